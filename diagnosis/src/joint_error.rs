//! Errors of a joint at equal steps of its sweep, in both directions (thesis 3.5 and the measurements behind 3.7 to 3.18).
//!
//! The angle of each target about the estimated axis, compared with the command; targets are weighted by the square of their
//! radius. Radial noise displaces the estimated axis, which appears in the angles as a sine and cosine of the joint angle,
//! like gravity: [`JointErrors`] contains the uncertainty of this.
//!
//! Sign: actual minus commanded (the thesis plots the opposite), precise for small angles. The joint offset is not estimated, because a sweep of one
//! joint does not determine it.

use crate::qr::QrFactor;
use crate::single_joint::{JointAxis, SAME_STEP_RAD, Sweep, angle_about};
use glam::DVec3;
use physics::frame::{normals, rotation_about};
use physics::{Inputs, JOINTS_MAX, Model};

/// Error of a joint at one commanded position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepError {
    /// Inputs of the model; `direction` is 0, because the mean is over both directions.
    pub inputs: Inputs,
    /// Commanded position, rad.
    pub position_rad: f64,
    /// Actual minus commanded, mean of both directions if both were measured, rad.
    pub mean_rad: f64,
    /// Standard uncertainty of the mean due to the noise of this step's points, rad.
    pub sigma_rad: f64,
    /// Derivative of the mean by a shift of the axis along its two normals, rad/m. The shift is common to all steps of a sweep and therefore not
    /// included in the standard uncertainty.
    pub by_shift: [f64; 2],
    /// Half the difference between downward and upward approach, rad: half the width of `backlash`. `None` unless both directions were measured.
    pub half_lost_motion_rad: Option<f64>,
}

/// The errors along one sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct JointErrors {
    /// 0-based.
    pub joint: usize,
    /// In increasing order of the joint's position.
    pub steps: Vec<StepError>,
    /// Covariance of the shifts of the axis along its two normals, m².
    pub shift_covariance: [[f64; 2]; 2],
}

/// One target at one step.
struct TargetAngle {
    step: usize,
    target: usize,
    /// Angle relative to the command, minus its value at the first measurement of this target, rad.
    angle: f64,
    by_shift: [f64; 2],
}

/// One step, averaged over its targets.
struct StepAngle {
    step: usize,
    angle: f64,
    sigma: f64,
    by_shift: [f64; 2],
}

impl Sweep {
    /// Errors of the joint at each step about the axis `found`, relative to the step nearest to `zero_at_rad`, because a sweep does not determine the
    /// offset.
    #[must_use]
    pub fn errors(&self, model: &Model, found: &JointAxis, zero_at_rad: f64) -> JointErrors {
        let read = self.angles(model, found);
        let mut order: Vec<&StepAngle> = read.iter().collect();
        let position = |read: &StepAngle| self.steps[read.step].inputs.q[self.joint];
        order.sort_by(|a, b| position(a).total_cmp(&position(b)));
        let same = |a: &&StepAngle, b: &&StepAngle| position(b) - position(a) <= SAME_STEP_RAD;
        let mut steps: Vec<StepError> =
            order.chunk_by(same).filter_map(|group| self.step_error(group)).collect();
        let away = |error: &StepError| (error.position_rad - zero_at_rad).abs();
        let zero = steps.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
        let zero = zero.map_or(0.0, |error| error.mean_rad);
        steps.iter_mut().for_each(|error| error.mean_rad -= zero);
        let shift_covariance = [2, 3].map(|i| [2, 3].map(|j| found.axis.covariance[i][j]));
        JointErrors { joint: self.joint, steps, shift_covariance }
    }

    /// Angle minus command for each step with a target, up to a constant.
    fn angles(&self, model: &Model, found: &JointAxis) -> Vec<StepAngle> {
        let weights: Vec<f64> =
            found.axis.circles.iter().map(|circle| circle.radius_m * circle.radius_m).collect();
        let ahead = self.target_angles(model, found);
        let starts = starting_angles(&ahead, &weights);
        let one = |step: &[TargetAngle]| -> Option<StepAngle> {
            let weight: f64 = step.iter().map(|reading| weights[reading.target]).sum();
            let mean = |quantity: &dyn Fn(&TargetAngle) -> f64| -> f64 {
                step.iter().map(|reading| weights[reading.target] * quantity(reading)).sum::<f64>()
                    / weight
            };
            Some(StepAngle {
                step: step.first()?.step,
                angle: mean(&|reading| reading.angle - starts[reading.target]),
                sigma: found.axis.residual_rms_m / weight.sqrt(),
                by_shift: [0, 1].map(|n| mean(&|reading| reading.by_shift[n])),
            })
        };
        ahead.chunk_by(|a, b| a.step == b.step).filter_map(one).collect()
    }

    fn target_angles(&self, model: &Model, found: &JointAxis) -> Vec<TargetAngle> {
        let e = found.axis.direction;
        let (n1, n2) = normals(e);
        let mut first: Vec<Option<(DVec3, f64)>> = vec![None; found.targets.len()];
        let mut ahead = Vec::new();
        for (i, step) in self.steps.iter().enumerate() {
            let points = self.without_sag(step, model, found.sag);
            let q = step.inputs.q[self.joint];
            for (target, (place, first)) in found.targets.iter().zip(&mut first).enumerate() {
                let Some(point) = points.get(*place).copied().flatten() else { continue };
                let lever = point - found.axis.point;
                let (from, q0) = *first.get_or_insert((lever, q));
                let angle = angle_about(e, rotation_about(e, q - q0) * from, lever);
                let across = lever - e * e.dot(lever);
                let rate = e.cross(across) / across.length_squared().max(f64::MIN_POSITIVE);
                let by_shift = [-rate.dot(n1), -rate.dot(n2)];
                ahead.push(TargetAngle { step: i, target, angle, by_shift });
            }
        }
        ahead
    }

    fn step_error(&self, group: &[&StepAngle]) -> Option<StepError> {
        let mut inputs = self.steps[group.first()?.step].inputs;
        let side = |wanted: fn(f64) -> bool| -> Option<(f64, f64)> {
            let readings = group.iter();
            let readings =
                readings.filter(|read| wanted(self.steps[read.step].inputs.direction[self.joint]));
            let (n, sum, variance) = readings.fold((0.0, 0.0, 0.0), |(n, s, v), read| {
                (n + 1.0, s + read.angle, v + read.sigma * read.sigma)
            });
            (n > 0.0).then(|| (sum / n, variance / (n * n)))
        };
        let (up, down) = (side(|d| d > 0.0), side(|d| d < 0.0));
        let (mean_rad, variance, half_lost_motion_rad) = match (up, down) {
            (Some(up), Some(down)) => {
                (0.5 * (up.0 + down.0), 0.25 * (up.1 + down.1), Some(0.5 * (down.0 - up.0)))
            }
            _ => side(|_| true).map(|(mean, variance)| (mean, variance, None))?,
        };
        let share = 1.0 / group.len() as f64;
        let by_shift =
            [0, 1].map(|n| group.iter().map(|read| read.by_shift[n]).sum::<f64>() * share);
        let position_rad = inputs.q[self.joint];
        inputs.q_before = inputs.q;
        inputs.direction = [0.0; JOINTS_MAX];
        let sigma_rad = variance.sqrt();
        Some(StepError {
            inputs,
            position_rad,
            mean_rad,
            sigma_rad,
            by_shift,
            half_lost_motion_rad,
        })
    }
}

/// Initial angle error of each target relative to the first target: targets measured from different steps on would otherwise distort those steps.
/// Least squares over all measurements; the error of the step itself cancels.
fn starting_angles(ahead: &[TargetAngle], weights: &[f64]) -> Vec<f64> {
    let mut triangle = QrFactor::new(weights.len());
    for step in ahead.chunk_by(|a, b| a.step == b.step) {
        let all: f64 = step.iter().map(|reading| weights[reading.target]).sum();
        let middle =
            step.iter().map(|reading| weights[reading.target] * reading.angle).sum::<f64>() / all;
        for reading in step {
            let mut row = vec![0.0; weights.len()];
            step.iter().for_each(|other| row[other.target] -= weights[other.target] / all);
            row[reading.target] += 1.0;
            row[0] = 0.0;
            let scale = weights[reading.target].sqrt();
            row.iter_mut().for_each(|x| *x *= scale);
            triangle.push(&row, scale * (reading.angle - middle));
        }
    }
    triangle.reduce();
    triangle.solve(&[])
}
