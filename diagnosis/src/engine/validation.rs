//! Validation and test of a selection: significance of parameters, support by rows that took no part, attribution of the error removed.
//!
//! The validation set can remove a candidate, never select one. The measure of error depends on the domain and is passed by the caller.

use nalgebra::{DMatrix, DVector};

use super::normal_equations::LeastSquaresSolution;
use super::regression_data::{RegressionData, Regressor, residual};
use super::stepwise::{TermSearch, TermSelection, without_term};
use crate::effect_size::EffectSize;

/// Least ratio of a parameter to its standard uncertainty.
pub(crate) const SIGNIFICANCE_SIGMAS: f64 = 2.0;
/// Quantiles of the χ² distribution with one to four degrees of freedom, at the probability with which a squared standard normal variate exceeds the
/// square of [`SIGNIFICANCE_SIGMAS`].
const CHI_SQUARED_QUANTILES: [f64; 4] =
    [SIGNIFICANCE_SIGMAS * SIGNIFICANCE_SIGMAS, 6.18, 8.02, 9.72];
/// RMS residual over the rows `used` that `counts` admits, each channel divided by its noise, times the geometric mean of the channels' noise.
pub(crate) fn rms_of(
    table: &RegressionData,
    columns: &[Regressor],
    solved: &LeastSquaresSolution,
    used: &[bool],
    counts: &[Vec<bool>],
) -> f64 {
    let (mut sum, mut count, mut scale, mut joints) = (0.0, 0.0, 0.0, 0.0);
    for joint in table.joints() {
        let noise = table.noise[joint].1;
        let left = residual(table, columns, solved, joint);
        for row in (0..left.len()).filter(|row| used[*row]) {
            if counts[joint][row] {
                sum += left[row] * left[row] / (noise * noise);
                count += 1.0;
            }
        }
        scale += noise.ln();
        joints += 1.0;
    }
    if count > 0.0 { libm::sqrt(sum / count) * libm::exp(scale / joints) } else { 0.0 }
}

/// Sum of squares of one joint's values over the rows that count.
pub(crate) fn sum_of_squares(
    table: &RegressionData,
    joint: usize,
    values: &[f64],
    used: &[bool],
) -> f64 {
    let rows = (0..values.len()).filter(|row| used[*row] && table.counts[joint][*row]);
    rows.map(|row| values[row] * values[row]).sum()
}

/// The candidates with significant parameters (Wald test); the least significant one is removed until all are. Candidates for which `is_belief` holds
/// are not tested.
pub(crate) fn significant(
    search: &TermSearch<'_>,
    mut names: Vec<usize>,
    covariance: &dyn Fn(&LeastSquaresSolution) -> DMatrix<f64>,
    is_belief: &dyn Fn(usize) -> bool,
) -> Vec<usize> {
    loop {
        let solved = search.solve(&names).solved;
        let covariance = covariance(&solved);
        let sure = |name: usize| {
            let columns = search.library.terms[name].columns.iter();
            let places =
                columns.filter_map(|k| solved.columns.iter().position(|column| column == k));
            let places: Vec<usize> = places.collect();
            let count = places.len();
            let values = DVector::from_fn(count, |i, _| solved.values[places[i]]);
            let shared = |i: usize, k: usize| covariance[(places[i], places[k])];
            wald_ratio(&values, DMatrix::from_fn(count, count, shared))
        };
        let tested = names.iter().filter(|name| !is_belief(**name));
        let weakest = tested.map(|name| (*name, sure(*name)));
        let weakest = weakest.min_by(|a, b| a.1.total_cmp(&b.1));
        match weakest {
            Some((name, sure)) if sure < 1.0 => names.retain(|n| *n != name),
            _ => return names,
        }
    }
}

/// Wald statistic of these parameters together, divided by its critical value: significant above 1.
fn wald_ratio(values: &DVector<f64>, covariance: DMatrix<f64>) -> f64 {
    let Some(more) = values.len().checked_sub(1) else { return 0.0 };
    let bar = CHI_SQUARED_QUANTILES[more.min(CHI_SQUARED_QUANTILES.len() - 1)];
    covariance.cholesky().map_or(f64::INFINITY, |factors| values.dot(&factors.solve(values)) / bar)
}

/// Removes candidates that increase the error `rms` on the validation set, the worst first; returns the remaining ones and the removed ones. No
/// others are selected in their place. Candidates for which `is_belief` holds are not tested.
pub(crate) fn supported(
    search: &TermSearch<'_>,
    mut names: Vec<usize>,
    rms: &dyn Fn(&LeastSquaresSolution) -> f64,
    is_belief: &dyn Fn(usize) -> bool,
) -> (Vec<usize>, Vec<usize>) {
    let error_of = |names: &[usize]| rms(&search.solve(names).solved);
    let mut refuted = Vec::new();
    loop {
        let whole = error_of(&names);
        let tested = names.iter().filter(|name| !is_belief(**name));
        // A candidate is not removed if its removal gives another one the wrong sign: the comparison would then be with an impossible model.
        let rest = tested.map(|name| (*name, without_term(&names, *name)));
        let admissible = rest.filter(|(_, rest)| search.admissible(rest.clone()) == *rest);
        let harm = admissible.map(|(name, rest)| (name, whole - error_of(&rest)));
        let worst = harm.max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((name, _)) = worst.filter(|(_, harm)| *harm > 0.0) else {
            return (names, refuted);
        };
        names = without_term(&names, name);
        refuted.push(name);
    }
}

/// Contribution of some columns of a fit to the rows in which the joints move.
pub(crate) fn size_of(
    table: &RegressionData,
    columns: &[Regressor],
    solved: &LeastSquaresSolution,
    own_columns: &[usize],
) -> EffectSize {
    let parts: Vec<(&Regressor, f64)> = (solved.columns.iter().zip(&solved.values))
        .filter(|(column, _)| own_columns.contains(column))
        .map(|(column, value)| (&columns[*column], *value))
        .collect();
    let mut values = Vec::new();
    for joint in table.joints() {
        let moved: Vec<f64> =
            Regressor::linear_combination(&parts, joint, table.rows()).into_iter().collect();
        if moved.iter().any(|value| *value != 0.0) {
            let rows = moved.iter().zip(&table.moves[joint]);
            values.extend(rows.filter(|(_, moves)| **moves).map(|(value, _)| *value));
        }
    }
    EffectSize::of(values)
}

/// A candidate with RMS errors on the test set.
pub(crate) struct RankedTerm {
    pub(crate) name: usize,
    /// Without it and all that follow it in the list, and with it.
    pub(crate) heldout: [f64; 2],
    /// When it alone is removed and all others are refitted.
    pub(crate) heldout_without: f64,
}

/// Candidates in order of importance, with the error on the test set before and after each is added in turn. The first is the one that reduces the
/// error most by itself; the others follow by the increase of the error if they alone are removed. All others are refitted each time, so the error
/// energy is not quadratic and the two-point formula of the Shapley value ([`super::attribution`]) does not hold.
pub(crate) fn attributed(
    search: &TermSearch<'_>,
    selection: &TermSelection,
    rms: &dyn Fn(&LeastSquaresSolution) -> f64,
) -> Vec<RankedTerm> {
    let without = |name: &usize| rms(&search.solve(&without_term(&selection.terms, *name)).solved);
    let mut names: Vec<(usize, f64)> = selection.terms.iter().map(|n| (*n, without(n))).collect();
    let alone = |name: &usize| rms(&search.solve(&[*name]).solved);
    let first = selection.terms.iter().map(|name| (*name, alone(name)));
    let first = first.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(first, _)| first);
    names.sort_by(|(a, a_left), (b, b_left)| {
        let is_later = |name: &usize| Some(*name) != first;
        is_later(a).cmp(&is_later(b)).then(b_left.total_cmp(a_left)).then(a.cmp(b))
    });
    let mut before = rms(&search.solve(&[]).solved);
    let mut included: Vec<usize> = Vec::new();
    let mut listed = Vec::new();
    for (name, heldout_without) in names {
        included.push(name);
        let after = rms(&search.solve(&included).solved);
        listed.push(RankedTerm { name, heldout: [before, after], heldout_without });
        before = after;
    }
    listed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_nothing_each_may_be_something_together() {
        let values = DVector::from_vec(vec![1.5, -1.5]);
        let alone = DMatrix::identity(2, 2);
        assert!(wald_ratio(&values, alone) < 1.0);
        // The variance of each is unchanged, but their difference is well determined.
        let tied = DMatrix::from_row_slice(2, 2, &[1.0, 0.9, 0.9, 1.0]);
        assert!(wald_ratio(&values, tied) > 5.0);
        // A single significant parameter is not masked by insignificant ones.
        let values = DVector::from_vec(vec![4.0, 0.1, -0.2]);
        assert!(wald_ratio(&values, DMatrix::identity(3, 3)) > 1.0);
        assert!(wald_ratio(&DVector::from_vec(vec![1.9]), DMatrix::identity(1, 1)) < 1.0);
        assert!(wald_ratio(&DVector::from_vec(vec![2.1]), DMatrix::identity(1, 1)) > 1.0);
    }
}
