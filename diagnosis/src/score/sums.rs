//! The sums that tell what groups of columns would gain on top of a fit.
//!
//! Promises: columns of one group are told from each other; groups are not. Never: a look at the arm.

use super::Score;
use crate::triangle::{Triangle, dot};

/// A candidate's share of its own length that must be left after the fit's columns, squared.
const LEFT: f64 = 1e-6;
/// Sums over all rows, for a batch of columns.
pub(super) struct Sums {
    width: usize,
    count: usize,
    /// `Jᵀ C`, one slice of `count` per column of the fit.
    mixed: Vec<f64>,
    /// `Cᵀ C` within the groups: `near[k][d] = c_k · c_{k+d}`.
    near: Vec<Vec<f64>>,
    pull: Vec<f64>,
    /// `Y`, one column after the other.
    seen: Vec<Vec<f64>>,
    right: Vec<f64>,
}

impl Sums {
    /// `groups`: columns of each.
    pub(super) fn new(width: usize, groups: &[usize]) -> Self {
        let of_group = |count: &usize| (1..=*count).rev().map(|left| vec![0.0; left]);
        let near: Vec<Vec<f64>> = groups.iter().flat_map(of_group).collect();
        let count = near.len();
        Self {
            width,
            count,
            mixed: vec![0.0; width * count],
            near,
            pull: vec![0.0; count],
            seen: Vec::new(),
            right: Vec::new(),
        }
    }

    pub(super) fn add(&mut self, row: impl Iterator<Item = f64>, columns: &[f64], right: f64) {
        for (j, slice) in row.zip(self.mixed.chunks_exact_mut(self.count.max(1))) {
            if j != 0.0 {
                slice.iter_mut().zip(columns).for_each(|(sum, c)| *sum += j * c);
            }
        }
        for (k, (c, near)) in columns.iter().zip(&mut self.near).enumerate() {
            self.pull[k] += c * right;
            near.iter_mut().zip(&columns[k..]).for_each(|(sum, b)| *sum += c * b);
        }
    }

    pub(super) fn project(&mut self, triangle: &Triangle, right: &[f64]) {
        let column = |k: usize| (0..self.width).map(|j| self.mixed[j * self.count + k]).collect();
        self.seen = (0..self.count).map(|k| triangle.forward(column(k))).collect();
        self.right = right.to_vec();
    }

    pub(super) fn score(
        &self,
        candidate: usize,
        columns: std::ops::Range<usize>,
        sigmas: &[f64],
    ) -> Option<Score> {
        let count = columns.len();
        let mut kept: Vec<usize> = Vec::new();
        let mut left = Triangle::new(count);
        let first = columns.start;
        // Cholesky of S with its dependent columns left out, written as rows of a triangle.
        let mut factor: Vec<Vec<f64>> = Vec::new();
        let mut pulls: Vec<f64> = Vec::new();
        for k in columns {
            let of = |a: usize, b: usize| {
                let (a, b) = (a.min(b), a.max(b));
                self.near[a][b - a] - dot(&self.seen[a], &self.seen[b])
            };
            let prior = sigmas[k].powi(-2);
            let mut row: Vec<f64> = Vec::new();
            for (i, other) in kept.iter().enumerate() {
                let known: f64 = dot(&factor[i][..i], &row[..i]);
                row.push((of(*other, k) - known) / factor[i][i]);
            }
            let own = of(k, k);
            let rest = own + prior - dot(&row, &row);
            let pull = self.pull[k] - dot(&self.seen[k], &self.right) - dot(&row, &pulls);
            if own > LEFT * self.near[k][0] && rest > LEFT * self.near[k][0] {
                let root = rest.sqrt();
                pulls.push(pull / root);
                row.push(root);
                factor.push(row);
                kept.push(k);
            }
        }
        if kept.is_empty() {
            return None;
        }
        for (i, pull) in pulls.iter().enumerate() {
            let mut row = vec![0.0; count];
            for (j, column) in kept.iter().enumerate().skip(i) {
                row[column - first] = factor[j][i];
            }
            left.push(&row, *pull);
        }
        left.reduce();
        let found = left.solve(&vec![1e-12; count]);
        Some(Score { candidate, gain: dot(&pulls, &pulls), numbers: kept.len(), found })
    }
}
