//! Clocks, frames and refused measurements.

use super::*;
use crate::settings::settings;
use crate::virtual_joint::STEP_S;
use physics::frame::rotation_from_vector;
use recording::model::RobotModel;
use std::path::Path;

const ROWS: usize = 600;

fn arm() -> Arm {
    RobotModel::read(Path::new("irb1600-6-145")).expect("a preset").physics.arm
}

/// Of a robot with a delay of 30 ms.
const TIMING: Timing = Timing { lag_s: 0.03, sigma_s: 5e-4 };

fn times_s() -> Vec<f64> {
    (0..ROWS).map(|k| k as f64 * STEP_S).collect()
}

/// A motion of all joints at a time, rad.
fn at(t_s: f64) -> [f64; 6] {
    let t_s = t_s.clamp(0.3, 2.0) - 0.3;
    [0.1, -0.2, 0.3, 0.2, 0.5, 0.0].map(|q| q + 0.1 * (1.0 - (2.0 * t_s + q).cos()))
}

fn path(late_s: f64) -> Vec<Vec<f64>> {
    (0..6).map(|joint| times_s().iter().map(|t_s| at(t_s - late_s)[joint]).collect()).collect()
}

fn expected<'a>(
    arm: &'a Arm,
    times_s: &'a [f64],
    path: &'a [Vec<f64>],
    error: &'a [Vec<f64>],
) -> Expected<'a> {
    Expected { arm, times_s, motors: path, links: path, tool: path, error, timing: TIMING }
}

fn of_links(path: &[Vec<f64>], ahead_s: f64) -> Recording {
    let mut recording = Recording::new(times_s().iter().map(|t_s| t_s - ahead_s).collect());
    for (joint, q) in path.iter().enumerate() {
        recording.set(Channel::Link(joint), q.clone());
    }
    recording
}

#[test]
fn an_unknown_clock_is_found_beside_the_delay_that_the_model_expects() {
    let (arm, times_s, wanted) = (arm(), times_s(), path(0.0));
    let reached = path(0.03);
    let error: Vec<Vec<f64>> = wanted
        .iter()
        .zip(&reached)
        .map(|(w, r)| w.iter().zip(r).map(|(w, r)| w - r).collect())
        .collect();
    let recording = of_links(&reached, 0.1234);
    let expected = expected(&arm, &times_s, &wanted, &error);
    let found =
        MeasuredErrors::of(&recording, expected, Clock::Unknown, &settings()).expect("found");
    assert!((found.clock_offset_s - 0.1234).abs() < 2e-4, "{}", found.clock_offset_s);
    let (quantity, errors) = found.joints[1].as_ref().expect("measured");
    assert_eq!(*quantity, MeasuredQuantity::Link);
    let error_max = errors.iter().zip(&error[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(error_max < 1e-4, "{error_max}");
}

#[test]
fn a_clock_that_is_late_by_more_than_any_plausible_delay_is_refused_and_by_less_is_measured() {
    let (arm, times_s, wanted) = (arm(), times_s(), path(0.0));
    let reached = path(0.03);
    let differ = |(w, r): (&Vec<f64>, &Vec<f64>)| w.iter().zip(r).map(|(w, r)| w - r).collect();
    let error: Vec<Vec<f64>> = wanted.iter().zip(&reached).map(differ).collect();
    let expected = expected(&arm, &times_s, &wanted, &error);
    let of = |late_s: f64, clock| {
        MeasuredErrors::of(&of_links(&reached, -late_s), expected, clock, &settings())
    };
    for late_s in [0.0, 0.006, -0.006] {
        let found = of(late_s, Clock::Offset(0.0)).expect("within 30 % of the delay");
        assert!((found.late_s - late_s).abs() < 1e-4, "{} {late_s}", found.late_s);
    }
    for late_s in [0.015, 0.03, 0.05, -0.03] {
        let refused = of(late_s, Clock::Offset(0.0)).expect_err("another clock");
        let FeedforwardError::ClockMismatch { excess_ms, is_late, most_ms } = refused else {
            panic!("{refused}")
        };
        assert!((excess_ms - 1e3 * late_s.abs()).abs() < 0.2 && is_late == (late_s > 0.0));
        assert!((most_ms - 10.0).abs() < 1e-9);
        assert!(refused.to_string().contains("--clock-offset-ms unknown"));
        let found = of(late_s, Clock::Unknown).expect("estimated");
        assert!((found.clock_offset_s + late_s).abs() < 2e-4, "{}", found.clock_offset_s);
    }
}

#[test]
fn points_in_an_unknown_frame_become_the_joints_that_move_the_tool_there() {
    let (arm, times_s, wanted) = (arm(), times_s(), path(0.0));
    let mut reached = wanted.clone();
    // An oscillation of joint 1, which no rigid motion of the frame can represent.
    for (k, q) in reached[0].iter_mut().enumerate() {
        *q += 2e-3 * (0.05 * k as f64).sin();
    }
    let turn = rotation_from_vector(DVec3::new(0.3, -0.8, 0.5));
    let quantity: Vec<DVec3> =
        points(&arm, &reached).iter().map(|p| turn * *p + DVec3::new(3.0, 1.0, 0.2)).collect();
    let mut recording = Recording::new(times_s.clone());
    for axis in 0..3 {
        recording.set(Channel::Position(axis), quantity.iter().map(|p| p[axis]).collect());
    }
    let none = vec![vec![0.0; ROWS]; 6];
    let expected = expected(&arm, &times_s, &wanted, &none);
    let found =
        MeasuredErrors::of(&recording, expected, Clock::Offset(0.0), &settings()).expect("found");
    let mut corrected = reached.clone();
    for (q, joint) in corrected.iter_mut().zip(&found.joints) {
        let (_, errors) = joint.as_ref().expect("measured");
        q.iter_mut().zip(errors).for_each(|(q, error)| *q += error);
    }
    let largest_distance = |path: &[Vec<f64>]| {
        let distances =
            points(&arm, path).into_iter().zip(points(&arm, &wanted)).map(|(a, b)| a.distance(b));
        distances.fold(0.0, f64::max)
    };
    assert!(
        largest_distance(&corrected) < 0.1 * largest_distance(&reached),
        "{} {}",
        largest_distance(&reached),
        largest_distance(&corrected)
    );
}

#[test]
fn a_measurement_of_another_path_or_of_a_part_of_it_is_refused() {
    let (arm, times_s, wanted) = (arm(), times_s(), path(0.0));
    let none = vec![vec![0.0; ROWS]; 6];
    let errors_of = |recording: &Recording| {
        let expected = expected(&arm, &times_s, &wanted, &none);
        MeasuredErrors::of(recording, expected, Clock::Offset(0.0), &settings())
    };
    let mut other = of_links(&wanted, 0.0);
    other.set(Channel::Link(2), vec![1.5; ROWS]);
    assert!(matches!(errors_of(&other), Err(FeedforwardError::TooFarOff { joint: 3, .. })));
    let mut part = Recording::new(times_s[..300].to_vec());
    part.set(Channel::Link(0), wanted[0][..300].to_vec());
    assert!(matches!(errors_of(&part), Err(FeedforwardError::Uncovered { .. })));
    let nothing = Recording::new(times_s.clone());
    assert_eq!(errors_of(&nothing), Err(FeedforwardError::NothingMeasured));
}

#[test]
fn a_joint_in_the_unit_of_another_column_is_refused_with_the_factor() {
    let (arm, times_s, wanted) = (arm(), times_s(), path(0.0));
    let none = vec![vec![0.0; ROWS]; 6];
    let errors_of = |factor: f64, channel: fn(usize) -> Channel| {
        let mut recording = Recording::new(times_s.clone());
        let measured = wanted[1].iter().map(|q| factor * q).collect();
        recording.set(channel(1), measured);
        let expected = expected(&arm, &times_s, &wanted, &none);
        MeasuredErrors::of(&recording, expected, Clock::Offset(0.0), &settings())
    };
    for channel in [Channel::Link, Channel::Motor] {
        for scale in [1f64.to_radians(), 1f64.to_degrees()] {
            let refused = errors_of(scale, channel).expect_err("another unit");
            let FeedforwardError::OtherUnit { joint: 2, factor, .. } = refused else {
                panic!("{refused}")
            };
            assert!((factor / scale - 1.0).abs() < 0.01, "{factor}");
        }
        assert!(errors_of(1.001, channel).is_ok());
    }
}
