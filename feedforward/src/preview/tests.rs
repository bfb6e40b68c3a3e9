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
    preview(&plants, None, STEP_S, &[path.to_vec()], settings).expect("a path")
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
    assert!(stepped.limited_rows() > 0, "a correction that is held back is counted");
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
    let refused = preview(&plants, None, STEP_S, &[smooth()], &settings());
    assert_eq!(refused, Err(FeedforwardError::NothingInTime));
    let coarse = preview(
        &Plants { joints: vec![model(&JOINT, 0.0)], left_out: Vec::new() },
        None,
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

/// A gantry of three axes, whose second one has a mode; `keys` are added to each joint.
fn gantry(keys: &str, effects: &str) -> recording::model::RobotModel {
    let joint = |k: usize| {
        let axis = [0, 1, 2].map(|i| f64::from(u8::from(i == k)));
        format!(
            "\n[[joint]]\nname = \"{}\"\nkind = \"prismatic\"\naxis = {axis:?}\nlimits_mm = [-3000.0, 3000.0]\n{keys}\n",
            k + 1
        )
    };
    let joints: String = (0..3).map(joint).collect();
    let text = format!(
        "schema = \"trued.model/1\"\nname = \"gantry\"\n{joints}\n[tool]\ntcp_mm = [0.0, 0.0, 0.0]\n{effects}"
    );
    recording::model::RobotModel::parse("gantry", &text).expect("a model")
}

/// A polygon at 100 mm/s with corners blended over a time, m, between rests.
fn polygon(step_s: f64, blend_s: f64) -> Vec<Vec<f64>> {
    let corners = [[0.0, 0.0, 0.0], [60.0, 20.0, -30.0], [20.0, 90.0, 0.0], [-40.0, 60.0, 50.0]];
    let mut points = vec![[0.0; 3]; (1.0 / step_s) as usize];
    for ends in corners.windows(2) {
        let along = [0, 1, 2].map(|i| ends[1][i] - ends[0][i]);
        let length_mm: f64 = along.iter().map(|x| x * x).sum::<f64>().sqrt();
        let rows = (length_mm / (100.0 * step_s)).round() as usize;
        let at =
            |k: usize| [0, 1, 2].map(|i| 1e-3 * (ends[0][i] + along[i] * k as f64 / rows as f64));
        points.extend((1..=rows).map(at));
    }
    points.extend(vec![points[points.len() - 1]; (1.0 / step_s) as usize]);
    let half = (0.5 * blend_s / step_s) as usize;
    let blended = |row: usize, axis: usize| {
        let about = row.saturating_sub(half)..(row + half + 1).min(points.len());
        let (count, sum) =
            (about.len(), points[about].iter().map(|point| point[axis]).sum::<f64>());
        sum / count as f64
    };
    (0..3).map(|axis| (0..points.len()).map(|row| blended(row, axis)).collect()).collect()
}

const MODE: &str = "[[effect]]\nkind = \"time_delay\"\ndelay_ms = 33.8\nsigma = { delay_ms = 0.7 }\n\
                    [[effect]]\nkind = \"flexible_mode\"\njoint = 2\nfrequency_Hz = 16.7\ndamping_ratio = 0.014\n\
                    sigma = { frequency_Hz = 0.33, damping_ratio = 0.0014 }\n";

/// Largest distances from the path by the model without and with a preview, m.
fn deviations(
    model: &recording::model::RobotModel,
    wanted: &[Vec<f64>],
    preview: &Preview,
) -> [f64; 2] {
    let points = |joints: &[Vec<f64>]| crate::tool::points(&model.physics.arm, joints);
    let of =
        |joints| crate::tool::error(&points(wanted), &points(joints), 2e-3).from_path.largest_m;
    [of(&preview.without), of(&preview.with)]
}

#[test]
fn a_preview_within_tight_limits_takes_no_tool_further_from_its_path() {
    let model = gantry("", MODE);
    let plants = Plants::of(&model, 0.1);
    let mut reduced = 0;
    for (rate, jerk, bandwidth_hz) in
        [(0.03, 10.0, 20.0), (0.2, 10.0, 40.0), (0.03, 100.0, 25.0), (0.2, 100.0, 10.0)]
    {
        for blend_s in [0.0, 0.05, 0.1] {
            let wanted = polygon(2e-3, blend_s);
            let tight = Settings::with_limits(0.02, rate, jerk).expect("sound");
            let tight = Settings { bandwidth_hz, ..tight };
            let arm = Some(&model.physics.arm);
            let preview = preview(&plants, arm, 2e-3, &wanted, &tight).expect("a path");
            let [without, with] = deviations(&model, &wanted, &preview);
            let late_m =
                preview.without.iter().zip(&wanted).map(|(y, q)| largest(&differences(q, y)));
            let late_m = late_m.map(|late_m| late_m * late_m).sum::<f64>().sqrt();
            let floor_m = tight.path_floor_m.max(tight.path_floor_share * late_m);
            assert!(with <= without.max(floor_m), "{rate} {jerk} {blend_s}: {without} {with}");
            reduced += usize::from(preview.reduced.is_some());
            let limited = preview.joints.iter().flatten().any(|joint| joint.limited_rows() > 0);
            assert!(preview.reduced.is_none_or(|by| by.limited_by.is_some() == limited));
        }
    }
    assert!(reduced > 0, "some would have been further from the path");
}

#[test]
fn a_preview_commands_no_joint_faster_than_its_model_allows() {
    let lags: String = (1..=3)
        .map(|joint| {
            format!("[[effect]]\nkind = \"servo_lag\"\njoint = {joint}\ntime_constant_ms = 12.0\n")
        })
        .collect();
    let model = gantry("max_speed_mm_s = 95.0", &(lags + MODE));
    let wanted = polygon(4e-3, 0.0);
    let arm = &model.physics.arm;
    let preview_of = |arm: Option<&Arm>| {
        preview(&Plants::of(&model, 0.1), arm, 4e-3, &wanted, &settings()).expect("a path")
    };
    let fastest = |preview: &Preview| {
        let speeds = |joint: &Vec<f64>| {
            joint.windows(2).map(|q| (q[1] - q[0]).abs() / 4e-3).fold(0.0, f64::max)
        };
        preview.commanded.iter().map(speeds).fold(0.0, f64::max)
    };
    assert!(fastest(&preview_of(None)) > 0.12, "without the limit it is exceeded");
    let limited = preview_of(Some(arm));
    assert!(fastest(&limited) <= 0.095 * (1.0 + 1e-6), "{}", fastest(&limited));
    let by = |joint: &CorrectionStep| joint.limited.contains(&Some(LimitedBy::JointSpeed));
    assert!(limited.joints.iter().flatten().any(by));
    let late = |joints: &[Vec<f64>]| {
        let error = |(q, joint): (&Vec<f64>, &Vec<f64>)| rms(&differences(q, joint));
        wanted.iter().zip(joints).map(error).fold(0.0, f64::max)
    };
    let [without, with] = [&limited.without, &limited.with].map(|joints| late(joints));
    assert!(with < 0.2 * without, "{without} {with}, {:?}", limited.reduced);
}

#[test]
fn with_little_room_below_the_speed_limit_most_of_a_lag_is_still_compensated() {
    let lag = "[[effect]]\nkind = \"servo_lag\"\njoint = 1\ntime_constant_ms = 12.0\n";
    let model = gantry("max_speed_mm_s = 110.0", &(lag.to_owned() + MODE));
    // To and fro at 105 mm/s with sharp corners.
    let at = |k: i32| {
        let way = 0.105 * 4e-3 * f64::from((k - 250).clamp(0, 450));
        0.05 - (0.05 - way % 0.1).abs()
    };
    let rest = vec![0.0; 950];
    let wanted = vec![(0..950).map(at).collect::<Vec<f64>>(), rest.clone(), rest];
    let plants = Plants::of(&model, 0.1);
    let preview =
        preview(&plants, Some(&model.physics.arm), 4e-3, &wanted, &settings()).expect("a path");
    let speeds = preview.commanded[0].windows(2).map(|q| (q[1] - q[0]).abs() / 4e-3);
    assert!(speeds.fold(0.0, f64::max) <= 0.11 * (1.0 + 1e-6));
    let late = |joints: &[Vec<f64>]| rms(&differences(&wanted[0], &joints[0]));
    let (without, with) = (late(&preview.without), late(&preview.with));
    assert!(with < 0.5 * without, "{without} {with} {:?}", preview.reduced);
}
