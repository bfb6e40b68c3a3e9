//! The AR noise model of each joint's torque: residual of all candidates.
//!
//! Estimated after all candidates were fitted together, so that missing effects are not mistaken for noise.
//!
//! Promises: training rows only. Never: less than the resolution of the recording.

use super::normal_equations::Solved;
use super::table::{Column, Table, residual};
use crate::colour::Colour;

/// Of the torque's own size, noise is at least this.
const LEAST: f64 = 1e-9;

/// How each joint's noise is, from a fit of all that may be missing.
pub(crate) fn of(
    table: &Table,
    columns: &[Column],
    rich: &Solved,
    used: &[bool],
) -> Vec<(Colour, f64)> {
    let joints = table.joints().count().max(1) as f64;
    let each = rich.columns.len() as f64 / joints;
    let of_joint = |joint: usize| {
        if table.target[joint].is_none() {
            return (Colour::default(), 1.0);
        }
        of_left(table, joint, &residual(table, columns, rich, joint), used, each)
    };
    (0..table.target.len()).map(of_joint).collect()
}

/// The same of one joint, from what is left of its torque once `numbers` were fitted.
pub(crate) fn of_left(
    table: &Table,
    joint: usize,
    left: &[f64],
    used: &[bool],
    numbers: f64,
) -> (Colour, f64) {
    let target = || table.target[joint].iter().flatten();
    let counts = |row: usize| used[row] && table.counts[joint][row];
    let kept: Vec<f64> = (0..left.len()).filter(|row| counts(*row)).map(|k| left[k]).collect();
    let free = (kept.len() as f64 - numbers).max(1.0);
    let size = libm::sqrt(kept.iter().map(|x| x * x).sum::<f64>() / free);
    let whole = libm::sqrt(target().map(|x| x * x).sum::<f64>() / target().count().max(1) as f64);
    let size = size.max(LEAST * whole).max(f64::MIN_POSITIVE);
    let mut pieces: Vec<Vec<f64>> = Vec::new();
    for run in &table.runs {
        let mut goes_on = false;
        for row in run.clone() {
            let here = counts(row);
            if here && !goes_on {
                pieces.push(Vec::new());
            }
            goes_on = here;
            if here {
                pieces.last_mut().into_iter().for_each(|piece| piece.push(left[row] / size));
            }
        }
    }
    (Colour::of_runs(&pieces), size)
}
