//! A recorded motion run through a model: real position of the tool, row by row.
//!
//! Order (docs/reference/effects.md): command → delay → lag → errors by position, and backlash →
//! compliance → modes. On a path the loads include the inertial part, from speeds and accelerations
//! of the motors.
//!
//! The same rows give the same bits; a path begins settled. Measurement by an instrument is left to
//! the caller.

use crate::curve::{Curve, derivatives};
use crate::dynamics::{Dynamics, delayed_samples};
use crate::executed_path::ExecutedPath;
use crate::reversal::advance;
use physics::{Chain, Evaluation, Frame, Inputs, JOINTS_MAX, Joints, Memories, Model};

/// The arm at one row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmState {
    /// Joint positions on the motors' side, rad or m.
    pub motor: Joints,
    /// Joint positions on the links' side, with the delay of their sensors, rad or m.
    pub link: Joints,
    /// Pose of the tool.
    pub base_from_tool: Frame,
    /// Whether a joint is loaded outside the range of its `stiffness_hardening`.
    pub beyond: bool,
}

/// The arm settled at each row; if the flag `from_before` is set its memory continues from the
/// previous row, otherwise see [`Model::advance`].
#[must_use]
pub fn poses(model: &Model, rows: &[(Inputs, bool)]) -> Vec<ArmState> {
    let mut memories = Memories::default();
    rows.iter()
        .map(|(inputs, from_before)| {
            if *from_before {
                model.advance(inputs, &mut memories);
            } else {
                model.settle_pose(inputs, &mut memories);
            }
            arm_state(&inputs.q, &model.evaluate(inputs, &memories), None, model)
        })
        .collect()
}

/// One segment of a path: times strictly increase, `q` is the command; speeds, directions after the
/// first row and the previous row of each are computed here.
#[must_use]
pub fn path(model: &Model, dynamics: &Dynamics, rows: &[Inputs]) -> Vec<ArmState> {
    let executed = ExecutedPath::of(model, dynamics, rows);
    let mut memories = Memories::default();
    let mut all: Vec<ArmState> = Vec::with_capacity(rows.len());
    for (k, inputs) in executed.inputs.iter().enumerate() {
        if k == 0 {
            model.settle(inputs, &mut memories);
        } else {
            let about = [k.checked_sub(2), Some(k - 1), Some(k), Some(k + 1)];
            let about = about.map(|row| executed.inputs.get(row?));
            advance(model, about, &mut memories);
        }
        let evaluation = model.evaluate(inputs, &memories);
        all.push(arm_state(&inputs.q, &evaluation, Some((&executed, k)), model));
    }
    if dynamics.link_delay_s != 0.0 {
        let times_s: Vec<f64> = rows.iter().map(|row| row.time_s).collect();
        for joint in 0..model.arm.count() {
            let links = all.iter().map(|state| state.link[joint]).collect();
            let links = delayed_samples(&times_s, links, dynamics.link_delay_s);
            all.iter_mut().zip(links).for_each(|(state, link)| state.link[joint] = link);
        }
    }
    all
}

/// Computes speeds and accelerations of one segment of a path from its positions, for the inertial
/// part of the loads. `joints`: number of joints of the arm.
pub fn set_rates(rows: &mut [Inputs], joints: usize) {
    set_rates_in(rows, joints, |row| row);
}

/// The same for the inputs within rows of another type.
pub fn set_rates_in<R>(rows: &mut [R], joints: usize, inputs: impl Fn(&mut R) -> &mut Inputs) {
    let times_s: Vec<f64> = rows.iter_mut().map(|row| inputs(row).time_s).collect();
    for joint in 0..joints.min(JOINTS_MAX) {
        let samples: Vec<f64> = rows.iter_mut().map(|row| inputs(row).q[joint]).collect();
        let rates = derivatives(&times_s, &samples);
        for (row, rate) in rows.iter_mut().zip(rates) {
            let inputs = inputs(row);
            (inputs.velocity[joint], inputs.acceleration[joint]) = rate;
        }
    }
}

/// Speed and acceleration of one joint at each row of one segment of a path, as in [`set_rates`].
#[must_use]
pub fn rates(times_s: &[f64], positions: &[f64]) -> Vec<(f64, f64)> {
    derivatives(times_s, positions)
}

/// Positions of one joint at other times than those of its samples; constant before the first and
/// after the last.
#[must_use]
pub fn positions_at(times_s: &[f64], positions: &[f64], at_s: &[f64]) -> Vec<f64> {
    let (Some(first), Some(last)) = (times_s.first(), times_s.last()) else {
        return vec![f64::NAN; at_s.len()];
    };
    let curve = Curve::through(times_s, positions.to_vec());
    at_s.iter().map(|t_s| curve.at(t_s.clamp(*first, *last))).collect()
}

fn arm_state(
    q: &Joints,
    evaluation: &Evaluation,
    executed: Option<(&ExecutedPath, usize)>,
    model: &Model,
) -> ArmState {
    let mut deviation = evaluation.deviation;
    let mut base_from_tool = evaluation.real.base_from_tool;
    if let Some((executed, row)) = executed.filter(|(ride, _)| ride.has_deflections()) {
        executed.add_deflections(row, &mut deviation);
        base_from_tool = Chain::real(&model.arm, q, &deviation).base_from_tool;
    }
    let mut link = *q;
    for (link, delta) in link.iter_mut().zip(&deviation.joints) {
        *link += delta;
    }
    ArmState { motor: *q, link, base_from_tool, beyond: evaluation.out_of_range.is_some() }
}

#[cfg(test)]
mod tests;
