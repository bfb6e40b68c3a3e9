//! Residuals on held-out rows, and the uncertainty of each parameter.
//!
//! Uncertainties are cluster-robust, from blocks of time (`crate::cluster_robust`), so that autocorrelated noise does not make them too small, and at least
//! those of an AR noise model (`variance_floor`). Searched parameters enter by the derivative of the torque.

use nalgebra::DMatrix;

use super::case::Case;
use super::nonlinear_parameters;
use super::variance_floor;
use crate::engine::normal_equations::{LeastSquaresSolution, NormalEquations};
use crate::engine::regression_data;
use crate::engine::regression_data::RegressionData;
use crate::engine::regression_data::Regressor;
use crate::engine::stepwise::{TermSearch, TermSelection};
use crate::engine::validation::{rms_of, sum_of_squares, supported};

/// Smallest share of the gain expected on held-out rows that a true law must reach.
const GAIN_SHARE_LEAST: f64 = 0.2;
/// The instant of a reversal between two rows, at which friction changes sign, is known to this share of a time step at best.
pub(super) const STEP_SHARE: f64 = 0.01;

/// RMS residual on `used` moving rows, weighted by each joint's noise and scaled by the geometric mean of these, N m or N.
pub(super) fn rms(case: &Case, solved: &LeastSquaresSolution, used: &[bool]) -> f64 {
    rms_of(&case.table, &case.library.columns, solved, used, &case.table.moves)
}

/// RMS residual as [`rms`], without the rows of zones.
pub(super) fn rms_outside(case: &Case, solved: &LeastSquaresSolution, used: &[bool]) -> f64 {
    rms_of(&case.table, &case.library.columns, solved, used, &case.table.counts)
}

/// RMS innovation (whitened residual) on `used` rows, in units of the noise. Sensitive to laws that vary fast compared with the noise's
/// autocorrelation.
pub(super) fn innovation_rms(case: &Case, solved: &LeastSquaresSolution, used: &[bool]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for joint in case.table.joints() {
        let left = case.table.whitened(joint, &case.residual(solved, joint));
        let counts = &case.table.counts[joint];
        for row in (0..left.len()).filter(|row| used[*row] && counts[*row]) {
            sum += left[row] * left[row];
            count += 1.0;
        }
    }
    libm::sqrt(sum / f64::max(count, 1.0))
}

/// Whether held-out rows reach at least a share of the gain that they would show if the change from `left[0]` to `left[1]` of a joint's residual were
/// true, with an allowance for noise.
pub(super) fn is_supported(
    table: &RegressionData,
    joint: usize,
    left: [&Vec<f64>; 2],
    used: &[bool],
) -> bool {
    let predicted: Vec<f64> =
        left[0].iter().zip(left[1]).map(|(before, after)| before - after).collect();
    let [before, after, predicted] = [left[0], left[1], &predicted]
        .map(|values| sum_of_squares(table, joint, &table.whitened(joint, values), used));
    let [gain, wanted] = [0.5 * (before - after), 0.5 * predicted];
    gain > GAIN_SHARE_LEAST * wanted - libm::sqrt(wanted)
}

/// RMS residual of one joint on `used` rows, N m or N.
pub(super) fn joint_rms(
    case: &Case,
    solved: &LeastSquaresSolution,
    joint: usize,
    used: &[bool],
) -> f64 {
    let left = case.residual(solved, joint);
    let kept = left.iter().zip(used).filter(|(_, used)| **used).map(|(x, _)| x * x);
    let (sum, count) = kept.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    if count > 0.0 { libm::sqrt(sum / count) } else { 0.0 }
}

/// Ratio of a column's parameter to its standard uncertainty, from blocks of time, when fitted with these effects.
pub(super) fn significance_of(
    case: &Case,
    search: &TermSearch<'_>,
    names: &[usize],
    column: usize,
    fitted_rows: &[bool],
) -> f64 {
    let solved = search.solve(names).solved;
    let covariance = covariance(case, &solved, fitted_rows);
    let index = solved.columns.iter().position(|k| *k == column);
    index.map_or(0.0, |index| solved.values[index].abs() / covariance[(index, index)].sqrt())
}

/// Splits effects into those that held-out rows do not contradict, and those that increase the error there. None is replaced.
pub(super) fn split_by_support(
    case: &Case,
    search: &TermSearch<'_>,
    names: Vec<usize>,
    held: &[bool],
) -> (Vec<usize>, Vec<usize>) {
    // No known law holds within zones, so the rows there get half the weight: the geometric mean of both residuals.
    let left = |solved: &LeastSquaresSolution| {
        libm::sqrt(rms(case, solved, held) * rms_outside(case, solved, held))
    };
    supported(search, names, &left, &|name| case.is_exempt_from_test(name, search.always))
}

/// Covariance of a fit's parameters from blocks of time, at least that of white noise. A delay is at best as certain as a share of a time step.
pub(super) fn covariance(
    case: &Case,
    solved: &LeastSquaresSolution,
    used: &[bool],
) -> DMatrix<f64> {
    let mut all = regression_data::covariance(&case.table, &case.library.columns, solved, used);
    let step_s = case.motion.runs.iter().map(|run| run.step_s).fold(0.0, f64::max);
    let delays = case.library.terms.iter().filter(|family| family.kind == "torque_delay");
    for column in delays.flat_map(|family| &family.columns) {
        if let Some(index) = solved.columns.iter().position(|k| k == column) {
            all[(index, index)] += (STEP_SHARE * step_s) * (STEP_SHARE * step_s);
        }
    }
    all
}

/// Covariance including the searched parameters and the exponential temperature law, and the relative standard uncertainty of the searched parameter
/// per effect. `viscous`: viscous friction of a joint, stated plus found.
pub(super) fn covariance_with_searched(
    case: &Case,
    selection: &TermSelection,
    used: &[bool],
    viscous: &dyn Fn(usize) -> f64,
) -> (DMatrix<f64>, Vec<(usize, f64)>) {
    let (solved, columns) = (&selection.solved, &case.library.columns);
    let is_reported_column = |column: &usize| is_reported(case, selection, *column);
    let places: Vec<usize> =
        (0..solved.columns.len()).filter(|k| is_reported_column(&solved.columns[*k])).collect();
    let covariance = covariance(case, solved, used);
    let covariance =
        variance_floor::with_ar_floor(covariance, (&case.table, columns), solved, &places, used);
    let slopes: Vec<(usize, Regressor)> = selection
        .terms
        .iter()
        .filter_map(|name| {
            Some((*name, nonlinear_parameters::derivative_by_log(case, *name, &selection.solved)?))
        })
        .collect();
    let bent = nonlinear_parameters::temperature_derivatives(case, selection, viscous);
    if slopes.is_empty() && bent.is_empty() {
        return (covariance, Vec::new());
    }
    let of_selection = selection.solved.columns.iter().map(|column| {
        let bent = bent.iter().find(|(place, _)| place == column);
        bent.map_or(&case.library.columns[*column], |(_, bent)| bent)
    });
    let columns: Vec<&Regressor> =
        of_selection.chain(slopes.iter().map(|(_, slope)| slope)).collect();
    let mut prior: Vec<f64> =
        selection.solved.columns.iter().map(|column| case.library.prior[*column]).collect();
    prior.resize(columns.len(), 0.0);
    let all: Vec<usize> = (0..columns.len()).collect();
    // Linearised about the estimate: the target is the residual.
    let mut table = case.table.clone();
    for joint in case.table.joints() {
        table.target[joint] = Some(case.residual(&selection.solved, joint));
    }
    let mut solved = NormalEquations::new(&table, &columns, prior, used).solve(&all);
    solved.values.fill(0.0);
    let columns: Vec<Regressor> = columns.into_iter().cloned().collect();
    let whole = regression_data::covariance(&table, &columns, &solved, used);
    let reported = places.into_iter().chain(selection.solved.columns.len()..columns.len());
    let reported = reported.filter_map(|column| solved.columns.iter().position(|k| *k == column));
    let whole = variance_floor::with_ar_floor(
        whole,
        (&table, &columns),
        &solved,
        &reported.collect::<Vec<usize>>(),
        used,
    );
    let index_of = |column: usize| solved.columns.iter().position(|k| *k == column);
    let count = selection.solved.columns.len();
    let all = DMatrix::from_fn(count, count, |i, j| match (index_of(i), index_of(j)) {
        // Additional free parameters cannot reduce a variance.
        (Some(a), Some(b)) if i == j => whole[(a, b)].max(covariance[(i, j)]),
        (Some(a), Some(b)) => whole[(a, b)],
        _ => covariance[(i, j)],
    });
    let spread =
        |k: usize| index_of(count + k).map_or(1.0, |index| libm::sqrt(whole[(index, index)]));
    (all, slopes.iter().enumerate().map(|(k, (name, _))| (*name, spread(k))).collect())
}

/// Whether a column's parameter is reported: of a selected effect, or of the model itself.
fn is_reported(case: &Case, selection: &TermSelection, column: usize) -> bool {
    let families = &case.library.terms;
    selection.terms.iter().any(|name| families[*name].columns.contains(&column))
        || case.uncertain_parameters.iter().any(|known| known.0 == column)
}
