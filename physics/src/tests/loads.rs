//! Gravity, wrench, and deflections of compliances.

use super::matrix::Geometry;
use super::{effect, evaluated, six_joints};
use crate::effects::conformance::{scene, sliding_scene};
use crate::frame::vector_from_rotation;
use crate::{Arm, Chain, Inputs, Joints, Loads, Wrench};
use glam::DVec3;
use nalgebra::Matrix6;
use proptest::prelude::*;

pub(super) fn arms() -> [Arm; 2] {
    [scene().arm, sliding_scene().arm]
}

/// Potential energy of all masses, J, by matrices.
pub(super) fn energy(arm: &Arm, q: &Joints) -> f64 {
    let geometry = Geometry::of(arm);
    let energy_of = |(i, body): (usize, &crate::Body)| {
        -body.mass * arm.gravity.dot(geometry.body(q, Some(i)).point(body.centre))
    };
    arm.bodies().map(energy_of).sum()
}

fn slope(f: impl Fn(&Joints) -> f64, q: &Joints, i: usize, h: f64) -> f64 {
    let (mut above, mut below) = (*q, *q);
    above[i] += h;
    below[i] -= h;
    (f(&above) - f(&below)) / (2.0 * h)
}

prop_compose! {
    fn any_wrench()(six in prop::array::uniform6(-200.0..200.0_f64)) -> Wrench {
        Wrench { force: DVec3::from_slice(&six), moment: DVec3::from_slice(&six[3..]) * 0.1 }
    }
}

/// Six numbers as a wrench: force, then moment.
fn wrench(six: [f64; 6]) -> Wrench {
    Wrench { force: DVec3::from_slice(&six), moment: DVec3::from_slice(&six[3..]) }
}

/// Displacement of the tool per wrench: columns are unit wrenches, rows are shift and rotation
/// vector.
fn compliance_matrix(arm: &Arm, inputs: &Inputs, effects: &[crate::AnyEffect]) -> Matrix6<f64> {
    let size = 1e-2;
    Matrix6::from_fn(|_, _| 0.0).map_with_location(|row, column, _: f64| {
        let pose = |by: f64| {
            let mut six = [0.0; 6];
            six[column] = by;
            let inputs = Inputs { wrench_base: wrench(six), ..*inputs };
            evaluated(*arm, effects, &inputs).real.base_from_tool
        };
        let (above, below) = (pose(size), pose(-size));
        let turned = vector_from_rotation(&(above.rotation * below.rotation.transpose()));
        let moved = above.origin - below.origin;
        let six = [moved.x, moved.y, moved.z, turned.x, turned.y, turned.z];
        six[row] / (2.0 * size)
    })
}

fn without_masses(arm: &Arm) -> Arm {
    let joints: Vec<_> = arm.joints().iter().map(|j| crate::Joint { link: None, ..*j }).collect();
    Arm::new(&joints, crate::Tool { body: None, ..arm.tool }, arm.gravity).expect("a sound arm")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn gravity_torque_is_minus_the_slope_of_the_energy(q in six_joints()) {
        for arm in arms() {
            let loads = Loads::on(&arm, &Chain::nominal(&arm, &q), Wrench::ZERO);
            for i in 0..6 {
                let wanted = -slope(|q| energy(&arm, q), &q, i, 1e-5);
                prop_assert!((loads.gravity_torque[i] - wanted).abs() < 1e-5, "joint {i}");
            }
        }
    }

    #[test]
    fn wrench_torque_is_the_virtual_work_per_step_of_the_joint(q in six_joints(), w in any_wrench()) {
        for arm in arms() {
            let chain = Chain::nominal(&arm, &q);
            let loads = Loads::on(&arm, &chain, w);
            let work = |q: &Joints| {
                let moved_tool = Chain::nominal(&arm, q).base_from_tool;
                let moved = moved_tool.origin - chain.base_from_tool.origin;
                let turned = moved_tool.rotation * chain.base_from_tool.rotation.transpose();
                w.force.dot(moved) + w.moment.dot(vector_from_rotation(&turned))
            };
            for i in 0..6 {
                let wanted = slope(work, &q, i, 1e-5);
                prop_assert!((loads.wrench_torque[i] - wanted).abs() < 1e-5, "joint {i}");
            }
        }
    }

    #[test]
    fn moments_at_pivots_and_base_are_sums_over_bodies_one_by_one(q in six_joints(), w in any_wrench()) {
        for arm in arms() {
            let chain = Chain::nominal(&arm, &q);
            let loads = Loads::on(&arm, &chain, w);
            let geometry = Geometry::of(&arm);
            let about = |point: DVec3, first: usize| -> DVec3 {
                let carried = arm.bodies().filter(|(k, _)| *k >= first);
                let weight = |(k, body): (usize, &crate::Body)| {
                    let centre = geometry.body(&q, Some(k)).point(body.centre);
                    (centre - point).cross(arm.gravity * body.mass)
                };
                carried.map(weight).sum()
            };
            for i in 0..6_usize {
                let carrier = i.checked_sub(1);
                let point = geometry.body(&q, carrier).point(arm.joints()[i].point);
                prop_assert!((loads.gravity_at(i).moment - about(point, i)).length() < 1e-10);
                let other = DVec3::new(0.3, -1.0, 2.0);
                let shifted = loads.gravity_at(i).moment_about(point, other);
                prop_assert!((shifted - about(other, i)).length() < 1e-10);
            }
            let tcp = chain.base_from_tool.origin;
            let base = about(DVec3::ZERO, 0) + tcp.cross(w.force) + w.moment;
            prop_assert!((loads.base_moment - base).length() < 1e-10);
        }
    }

    #[test]
    fn the_loads_of_joints_are_the_jacobians_transpose_times_the_wrench(q in six_joints(), w in any_wrench()) {
        for arm in arms() {
            let chain = Chain::nominal(&arm, &q);
            let (loads, jacobian) = (Loads::on(&arm, &chain, w), chain.jacobian(&arm));
            let six = nalgebra::Vector6::from_column_slice(&[w.force.to_array(), w.moment.to_array()].concat());
            let wanted = jacobian.transpose() * six;
            for i in 0..6 {
                prop_assert!((loads.wrench_torque[i] - wanted[i]).abs() < 1e-11);
            }
        }
    }

    /// Maxwell's reciprocity: any elastic structure has a symmetric compliance, and no load may
    /// gain energy.
    #[test]
    fn every_compliance_is_symmetric_and_takes_energy(q in six_joints()) {
        for scene in [scene(), sliding_scene()] {
            let arm = without_masses(&scene.arm);
            let inputs = Inputs { q, ..scene.inputs };
            let mut effects = vec![
                effect(&arm, "base_compliance", None, &[("compliance", &[4e-7])]),
                effect(&arm, "tool_compliance", None, &[("compliance", &[2e-6, 1e-6, 5e-7])]),
            ];
            for i in 0..6 {
                effects.push(effect(&arm, "joint_compliance", i, &[("compliance", &[2e-6])]));
                effects.push(effect(&arm, "bearing_compliance", i, &[("compliance", &[3e-7])]));
            }
            let matrix = compliance_matrix(&arm, &inputs, &effects);
            let asymmetry = (matrix - matrix.transpose()).norm() / matrix.norm();
            prop_assert!(asymmetry < 1e-7, "{asymmetry}");
            let smallest = ((matrix + matrix.transpose()) * 0.5).symmetric_eigenvalues().min();
            prop_assert!(smallest > -1e-7 * matrix.norm(), "{smallest}");
        }
    }
}

#[test]
fn joint_compliance_gives_the_textbook_compliance_matrix() {
    let scene = scene();
    let arm = without_masses(&scene.arm);
    let jacobian = Chain::nominal(&arm, &scene.inputs.q).jacobian(&arm);
    let compliances = [2.5e-6, 2.2e-6, 1.1e-5, 1.1e-4, 3.3e-4, 3e-4];
    let effects: Vec<_> = (0..6)
        .map(|i| effect(&arm, "joint_compliance", i, &[("compliance", &compliances[i..=i])]))
        .collect();
    let found = compliance_matrix(&arm, &scene.inputs, &effects);
    let columns = jacobian.fixed_columns::<6>(0);
    let diagonal = Matrix6::from_diagonal(&compliances.into());
    let wanted = columns * diagonal * columns.transpose();
    assert!((found - wanted).norm() < 1e-7 * wanted.norm(), "{found} not {wanted}");
}
