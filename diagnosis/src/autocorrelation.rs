//! Autocorrelated noise: one autoregressive model AR(p) per instrument, and the whitening of rows before they are summed.
//!
//! `w_t = (r_t − Σ φ_k r_{t−k}) / s`, s the standard deviation of the innovation (Box and Jenkins, Time Series Analysis, chapter 3). Where rows are
//! missing, or fewer than p precede (subsampled recordings, rows with a fault, the start of a recording), φ and s are those of the best linear
//! prediction from the last rows that exist, by the autocorrelation function of the model (chapter 5, there).
//!
//! Residuals and all columns pass the same filter, so the whitened noise has unit variance if the noise model is right.
//! How the model is estimated: [`ArModel::estimate`].

use crate::campaign::{Campaign, Pose, Reading, ToolPoint};
use crate::simd::subtract_scaled;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// Largest order that is tried.
const ORDER_MAX: usize = 8;
/// A model whose coefficients sum to no more than this is rejected.
const SWINGS: f64 = 0.05;
/// Number of lags, in rows, over which rows are correlated; above [`ORDER_MAX`]. Default 512: with the largest reflection coefficient the
/// correlation is then below 1e-4.
const LAGS: usize = 512;
/// Bound on the reflection coefficients: it keeps the poles inside the unit circle, so that a drift is not taken for noise.
const REFLECTION_MAX: f64 = 0.98;

/// Autoregressive noise model of one instrument; default: white.
#[derive(Clone, Debug, PartialEq)]
pub struct ArModel {
    /// Coefficients `φ_1 …`; empty: white.
    coefficients: Vec<f64>,
    /// Standard deviation of the innovation, relative to that of the noise.
    innovation_sigma: f64,
    /// Autocorrelation at lags of 0, 1 … rows; beyond, it is negligible or not needed.
    autocorrelation: Vec<f64>,
}

impl Default for ArModel {
    fn default() -> Self {
        Self::from_reflections(&[])
    }
}

impl ArModel {
    /// The model estimated from runs of consecutive residuals.
    #[must_use]
    pub fn estimate(runs: &[Vec<f64>]) -> Self {
        let model = Self::from_reflections(&burg(runs));
        // A flexible model that overfits leaves residuals that alternate in sign; no instrument's noise does.
        if model.coefficient_sum() <= SWINGS { Self::default() } else { model }
    }

    /// The model with these reflection coefficients (Levinson's recursion; Box and Jenkins, appendix A3.2).
    fn from_reflections(reflections: &[f64]) -> Self {
        let (mut coefficients, mut left, mut autocorrelation) = (Vec::new(), 1.0, vec![1.0]);
        for reflection in reflections {
            autocorrelation.push(predicted(&coefficients, &autocorrelation) + reflection * left);
            let before = coefficients.clone();
            coefficients
                .iter_mut()
                .zip(before.iter().rev())
                .for_each(|(a, back): (&mut f64, &f64)| *a -= reflection * back);
            coefficients.push(*reflection);
            left *= 1.0 - reflection * reflection;
        }
        while !coefficients.is_empty() && autocorrelation.len() < LAGS {
            autocorrelation.push(predicted(&coefficients, &autocorrelation));
        }
        Self { coefficients, innovation_sigma: left.sqrt(), autocorrelation }
    }

    /// The best linear prediction of a row from rows that precede it by `lags`, newest first: a coefficient for each, and the standard deviation of
    /// its error relative to that of the noise.
    fn predictor(&self, lags: &[usize]) -> (Vec<f64>, f64) {
        let correlation = |lag: usize| self.autocorrelation.get(lag).copied().unwrap_or_default();
        let count = lags.len();
        let between = DMatrix::from_fn(count, count, |i, k| correlation(lags[i].abs_diff(lags[k])));
        let with_row = DVector::from_fn(count, |i, _| correlation(lags[i]));
        let solved = between.cholesky().map(|factor| factor.solve(&with_row));
        let coefficients = solved.unwrap_or_else(|| DVector::zeros(count));
        let variance = 1.0 - coefficients.dot(&with_row);
        let sigma = variance.max(self.innovation_sigma * self.innovation_sigma).sqrt();
        (coefficients.iter().copied().collect(), sigma)
    }

    /// Whether the noise is white, so that no filter is needed.
    #[must_use]
    pub fn is_white(&self) -> bool {
        self.coefficients.is_empty()
    }

    /// Appends the innovations of a run, scaled to the standard deviation of the noise, to `all`; the first p values, which lack predecessors, are
    /// unchanged.
    pub(crate) fn append_whitened(&self, run: &[f64], all: &mut Vec<f64>) {
        let (order, first) = (self.coefficients.len(), all.len());
        all.extend_from_slice(run);
        let Some(behind) = all.get_mut(first + order..) else { return };
        for (i, a) in self.coefficients.iter().enumerate() {
            behind
                .iter_mut()
                .zip(&run[order - 1 - i..])
                .for_each(|(new, before)| *new -= a * before);
        }
        behind.iter_mut().for_each(|new| *new /= self.innovation_sigma);
    }

    /// Variance of a weighted sum of consecutive noise values of unit variance, with their autocorrelation: each innovation acts on all later values.
    pub(crate) fn variance_of(&self, weights: &[f64]) -> f64 {
        let mut shares = weights.to_vec();
        for row in (0..shares.len()).rev() {
            let later = self.coefficients.iter().zip(&shares[row + 1..]);
            let remembered: f64 = later.map(|(law, share)| law * share).sum();
            shares[row] += remembered;
        }
        self.innovation_sigma
            * self.innovation_sigma
            * shares.iter().map(|share| share * share).sum::<f64>()
    }

    /// Sum of the AR coefficients, below one; the closer to one, the more of a slow change is attributed to noise. For users.
    #[must_use]
    pub fn coefficient_sum(&self) -> f64 {
        self.coefficients.iter().sum()
    }
}

/// Prediction of the next value of a series, whose values are given oldest first.
fn predicted(coefficients: &[f64], series: &[f64]) -> f64 {
    coefficients.iter().zip(series.iter().rev()).map(|(a, x)| a * x).sum()
}

/// Reflection coefficients by Burg's recursion over separate runs; their number minimises the Bayesian information criterion.
fn burg(runs: &[Vec<f64>]) -> Vec<f64> {
    let runs: Vec<&Vec<f64>> = runs.iter().filter(|run| run.len() > 2 * ORDER_MAX).collect();
    let count: usize = runs.iter().map(|run| run.len()).sum();
    if count < 20 * ORDER_MAX {
        return Vec::new();
    }
    let mut forward: Vec<Vec<f64>> = runs.iter().map(|run| (*run).clone()).collect();
    let mut backward = forward.clone();
    let mut reflections: Vec<f64> = Vec::new();
    let mut left = 1.0;
    let penalty = (count as f64).ln() / count as f64;
    let mut best = (0.0, 0);
    for order in 1..=ORDER_MAX {
        let (mut product, mut energy) = (0.0, 0.0);
        for (f, b) in forward.iter().zip(&backward) {
            for (x, y) in f[order..].iter().zip(&b[order - 1..]) {
                product += x * y;
                energy += 0.5 * (x * x + y * y);
            }
        }
        let reflection = if energy > 0.0 { product / energy } else { 0.0 };
        let reflection = reflection.clamp(-REFLECTION_MAX, REFLECTION_MAX);
        for (f, b) in forward.iter_mut().zip(&mut backward) {
            for t in (order..f.len()).rev() {
                let (x, y) = (f[t], b[t - 1]);
                f[t] = x - reflection * y;
                b[t] = y - reflection * x;
            }
        }
        reflections.push(reflection);
        left *= 1.0 - reflection * reflection;
        let worth = -f64::ln(left) - order as f64 * penalty;
        if worth > best.0 {
            best = (worth, order);
        }
    }
    reflections.truncate(best.1);
    reflections
}

/// The series of consecutive measurements (TCP, each target, …) that a measurement belongs to.
pub(crate) fn series_index(reading: &Reading) -> usize {
    let series_of = |place: &ToolPoint| match place {
        ToolPoint::Tcp => 0,
        ToolPoint::Target(target) => target + 1,
    };
    match reading {
        Reading::Point { place, .. } => 4 * series_of(place),
        Reading::Orientation { .. } => 1,
        Reading::JointPosition { joint, .. } => 4 * joint + 2,
        Reading::Distance { place, .. }
        | Reading::Plane { place, .. }
        | Reading::Sphere { place, .. } => 4 * series_of(place) + 3,
    }
}

/// Whether one pose is the row directly after another in the same recording.
pub(crate) fn is_next_row(campaign: &Campaign, before: usize, now: usize) -> bool {
    let pose = |place: usize| -> &Pose { &campaign.poses[place] };
    pose(before).row + 1 == pose(now).row
        && pose(before).recording == pose(now).recording
        && pose(before).inputs.time_s <= pose(now).inputs.time_s
}

/// Whether one pose is a later row than another in the same recording.
pub(crate) fn is_later_row(campaign: &Campaign, before: usize, now: usize) -> bool {
    let pose = |place: usize| -> &Pose { &campaign.poses[place] };
    pose(before).row < pose(now).row
        && pose(before).recording == pose(now).recording
        && pose(before).inputs.time_s <= pose(now).inputs.time_s
}

/// The last rows of one series, each with its pose, newest first.
#[derive(Default)]
struct SeriesHistory {
    rows: Vec<(usize, Vec<f64>)>,
    /// Buffer of a dropped row, reused for the next.
    spare: Vec<f64>,
}

/// Whitening filter for rows that arrive in order.
pub(crate) struct WhiteningFilter<'a> {
    campaign: &'a Campaign,
    past: BTreeMap<(usize, usize, usize), SeriesHistory>,
    /// Predictors by instrument and lags, zeros at the end.
    predictors: BTreeMap<(usize, [usize; ORDER_MAX]), (Vec<f64>, f64)>,
}

impl<'a> WhiteningFilter<'a> {
    pub(crate) fn new(campaign: &'a Campaign) -> Self {
        Self { campaign, past: BTreeMap::new(), predictors: BTreeMap::new() }
    }

    /// Filters `row` (columns and right-hand side, in units of the noise) of component `part` of a measurement.
    pub(crate) fn pass(
        &mut self,
        pose: usize,
        instrument: usize,
        stream: usize,
        part: usize,
        row: &mut [f64],
    ) {
        let model = &self.campaign.instruments[instrument].noise_model;
        if model.is_white() {
            return;
        }
        let past = self.past.entry((instrument, stream, part)).or_default();
        let newest = past.rows.first().map(|(newest, _)| *newest);
        if newest.is_some_and(|newest| !is_later_row(self.campaign, newest, pose)) {
            past.rows.clear();
        }
        let mut raw = std::mem::take(&mut past.spare);
        raw.clear();
        raw.extend_from_slice(row);
        let mut lags = [0; ORDER_MAX];
        let mut count = 0;
        for (before, _) in &past.rows {
            let lag = self.campaign.poses[pose].row - self.campaign.poses[*before].row;
            if lag < LAGS {
                (lags[count], count) = (lag, count + 1);
            }
        }
        if count > 0 {
            let predictor = self.predictors.entry((instrument, lags));
            let (coefficients, sigma) =
                predictor.or_insert_with(|| model.predictor(&lags[..count]));
            for (coefficient, (_, before)) in coefficients.iter().zip(&past.rows) {
                subtract_scaled(row, *coefficient, before);
            }
            row.iter_mut().for_each(|x| *x /= *sigma);
        }
        if past.rows.len() >= model.coefficients.len() {
            past.spare = past.rows.pop().map(|(_, row)| row).unwrap_or_default();
        }
        past.rows.insert(0, (pose, raw));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::StandardNormal;

    fn run(phi: f64, count: usize, seed: u64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut last = 0.0;
        let fresh = (1.0_f64 - phi * phi).sqrt();
        (0..count)
            .map(|_| {
                last = phi * last + fresh * rng.sample::<f64, _>(StandardNormal);
                last
            })
            .collect()
    }

    #[test]
    fn a_first_order_law_is_found_and_white_noise_has_none() {
        let coloured = ArModel::estimate(&[run(0.8, 2000, 1), run(0.8, 500, 2)]);
        assert!((coloured.coefficients[0] - 0.8).abs() < 0.06, "{coloured:?}");
        assert!((coloured.innovation_sigma - 0.6).abs() < 0.03, "{coloured:?}");
        let white = ArModel::estimate(&[run(0.0, 2000, 3)]);
        assert!(white.is_white(), "{white:?}");
    }

    #[test]
    fn sums_of_noise_that_remembers_itself_vary_as_its_law_says() {
        let colour = ArModel::from_reflections(&[0.8]);
        let sums: Vec<f64> =
            (0..400).map(|seed| run(0.8, 300, seed)[100..200].iter().sum()).collect();
        let varies = sums.iter().map(|sum| sum * sum).sum::<f64>() / 400.0;
        let mut weights = vec![0.0; 100];
        weights.extend([1.0; 100]);
        let predicted = colour.variance_of(&weights);
        assert!((varies / predicted - 1.0).abs() < 0.2, "{varies} {predicted}");
        assert!((ArModel::default().variance_of(&weights) - 100.0).abs() < 1e-9);
    }

    #[test]
    fn the_filter_gives_back_what_was_new_and_starts_again_after_a_gap() {
        let mut campaign = crate::test_campaigns::unmeasured_campaign(0, 60);
        campaign.poses.iter_mut().enumerate().for_each(|(k, p)| p.inputs.time_s = k as f64);
        let series = run(0.7, 60, 4);
        campaign.instruments[0].noise_model = ArModel::from_reflections(&[0.7]);
        let mut filter = WhiteningFilter::new(&campaign);
        for (k, value) in series.iter().enumerate().filter(|(k, _)| !(20..25).contains(k)) {
            let mut row = [*value];
            filter.pass(k, 0, 0, 0, &mut row);
            // After a gap of n rows the correlation is 0.7^n.
            let law = |n: usize| 0.7_f64.powi(n as i32);
            let innovation =
                |n: usize| (value - law(n) * series[k - n]) / (1.0 - law(n).powi(2)).sqrt();
            let wanted = match k {
                0 => *value,
                25 => innovation(6),
                _ => innovation(1),
            };
            assert!((row[0] - wanted).abs() < 1e-12, "{k}");
        }
    }

    #[test]
    fn every_third_row_of_slow_noise_is_whitened() {
        let mut campaign = crate::test_campaigns::unmeasured_campaign(0, 3000);
        campaign.poses.iter_mut().enumerate().for_each(|(k, p)| p.inputs.time_s = k as f64);
        let series = run(0.95, 3000, 5);
        campaign.instruments[0].noise_model = ArModel::from_reflections(&[0.95]);
        let mut filter = WhiteningFilter::new(&campaign);
        let mut white = Vec::new();
        for (k, value) in series.iter().enumerate().step_by(3) {
            let mut row = [*value];
            filter.pass(k, 0, 0, 0, &mut row);
            white.push(row[0]);
        }
        let sum = |lag: usize| -> f64 { white.iter().zip(&white[lag..]).map(|(a, b)| a * b).sum() };
        assert!((sum(0) / 1000.0 - 1.0).abs() < 0.15, "{}", sum(0));
        assert!((sum(1) / sum(0)).abs() < 0.1, "{}", sum(1) / sum(0));
    }

    #[test]
    fn the_autocorrelation_is_that_of_the_model() {
        let model = ArModel::from_reflections(&[0.8, -0.3, 0.2]);
        let mut response = vec![0.0, 0.0, 1.0];
        while response.len() < 2000 {
            response.push(predicted(&model.coefficients, &response));
        }
        let sum =
            |lag: usize| -> f64 { response.iter().zip(&response[lag..]).map(|(a, b)| a * b).sum() };
        assert!((model.innovation_sigma.powi(2) - 1.0 / sum(0)).abs() < 1e-9);
        for lag in [1, 2, 3, 10, 100] {
            assert!((model.autocorrelation[lag] - sum(lag) / sum(0)).abs() < 1e-9, "{lag}");
        }
    }
}
