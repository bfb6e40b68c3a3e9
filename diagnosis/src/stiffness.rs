//! Joint stiffness from known loads: joint by joint (thesis 3.13), or of all joints simultaneously by least squares (thesis 1.1 to 1.7).
//!
//! Uses differences, loaded minus unloaded at the same command: geometry, gravity deflection and offsets cancel. Joint by joint, the rotation of a link
//! about its joint follows by `angle_about` from the displacement of a target, after the rotations of the preceding joints are removed (equation 3.13
//! divides outside its arccosine, and an arccosine loses small angles and the sign). Simultaneously, `dx = J diag(JᵀW) c` is linear in the compliances
//! `c`; each row is divided by its noise, which makes metres and radians comparable.
//!
//! Errors of compliances, not of stiffnesses, are approximately normal: covariances refer to compliances. Parameters that the loads do not determine
//! are listed. Stiffening by the load itself is neglected; see [`crate::enhanced_stiffness`].

use crate::hypothesis::{FreeParameter, Hypothesis, PriorSource};
use crate::identifiability::split_identifiable;
use crate::qr::QrFactor;
use crate::single_joint::angle_about;
use glam::DVec3;
use physics::frame::rotation_about;
use physics::{
    AnyEffect, Arm, Chain, JOINTS_MAX, JointKind, Joints, Loads, ParameterValues, Wrench,
};
use thiserror::Error;

/// Largest compliance of an undamaged joint, rad/Nm (m/N): the unit in which a compliance counts as determined or not.
const WIDEST: f64 = 2e-3;

/// A target on the link that a joint moves, measured before and after a load is applied at the TCP.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadedLink {
    /// 0-based: the joint that moves the link.
    pub joint: usize,
    /// Commanded position, rad.
    pub q: Joints,
    /// Applied wrench, at the TCP, base axes.
    pub wrench_base: Wrench,
    /// Target position before, m, base frame.
    pub before: DVec3,
    /// Target position under the load, m, base frame.
    pub after: DVec3,
}

/// Displacement of the tool by a load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadedPose {
    /// Commanded position, rad or m.
    pub q: Joints,
    /// Applied wrench, at the TCP, base axes.
    pub wrench_base: Wrench,
    /// Displacement of the TCP, m, base axes.
    pub shift: DVec3,
    /// Rotation of the tool if measured: rotation vector, rad, base axes.
    pub turn: Option<DVec3>,
}

/// Standard deviations of one coordinate of a difference, loaded minus unloaded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferenceNoise {
    /// Of a translation, m.
    pub shift_m: f64,
    /// Of a rotation, rad; used only if rotations were measured.
    pub turn_rad: f64,
}

/// Compliances estimated from loads.
#[derive(Clone, Debug, PartialEq)]
pub struct Compliances {
    /// rad/Nm or m/N; `None` for a joint that the loads do not determine, which was treated as rigid.
    pub value: [Option<f64>; JOINTS_MAX],
    /// rad²/(Nm)²: a row and column per joint, zero where not determined.
    pub covariance: [[f64; JOINTS_MAX]; JOINTS_MAX],
    /// Root mean square residual in units of the stated noise: near 1 if the model is adequate.
    pub normalised_rms: f64,
    /// Joints that are confounded with preceding ones, or that no load deflects, 0-based.
    pub undetermined: Vec<usize>,
}

/// Why loads do not determine stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum StiffnessError {
    /// A value is not finite.
    #[error("loaded case {case}: its numbers must be finite")]
    NotFinite {
        /// 1-based.
        case: usize,
    },
    /// Noise that is not positive and finite.
    #[error("the noise of the measurement must be above zero")]
    Noise,
    /// A joint that the arm does not have, or that is prismatic.
    #[error("loaded case {case}: joint {joint} is not a revolute joint of this arm")]
    NotRevolute {
        /// 1-based.
        case: usize,
        /// 1-based.
        joint: usize,
    },
}

impl Compliances {
    /// Stiffness of a joint and its standard uncertainty, Nm/rad, to first order; `None` if it is not determined or not positive.
    #[must_use]
    pub fn stiffness(&self, joint: usize) -> Option<(f64, f64)> {
        let compliance = (*self.value.get(joint)?)?;
        (compliance > 0.0)
            .then(|| (1.0 / compliance, self.sigma(joint) / (compliance * compliance)))
    }

    /// Standard uncertainty of a compliance, rad/Nm (m/N).
    #[must_use]
    pub fn sigma(&self, joint: usize) -> f64 {
        self.covariance.get(joint).map_or(0.0, |row| row[joint].sqrt())
    }

    /// Transfers determined compliances to a global fit: as value and prior of `joint_compliance` or `load_compliance`, or of a new `load_compliance`
    /// if a joint has neither. Negative estimates are replaced by zero.
    ///
    /// # Errors
    /// More effects than a model has room for.
    pub fn transfer_to(&self, hypothesis: &mut Hypothesis) -> Result<(), physics::ModelError> {
        for joint in 0..hypothesis.model.arm.count() {
            let Some(mean) = self.value[joint] else { continue };
            let takes = |effect: &AnyEffect| {
                ["joint_compliance", "load_compliance"].contains(&effect.spec().kind)
                    && effect.joint() == Some(joint)
            };
            let found = hypothesis.model.effects().position(takes);
            let given = [("compliance", &[mean.max(0.0)][..])];
            let index = match found {
                Some(index) => index,
                None => {
                    let built = AnyEffect::build(
                        "load_compliance",
                        &hypothesis.model.arm,
                        Some(joint),
                        ParameterValues(&given),
                    );
                    let Ok(effect) = built else { continue };
                    hypothesis.model.push(effect)?;
                    hypothesis.model.effects().len() - 1
                }
            };
            hypothesis.model.change(index, |effect| effect.values_mut()[0] = mean.max(0.0));
            hypothesis.free.retain(|free| free.effect != index);
            let sigma = self.sigma(joint);
            hypothesis.free.push(FreeParameter {
                effect: index,
                value: 0,
                mean,
                sigma,
                prior_source: PriorSource::Stated,
            });
        }
        Ok(())
    }
}

/// Estimates joint by joint, from the base on, each from the targets on the link that it moves. `noise_m` is the standard deviation of one
/// coordinate of one point.
///
/// # Errors
/// Invalid cases, see [`StiffnessError`].
pub fn estimate_joint_by_joint(
    arm: &Arm,
    cases: &[LoadedLink],
    noise_m: f64,
) -> Result<Compliances, StiffnessError> {
    check_noise(noise_m)?;
    for (i, case) in cases.iter().enumerate() {
        let revolute = arm.joints().get(case.joint).is_some_and(|j| j.kind == JointKind::Revolute);
        if !revolute {
            return Err(StiffnessError::NotRevolute { case: i + 1, joint: case.joint + 1 });
        }
        let finite = case.before.is_finite() && case.after.is_finite();
        check_case(i, &case.q, &case.wrench_base, finite)?;
    }
    let mut found = Compliances::none();
    let (mut square, mut rows) = (0.0, 0_usize);
    for joint in 0..arm.count() {
        let rotations: Vec<JointRotation> = cases
            .iter()
            .filter(|case| case.joint == joint)
            .map(|case| joint_rotation(arm, case, &found.value, noise_m))
            .collect();
        let load: f64 = rotations.iter().map(|s| s.torque * s.torque / s.variance).sum();
        let mut loads = QrFactor::new(1);
        loads.push_one(0, load.sqrt(), 0.0);
        loads.reduce();
        if split_identifiable(&loads, &[WIDEST]).0.is_empty() {
            found.undetermined.push(joint);
            continue;
        }
        let mean = |quantity: &dyn Fn(&JointRotation) -> f64| -> f64 {
            rotations.iter().map(|s| s.torque * quantity(s) / s.variance).sum::<f64>() / load
        };
        let value = mean(&|s| s.angle);
        let by_before: [f64; JOINTS_MAX] = std::array::from_fn(|k| mean(&|s| s.by_before[k]));
        found.insert(joint, value, 1.0 / load, &by_before);
        let left = |s: &JointRotation| (s.angle - value * s.torque).powi(2) / s.variance;
        square += rotations.iter().map(left).sum::<f64>();
        rows += rotations.len();
    }
    let free = rows.saturating_sub(found.value.iter().flatten().count()).max(1);
    found.normalised_rms = (square / free as f64).sqrt();
    Ok(found)
}

/// Estimates all joints simultaneously: weighted least squares of `dx = J diag(JᵀW) c`.
///
/// # Errors
/// Invalid poses or noise, see [`StiffnessError`].
pub fn estimate_simultaneously(
    arm: &Arm,
    poses: &[LoadedPose],
    noise: DifferenceNoise,
) -> Result<Compliances, StiffnessError> {
    check_noise(noise.shift_m)?;
    if poses.iter().any(|pose| pose.turn.is_some()) {
        check_noise(noise.turn_rad)?;
    }
    let count = arm.count();
    let mut triangle = QrFactor::new(count);
    for (i, pose) in poses.iter().enumerate() {
        let finite = pose.shift.is_finite() && pose.turn.is_none_or(DVec3::is_finite);
        check_case(i, &pose.q, &pose.wrench_base, finite)?;
        let chain = Chain::nominal(arm, &pose.q);
        let torque = Loads::on(arm, &chain, pose.wrench_base).wrench_torque;
        let jacobian = chain.jacobian(arm);
        let mut push = |row: usize, moved: f64, sigma: f64| {
            let entries: Vec<f64> =
                (0..count).map(|j| jacobian[(row, j)] * torque[j] / sigma).collect();
            triangle.push(&entries, moved / sigma);
        };
        (0..3).for_each(|row| push(row, pose.shift[row], noise.shift_m));
        if let Some(turn) = pose.turn {
            (0..3).for_each(|row| push(3 + row, turn[row], noise.turn_rad));
        }
    }
    triangle.reduce();
    let (kept, others) = split_identifiable(&triangle, &vec![WIDEST; count]);
    let part = triangle.of_columns(&kept);
    let inverse = part.inverse();
    let mut found = Compliances::none();
    found.undetermined = others.iter().map(|dependent| dependent.column).collect();
    for (a, (joint, value)) in kept.iter().zip(part.solve(&[])).enumerate() {
        found.value[*joint] = Some(value);
        for (b, other) in kept.iter().enumerate() {
            found.covariance[*joint][*other] =
                (a.max(b)..kept.len()).map(|k| inverse[a][k - a] * inverse[b][k - b]).sum();
        }
    }
    let free = part.rows().saturating_sub(kept.len()).max(1);
    found.normalised_rms = (part.rest() / free as f64).sqrt();
    Ok(found)
}

impl Compliances {
    fn none() -> Self {
        Self {
            value: [None; JOINTS_MAX],
            covariance: [[0.0; JOINTS_MAX]; JOINTS_MAX],
            normalised_rms: 0.0,
            undetermined: Vec::new(),
        }
    }

    /// Adds a joint whose estimate depends on those of the preceding joints.
    fn insert(&mut self, joint: usize, value: f64, variance: f64, by_before: &[f64; JOINTS_MAX]) {
        let carried: [f64; JOINTS_MAX] = std::array::from_fn(|m| {
            by_before[..joint].iter().zip(&self.covariance).map(|(d, row)| d * row[m]).sum()
        });
        for (m, of_both) in carried.into_iter().enumerate().take(joint) {
            self.covariance[joint][m] = of_both;
            self.covariance[m][joint] = of_both;
        }
        let of_before: f64 = by_before[..joint].iter().zip(carried).map(|(d, c)| d * c).sum();
        self.covariance[joint][joint] = variance + of_before;
        self.value[joint] = Some(value);
    }
}

/// Rotation of one joint under a load.
struct JointRotation {
    angle: f64,
    variance: f64,
    torque: f64,
    /// Derivative of the angle with respect to the compliance of each preceding joint, Nm.
    by_before: [f64; JOINTS_MAX],
}

fn joint_rotation(
    arm: &Arm,
    case: &LoadedLink,
    known: &[Option<f64>; JOINTS_MAX],
    noise_m: f64,
) -> JointRotation {
    let chain = Chain::nominal(arm, &case.q);
    let torque = Loads::on(arm, &chain, case.wrench_base).wrench_torque;
    let (e, centre) = (chain.axis(case.joint), chain.point(case.joint));
    // The joint nearest to the base moves all others: it is corrected first.
    let mut after = case.after;
    for k in 0..case.joint {
        let angle = known[k].unwrap_or(0.0) * torque[k];
        let (axis, point) = (chain.axis(k), chain.point(k));
        after = point + rotation_about(axis, -angle) * (after - point);
    }
    let lever = case.before - centre;
    let across = lever - e * e.dot(lever);
    let square = across.length_squared();
    // A target on the axis does not move: its variance is infinite.
    let tangent = if square > 0.0 { e.cross(lever) / square } else { DVec3::ZERO };
    let by_before = std::array::from_fn(|k| {
        if k >= case.joint || known[k].is_none() {
            return 0.0;
        }
        -tangent.dot(chain.axis(k).cross(case.before - chain.point(k))) * torque[k]
    });
    JointRotation {
        angle: angle_about(e, lever, after - centre),
        variance: 2.0 * noise_m * noise_m / square,
        torque: torque[case.joint],
        by_before,
    }
}

fn check_noise(noise: f64) -> Result<(), StiffnessError> {
    if noise > 0.0 && noise.is_finite() { Ok(()) } else { Err(StiffnessError::Noise) }
}

fn check_case(i: usize, q: &Joints, wrench: &Wrench, finite: bool) -> Result<(), StiffnessError> {
    let sound = finite
        && q.iter().all(|q| q.is_finite())
        && wrench.force.is_finite()
        && wrench.moment.is_finite();
    if sound { Ok(()) } else { Err(StiffnessError::NotFinite { case: i + 1 }) }
}

#[cfg(test)]
mod tests;
