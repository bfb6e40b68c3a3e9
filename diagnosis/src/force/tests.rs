//! Synthetic signals: air, a cut and air again, with a sensor bias and lines of known cause.

use recording::model::RobotModel;
use recording::series::{Channel, Recording};
use std::f64::consts::TAU;

use super::{Cause, Diagnosis, DiagnosisError, Finding, State};
use crate::diagnose::Verdict;

/// A tool not in contact.
pub(super) const NO_ARM: &str = r#"
schema = "trued.model/1"
name = "no arm"

[[joint]]
kind = "prismatic"
axis = [0.0, 0.0, 1.0]
limits_mm = [-1.0, 1.0]

[tool]
tcp_mm = [0.0, 0.0, 0.0]
"#;

fn diagnose(recording: &Recording) -> Result<Diagnosis, DiagnosisError> {
    let model = RobotModel::parse("no arm", NO_ARM).expect("sound");
    super::diagnose(&model.physics, &[], recording)
}

const RATE_HZ: f64 = 5000.0;
const BIAS: [f64; 3] = [5.0, -3.0, 0.0];
const MEAN: [f64; 3] = [120.0, 80.0, 300.0];

/// Uniform white noise with a standard deviation of one.
fn noise(k: usize) -> f64 {
    let mut x = (k as u64).wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    x ^= x >> 29;
    x = x.wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x ^= x >> 32;
    (x as f64 / u64::MAX as f64 - 0.5) * 12_f64.sqrt()
}

/// One second of air, entry over 0.2 s, cut until 3 s, exit over 0.1 s, air; `tone`: frequency in Hz and amplitude in N in the cut, `hum` at all
/// times.
fn made(tone: (f64, f64), hum: (f64, f64), spindle_rpm: Option<f64>) -> Recording {
    let rows = (4.5 * RATE_HZ) as usize;
    let t_s: Vec<f64> = (0..rows).map(|k| k as f64 / RATE_HZ).collect();
    let mut recording = Recording::new(t_s.clone());
    for axis in 0..3 {
        let value = |k: usize| {
            let t = t_s[k];
            let inside = ((t - 1.0) / 0.2).clamp(0.0, 1.0) * ((3.1 - t) / 0.1).clamp(0.0, 1.0);
            let swing = |(hz, size): (f64, f64)| size * (TAU * hz * t).sin();
            BIAS[axis]
                + inside * (MEAN[axis] + 3.0 * noise(7 * k + axis) + swing(tone))
                + swing(hum)
                + noise(3 * k + axis)
        };
        recording.set(Channel::Wrench(axis), (0..rows).map(value).collect());
    }
    if let Some(rpm) = spindle_rpm {
        recording.set(Channel::Spindle, vec![rpm; rows]);
    }
    recording
}

#[test]
fn air_entry_cut_and_exit_are_told_apart_where_they_are() {
    let found = diagnose(&made((0.0, 0.0), (0.0, 0.0), None)).expect("sound");
    let states: Vec<State> = found.phases.iter().map(|phase| phase.state).collect();
    assert_eq!(states, [State::Air, State::Entry, State::Cut, State::Exit, State::Air]);
    let is_close = |a: f64, b: f64| (a - b).abs() < 0.08;
    let cut = &found.phases[2];
    assert!(
        is_close(found.phases[0].to_s, 1.0)
            && is_close(cut.from_s, 1.17)
            && is_close(cut.to_s, 3.01),
        "{:?}",
        found.phases
    );
    for axis in 0..3 {
        assert!((cut.mean[axis] - BIAS[axis] - MEAN[axis]).abs() < 3.0, "{:?}", cut.mean);
    }
}

#[test]
fn what_the_sensor_reads_in_air_is_its_bias_with_an_interval_that_holds_it() {
    let found = diagnose(&made((0.0, 0.0), (0.0, 0.0), None)).expect("sound");
    assert_eq!(found.verdict, Verdict::MissingPhysics);
    let [Finding::Bias { force, sigma, heldout, .. }] = found.findings[..] else {
        panic!("{:?}", found.findings)
    };
    for axis in 0..3 {
        assert!((force[axis] - BIAS[axis]).abs() < 4.0 * sigma[axis] + 0.02, "{force:?} {sigma:?}");
    }
    assert!(heldout[1] < 1.1 && heldout[0] > 3.0, "{heldout:?}");
}

#[test]
fn a_tone_of_the_cut_that_nothing_forces_is_chatter_and_a_hum_of_the_mains_is_not() {
    let found = diagnose(&made((684.0, 15.0), (150.0, 20.0), Some(5000.0))).expect("sound");
    let chatter = found.findings.iter().find_map(|one| match one {
        Finding::Chatter { line, is_speed_known, .. } => Some((line, *is_speed_known)),
        Finding::Bias { .. } => None,
    });
    let (tone, is_alone) = chatter.expect("chatter");
    assert!((tone.frequency_hz - 684.0).abs() < 1.0 && (tone.amplitude / 15.0 - 1.0).abs() < 0.1);
    assert!(is_alone, "the spindle's speed is known");
    let hum = found.spectral_lines.iter().find(|tone| (tone.frequency_hz - 150.0).abs() < 1.0);
    assert_eq!(hum.map(|tone| tone.cause), Some(Cause::Air));
}

#[test]
fn a_multiple_of_the_spindles_speed_is_no_chatter() {
    let found = diagnose(&made((8.0 * 85.5, 15.0), (0.0, 0.0), Some(60.0 * 85.5))).expect("sound");
    assert!(!found.findings.iter().any(|one| matches!(one, Finding::Chatter { .. })));
    assert_eq!(found.spectral_lines.first().map(|tone| tone.cause), Some(Cause::Spindle(8)));
    // Above half the sampling rate, the line appears aliased.
    let folded = made((5000.0 - 40.0 * 85.5, 15.0), (0.0, 0.0), Some(60.0 * 85.5));
    let found = diagnose(&folded).expect("sound");
    assert!(!found.findings.iter().any(|one| matches!(one, Finding::Chatter { .. })));
}

#[test]
fn without_a_speed_chatter_is_not_claimed() {
    let found = diagnose(&made((684.0, 15.0), (0.0, 0.0), None)).expect("sound");
    assert_eq!(found.verdict, Verdict::Undetermined);
}

#[test]
fn even_noise_holds_no_cut_and_no_finding() {
    let mut recording = Recording::new((0..20_000).map(|k| k as f64 / RATE_HZ).collect());
    recording.set(Channel::Wrench(0), (0..20_000).map(noise).collect());
    let found = diagnose(&recording).expect("sound");
    assert_eq!(found.phases.iter().map(|p| p.state).collect::<Vec<_>>(), [State::Unknown]);
    assert!(found.findings.is_empty() && found.verdict == Verdict::Undetermined);
}

#[test]
fn what_is_empty_constant_or_short_is_doubted() {
    let even = |rows: usize| Recording::new((0..rows).map(|k| k as f64 / RATE_HZ).collect());
    let mut recording = even(5000);
    recording.set(Channel::Wrench(0), vec![f64::NAN; 5000]);
    assert_eq!(diagnose(&recording).err(), Some(DiagnosisError::Empty));
    recording.set(Channel::Wrench(1), vec![4.0; 5000]);
    assert_eq!(diagnose(&recording).err(), Some(DiagnosisError::Constant));
    let mut short = even(300);
    short.set(Channel::Wrench(0), (0..300).map(noise).collect());
    assert!(matches!(diagnose(&short).err(), Some(DiagnosisError::TooShort { rows: 300, .. })));
}

#[test]
fn an_amplifier_at_its_limit_is_said_and_nothing_is_claimed_and_a_coarse_digit_is_none() {
    let whole = made((684.0, 15.0), (0.0, 0.0), Some(5130.0));
    let values = whole.column(Channel::Wrench(0)).expect("forces").to_vec();
    let most = values.iter().fold(0.0, |most, x| f64::max(most, x.abs()));
    let mut cut_off = whole.clone();
    let limited = values.iter().map(|x| x.clamp(-0.6 * most, 0.6 * most));
    cut_off.set(Channel::Wrench(0), limited.collect());
    assert!(matches!(diagnose(&cut_off).err(), Some(DiagnosisError::Saturated { .. })));
    let mut coarse = whole;
    coarse.set(Channel::Wrench(0), values.iter().map(|x| (x / 3.0).round() * 3.0).collect());
    assert!(diagnose(&coarse).is_ok());
}
