//! Preview compensation on a joint integrated in time: inversion, robustness, limits.

use super::*;
use crate::settings::settings;
use crate::virtual_joint::{JOINT, STEP_S, VirtualJoint, corners, differences, largest, rms};
use joint_dynamics::plant::{Mode, UncertainValue};
use proptest::prelude::*;

/// A model of the joint, with this relative uncertainty of its parameters.
pub(crate) fn model(joint: &VirtualJoint, sigma: f64) -> Plant {
    let number = |value: f64| UncertainValue { value, sigma: sigma * value };
    let positive = |value: f64| (value > 0.0).then(|| number(value));
    let mode = Mode {
        frequency_hz: number(joint.frequency_hz),
        damping_ratio: number(joint.damping_ratio),
        participation: UncertainValue { value: joint.participation, sigma: 0.0 },
    };
    Plant {
        delays_s: positive(joint.delay_s).into_iter().collect(),
        lags_s: positive(joint.lag_s).into_iter().collect(),
        modes: (joint.participation > 0.0).then_some(mode).into_iter().collect(),
    }
}

fn preview_of(plant: Plant, path: &[f64], settings: &Settings) -> Preview {
    let plants = Plants { joints: vec![plant], left_out: Vec::new() };
    preview(&plants, STEP_S, &[path.to_vec()], settings).expect("a path")
}

/// Errors of the virtual joint without and with the preview by a model.
fn errors(joint: &VirtualJoint, plant: Plant, path: &[f64]) -> [Vec<f64>; 2] {
    let preview = preview_of(plant, path, &settings());
    let error = |commanded: &[f64]| differences(path, &joint.run(STEP_S, commanded));
    [error(path), error(&preview.commanded[0])]
}

/// A second up and a second down, with continuous speed and acceleration.
fn smooth() -> Vec<f64> {
    let rest = std::iter::repeat_n(0.0, 250);
    let swing = (0..500).map(|k| {
        let phase = std::f64::consts::TAU * f64::from(k) / 500.0;
        0.1 * (1.0 - phase.cos()).powi(2)
    });
    rest.clone().chain(swing).chain(rest).collect()
}

#[test]
fn a_lag_is_inverted_exactly_where_the_band_allows() {
    let lag = VirtualJoint { delay_s: 0.0, lag_s: 0.03, participation: 0.0, ..JOINT };
    let [without, with] = errors(&lag, model(&lag, 0.0), &smooth());
    assert!(largest(&with) < 5e-4 * largest(&without), "{} {}", largest(&with), largest(&without));
}

#[test]
fn a_delay_of_a_fraction_of_a_sample_is_compensated() {
    let late = VirtualJoint { delay_s: 0.0307, lag_s: 0.0, participation: 0.0, ..JOINT };
    let [without, with] = errors(&late, model(&late, 0.0), &smooth());
    assert!(largest(&with) < 2e-3 * largest(&without), "{} {}", largest(&with), largest(&without));
}

#[test]
fn a_mode_of_eight_hertz_does_not_ring_after_a_corner() {
    let rings = VirtualJoint { delay_s: 0.0, lag_s: 0.0, ..JOINT };
    let path = corners(STEP_S, &[(0.1, 1.0), (-0.1, 1.0)]);
    let [without, with] = errors(&rings, model(&rings, 0.0), &path);
    let after = path.len() - 220..path.len();
    let (before, rest) = (rms(&without[after.clone()]), rms(&with[after]));
    assert!(before > 5e-5, "it rings at rest without: {before}");
    assert!(rest < 0.02 * before, "{before} {rest}");
}

#[test]
fn corners_are_followed_five_times_better_with_numbers_off_by_their_sigma() {
    let path = corners(STEP_S, &[(0.1, 1.0), (-0.1, 0.8), (0.05, 0.7), (0.0, 0.5), (-0.08, 0.6)]);
    for sign in [-1.0, 1.0] {
        let damping_ratio = JOINT.damping_ratio * (1.0 + 0.2 * sign);
        let believed = VirtualJoint { damping_ratio, ..JOINT.believed(1.0 + 0.03 * sign) };
        let [without, with] = errors(&JOINT, model(&believed, 0.03), &path);
        let (before, after) = (largest(&without), largest(&with));
        assert!(after < before / 5.0, "{before} {after}");
    }
}

#[test]
fn limits_hold_by_differences_for_any_request() {
    let tight = Settings::with_limits(2e-3, 0.02, 2.0).expect("sound");
    let path = corners(STEP_S, &[(0.5, 1.0), (-0.5, 1.0)]);
    let preview = preview_of(model(&JOINT, 0.03), &path, &tight);
    let c = differences(&preview.commanded[0], &path);
    let rounding = 1.0 + 1e-6;
    assert!(largest(&c) <= 2e-3 * rounding, "{}", largest(&c));
    assert!(c.windows(2).all(|c| (c[1] - c[0]).abs() <= 0.02 * STEP_S * rounding));
    let third = |c: &[f64]| (c[3] - 3.0 * c[2] + 3.0 * c[1] - c[0]) / STEP_S.powi(3);
    let jerk = c.windows(4).map(third).fold(0.0_f64, |most, jerk| most.max(jerk.abs()));
    assert!(jerk <= 2.0 * (1.0 + 1e-4), "{jerk}");
    let stepped = preview.joints[0].as_ref().expect("compensated");
    assert!(stepped.limited_rows > 0, "a correction that is held back is counted");
}

#[test]
fn the_reported_error_is_the_remaining_one() {
    let path = corners(STEP_S, &[(0.1, 1.0), (-0.1, 0.8)]);
    let preview = preview_of(model(&JOINT, 0.0), &path, &settings());
    let reached = JOINT.run(STEP_S, &preview.commanded[0]);
    let without = JOINT.run(STEP_S, &path);
    let reported = largest(&differences(&preview.with[0], &reached));
    let reported_without = largest(&differences(&preview.without[0], &without));
    let error = largest(&differences(&path, &without));
    assert!(
        reported < 0.02 * error && reported_without < 0.02 * error,
        "{reported} {reported_without} {error}"
    );
}

#[test]
fn a_model_without_dynamic_effects_is_refused() {
    let plants = Plants { joints: vec![Plant::default()], left_out: Vec::new() };
    let refused = preview(&plants, STEP_S, &[smooth()], &settings());
    assert_eq!(refused, Err(FeedforwardError::NothingInTime));
    let coarse = preview(
        &Plants { joints: vec![model(&JOINT, 0.0)], left_out: Vec::new() },
        0.02,
        &[smooth()],
        &settings(),
    );
    assert!(matches!(coarse, Err(FeedforwardError::Sampling { .. })), "{coarse:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn a_model_that_is_off_by_thirty_percent_makes_nothing_worse(
        delay_s in 0.0..0.04_f64, lag_s in 0.003..0.04_f64, frequency_hz in 5.0..15.0_f64, damping_ratio in 0.01..0.1_f64,
        participation in 0.2..1.0_f64, off_by in prop::array::uniform4(-0.3..0.3_f64), speeds in prop::array::uniform4(-0.2..0.2_f64),
    ) {
        let believed = VirtualJoint { delay_s, lag_s, frequency_hz, damping_ratio, participation };
        let truth = VirtualJoint {
            delay_s: delay_s * (1.0 + off_by[0]),
            lag_s: lag_s * (1.0 + off_by[1]),
            frequency_hz: frequency_hz * (1.0 + off_by[2]),
            damping_ratio: damping_ratio * (1.0 + off_by[3]),
            participation,
        };
        let path = corners(STEP_S, &speeds.map(|speed| (speed, 0.6)));
        let [without, with] = errors(&truth, model(&believed, 0.05), &path);
        prop_assert!(rms(&with) <= 1.005 * rms(&without), "{} {}", rms(&with), rms(&without));
    }
}
