//! Recorded drive quantities for a known motion, row by row. For motion that depends on the drives, see [`crate::servo`].
//!
//! The same rows give the same bits; a path begins settled; a delay of torques shifts them relative
//! to the motion. No noise, and no limits of the drives.

use crate::dynamics::{Dynamics, at_row, delayed_samples};
use crate::executed_path::ExecutedPath;
use physics::{Inputs, JOINTS_MAX, Joints, Memories, Model};

/// Torques (forces) at settled poses, Nm or N; if the flag `from_before` is set the memory
/// continues from the previous row, as in [`crate::forward::poses`].
#[must_use]
pub fn poses(model: &Model, rows: &[(Inputs, bool)]) -> Vec<Joints> {
    let mut memories = Memories::default();
    rows.iter()
        .map(|(inputs, from_before)| {
            if *from_before {
                model.advance(inputs, &mut memories);
            } else {
                model.settle_pose(inputs, &mut memories);
            }
            recorded(model, inputs, &memories)
        })
        .collect()
}

/// Torques (forces) on one segment of a path, Nm or N: drive torques for motors that follow the
/// commands of `rows` with the delay and lag of `dynamics`.
#[must_use]
pub fn path(model: &Model, dynamics: &Dynamics, rows: &[Inputs]) -> Vec<Joints> {
    let executed = ExecutedPath::of(model, dynamics, rows);
    let mut memories = Memories::default();
    let torques = executed.inputs.iter().enumerate().map(|(k, inputs)| {
        if k == 0 {
            model.settle(inputs, &mut memories);
        } else {
            model.advance(inputs, &mut memories);
        }
        recorded(model, inputs, &memories)
    });
    delayed(model, rows, torques.collect(), dynamics.torque_delay_s)
}

fn recorded(model: &Model, inputs: &Inputs, memories: &Memories) -> Joints {
    let drive = model.drive(inputs, memories);
    std::array::from_fn(|i| drive.recorded(i))
}

/// Torques recorded with a delay of `delay_s`.
pub(crate) fn delayed(
    model: &Model,
    rows: &[Inputs],
    torques: Vec<Joints>,
    delay_s: f64,
) -> Vec<Joints> {
    if delay_s == 0.0 {
        return torques;
    }
    let times_s: Vec<f64> = rows.iter().map(|row| row.time_s).collect();
    let of_joint = |i: usize| torques.iter().map(|torque| torque[i]).collect();
    let joints = 0..model.arm.count().min(JOINTS_MAX);
    let late: Vec<Vec<f64>> =
        joints.map(|i| delayed_samples(&times_s, of_joint(i), delay_s)).collect();
    (0..torques.len()).map(|k| at_row(&late, k)).collect()
}

#[cfg(test)]
mod tests;
