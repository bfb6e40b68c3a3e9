//! Validation and test: removes effects that the validation set does not support; computes errors on the test set.
//!
//! Frames and targets are estimated on training rows. Gross errors, by the final model, are excluded from the
//! errors of all models that are compared.

use super::selection::{
    EffectSelection, SelectedEffect, hypothesis_without, is_needed, shift_indices_after,
};
use crate::autocorrelation::{WhiteningFilter, series_index};
use crate::campaign::Campaign;
use crate::chord::RefitsWithout;
use crate::effect_size::EffectSize;
use crate::engine::statistics::median;
use crate::fit::refit_with_fixed_weights;
use crate::fit_result::{Fit, Residual};
use crate::hold_out::HoldOutSplit;
use crate::hypothesis::Hypothesis;
use crate::least_squares::{FitState, VisitScope, visit_readings};
use crate::outlier_runs::{self, ReadingPlace};
use crate::progress::StageProgress;
use physics::{AnyEffect, Model};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Least gain in log-likelihood on the validation set for which an effect is kept. An absent effect loses there about as much as it gained on the
/// training set.
const VALIDATION_GAIN_MIN: f64 = 1.0;
/// Least sum of an effect's margin on the training set (gain less penalty) and its gain on the validation set, in log-likelihood.
const TOTAL_MARGIN_MIN: f64 = 7.0;
/// A gain on the validation set below this, without sign and in log-likelihood, means that the set cannot show the effect: no reversal of that joint,
/// no load on it. The effect is then kept if its margin on the training set exceeds [`TRAINING_MARGIN_ALONE`].
const NO_INFORMATION_GAIN: f64 = 0.5;
/// Margin on the training set, in log-likelihood, from which an effect needs no support by the validation set.
const TRAINING_MARGIN_ALONE: f64 = 50.0;
/// Number of effects, those with the smallest margins, that are validated again after one was removed.
const REVALIDATED_EFFECTS: usize = 6;
/// Number of poses of a path before each boundary between sets whose measurements are removed.
const BOUNDARY_POSES: usize = 5;
/// When measurements on the test set are gross errors, and how much a measurement counts.
struct GrossErrorSettings {
    /// A gross error deviates by more than this multiple of the median deviation; above 1. Default 8: 5.4 standard deviations of a normal distribution.
    ratio_min: f64,
    /// Larger shares of the measurements are not gross errors but errors of the model; 0 to 1. Default 0.2, as for the share of outliers at which findings
    /// are claimed.
    share_max: f64,
}

const GROSS_ERRORS: GrossErrorSettings =
    GrossErrorSettings { ratio_min: 8.0, share_max: super::OUTLIER_SHARE_MAX };

/// Largest whitened residual that counts in a likelihood on rows outside the fit, in standard deviations; above 3. Default 5.4: eight medians of a normal
/// distribution, as for gross errors.
pub(super) const RESIDUAL_SIGMAS_MAX: f64 = 5.4;

/// RMS errors of scalar values on the test set.
#[derive(Clone, Debug, PartialEq)]
pub struct TestErrors {
    /// What the test set consists of, for users.
    pub says: String,
    /// Error of the model as given, with frames and targets estimated: m (rad if only joint positions were measured).
    pub before: f64,
    /// Error with all findings and candidates.
    pub after: f64,
    /// RMS difference between the predictions of the two models there.
    pub difference: f64,
    /// Weighted RMS residual of the training rows, corrected for the degrees of freedom: the noise level.
    pub noise: f64,
    /// Whether the errors are lengths (m) or angles (rad).
    pub is_length: bool,
    /// How much larger they are than the residuals of the training rows, if by more than chance (docs/diagnosis.md).
    pub excess: Option<TestExcess>,
}

/// Errors on the test set that a fit to the training rows does not explain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestExcess {
    /// RMS of the whitened errors on the test set over that of the training rows; no unit.
    pub ratio: f64,
    /// Normal deviate of the ratio, for independent clusters of normally distributed errors.
    pub deviate: f64,
}

/// When errors on the test set count as larger than the residuals of the training rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct ExcessSettings {
    /// Least ratio of the RMS values; no unit, above 1. Default 1.5, chosen: noise that differs between parts of the workspace causes smaller ratios.
    pub(super) ratio_least: f64,
    /// Least normal deviate; above 0. Default 4: exceeded with a probability of 3e-5 by normally distributed errors.
    pub(super) deviate_least: f64,
}

impl Default for ExcessSettings {
    fn default() -> Self {
        Self { ratio_least: 1.5, deviate_least: 4.0 }
    }
}

impl TestExcess {
    /// Compares the mean squares of `test` and `training`, each with its degrees of freedom, by the F distribution (normal approximation of
    /// Paulson 1942).
    fn of_mean_squares(test: [f64; 2], training: [f64; 2]) -> Self {
        let f = test[0] / training[0].max(f64::MIN_POSITIVE);
        let [a, b] = [test[1], training[1]].map(|freedom| 2.0 / (9.0 * freedom.max(1.0)));
        let root = f.cbrt();
        let deviate = ((1.0 - b) * root - (1.0 - a)) / (b * root * root + a).sqrt();
        Self { ratio: f.sqrt(), deviate }
    }

    /// Whether it is significant.
    fn is_significant(self, settings: &ExcessSettings) -> bool {
        self.ratio >= settings.ratio_least && self.deviate >= settings.deviate_least
    }
}

/// Removes the measurements of a path just before each boundary between sets, so that autocorrelated noise does not correlate the sets.
pub(super) fn remove_rows_at_boundaries(campaign: &mut Campaign, splits: [&HoldOutSplit; 2]) {
    let is_path = |k: usize| {
        let source = campaign.recordings.get(campaign.poses[k].recording);
        source.is_none_or(|source| source.is_path)
    };
    let moving = |k: usize| is_path(k) && campaign.poses[k].arrival == crate::Arrival::FromPrevious;
    let count = campaign.poses.len();
    let turns = |k: usize| splits.iter().any(|s| s.training[k] != s.training[k - 1]);
    let borders = (1..count).filter(|k| turns(*k) && moving(*k));
    let at_boundaries: Vec<usize> =
        borders.flat_map(|k| k.saturating_sub(BOUNDARY_POSES)..k).collect();
    at_boundaries.into_iter().for_each(|k| campaign.poses[k].seen.clear());
}

/// Margin of an effect after validation, in log-likelihood; above zero: supported. `margin`: gain less penalty on the training set; `gain`: on the
/// validation set.
pub(super) fn validation_margin(margin: f64, gain: f64) -> f64 {
    if gain.abs() < NO_INFORMATION_GAIN && margin > TRAINING_MARGIN_ALONE {
        return margin - TRAINING_MARGIN_ALONE;
    }
    (gain - VALIDATION_GAIN_MIN).min(margin + gain - TOTAL_MARGIN_MIN)
}

/// Removes the effects that the validation set does not support; it never adds one.
pub(super) fn drop_unsupported(
    campaign: &Campaign,
    model: &Model,
    (split, kept): (&HoldOutSplit, &[bool]),
    mut selection: EffectSelection,
    progress: StageProgress<'_>,
) -> EffectSelection {
    // The design effect of the full selection is kept: without an effect, measurements of one pose would appear more correlated.
    let together = selection.fit.design_effect;
    let mut margins = vec![f64::NEG_INFINITY; selection.selected.len()];
    while !selection.selected.is_empty() && kept.contains(&true) {
        let held = FitEvaluator::new(campaign, (split, kept), &selection.fit);
        let (last, factors) = (&selection.fit, selection.fit.factors.as_slice());
        let left = held.whitened_sum(&last.state(), factors);
        let refits = RefitsWithout::of(campaign, last, &split.training);
        let supported_margin = |one: &SelectedEffect| {
            if is_needed(one, last) {
                return f64::INFINITY;
            }
            let mut without = hypothesis_without(last, model, &[one]);
            if one.previous_priors.is_some() {
                // If the parameters stayed free within their stated uncertainty, they would be fitted to the corrected values and the gain would
                // vanish.
                let same = |effect: &AnyEffect| {
                    let candidate = &one.candidate;
                    let kind = candidate.probes.first().map(|probe| probe.effect.spec().kind);
                    Some(effect.spec().kind) == kind && effect.joint() == candidate.joint
                };
                without.fix_at_stated_means(same);
            }
            let without = refits.state_without(&without, &[one.effect]);
            let gain = 0.5 * (held.whitened_sum(&without, factors) - left) / together;
            validation_margin(one.margin, gain)
        };
        // Effects with large margins are supported whatever was removed; only the weakest are validated again.
        let mut order: Vec<usize> = (0..margins.len()).collect();
        order.sort_by(|a, b| margins[*a].total_cmp(&margins[*b]));
        let first = margins.iter().filter(|margin| **margin == f64::NEG_INFINITY).count();
        order.truncate(first.max(REVALIDATED_EFFECTS));
        let steps = progress.steps(order.len());
        let computed = order.par_iter().map(|k| {
            let margin = supported_margin(&selection.selected[*k]);
            steps.step();
            margin
        });
        let computed: Vec<f64> = computed.collect();
        order.into_iter().zip(computed).for_each(|(k, margin)| margins[k] = margin);
        let worst = margins.iter().copied().enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((k, _)) = worst.filter(|(_, margin)| *margin < 0.0) else { break };
        margins.remove(k);
        // An effect that the removed one needed is validated now.
        let needed = margins.iter_mut().filter(|margin| **margin == f64::INFINITY);
        needed.for_each(|margin| *margin = f64::NEG_INFINITY);
        let hypothesis = hypothesis_without(&selection.fit, model, &[&selection.selected[k]]);
        let removed = selection.selected.remove(k);
        shift_indices_after(&mut selection.selected, &removed);
        selection.fit = held.compared(&hypothesis, &selection.fit);
        progress.selected(selection.selected.len());
    }
    selection
}

/// Evaluates fits on poses that took no part in them.
pub(super) struct FitEvaluator<'a> {
    pub(super) campaign: &'a Campaign,
    pub(super) split: &'a HoldOutSplit,
    /// Whether each pose is evaluated.
    is_evaluated: Vec<bool>,
    /// Whether each measurement counts: of an evaluated pose, of the kind `is_length`, and no gross error.
    is_counted: Vec<bool>,
    pub(super) is_length: bool,
}

impl<'a> FitEvaluator<'a> {
    /// `split`: training poses; `is_evaluated`: poses to evaluate; `last`: the fit of the final model, which determines the gross errors: measurements that it
    /// misses by far, unless they are in [runs](crate::outlier_runs) or many, which are errors of the model.
    pub(super) fn new(
        campaign: &'a Campaign,
        (split, is_evaluated): (&'a HoldOutSplit, &[bool]),
        last: &Fit,
    ) -> Self {
        let residuals = last.residuals(campaign);
        let is_length = residuals.iter().any(|residual| residual.is_length);
        let lengths =
            residuals.iter().filter(|o| o.is_length == is_length).map(|o| o.residual.length());
        let distance_max = GROSS_ERRORS.ratio_min * median(lengths);
        let counts = |o: &Residual| is_evaluated[o.pose] && o.is_length == is_length;
        let is_far = |o: &Residual| o.is_length == is_length && o.residual.length() > distance_max;
        let is_far: Vec<bool> = residuals.iter().map(is_far).collect();
        let observations = campaign.poses.iter().enumerate();
        let places: Vec<ReadingPlace> = observations
            .flat_map(|(pose, one)| one.seen.iter().map(move |seen| (pose, seen)))
            .map(|(pose, seen)| ReadingPlace {
                pose,
                instrument: seen.instrument,
                stream: series_index(&seen.reading),
            })
            .collect();
        let in_runs = outlier_runs::in_runs(campaign, &places, &is_far);
        let is_single = is_far.iter().zip(in_runs).map(|(is_far, in_run)| *is_far && !in_run);
        let is_gross: Vec<bool> =
            residuals.iter().zip(is_single).map(|(o, is_single)| counts(o) && is_single).collect();
        let gross = is_gross.iter().filter(|is_gross| **is_gross).count();
        let all = residuals.iter().filter(|o| counts(o)).count();
        let are_few = gross as f64 <= GROSS_ERRORS.share_max * all as f64;
        let is_counted = residuals.iter().zip(is_gross);
        let is_counted =
            is_counted.map(|(o, is_gross)| counts(o) && !(is_gross && are_few)).collect();
        Self { campaign, split, is_evaluated: is_evaluated.to_vec(), is_counted, is_length }
    }

    /// Whether each pose is evaluated.
    pub(super) fn evaluated(&self) -> &[bool] {
        &self.is_evaluated
    }

    /// Whether a measurement counts.
    pub(super) fn counts(&self, reading: usize) -> bool {
        self.is_counted[reading]
    }

    /// Number of measurements that are gross errors, and number of all that could count.
    pub(super) fn gross_errors(&self, last: &Fit) -> (usize, usize) {
        let residuals = last.residuals(self.campaign);
        let measured =
            residuals.iter().filter(|o| self.is_evaluated[o.pose] && o.is_length == self.is_length);
        let all = measured.clone().count();
        (measured.filter(|o| !self.is_counted[o.reading]).count(), all)
    }

    /// RMS error of scalar values, m or rad.
    pub(super) fn rms(&self, fit: &Fit) -> f64 {
        self.rms_of(&fit.residuals(self.campaign))
    }

    /// The same of residuals of all measurements.
    pub(super) fn rms_of(&self, residuals: &[Residual]) -> f64 {
        let (sum, count) = self.sum(residuals);
        (sum / count.max(1) as f64).sqrt()
    }

    /// Difference of the predictions of two fits for the measurements that count.
    pub(super) fn size_between(&self, one: &Fit, other: &Fit) -> EffectSize {
        let numbers = self.campaign.poses.iter().flat_map(|pose| &pose.seen);
        let numbers: Vec<usize> = numbers.map(|observation| observation.reading.count()).collect();
        let (one, other) = (one.residuals(self.campaign), other.residuals(self.campaign));
        let counted = one.iter().zip(&other).filter(|(one, _)| self.is_counted[one.reading]);
        EffectSize::of(counted.flat_map(|(one, other)| {
            let values = (one.residual - other.residual).to_array();
            values.into_iter().take(numbers[one.reading])
        }))
    }

    /// Sum of squared errors of scalar values, m² or rad², and their number.
    fn sum(&self, residuals: &[Residual]) -> (f64, usize) {
        let (mut sum, mut count) = (0.0, 0_usize);
        let numbers = self.campaign.poses.iter().flat_map(|pose| &pose.seen);
        let numbers: Vec<usize> = numbers.map(|observation| observation.reading.count()).collect();
        for residual in residuals.iter().filter(|residual| self.is_counted[residual.reading]) {
            sum += residual.residual.length_squared();
            count += numbers[residual.reading];
        }
        (sum, count)
    }

    /// Mean squared error of scalar values, m² or rad², from residuals of all measurements. For measured joint positions the mean of each encoder is
    /// subtracted first, since the zero of an encoder is arbitrary.
    pub(super) fn energy(&self, residuals: &[Residual]) -> f64 {
        if self.is_length {
            return self.rms_of(residuals).powi(2);
        }
        let readings: Vec<_> = self.campaign.poses.iter().flat_map(|pose| &pose.seen).collect();
        let mut encoders: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
        for residual in residuals.iter().filter(|residual| self.is_counted[residual.reading]) {
            let moments =
                encoders.entry(series_index(&readings[residual.reading].reading)).or_default();
            let more = [1.0, residual.residual.x, residual.residual.x * residual.residual.x];
            moments.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        }
        let varies = |[count, sum, square]: &[f64; 3]| square - sum * sum / count;
        let count: f64 = encoders.values().map(|moments| moments[0]).sum();
        encoders.values().map(varies).sum::<f64>() / count.max(1.0)
    }

    /// Sum of squares of the whitened residuals: in units of the noise, autocorrelation removed, and each limited to [`RESIDUAL_SIGMAS_MAX`]: a model loses
    /// where it fails, but no row decides alone.
    fn whitened_sum(&self, state: &FitState, noise_factors: &[f64]) -> f64 {
        self.whitened_sum_and_count(state, noise_factors).0
    }

    /// The same with the number of values.
    fn whitened_sum_and_count(&self, state: &FitState, noise_factors: &[f64]) -> (f64, f64) {
        let (mut sum, mut count) = (0.0, 0.0);
        let mut filter = WhiteningFilter::new(self.campaign);
        let scope = VisitScope { used: Some(&self.is_evaluated), derivatives: false };
        visit_readings(self.campaign, state, scope, |reading| {
            let weight = if self.is_counted[reading.reading] { 1.0 } else { 0.0 };
            for part in 0..reading.rows.count {
                let scale = weight / noise_factors[reading.instrument];
                let mut left = [scale * reading.rows.residual[part]];
                filter.pass(reading.pose, reading.instrument, reading.stream, part, &mut left);
                sum += weight * left[0].powi(2).min(RESIDUAL_SIGMAS_MAX.powi(2));
                count += weight;
            }
        });
        (sum, count)
    }

    /// How much larger the errors on these poses are than the residuals of the training rows; `None` without evaluated or training rows, or if not
    /// significantly. Outliers of `last` do not count on either side.
    ///
    /// The design effect of the fit divides the degrees of freedom, since the values of a pose may be correlated.
    fn excess(&self, last: &Fit, settings: &ExcessSettings) -> Option<TestExcess> {
        let training = FitEvaluator::new(self.campaign, (self.split, &self.split.training), last);
        let state = last.state();
        let (of_test, tested) = self.whitened_sum_and_count(&state, &last.factors);
        let (of_training, trained) = training.whitened_sum_and_count(&state, &last.factors);
        let parameters = last.columns().len() as f64;
        let freedom = trained - parameters;
        if tested < 1.0 || freedom < 1.0 {
            return None;
        }
        // The prediction for a test row has, on average, the variance of `parameters` of `trained` values in addition.
        let predicted = 1.0 + parameters / trained;
        let test = [of_test / (tested * predicted), tested / last.design_effect];
        let training = [of_training / freedom, freedom / last.design_effect];
        let excess = TestExcess::of_mean_squares(test, training);
        excess.is_significant(settings).then_some(excess)
    }

    /// Weighted RMS residual of the training rows, corrected for the number of fitted parameters.
    fn rms_in_training(&self, fit: &Fit) -> f64 {
        let numbers = self.campaign.poses.iter().flat_map(|pose| &pose.seen);
        let numbers: Vec<usize> = numbers.map(|observation| observation.reading.count()).collect();
        let (mut sum, mut count) = (0.0, 0.0);
        for residual in fit.residuals(self.campaign) {
            if self.split.training[residual.pose] && residual.is_length == self.is_length {
                let weight = fit.weights[residual.reading];
                sum += weight * residual.residual.length_squared();
                count += weight * numbers[residual.reading] as f64;
            }
        }
        let freedom = (count - fit.columns().len() as f64).max(1.0);
        (sum / freedom).sqrt()
    }

    /// The errors on the test set, with the model as given and with `last`.
    pub(super) fn test_errors(&self, given: &Fit, last: &Fit) -> TestErrors {
        let (before, after) = (self.rms(given), self.rms(last));
        let difference = self.size_between(given, last).rms;
        let (description, noise) = (self.split.description.clone(), self.rms_in_training(last));
        let excess = self.excess(last, &ExcessSettings::default());
        let is_length = self.is_length;
        TestErrors { says: description, before, after, difference, noise, is_length, excess }
    }

    /// The fit of `hypothesis` with the weights and noise of `last`, so that the sums of squares can be compared.
    pub(super) fn compared(&self, hypothesis: &Hypothesis, last: &Fit) -> Fit {
        refit_with_fixed_weights(self.campaign, hypothesis, last, &self.split.training)
    }
}

#[cfg(test)]
mod tests {
    use super::{ExcessSettings, TestExcess};
    use super::{FitEvaluator, HoldOutSplit};
    use crate::campaign::{Observation, Reading, ReadingNoise};
    use crate::campaign_simulation::simulate_readings;
    use crate::fit::{FitSettings, fit};
    use crate::hypothesis::Hypothesis;
    use crate::robust_weights::Influence;
    use crate::test_campaigns::{nominal_robot, unmeasured_campaign};
    use glam::DVec3;

    #[test]
    fn where_an_encoders_zero_was_put_makes_no_energy() {
        let (zero, swing) = (5e-4, 1e-4);
        let mut campaign = unmeasured_campaign(0, 120);
        for (k, pose) in campaign.poses.iter_mut().enumerate() {
            let errors = [zero, if k % 2 == 0 { swing } else { -swing }];
            let whitening = ReadingNoise::Equal(1e-5).whitening(DVec3::ZERO).expect("sound");
            let observations = errors.iter().enumerate().map(|(joint, error)| Observation {
                reading: Reading::JointPosition { joint, position: pose.inputs.q[joint] + error },
                whitening,
                instrument: 0,
            });
            pose.seen = observations.collect();
        }
        let used = vec![true; 120];
        let settings = FitSettings::full(&used, Influence::Equal);
        let found = fit(&campaign, &Hypothesis::fixed(nominal_robot()), &settings);
        let split = HoldOutSplit { description: String::new(), training: used.clone() };
        let held = FitEvaluator::new(&campaign, (&split, &used), &found);
        let energy = held.energy(&found.residuals(&campaign));
        assert!((energy - 0.5 * swing * swing).abs() < 1e-12, "{energy}");
        assert!(held.rms(&found) > 0.7 * zero, "the error as it is has it");
    }

    /// The excess on the test set of a campaign of the nominal robot, whose test poses have `scale` times the noise of the others.
    fn excess(scale: f64, seed: u64) -> Option<TestExcess> {
        let unmeasured = unmeasured_campaign(1, 220);
        let measured = |scale| {
            simulate_readings(&unmeasured, &nominal_robot(), &unmeasured.surroundings, scale, seed)
        };
        let (mut campaign, louder) = (measured(1.0), measured(scale));
        let split = HoldOutSplit::in_blocks(&campaign, seed);
        let held_out = split.held_out();
        for (k, pose) in louder.poses.into_iter().enumerate().filter(|(k, _)| held_out[*k]) {
            campaign.poses[k] = pose;
        }
        let settings = FitSettings::full(&split.training, Influence::Redescending);
        let found = fit(&campaign, &Hypothesis::fixed(nominal_robot()), &settings);
        let held = FitEvaluator::new(&campaign, (&split, &held_out), &found);
        held.excess(&found, &ExcessSettings::default())
    }

    #[test]
    fn errors_on_the_test_set_are_no_excess_unless_they_are_larger_than_scatter() {
        for seed in 0..20 {
            assert_eq!(excess(1.0, seed), None, "seed {seed}");
        }
        for seed in 0..5 {
            let ratio = excess(2.5, seed).map_or(0.0, |excess| excess.ratio);
            assert!((2.0..3.0).contains(&ratio), "seed {seed}: {ratio}");
        }
    }

    #[test]
    fn the_deviate_of_a_ratio_is_that_of_the_f_distribution() {
        // Upper quantiles of F by SciPy 1.17 (`scipy.stats.f.isf`): probability of a normal deviate of 4 is 3.167e-5.
        for (freedoms, f) in [([12.0, 60.0], 4.5946), ([40.0, 200.0], 2.4217)] {
            let excess = TestExcess::of_mean_squares([f, freedoms[0]], [1.0, freedoms[1]]);
            assert!((excess.deviate - 4.0).abs() < 0.03, "{freedoms:?}: {}", excess.deviate);
            assert!((excess.ratio - f.sqrt()).abs() < 1e-12);
        }
    }
}
