//! Recordings with known tones, gaps, pulses and paths.

use super::*;
use crate::config::{Mode, MonitorConfig};
use crate::verdict::{Class, State};
use crate::welch::{Segments, welch};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::TAU;

fn noise(samples: usize, sigma: f64, seed: u64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..samples).map(|_| sigma * rng.sample::<f64, _>(StandardNormal)).collect()
}

fn lines_of(x: &[f64], rate_hz: f64, length: usize) -> Vec<Line> {
    AveragedSpectrum::from_runs([x], &Segments::new(rate_hz, length)).expect("a spectrum").lines()
}

#[test]
fn tones_between_the_bins_are_found_with_frequency_and_amplitude() {
    let mut x = noise(32_000, 1.0, 1);
    for (i, x) in x.iter_mut().enumerate() {
        let t = i as f64 / 2000.0;
        *x += 2.0 * (TAU * 71.37 * t).sin() + 0.5 * (TAU * 300.0 * t).sin();
    }
    let found = lines_of(&x, 2000.0, 2000);
    assert_eq!(found.len(), 2, "{found:?}");
    for (line, (frequency, amplitude)) in found.iter().zip([(71.37, 2.0), (300.0, 0.5)]) {
        assert!((line.frequency - frequency).abs() < 0.05, "{line:?}");
        assert!((line.amplitude / amplitude - 1.0).abs() < 0.05, "{line:?}");
    }
}

#[test]
fn noise_of_any_colour_and_a_short_burst_make_no_false_lines() {
    for seed in 0..10 {
        for length in [256, 1024, 8192] {
            let white = noise(16_384, 1.0, seed);
            let mut brown = 0.0;
            let coloured: Vec<f64> = white
                .iter()
                .map(|x| {
                    brown = 0.95 * brown + x;
                    brown
                })
                .collect();
            for x in [&white, &coloured] {
                let found = lines_of(x, 1000.0, length);
                assert!(found.is_empty(), "{seed} {length}: {found:?}");
            }
        }
    }
    // Noise that is loud for a tenth of the time only is averaged less often than there are segments.
    for seed in 20..30 {
        let mut x = noise(40_000, 0.05, seed);
        for (x, loud) in x[9000..13_000].iter_mut().zip(noise(4000, 3.0, seed + 50)) {
            *x += loud;
        }
        let found = lines_of(&x, 1000.0, 1024);
        assert!(found.is_empty(), "{seed}: {found:?}");
    }
    let burst: Vec<f64> = noise(16_384, 0.01, 3)
        .iter()
        .enumerate()
        .map(|(i, x)| {
            x + if (5000..6500).contains(&i) { (TAU * 0.08 * i as f64).sin() } else { 0.0 }
        })
        .collect();
    let found = lines_of(&burst, 1000.0, 2048);
    assert!(found.iter().all(|line| (line.frequency - 80.0).abs() < 4.0), "{found:?}");
}

#[test]
fn the_mean_over_one_run_is_welchs_and_short_runs_are_left_out() {
    let (x, short) = (noise(5000, 1.0, 12), noise(100, 9.0, 13));
    let plan = Segments::new(1000.0, 512);
    let averaged = AveragedSpectrum::from_runs([x.as_slice(), &short], &plan).expect("a spectrum");
    let known = welch(&x, &plan).expect("a spectrum");
    assert_eq!(averaged.mean.averages, known.averages);
    for (a, b) in averaged.mean.power.iter().zip(&known.power) {
        assert!((a / b - 1.0).abs() < 1e-12);
    }
    assert!(AveragedSpectrum::from_runs([short.as_slice()], &plan).is_err());
}

#[test]
fn a_sensor_of_one_axis_is_heard_without_a_fault() {
    let rate_hz = 2000.0;
    for count in [1, 2] {
        let mut x = noise(12_000, 1.0, 4);
        let quiet = noise(12_000, 1.0, 5);
        for (i, x) in x.iter_mut().enumerate().skip(6000) {
            *x += 6.0 * (TAU * 72.0 * i as f64 / rate_hz).sin();
        }
        let config = MonitorConfig {
            rate_hz,
            channels: count,
            modes: vec![Mode::at_hz(70.0)],
            band_hz: [10.0, 800.0],
            ..MonitorConfig::default()
        };
        let mut watch = VibrationMonitor::new(config).expect("a good configuration");
        let both: [&[f64]; 2] = [&quiet, &x];
        let channels = &both[2 - count..];
        let piece = Piece { start_s: 10.0, channels };
        let result = run_monitor(&mut watch, rate_hz, &[piece], |_, _| ProcessState::default());
        assert!(result.findings.is_empty() && !result.still_learning, "{:?}", result.findings);
        let alarm =
            result.events.iter().find(|e| e.verdict.state == State::Alarm).expect("an alarm");
        assert!((13.0..13.3).contains(&alarm.t_s), "{alarm:?}");
        assert_eq!(
            (alarm.verdict.axis.channel(), alarm.verdict.class),
            (count - 1, Class::Chatter)
        );
        assert!(result.events.iter().all(|e| e.t_s > 12.9), "{:?}", result.events);
    }
}

#[test]
fn a_hole_between_pieces_restarts_the_windows_and_times_stay_true() {
    let rate_hz = 1000.0;
    let first = noise(5000, 1.0, 6);
    let mut second = noise(5000, 1.0, 7);
    for (i, x) in second.iter_mut().enumerate().skip(2000) {
        *x += 8.0 * (TAU * 90.0 * i as f64 / rate_hz).sin();
    }
    let mut watch =
        VibrationMonitor::new(MonitorConfig { rate_hz, channels: 1, ..MonitorConfig::default() })
            .expect("a good configuration");
    let (a, b): ([&[f64]; 1], [&[f64]; 1]) = ([&first], [&second]);
    let pieces = [Piece { start_s: 0.0, channels: &a }, Piece { start_s: 1.0, channels: &b }];
    let result = run_monitor(&mut watch, rate_hz, &pieces, |_, _| ProcessState::default());
    let first = result.events.first().expect("the tone is result");
    assert!((3.0..3.2).contains(&first.t_s), "time that starts anew is the piece's own: {first:?}");
    assert!(result.findings.is_empty(), "{:?}", result.findings);
}

#[test]
fn samples_that_were_not_taken_and_a_stuck_channel_are_found_with_their_time() {
    let rate_hz = 1000.0;
    let mut x = noise(6000, 1.0, 8);
    x[3000] = f64::NAN;
    x[4000..].fill(2.5);
    let mut watch =
        VibrationMonitor::new(MonitorConfig { rate_hz, channels: 1, ..MonitorConfig::default() })
            .expect("a good configuration");
    let channels: [&[f64]; 1] = [&x];
    let piece = Piece { start_s: 0.0, channels: &channels };
    let result = run_monitor(&mut watch, rate_hz, &[piece], |_, _| ProcessState::default());
    let finding = |fault| result.findings.iter().find(|f| f.fault == fault).expect("it is found");
    assert!((finding(Fault::NotFinite).from_s - 3.0).abs() < 0.01);
    assert!((finding(Fault::Stuck).from_s - 4.1).abs() < 0.05 && finding(Fault::Stuck).to_s > 5.9);
}

#[test]
fn a_permanent_line_is_judged_by_its_frequency() {
    let config = MonitorConfig {
        rate_hz: 1000.0,
        modes: vec![Mode::at_hz(67.0)],
        ..MonitorConfig::default()
    };
    let mut watch = VibrationMonitor::new(config).expect("a good configuration");
    watch.set_process_state(ProcessState {
        spindle_rpm: 28_000.0,
        teeth: 2,
        ..ProcessState::default()
    });
    // The speed applies once samples have arrived.
    let quiet = noise(2000, 1.0, 9);
    let channels: [&[f64]; 3] = [&quiet, &quiet, &quiet];
    let state = ProcessState { spindle_rpm: 28_000.0, teeth: 2, ..ProcessState::default() };
    run_monitor(&mut watch, 1000.0, &[Piece { start_s: 0.0, channels: &channels }], |_, _| state);
    let verdict_at = |hz: f64| {
        let standing =
            LineConditions { process: state, spindle_rpm: [28_000.0; 2], uncertainty_hz: 0.05 };
        watch.classify_steady_line(Axis::Y, hz, &standing)
    };
    let alias = verdict_at(66.7);
    assert!(alias.suspect_alias && alias.class == Class::Forced, "{alias:?}");
    assert_eq!(verdict_at(466.7).class, Class::Forced);
    assert_eq!(verdict_at(150.0).class, Class::Electrical);
    assert!(!verdict_at(466.7).suspect_alias);
    let varied = |hz: f64| {
        let process = ProcessState { spindle_rpm: 1200.0, ..ProcessState::default() };
        let standing =
            LineConditions { process, spindle_rpm: [1180.0, 1220.0], uncertainty_hz: 0.05 };
        watch.classify_steady_line(Axis::Y, hz, &standing)
    };
    assert_eq!(varied(80.9).class, Class::Forced, "within the range of its multiple");
    assert_eq!(varied(88.0).class, Class::Unknown);
    let high = varied(411.0);
    assert!(high.class == Class::Unknown && high.alternatives.contains(Class::Forced), "{high:?}");
}

#[test]
fn speed_is_read_from_pulses_and_ends_with_them() {
    let pulse = |i: usize| if i < 5000 && i % 50 < 5 { 3.0 } else { -0.5 };
    let tacho: Vec<f64> = (0..8000).map(pulse).collect();
    let speed = speed_from_pulses(&tacho, 1000.0);
    assert_eq!((speed[20], speed[200], speed[4999]), (0.0, 1200.0, 1200.0));
    assert_eq!(speed[7000], 0.0, "no pulse comes any more");
    let missed: Vec<f64> =
        tacho.iter().enumerate().map(|(i, x)| if i / 50 % 7 == 3 { -0.5 } else { -x }).collect();
    let speed = speed_from_pulses(&missed, 1000.0);
    assert!(
        speed[400..4900].iter().all(|rpm| *rpm == 1200.0 || *rpm == 0.0),
        "pulses down, some missed"
    );
    assert!(speed[400..4900].iter().filter(|rpm| **rpm == 0.0).count() < 100);
    let fast: Vec<f64> =
        (0..4000).map(|i| f64::from((f64::from(i) * 0.0467).fract() < 0.2)).collect();
    let speed = speed_from_pulses(&fast, 10_000.0);
    assert!(
        speed[2500..].iter().all(|rpm| (rpm / 28_020.0 - 1.0).abs() < 1e-3),
        "whole samples do not count"
    );
    assert!(speed_from_pulses(&[1.0; 100], 1000.0).is_empty());
    assert!(speed_from_pulses(&[f64::NAN; 100], 1000.0).is_empty());
}

#[test]
fn a_trackers_noise_does_not_lengthen_the_path() {
    let jitter = noise(60_000, 0.03, 10);
    let position: Vec<[f64; 3]> = (0..20_000)
        .map(|i| {
            let s = 5.0 * i as f64 / 1000.0;
            if i % 500 == 7 {
                [f64::NAN; 3]
            } else {
                [0.6 * s + jitter[i], 0.8 * s + jitter[i + 20_000], jitter[i + 40_000]]
            }
        })
        .collect();
    let path = path_mm(&position, 1000.0);
    assert!((path[19_999] - path[0] - 99.995).abs() < 0.3, "{}", path[19_999] - path[0]);
    assert!(path.windows(2).all(|pair| pair[1] >= pair[0]));
    let feed = feed_along_path(&path, 1000.0);
    assert!(feed.iter().all(|feed| (feed - 5.0).abs() < 0.3));
    assert!(path_mm(&[[0.0; 3]; 3], 1000.0).is_empty());
}
