//! Flexible regression on many covariates, with complexity chosen by block cross-validation.
//!
//! Covariates are added one by one while this lowers the error on left-out blocks (Burman, Chow and
//! Nolan 1994): a regression that fits autocorrelated noise would remove its autocorrelation.
//!
//! Invariant: with [`CovariateChoice::Validated`] a covariate that improves only the fitted rows is not added.

use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Blocks of a run, and cross-validation folds to which they are assigned in turn.
const BLOCKS: usize = 20;
const FOLDS: usize = 5;
/// Relative reduction of the cross-validation error for which a covariate is added.
const IMPROVEMENT_MIN: f64 = 0.01;
/// Largest number of covariates that are added.
const COVARIATES_MAX: usize = 16;
/// Ridge penalty, relative to the squared length of a column.
const RIDGE: f64 = 1e-6;

/// Which covariates enter the regression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CovariateChoice {
    /// All: before any effect is selected, whatever a covariate explains may be a missing effect and must not be attributed to noise.
    All,
    /// Those that reduce the cross-validation error.
    Validated,
}

/// Normal equations of the rows of one fold: `XᵀX`, `Xᵀy` and `yᵀy`.
#[derive(Clone)]
struct NormalEquations {
    columns: DMatrix<f64>,
    right: DVector<f64>,
    values: f64,
}

impl NormalEquations {
    fn none(width: usize) -> Self {
        Self { columns: DMatrix::zeros(width, width), right: DVector::zeros(width), values: 0.0 }
    }

    fn add(&mut self, row: &[f64], value: f64) {
        let row = DVector::from_column_slice(row);
        self.columns.ger(1.0, &row, &row, 1.0);
        self.right.axpy(value, &row, 1.0);
        self.values += value * value;
    }

    fn plus(mut self, other: &Self) -> Self {
        self.columns += &other.columns;
        self.right += &other.right;
        self.values += other.values;
        self
    }

    /// Least-squares coefficients of these columns alone.
    fn solve(&self, indices: &[usize]) -> DVector<f64> {
        let mut cells = self.columns.select_rows(indices).select_columns(indices);
        for k in 0..indices.len() {
            cells[(k, k)] += RIDGE * cells[(k, k)] + f64::MIN_POSITIVE;
        }
        let pulls = self.right.select_rows(indices);
        cells.cholesky().map_or_else(|| DVector::zeros(indices.len()), |c| c.solve(&pulls))
    }

    /// Sum of squared residuals with these coefficients.
    fn residual_sum(&self, indices: &[usize], law: &DVector<f64>) -> f64 {
        let cells = self.columns.select_rows(indices).select_columns(indices);
        let pulls = self.right.select_rows(indices);
        self.values - 2.0 * law.dot(&pulls) + law.dot(&(cells * law))
    }
}

/// Coefficient of each column of `rows`. The first column is always included; `groups` of columns are added as a whole; excluded columns have zero.
pub(super) fn coefficients(
    rows: &[Vec<f64>],
    values: &[f64],
    groups: &[Range<usize>],
    taken: CovariateChoice,
) -> Vec<f64> {
    let width = rows.first().map_or(0, Vec::len);
    if taken == CovariateChoice::All {
        let all: Vec<usize> = (0..width).collect();
        let sums =
            rows.iter().zip(values).fold(NormalEquations::none(width), |mut sums, (row, value)| {
                sums.add(row, *value);
                sums
            });
        return sums.solve(&all).iter().copied().collect();
    }
    let mut folds = vec![NormalEquations::none(width); FOLDS];
    for (k, (row, value)) in rows.iter().zip(values).enumerate() {
        let stretch = k * BLOCKS / rows.len();
        folds[stretch % FOLDS].add(row, *value);
    }
    let all = folds.iter().fold(NormalEquations::none(width), NormalEquations::plus);
    let others: Vec<NormalEquations> = (0..FOLDS)
        .map(|out| {
            let rest = folds.iter().enumerate().filter(|(k, _)| *k != out);
            rest.fold(NormalEquations::none(width), |sum, (_, fold)| sum.plus(fold))
        })
        .collect();
    let error = |indices: &[usize]| -> f64 {
        folds
            .iter()
            .zip(&others)
            .map(|(fold, rest)| fold.residual_sum(indices, &rest.solve(indices)))
            .sum()
    };
    let mut inside: Vec<usize> = (0..width.min(1)).collect();
    let mut left = error(&inside);
    let mut open: Vec<&Range<usize>> = groups.iter().collect();
    for _ in 0..COVARIATES_MAX {
        let with = |group: &Range<usize>| {
            let mut indices = inside.clone();
            indices.extend(group.clone());
            error(&indices)
        };
        let tried = open.iter().enumerate().map(|(k, group)| (k, with(group)));
        let Some((k, reached)) = tried.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        if reached > (1.0 - IMPROVEMENT_MIN) * left {
            break;
        }
        left = reached;
        inside.extend(open.remove(k).clone());
    }
    let mut law = vec![0.0; width];
    for (column, x) in inside.iter().zip(all.solve(&inside).iter()) {
        law[*column] = *x;
    }
    law
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// AR(1) noise with a coefficient of 0.9.
    fn slow(count: usize, seed: u64) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut last = 0.0;
        (0..count)
            .map(|_| {
                last = 0.9 * last + random.random_range(-1.0..1.0_f64);
                last
            })
            .collect()
    }

    fn waves(count: usize) -> (Vec<Vec<f64>>, Vec<Range<usize>>) {
        let row = |k: usize| {
            let t = k as f64 / count as f64;
            let wave = |n: f64| (n * 6.0 * t).sin();
            [vec![1.0], (1..41).map(|n| wave(f64::from(n))).collect()].concat()
        };
        ((0..count).map(row).collect(), (0..10).map(|g| 1 + 4 * g..5 + 4 * g).collect())
    }

    #[test]
    fn slow_noise_is_left_as_it_is() {
        let (rows, groups) = waves(1000);
        let share = |seed: u64, taken| {
            let values = slow(1000, seed);
            let found = coefficients(&rows, &values, &groups, taken);
            let left = |(row, value): (&Vec<f64>, &f64)| value - crate::simd::dot(row, &found);
            let left: f64 = rows.iter().zip(&values).map(left).map(|x| x * x).sum();
            left / values.iter().map(|v| v * v).sum::<f64>()
        };
        let middle = |taken| (0..20).map(|seed| share(seed, taken)).sum::<f64>() / 20.0;
        let (borne_out, all) = (middle(CovariateChoice::Validated), middle(CovariateChoice::All));
        assert!(borne_out > 0.8 && all < 0.7, "{borne_out}, {all}");
    }

    #[test]
    fn a_law_that_other_stretches_show_too_is_taken_out() {
        let (rows, groups) = waves(1000);
        let noise = slow(1000, 3);
        let values: Vec<f64> =
            rows.iter().zip(&noise).map(|(row, noise)| 8.0 * row[30] + noise).collect();
        let found = coefficients(&rows, &values, &groups, CovariateChoice::Validated);
        assert!((found[30] - 8.0).abs() < 1.0, "{}", found[30]);
    }
}
