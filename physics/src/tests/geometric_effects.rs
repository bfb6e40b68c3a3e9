//! Comparison of each geometric effect with the same deviation in plain 4×4 matrices.

use super::matrix::{Geometry, identity, shift, turn};
use super::{effect, evaluated};
use crate::effects::conformance::{Scene, scene, sliding_scene};
use crate::frame::normals;
use crate::{AnyEffect, Frame};
use glam::DVec3;

const ROUNDING: f64 = 1e-13;

fn tool_with(scene: &Scene, effects: &[AnyEffect]) -> Frame {
    evaluated(scene.arm, effects, &scene.inputs).real.base_from_tool
}

fn scenes() -> [Scene; 2] {
    [scene(), sliding_scene()]
}

/// Large on purpose: a formula that is only of first order must fail.
const LARGE: [f64; 3] = [0.12, -0.2, 0.15];

#[test]
fn effects_on_joints_add_to_their_positions() {
    for scene in scenes() {
        let (arm, geometry, mut q) = (&scene.arm, Geometry::of(&scene.arm), scene.inputs.q);
        let effects = [
            effect(arm, "joint_offset", 1, &[("offset", &[0.01])]),
            effect(arm, "joint_ratio", 1, &[("ratio", &[1e-3])]),
            effect(arm, "joint_coupling", 4, &[("ratio", &[0.02]), ("from_joint", &[4.0])]),
            effect(
                arm,
                "transmission_error",
                2,
                &[("amplitude", &[2e-3]), ("cycles", &[7.0]), ("phase", &[0.3])],
            ),
            effect(
                arm,
                "joint_polynomial",
                3,
                &[("coefficients", &[1e-3, 2e-3, 3e-3, 4e-3]), ("range", &[-1.0, 2.0])],
            ),
        ];
        q[4] += 0.02 * q[3];
        q[1] += 0.01 + 1e-3 * q[1];
        q[2] += 2e-3 * (7.0 * q[2] + 0.3).sin();
        // T_n(cos a) = cos n a
        let angle = ((q[3] + 1.0) / 1.5 - 1.0).acos();
        q[3] +=
            (0..4).map(|n| 1e-3 * (f64::from(n) + 1.0) * (f64::from(n) * angle).cos()).sum::<f64>();
        assert!(geometry.base_from_tool(&q).difference(&tool_with(&scene, &effects)) < ROUNDING);
    }
}

#[test]
fn a_polynomial_stays_at_its_ends_value_outside_its_range() {
    let mut scene = scene();
    let entries: [(&str, &[f64]); 2] =
        [("coefficients", &[1e-3, 2e-3, 3e-3]), ("range", &[-0.5, 0.5])];
    let polynomial = effect(&scene.arm, "joint_polynomial", 1, &entries);
    for (q, wanted) in [(0.5, 6e-3), (2.9, 6e-3), (-0.5, 2e-3), (-2.9, 2e-3)] {
        scene.inputs.q[1] = q;
        let deviation = evaluated(scene.arm, &[polynomial], &scene.inputs).deviation.joints[1];
        assert!((deviation - wanted).abs() < 1e-17, "{deviation} at {q}");
    }
}

#[test]
fn a_tilted_axis_turns_alone_about_its_pivot() {
    for scene in scenes() {
        let joint = scene.arm.joints()[1];
        let (n1, n2) = normals(joint.axis);
        let tilt = n1 * 0.2 - n2 * 0.1;
        for along in [0.0, 0.7] {
            let pivot = joint.point + joint.axis * along;
            let mut geometry = Geometry::of(&scene.arm);
            let moved = turn(tilt.to_array(), pivot.to_array());
            geometry.joints[1].1 = moved.point(joint.axis) - moved.point(DVec3::ZERO);
            geometry.joints[1].2 = moved.point(joint.point);
            let entries: [(&str, &[f64]); 2] =
                [("tilt", &[0.2, -0.1]), ("pivot", &pivot.to_array())];
            let tilted = effect(&scene.arm, "axis_tilt", 1, &entries);
            let wanted = geometry.base_from_tool(&scene.inputs.q);
            assert!(wanted.difference(&tool_with(&scene, &[tilted])) < ROUNDING, "{along}");
        }
    }
}

#[test]
fn a_wobbling_axis_is_one_that_is_tilted_by_its_angle() {
    for scene in scenes() {
        let q = scene.inputs.q[1];
        let [t1, t2] = [0.02 * (2.0 * q + 0.3).sin(), 0.01 * (2.0 * q - 0.9).sin()];
        let entries: [(&str, &[f64]); 3] =
            [("amplitude", &[0.02, 0.01]), ("phase", &[0.3, -0.9]), ("cycles", &[2.0])];
        let wobbling = effect(&scene.arm, "axis_wobble", 1, &entries);
        let tilted = effect(&scene.arm, "axis_tilt", 1, &[("tilt", &[t1, t2])]);
        let (a, b) = (tool_with(&scene, &[wobbling]), tool_with(&scene, &[tilted]));
        assert!((a.origin - b.origin).length() < ROUNDING);
    }
}

#[test]
fn opposite_tilts_about_two_pivots_shift_the_axis() {
    let scene = scene();
    let joint = scene.arm.joints()[1];
    let other_pivot = (joint.point + joint.axis).to_array();
    let tilted = effect(&scene.arm, "axis_tilt", 1, &[("tilt", &[1e-3, 2e-3])]);
    let back =
        effect(&scene.arm, "axis_tilt", 1, &[("tilt", &[-1e-3, -2e-3]), ("pivot", &other_pivot)]);
    let (n1, n2) = normals(joint.axis);
    let mut geometry = Geometry::of(&scene.arm);
    geometry.joints[1].2 += (n1 * 1e-3 + n2 * 2e-3).cross(joint.axis);
    let wanted = geometry.base_from_tool(&scene.inputs.q);
    assert!(wanted.difference(&tool_with(&scene, &[tilted, back])) < ROUNDING);
}

#[test]
fn a_shifted_axis_takes_along_all_that_it_carries() {
    for scene in scenes() {
        for joint in [1, 5] {
            let axis = scene.arm.joints()[joint].axis;
            let free = DVec3::from_array(LARGE);
            let by = if joint == 5 { free } else { free - axis * axis.dot(free) };
            let mut geometry = Geometry::of(&scene.arm);
            geometry.move_from(joint, by);
            let shifted = effect(&scene.arm, "axis_shift", joint, &[("shift", &by.to_array())]);
            let wanted = geometry.base_from_tool(&scene.inputs.q);
            assert!(wanted.difference(&tool_with(&scene, &[shifted])) < ROUNDING);
        }
    }
}

#[test]
fn a_shift_along_the_axis_is_the_last_joints_alone() {
    let arm = scene().arm;
    let build = |joint, shift: &[f64]| {
        AnyEffect::build(
            "axis_shift",
            &arm,
            Some(joint),
            crate::ParameterValues(&[("shift", shift)]),
        )
    };
    assert!(matches!(build(1, &[0.0, 1e-5, 0.0]), Err(crate::BuildError::Combination(_))));
    let rounded = build(1, &[1e-3, 9e-7, 0.0]).expect("rounding is no part along the axis");
    let wanted = effect(&arm, "axis_shift", 1, &[("shift", &[1e-3, 0.0, 0.0])]);
    let tools = [rounded, wanted].map(|shifted| tool_with(&scene(), &[shifted]));
    assert_eq!(tools[0], tools[1], "what rounding leaves along the axis does nothing");
    assert!(build(5, &[1e-3, 0.0, 0.0]).is_ok());
}

#[test]
fn effects_on_the_tool_are_applied_after_the_chain() {
    let scene = scene();
    let (q, force) = (scene.inputs.q, scene.inputs.wrench_base.force);
    let nominal = Geometry::of(&scene.arm).base_from_tool(&q);
    let offset = effect(
        &scene.arm,
        "tool_offset",
        None,
        &[("shift", &[1e-2, 2e-2, -3e-2]), ("turn", &LARGE)],
    );
    let wanted = nominal.times(&shift([1e-2, 2e-2, -3e-2])).times(&turn(LARGE, [0.0; 3]));
    assert!(wanted.difference(&tool_with(&scene, &[offset])) < ROUNDING);

    let softness = [2e-6, 1e-6, 5e-7];
    let yielding = effect(&scene.arm, "tool_compliance", None, &[("compliance", &softness)]);
    let column = |k: usize| DVec3::new(nominal.0[0][k], nominal.0[1][k], nominal.0[2][k]);
    let along = [0, 1, 2].map(|k| softness[k] * column(k).dot(force));
    assert!(nominal.times(&shift(along)).difference(&tool_with(&scene, &[yielding])) < ROUNDING);

    let by_warmth = effect(&scene.arm, "spindle_growth", None, &[("growth", &[3e-6])]);
    let by_speed = effect(&scene.arm, "spindle_growth", None, &[("growth_um", &[1e-9])]);
    let grown = nominal.times(&shift([0.0, 0.0, 3e-6 * 7.0 + 1e-9 * 28_000.0]));
    assert!(grown.difference(&tool_with(&scene, &[by_warmth, by_speed])) < ROUNDING);
}

#[test]
fn a_growing_link_moves_the_next_joint_away() {
    for scene in scenes() {
        let joints = scene.arm.joints();
        let ends = [(2, joints[3].point), (5, scene.arm.tool.tcp)];
        for (joint, end) in ends {
            let mut scene = Scene { arm: scene.arm, inputs: scene.inputs };
            scene.inputs.joint_celsius[joint] = 32.0;
            let along = (end - joints[joint].point).normalize() * 1e-3 * 12.0;
            let mut geometry = Geometry::of(&scene.arm);
            if joint == 5 {
                geometry.tool = shift(along.to_array()).times(&geometry.tool);
            } else {
                geometry.move_from(joint + 1, along);
            }
            let growing = effect(&scene.arm, "thermal_growth", joint, &[("growth", &[1e-3])]);
            let wanted = geometry.base_from_tool(&scene.inputs.q);
            assert!(wanted.difference(&tool_with(&scene, &[growing])) < ROUNDING);
        }
    }
}

#[test]
fn a_tilting_base_turns_everything_about_its_origin() {
    let scene = scene();
    let nominal = Geometry::of(&scene.arm).base_from_tool(&scene.inputs.q);
    let moment = evaluated(scene.arm, &[], &scene.inputs).loads.base_moment;
    let tilting = effect(&scene.arm, "base_compliance", None, &[("compliance", &[4e-4])]);
    let wanted = turn([4e-4 * moment.x, 4e-4 * moment.y, 0.0], [0.0; 3]).times(&nominal);
    assert!(wanted.difference(&tool_with(&scene, &[tilting])) < ROUNDING);
}

#[test]
fn a_tilting_bearing_turns_all_beyond_about_its_pivot_where_it_is_now() {
    for scene in scenes() {
        let (geometry, q) = (Geometry::of(&scene.arm), scene.inputs.q);
        let evaluation = evaluated(scene.arm, &[], &scene.inputs);
        for joint in [0_usize, 1, 3] {
            let (_, axis, point) = geometry.joints[joint];
            let carrier = joint.checked_sub(1).map_or(identity(), |k| geometry.body(&q, Some(k)));
            let pivot = point + axis * 0.3;
            let (now, point_now) = (carrier.point(pivot), carrier.point(point));
            let axis_now = carrier.point(axis) - carrier.point(DVec3::ZERO);
            let about =
                |load: &crate::loads::PivotLoad| load.moment + (point_now - now).cross(load.force);
            let moment = about(&evaluation.loads.gravity_at(joint))
                + about(&evaluation.loads.wrench_at(joint, &evaluation.nominal));
            let tilt = (moment - axis_now * axis_now.dot(moment)) * 4e-4;
            let wanted = turn(tilt.to_array(), now.to_array()).times(&geometry.base_from_tool(&q));
            let entries: [(&str, &[f64]); 2] =
                [("compliance", &[4e-4]), ("pivot", &pivot.to_array())];
            let tilting = effect(&scene.arm, "bearing_compliance", joint, &entries);
            assert!(wanted.difference(&tool_with(&scene, &[tilting])) < ROUNDING, "joint {joint}");
        }
    }
}
