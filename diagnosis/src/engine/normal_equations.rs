//! Normal equations `(XᵀX + P) β = Xᵀr` of columns with Gaussian priors, their solution and what further columns would add (nalgebra's Cholesky factorisation).
//!
//! Columns are scaled to unit length. Columns that those before them explain are left out, by a pivoted elimination. Rows are whitened before they are summed.
//! Promises: the same sums give the same numbers. Never: a selection.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// A column that the others explain but for this share, squared, has no number of its own.
const OWN: f64 = 1e-7;
/// A column that is left so little, squared, brings nothing that rounding would not.
pub(crate) const BRINGS: f64 = 1e-4;

/// Sums of products of columns and right-hand side over some rows.
#[derive(Clone, Debug)]
pub(crate) struct Products {
    pub(crate) gram: DMatrix<f64>,
    pub(crate) right: DVector<f64>,
    /// Rows, all joints together.
    pub(crate) rows: usize,
    /// One over the square of what is believed of each number; 0 where nothing is.
    pub(crate) prior: Vec<f64>,
    /// A column that is left so little, squared, brings nothing.
    pub(crate) brings: f64,
}

/// Numbers of some columns, with what they explain.
#[derive(Clone, Debug)]
pub(crate) struct Solved {
    pub(crate) columns: Vec<usize>,
    pub(crate) values: Vec<f64>,
    /// By how much log-likelihood is higher than without any of them.
    pub(crate) gain: f64,
    inverse: DMatrix<f64>,
}

impl Products {
    /// The least squares of these columns; those that say nothing of their own are left out.
    pub(crate) fn solve(&self, columns: &[usize]) -> Solved {
        let mut solved = Solved {
            columns: Vec::new(),
            values: Vec::new(),
            gain: 0.0,
            inverse: DMatrix::zeros(0, 0),
        };
        // A pivoted look first: a column that the ones before it explain has no number of its own.
        let mut rest = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            let own = if i == j { self.prior[columns[i]] } else { 0.0 };
            self.gram[(columns[i], columns[j])] + own
        });
        let taken = Self::own(columns, &mut rest);
        if taken.is_empty() {
            return solved;
        }
        let scale: Vec<f64> =
            taken.iter().map(|k| 1.0 / libm::sqrt(self.gram[(*k, *k)] + self.prior[*k])).collect();
        let count = taken.len();
        let normal = DMatrix::from_fn(count, count, |i, j| {
            let own = if i == j { self.prior[taken[i]] } else { 0.0 };
            (self.gram[(taken[i], taken[j])] + own) * scale[i] * scale[j]
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

    /// How many of these columns say something of their own.
    pub(crate) fn rank(&self, columns: &[usize]) -> usize {
        let mut rest = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            self.gram[(columns[i], columns[j])]
        });
        Self::own(columns, &mut rest).len()
    }

    /// Which of these columns the ones before them do not explain; `rest`: their sums of products, used up.
    fn own(columns: &[usize], rest: &mut DMatrix<f64>) -> Vec<usize> {
        let full: Vec<f64> = (0..columns.len()).map(|k| rest[(k, k)]).collect();
        let mut taken = Vec::with_capacity(columns.len());
        for k in 0..columns.len() {
            let pivot = rest[(k, k)];
            if full[k] <= 0.0 || pivot <= OWN * full[k] {
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

    /// How likely the right-hand side is whatever these numbers are, but for what is the same of all columns: rows more raise it by how well those before foretold
    /// them, numbers as unsure as these left them.
    pub(crate) fn likelihood(&self, columns: &[usize]) -> f64 {
        let own = |k: usize| self.gram[(k, k)] + self.prior[k];
        let scale: Vec<f64> = columns.iter().map(|k| 1.0 / libm::sqrt(own(*k))).collect();
        let count = columns.len();
        let normal = DMatrix::from_fn(count, count, |i, j| {
            let (a, b) = (columns[i], columns[j]);
            let whole = if i == j { own(a) } else { self.gram[(a, b)] };
            whole * scale[i] * scale[j]
        });
        let Some(factors) = normal.cholesky() else { return f64::NEG_INFINITY };
        let right = DVector::from_fn(count, |i, _| self.right[columns[i]] * scale[i]);
        let gain = 0.5 * right.dot(&factors.solve(&right));
        let room = |i: usize| (factors.l_dirty()[(i, i)] / scale[i]).ln();
        gain - (0..count).map(room).sum::<f64>()
    }

    /// What it costs that these numbers, believed with doubt, may take what values they like (Occam's factor of a Gaussian belief).
    pub(crate) fn room(&self, columns: &[usize]) -> f64 {
        let kept: Vec<usize> = columns.iter().copied().filter(|k| self.prior[*k] > 0.0).collect();
        let wide: Vec<f64> = kept.iter().map(|k| 1.0 / libm::sqrt(self.prior[*k])).collect();
        let count = kept.len();
        let ratio = DMatrix::from_fn(count, count, |i, j| {
            f64::from(u8::from(i == j)) + self.gram[(kept[i], kept[j])] * wide[i] * wide[j]
        });
        let Some(factors) = ratio.cholesky() else { return 0.0 };
        (0..count).map(|i| factors.l_dirty()[(i, i)].ln()).sum()
    }

    /// What more columns would bring beside those that are solved, and their numbers.
    pub(crate) fn more(&self, solved: &Solved, columns: &[usize]) -> (f64, Vec<f64>) {
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
            let own = if i == j { self.prior[open[i]] } else { 0.0 };
            self.gram[(open[i], open[j])] + own - beside[i].dot(&through[j])
        });
        let mut right =
            DVector::from_fn(count, |i, _| self.right[open[i]] - beside[i].dot(&values));
        for i in 0..count {
            let full = self.gram[(open[i], open[i])] + self.prior[open[i]];
            if left[(i, i)] <= self.brings * full || full <= 0.0 {
                left.row_mut(i).fill(0.0);
                left.column_mut(i).fill(0.0);
                left[(i, i)] = 1.0;
                right[i] = 0.0;
            }
        }
        let Some(factors) = left.cholesky() else { return (0.0, vec![0.0; columns.len()]) };
        let numbers = factors.solve(&right);
        let gain = 0.5 * right.dot(&numbers);
        let of = |k: &usize| open.iter().position(|o| o == k).map_or(0.0, |at| numbers[at]);
        (gain, columns.iter().map(of).collect())
    }
}

impl Solved {
    /// The number of a column; none where it is not in.
    pub(crate) fn value(&self, column: usize) -> Option<f64> {
        let at = self.columns.iter().position(|k| *k == column)?;
        Some(self.values[at])
    }

    /// What these columns bring beside the others that are in: `½ βᵀ C⁻¹ β`, C their part of the inverse.
    pub(crate) fn worth(&self, columns: &[usize]) -> f64 {
        let at: Vec<usize> =
            columns.iter().filter_map(|k| self.columns.iter().position(|c| c == k)).collect();
        let part = DMatrix::from_fn(at.len(), at.len(), |i, j| self.inverse[(at[i], at[j])]);
        let values = DVector::from_fn(at.len(), |i, _| self.values[at[i]]);
        part.cholesky().map_or(0.0, |factors| 0.5 * values.dot(&factors.solve(&values)))
    }

    /// The covariance of two numbers where the noise is as it was taken to be.
    pub(crate) fn covariance(&self) -> &DMatrix<f64> {
        &self.inverse
    }
}
