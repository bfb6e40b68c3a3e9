//! Effects that change loads or depend on them, compared with their formulas.

use super::{effect, evaluated, six_joints};
use crate::effects::conformance::{Scene, scene};
use crate::frame::rotation_from_vector;
use crate::{Arm, Body, Inputs, Model, ModelError, Tool, Wrench};
use glam::DVec3;
use proptest::prelude::*;

fn delta(scene: &Scene, joint: usize, kind: &str, given: &[(&str, &[f64])]) -> f64 {
    let effect = effect(&scene.arm, kind, joint, given);
    evaluated(scene.arm, &[effect], &scene.inputs).deviation.joints[joint]
}

#[test]
fn a_joints_compliance_is_its_gravity_and_its_load_compliance_in_one() {
    let scene = scene();
    for joint in 0..6 {
        let given: [(&str, &[f64]); 1] = [("compliance", &[2e-6])];
        let whole = delta(&scene, joint, "joint_compliance", &given);
        let halves = delta(&scene, joint, "gravity_compliance", &given)
            + delta(&scene, joint, "load_compliance", &given);
        assert!((whole - halves).abs() < 1e-18);
    }
}

#[test]
fn a_force_pushes_the_tool_its_own_way() {
    let scene = scene();
    let mut inputs = scene.inputs;
    inputs.wrench_base = Wrench { force: DVec3::new(0.0, 0.0, -100.0), moment: DVec3::ZERO };
    let soft: Vec<_> = (0..6)
        .map(|i| effect(&scene.arm, "load_compliance", i, &[("compliance", &[2e-6])]))
        .collect();
    let evaluation = evaluated(scene.arm, &soft, &inputs);
    assert!(evaluation.real.base_from_tool.origin.z < evaluation.nominal.base_from_tool.origin.z);
}

#[test]
fn lost_motion_saturates_at_half_its_width_on_the_loads_side() {
    let scene = scene();
    let torque = evaluated(scene.arm, &[], &scene.inputs).loads.torque(1);
    let hard = delta(&scene, 1, "lost_motion", &[("width", &[4e-4]), ("torque", &[1e-3])]);
    assert!((hard - 2e-4 * torque.signum()).abs() < 1e-18);
    let soft = delta(&scene, 1, "lost_motion", &[("width", &[4e-4]), ("torque", &[1e6])]);
    assert!((soft - 2e-4 * torque / 1e6).abs() < 1e-12);
}

proptest! {
    /// The weight of everything beyond a joint acts through vectors that rotate with the bodies, so
    /// a sag can be computed from masses.
    #[test]
    fn a_sag_computed_from_masses_is_their_gravity_compliance(q in six_joints()) {
        let scene = Scene { inputs: Inputs::at_rest(q), ..scene() };
        let (arm, joint, compliance) = (&scene.arm, 1, 2e-6);
        let mut sag = Vec::new();
        for k in joint..6 {
            let own_moment: DVec3 = arm.bodies().filter(|(b, _)| *b == k)
                .map(|(_, body)| (body.centre - arm.joints()[k].point) * body.mass).sum();
            let beyond: f64 = arm.bodies().filter(|(b, _)| *b > k).map(|(_, body)| body.mass).sum();
            let link = arm.next_point(k) - arm.joints()[k].point;
            let lever = own_moment + if k < 5 { link * beyond } else { DVec3::ZERO };
            sag.extend((lever * compliance * arm.gravity.length()).to_array());
        }
        let by_sag = delta(&scene, joint, "gravity_sag", &[("sag", &sag)]);
        let by_masses = delta(&scene, joint, "gravity_compliance", &[("compliance", &[compliance])]);
        prop_assert!((by_sag - by_masses).abs() < 1e-15, "{by_sag} not {by_masses}");
    }
}

#[test]
fn a_payload_is_a_mass_more_at_the_tool() {
    let scene = scene();
    let (known, centre) =
        (scene.arm.tool.body.expect("a tool with a mass"), DVec3::new(0.95, 0.1, 1.1));
    let payload =
        effect(&scene.arm, "payload", None, &[("mass", &[2.5]), ("com", &centre.to_array())]);
    let mass = known.mass + 2.5;
    let body = Body::point_mass(mass, (known.centre * known.mass + centre * 2.5) / mass);
    let tool = Tool { body: Some(body), ..scene.arm.tool };
    let heavier = crate::Arm::new(scene.arm.joints(), tool, scene.arm.gravity).expect("sound");
    let found = evaluated(scene.arm, &[payload], &scene.inputs).loads;
    let wanted = evaluated(heavier, &[], &scene.inputs).loads;
    for i in 0..6 {
        assert!((found.gravity_torque[i] - wanted.gravity_torque[i]).abs() < 1e-11);
        assert!((found.gravity_at(i).moment - wanted.gravity_at(i).moment).length() < 1e-11);
    }
    assert!((found.base_moment - wanted.base_moment).length() < 1e-11);
}

#[test]
fn a_robot_on_its_side_feels_gravity_sideways() {
    let scene = scene();
    let quarter =
        effect(&scene.arm, "gravity_tilt", None, &[("tilt", &[core::f64::consts::FRAC_PI_2, 0.0])]);
    let loads = evaluated(scene.arm, &[quarter], &scene.inputs).loads;
    assert!((loads.gravity - DVec3::new(0.0, -9.80665, 0.0)).length() < 1e-14);
    let side = crate::Arm::new(scene.arm.joints(), scene.arm.tool, loads.gravity).expect("sound");
    let wanted = evaluated(side, &[], &scene.inputs).loads;
    assert!((0..6).all(|i| (loads.gravity_torque[i] - wanted.gravity_torque[i]).abs() < 1e-11));
}

#[test]
fn what_a_sensor_reads_wrong_is_undone_in_the_contracts_order() {
    let Scene { arm, mut inputs } = scene();
    let (scale, turn) = ([0.05, -0.02, 0.1, 0.03, -0.04, 0.2], DVec3::new(0.02, -0.03, 0.05));
    let (bias_force, bias_moment) = (DVec3::new(5.0, -3.0, 8.0), DVec3::new(0.5, 0.2, -0.1));
    let truth = inputs.wrench_base;
    let from_tool = evaluated(arm, &[], &inputs).nominal.base_from_tool.rotation;
    // Forwards: the truth in the axes of the misaligned sensor, scaled, plus the bias.
    let read = |v: DVec3, s: &[f64], bias: DVec3| {
        let at_sensor = rotation_from_vector(turn).transpose() * (from_tool.transpose() * v);
        from_tool * (at_sensor * (DVec3::ONE + DVec3::from_slice(s)) + bias)
    };
    inputs.wrench_base = Wrench {
        force: read(truth.force, &scale[..3], bias_force),
        moment: read(truth.moment, &scale[3..], bias_moment),
    };
    let effects = [
        effect(&arm, "wrench_misalignment", None, &[("turn", &turn.to_array())]),
        effect(
            &arm,
            "wrench_bias",
            None,
            &[("bias", &bias_force.to_array()), ("bias_Nm", &bias_moment.to_array())],
        ),
        effect(&arm, "wrench_scale", None, &[("scale", &scale)]),
    ];
    let found = evaluated(arm, &effects, &inputs).loads.wrench;
    assert!((found.force - truth.force).length() < 1e-12, "{found:?} not {truth:?}");
    assert!((found.moment - truth.moment).length() < 1e-12);
}

#[test]
fn a_stiffening_law_is_refused_beyond_the_load_where_it_would_turn_back() {
    let scene = scene();
    let torque = evaluated(scene.arm, &[], &scene.inputs).loads.torque(1).abs();
    let compliance = 2e-6;
    for (share, beyond) in [(0.9, false), (1.1, true)] {
        let limit = torque / share;
        let cubic = compliance / (3.0 * limit * limit);
        let effects = [
            effect(&scene.arm, "joint_compliance", 1, &[("compliance", &[compliance])]),
            effect(&scene.arm, "stiffness_hardening", 1, &[("cubic", &[cubic])]),
        ];
        let evaluation = evaluated(scene.arm, &effects, &scene.inputs);
        assert_eq!(evaluation.out_of_range.is_some(), beyond);
        if let Some(out_of_range) = evaluation.out_of_range {
            assert_eq!(out_of_range.joint, 1);
            assert!((out_of_range.limit - limit).abs() < 1e-9 && out_of_range.torque.abs() > limit);
        }
    }
}

#[test]
fn effects_that_do_not_fit_each_other_make_no_model() {
    let arm = scene().arm;
    let soft = |kind, joint| effect(&arm, kind, joint, &[("compliance", &[2e-6])]);
    let hardening = effect(&arm, "stiffness_hardening", 1, &[("cubic", &[1e-13])]);
    let made = |effects: &[crate::AnyEffect]| Model::new(arm, effects).map(|_| ());
    assert_eq!(made(&[hardening]), Err(ModelError::HardensNothing { joint: 2 }));
    assert_eq!(
        made(&[hardening, soft("joint_compliance", 2)]),
        Err(ModelError::HardensNothing { joint: 2 })
    );
    assert_eq!(made(&[hardening, soft("load_compliance", 1)]), Ok(()));
    let twice = [soft("joint_compliance", 3), soft("gravity_compliance", 3)];
    assert_eq!(made(&twice), Err(ModelError::CompliantTwice { joint: 4 }));
    assert_eq!(made(&[soft("joint_compliance", 3), soft("gravity_compliance", 2)]), Ok(()));
}

proptest! {
    #[test]
    fn a_base_that_stands_turned_turns_the_arm_with_it_and_gravity_against_it(tilt in prop::array::uniform3(-0.3..0.3_f64), q in six_joints()) {
        let mut scene = scene();
        scene.inputs.q = q;
        let straight = evaluated(scene.arm, &[], &scene.inputs);
        scene.inputs.base_tilt = DVec3::from_array(tilt);
        let tilted = evaluated(scene.arm, &[], &scene.inputs);
        let turn = rotation_from_vector(scene.inputs.base_tilt);
        let tool = turn * straight.real.base_from_tool.origin;
        prop_assert!((tilted.real.base_from_tool.origin - tool).length() < 1e-12);
        let level = Arm::new(scene.arm.joints(), scene.arm.tool, turn.transpose() * scene.arm.gravity).expect("sound");
        let other = evaluated(level, &[], &Inputs { base_tilt: DVec3::ZERO, ..scene.inputs });
        for joint in 0..6 {
            prop_assert!((tilted.loads.torque(joint) - other.loads.torque(joint)).abs() < 1e-9);
        }
    }
}
