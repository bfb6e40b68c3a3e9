//! Preview compensation: the commands that bring each joint, by the model, to its target position at each instant.
//!
//! The path is known ahead, so that commands can precede it by delay and lag, without exciting modes.

use crate::FeedforwardError;
use crate::fourier::Transform;
use crate::grid::SourceRows;
use crate::settings::Settings;
use crate::step::{CorrectionStep, Joint, StepInput};
use joint_dynamics::plant::{Plant, Plants};
use physics::Arm;

/// Result of a preview; all in rad or m, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Preview {
    /// The commands.
    pub commanded: Vec<Vec<f64>>,
    /// Predicted positions without correction.
    pub without: Vec<Vec<f64>>,
    /// Predicted positions with the correction.
    pub with: Vec<Vec<f64>>,
    /// Per joint; `None` if there was nothing to compensate.
    pub joints: Vec<Option<CorrectionStep>>,
}

/// The commands for joints with targets `wanted` (a list per joint, rad or m, every `step_s`). The
/// path begins and ends at rest, for as long as [`lead_s`] states.
///
/// # Errors
/// Settings out of their range, too few rows, a model without anything to compensate, a sampling
/// that is too coarse.
pub fn preview(
    plants: &Plants,
    step_s: f64,
    wanted: &[Vec<f64>],
    settings: &Settings,
) -> Result<Preview, FeedforwardError> {
    settings.check()?;
    settings.check_step("the path", step_s)?;
    if plants.is_empty() {
        return Err(FeedforwardError::NothingInTime);
    }
    let rows = wanted.first().map_or(0, Vec::len);
    if rows < crate::grid::ROWS_LEAST {
        return Err(FeedforwardError::TooShort(rows));
    }
    let transform = Transform::new(rows, step_s, settle_s(plants));
    let mut preview = Preview {
        commanded: wanted.to_vec(),
        without: wanted.to_vec(),
        with: wanted.to_vec(),
        joints: vec![None; wanted.len()],
    };
    for (index, (plant, wanted)) in plants.joints.iter().zip(wanted).enumerate() {
        let is_at_rest = wanted.iter().all(|q| *q == wanted[0]);
        if plant.is_identity() || is_at_rest {
            continue;
        }
        let joint = joint_of(plant, &transform, step_s, settings);
        let without = transform.through(wanted, &joint.response());
        let error: Vec<f64> = wanted.iter().zip(&without).map(|(q, y)| q - y).collect();
        let spectrum = transform.spectrum(wanted);
        let stepped = joint.step(&StepInput::Path(&spectrum), &vec![0.0; rows], &error);
        let with = wanted.iter().zip(&stepped.residual).map(|(q, left)| q - left);
        preview.with[index] = with.collect();
        let commanded = wanted.iter().zip(&stepped.correction).map(|(q, c)| q + c);
        preview.commanded[index] = commanded.collect();
        preview.without[index] = without;
        preview.joints[index] = Some(stepped);
    }
    Ok(preview)
}

/// Checks that commands at `times_s` stay within the limits of the joints; `source`: the rows of the file.
///
/// # Errors
/// The first command beyond a limit.
pub fn check_joint_limits(
    arm: &Arm,
    commanded: &[Vec<f64>],
    times_s: &[f64],
    source: &SourceRows,
) -> Result<(), FeedforwardError> {
    for (index, (joint, commanded)) in arm.joints().iter().zip(commanded).enumerate() {
        let (lower, upper) = joint.limits;
        if let Some(row) = commanded.iter().position(|q| !(lower..=upper).contains(q)) {
            let (joint, position) = (index + 1, commanded[row]);
            let at = source.at(times_s.get(row).copied().unwrap_or(f64::NAN));
            return Err(FeedforwardError::JointLimit { at, joint, position, lower, upper });
        }
    }
    Ok(())
}

/// For how long a path is at rest at both ends, s: the delay and five time constants of the slowest joint, and three periods of the bandwidth.
#[must_use]
pub fn lead_s(plants: &Plants, settings: &Settings) -> f64 {
    let slowest = plants.joints.iter().map(Plant::response_time_s).fold(0.0, f64::max);
    slowest + 3.0 / settings.bandwidth_hz
}

/// A joint on a path whose correction fades over a period of the bandwidth at both ends.
pub(crate) fn joint_of<'a>(
    plant: &'a Plant,
    transform: &'a Transform,
    step_s: f64,
    settings: &'a Settings,
) -> Joint<'a> {
    let fade_rows = (1.0 / settings.bandwidth_hz / step_s).ceil() as usize;
    Joint { plant, transform, step_s, fade_rows, settings }
}

/// Rest of a path in its transform, s: until every mode has decayed.
pub(crate) fn settle_s(plants: &Plants) -> f64 {
    plants
        .joints
        .iter()
        .map(|plant| plant.response_time_s() + plant.decay_time_s())
        .fold(1.0, f64::max)
}

#[cfg(test)]
mod tests;
