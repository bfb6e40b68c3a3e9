//! Uncertainty of parameters from blocks of time: their change when one block is left out (block jackknife, which is White's sandwich estimator
//! with each block corrected for its leverage: Cameron and Miller, A practitioner's guide to cluster-robust inference, 2015, section VI B).
//!
//! With many parameters and few blocks, the residual of a block is smaller than its noise because of overfitting: uncorrected, every uncertainty would be too small.
//!
//! Promises: autocorrelation within a block does not reduce uncertainties; none is smaller than with white noise. Never: a noise model.

use nalgebra::{DMatrix, DVector};
use std::ops::Range;

use super::columns::Column;
use super::noise;
use super::table::{Solved, Table};

/// Blocks of time that uncertainties are told from.
const BLOCKS: usize = 40;
/// Half of an interval of 95 % of a normal, in standard uncertainties.
const NORMAL: f64 = 1.959_964;

/// What the rows of one block say: `Xᵀ r`, r what is left, and `Xᵀ X`.
struct Block {
    score: DVector<f64>,
    gram: DMatrix<f64>,
}

/// The covariance of the numbers of a fit.
pub(crate) fn covariance_of(
    table: &Table,
    columns: &[Column],
    solved: &Solved,
    used: &[bool],
) -> DMatrix<f64> {
    let count = solved.columns.len();
    let inverse = solved.covariance();
    if count == 0 {
        return inverse.clone();
    }
    let mut meat = DMatrix::zeros(count, count);
    let blocks = blocks(table, columns, solved, used);
    let filled = blocks.iter().filter(|block| block.score.iter().any(|x| *x != 0.0)).count();
    for Block { score, gram } in blocks {
        let own = DMatrix::identity(count, count) - gram * inverse;
        // A number that one block alone tells has no other to be held against: it keeps what the block leaves.
        let freed = own.lu().solve(&score).filter(|freed| freed.iter().all(|x| x.is_finite()));
        let freed = freed.unwrap_or(score);
        meat.ger(1.0, &freed, &freed, 1.0);
    }
    let free = (filled as f64 - 1.0).max(1.0);
    let few = free / (filled as f64).max(1.0);
    let wider = student(free);
    let mut all = inverse * meat * inverse * (few * wider * wider);
    for i in 0..count {
        all[(i, i)] = all[(i, i)].max(inverse[(i, i)]);
    }
    all
}

/// How much wider than of a normal an interval of 95 % is whose size was told from so many free blocks (Student's, by the expansion of Cornish and Fisher).
fn student(free: f64) -> f64 {
    let square = NORMAL * NORMAL;
    let second = (5.0 * square + 16.0) * square + 3.0;
    1.0 + (square + 1.0) / (4.0 * free) + second / (96.0 * free * free)
}

/// Rows of block `k`.
fn rows_of(k: usize, rows: usize) -> Range<usize> {
    (k * rows).div_ceil(BLOCKS)..((k + 1) * rows).div_ceil(BLOCKS)
}

fn blocks(table: &Table, columns: &[Column], solved: &Solved, used: &[bool]) -> Vec<Block> {
    let count = solved.columns.len();
    let none = || Block { score: DVector::zeros(count), gram: DMatrix::zeros(count, count) };
    let mut all: Vec<Block> = (0..BLOCKS).map(|_| none()).collect();
    let rows = table.rows();
    for joint in table.joints() {
        let left = table.whitened(joint, &noise::residual(table, columns, solved, joint));
        let own = |(k, column): (usize, &usize)| {
            let mut parts = columns[*column].parts.iter();
            let (_, values) = parts.find(|(at, _)| *at == joint)?;
            Some((k, table.whitened(joint, values)))
        };
        let white: Vec<(usize, Vec<f64>)> =
            solved.columns.iter().enumerate().filter_map(own).collect();
        for (k, block) in all.iter_mut().enumerate() {
            let counts = |row: &usize| used[*row] && table.counts[joint][*row];
            let here: Vec<usize> = rows_of(k, rows).filter(counts).collect();
            let part = DMatrix::from_fn(here.len(), white.len(), |i, j| white[j].1[here[i]]);
            let rest = DVector::from_fn(here.len(), |i, _| left[here[i]]);
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

#[cfg(test)]
mod tests {
    use super::student;

    #[test]
    fn an_interval_from_few_blocks_is_as_wide_as_students() {
        for (free, quantile) in [(3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (31.0, 2.040)] {
            assert!((student(free) * super::NORMAL / quantile - 1.0).abs() < 0.04, "{free}");
        }
    }
}
