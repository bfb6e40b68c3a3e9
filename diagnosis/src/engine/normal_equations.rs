//! Normal equations `(XᵀX + P) β = Xᵀr` of columns with Gaussian priors, their solution, and the gain by further columns (nalgebra's Cholesky
//! factorisation).
//!
//! Columns are scaled to unit length. Columns that depend linearly on those before them are left out, found by elimination. Rows are whitened before
//! the products are computed, so that gains are in log-likelihood. Invariant: the same products give the same solution.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Squared share of a column that is linearly independent of the columns before it, below which its coefficient is not determined.
const INDEPENDENT_SHARE_MIN: f64 = 1e-7;
/// Squared share of a further column that is independent of the solved ones, below which its gain would be rounding error.
pub(crate) const FURTHER_SHARE_MIN: f64 = 1e-4;

/// Products of columns and right-hand side over some rows.
#[derive(Clone, Debug)]
pub(crate) struct NormalEquations {
    pub(crate) gram: DMatrix<f64>,
    pub(crate) right: DVector<f64>,
    /// Number of rows, of all joints together.
    pub(crate) rows: usize,
    /// Prior precision of each coefficient: 1/σ², 0 without a prior.
    pub(crate) prior: Vec<f64>,
    /// Squared share of a further column that is independent of the solved ones, below which it is ignored.
    pub(crate) further_share_min: f64,
}

/// Least-squares solution for some columns.
#[derive(Clone, Debug)]
pub(crate) struct LeastSquaresSolution {
    pub(crate) columns: Vec<usize>,
    pub(crate) values: Vec<f64>,
    /// Gain in log-likelihood over a fit without any of these columns.
    pub(crate) gain: f64,
    inverse: DMatrix<f64>,
}

impl NormalEquations {
    /// The least-squares solution for these columns; linearly dependent ones are left out.
    pub(crate) fn solve(&self, columns: &[usize]) -> LeastSquaresSolution {
        let mut solved = LeastSquaresSolution {
            columns: Vec::new(),
            values: Vec::new(),
            gain: 0.0,
            inverse: DMatrix::zeros(0, 0),
        };
        // Elimination first determines the linearly independent columns.
        let mut rest = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            let prior = if i == j { self.prior[columns[i]] } else { 0.0 };
            self.gram[(columns[i], columns[j])] + prior
        });
        let taken = Self::independent_columns(columns, &mut rest);
        if taken.is_empty() {
            return solved;
        }
        let scale: Vec<f64> =
            taken.iter().map(|k| 1.0 / libm::sqrt(self.gram[(*k, *k)] + self.prior[*k])).collect();
        let count = taken.len();
        let normal = DMatrix::from_fn(count, count, |i, j| {
            let prior = if i == j { self.prior[taken[i]] } else { 0.0 };
            (self.gram[(taken[i], taken[j])] + prior) * scale[i] * scale[j]
        });
        let Some(factors): Option<Cholesky<f64, Dyn>> = normal.cholesky() else { return solved };
        let right = DVector::from_fn(count, |i, _| self.right[taken[i]] * scale[i]);
        let numbers = factors.solve(&right);
        solved.gain = 0.5 * right.dot(&numbers);
        solved.values = (0..count).map(|i| numbers[i] * scale[i]).collect();
        let inverse = factors.inverse();
        solved.inverse =
            DMatrix::from_fn(count, count, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
        solved.columns = taken;
        solved
    }

    /// Number of linearly independent columns among these.
    pub(crate) fn rank(&self, columns: &[usize]) -> usize {
        let mut rest = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            self.gram[(columns[i], columns[j])]
        });
        Self::independent_columns(columns, &mut rest).len()
    }

    /// The columns that do not depend linearly on those before them; `rest`: their products, overwritten.
    fn independent_columns(columns: &[usize], rest: &mut DMatrix<f64>) -> Vec<usize> {
        let full: Vec<f64> = (0..columns.len()).map(|k| rest[(k, k)]).collect();
        let mut taken = Vec::with_capacity(columns.len());
        for k in 0..columns.len() {
            let pivot = rest[(k, k)];
            if full[k] <= 0.0 || pivot <= INDEPENDENT_SHARE_MIN * full[k] {
                continue;
            }
            taken.push(columns[k]);
            for i in k + 1..columns.len() {
                let share = rest[(i, k)] / pivot;
                for j in k + 1..columns.len() {
                    rest[(i, j)] -= share * rest[(k, j)];
                }
            }
        }
        taken
    }

    /// Log marginal likelihood of the right-hand side with the coefficients of these columns integrated out, up to a term that is the same for all
    /// choices of columns. Its increase by further rows is their log predictive density under the posterior from the rows before.
    pub(crate) fn log_marginal_likelihood(&self, columns: &[usize]) -> f64 {
        let diagonal = |k: usize| self.gram[(k, k)] + self.prior[k];
        let scale: Vec<f64> = columns.iter().map(|k| 1.0 / libm::sqrt(diagonal(*k))).collect();
        let count = columns.len();
        let normal = DMatrix::from_fn(count, count, |i, j| {
            let (a, b) = (columns[i], columns[j]);
            let whole = if i == j { diagonal(a) } else { self.gram[(a, b)] };
            whole * scale[i] * scale[j]
        });
        let Some(factors) = normal.cholesky() else { return f64::NEG_INFINITY };
        let right = DVector::from_fn(count, |i, _| self.right[columns[i]] * scale[i]);
        let gain = 0.5 * right.dot(&factors.solve(&right));
        let room = |i: usize| (factors.l_dirty()[(i, i)] / scale[i]).ln();
        gain - (0..count).map(room).sum::<f64>()
    }

    /// Occam factor of coefficients with a Gaussian prior, in log-likelihood: `½ ln det(I + σ XᵀX σ)`.
    pub(crate) fn log_occam_factor(&self, columns: &[usize]) -> f64 {
        let kept: Vec<usize> = columns.iter().copied().filter(|k| self.prior[*k] > 0.0).collect();
        let wide: Vec<f64> = kept.iter().map(|k| 1.0 / libm::sqrt(self.prior[*k])).collect();
        let count = kept.len();
        let ratio = DMatrix::from_fn(count, count, |i, j| {
            f64::from(u8::from(i == j)) + self.gram[(kept[i], kept[j])] * wide[i] * wide[j]
        });
        let Some(factors) = ratio.cholesky() else { return 0.0 };
        (0..count).map(|i| factors.l_dirty()[(i, i)].ln()).sum()
    }

    /// Gain in log-likelihood by further columns beside the solved ones, and their coefficients.
    pub(crate) fn gain_of_further(
        &self,
        solved: &LeastSquaresSolution,
        columns: &[usize],
    ) -> (f64, Vec<f64>) {
        let inside = |k: usize| {
            DVector::from_fn(solved.columns.len(), |i, _| self.gram[(solved.columns[i], k)])
        };
        let open: Vec<usize> =
            columns.iter().copied().filter(|k| !solved.columns.contains(k)).collect();
        let count = open.len();
        let beside: Vec<DVector<f64>> = open.iter().map(|k| inside(*k)).collect();
        let through: Vec<DVector<f64>> = beside.iter().map(|b| &solved.inverse * b).collect();
        let values = DVector::from_column_slice(&solved.values);
        let mut left = DMatrix::from_fn(count, count, |i, j| {
            let prior = if i == j { self.prior[open[i]] } else { 0.0 };
            self.gram[(open[i], open[j])] + prior - beside[i].dot(&through[j])
        });
        let mut right =
            DVector::from_fn(count, |i, _| self.right[open[i]] - beside[i].dot(&values));
        for i in 0..count {
            let full = self.gram[(open[i], open[i])] + self.prior[open[i]];
            if left[(i, i)] <= self.further_share_min * full || full <= 0.0 {
                left.row_mut(i).fill(0.0);
                left.column_mut(i).fill(0.0);
                left[(i, i)] = 1.0;
                right[i] = 0.0;
            }
        }
        let Some(factors) = left.cholesky() else { return (0.0, vec![0.0; columns.len()]) };
        let numbers = factors.solve(&right);
        let gain = 0.5 * right.dot(&numbers);
        let number_of =
            |k: &usize| open.iter().position(|o| o == k).map_or(0.0, |index| numbers[index]);
        (gain, columns.iter().map(number_of).collect())
    }
}

impl LeastSquaresSolution {
    /// The coefficient of a column; `None` if it is not in the solution.
    pub(crate) fn value(&self, column: usize) -> Option<f64> {
        let index = self.columns.iter().position(|k| *k == column)?;
        Some(self.values[index])
    }

    /// Gain in log-likelihood of these columns beside the others in the solution: `½ βᵀ C⁻¹ β`, where C is their block of the inverse.
    pub(crate) fn gain_of(&self, columns: &[usize]) -> f64 {
        let places: Vec<usize> =
            columns.iter().filter_map(|k| self.columns.iter().position(|c| c == k)).collect();
        let part = DMatrix::from_fn(places.len(), places.len(), |i, j| {
            self.inverse[(places[i], places[j])]
        });
        let values = DVector::from_fn(places.len(), |i, _| self.values[places[i]]);
        part.cholesky().map_or(0.0, |factors| 0.5 * values.dot(&factors.solve(&values)))
    }

    /// Covariance of the coefficients if the noise model is right.
    pub(crate) fn covariance(&self) -> &DMatrix<f64> {
        &self.inverse
    }
}
