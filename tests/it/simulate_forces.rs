//! `trued simulate` in the force domain: sensor readings of a recorded cut, without a robot.

use std::f64::consts::PI;
use std::fmt::Write as _;

use recording::series::{Channel, Recording, RequiredData, read};

use crate::program::Place;

const RATE_HZ: f64 = 10_000.0;
const SPINDLE_HZ: f64 = 50.0;
const FEED_MM_S: f64 = 4.0;
/// Number of rows per turn, an integer.
const TURN: usize = (RATE_HZ / SPINDLE_HZ) as usize;

pub(crate) const CUT: &str = r#"
[cut]
teeth = 2
diameter_mm = 6.0
axial_depth_mm = 0.25
coefficients_N_per_mm2 = [800.0, 300.0, 150.0]
coefficients_N_per_mm = [8.0, 10.0, 2.0]
"#;

fn place(cut: &str, effects: &str) -> Place {
    let place = Place::new();
    let mut text = "t_s,spindle_rpm,feed_mm_s,fx_N,fy_N,fz_N\n".to_owned();
    for row in 0..10 * TURN {
        let feed = if row < TURN { 0.0 } else { FEED_MM_S };
        writeln!(text, "{},{},{feed},1,1,", row as f64 / RATE_HZ, 60.0 * SPINDLE_HZ).unwrap();
    }
    place.file("cut.csv", &text);
    place.file("cut.toml", &format!("schema = \"trued.recording/1\"\n{cut}"));
    let model = include_str!("../../trued/src/no_arm.toml");
    place.file("sensor.toml", &format!("{model}\n{effects}"));
    place
}

fn simulated(place: &Place, more: &[&str]) -> Recording {
    let mut arguments = vec!["simulate", "--overwrite", "--out", "made", "cut.csv"];
    arguments.extend(more);
    place.succeed(&arguments);
    read(&place.path("made.csv"), None, RequiredData::Samples).expect("a recording")
}

/// The mean of a channel over nine turns of cut, N.
fn mean(recording: &Recording, axis: usize) -> f64 {
    let force = &recording.column(Channel::Wrench(axis)).expect("simulated")[TURN..];
    force.iter().sum::<f64>() / force.len() as f64
}

#[test]
fn a_slot_exerts_the_mean_forces_of_the_closed_form_and_air_none() {
    let made = simulated(&place(CUT, ""), &[]);
    let feed_per_tooth_mm = FEED_MM_S / (2.0 * SPINDLE_HZ);
    let (n, a) = (2.0, 0.25);
    let expected = [
        -n * a / 4.0 * 300.0 * feed_per_tooth_mm - n * a / PI * 10.0,
        n * a / 4.0 * 800.0 * feed_per_tooth_mm + n * a / PI * 8.0,
        n * a / PI * 150.0 * feed_per_tooth_mm + n * a / 2.0 * 2.0,
    ];
    for (axis, expected) in expected.into_iter().enumerate() {
        // This number of samples per turn: the jump of the edge force at a tooth's entry is between
        // two of them.
        let found = mean(&made, axis);
        assert!((found - expected).abs() < 0.02 * 5.0, "{axis}: {found} {expected}");
        let air = &made.column(Channel::Wrench(axis)).unwrap()[..TURN];
        assert!(air.iter().all(|force| *force == 0.0), "{axis}");
    }
}

#[test]
fn turning_pushes_evenly() {
    let turning = CUT.replace("teeth = 2", "operation = \"turning\"\nteeth = 1");
    let made = simulated(&place(&turning, ""), &[]);
    let feed_mm = FEED_MM_S / SPINDLE_HZ;
    let expected = 0.25 * (800.0 * feed_mm + 8.0);
    let force = &made.column(Channel::Wrench(1)).unwrap()[TURN..];
    assert!(force.iter().all(|force| (force - expected).abs() < 1e-9), "{expected}");
    let twice = place(&turning.replace("teeth = 1", "teeth = 2"), "");
    let output = twice.run(&["simulate", "--out", "made", "cut.csv"]);
    assert_eq!(output.code, Some(2), "a turning tool of two teeth");
}

#[test]
fn every_effect_of_cutter_and_sensor_changes_what_is_read() {
    let exact = simulated(&place(CUT, ""), &[]);
    for (kind, numbers) in [
        ("edge_force", "coefficient_N_per_mm = [4.0, 0.0, 0.0]"),
        ("cutting_force", "coefficient_N_per_mm2 = [50.0, 20.0, 5.0]"),
        ("tool_wear", "growth_per_m = 200.0"),
        ("runout", "radial_um = 5.0\nphase_rad = 0.3"),
        ("chatter", "frequency_Hz = 684.0\namplitude_N = 3.0"),
        ("cross_talk", "matrix = [0, 0.03, 0, 0, 0, 0, 0, 0, 0]"),
        ("wrench_bias", "bias_N = [1.0, -2.0, 0.5]"),
        ("wrench_scale", "scale = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]"),
        ("wrench_misalignment", "turn_mrad = [0.0, 0.0, 40.0]"),
        ("tool_compliance", "compliance_um_per_N = [0.0, 0.0, 5.0]"),
    ] {
        let place = place(CUT, &format!("[[effect]]\nkind = \"{kind}\"\n{numbers}\n"));
        let made = simulated(&place, &["--model", "sensor.toml"]);
        let apart = (0..3).map(|axis| {
            let [a, b] = [&made, &exact].map(|r| r.column(Channel::Wrench(axis)).unwrap());
            a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        });
        let apart = apart.fold(0.0, f64::max);
        assert!(apart > 0.01, "{kind} changes nothing: {apart} N");
    }
}

#[test]
fn noise_of_forces_is_of_the_requested_size_and_a_cut_without_a_speed_is_an_error() {
    let place = place(CUT, "");
    let exact = simulated(&place, &[]);
    let noisy = simulated(&place, &["--seed", "3", "--force-noise", "0.4"]);
    assert_eq!(noisy.sigma(Channel::Wrench(0)), Some(0.4));
    let [a, b] = [&noisy, &exact].map(|r| r.column(Channel::Wrench(1)).unwrap());
    let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    let rms = (square / a.len() as f64).sqrt();
    assert!((rms / 0.4 - 1.0).abs() < 0.1, "{rms} N");
    let lengths = ["simulate", "--overwrite", "--out", "made", "--noise", "1", "cut.csv"];
    let done = place.run(&lengths);
    assert!(done.code == Some(2) && done.err.contains("lengths and angles"), "{done:#?}");
    place.file("bare.csv", "t_s,fx_N\n0,1\n0.1,1\n");
    place.file("bare.toml", &format!("schema = \"trued.recording/1\"\n{CUT}"));
    let output = place.run(&["simulate", "--out", "bare-made", "bare.csv"]);
    assert_eq!(output.code, Some(2));
    assert!(output.err.contains("spindle_rpm"));
}
