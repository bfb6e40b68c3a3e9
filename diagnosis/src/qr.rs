//! Least squares by QR factorisation: rows are added one by one, and only the upper triangle is stored.
//!
//! `[J | r] = Q R` by Householder reflections, a block of rows at a time (Golub and Van Loan, Matrix Computations, 5.2 and 6.5),
//! so that the square of the condition number never enters and no more than a block of rows is held. The reflections of a few columns are
//! applied to all others together, as products of matrices.
//!
//! The same rows in the same order give the same bits; zero columns are harmless. Dependent columns are detected in `identifiability.rs`.

use crate::simd::{dot, dot_inline, subtract_scaled_inline};
use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut};
use physics::lanes::{Kernel, Lanes, run_widest};
use std::ops::Range;

/// Rows that are reduced in one block.
const BLOCK: usize = 64;
/// Columns whose reflections are applied together.
const PANEL: usize = 16;

/// The upper triangle `R` of `[J | r]`: `width` columns of `J` and the right-hand side as one more.
#[derive(Clone, Debug)]
pub struct QrFactor {
    width: usize,
    /// Column-major, `width + 1` rows and columns; entries below the diagonal are never read.
    entries: Vec<f64>,
    /// Rows not yet reduced, column-major in blocks of [`BLOCK`].
    waiting: Vec<f64>,
    waiting_rows: usize,
    rows: usize,
}

impl QrFactor {
    /// An empty system for `width` columns.
    #[must_use]
    pub fn new(width: usize) -> Self {
        let columns = width + 1;
        Self {
            width,
            entries: vec![0.0; columns * columns],
            waiting: vec![0.0; columns * BLOCK],
            waiting_rows: 0,
            rows: 0,
        }
    }

    /// Number of columns, without the right-hand side.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows added.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Adds the row `row · x ≈ right`; entries beyond the width are ignored, missing ones are zero.
    pub fn push(&mut self, row: &[f64], right: f64) {
        let slot = self.waiting_rows;
        for (column, value) in row.iter().take(self.width).enumerate() {
            self.waiting[column * BLOCK + slot] = *value;
        }
        self.waiting[self.width * BLOCK + slot] = right;
        self.waiting_rows += 1;
        self.rows += 1;
        if self.waiting_rows == BLOCK {
            self.reduce();
        }
    }

    /// Adds the row `weight · x[column] ≈ right`.
    pub fn push_one(&mut self, column: usize, weight: f64, right: f64) {
        let mut row = vec![0.0; self.width];
        row[column] = weight;
        self.push(&row, right);
    }

    /// Reduces the pending rows. Required before any result is read.
    pub fn reduce(&mut self) {
        if self.waiting_rows == 0 {
            return;
        }
        let columns = self.width + 1;
        for first in (0..columns).step_by(PANEL) {
            let beyond = (first + PANEL).min(columns);
            let shares = self.reflect(first..beyond);
            if beyond < columns {
                self.reflect_others(first..beyond, &shares);
            }
        }
        self.waiting.fill(0.0);
        self.waiting_rows = 0;
    }

    /// Reflects the pending rows of the columns `panel` into their diagonals, column by column, within the panel only. The pending rows are replaced
    /// by the Householder vectors `v` (with an implicit one at the diagonal) of the reflections `1 − share · v vᵀ`.
    fn reflect(&mut self, panel: Range<usize>) -> [f64; PANEL] {
        run_widest(0, Reflect { triangle: self, panel })
    }

    /// Applies the reflections of `panel` together to the following columns: their product is `1 − V T Vᵀ` (Schreiber and Van Loan 1989).
    fn reflect_others(&mut self, panel: Range<usize>, shares: &[f64; PANEL]) {
        let columns = self.width + 1;
        let (wide, others) = (panel.len(), columns - panel.end);
        let (vectors, waiting) = self.waiting.split_at_mut(panel.end * BLOCK);
        let vectors = &vectors[panel.start * BLOCK..];
        let v = DMatrixView::from_slice(vectors, BLOCK, wide);
        let t = product_of_reflections(vectors, &shares[..wide]);
        let heads = &mut self.entries[panel.end * columns + panel.start..];
        let mut heads =
            DMatrixViewMut::from_slice_with_strides_mut(heads, wide, others, 1, columns);
        let mut waiting = DMatrixViewMut::from_slice(waiting, BLOCK, others);
        let mut along = heads.clone_owned();
        // The transpose is copied: nalgebra 0.35 reads and writes out of bounds if the rows of the left factor are strided and the right one has few
        // columns.
        along.gemm(1.0, &v.transpose(), &waiting, 1.0);
        let along = t.transpose() * along;
        heads -= &along;
        waiting.gemm(-1.0, &v, &along, 1.0);
    }

    /// The entry in row `i` and column `j ≥ i`; column `width` is the right-hand side.
    #[must_use]
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.entries[j * (self.width + 1) + i]
    }

    /// Column `j` down to its diagonal; column `width` is the right-hand side without the residual.
    #[must_use]
    pub fn column(&self, j: usize) -> &[f64] {
        let from = j * (self.width + 1);
        &self.entries[from..from + self.width.min(j + 1)]
    }

    /// Norm of column `j` over all rows.
    #[must_use]
    pub fn norm(&self, j: usize) -> f64 {
        let column = self.column(j);
        dot(column, column).sqrt()
    }

    /// Residual sum of squares.
    #[must_use]
    pub fn rest(&self) -> f64 {
        let rest = self.at(self.width, self.width);
        rest * rest
    }

    /// Sum of squares of the right-hand side.
    #[must_use]
    pub fn total(&self) -> f64 {
        let right = self.column(self.width);
        dot(right, right) + self.rest()
    }

    /// The gradient `Jᵀr`.
    #[must_use]
    pub fn gradient(&self) -> Vec<f64> {
        let right = self.column(self.width);
        (0..self.width).map(|j| dot(self.column(j), &right[..=j])).collect()
    }

    /// Least-squares solution with the additional rows `damping[j] x[j] ≈ 0`. Zero columns give zero.
    #[must_use]
    pub fn solve(&self, damping: &[f64]) -> Vec<f64> {
        let mut damped = self.clone();
        for (j, weight) in damping.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
            damped.push_one(j, *weight, 0.0);
        }
        damped.reduce();
        damped.back(damped.column(self.width).to_vec())
    }

    /// As [`QrFactor::solve`] with `x ≥ lowest`: violated entries are fixed at their bound, and the others are solved for again.
    #[must_use]
    pub fn solve_above(&self, damping: &[f64], lowest: &[f64]) -> Vec<f64> {
        let mut x = self.solve(damping);
        let mut held = vec![false; self.width];
        loop {
            let below = |j: &usize| !held[*j] && x[*j] < lowest[*j];
            let beyond: Vec<usize> = (0..self.width).filter(below).collect();
            if beyond.is_empty() {
                return x;
            }
            beyond.into_iter().for_each(|j| held[j] = true);
            let free = |j: usize, value: f64| if held[j] { 0.0 } else { value };
            let mut others = Self::new(self.width);
            for i in 0..=self.width {
                let row: Vec<f64> =
                    (0..self.width).map(|j| if i <= j { self.at(i, j) } else { 0.0 }).collect();
                let taken: f64 =
                    (0..self.width).filter(|j| held[*j]).map(|j| row[j] * lowest[j]).sum();
                let row: Vec<f64> =
                    row.iter().enumerate().map(|(j, value)| free(j, *value)).collect();
                others.push(&row, self.at(i, self.width) - taken);
            }
            others.reduce();
            let damping: Vec<f64> = damping.iter().enumerate().map(|(j, d)| free(j, *d)).collect();
            x = others.solve(&damping);
            (0..self.width).filter(|j| held[*j]).for_each(|j| x[j] = lowest[j]);
        }
    }

    /// `R⁻¹ right`; a zero on the diagonal gives a zero.
    #[must_use]
    pub fn back(&self, mut right: Vec<f64>) -> Vec<f64> {
        for j in (0..right.len().min(self.width)).rev() {
            let pivot = self.at(j, j);
            let x = if pivot == 0.0 { 0.0 } else { right[j] / pivot };
            right[j] = x;
            let column = &self.entries[j * (self.width + 1)..];
            right[..j].iter_mut().zip(column).for_each(|(r, a)| *r -= a * x);
        }
        right
    }

    /// `R⁻ᵀ right`; a zero on the diagonal gives a zero.
    #[must_use]
    pub fn forward(&self, mut right: Vec<f64>) -> Vec<f64> {
        for j in 0..right.len().min(self.width) {
            let known = dot(&self.column(j)[..j], &right[..j]);
            let pivot = self.at(j, j);
            right[j] = if pivot == 0.0 { 0.0 } else { (right[j] - known) / pivot };
        }
        right
    }

    /// `R⁻¹` by rows, upper triangular: row `i` starts at its diagonal. `(RᵀR)⁻¹ = R⁻¹ R⁻ᵀ`.
    #[must_use]
    pub fn inverse(&self) -> Vec<Vec<f64>> {
        let mut rows: Vec<Vec<f64>> = (0..self.width).map(|i| vec![0.0; self.width - i]).collect();
        for j in 0..self.width {
            let mut unit = vec![0.0; j + 1];
            unit[j] = 1.0;
            for (i, x) in self.back(unit).into_iter().enumerate() {
                rows[i][j - i] = x;
            }
        }
        rows
    }

    /// The system of the same columns with another right-hand side, given by its gradient `Jᵀr`, without what no column reaches.
    #[must_use]
    pub(crate) fn with_gradient(&self, gradient: Vec<f64>) -> Self {
        let mut system = self.clone();
        let right = self.forward(gradient);
        let from = self.width * (self.width + 1);
        system.entries[from..from + self.width].copy_from_slice(&right);
        system.entries[from + self.width] = 0.0;
        system
    }

    /// The triangle of a subset of the columns, in the given order.
    #[must_use]
    pub fn of_columns(&self, columns: &[usize]) -> Self {
        let mut part = Self::new(columns.len());
        let mut row = vec![0.0; columns.len()];
        for i in 0..=self.width {
            for (slot, j) in row.iter_mut().zip(columns) {
                *slot = if i <= *j { self.at(i, *j) } else { 0.0 };
            }
            part.push(&row, self.at(i, self.width));
        }
        part.reduce();
        part.rows = self.rows;
        part
    }
}

/// Work of [`QrFactor::reflect`].
struct Reflect<'a> {
    triangle: &'a mut QrFactor,
    panel: Range<usize>,
}

impl Kernel for Reflect<'_> {
    type Output = [f64; PANEL];

    #[inline(always)]
    fn run<S: Lanes>(self, _: S) -> [f64; PANEL] {
        let QrFactor { width, entries, waiting, .. } = self.triangle;
        let (columns, panel) = (*width + 1, self.panel);
        let mut shares = [0.0; PANEL];
        for j in panel.clone() {
            let (left, right) = waiting.split_at_mut((j + 1) * BLOCK);
            let v = &mut left[j * BLOCK..];
            let below = dot_inline(v, v);
            if below == 0.0 {
                continue;
            }
            let diagonal = entries[j * columns + j];
            let norm = (diagonal * diagonal + below).sqrt();
            let reflected = if diagonal > 0.0 { -norm } else { norm };
            let pivot = diagonal - reflected;
            let share = -pivot / reflected;
            for x in v.iter_mut() {
                *x /= pivot;
            }
            entries[j * columns + j] = reflected;
            for k in j + 1..panel.end {
                let column = &mut right[(k - j - 1) * BLOCK..(k - j) * BLOCK];
                let head = &mut entries[k * columns + j];
                let s = share * (*head + dot_inline(v, column));
                *head -= s;
                subtract_scaled_inline(column, s, v);
            }
            shares[j - panel.start] = share;
        }
        shares
    }
}

/// The upper triangle `T` of the product `H₁ H₂ … = 1 − V T Vᵀ` of reflections with consecutive vectors.
fn product_of_reflections(vectors: &[f64], shares: &[f64]) -> DMatrix<f64> {
    let mut t = DMatrix::zeros(shares.len(), shares.len());
    let vectors: Vec<&[f64]> = vectors.chunks_exact(BLOCK).collect();
    for (j, share) in shares.iter().enumerate() {
        let along: Vec<f64> = vectors[..j].iter().map(|v| dot(v, vectors[j])).collect();
        for i in 0..j {
            let sum: f64 = (i..j).map(|k| t[(i, k)] * along[k]).sum();
            t[(i, j)] = -share * sum;
        }
        t[(j, j)] = *share;
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn triangle(rows: &[Vec<f64>], right: &[f64]) -> QrFactor {
        let mut triangle = QrFactor::new(rows[0].len());
        for (row, r) in rows.iter().zip(right) {
            triangle.push(row, *r);
        }
        triangle.reduce();
        triangle
    }

    fn system() -> impl Strategy<Value = (Vec<Vec<f64>>, Vec<f64>)> {
        (5..200_usize).prop_flat_map(|rows| {
            let row = prop::collection::vec(-1.0..1.0_f64, 4);
            (prop::collection::vec(row, rows), prop::collection::vec(-1.0..1.0_f64, rows))
        })
    }

    proptest! {
        #[test]
        fn what_the_solution_leaves_is_normal_to_every_column((rows, right) in system()) {
            let triangle = triangle(&rows, &right);
            let x = triangle.solve(&[0.0; 4]);
            let left: Vec<f64> = rows.iter().zip(&right).map(|(row, r)| r - dot(row, &x)).collect();
            for j in 0..4 {
                let along: f64 = rows.iter().zip(&left).map(|(row, l)| row[j] * l).sum();
                prop_assert!(along.abs() < 1e-9, "column {j}: {along}");
            }
            prop_assert!((dot(&left, &left) - triangle.rest()).abs() < 1e-9);
            prop_assert!((dot(&right, &right) - triangle.total()).abs() < 1e-9);
        }

        #[test]
        fn the_inverse_undoes_the_triangle((rows, right) in system(), x in prop::collection::vec(-1.0..1.0_f64, 4)) {
            let triangle = triangle(&rows, &right);
            let inverse = triangle.inverse();
            let product: Vec<f64> = (0..4).map(|i| (i..4).map(|j| triangle.at(i, j) * x[j]).sum()).collect();
            for i in 0..4 {
                let back: f64 = (i..4).map(|j| inverse[i][j - i] * product[j]).sum();
                prop_assert!((back - x[i]).abs() < 1e-6, "{back} not {}", x[i]);
            }
        }

        #[test]
        fn no_bounded_solution_could_fall_further((rows, right) in system(), lowest in prop::collection::vec(-0.2..0.0_f64, 4)) {
            let x = triangle(&rows, &right).solve_above(&[0.0; 4], &lowest);
            let left: Vec<f64> = rows.iter().zip(&right).map(|(row, r)| r - dot(row, &x)).collect();
            for j in 0..4 {
                prop_assert!(x[j] >= lowest[j]);
                // The gradient is zero, or points against an active bound (which may have been activated early).
                let slope: f64 = rows.iter().zip(&left).map(|(row, l)| row[j] * l).sum();
                prop_assert!(slope.abs() < 1e-8 || x[j] == lowest[j], "{j}: {slope}");
            }
        }

        #[test]
        fn a_part_of_the_columns_is_what_their_rows_alone_give((rows, right) in system()) {
            let part = triangle(&rows, &right).of_columns(&[2, 0]);
            let picked: Vec<Vec<f64>> = rows.iter().map(|row| vec![row[2], row[0]]).collect();
            let direct = triangle(&picked, &right);
            for (a, b) in part.solve(&[0.0; 2]).iter().zip(direct.solve(&[0.0; 2])) {
                prop_assert!((a - b).abs() < 1e-8);
            }
            prop_assert!((part.rest() - direct.rest()).abs() < 1e-9);
        }
    }

    #[test]
    fn many_columns_at_once_leave_what_is_normal_to_each_of_them() {
        let entry = |i: usize, j: usize| ((i * 31 + j * 17 + i * j) as f64 * 0.7).sin();
        let rows: Vec<Vec<f64>> = (0..300)
            .map(|i| (0..50).map(|j| if j == 20 { 0.0 } else { entry(i, j) }).collect())
            .collect();
        let right: Vec<f64> = (0..300).map(|i| entry(i, 77)).collect();
        let triangle = triangle(&rows, &right);
        let x = triangle.solve(&[0.0; 50]);
        assert_eq!(x[20], 0.0);
        let left: Vec<f64> = rows.iter().zip(&right).map(|(row, r)| r - dot(row, &x)).collect();
        for j in 0..50 {
            let along: f64 = rows.iter().zip(&left).map(|(row, l)| row[j] * l).sum();
            assert!(along.abs() < 1e-9, "column {j}: {along}");
        }
        assert!((dot(&left, &left) - triangle.rest()).abs() < 1e-9);
    }

    #[test]
    fn a_column_of_zeros_stays_at_zero_and_harms_no_other() {
        let rows: Vec<Vec<f64>> = (0..70).map(|i| vec![1.0, 0.0, f64::from(i)]).collect();
        let right: Vec<f64> = (0..70).map(|i| 2.0 + 3.0 * f64::from(i)).collect();
        let x = triangle(&rows, &right).solve(&[0.0; 3]);
        assert!((x[0] - 2.0).abs() < 1e-10 && x[1] == 0.0 && (x[2] - 3.0).abs() < 1e-12);
    }
}
