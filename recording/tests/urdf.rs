//! Import and export of URDF compared with references: Pinocchio's kinematics and dynamics, urdf-rs
//! as a reader, and frames multiplied here. `recording/tests/urdf/make.py` writes Pinocchio's
//! numbers.
#![expect(clippy::expect_used, reason = "a test says what failed")]

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};
use physics::{AnyEffect, Body, Chain, Inputs, JointKind, Joints, Memories, Wrench};
use proptest::prelude::*;
use recording::model::presets::preset;
use recording::model::{EffectEntry, Numbers, Parameter, RobotModel};
use recording::urdf::{self, ChainEnds, Import};

/// The robots of `tests/urdf`, with the chain that the reference takes.
const ROBOTS: [(&str, ChainEnds<'static>); 3] = [
    ("six", ChainEnds { base: Some("foot"), tip: Some("tool") }),
    ("scara", ChainEnds { base: None, tip: None }),
    ("seven", ChainEnds { base: Some("seat"), tip: None }),
];

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/urdf").join(name)
}

fn import(name: &str, ends: &ChainEnds<'_>) -> Import {
    urdf::read(&file(&format!("{name}.urdf")), ends).expect("imports")
}

/// Lines of a name and its numbers, four per pose.
fn reference(name: &str) -> Vec<[Vec<f64>; 4]> {
    let text = std::fs::read_to_string(file(&format!("{name}.txt"))).expect("reference");
    let lines: Vec<Vec<f64>> = text
        .lines()
        .map(|line| line.split(' ').skip(1).map(|field| field.parse().expect("number")).collect())
        .collect();
    lines.chunks_exact(4).map(|pose| pose.to_vec().try_into().expect("four")).collect()
}

fn joints(q: &[f64]) -> Joints {
    let mut joints = Joints::default();
    joints[..q.len()].copy_from_slice(q);
    joints
}

/// The tool's placement by rows: `[R p]`.
fn rows(chain: &Chain) -> Vec<f64> {
    let (r, p) = (chain.base_from_tool.rotation, chain.base_from_tool.origin);
    (0..3).flat_map(|row| r.row(row).extend(p[row]).to_array()).collect()
}

fn most_apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).fold(0.0, |most, (a, b)| most.max((a - b).abs()))
}

/// Joint-space inertia from the bodies' own motions: `Σ m JvᵀJv + Jωᵀ I Jω`.
fn inertia(model: &RobotModel, chain: &Chain) -> Vec<f64> {
    let arm = &model.physics.arm;
    let n = arm.count();
    let moves = |k: usize, offset: DVec3, upto: usize| {
        let joint = arm.joints()[k];
        match joint.kind {
            _ if k > upto => (DVec3::ZERO, DVec3::ZERO),
            JointKind::Revolute => (chain.axis(k).cross(offset - chain.point(k)), chain.axis(k)),
            JointKind::Prismatic => (chain.axis(k), DVec3::ZERO),
        }
    };
    let mut sums = vec![0.0; n * n];
    for (body_of, Body { mass, centre, inertia }) in arm.bodies() {
        let now = chain.body(body_of);
        let turned = now.rotation * *inertia * now.rotation.transpose();
        let motions: Vec<_> = (0..n).map(|k| moves(k, now.point(*centre), body_of)).collect();
        for (i, (vi, wi)) in motions.iter().enumerate() {
            for (j, (vj, wj)) in motions.iter().enumerate() {
                sums[i * n + j] += mass * vi.dot(*vj) + wi.dot(turned * *wj);
            }
        }
    }
    sums
}

#[test]
fn kinematics_and_masses_of_an_import_are_those_of_pinocchio() {
    for (name, ends) in ROBOTS {
        let model = import(name, &ends).model;
        let arm = &model.physics.arm;
        let poses = reference(name);
        assert_eq!(poses.len(), 6);
        for [q, tip, gravity, mass] in poses {
            assert_eq!(q.len(), arm.count(), "{name}");
            let chain = Chain::nominal(arm, &joints(&q));
            let error = most_apart(&rows(&chain), &tip);
            assert!(error < 1e-12, "{name}: placement off by {error}");
            let loads = physics::Loads::on(arm, &chain, Wrench::ZERO);
            // The reference gives the torque that holds the arm, ours is that exerted by gravity.
            let held: Vec<f64> = loads.gravity_torque[..q.len()].iter().map(|t| -t).collect();
            let error = most_apart(&held, &gravity);
            assert!(error < 1e-10, "{name}: gravity off by {error} Nm");
            let error = most_apart(&inertia(&model, &chain), &mass);
            assert!(error < 1e-11, "{name}: inertia off by {error} kg m²");
        }
    }
}

/// What a person would note of a joint, whatever the file: kind, limits, speed.
fn nameplate(model: &RobotModel) -> Vec<(String, JointKind, [f64; 2], Option<f64>)> {
    let plate = |joint: &recording::model::JointEntry| {
        (joint.name.clone(), joint.kind, joint.limits, joint.max_speed)
    };
    model.file.joints.iter().map(plate).collect()
}

#[test]
fn a_robot_that_went_out_and_in_again_is_the_same_robot() {
    for (name, ends) in ROBOTS {
        let first = import(name, &ends);
        let text = urdf::export(&first.model).text;
        let again = urdf::parse("again.urdf", &text, &ChainEnds::default()).expect("reads back");
        assert_eq!((&again.base, &again.tip), (&first.base, &first.tip), "{name}");
        assert_eq!(nameplate(&again.model), nameplate(&first.model), "{name}");
        for [q, ..] in reference(name) {
            let [a, b] = [&first, &again].map(|import| {
                let arm = &import.model.physics.arm;
                let chain = Chain::nominal(arm, &joints(&q));
                let torque = physics::Loads::on(arm, &chain, Wrench::ZERO).gravity_torque;
                (rows(&chain), inertia(&import.model, &chain), torque)
            });
            assert!(most_apart(&a.0, &b.0) < 1e-12, "{name}");
            assert!(most_apart(&a.1, &b.1) < 1e-11, "{name}");
            // `seven` is mounted on a wall, with another direction of gravity, which a URDF cannot
            // represent.
            assert!(name == "seven" || most_apart(&a.2, &b.2) < 1e-11, "{name}");
        }
    }
}

fn rpy(angles: DVec3) -> DMat4 {
    DMat4::from_rotation_z(angles.z)
        * DMat4::from_rotation_y(angles.y)
        * DMat4::from_rotation_x(angles.x)
}

/// Forward kinematics from urdf-rs for a text whose joints are in the order of the chain.
fn by_urdf_rs(text: &str, q: &[f64]) -> Vec<f64> {
    composed_by(&urdf_rs::read_from_string(text).expect("urdf-rs reads it").joints, q)
}

fn composed_by(chain: &[urdf_rs::Joint], q: &[f64]) -> Vec<f64> {
    use urdf_rs::JointType::{Prismatic, Revolute};
    let mut place = DMat4::IDENTITY;
    let mut left = q.iter();
    for joint in chain {
        let shift = DMat4::from_translation(DVec3::from_array(*joint.origin.xyz));
        place = place * shift * rpy(DVec3::from_array(*joint.origin.rpy));
        let axis = DVec3::from_array(*joint.axis.xyz);
        let mut next = || *left.next().expect("position");
        place *= match joint.joint_type {
            Revolute => DMat4::from_axis_angle(axis, next()),
            Prismatic => DMat4::from_translation(axis * next()),
            _ => DMat4::IDENTITY,
        };
    }
    (0..3).flat_map(|row| place.row(row).to_array()).collect()
}

/// An effect with one list, or one number, for one key.
fn effect(kind: &str, joint: Option<usize>, key: &str, values: &[f64]) -> EffectEntry {
    let value = match values {
        [one] => Numbers::One(*one),
        many => Numbers::List(many.to_vec()),
    };
    let parameters = vec![Parameter { key: key.to_owned(), value, sigma: None }];
    EffectEntry { kind: kind.to_owned(), joint, channel: None, parameters }
}

/// A robot with the four fixed deviations on several joints, and some that move.
fn calibrated(name: &str) -> RobotModel {
    let mut file = preset(name).expect("preset").model().expect("loads").file;
    file.effects = vec![
        effect("joint_ratio", Some(1), "ratio", &[1e-3]),
        effect("joint_offset", Some(2), "offset_mrad", &[2.0]),
        effect("axis_tilt", Some(2), "tilt_mrad", &[-3.0, 1.5]),
        effect("servo_lag", Some(2), "time_constant_ms", &[3.0]),
        effect("joint_compliance", Some(2), "compliance_mrad_per_kNm", &[2.0]),
        effect("backlash", Some(1), "width_mrad", &[0.2]),
        effect("axis_tilt", Some(5), "tilt_mrad", &[4.0, 0.3]),
        effect("joint_offset", Some(5), "offset_mrad", &[-7.0]),
        effect("axis_shift", Some(6), "shift_mm", &[0.4, -0.2, 0.7]),
        effect("joint_offset", Some(2), "offset_mrad", &[0.5]),
        effect("tool_offset", None, "shift_mm", &[1.0, 2.0, -3.0]),
        effect("tool_offset", None, "turn_mrad", &[5.0, -6.0, 7.0]),
    ];
    RobotModel::of_file(name, file).expect("a model")
}

/// The actual pose with the constant deviations alone, by `physics`.
fn real(model: &RobotModel, q: &[f64]) -> Vec<f64> {
    let mut fixed = physics::Model::nominal(model.physics.arm);
    for effect in model.physics.effects() {
        use AnyEffect::{AxisShift, AxisTilt, JointOffset, ToolOffset};
        if matches!(effect, JointOffset(_) | AxisTilt(_) | AxisShift(_) | ToolOffset(_)) {
            fixed.push(*effect).expect("room");
        }
    }
    rows(&fixed.evaluate(&Inputs::at_rest(joints(q)), &Memories::default()).real)
}

#[test]
fn what_is_fixed_stands_in_the_frames_and_the_rest_is_named() {
    for name in ["irb1600-6-145", "ur10e", "kuka-kr240"] {
        let model = calibrated(name);
        let export = urdf::export(&model);
        assert_eq!(export.carried.len(), 8, "{:?}", export.carried);
        let left: Vec<&str> = export.left_out.iter().map(|part| part.what.as_str()).collect();
        let wanted = [
            "joint_ratio of joint 1",
            "servo_lag of joint 2",
            "joint_compliance of joint 2",
            "backlash of joint 1",
        ];
        assert_eq!(left[..4], wanted);
        let arm =
            urdf::parse("x", &export.text, &ChainEnds::default()).expect("reads").model.physics.arm;
        for index in 0..50 {
            let q: Vec<f64> =
                (0..6).map(|j| ((index * 7 + j) as f64 * 0.618_034).fract() * 4.0 - 2.0).collect();
            let wanted = real(&model, &q);
            let error = most_apart(&wanted, &rows(&Chain::nominal(&arm, &joints(&q))));
            assert!(error < 1e-12, "{name}: off by {error}");
            let error = most_apart(&wanted, &by_urdf_rs(&export.text, &q));
            assert!(error < 1e-12, "{name}: urdf-rs sees it off by {error}");
            // The deviations are significant: otherwise the test would show nothing.
            let nominal = rows(&Chain::nominal(&model.physics.arm, &joints(&q)));
            assert!(most_apart(&wanted, &nominal) > 1e-3);
        }
    }
}

#[test]
fn a_model_without_effects_goes_out_as_it_is() {
    for preset in recording::model::presets::PRESETS {
        let mut file = preset.model().expect("loads").file;
        file.effects.clear();
        let model = RobotModel::of_file(preset.name, file).expect("a model");
        let export = urdf::export(&model);
        assert!(export.carried.is_empty());
        let n = model.physics.arm.count();
        let q = [0.3, -0.4, 0.5, -0.6, 0.7, -0.8, 0.9];
        let nominal = rows(&Chain::nominal(&model.physics.arm, &joints(&q[..n])));
        assert!(
            most_apart(&nominal, &by_urdf_rs(&export.text, &q[..n])) < 1e-12,
            "{}",
            preset.name
        );
    }
}

#[test]
fn an_offset_of_any_size_takes_frames_and_masses_along() {
    let mut file = import("six", &ROBOTS[0].1).model.file;
    file.effects = vec![effect("joint_offset", Some(3), "offset_mrad", &[1000.0])];
    let model = RobotModel::of_file("x", file).expect("a model");
    let text = urdf::export(&model).text;
    let out = urdf::parse("x", &text, &ChainEnds::default()).expect("reads").model;
    let q = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
    let moved = [0.1, 0.2, 1.3, 0.4, 0.5, 0.6];
    let held = |model: &RobotModel, q: &[f64]| {
        let chain = Chain::nominal(&model.physics.arm, &joints(q));
        let loads = physics::Loads::on(&model.physics.arm, &chain, Wrench::ZERO);
        (rows(&chain), loads.gravity_torque.to_vec(), inertia(model, &chain))
    };
    let (wanted, found) = (held(&model, &moved), held(&out, &q));
    assert!(most_apart(&wanted.0, &by_urdf_rs(&text, &q)) < 1e-12);
    assert!(most_apart(&wanted.0, &found.0) < 1e-12);
    assert!(most_apart(&wanted.1, &found.1) < 1e-10);
    assert!(most_apart(&wanted.2, &found.2) < 1e-10);
}

/// One joint of an artificial arm.
#[derive(Debug, Clone)]
struct Made {
    kind: &'static str,
    xyz: [f64; 3],
    rpy: [f64; 3],
    axis: [f64; 3],
    q: f64,
}

fn made() -> impl Strategy<Value = Made> {
    let three = |size: f64| prop::array::uniform3(-size..size);
    let kinds = prop::sample::select(vec!["revolute", "prismatic", "fixed", "continuous"]);
    let axis =
        three(2.0).prop_filter("long enough", |axis| DVec3::from_array(*axis).length() > 0.1);
    (kinds, three(1.0), three(4.0), axis, -2.0..2.0).prop_map(|(kind, xyz, rpy, axis, q)| Made {
        kind,
        xyz,
        rpy,
        axis,
        q,
    })
}

fn joined(numbers: &[f64; 3]) -> String {
    numbers.map(|number| number.to_string()).join(" ")
}

fn text_of(joints: &[Made]) -> String {
    let mut text = "<robot name='made'><link name='l0'/>".to_owned();
    for (i, joint) in joints.iter().enumerate() {
        let Made { kind, xyz, rpy, axis, .. } = joint;
        text += &format!(
            "<joint name='j{i}' type='{kind}'><axis xyz='{}'/><origin rpy='{}' xyz='{}'/><child link='l{}'/>\
             <parent link='l{i}'/><limit lower='-3' upper='3' velocity='0'/></joint><link name='l{}'/>",
            joined(axis),
            joined(rpy),
            joined(xyz),
            i + 1,
            i + 1
        );
    }
    text + "</robot>"
}

fn composed(made: &[Made]) -> DMat4 {
    made.iter().fold(DMat4::IDENTITY, |place, joint| {
        let axis = DVec3::from_array(joint.axis).normalize();
        let motion = match joint.kind {
            "fixed" => DMat4::IDENTITY,
            "prismatic" => DMat4::from_translation(axis * joint.q),
            _ => DMat4::from_axis_angle(axis, joint.q),
        };
        place
            * DMat4::from_translation(DVec3::from_array(joint.xyz))
            * rpy(DVec3::from_array(joint.rpy))
            * motion
    })
}

proptest! {
    #[test]
    fn a_random_arm_keeps_its_kinematics_in_and_out_and_in(made in prop::collection::vec(made(), 1..14)) {
        let text = text_of(&made);
        let tip = format!("l{}", made.len());
        let ends = ChainEnds { base: Some("l0"), tip: Some(&tip) };
        let q: Vec<f64> = made.iter().filter(|joint| joint.kind != "fixed").map(|joint| joint.q).collect();
        prop_assume!(!q.is_empty());
        let first = urdf::parse("made", &text, &ends).map_err(|faults| TestCaseError::fail(faults.plain()))?;
        let wanted = composed(&made);
        let wanted: Vec<f64> = (0..3).flat_map(|row| wanted.row(row).to_array()).collect();
        let found = rows(&Chain::nominal(&first.model.physics.arm, &joints(&q)));
        prop_assert!(most_apart(&wanted, &found) < 1e-12);
        let out = urdf::export(&first.model).text;
        let again = urdf::parse("out", &out, &ends).map_err(|faults| TestCaseError::fail(faults.plain()))?;
        let found = rows(&Chain::nominal(&again.model.physics.arm, &joints(&q)));
        prop_assert!(most_apart(&wanted, &found) < 1e-12);
        // The written model file loads, with the same numbers.
        let toml = first.model.file.to_toml();
        prop_assert_eq!(&RobotModel::parse("toml", &toml).expect("loads"), &first.model);
    }
}

#[test]
fn a_real_description_gives_its_arm_and_its_telescope_as_one_joint() {
    let data =
        std::env::var_os("TRUED_DATA").map_or(PathBuf::from("../../shared/data"), PathBuf::from);
    let path = data.join("hilti/trailblazer.urdf");
    if !path.exists() {
        eprintln!("SKIPPED: {} is not there (set TRUED_DATA)", path.display());
        return;
    }
    // A lift of two stages that follow a third joint carries an arm of six.
    let ends = |base, tip| ChainEnds { base, tip };
    let whole = urdf::read(&path, &ends(None, Some("prism"))).expect("imports");
    assert_eq!(whole.model.physics.arm.count(), 7);
    assert_eq!(whole.model.physics.arm.joints()[0].kind, physics::JointKind::Prismatic);
    let notes = whole.notes.join(" ");
    assert!(notes.contains("column_middle_joint") && notes.contains("column_top_joint"), "{notes}");
    let import = urdf::read(&path, &ends(Some("dsr_base_0"), Some("prism"))).expect("imports");
    let arm = import.model.physics.arm;
    assert_eq!((arm.count(), arm.bodies().count()), (6, 6));
    let text = std::fs::read_to_string(&path).expect("text");
    let mut robot = urdf_rs::read_from_string(&text).expect("urdf-rs reads it");
    let mut chain = Vec::new();
    let mut link = "prism".to_owned();
    while link != "dsr_base_0" {
        let above = robot.joints.iter().position(|joint| joint.child.link == link).expect("above");
        link.clone_from(&robot.joints[above].parent.link);
        chain.insert(0, robot.joints.swap_remove(above));
    }
    let q = [0.3, -0.4, 0.5, -0.6, 0.7, -0.8];
    let error = most_apart(&composed_by(&chain, &q), &rows(&Chain::nominal(&arm, &joints(&q))));
    assert!(error < 1e-12, "off by {error}");
}
