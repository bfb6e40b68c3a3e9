//! Errors of a joint at equal steps of its sweep, in both directions (thesis 3.5 and the measurements behind 3.7 to 3.18).
//!
//! The angle of each target about the estimated axis, compared with the command; targets are weighted by the square of their radius. Radial noise displaces
//! the estimated axis, which appears in the angles as a sine and cosine of the joint angle, like gravity: [`JointErrors`] contains the uncertainty of this.
//!
//! Promises: actual minus commanded (the thesis plots the opposite), signed, precise for small angles. Never: the joint's zero, which a sweep of one joint does not determine.

use crate::single_joint::{JointAxis, SAME_STEP_RAD, Sweep, angle_about};
use crate::triangle::Triangle;
use glam::DVec3;
use physics::frame::{normals, rotation_about};
use physics::{Inputs, JOINTS_MAX, Model};

/// What a joint does at one commanded position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepError {
    /// What was commanded; `direction` is 0, since both directions go into the mean.
    pub inputs: Inputs,
    /// Commanded, rad.
    pub position_rad: f64,
    /// Actual minus commanded, the mean of both directions where both were seen, rad.
    pub mean_rad: f64,
    /// Standard uncertainty of the mean by the noise of this step's points, rad.
    pub sigma_rad: f64,
    /// How the mean changes as the axis is shifted along its two normals, rad/m: alike for all steps of a sweep, hence no part of the sigma.
    pub by_shift: [f64; 2],
    /// Half of what arriving downwards shows more than arriving upwards, rad: half of `backlash`'s width. `None` without both directions.
    pub half_lost_motion_rad: Option<f64>,
}

/// The errors along one sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct JointErrors {
    /// 0-based.
    pub joint: usize,
    /// In rising order of the joint's position.
    pub steps: Vec<StepError>,
    /// Covariance of the axis' shifts along its two normals, m².
    pub shift_covariance: [[f64; 2]; 2],
}

/// One target's part in one step.
struct Seen {
    step: usize,
    target: usize,
    /// Ahead of the command, from where this target was first seen, rad.
    angle: f64,
    by_shift: [f64; 2],
}

/// One step as all its targets show it.
struct Read {
    step: usize,
    angle: f64,
    sigma: f64,
    by_shift: [f64; 2],
}

impl Sweep {
    /// What the joint does at each step about `found`. Zero at the step nearest to `zero_at_rad`: a sweep does not see the zero.
    #[must_use]
    pub fn errors(&self, model: &Model, found: &JointAxis, zero_at_rad: f64) -> JointErrors {
        let read = self.angles(model, found);
        let mut order: Vec<&Read> = read.iter().collect();
        let position = |read: &Read| self.steps[read.step].inputs.q[self.joint];
        order.sort_by(|a, b| position(a).total_cmp(&position(b)));
        let same = |a: &&Read, b: &&Read| position(b) - position(a) <= SAME_STEP_RAD;
        let mut steps: Vec<StepError> =
            order.chunk_by(same).filter_map(|group| self.step_error(group)).collect();
        let away = |error: &StepError| (error.position_rad - zero_at_rad).abs();
        let zero = steps.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
        let zero = zero.map_or(0.0, |error| error.mean_rad);
        steps.iter_mut().for_each(|error| error.mean_rad -= zero);
        let shift_covariance = [2, 3].map(|i| [2, 3].map(|j| found.axis.covariance[i][j]));
        JointErrors { joint: self.joint, steps, shift_covariance }
    }

    /// For each step with a target: how far it stands ahead of the command, up to a constant.
    fn angles(&self, model: &Model, found: &JointAxis) -> Vec<Read> {
        let weights: Vec<f64> =
            found.axis.circles.iter().map(|circle| circle.radius_m * circle.radius_m).collect();
        let ahead = self.seen(model, found);
        let starts = starting_angles(&ahead, &weights);
        let one = |step: &[Seen]| -> Option<Read> {
            let weight: f64 = step.iter().map(|seen| weights[seen.target]).sum();
            let mean = |of: &dyn Fn(&Seen) -> f64| -> f64 {
                step.iter().map(|seen| weights[seen.target] * of(seen)).sum::<f64>() / weight
            };
            Some(Read {
                step: step.first()?.step,
                angle: mean(&|seen| seen.angle - starts[seen.target]),
                sigma: found.axis.left_m / weight.sqrt(),
                by_shift: [0, 1].map(|n| mean(&|seen| seen.by_shift[n])),
            })
        };
        ahead.chunk_by(|a, b| a.step == b.step).filter_map(one).collect()
    }

    fn seen(&self, model: &Model, found: &JointAxis) -> Vec<Seen> {
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
                ahead.push(Seen { step: i, target, angle, by_shift });
            }
        }
        ahead
    }

    fn step_error(&self, group: &[&Read]) -> Option<StepError> {
        let mut inputs = self.steps[group.first()?.step].inputs;
        let side = |wanted: fn(f64) -> bool| -> Option<(f64, f64)> {
            let here = group.iter();
            let here =
                here.filter(|read| wanted(self.steps[read.step].inputs.direction[self.joint]));
            let (n, sum, variance) = here.fold((0.0, 0.0, 0.0), |(n, s, v), read| {
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

/// How far ahead of the command each target already was where it was first seen, against the first target: targets seen at different steps
/// would otherwise pull these steps apart. Least squares over all that was seen, in the order of the steps; what the step itself does falls out.
fn starting_angles(ahead: &[Seen], weights: &[f64]) -> Vec<f64> {
    let mut triangle = Triangle::new(weights.len());
    for step in ahead.chunk_by(|a, b| a.step == b.step) {
        let all: f64 = step.iter().map(|seen| weights[seen.target]).sum();
        let middle = step.iter().map(|seen| weights[seen.target] * seen.angle).sum::<f64>() / all;
        for seen in step {
            let mut row = vec![0.0; weights.len()];
            step.iter().for_each(|other| row[other.target] -= weights[other.target] / all);
            row[seen.target] += 1.0;
            row[0] = 0.0;
            let scale = weights[seen.target].sqrt();
            row.iter_mut().for_each(|x| *x *= scale);
            triangle.push(&row, scale * (seen.angle - middle));
        }
    }
    triangle.reduce();
    triangle.solve(&[])
}
