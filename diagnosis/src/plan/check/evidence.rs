//! Sums over whitened rows, and the test statistic of each damage after projecting out the nuisance parameters.
//!
//! With `A` the columns of the nuisance parameters (scaled by their priors), `D` those of a damage and `r` the residuals: `N = 1 + AᵀA`, `S = DᵀD −
//! DᵀA N⁻¹ AᵀD`, `g = Dᵀr − DᵀA N⁻¹ Aᵀr`; the damage reduces the sum of squares by `gᵀ S⁻¹ g`. Unobservable directions of a damage are excluded.

use super::super::pose_selection::inverse;
use crate::campaign::Campaign;
use crate::least_squares::{FitState, ReadingWeights, data_rows};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Information on a direction of damage, in squared standard deviations per squared unit, below which it is unobservable.
const INFORMATION_MIN: f64 = 1e-3;
/// Eigenvalue of the normalised normal matrix below which a direction is linearly dependent on others.
const DEPENDENT: f64 = 1e-9;
/// Information added to each direction of damage in the selection of poses, which keeps the inverse finite.
const OPEN: f64 = 1e-2;

/// The columns of one damage among those of all damages.
#[derive(Clone, Copy, Debug)]
pub(super) struct DamageColumns {
    pub(super) first: usize,
    pub(super) count: usize,
}

/// Estimate of a damage.
pub(super) struct DamageEstimate {
    pub(super) gain: f64,
    /// Estimated size in units of the columns.
    pub(super) size: Vec<f64>,
    /// Standard uncertainty of the length of `size`.
    pub(super) sigma: f64,
    /// Number of observable directions.
    pub(super) count: usize,
}

/// Sums of products of nuisance columns (n), damage columns (d) and residuals (r).
#[derive(Clone, Debug)]
pub(super) struct Evidence {
    nuisance: usize,
    nn: DMatrix<f64>,
    nd: DMatrix<f64>,
    dd: DMatrix<f64>,
    nr: DVector<f64>,
    dr: DVector<f64>,
    rr: f64,
    rows: usize,
}

impl Evidence {
    pub(super) fn new(nuisance: usize, damage: usize) -> Self {
        Self {
            nuisance,
            nn: DMatrix::identity(nuisance, nuisance),
            nd: DMatrix::zeros(nuisance, damage),
            dd: DMatrix::zeros(damage, damage),
            nr: DVector::zeros(nuisance),
            dr: DVector::zeros(damage),
            rr: 0.0,
            rows: 0,
        }
    }

    /// Sums of the measurements in `campaign`, linearised at `state`.
    pub(super) fn of(campaign: &Campaign, state: &FitState, nuisance: usize) -> Self {
        let widths = state.prior_sigmas();
        let all: Vec<usize> = (0..widths.len()).collect();
        let weighing = ReadingWeights::equal(campaign, &vec![true; campaign.poses.len()]);
        let mut evidence = Self::new(nuisance, widths.len() - nuisance);
        data_rows(campaign, state, &weighing, &all, |_, row, right| {
            let scaled = row.iter().zip(&widths).map(|(x, width)| x * width);
            evidence.add(&DMatrix::from_row_iterator(1, widths.len(), scaled), &[right]);
        });
        evidence
    }

    /// Adds scaled rows, with their residuals if given.
    pub(super) fn add(&mut self, rows: &DMatrix<f64>, residuals: &[f64]) {
        let (n, d) = self.split(rows);
        self.nn += n.transpose() * &n;
        self.nd += n.transpose() * &d;
        self.dd += d.transpose() * &d;
        self.rows += rows.nrows();
        if residuals.len() == rows.nrows() {
            let r = DVector::from_row_slice(residuals);
            self.nr += n.transpose() * &r;
            self.dr += d.transpose() * &r;
            self.rr += r.norm_squared();
        }
    }

    fn split(&self, rows: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let damage = rows.ncols() - self.nuisance;
        (
            rows.columns(0, self.nuisance).into_owned(),
            rows.columns(self.nuisance, damage).into_owned(),
        )
    }

    /// Sum of squares after the fit of the nuisance parameters within their priors.
    pub(super) fn sum(&self) -> f64 {
        self.rr - self.nr.dot(&(inverse(&self.nn) * &self.nr))
    }

    /// Degrees of freedom of that sum: the number of readings less the observable directions of the first `open` columns, which have no prior
    /// knowledge.
    pub(super) fn freedom(&self, open: usize) -> usize {
        if open == 0 {
            return self.rows;
        }
        let information =
            self.nn.view((0, 0), (open, open)).into_owned() - DMatrix::identity(open, open);
        let scale = DMatrix::from_fn(open, open, |i, j| {
            information[(i, j)] / (information[(i, i)] * information[(j, j)]).max(1e-300).sqrt()
        });
        let found =
            scale.symmetric_eigenvalues().iter().filter(|value| **value > DEPENDENT).count();
        self.rows.saturating_sub(found)
    }

    /// Sum of squares with all nuisance parameters fitted freely, and its degrees of freedom: measures the noise alone, independent of the stated
    /// uncertainties of the model.
    pub(super) fn noise(&self) -> (f64, usize) {
        if self.nuisance == 0 {
            return (self.rr, self.rows);
        }
        let information = &self.nn - DMatrix::identity(self.nuisance, self.nuisance);
        let width = |i: usize| information[(i, i)].max(1e-300).sqrt();
        let scaled = DMatrix::from_fn(self.nuisance, self.nuisance, |i, j| {
            information[(i, j)] / (width(i) * width(j))
        });
        let right = DVector::from_fn(self.nuisance, |i, _| self.nr[i] / width(i));
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(scaled);
        let shown = eigenvectors.column_iter().zip(eigenvalues.iter());
        let shown = shown.filter(|(_, value)| **value > DEPENDENT);
        let gains = shown.map(|(direction, value)| direction.dot(&right).powi(2) / value);
        let gains: Vec<f64> = gains.collect();
        (self.rr - gains.iter().sum::<f64>(), self.rows.saturating_sub(gains.len()))
    }

    /// Information matrix (`S`) and score (`g`) of a damage.
    fn left(&self, columns: DamageColumns) -> (DMatrix<f64>, DVector<f64>) {
        let DamageColumns { first, count } = columns;
        let taken = inverse(&self.nn) * self.nd.columns(first, count);
        let nd = self.nd.columns(first, count);
        let information = self.dd.view((first, first), (count, count)) - nd.transpose() * &taken;
        let score = self.dr.rows(first, count) - taken.transpose() * &self.nr;
        (0.5 * (&information + information.transpose()), score)
    }

    /// Information on the least observable direction of a damage, in squared standard deviations per squared unit; `None` if it is unobservable.
    pub(super) fn weakest(&self, columns: DamageColumns) -> Option<f64> {
        let information_min = self.left(columns).0.symmetric_eigenvalues().min();
        (information_min > INFORMATION_MIN).then_some(information_min)
    }

    pub(super) fn explained(&self, columns: DamageColumns) -> Option<DamageEstimate> {
        let (information, score) = self.left(columns);
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(information);
        let mut size = DVector::zeros(columns.count);
        let (mut gain, mut spread, mut count) = (0.0, 0.0, 0);
        for (direction, shown) in eigenvectors.column_iter().zip(eigenvalues.iter()) {
            if *shown > INFORMATION_MIN {
                let along = direction.dot(&score) / shown;
                size += direction * along;
                gain += along * along * shown;
                spread += along * along / shown;
                count += 1;
            }
        }
        let length = size.norm();
        let sigma = if length > 0.0 { spread.sqrt() / length } else { 0.0 };
        (count > 0).then(|| DamageEstimate {
            gain,
            size: size.iter().copied().collect(),
            sigma,
            count,
        })
    }

    /// Reduction of the sum over all damages of `tr (S + OPEN)⁻¹` by each candidate's rows; poorly observable directions dominate it.
    pub(super) fn worths(
        &self,
        candidates: &[DMatrix<f64>],
        damages: &[DamageColumns],
    ) -> Vec<f64> {
        let around = inverse(&self.nn);
        let taken = &around * &self.nd;
        let open = |count: usize| DMatrix::identity(count, count) * OPEN;
        let before: Vec<DMatrix<f64>> =
            damages.iter().map(|columns| self.left(*columns).0 + open(columns.count)).collect();
        let traces: Vec<f64> =
            before.iter().map(|information| inverse(information).trace()).collect();
        let worth = |rows: &DMatrix<f64>| {
            let (n, d) = self.split(rows);
            let left = d - &n * &taken;
            let noise =
                DMatrix::identity(rows.nrows(), rows.nrows()) + &n * &around * n.transpose();
            let Some(noise) = noise.cholesky() else { return 0.0 };
            let solved = noise.solve(&left);
            let gain = |(columns, (before, trace)): (&DamageColumns, (&DMatrix<f64>, &f64))| {
                let (a, b) = (
                    left.columns(columns.first, columns.count),
                    solved.columns(columns.first, columns.count),
                );
                trace - inverse(&(before + a.transpose() * b)).trace()
            };
            damages.iter().zip(before.iter().zip(&traces)).map(gain).sum()
        };
        candidates.iter().map(worth).collect()
    }
}

/// Probability of a χ² variable with `freedom` degrees of freedom above `sum`.
pub(super) fn p_above(freedom: usize, sum: f64) -> f64 {
    ChiSquared::new(freedom as f64).map_or(1.0, |chi| chi.sf(sum.max(0.0)))
}

/// Probability of a χ² variable with `freedom` degrees of freedom of at most `sum`.
pub(super) fn p_below(freedom: usize, sum: f64) -> f64 {
    ChiSquared::new(freedom as f64).map_or(1.0, |chi| chi.cdf(sum.max(0.0)))
}

/// Noncentrality at which a χ² test of size `alarm` has the given power.
pub(super) fn minimum_detectable(freedom: usize, alarm: f64, power: f64) -> f64 {
    let Ok(chi) = ChiSquared::new(freedom as f64) else { return f64::INFINITY };
    let bound = chi.inverse_cdf(1.0 - alarm);
    let (mut low, mut high) = (0.0, 1e3);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if detection_power(freedom, middle, bound) < power {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Probability of a noncentral χ² variable above `bound`, as a Poisson mixture of central ones (Johnson, Kotz and Balakrishnan 1995, chapter 29).
fn detection_power(freedom: usize, noncentrality: f64, bound: f64) -> f64 {
    let half = 0.5 * noncentrality;
    let (mut log_weight, mut sum) = (-half, 0.0);
    for k in 0..2000_usize {
        if k > 0 {
            log_weight += (half / k as f64).ln();
        }
        sum += log_weight.exp() * p_above(freedom + 2 * k, bound);
        if k as f64 > half && log_weight < -40.0 {
            break;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_seen_as_surely_as_asked_is_what_tables_say() {
        // Cohen 1988 (table of noncentralities): alarm 0.05, power 0.80.
        for (freedom, expected) in [(1, 7.849), (2, 9.635), (3, 10.903), (6, 13.624)] {
            let found = minimum_detectable(freedom, 0.05, 0.80);
            assert!((found - expected).abs() < 0.01, "{freedom}: {found}");
        }
        assert!((p_above(6, 12.592) - 0.05).abs() < 1e-4);
        assert!((p_below(6, 1.635) - 0.05).abs() < 1e-4);
    }

    #[test]
    fn what_may_change_anyway_hides_a_damage_that_does_the_same() {
        let same = DMatrix::from_row_slice(2, 2, &[1e4, 1.0, 2e4, 2.0]);
        let other = DMatrix::from_row_slice(2, 2, &[1e4, 2.0, 2e4, -1.0]);
        let columns = DamageColumns { first: 0, count: 1 };
        let with = |rows: &DMatrix<f64>| {
            let mut evidence = Evidence::new(1, 1);
            evidence.add(rows, &[1.0, 2.0]);
            evidence
        };
        assert_eq!(with(&same).weakest(columns), None);
        assert!((with(&other).weakest(columns).expect("shown") - 5.0).abs() < 1e-6);
        assert!(with(&same).sum() < 1e-6 && with(&other).freedom(1) == 1);
    }
}
