//! Whether a series is constant, has a step, or grows from some recording on; and since when.
//!
//! Method: three models of the mean are compared by Bayes factors: a constant, a constant with a step, and a constant that becomes a line (hinge). The one further
//! coefficient of a change costs `½ ln n` (Bayesian information criterion; Kass and Raftery, "Bayes Factors", JASA 90, 1995); its time is averaged over all
//! recordings alike (uniform prior; Barry and Hartigan, "A Bayesian Analysis for Change Point Problems", JASA 88, 1993), so that its probability is that of an
//! interval of recordings. Ambient temperature is a covariate of all three, where it was recorded.
//!
//! Not physical: one change for each series. A robot that grew worse and was repaired looks like a weaker growth or a step.

use crate::likelihood::{Fit, Reading, Row, TERMS, fit};
use crate::series::{Observation, Series};
use crate::settings::Settings;
use crate::time::months;

/// Largest number of candidate times of a change; of more recordings, evenly spaced ones are candidates.
const ONSETS: usize = 200;
/// Standard deviations of half an interval of 95 %.
const HALF_95: f64 = 1.96;
/// Share of recordings that must state a temperature.
const TEMPERATURES: f64 = 0.9;

/// How a series changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChangeKind {
    /// From one recording to the next.
    Step,
    /// Steadily, from some recording on.
    Growth,
}

/// A number with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Its mean.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// The most probable change of a series, if it has one.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Logarithm of the Bayes factor of a change against none.
    pub log_bayes: f64,
    /// Step or growth.
    pub kind: ChangeKind,
    /// Probability of that kind among the two.
    pub kind_probability: f64,
    /// The first recording that is changed, as an index of observations: median of its probability, and the ends of an interval of 95 %. (The most probable one lies at an
    /// end of the interval where a growth begins slowly.)
    pub first: [usize; 3],
    /// The number before the change.
    pub before: Estimate,
    /// The number at the last recording.
    pub now: Estimate,
    /// Step, or growth per month.
    pub change: Estimate,
    /// Scatter between recordings beyond the stated uncertainty.
    pub scatter: f64,
    /// Coefficient of the ambient temperature, per kelvin; none where it is no covariate.
    pub per_kelvin: Option<f64>,
}

/// A candidate change.
struct CandidateChange {
    kind: ChangeKind,
    first: usize,
    fit: Fit,
    /// Its last column at the last recording.
    reach: f64,
}

/// The change of a series; none where it has too few recordings for one, or all of one time.
#[must_use]
pub fn most_probable_change(series: &Series, settings: &Settings) -> Option<Change> {
    let observations = &series.observations;
    let count = observations.len();
    if series.found() < settings.least_found || count < 2 * settings.least_after {
        return None;
    }
    let first_us = observations.first()?.at_us;
    if observations.iter().all(|one| one.at_us == first_us) {
        // Their order is none of time.
        return None;
    }
    let kelvins = centred_temperatures(observations, settings);
    let constant = fit(
        &rows(observations, &kelvins, |_| 0.0),
        [true, false, kelvins.is_some()],
        settings.missed_share,
        None,
    );
    let tried: Vec<CandidateChange> = [ChangeKind::Growth, ChangeKind::Step]
        .into_iter()
        .flat_map(|kind| tried(observations, &kelvins, kind, settings, &constant))
        .collect();
    let penalty = 0.5 * (count as f64).ln();
    let evidence = |kind: ChangeKind| {
        let of: Vec<f64> = tried
            .iter()
            .filter(|one| one.kind == kind)
            .map(|one| one.fit.log_likelihood - constant.log_likelihood)
            .collect();
        log_mean(&of) - penalty
    };
    let (growth, step) = (evidence(ChangeKind::Growth), evidence(ChangeKind::Step));
    let (kind, of_kind, other) = if growth >= step {
        (ChangeKind::Growth, growth, step)
    } else {
        (ChangeKind::Step, step, growth)
    };
    let chosen: Vec<&CandidateChange> = tried.iter().filter(|one| one.kind == kind).collect();
    let summary = WeightedSummary::of(&chosen)?;
    Some(Change {
        log_bayes: log_mean(&[growth, step]),
        kind,
        kind_probability: 1.0 / (1.0 + (other - of_kind).exp()),
        first: summary.first,
        before: summary.estimate(|one| (one.fit.coefficients[0], one.fit.covariance[0][0])),
        now: summary.estimate(|one| {
            let columns = [1.0, one.reach, 0.0];
            (one.fit.mean(&columns), quadratic(&one.fit.covariance, &columns))
        }),
        change: summary.estimate(|one| (one.fit.coefficients[1], one.fit.covariance[1][1])),
        scatter: summary.best.fit.scatter,
        per_kelvin: kelvins.is_some().then_some(summary.best.fit.coefficients[2]),
    })
}

/// Temperatures minus their mean, where they are a covariate.
fn centred_temperatures(observations: &[Observation], settings: &Settings) -> Option<Vec<f64>> {
    let known: Vec<f64> = observations.iter().filter_map(|one| one.ambient_c).collect();
    let low = known.iter().copied().fold(f64::INFINITY, f64::min);
    let high = known.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let is_known = known.len() as f64 >= TEMPERATURES * observations.len() as f64;
    let is_wide = high - low >= settings.temperature_range_k;
    if !is_known || !is_wide {
        return None;
    }
    let mean = known.iter().sum::<f64>() / known.len() as f64;
    Some(
        observations
            .iter()
            .map(|one| one.ambient_c.map_or(0.0, |celsius| celsius - mean))
            .collect(),
    )
}

fn rows(
    observations: &[Observation],
    kelvins: &Option<Vec<f64>>,
    changed: impl Fn(usize) -> f64,
) -> Vec<Row> {
    let kelvin = |i: usize| kelvins.as_ref().and_then(|all| all.get(i)).copied().unwrap_or(0.0);
    let row = |(i, one): (usize, &Observation)| Row {
        reading: one.reading,
        columns: [1.0, changed(i), kelvin(i)],
    };
    observations.iter().enumerate().map(row).collect()
}

/// Fits every candidate time of this kind of change; each fit starts at the result of its neighbour.
fn tried(
    observations: &[Observation],
    kelvins: &Option<Vec<f64>>,
    kind: ChangeKind,
    settings: &Settings,
    constant: &Fit,
) -> Vec<CandidateChange> {
    let count = observations.len();
    let (from, to) = (1, count - settings.least_after);
    let stride = (to + 1 - from).div_ceil(ONSETS).max(1);
    let is_bounded = observations.iter().any(|one| matches!(one.reading, Reading::Below { .. }));
    let mut fits: Vec<CandidateChange> = Vec::new();
    for first in (from..=to).step_by(stride) {
        let changed = |i: usize| match kind {
            ChangeKind::Step => f64::from(u8::from(i >= first)),
            ChangeKind::Growth => {
                months(observations[first - 1].at_us, observations[i].at_us).max(0.0)
            }
        };
        let rows = rows(observations, kelvins, changed);
        let active = [true, true, kelvins.is_some()];
        let start = fits.last().map_or(constant, |one| &one.fit);
        let warm = fit(&rows, active, settings.missed_share, Some(start));
        // With bounds the likelihood may have two maxima: the other is searched from a new start.
        let cold = is_bounded.then(|| fit(&rows, active, settings.missed_share, None));
        let better = cold.filter(|cold| cold.log_likelihood > warm.log_likelihood).unwrap_or(warm);
        fits.push(CandidateChange { kind, first, fit: better, reach: changed(count - 1) });
    }
    fits
}

/// Logarithm of the mean of numbers given by their logarithms.
fn log_mean(logs: &[f64]) -> f64 {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !most.is_finite() {
        return most;
    }
    most + (logs.iter().map(|log| (log - most).exp()).sum::<f64>() / logs.len() as f64).ln()
}

fn quadratic(matrix: &[[f64; TERMS]; TERMS], by: &[f64; TERMS]) -> f64 {
    matrix
        .iter()
        .zip(by)
        .map(|(line, left)| {
            left * line.iter().zip(by).map(|(cell, right)| cell * right).sum::<f64>()
        })
        .sum()
}

/// All times of one kind, each with its probability.
struct WeightedSummary<'a> {
    tried: Vec<(&'a CandidateChange, f64)>,
    best: &'a CandidateChange,
    first: [usize; 3],
}

impl<'a> WeightedSummary<'a> {
    fn of(tried: &[&'a CandidateChange]) -> Option<Self> {
        let best = tried
            .iter()
            .copied()
            .max_by(|a, b| a.fit.log_likelihood.total_cmp(&b.fit.log_likelihood))?;
        let weight =
            |one: &CandidateChange| (one.fit.log_likelihood - best.fit.log_likelihood).exp();
        let whole: f64 = tried.iter().map(|one| weight(one)).sum();
        let weighted: Vec<(&CandidateChange, f64)> =
            tried.iter().map(|one| (*one, weight(one) / whole)).collect();
        let quantile = |share: f64| {
            let mut reached = 0.0;
            let beyond = weighted.iter().find(|(_, weight)| {
                reached += weight;
                reached >= share
            });
            beyond.map_or(best.first, |(one, _)| one.first)
        };
        Some(Self {
            first: [quantile(0.5), quantile(0.025), quantile(0.975)],
            tried: weighted,
            best,
        })
    }

    /// Mean and interval of a number over all times; the variance is that within and between them.
    fn estimate(&self, of: impl Fn(&CandidateChange) -> (f64, f64)) -> Estimate {
        let (mut mean, mut square) = (0.0, 0.0);
        for (one, weight) in &self.tried {
            let (value, variance) = of(one);
            mean += weight * value;
            square += weight * (variance + value * value);
        }
        let half = HALF_95 * (square - mean * mean).max(0.0).sqrt();
        Estimate { value: mean, low: mean - half, high: mean + half }
    }
}
