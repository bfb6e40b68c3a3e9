//! The AR noise model of each joint's torque (or each axis of a force sensor), estimated from the residual of a fit of all candidates together, so
//! that missing effects are not mistaken for noise. Uses training rows only.

use super::normal_equations::LeastSquaresSolution;
use super::regression_data::{RegressionData, Regressor, residual};
use crate::autocorrelation::ArModel;

/// Lower limit of the noise, relative to the RMS of the torque.
const LEAST: f64 = 1e-9;

/// AR model and standard deviation (N m or N) of each joint's noise, from `rich`, a fit of all candidates.
pub(crate) fn estimate_noise(
    table: &RegressionData,
    columns: &[Regressor],
    rich: &LeastSquaresSolution,
    used: &[bool],
) -> Vec<(ArModel, f64)> {
    let joints = table.joints().count().max(1) as f64;
    let each = rich.columns.len() as f64 / joints;
    let of_joint = |joint: usize| {
        if table.target[joint].is_none() {
            return (ArModel::default(), 1.0);
        }
        estimate_from_residual(table, joint, &residual(table, columns, rich, joint), used, each)
    };
    (0..table.target.len()).map(of_joint).collect()
}

/// The same for one joint, from the residual `left` of a fit with `numbers` parameters.
pub(crate) fn estimate_from_residual(
    table: &RegressionData,
    joint: usize,
    left: &[f64],
    used: &[bool],
    numbers: f64,
) -> (ArModel, f64) {
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
            let is_counted = counts(row);
            if is_counted && !goes_on {
                pieces.push(Vec::new());
            }
            goes_on = is_counted;
            if is_counted {
                pieces.last_mut().into_iter().for_each(|piece| piece.push(left[row] / size));
            }
        }
    }
    (ArModel::estimate(&pieces), size)
}
