//! Selection of poses: greedy start, then exchanges while they improve the criterion (Fedorov 1972; Mitchell's DETMAX 1974).
//!
//! The contribution of a pose follows from small determinants: `det(M + AᵀA) = det M · det(I + A M⁻¹ Aᵀ)`. An exchange never lowers the criterion,
//! and no candidate is selected twice.

use super::candidate_jacobians::CandidateJacobians;
use nalgebra::{DMatrix, DVector};

/// Maximum number of passes of exchanges.
const PASSES_MAX: usize = 4;
/// Smallest relative improvement of the criterion; less is rounding error.
const IMPROVEMENT_MIN: f64 = 1e-9;

/// Criterion of optimality.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Criterion {
    /// D-optimality of all parameters together, with the extrinsic parameters projected out.
    D,
    /// Geometric mean of the singular values of the scaled derivatives divided by the square root of the number of scalar readings (Borm and Menq).
    /// Equivalent to `D` if all poses have equally many readings; otherwise it rates the information per reading.
    O1,
    /// Smallest expected tool error at the test poses.
    Zone,
    /// Random valid poses: for validation, and if the errors of the model's form are larger than the noise.
    Random,
}

/// The candidates under a criterion.
pub(crate) struct PoseCriterion<'a> {
    jacobians: &'a CandidateJacobians,
    criterion: Criterion,
    /// Rows of all candidates, stacked.
    stacked: DMatrix<f64>,
    first: Vec<usize>,
}

impl<'a> PoseCriterion<'a> {
    pub(crate) fn of(jacobians: &'a CandidateJacobians, criterion: Criterion) -> Self {
        let mut first = vec![0];
        for rows in &jacobians.jacobians {
            first.push(first.last().copied().unwrap_or(0) + rows.nrows());
        }
        let total = first.last().copied().unwrap_or(0);
        let mut stacked = DMatrix::zeros(total, jacobians.columns.len());
        for (rows, row) in jacobians.jacobians.iter().zip(&first) {
            stacked.rows_mut(*row, rows.nrows()).copy_from(rows);
        }
        Self { jacobians, criterion, stacked, first }
    }

    /// Information matrix with these poses.
    pub(crate) fn information(&self, picks: &[usize]) -> DMatrix<f64> {
        let mut information = self.jacobians.prior_information.clone();
        picks.iter().for_each(|pick| {
            information +=
                self.jacobians.jacobians[*pick].transpose() * &self.jacobians.jacobians[*pick];
        });
        information
    }

    /// Improvement of the criterion by each candidate.
    pub(crate) fn improvements(&self, picks: &[usize]) -> Vec<f64> {
        let information = self.information(picks);
        let covariance = inverse(&information);
        let through = &self.stacked * &covariance;
        match self.criterion {
            Criterion::Zone => {
                let focused =
                    &self.stacked * (&covariance * &self.jacobians.tool_error_form * &covariance);
                self.for_each_candidate(|first_row, rows, count| {
                    let gain = DMatrix::identity(count, count)
                        + through.rows(first_row, count) * rows.transpose();
                    let fallen = focused.rows(first_row, count) * rows.transpose();
                    gain.cholesky().map_or(0.0, |gain| gain.solve(&fallen).trace())
                })
            }
            // Random poses are rated by D-optimality.
            Criterion::D | Criterion::O1 | Criterion::Random => {
                let nuisance = self.jacobians.nuisance_count;
                let around = inverse(&information.view((0, 0), (nuisance, nuisance)).into_owned());
                let other = self.stacked.columns(0, nuisance) * around;
                let read = self.jacobians.measured_information.1
                    + picks.iter().map(|p| self.jacobians.jacobians[*p].nrows()).sum::<usize>();
                let found = (self.jacobians.columns.len() - nuisance) as f64;
                self.for_each_candidate(|first_row, rows, count| {
                    let one = || DMatrix::identity(count, count);
                    let all = log_det(one() + through.rows(first_row, count) * rows.transpose());
                    let around = rows.columns(0, nuisance).transpose();
                    let gain = all - log_det(one() + other.rows(first_row, count) * around);
                    if self.criterion != Criterion::O1 {
                        return gain;
                    }
                    gain / (2.0 * found) - 0.5 * ((read + count) as f64 / read.max(1) as f64).ln()
                })
            }
        }
    }

    fn for_each_candidate(&self, worth: impl Fn(usize, &DMatrix<f64>, usize) -> f64) -> Vec<f64> {
        let all = self.jacobians.jacobians.iter().zip(&self.first);
        all.map(|(rows, first_row)| worth(*first_row, rows, rows.nrows())).collect()
    }
}

/// Selects `count` candidates; `improvements` gives the improvement by each candidate in addition to those selected.
pub(crate) fn select_greedily(
    improvements: &dyn Fn(&[usize]) -> Vec<f64>,
    count: usize,
) -> Vec<usize> {
    let mut picks = Vec::with_capacity(count);
    while picks.len() < count {
        let Some(best) = best(&improvements(&picks), &picks) else { break };
        picks.push(best);
    }
    exchange(improvements, &mut picks);
    picks
}

/// Exchanges selected candidates for better ones while the criterion improves.
pub(crate) fn exchange(improvements: &dyn Fn(&[usize]) -> Vec<f64>, picks: &mut [usize]) {
    for _ in 0..PASSES_MAX {
        let mut gained = false;
        for place in 0..picks.len() {
            let others: Vec<usize> = picks
                .iter()
                .enumerate()
                .filter(|(k, _)| *k != place)
                .map(|(_, pick)| *pick)
                .collect();
            let worths = improvements(&others);
            let Some(best) = best(&worths, &others) else { continue };
            if worths[best] > worths[picks[place]] + IMPROVEMENT_MIN * worths[best].abs() {
                picks[place] = best;
                gained = true;
            }
        }
        if !gained {
            break;
        }
    }
}

fn best(improvements: &[f64], selected: &[usize]) -> Option<usize> {
    let open = improvements
        .iter()
        .enumerate()
        .filter(|(k, worth)| !selected.contains(k) && worth.is_finite());
    open.max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0))).map(|(k, _)| k)
}

/// Inverse of a matrix that is at least the identity.
pub(crate) fn inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let size = matrix.nrows();
    // Scaled to a unit diagonal first, since the magnitudes of the columns differ by orders.
    let scale =
        DVector::from_iterator(size, (0..size).map(|k| 1.0 / matrix[(k, k)].max(1e-300).sqrt()));
    let even = DMatrix::from_fn(size, size, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let found = even.cholesky().map_or_else(|| DMatrix::identity(size, size), |c| c.inverse());
    DMatrix::from_fn(size, size, |i, j| found[(i, j)] * scale[i] * scale[j])
}

/// Logarithm of the determinant of a positive definite matrix; minus infinity for any other.
pub(crate) fn log_det(matrix: DMatrix<f64>) -> f64 {
    matrix.cholesky().map_or(f64::NEG_INFINITY, |c| {
        2.0 * c.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>()
    })
}
