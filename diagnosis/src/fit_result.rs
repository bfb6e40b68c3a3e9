//! Result of a fit: parameters, uncertainties, residuals.
//!
//! Covariance is `(JᵀWJ)⁻¹` with the priors, times the design effect for correlated measurements of one pose: the mean over the parameters of the
//! ratio of cluster-robust to independent variance (Liang and Zeger 1986).
//!
//! The covariance is symmetric and positive semidefinite.

use crate::campaign::Campaign;
use crate::extrinsics::Extrinsics;
use crate::hypothesis::{Hypothesis, PriorSource};
use crate::identifiability::{ConfoundedColumn, DETERMINED_SIGMAS};
use crate::least_squares::{FitState, ReadingWeights, VisitScope, visit_readings};
use crate::levenberg_marquardt::Minimum;
use crate::linearisation::Linearisation;
use crate::qr::QrFactor;
use crate::simd::dot;
use glam::DVec3;
use nalgebra::DMatrix;
use std::sync::Arc;

/// Largest fraction of a parameter's variance that may come from tolerances if the parameter counts as determined by the data; its interval is then
/// valid whatever the tolerances are. No unit, 0 to 1: with a tenth the interval is at most 5 % wider than from the data alone.
const FROM_TOLERANCES: f64 = 0.1;
/// Correlation from which parameters are reported as confounded. No unit, 0 to 1.
const TOGETHER: f64 = 0.1;
/// Largest number of confounded parameters that are listed for one.
const PARTNERS: usize = 4;

/// Result of a fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The fitted model.
    pub hypothesis: Hypothesis,
    /// Frames, targets and touched objects, fitted.
    pub surroundings: Extrinsics,
    /// Parameters that the data do not determine: they stay at their prior mean, or depend on a tolerance.
    pub undetermined: Vec<UndeterminedParameter>,
    /// Weight of each measurement of the campaign, 0 to 1.
    pub weights: Vec<f64>,
    /// Factor on each instrument's stated noise, estimated from the residuals.
    pub factors: Vec<f64>,
    /// Factor on the covariance relative to that of independent measurements.
    pub design_effect: f64,
    /// Number of steps.
    pub steps: usize,
    /// Whether the minimisation converged.
    pub converged: bool,
    /// Weighted sum of squares of data and priors, in units of the noise variance.
    pub sum_of_squares: f64,
    /// Number of scalar measurements in the poses that took part.
    pub readings: usize,
    active: Vec<usize>,
    /// Whether each active column is determined by the data or by a stated prior.
    determined: Vec<bool>,
    inverse: Vec<Vec<f64>>,
    pub(crate) triangle: QrFactor,
    /// The rows at the fitted state.
    pub(crate) linearisation: Arc<Linearisation>,
}

/// Singular values of the Jacobian with priors, each column in units of its prior's standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditioning {
    /// Number of fitted parameters.
    pub fitted: usize,
    /// Rank: number of independent directions that the data determine, those whose largest plausible change is at least ten standard deviations of
    /// the noise. The others are gauge freedoms, fixed by priors, or insufficiently excited by these poses.
    pub determined: usize,
    /// Condition number over those directions: largest over smallest singular value.
    pub condition: f64,
}

/// A parameter that was not fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct UndeterminedParameter {
    /// Its column: extrinsic parameters first, then the hypothesis' free parameters.
    pub column: usize,
    /// Its name for users.
    pub name: String,
    /// Parameters it is confounded with, strongest first; empty if the data do not depend on it at all.
    pub confounded_with: Vec<String>,
}

impl UndeterminedParameter {
    /// A sentence for users.
    #[must_use]
    pub fn message(&self) -> String {
        match self.confounded_with.as_slice() {
            [] => format!("{} has no effect in these data", self.name),
            [one] => format!("{} and {one} cannot be separated", self.name),
            [first @ .., last] => {
                format!("{} cannot be separated from {} and {last}", self.name, first.join(", "))
            }
        }
    }
}

/// Residual of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Index into the campaign's poses.
    pub pose: usize,
    /// Index among all measurements.
    pub reading: usize,
    /// Measured minus predicted: m (or rad), axes of the measurement.
    pub residual: DVec3,
    /// Whether it is a length.
    pub is_length: bool,
}

/// Final state of the fitting algorithm.
pub(crate) struct FitParts {
    pub(crate) linearisation: Arc<Linearisation>,
    pub(crate) weighing: ReadingWeights,
    pub(crate) active: Vec<usize>,
    pub(crate) dependent: Vec<ConfoundedColumn>,
    pub(crate) bounded: Vec<usize>,
    pub(crate) minimum: Option<Minimum>,
    pub(crate) steps: usize,
    pub(crate) sum: f64,
}

impl Fit {
    pub(crate) fn of(campaign: &Campaign, parts: FitParts) -> Self {
        let FitParts {
            linearisation,
            weighing,
            active,
            dependent,
            bounded,
            minimum,
            steps,
            sum: sum_of_squares,
        } = parts;
        let triangle = minimum.as_ref().map_or(QrFactor::new(0), |m| m.triangle.clone());
        let readings = minimum.as_ref().map_or(0, |m| m.data.rows());
        let inverse = triangle.inverse();
        let design_effect = design_effect(campaign, &linearisation, &weighing, &active, &triangle);
        let names = ColumnNames(&linearisation.state);
        let mut undetermined: Vec<UndeterminedParameter> =
            dependent.iter().map(|d| names.undetermined(d)).collect();
        undetermined.extend(bounded.iter().map(|column| UndeterminedParameter {
            column: *column,
            name: format!("{}, which would be negative,", names.of(*column)),
            confounded_with: Vec::new(),
        }));
        let posterior =
            PosteriorCovariance { inverse: &inverse, active: &active, state: &linearisation.state };
        let determined = posterior.determined();
        let open = (0..active.len()).filter(|place| !determined[*place]);
        undetermined.extend(open.map(|place| posterior.undetermined(place)));
        undetermined.sort_by_key(|open| open.column);
        Self {
            undetermined,
            determined,
            weights: weighing.weights,
            factors: weighing.noise_factors,
            design_effect,
            steps,
            converged: minimum.is_some_and(|m| m.converged),
            sum_of_squares,
            readings,
            active,
            inverse,
            triangle,
            hypothesis: linearisation.state.hypothesis.clone(),
            surroundings: linearisation.state.surroundings.clone(),
            linearisation,
        }
    }

    /// The fitted state.
    pub(crate) fn state(&self) -> FitState {
        FitState { surroundings: self.surroundings.clone(), hypothesis: self.hypothesis.clone() }
    }

    /// The rows of the poses `used` at `state`: those of this fit if they are the same.
    pub(crate) fn rows_at(
        &self,
        campaign: &Campaign,
        state: FitState,
        used: &[bool],
    ) -> Arc<Linearisation> {
        if self.linearisation.matches_state(&state, used) {
            Arc::clone(&self.linearisation)
        } else {
            Arc::new(Linearisation::of(campaign, state, used))
        }
    }

    /// The fitted columns in order: extrinsic parameters first, then free parameters.
    #[must_use]
    pub fn columns(&self) -> &[usize] {
        &self.active
    }

    /// Column of a free parameter of the hypothesis.
    #[must_use]
    pub fn column_of(&self, free: usize) -> usize {
        self.surroundings.parameters().len() + free
    }

    /// Covariance of two columns, SI; `None` if one was not fitted.
    #[must_use]
    pub fn covariance(&self, a: usize, b: usize) -> Option<f64> {
        let index_of = |column| self.active.iter().position(|c| *c == column);
        let (i, j) = (index_of(a)?, index_of(b)?);
        let (i, j) = (i.min(j), i.max(j));
        Some(self.design_effect * dot(&self.inverse[i][j - i..], &self.inverse[j]))
    }

    /// Standard uncertainty of a column, SI; `None` if it was not fitted, or if it depends on a tolerance.
    #[must_use]
    pub fn sigma(&self, column: usize) -> Option<f64> {
        let place = self.active.iter().position(|c| *c == column)?;
        self.covariance(column, column).map(f64::sqrt).filter(|_| self.determined[place])
    }

    /// Correlation of two columns; `None` if one was not fitted.
    #[must_use]
    pub fn correlation(&self, a: usize, b: usize) -> Option<f64> {
        Some(self.covariance(a, b)? / (self.sigma(a)? * self.sigma(b)?))
    }

    /// Variance of a linear combination of columns (one coefficient per entry of [`Fit::columns`]), SI.
    #[must_use]
    pub fn variance_of(&self, shares: &[f64]) -> f64 {
        let projected = self.triangle.forward(shares.to_vec());
        self.design_effect * dot(&projected, &projected)
    }

    /// Rank and condition number of the fit.
    #[must_use]
    pub fn conditioning(&self) -> Conditioning {
        let (width, priors) = (self.active.len(), self.linearisation.state.prior_sigmas());
        let cell = |i: usize, j: usize| {
            if i <= j { self.triangle.at(i, j) * priors[self.active[j]] } else { 0.0 }
        };
        let values = DMatrix::from_fn(width, width, cell).singular_values();
        let shown: Vec<f64> =
            values.iter().copied().filter(|value| *value >= DETERMINED_SIGMAS).collect();
        let most = shown.iter().copied().fold(0.0, f64::max);
        let smallest = shown.iter().copied().fold(f64::INFINITY, f64::min);
        let condition = if shown.is_empty() { 1.0 } else { most / smallest };
        Conditioning { fitted: width, determined: shown.len(), condition }
    }

    /// Parameters that deviate from their prior mean by more than `factor` times their tolerance: name, and number of standard deviations.
    #[must_use]
    pub fn beyond_tolerance(&self, factor: f64) -> Vec<(String, f64)> {
        let (hypothesis, values) = (&self.hypothesis, self.hypothesis.values());
        let tolerated = hypothesis.free.iter().zip(values);
        let tolerated = tolerated.filter(|(free, _)| free.prior_source == PriorSource::Tolerance);
        let deviation_of = |(free, value): (&crate::FreeParameter, f64)| {
            (hypothesis.describe(free), (value - free.mean).abs() / free.sigma)
        };
        tolerated.map(deviation_of).filter(|(_, deviation)| *deviation > factor).collect()
    }

    /// Poses with a measurement of weight below one half.
    #[must_use]
    pub fn outliers(&self, campaign: &Campaign) -> Vec<usize> {
        let mut weights = self.weights.iter();
        let has_outlier = |pose: &crate::Pose| {
            let pose_weights = weights.by_ref().take(pose.seen.len());
            pose_weights.filter(|weight| **weight < 0.5).count() > 0
        };
        let are_outliers: Vec<bool> = campaign.poses.iter().map(has_outlier).collect();
        (0..are_outliers.len()).filter(|pose| are_outliers[*pose]).collect()
    }

    /// Residuals of all measurements, including those of poses that took no part.
    #[must_use]
    pub fn residuals(&self, campaign: &Campaign) -> Vec<Residual> {
        self.state().residuals(campaign)
    }
}

impl FitState {
    /// Residuals of all measurements at this state, including those of poses that took no part in a fit.
    pub(crate) fn residuals(&self, campaign: &Campaign) -> Vec<Residual> {
        let readings: Vec<_> = campaign.poses.iter().flat_map(|pose| &pose.seen).collect();
        let mut residuals = Vec::with_capacity(readings.len());
        visit_readings(campaign, self, VisitScope { used: None, derivatives: false }, |visited| {
            let observation = readings[visited.reading];
            let residual = visited.rows.residual;
            let back = match visited.rows.count {
                1 => DVec3::X * (residual.x / observation.whitening.x_axis.x),
                _ => observation.whitening.inverse() * residual,
            };
            let is_length = observation.reading.is_length();
            residuals.push(Residual {
                pose: visited.pose,
                reading: visited.reading,
                residual: back,
                is_length,
            });
        });
        residuals
    }
}

/// The posterior covariance, to separate the contributions of data and tolerances.
struct PosteriorCovariance<'a> {
    inverse: &'a [Vec<f64>],
    active: &'a [usize],
    state: &'a FitState,
}

impl PosteriorCovariance<'_> {
    fn covariance(&self, a: usize, b: usize) -> f64 {
        let (i, j) = (a.min(b), a.max(b));
        dot(&self.inverse[i][j - i..], &self.inverse[j])
    }

    /// Which columns are determined: of the variance `C = (JᵀWJ + P)⁻¹`, the part `C P C` due to the tolerances (the diagonal of P) is at most
    /// [`FROM_TOLERANCES`].
    fn determined(&self) -> Vec<bool> {
        let first = self.state.surroundings.parameters().len();
        let free = &self.state.hypothesis.free;
        let tolerance = |column: &usize| {
            let free = free.get(column.checked_sub(first)?)?;
            (free.prior_source == PriorSource::Tolerance).then_some(free.sigma)
        };
        let tolerances: Vec<(usize, f64)> = self
            .active
            .iter()
            .enumerate()
            .filter_map(|(place, column)| Some((place, tolerance(column)?)))
            .collect();
        let lent = |place: usize| -> f64 {
            let shares = tolerances.iter().map(|(k, sigma)| self.covariance(place, *k) / sigma);
            shares.map(|share| share * share).sum()
        };
        // Extrinsic parameters are reported in any case, with the uncertainty that includes the tolerances.
        let holds = |place: usize| {
            self.active[place] < first
                || lent(place) <= FROM_TOLERANCES * self.covariance(place, place)
        };
        (0..self.active.len()).map(holds).collect()
    }

    /// Parameters with which a column is confounded: those with the largest correlation.
    fn undetermined(&self, place: usize) -> UndeterminedParameter {
        let size = |k: usize| self.covariance(k, k).sqrt();
        let correlation = |k: usize| {
            let together = (self.covariance(place, k) / (size(place) * size(k))).abs();
            if together.is_finite() { together } else { 0.0 }
        };
        let others = (0..self.active.len()).filter(|k| *k != place);
        let mut partners: Vec<(usize, f64)> =
            others.map(|k| (k, correlation(k))).filter(|(_, r)| *r > TOGETHER).collect();
        partners.sort_by(|a, b| b.1.total_cmp(&a.1));
        let names = ColumnNames(self.state);
        let with = partners.iter().take(PARTNERS).map(|(k, _)| names.of(self.active[*k]));
        let column = self.active[place];
        UndeterminedParameter { column, name: names.of(column), confounded_with: with.collect() }
    }
}

/// Names of columns for users.
pub(crate) struct ColumnNames<'a>(pub(crate) &'a FitState);

impl ColumnNames<'_> {
    pub(crate) fn of(&self, column: usize) -> String {
        let numbers = self.0.surroundings.parameters();
        match numbers.get(column) {
            Some(number) => self.0.surroundings.describe(*number),
            None => {
                let hypothesis = &self.0.hypothesis;
                let free = hypothesis.free.get(column - numbers.len());
                free.map(|free| hypothesis.describe(free)).unwrap_or_default()
            }
        }
    }

    pub(crate) fn undetermined(&self, dependent: &ConfoundedColumn) -> UndeterminedParameter {
        let partners = dependent.partners.iter().take(PARTNERS);
        UndeterminedParameter {
            column: dependent.column,
            name: self.of(dependent.column),
            confounded_with: partners.map(|(column, _)| self.of(*column)).collect(),
        }
    }
}

/// Mean ratio of the parameters' variances with poses as clusters to those of independent measurements; at least one.
fn design_effect(
    campaign: &Campaign,
    linearisation: &Linearisation,
    weighing: &ReadingWeights,
    active: &[usize],
    triangle: &QrFactor,
) -> f64 {
    let width = active.len();
    let (mut sum, mut rows, mut poses) = (0.0, 0_usize, 0_usize);
    let mut now = usize::MAX;
    let mut gradient = vec![0.0; width];
    let close = |gradient: &mut Vec<f64>| {
        let projected = triangle.forward(std::mem::replace(gradient, vec![0.0; width]));
        dot(&projected, &projected)
    };
    linearisation.rows(campaign, weighing, active, |reading, row, right| {
        if reading.pose != now {
            sum += close(&mut gradient);
            (now, poses) = (reading.pose, poses + 1);
        }
        gradient.iter_mut().zip(row).for_each(|(g, j)| *g += j * right);
        rows += 1;
    });
    sum += close(&mut gradient);
    if width == 0 || rows <= width || poses < 3 {
        return 1.0;
    }
    // Residuals of a fit are smaller than the errors; with few rows per parameter the ratio is not significant.
    let freedom = rows as f64 / (rows - width) as f64;
    let effect = freedom * sum / width as f64;
    let tolerance = 3.0 * (2.0 / width as f64).sqrt() + 3.0 * width as f64 / rows as f64;
    if effect > 1.0 + tolerance { effect } else { 1.0 }
}
