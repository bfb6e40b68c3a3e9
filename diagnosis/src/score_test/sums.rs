//! Sums for the score test of groups of columns.
//!
//! Columns of a group are tested jointly, groups separately.

use super::{CandidateScore, ROWS, transpose_view};
use crate::engine::partial_cholesky::PartialCholesky;
use crate::qr::QrFactor;
use crate::simd::dot;
use nalgebra::DMatrix;
use std::ops::Range;

/// Least squared ratio of a candidate column's length after projection on the fit's columns to its full length.
const LEFT: f64 = 1e-6;
/// Groups with at most this many columns are multiplied column by column.
const FEW: usize = 5;

/// Sums over all rows, for a batch of columns.
pub(super) struct ScoreSums {
    width: usize,
    count: usize,
    /// Pending rows, one per column: those of the fit, the residual, those of the candidates.
    waiting: DMatrix<f64>,
    filled: usize,
    /// `Jᵀ C`, and below it `rᵀ C`.
    mixed: DMatrix<f64>,
    /// `Cᵀ C` of each group.
    group_products: Vec<(Range<usize>, DMatrix<f64>)>,
    /// The group of each column.
    home: Vec<usize>,
    /// `Y`, column by column.
    projected: Vec<Vec<f64>>,
    right: Vec<f64>,
}

impl ScoreSums {
    /// `groups`: number of columns of each.
    pub(super) fn new(width: usize, groups: &[usize]) -> Self {
        let mut count = 0;
        let group = |size: &usize| {
            count += size;
            (count - size..count, DMatrix::zeros(*size, *size))
        };
        let group_products: Vec<(Range<usize>, DMatrix<f64>)> = groups.iter().map(group).collect();
        let home = groups.iter().enumerate().flat_map(|(k, size)| std::iter::repeat_n(k, *size));
        Self {
            width,
            count,
            waiting: DMatrix::zeros(width + count + 1, ROWS),
            filled: 0,
            mixed: DMatrix::zeros(width + 1, count),
            group_products,
            home: home.collect(),
            projected: Vec::new(),
            right: Vec::new(),
        }
    }

    pub(super) fn add(&mut self, row: &[f64], columns: &[f64], right: f64) {
        let mut slot = self.waiting.column_mut(self.filled);
        let all = row.iter().chain(std::iter::once(&right)).chain(columns);
        slot.iter_mut().zip(all).for_each(|(slot, x)| *slot = *x);
        self.filled += 1;
        if self.filled == ROWS {
            self.reduce();
        }
    }

    /// Adds the products of the pending rows.
    fn reduce(&mut self) {
        let (known, count) = (self.width + 1, self.count);
        self.waiting.columns_range_mut(self.filled..).fill(0.0);
        let (rows, turned) = (&self.waiting, transpose_view(&self.waiting));
        let group_columns = turned.columns(known, count);
        self.mixed.gemm(1.0, &rows.rows(0, known), &group_columns, 1.0);
        for (columns_of_group, group_products) in self
            .group_products
            .iter_mut()
            .filter(|(columns_of_group, _)| columns_of_group.len() > FEW)
        {
            let columns = group_columns.columns(columns_of_group.start, columns_of_group.len());
            group_products.gemm(
                1.0,
                &rows.rows(known + columns_of_group.start, columns_of_group.len()),
                &columns,
                1.0,
            );
        }
        for row in rows.as_slice().chunks_exact(known + count).take(self.filled) {
            for (columns_of_group, group_products) in self
                .group_products
                .iter_mut()
                .filter(|(columns_of_group, _)| columns_of_group.len() <= FEW)
            {
                let row_of_group = &row[known..][columns_of_group.clone()];
                for (b, y) in row_of_group.iter().enumerate() {
                    row_of_group[..=b]
                        .iter()
                        .enumerate()
                        .for_each(|(a, x)| group_products[(a, b)] += x * y);
                }
            }
        }
        self.filled = 0;
    }

    pub(super) fn project(&mut self, triangle: &QrFactor, right: &[f64]) {
        self.reduce();
        let column = |k: usize| self.mixed.column(k).iter().take(self.width).copied().collect();
        self.projected = (0..self.count).map(|k| triangle.forward(column(k))).collect();
        self.right = right.to_vec();
    }

    pub(super) fn score(
        &self,
        candidate: usize,
        columns: std::ops::Range<usize>,
        sigmas: &[f64],
    ) -> Option<CandidateScore> {
        let first = columns.start;
        let mut values = vec![0.0; columns.len()];
        // The projected columns `S`, without their priors.
        let remaining = |a: usize, b: usize| {
            let (group, group_products) = &self.group_products[self.home[a]];
            let (i, j) = (a.min(b) - group.start, a.max(b) - group.start);
            group_products[(i, j)] - dot(&self.projected[a], &self.projected[b])
        };
        let length = |a: usize| {
            let (group, group_products) = &self.group_products[self.home[a]];
            group_products[(a - group.start, a - group.start)]
        };
        let solved = PartialCholesky::of(
            columns,
            |a, b| remaining(a, b) + if a == b { sigmas[a].powi(-2) } else { 0.0 },
            |a| self.mixed[(self.width, a)] - dot(&self.projected[a], &self.right),
            |a, left| remaining(a, a) > LEFT * length(a) && left > LEFT * length(a),
        )?;
        for (column, x) in solved.kept.iter().zip(solved.solution()) {
            values[column - first] = x;
        }
        Some(CandidateScore {
            candidate,
            gain: solved.gain(),
            parameter_count: solved.kept.len(),
            values,
        })
    }
}
