//! Cholesky factorisation of normal equations, column by column: columns that depend linearly on those before them are left out.
//!
//! `S = L Lᵀ` over the columns that are kept, and `L y = b` (Golub and Van Loan, Matrix Computations, 4.2). `yᵀy` is the reduction of the sum of
//! squares. Of two linearly dependent columns the first is kept; the caller decides when a column counts as dependent.

/// The factor, and the right-hand side after forward substitution.
pub(crate) struct PartialCholesky {
    /// Indices of the columns that are kept, in order.
    pub(crate) kept: Vec<usize>,
    /// Rows of `L`, each up to its diagonal element.
    factor: Vec<Vec<f64>>,
    /// `y`, the solution of `L y = b`.
    forward: Vec<f64>,
}

impl PartialCholesky {
    /// Factorises the normal matrix `cell` with the right-hand side `right` over `columns`. `is_significant` decides whether a column is kept, from its index
    /// and the square of its remaining length. `None` if no column is kept.
    pub(crate) fn of(
        columns: impl IntoIterator<Item = usize>,
        cell: impl Fn(usize, usize) -> f64,
        right: impl Fn(usize) -> f64,
        is_significant: impl Fn(usize, f64) -> bool,
    ) -> Option<Self> {
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut partial = Self { kept: Vec::new(), factor: Vec::new(), forward: Vec::new() };
        for k in columns {
            let mut row: Vec<f64> = Vec::with_capacity(partial.kept.len() + 1);
            for (other, known) in partial.kept.iter().zip(&partial.factor) {
                row.push((cell(*other, k) - product(known, &row)) / known[row.len()]);
            }
            let left = cell(k, k) - product(&row, &row);
            if !is_significant(k, left) {
                continue;
            }
            let pivot = left.sqrt();
            partial.forward.push((right(k) - product(&row, &partial.forward)) / pivot);
            row.push(pivot);
            partial.factor.push(row);
            partial.kept.push(k);
        }
        (!partial.kept.is_empty()).then_some(partial)
    }

    /// Reduction of the sum of squares.
    pub(crate) fn gain(&self) -> f64 {
        self.forward.iter().map(|y| y * y).sum()
    }

    /// Coefficient of each column that is kept.
    pub(crate) fn solution(&self) -> Vec<f64> {
        let mut x = self.forward.clone();
        for i in (0..x.len()).rev() {
            let later: f64 = (i + 1..x.len()).map(|j| self.factor[j][i] * x[j]).sum();
            x[i] = (x[i] - later) / self.factor[i][i];
        }
        x
    }

    /// Standard deviation of the coefficient at position `place` among the columns that are kept, under unit noise: the length of its column in the
    /// inverse of the factor.
    pub(crate) fn sigma(&self, place: usize) -> f64 {
        let mut column = vec![0.0; self.kept.len()];
        column[place] = 1.0 / self.factor[place][place];
        for i in place + 1..column.len() {
            let known: f64 = (place..i).map(|k| self.factor[i][k] * column[k]).sum();
            column[i] = -known / self.factor[i][i];
        }
        column.iter().map(|x| x * x).sum::<f64>().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_that_is_the_sum_of_two_is_left_out_and_the_others_are_solved() {
        // Columns (1, 0, 1), (0, 2, 1), their sum, and the right-hand side: 3 × the first − the second.
        let columns = [[1.0, 0.0, 1.0], [0.0, 2.0, 1.0], [1.0, 2.0, 2.0]];
        let wanted = [3.0, -2.0, 2.0];
        let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let cell = |a: usize, b: usize| dot(&columns[a], &columns[b]);
        let right = |a: usize| dot(&columns[a], &wanted);
        let found = PartialCholesky::of(0..3, cell, right, |_, left| left > 1e-9).expect("columns");
        assert_eq!(found.kept, [0, 1]);
        let solution = found.solution();
        assert!((solution[0] - 3.0).abs() < 1e-12 && (solution[1] + 1.0).abs() < 1e-12);
        assert!((found.gain() - dot(&wanted, &wanted)).abs() < 1e-12, "all is explained");
        // The inverse of [[2, 1], [1, 5]] is [[5, −1], [−1, 2]] / 9.
        assert!((found.sigma(0) - (5.0_f64 / 9.0).sqrt()).abs() < 1e-12);
        assert!((found.sigma(1) - (2.0_f64 / 9.0).sqrt()).abs() < 1e-12);
    }
}
