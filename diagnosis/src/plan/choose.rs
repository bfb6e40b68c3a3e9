//! Selection of poses: greedy start, then exchanges while they improve the criterion (Fedorov 1972; Mitchell's DETMAX 1974).
//!
//! The contribution of a pose follows from small determinants: `det(M + AᵀA) = det M · det(I + A M⁻¹ Aᵀ)`. An exchange never lowers the criterion,
//! and no candidate is selected twice.

use super::bank::Bank;
use nalgebra::{DMatrix, DVector};

/// Maximum number of passes of exchanges.
const PASSES: usize = 4;
/// Smallest relative improvement of the criterion; less is rounding error.
const GAIN: f64 = 1e-9;

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
pub(crate) struct Design<'a> {
    bank: &'a Bank,
    criterion: Criterion,
    /// Rows of all candidates, stacked.
    stacked: DMatrix<f64>,
    first: Vec<usize>,
}

impl<'a> Design<'a> {
    pub(crate) fn of(bank: &'a Bank, criterion: Criterion) -> Self {
        let mut first = vec![0];
        for rows in &bank.rows {
            first.push(first.last().copied().unwrap_or(0) + rows.nrows());
        }
        let total = first.last().copied().unwrap_or(0);
        let mut stacked = DMatrix::zeros(total, bank.columns.len());
        for (rows, at) in bank.rows.iter().zip(&first) {
            stacked.rows_mut(*at, rows.nrows()).copy_from(rows);
        }
        Self { bank, criterion, stacked, first }
    }

    /// Information matrix with these poses.
    pub(crate) fn information(&self, picks: &[usize]) -> DMatrix<f64> {
        let mut information = self.bank.before.clone();
        picks.iter().for_each(|pick| {
            information += self.bank.rows[*pick].transpose() * &self.bank.rows[*pick];
        });
        information
    }

    /// Improvement of the criterion by each candidate.
    pub(crate) fn worths(&self, picks: &[usize]) -> Vec<f64> {
        let information = self.information(picks);
        let covariance = inverse(&information);
        let seen = &self.stacked * &covariance;
        match self.criterion {
            Criterion::Zone => {
                let focused = &self.stacked * (&covariance * &self.bank.focus * &covariance);
                self.each(|at, rows, count| {
                    let gain =
                        DMatrix::identity(count, count) + seen.rows(at, count) * rows.transpose();
                    let fallen = focused.rows(at, count) * rows.transpose();
                    gain.cholesky().map_or(0.0, |gain| gain.solve(&fallen).trace())
                })
            }
            // Random poses are rated by D-optimality.
            Criterion::D | Criterion::O1 | Criterion::Random => {
                let nuisance = self.bank.nuisance;
                let around = inverse(&information.view((0, 0), (nuisance, nuisance)).into_owned());
                let other = self.stacked.columns(0, nuisance) * around;
                let read = self.bank.measured.1
                    + picks.iter().map(|p| self.bank.rows[*p].nrows()).sum::<usize>();
                let found = (self.bank.columns.len() - nuisance) as f64;
                self.each(|at, rows, count| {
                    let one = || DMatrix::identity(count, count);
                    let all = log_det(one() + seen.rows(at, count) * rows.transpose());
                    let around = rows.columns(0, nuisance).transpose();
                    let gain = all - log_det(one() + other.rows(at, count) * around);
                    if self.criterion != Criterion::O1 {
                        return gain;
                    }
                    gain / (2.0 * found) - 0.5 * ((read + count) as f64 / read.max(1) as f64).ln()
                })
            }
        }
    }

    fn each(&self, worth: impl Fn(usize, &DMatrix<f64>, usize) -> f64) -> Vec<f64> {
        let all = self.bank.rows.iter().zip(&self.first);
        all.map(|(rows, at)| worth(*at, rows, rows.nrows())).collect()
    }
}

/// Selects `count` candidates; `worths` gives the improvement by each candidate in addition to those selected.
pub(crate) fn choose(worths: &dyn Fn(&[usize]) -> Vec<f64>, count: usize) -> Vec<usize> {
    let mut picks = Vec::with_capacity(count);
    while picks.len() < count {
        let Some(best) = best(&worths(&picks), &picks) else { break };
        picks.push(best);
    }
    exchange(worths, &mut picks);
    picks
}

/// Exchanges selected candidates for better ones while the criterion improves.
pub(crate) fn exchange(worths: &dyn Fn(&[usize]) -> Vec<f64>, picks: &mut [usize]) {
    for _ in 0..PASSES {
        let mut gained = false;
        for place in 0..picks.len() {
            let others: Vec<usize> = picks
                .iter()
                .enumerate()
                .filter(|(k, _)| *k != place)
                .map(|(_, pick)| *pick)
                .collect();
            let worths = worths(&others);
            let Some(best) = best(&worths, &others) else { continue };
            if worths[best] > worths[picks[place]] + GAIN * worths[best].abs() {
                picks[place] = best;
                gained = true;
            }
        }
        if !gained {
            break;
        }
    }
}

fn best(worths: &[f64], taken: &[usize]) -> Option<usize> {
    let open =
        worths.iter().enumerate().filter(|(k, worth)| !taken.contains(k) && worth.is_finite());
    open.max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0))).map(|(k, _)| k)
}

/// Inverse of a matrix that is at least the identity.
pub(crate) fn inverse(of: &DMatrix<f64>) -> DMatrix<f64> {
    let size = of.nrows();
    // Scaled to a unit diagonal first, since the magnitudes of the columns differ by orders.
    let scale =
        DVector::from_iterator(size, (0..size).map(|k| 1.0 / of[(k, k)].max(1e-300).sqrt()));
    let even = DMatrix::from_fn(size, size, |i, j| of[(i, j)] * scale[i] * scale[j]);
    let found = even.cholesky().map_or_else(|| DMatrix::identity(size, size), |c| c.inverse());
    DMatrix::from_fn(size, size, |i, j| found[(i, j)] * scale[i] * scale[j])
}

/// Logarithm of the determinant of a positive definite matrix; minus infinity for any other.
pub(crate) fn log_det(of: DMatrix<f64>) -> f64 {
    of.cholesky().map_or(f64::NEG_INFINITY, |c| {
        2.0 * c.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>()
    })
}
