//! Autocorrelated noise: one autoregressive model AR(p) per instrument, and the whitening of rows before they are summed.
//!
//! `w_t = (r_t − Σ φ_k r_{t−k}) / s`, s the standard deviation of the innovation (Box and Jenkins, Time Series Analysis, chapter 3). Rows
//! without p predecessors (after a gap, at the start of a segment) are not whitened.
//!
//! Residuals and all columns pass the same filter, so the whitened noise has unit variance if the noise model is right.
//! How the model is estimated: [`ArModel::estimate`].

use crate::campaign::{Campaign, Pose, Reading, ToolPoint};
use crate::simd::subtract_scaled;
use std::collections::BTreeMap;

/// Largest order that is tried.
const ORDER_MAX: usize = 8;
/// A model whose coefficients sum to no more than this is rejected.
const SWINGS: f64 = 0.05;
/// Bound on the reflection coefficients: it keeps the poles inside the unit circle, so that a drift is not taken for noise.
const REFLECTION_MAX: f64 = 0.98;

/// Autoregressive noise model of one instrument; default: white.
#[derive(Clone, Debug, PartialEq)]
pub struct ArModel {
    /// Coefficients `φ_1 …`; empty: white.
    coefficients: Vec<f64>,
    /// Standard deviation of the innovation, relative to that of the noise.
    innovation_sigma: f64,
}

impl Default for ArModel {
    fn default() -> Self {
        Self { coefficients: Vec::new(), innovation_sigma: 1.0 }
    }
}

impl ArModel {
    /// The model estimated from runs of consecutive residuals.
    #[must_use]
    pub fn estimate(runs: &[Vec<f64>]) -> Self {
        let (coefficients, innovation_sigma) = burg(runs);
        // A flexible model that overfits leaves residuals that alternate in sign; no instrument's noise does.
        if coefficients.iter().sum::<f64>() <= SWINGS {
            Self::default()
        } else {
            Self { coefficients, innovation_sigma }
        }
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

/// Burg's recursion over separate runs; the order minimises the Bayesian information criterion.
fn burg(runs: &[Vec<f64>]) -> (Vec<f64>, f64) {
    let runs: Vec<&Vec<f64>> = runs.iter().filter(|run| run.len() > 2 * ORDER_MAX).collect();
    let count: usize = runs.iter().map(|run| run.len()).sum();
    if count < 20 * ORDER_MAX {
        return (Vec::new(), 1.0);
    }
    let mut forward: Vec<Vec<f64>> = runs.iter().map(|run| (*run).clone()).collect();
    let mut backward = forward.clone();
    let mut law: Vec<f64> = Vec::new();
    let mut left = 1.0;
    let penalty = (count as f64).ln() / count as f64;
    let mut best = (0.0, Vec::new(), 1.0);
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
        let before = law.clone();
        law.iter_mut().zip(before.iter().rev()).for_each(|(a, back)| *a -= reflection * back);
        law.push(reflection);
        left *= 1.0 - reflection * reflection;
        let worth = -left.ln() - order as f64 * penalty;
        if worth > best.0 {
            best = (worth, law.clone(), left.sqrt());
        }
    }
    (best.1, best.2)
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

/// The last rows of one series, newest first, and the pose of the newest.
#[derive(Default)]
struct SeriesHistory {
    pose: usize,
    rows: Vec<Vec<f64>>,
    /// Buffer of a dropped row, reused for the next.
    spare: Vec<f64>,
}

/// Whitening filter for rows that arrive in order.
pub(crate) struct WhiteningFilter<'a> {
    campaign: &'a Campaign,
    past: BTreeMap<(usize, usize, usize), SeriesHistory>,
}

impl<'a> WhiteningFilter<'a> {
    pub(crate) fn new(campaign: &'a Campaign) -> Self {
        Self { campaign, past: BTreeMap::new() }
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
        let ArModel { coefficients, innovation_sigma } =
            &self.campaign.instruments[instrument].noise_model;
        if coefficients.is_empty() {
            return;
        }
        let past = self.past.entry((instrument, stream, part)).or_default();
        if !past.rows.is_empty() && !is_next_row(self.campaign, past.pose, pose) {
            past.rows.clear();
        }
        past.pose = pose;
        let mut raw = std::mem::take(&mut past.spare);
        raw.clear();
        raw.extend_from_slice(row);
        if past.rows.len() >= coefficients.len() {
            for (share, before) in coefficients.iter().zip(&past.rows) {
                subtract_scaled(row, *share, before);
            }
            row.iter_mut().for_each(|x| *x /= innovation_sigma);
            past.spare = past.rows.pop().unwrap_or_default();
        }
        past.rows.insert(0, raw);
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
        let colour = ArModel { coefficients: vec![0.8], innovation_sigma: 0.6 };
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
        campaign.instruments[0].noise_model =
            ArModel { coefficients: vec![0.7], innovation_sigma: 0.5 };
        let mut filter = WhiteningFilter::new(&campaign);
        for (k, value) in series.iter().enumerate().filter(|(k, _)| !(20..25).contains(k)) {
            let mut row = [*value];
            filter.pass(k, 0, 0, 0, &mut row);
            let starts = k == 0 || k == 25;
            let wanted = if starts { *value } else { (value - 0.7 * series[k - 1]) / 0.5 };
            assert!((row[0] - wanted).abs() < 1e-12, "{k}");
        }
    }
}
