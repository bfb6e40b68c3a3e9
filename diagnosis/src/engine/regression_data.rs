//! Rows of several channels (joints, or axes of a sensor) with the columns of candidates, and residuals and covariance of a fit.
//!
//! Right-hand side and columns of a channel are whitened by the same AR noise model.

use nalgebra::{DMatrix, DVector};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use super::normal_equations::LeastSquaresSolution;
use super::sandwich::{self, BlockSettings, BlockSums};
use crate::autocorrelation::ArModel;

/// Measured torques or forces less the contributions that the model states, with the rows to use and the noise model.
#[derive(Clone, Debug)]
pub(crate) struct RegressionData {
    /// Rows of each run without gaps.
    pub(crate) runs: Vec<Range<usize>>,
    /// Right-hand side: a value per joint and row, N m or N; `None` if the joint's torque was not recorded.
    pub(crate) target: Vec<Option<Vec<f64>>>,
    /// Whether the joint moves, per joint and row. At rest, stiction balances any torque, so that such rows contain no information.
    pub(crate) moves: Vec<Vec<bool>>,
    /// Whether the value is used, per joint and row.
    pub(crate) counts: Vec<Vec<bool>>,
    /// AR noise model of each joint, and the standard deviation of its noise, N m or N.
    pub(crate) noise: Vec<(ArModel, f64)>,
}

impl RegressionData {
    pub(crate) fn rows(&self) -> usize {
        self.runs.last().map_or(0, |run| run.end)
    }

    /// The joints whose torque was recorded.
    pub(crate) fn joints(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.target.len()).filter(|joint| self.target[*joint].is_some())
    }

    /// Whitened values of one joint, in units of the standard deviation of the noise.
    pub(crate) fn whitened(&self, joint: usize, values: &[f64]) -> Vec<f64> {
        let size = self.noise[joint].1;
        let mut all = self.decorrelated(joint, values).into_owned();
        all.iter_mut().for_each(|x| *x /= size);
        all
    }

    /// Values of one joint with the noise's autocorrelation removed, in N m or N.
    pub(crate) fn decorrelated<'v>(&self, joint: usize, values: &'v [f64]) -> Cow<'v, [f64]> {
        let colour = &self.noise[joint].0;
        if colour.is_white() {
            return Cow::Borrowed(values);
        }
        let mut all = Vec::with_capacity(values.len());
        self.runs.iter().for_each(|run| colour.append_whitened(&values[run.clone()], &mut all));
        Cow::Owned(all)
    }
}

/// Regressor of one coefficient: a value per row for each joint that it acts on.
#[derive(Clone, Debug, Default)]
pub(crate) struct Regressor {
    pub(crate) parts: Vec<(usize, Arc<[f64]>)>,
}

impl Regressor {
    /// Linear combination of columns for one joint.
    pub(crate) fn linear_combination(
        columns: &[(&Self, f64)],
        joint: usize,
        rows: usize,
    ) -> Vec<f64> {
        let mut all = vec![0.0; rows];
        for (column, number) in columns {
            for (_, part) in column.parts.iter().filter(|(channel, _)| *channel == joint) {
                all.iter_mut().zip(part.iter()).for_each(|(sum, x)| *sum += number * x);
            }
        }
        all
    }
}

/// Residual of one joint's torque, row by row, N m or N.
pub(crate) fn residual(
    table: &RegressionData,
    columns: &[Regressor],
    solved: &LeastSquaresSolution,
    joint: usize,
) -> Vec<f64> {
    let parts: Vec<(&Regressor, f64)> =
        solved.columns.iter().zip(&solved.values).map(|(k, v)| (&columns[*k], *v)).collect();
    let model = Regressor::linear_combination(&parts, joint, table.rows());
    let target = table.target[joint].iter().flatten();
    target.zip(model).map(|(target, model)| target - model).collect()
}

/// Cluster-robust covariance of the coefficients of a fit, from blocks of time ([`sandwich`]).
pub(crate) fn covariance(
    table: &RegressionData,
    columns: &[Regressor],
    solved: &LeastSquaresSolution,
    used: &[bool],
) -> DMatrix<f64> {
    let settings = BlockSettings::DRIVE_OR_CUT;
    let blocks = blocks((table, columns), solved, used, settings.blocks);
    sandwich::covariance(solved.covariance(), blocks, &settings)
}

/// Whitened columns of a solution that act on a joint, each with its index in the solution.
pub(crate) fn whitened_columns(
    table: &RegressionData,
    columns: &[Regressor],
    solved: &LeastSquaresSolution,
    joint: usize,
) -> Vec<(usize, Vec<f64>)> {
    let whitened = |(k, column): (usize, &usize)| {
        let mut parts = columns[*column].parts.iter();
        let (_, values) = parts.find(|(channel, _)| *channel == joint)?;
        Some((k, table.whitened(joint, values)))
    };
    solved.columns.iter().enumerate().filter_map(whitened).collect()
}

/// Rows of block `k` of `count`.
fn rows_of(k: usize, rows: usize, count: usize) -> Range<usize> {
    (k * rows).div_ceil(count)..((k + 1) * rows).div_ceil(count)
}

/// Scores and normal matrices of blocks of time.
fn blocks(
    (table, columns): (&RegressionData, &[Regressor]),
    solved: &LeastSquaresSolution,
    used: &[bool],
    block_count: usize,
) -> Vec<BlockSums> {
    let count = solved.columns.len();
    let mut all: Vec<BlockSums> = (0..block_count).map(|_| BlockSums::new(count)).collect();
    let rows = table.rows();
    for joint in table.joints() {
        let left = table.whitened(joint, &residual(table, columns, solved, joint));
        let white = whitened_columns(table, columns, solved, joint);
        for (k, block) in all.iter_mut().enumerate() {
            let counts = |row: &usize| used[*row] && table.counts[joint][*row];
            let counted_rows: Vec<usize> = rows_of(k, rows, block_count).filter(counts).collect();
            let part = DMatrix::from_fn(counted_rows.len(), white.len(), |i, j| {
                white[j].1[counted_rows[i]]
            });
            let rest = DVector::from_fn(counted_rows.len(), |i, _| left[counted_rows[i]]);
            let (score, gram) = (part.tr_mul(&rest), part.tr_mul(&part));
            for (i, (a, _)) in white.iter().enumerate() {
                block.score[*a] += score[i];
                for (j, (b, _)) in white.iter().enumerate() {
                    block.gram[(*a, *b)] += gram[(i, j)];
                }
            }
        }
    }
    all
}
