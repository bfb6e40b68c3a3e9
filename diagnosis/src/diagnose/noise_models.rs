//! The AR noise model of each instrument, estimated from the residual of a flexible regression on the poses, so that a missing effect is not mistaken
//! for noise.
//!
//! Each measured scalar is first fitted by smooth functions of positions, directions, speeds, loads, temperature and time; the autoregression is
//! estimated from the residual. Slow drifts, deflection and backlash are therefore not attributed to noise, nor are residuals far above a stated
//! noise. Inputs are residuals in units of the stated noise; the result is one AR model per instrument.

use super::additive_regression::{self, CovariateChoice};
use super::covariates::Covariate;
use crate::autocorrelation::{ArModel, is_next_row, series_index};
use crate::campaign::{Campaign, Instrument};
use crate::fit_result::Fit;
use crate::least_squares::{FitState, ReadingWeights, VisitScope, visit_readings};
use crate::simd::dot;
use std::collections::BTreeMap;

/// Degree of the polynomials of a covariate.
const DEGREE: usize = 4;
/// Degree of the polynomials of time: slow drifts.
const TIME_DEGREE: usize = 10;
/// Least number of values per coefficient of the regression.
const VALUES_PER_COEFFICIENT: usize = 6;
/// If the RMS residual of the regression exceeds a stated noise by this factor, effects are missing and the noise is assumed to be white.
const MISSING_EFFECT_RATIO: f64 = 3.0;
/// Residuals are clipped to this, in standard deviations of the noise.
const CLIPPING_SIGMAS: f64 = 4.0;

/// The residuals of one measured scalar, in the order of poses.
#[derive(Default)]
struct ScalarResiduals {
    instrument: usize,
    poses: Vec<usize>,
    values: Vec<f64>,
}

/// AR noise models of all instruments, from the poses `used`.
pub(super) fn noise_models(
    campaign: &Campaign,
    fit: &Fit,
    used: &[bool],
    (words, taken): (&[Covariate], CovariateChoice),
) -> Vec<ArModel> {
    let mut pieces: Vec<Vec<Vec<f64>>> = vec![Vec::new(); campaign.instruments.len()];
    for run in scalar_residuals(campaign, fit, used).values() {
        let left = detrended(run, words, taken);
        pieces[run.instrument].extend(contiguous_sections(campaign, run, &left));
    }
    let inputs = campaign.instruments.iter().zip(&fit.factors).zip(&pieces);
    let colour = |((instrument, factor), pieces): ((&Instrument, &f64), &Vec<Vec<f64>>)| {
        let is_loud = instrument.noise_is_known && factor * rms(pieces) > MISSING_EFFECT_RATIO;
        if is_loud { ArModel::default() } else { ArModel::estimate(pieces) }
    };
    inputs.map(colour).collect()
}

/// Root mean square of the values of all pieces.
fn rms(pieces: &[Vec<f64>]) -> f64 {
    let count = pieces.iter().map(Vec::len).sum::<usize>().max(1);
    (pieces.iter().flatten().map(|x| x * x).sum::<f64>() / count as f64).sqrt()
}

/// Residuals of the fit in units of the noise, by instrument, channel and coordinate.
fn scalar_residuals(
    campaign: &Campaign,
    fit: &Fit,
    used: &[bool],
) -> BTreeMap<(usize, usize, usize), ScalarResiduals> {
    let state =
        FitState { surroundings: fit.surroundings.clone(), hypothesis: fit.hypothesis.clone() };
    let weighing = ReadingWeights {
        used: used.to_vec(),
        weights: fit.weights.clone(),
        noise_factors: fit.factors.clone(),
    };
    let mut runs: BTreeMap<(usize, usize, usize), ScalarResiduals> = BTreeMap::new();
    let scope = VisitScope { used: Some(used), derivatives: false };
    let streams: Vec<usize> = campaign
        .poses
        .iter()
        .flat_map(|pose| pose.seen.iter().map(|observation| series_index(&observation.reading)))
        .collect();
    visit_readings(campaign, &state, scope, |reading| {
        let scale = weighing.scale(reading);
        for part in 0..reading.rows.count {
            let run = runs.entry((reading.instrument, streams[reading.reading], part)).or_default();
            run.instrument = reading.instrument;
            run.poses.push(reading.pose);
            run.values.push(scale * reading.rows.residual[part]);
        }
    });
    runs
}

/// Residual of the regression of a run on all covariates.
fn detrended(run: &ScalarResiduals, covariates: &[Covariate], taken: CovariateChoice) -> Vec<f64> {
    let count = run.values.len();
    let mut rows: Vec<Vec<f64>> = vec![vec![1.0]; count];
    let mut groups = Vec::new();
    let mut add = |degree: usize, terms: &dyn Fn(usize) -> Vec<f64>| {
        let first = rows.first().map_or(0, Vec::len);
        if (first + degree) * VALUES_PER_COEFFICIENT <= count {
            groups.push(first..first + degree);
            rows.iter_mut().zip(&run.poses).for_each(|(row, pose)| row.extend(terms(*pose)));
        }
    };
    let degree = |covariate: &Covariate| if covariate.name == "t_s" { TIME_DEGREE } else { DEGREE };
    let mut ordered: Vec<&Covariate> = covariates.iter().collect();
    // If the values are too few for all covariates, temperature and time come first: drifts resemble autocorrelated noise most.
    if covariates.iter().map(degree).sum::<usize>() * VALUES_PER_COEFFICIENT >= count {
        ordered.sort_by_key(|covariate| covariate.joint.is_some());
    }
    for covariate in ordered {
        let degree = degree(covariate);
        add(degree, &|pose| covariate.chebyshev(pose, degree).collect());
    }
    // Backlash and friction vary with the position of the joint.
    for direction in covariates.iter().filter(|covariate| covariate.name.starts_with("direction")) {
        let is_place = |covariate: &&Covariate| {
            covariate.joint == direction.joint && covariate.name.starts_with('q')
        };
        if let Some(place) = covariates.iter().find(is_place) {
            let sign = |pose: usize| direction.values[pose];
            let terms = |pose| place.chebyshev(pose, DEGREE).map(|t| t * sign(pose)).collect();
            add(DEGREE, &terms);
        }
    }
    let law = additive_regression::coefficients(&rows, &run.values, &groups, taken);
    let left = rows.iter().zip(&run.values).map(|(row, value)| value - dot(row, &law));
    left.map(|x| x.clamp(-CLIPPING_SIGMAS, CLIPPING_SIGMAS)).collect()
}

/// The run in sections within which each pose follows the one before it in time.
fn contiguous_sections(campaign: &Campaign, run: &ScalarResiduals, left: &[f64]) -> Vec<Vec<f64>> {
    let mut pieces: Vec<Vec<f64>> = Vec::new();
    for (k, value) in left.iter().enumerate() {
        let is_contiguous = k > 0 && is_next_row(campaign, run.poses[k - 1], run.poses[k]);
        match pieces.last_mut().filter(|_| is_contiguous) {
            Some(piece) => piece.push(*value),
            None => pieces.push(vec![*value]),
        }
    }
    pieces
}
