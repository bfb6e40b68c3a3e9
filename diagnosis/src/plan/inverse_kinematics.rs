//! Inverse kinematics for planning: a tool point on a surface, or position and direction of the tool in a zone.
//!
//! Damped least squares (Wampler 1986; Nakamura and Hanafusa 1986) on the controller's geometry, to 1e-6 m and rad. The caller must check joint
//! limits.

use glam::{DMat3, DVec3};
use nalgebra::{DMatrix, DVector};
use physics::frame::vector_from_rotation;
use physics::{Arm, Chain, Joints};

const ITERATIONS_MAX: usize = 60;
const DAMPING: f64 = 1e-3;
/// Tolerance of convergence, m and rad.
const TOLERANCE: f64 = 1e-6;
/// Largest step of a joint, rad or m.
const STEP_MAX: f64 = 0.3;

/// Joint positions near `q` for which the tool's point `tip` (tool frame, m) lies on a surface. `distance_and_normal` gives the signed distance of a point (base
/// frame, m) from it and the gradient of that distance. `None` if not converged.
#[must_use]
pub fn solve_tip_on_surface(
    arm: &Arm,
    q: &Joints,
    tip: DVec3,
    distance_and_normal: impl Fn(DVec3) -> (f64, DVec3),
) -> Option<Joints> {
    solve(arm, q, |chain| {
        let lever = chain.base_from_tool.rotation * tip;
        let (distance, normal) = distance_and_normal(chain.base_from_tool.origin + lever);
        // d(n·p) = n·v + n·(ω × lever).
        let turned = lever.cross(normal);
        let row = [normal.x, normal.y, normal.z, turned.x, turned.y, turned.z];
        (DMatrix::from_row_slice(1, 6, &row), DVector::from_element(1, -distance))
    })
}

/// Joint positions near `q` with the TCP at `position` (base frame, m) and the tool's z axis along `along`; the rotation about that axis is free. `None` if
/// not converged.
#[must_use]
pub fn solve_tool_axis(arm: &Arm, q: &Joints, position: DVec3, along: DVec3) -> Option<Joints> {
    solve(arm, q, |chain| {
        let axis = chain.base_from_tool.rotation * DVec3::Z;
        let (u, v) = physics::frame::normals(axis);
        // For opposite axes, the axis of rotation is arbitrary.
        let turn = if axis.dot(along) < -0.999 { u } else { axis.cross(along) };
        let rows = [DVec3::X, DVec3::Y, DVec3::Z].map(|e| [e.x, e.y, e.z, 0.0, 0.0, 0.0]);
        let turns = [u, v].map(|e| [0.0, 0.0, 0.0, e.x, e.y, e.z]);
        let all: Vec<f64> = rows.into_iter().chain(turns).flatten().collect();
        let offset = position - chain.base_from_tool.origin;
        let right = [offset.x, offset.y, offset.z, turn.dot(u), turn.dot(v)];
        (DMatrix::from_row_slice(5, 6, &all), DVector::from_row_slice(&right))
    })
}

/// Joint positions near `q` with the TCP at `position` (base frame, m) and orientation `base_from_tool`. `None` if not converged.
#[must_use]
pub fn solve_tool_pose(
    arm: &Arm,
    q: &Joints,
    position: DVec3,
    base_from_tool: &DMat3,
) -> Option<Joints> {
    solve(arm, q, |chain| {
        let tool = &chain.base_from_tool;
        let turn = vector_from_rotation(&(*base_from_tool * tool.rotation.transpose()));
        let offset = position - tool.origin;
        let right = [offset.x, offset.y, offset.z, turn.x, turn.y, turn.z];
        (DMatrix::identity(6, 6), DVector::from_row_slice(&right))
    })
}

/// Iterates steps towards `wanted` (rows over the tool's motion, right-hand sides) until the right-hand side is below the tolerance.
fn solve(
    arm: &Arm,
    q: &Joints,
    equations: impl Fn(&Chain) -> (DMatrix<f64>, DVector<f64>),
) -> Option<Joints> {
    let count = arm.count();
    let mut q = *q;
    for _ in 0..ITERATIONS_MAX {
        let chain = Chain::nominal(arm, &q);
        let (rows, right) = equations(&chain);
        if right.amax() < TOLERANCE {
            return Some(q);
        }
        let jacobian = chain.jacobian(arm);
        let jacobian = &rows * jacobian.columns(0, count);
        let left = right.len();
        let square = &jacobian * jacobian.transpose()
            + DMatrix::identity(left, left) * (DAMPING * right.amax().min(1.0));
        let step = jacobian.transpose() * square.cholesky()?.solve(&right);
        let shorter = (STEP_MAX / step.amax().max(1e-12)).min(1.0);
        q.iter_mut().zip(step.iter()).for_each(|(q, by)| *q += shorter * by);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_campaigns::nominal_robot;

    #[test]
    fn the_tool_ends_where_it_was_asked_to_be() {
        let arm = nominal_robot().arm;
        let start = Joints::default();
        let (position, along) = (DVec3::new(0.7, 0.2, 0.6), DVec3::NEG_Z);
        let q = solve_tool_axis(&arm, &start, position, along).expect("reached");
        let tool = Chain::nominal(&arm, &q).base_from_tool;
        assert!(
            tool.origin.distance(position) < 2e-6
                && (tool.rotation * DVec3::Z).dot(along) > 1.0 - 1e-9
        );
        let again = solve_tool_pose(&arm, &start, position, &tool.rotation).expect("reached");
        let reached = Chain::nominal(&arm, &again).base_from_tool;
        assert!(reached.origin.distance(position) < 2e-6);
        assert!(
            vector_from_rotation(&(reached.rotation * tool.rotation.transpose())).length() < 2e-6
        );
        let tip = DVec3::new(0.05, 0.0, 0.1);
        let distance_and_normal = |p: DVec3| (p.z - 0.4, DVec3::Z);
        let q = solve_tip_on_surface(&arm, &start, tip, distance_and_normal).expect("reached");
        assert!((Chain::nominal(&arm, &q).base_from_tool.point(tip).z - 0.4).abs() < 2e-6);
        assert_eq!(solve_tool_axis(&arm, &start, DVec3::splat(5.0), along), None, "out of reach");
    }
}
