//! Derivatives compared with central differences, for every kind of measurement, every extrinsic parameter and every effect that moves the tool.

use super::*;
use crate::campaign::{Instrument, Observation, Pose, Reading, ReadingNoise, ToolPoint};
use crate::extrinsics::{Anchor, FitParameter, MeasuringFrame, Plane, Sphere};
use glam::{DMat3, DVec3};
use physics::Inputs;
use physics::frame::rotation_from_vector;
use physics::{AnyEffect, Arm, Frame, JOINTS_MAX, ParameterValues, Wrench};
use proptest::prelude::*;
use recording::model::presets::preset;

/// The thesis' robot with its own effects and one of each other kind.
fn everything() -> Model {
    let mut model = preset("irb1600-6-145-thesis").expect("preset").model().expect("sound").physics;
    let arm = model.arm;
    let mut add = |kind: &str, joint: Option<usize>, given: &[(&str, &[f64])]| {
        let effect = AnyEffect::build(kind, &arm, joint, ParameterValues(given)).expect(kind);
        model.push(effect).expect("room");
    };
    add("joint_coupling", Some(5), &[("ratio", &[1e-3]), ("from_joint", &[5.0])]);
    add("lost_motion", Some(2), &[("width", &[2e-4]), ("torque", &[30.0])]);
    add("hysteresis", Some(3), &[("amplitude", &[3e-4]), ("reversal", &[0.02])]);
    add("gravity_compliance", Some(3), &[("compliance", &[1e-5])]);
    add("stiffness_hardening", Some(1), &[("cubic", &[1e-13])]);
    add("bearing_compliance", Some(0), &[("compliance", &[1e-6])]);
    add("base_compliance", None, &[("compliance", &[1e-6])]);
    add("tool_compliance", None, &[("compliance", &[1e-6, 2e-6, 3e-6])]);
    add(
        "counterbalance",
        Some(1),
        &[
            ("stiffness", &[2e4]),
            ("free_length", &[0.2]),
            ("a", &[0.15]),
            ("L", &[0.3]),
            ("angle", &[0.4]),
        ],
    );
    add("tool_offset", None, &[("shift", &[1e-3, 2e-3, 0.0]), ("turn", &[0.01, -0.02, 0.03])]);
    add("gravity_tilt", None, &[("tilt", &[0.01, -0.02])]);
    add("payload", None, &[("mass", &[2.0]), ("com", &[0.8, 0.0, 1.2])]);
    add("thermal_growth", Some(1), &[("amplitude", &[1e-4]), ("time_constant", &[900.0])]);
    add("thermal_zero", Some(2), &[("drift", &[1e-5]), ("lag", &[600.0])]);
    add(
        "axis_wobble",
        Some(3),
        &[("amplitude", &[2e-4, 1e-4]), ("phase", &[0.3, 1.0]), ("cycles", &[2.0])],
    );
    model
}

fn inputs(q: [f64; 6], before: Option<&Inputs>) -> Inputs {
    let mut all = [0.0; JOINTS_MAX];
    all[..6].copy_from_slice(&q);
    let mut inputs = Inputs::at_rest(all);
    inputs.ambient_celsius = 24.0;
    inputs.wrench_base =
        Wrench { force: DVec3::new(40.0, -20.0, 70.0), moment: DVec3::new(1.0, 2.0, -3.0) };
    if let Some(before) = before {
        inputs.q_before = before.q;
        inputs.time_s = before.time_s + 300.0;
        inputs.dt_s = 300.0;
        inputs.ambient_celsius = before.ambient_celsius + 1.0;
        inputs.direction = std::array::from_fn(|i| (all[i] - before.q[i]).signum());
    }
    inputs
}

fn surroundings() -> Extrinsics {
    let frame =
        Frame::new(rotation_from_vector(DVec3::new(0.3, -0.2, 2.0)), DVec3::new(3.0, 1.0, -0.5));
    let station = MeasuringFrame { measuring_from_base: frame, pivot: DVec3::new(2.5, 1.0, 0.3) };
    let plane = Plane { normal: DVec3::new(0.6, 0.0, 0.8), offset_m: 0.4 };
    Extrinsics {
        frames: vec![FitParameter::unknown(station)],
        targets: vec![FitParameter::unknown(DVec3::new(0.02, 0.08, 0.1))],
        anchors: vec![Anchor {
            place: FitParameter::unknown(DVec3::new(1.0, 0.7, 0.2)),
            offset_m: FitParameter::unknown(2e-3),
        }],
        planes: vec![FitParameter::unknown(plane)],
        spheres: vec![Sphere {
            centre: FitParameter::unknown(DVec3::new(0.9, -0.6, 0.4)),
            radius_m: FitParameter::unknown(0.02),
        }],
    }
}

/// One measurement of every kind, each near its prediction, because derivatives of rotations are exact only at small residuals.
fn readings(tool: &Frame, around: &Extrinsics, q1: f64) -> Vec<Observation> {
    let place = ToolPoint::Target(0);
    let point = tool.point(around.targets[0].value);
    let station = &around.frames[0].value.measuring_from_base;
    let (plane, sphere) = (&around.planes[0].value, &around.spheres[0]);
    let kinds = [
        Reading::Point { place, frame: 0, at: station.point(point) + DVec3::splat(1e-4) },
        Reading::Point { place: ToolPoint::Tcp, frame: 0, at: station.point(tool.origin) },
        Reading::Orientation { frame: 0, measuring_from_tool: station.rotation * tool.rotation },
        Reading::Distance {
            place,
            anchor: 0,
            length_m: (point - around.anchors[0].place.value).length() + 2e-3,
        },
        Reading::Plane { place, plane: 0, radius_m: plane.normal.dot(point) - plane.offset_m },
        Reading::Sphere {
            place,
            sphere: 0,
            radius_m: (point - sphere.centre.value).length() - sphere.radius_m.value,
        },
        Reading::JointPosition { joint: 0, position: q1 },
    ];
    let covariance = DMat3::from_cols(
        DVec3::new(4e-10, 1e-10, 0.0),
        DVec3::new(1e-10, 9e-10, 0.0),
        DVec3::new(0.0, 0.0, 1e-9),
    );
    let whitening = ReadingNoise::Covariance(covariance).whitening(DVec3::ZERO).expect("sound");
    kinds.map(|reading| Observation { reading, whitening, instrument: 0 }).to_vec()
}

fn scene(path: &[[f64; 6]]) -> (Campaign, FitState) {
    let mut hypothesis = Hypothesis::fixed(everything());
    let count = hypothesis.model.effects().len();
    for effect in 0..count {
        hypothesis.free_all(effect, &[], &[]);
    }
    let around = surroundings();
    let mut poses: Vec<Pose> = Vec::new();
    for q in path {
        let inputs = inputs(*q, poses.last().map(|pose| &pose.inputs));
        let arrival = if poses.is_empty() { Arrival::Settled } else { Arrival::FromPrevious };
        poses.push(Pose { inputs, arrival, recording: 0, row: poses.len(), seen: Vec::new() });
    }
    let instruments =
        vec![Instrument { name: "all".to_owned(), noise_is_known: true, ..Instrument::default() }];
    let mut campaign =
        Campaign { poses, surroundings: around.clone(), instruments, recordings: Vec::new() };
    let mut tools = Vec::new();
    visit_poses(&hypothesis.model, &campaign, None, |_, evaluation, _| {
        tools.push(evaluation.real.base_from_tool);
    });
    for (pose, tool) in campaign.poses.iter_mut().zip(tools) {
        pose.seen = readings(&tool, &around, pose.inputs.q[0]);
    }
    (campaign, FitState { surroundings: around, hypothesis })
}

/// All residuals in order.
fn residuals(campaign: &Campaign, state: &FitState) -> Vec<f64> {
    let mut all = Vec::new();
    visit_readings(campaign, state, VisitScope { used: None, derivatives: false }, |reading| {
        all.extend_from_slice(&reading.rows.residual.to_array()[..reading.rows.count]);
    });
    all
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn derivatives_agree_with_central_differences(path in prop::collection::vec(prop::array::uniform6(-1.2..1.2_f64), 3)) {
        let (campaign, state) = scene(&path);
        let weighing = ReadingWeights::equal(&campaign, &vec![true; campaign.poses.len()]);
        let all: Vec<usize> = (0..state.width()).collect();
        let mut analytic: Vec<Vec<f64>> = Vec::new();
        data_rows(&campaign, &state, &weighing, &all, |_, row, _| analytic.push(row.to_vec()));
        let (sizes, values) = (state.plausible_sizes(), state.hypothesis.values());
        let first = state.surroundings.parameters().len();
        for column in all {
            // Central difference, within the range of parameters that must stay positive.
            let size = column.checked_sub(first).map_or(0.0, |k| values[k].abs());
            let room = if size > 0.0 { 0.5 * size } else { 1.0 };
            let step = (1e-4 * sizes[column].min(1.0)).min(room);
            let beside = |by: f64| {
                let mut full = vec![0.0; state.width()];
                full[column] = by;
                residuals(&campaign, &state.stepped(&full))
            };
            let (above, below) = (beside(step), beside(-step));
            let found: Vec<f64> = below.iter().zip(&above).map(|(b, a)| (b - a) / (2.0 * step)).collect();
            let most = found.iter().chain(analytic.iter().map(|row| &row[column])).fold(0.0_f64, |m, x| m.max(x.abs()));
            // Rounding: residuals are metres divided by tens of micrometres.
            let allowed = 2e-5 * most + 1e-9 / step;
            for (row, found) in analytic.iter().zip(&found) {
                let error = (row[column] - found).abs();
                prop_assert!(error <= allowed, "column {column} ({}): {} not {found}", name(&state, column), row[column]);
            }
        }
    }
}

fn name(state: &FitState, column: usize) -> String {
    let numbers = state.surroundings.parameters();
    match numbers.get(column) {
        Some(number) => state.surroundings.describe(*number),
        None => state.hypothesis.describe(&state.hypothesis.free[column - numbers.len()]),
    }
}

/// The arm is that of the thesis.
#[test]
fn the_scene_has_every_effect_that_moves_the_tool() {
    let model = everything();
    let arm: &Arm = &model.arm;
    assert_eq!(arm.count(), 6);
    let missing: Vec<&str> = physics::effects::SPECS
        .iter()
        .map(|spec| spec.kind)
        .filter(|kind| !model.effects().any(|effect| effect.spec().kind == *kind))
        .collect();
    // `joint_compliance` excludes the effects for gravity and for wrench alone; sensor errors act on the tool only through compliance to the wrench,
    // which tool_compliance covers.
    let left = [
        "joint_compliance",
        "spindle_growth",
        "wrench_bias",
        "wrench_scale",
        "wrench_misalignment",
    ];
    assert_eq!(missing, left);
}
