//! Inverse kinematics on the controller's geometry.
//!
//! Damped Newton: `Δq = Jᵀ (J Jᵀ + λ² I)⁻¹ e` with `λ² = ½ |e|²`, which vanishes with the error
//! (Sugihara, IEEE T-RO 27(5), 2011); a redundant arm takes the minimum-norm step. e: pose error, m
//! and rad.
//!
//! A solution is accurate to 1e-12 m and rad on [`Chain::nominal`] and within the joint limits.
//! Effects are compensated by the corrector, not here. Not for hard real time.

use glam::DVec3;
use nalgebra::{Cholesky, SMatrix, SVector};
use physics::frame::vector_from_rotation;
use physics::{Arm, Chain, Frame, JOINTS_MAX, JointKind, Joints};
use thiserror::Error;

const ITERATIONS: usize = 200;
/// Below the stated accuracy, so that subtracting whole turns, with its rounding, keeps it.
const TOLERANCE: f64 = 1e-13;
const STEP_MAX: f64 = 0.3;
const SEEDS: u32 = 96;

/// Why there are no joint positions.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum IkError {
    /// An arm of fewer than six joints cannot reach an arbitrary pose.
    #[error("the arm has {0} joints, a tool pose needs at least 6")]
    TooFewJoints(usize),
    /// The pose is out of reach, or singular.
    #[error(
        "the tool pose is out of reach by {position_m:.6} m and {angle_rad:.6} rad; move the workpiece nearer"
    )]
    OutOfReach {
        /// Remaining distance, m.
        position_m: f64,
        /// Remaining angle, rad.
        angle_rad: f64,
    },
    /// A joint (1-based) would leave its limits.
    #[error("joint {joint} would be at {position:.4} (rad or m), outside its limits")]
    Limits {
        /// 1-based.
        joint: usize,
        /// rad or m.
        position: f64,
    },
}

/// Joint positions with the tool at `wanted` (base frame), starting from `start`.
///
/// # Errors
/// See [`IkError`].
pub fn solve(arm: &Arm, wanted: &Frame, start: &Joints) -> Result<Joints, IkError> {
    if arm.count() < 6 {
        return Err(IkError::TooFewJoints(arm.count()));
    }
    let mut q = *start;
    for _ in 0..ITERATIONS {
        let chain = Chain::nominal(arm, &q);
        let (position, angle) = error(wanted, &chain.base_from_tool);
        if position.length() < TOLERANCE && angle.length() < TOLERANCE {
            return within_limits(arm, q);
        }
        step(arm, &chain, position, angle, &mut q);
    }
    let left = error(wanted, &Chain::nominal(arm, &q).base_from_tool);
    Err(IkError::OutOfReach { position_m: left.0.length(), angle_rad: left.1.length() })
}

/// Joint positions for `wanted` without a starting pose: of the solutions from many fixed starts,
/// the one nearest to the zero configuration among those far enough from singular poses and joint
/// limits, if there are any.
///
/// # Errors
/// The error of the last start, if none succeeded.
pub fn start_pose(arm: &Arm, wanted: &Frame) -> Result<Joints, IkError> {
    let mut found: Vec<(f64, f64, Joints)> = Vec::new();
    let mut failure = IkError::TooFewJoints(arm.count());
    for k in 0..SEEDS {
        match solve(arm, wanted, &seed(arm, k)) {
            Ok(q) => {
                let distance: f64 = q.iter().map(|x| x * x).sum();
                found.push((clearance(arm, &q), distance, q));
            }
            Err(error) => failure = error,
        }
    }
    let best = found.iter().map(|(clear, ..)| *clear).fold(0.0, f64::max);
    let clear = found.iter().filter(|(clear, ..)| *clear >= 0.2 * best);
    clear.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(.., q)| *q).ok_or(failure)
}

/// Distance of a pose from singular poses and joint limits: its manipulability, reduced within 0.2
/// rad (m) of a limit.
pub fn clearance(arm: &Arm, q: &Joints) -> f64 {
    let margins = arm.joints().iter().zip(q).map(|(j, q)| (q - j.limits.0).min(j.limits.1 - q));
    let margin_min = margins.fold(f64::INFINITY, f64::min).max(0.0);
    manipulability(arm, q) * (margin_min / 0.2).min(1.0)
}

/// `sqrt(det(J Jᵀ))` (Yoshikawa 1985), in mixed units: only for comparing poses of one arm.
pub fn manipulability(arm: &Arm, q: &Joints) -> f64 {
    let jacobian = Chain::nominal(arm, q).jacobian(arm);
    let square: SMatrix<f64, 6, 6> = jacobian * jacobian.transpose();
    libm::sqrt(square.determinant().max(0.0))
}

fn error(wanted: &Frame, now: &Frame) -> (DVec3, DVec3) {
    let turn = wanted.rotation * now.rotation.transpose();
    (wanted.origin - now.origin, vector_from_rotation(&turn))
}

fn step(arm: &Arm, chain: &Chain, position: DVec3, angle: DVec3, q: &mut Joints) {
    let jacobian = chain.jacobian(arm);
    let error =
        SVector::<f64, 6>::new(position.x, position.y, position.z, angle.x, angle.y, angle.z);
    let damping = 0.5 * error.norm_squared() + 1e-18;
    let square = jacobian * jacobian.transpose() + SMatrix::<f64, 6, 6>::identity() * damping;
    let Some(factor) = Cholesky::new(square) else { return };
    let delta: SVector<f64, JOINTS_MAX> = jacobian.transpose() * factor.solve(&error);
    let scale = (STEP_MAX / delta.amax().max(STEP_MAX)).min(1.0);
    for (q, delta) in q.iter_mut().zip(delta.iter()).take(arm.count()) {
        *q += scale * delta;
    }
}

/// Subtracts whole turns if that brings a joint back within its limits.
fn within_limits(arm: &Arm, mut q: Joints) -> Result<Joints, IkError> {
    for (i, joint) in arm.joints().iter().enumerate() {
        let (low, high) = joint.limits;
        if joint.kind == JointKind::Revolute && !(low..=high).contains(&q[i]) {
            let turn = core::f64::consts::TAU;
            q[i] -= turn * libm::ceil((q[i] - high) / turn);
        }
        if !(low..=high).contains(&q[i]) {
            return Err(IkError::Limits { joint: i + 1, position: q[i] });
        }
    }
    Ok(q)
}

/// Fixed starts spread over the joints' ranges (a Kronecker sequence; a revolute range is reduced
/// to ±half a turn).
fn seed(arm: &Arm, k: u32) -> Joints {
    let mut q = [0.0; JOINTS_MAX];
    for (i, joint) in arm.joints().iter().enumerate() {
        let (mut low, mut high) = joint.limits;
        if joint.kind == JointKind::Revolute {
            (low, high) = (low.max(-core::f64::consts::PI), high.min(core::f64::consts::PI));
        }
        let prime = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0][i % 8];
        let spread = (0.5 + f64::from(k) * libm::sqrt(prime)) % 1.0;
        q[i] = low + (high - low) * spread;
    }
    q
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_arm::{irb1600, seven_joints};
    use proptest::prelude::*;

    fn closes(arm: &Arm, wanted: &Frame, q: &Joints) -> bool {
        let reached = Chain::nominal(arm, q).base_from_tool;
        let (position, angle) = error(wanted, &reached);
        position.length() < 1e-12 && angle.length() < 1e-12 && arm.within_limits(q)
    }

    proptest! {
        #[test]
        fn the_solution_closes_on_the_forward_kinematics(
            x in 0.6..0.9_f64, y in -0.3..0.3_f64, z in 0.3..0.6_f64, tilt in -0.3..0.3_f64,
        ) {
            for (arm, scale) in [(irb1600(), 1.0), (seven_joints(), 0.7)] {
                let direction = DVec3::new(libm::sin(tilt), 0.0, -libm::cos(tilt));
                let rotation = crate::path::tool_along(direction, arm.tool.base_from_tool);
                let wanted = Frame::new(rotation, DVec3::new(x, y, z) * scale);
                let q = start_pose(&arm, &wanted).expect("within reach");
                prop_assert!(closes(&arm, &wanted, &q));
                prop_assume!(clearance(&arm, &q) > 0.01);
                let moved = Frame::new(rotation, wanted.origin + DVec3::new(1e-3, -2e-3, 5e-4));
                let solution = solve(&arm, &moved, &q).expect("a step away");
                prop_assert!(closes(&arm, &moved, &solution));
                prop_assert!((0..arm.count()).all(|i| (solution[i] - q[i]).abs() < 0.1));
            }
        }
    }

    #[test]
    fn an_unreachable_pose_is_reported_with_the_remaining_distance() {
        let arm = irb1600();
        let wanted = Frame::new(arm.tool.base_from_tool, DVec3::new(3.0, 0.0, 0.5));
        let Err(IkError::OutOfReach { position_m, .. }) = solve(&arm, &wanted, &seed(&arm, 0))
        else {
            panic!("expected out of reach");
        };
        assert!((1.0..2.5).contains(&position_m), "{position_m}");
    }

    #[test]
    fn an_arm_of_five_joints_is_refused() {
        let arm = irb1600();
        let five = Arm::new(&arm.joints()[..5], arm.tool, arm.gravity).expect("a sound arm");
        let refused = start_pose(&five, &Frame::IDENTITY);
        assert_eq!(refused, Err(IkError::TooFewJoints(5)));
    }
}
