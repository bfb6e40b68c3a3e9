//! Limits of commands, by differences, and the limit that is named.

use super::*;
use proptest::prelude::*;

const STEP_S: f64 = 4e-3;

fn limits(position: f64, rate: f64, jerk: f64) -> Limits {
    Limits::new(position, rate, jerk).expect("sound")
}

/// A path that starts and ends at rest, and a correction of it.
fn ramp(speed: f64) -> (Vec<f64>, Vec<f64>) {
    let at = |k: i32| speed * STEP_S * f64::from((k - 100).clamp(0, 200));
    let path: Vec<f64> = (0..400).map(at).collect();
    let ahead = |k: usize| path[(k + 8).min(399)] - path[k];
    let request: Vec<f64> = (0..400).map(|k| 1.5 * ahead(k)).collect();
    // Corners of a request are as smooth as its bandwidth.
    let request = smoothed(&smoothed(&request, 3), 3);
    (path, request)
}

fn fastest(path: &[f64], correction: &[f64]) -> f64 {
    let commands: Vec<f64> = path.iter().zip(correction).map(|(p, c)| p + c).collect();
    commands.windows(2).map(|ends| (ends[1] - ends[0]).abs() / STEP_S).fold(0.0, f64::max)
}

#[test]
fn a_command_keeps_the_speed_of_the_joint_and_the_rows_say_so() {
    let (path, request) = ramp(0.1);
    let wide = limits(0.2, 1.0, 5000.0);
    assert!(fastest(&path, &request) > 0.13, "the request is too fast");
    let bounds = JointBounds { speed: 0.11, ..JointBounds::NONE };
    let Bounded { correction, limited } = bounded(&path, &request, (&bounds, &wide), STEP_S);
    assert!(fastest(&path, &correction) <= 0.11 * (1.0 + 1e-6), "{}", fastest(&path, &correction));
    let differ = request.iter().zip(&correction).filter(|(r, c)| r != c).count();
    assert_eq!(limited.iter().flatten().count(), differ);
    let by_speed = limited.iter().filter(|by| **by == Some(LimitedBy::JointSpeed)).count();
    assert!(by_speed > differ * 9 / 10, "{by_speed} of {differ}");
    let largest = |c: &[f64]| c.iter().fold(0.0_f64, |largest, c| largest.max(c.abs()));
    assert!(
        differ > 10 && largest(&correction) > 0.5 * largest(&request),
        "{differ} {}",
        largest(&correction)
    );
}

#[test]
fn a_command_keeps_the_position_of_the_joint() {
    let (path, request) = ramp(0.1);
    let bounds = JointBounds { position: (0.0, 0.0805), ..JointBounds::NONE };
    let wide = limits(0.2, 1.0, 5000.0);
    let swing: Vec<f64> = (0..400).map(|k| 5e-3 * (f64::from(k) / 30.0).sin()).collect();
    for request in [request, swing] {
        let Bounded { correction, limited } = bounded(&path, &request, (&bounds, &wide), STEP_S);
        let inside = |(p, c): (&f64, &f64)| (-1e-12..=0.0805 + 1e-12).contains(&(p + c));
        assert!(path.iter().zip(&correction).all(inside));
        assert!(
            limited.iter().flatten().any(|by| *by == LimitedBy::JointLimit) || request[50] == 0.0
        );
    }
}

#[test]
fn the_limit_of_the_correction_that_binds_is_named() {
    let (path, request) = ramp(0.1);
    for (limits, by) in [
        (limits(1e-3, 1.0, 5000.0), LimitedBy::MaxMrad),
        (limits(0.2, 0.05, 5000.0), LimitedBy::MaxRate),
        (limits(0.2, 1.0, 10.0), LimitedBy::MaxJerk),
    ] {
        let bounded = bounded(&path, &request, (&JointBounds::NONE, &limits), STEP_S);
        let rows = |by| bounded.limited.iter().filter(|found| **found == Some(by)).count();
        assert!(rows(by) > 0, "{by:?}");
        let others = [LimitedBy::JointLimit, LimitedBy::JointSpeed];
        assert!(others.into_iter().all(|other| rows(other) == 0));
    }
}

#[test]
fn a_path_that_is_too_fast_by_itself_is_counted_and_not_made_faster() {
    let (path, request) = ramp(0.12);
    let bounds = JointBounds { speed: 0.11, ..JointBounds::NONE };
    let (rows, speed) = bounds.too_fast(&path, STEP_S);
    assert_eq!((rows.len(), rows[0]), (200, 101));
    assert!((speed - 0.12).abs() < 1e-9);
    let bounded = bounded(&path, &request, (&bounds, &limits(0.2, 1.0, 5000.0)), STEP_S);
    assert!(fastest(&path, &bounded.correction) <= 0.12 * (1.0 + 1e-6));
}

proptest! {
    #[test]
    fn any_request_is_kept_within_every_limit_and_a_harmless_one_bit_for_bit(
        speed in 0.02..0.3_f64, most in 0.1..0.5_f64, size in 0.0..0.05_f64, hz in 0.5..20.0_f64,
        rate in 0.05..2.0_f64, jerk in 1.0..1e4_f64,
    ) {
        let (path, _) = ramp(speed);
        let window = |k: f64| (std::f64::consts::PI * (k / 399.0)).sin().powi(2);
        let at = |k: u32| size * window(f64::from(k)) * (std::f64::consts::TAU * hz * f64::from(k) * STEP_S).sin();
        let request: Vec<f64> = (0..400).map(at).collect();
        let bounds = JointBounds { position: (-0.02, 0.8 * speed + 0.02), speed: most };
        let limits = limits(0.03, rate, jerk);
        let Bounded { correction, limited } = bounded(&path, &request, (&bounds, &limits), STEP_S);
        let rounding = 1.0 + 1e-6;
        prop_assert!(fastest(&path, &correction) <= most.max(speed) * rounding);
        prop_assert!(path.iter().zip(&correction).all(|(p, c)| (-0.02 - 1e-9..=0.8 * speed + 0.02 + 1e-9).contains(&(p + c))));
        prop_assert!(correction.iter().all(|c| c.abs() <= 0.03 * rounding));
        prop_assert!(correction.windows(2).all(|c| (c[1] - c[0]).abs() <= rate * STEP_S * rounding));
        for (row, by) in limited.iter().enumerate() {
            prop_assert_eq!(by.is_none(), correction[row] == request[row]);
        }
    }
}
