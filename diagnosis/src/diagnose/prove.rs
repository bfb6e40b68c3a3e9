//! Validation and test: removes effects that the validation set does not support; computes errors on the test set.
//!
//! Frames and targets are estimated on training rows. Outliers of the final model are excluded from the errors of all models that are compared.

use super::selection::{Selected, Selection, close_up, without};
use crate::campaign::Campaign;
use crate::colour::{Filter, stream};
use crate::engine::statistics::median;
use crate::fit::compare;
use crate::hypothesis::Hypothesis;
use crate::problem::{Look, State, visit};
use crate::proof::Split;
use crate::result::Fit;
use crate::size::Size;
use physics::{AnyEffect, Model};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Least gain in log-likelihood on the validation set for which an effect is kept. An absent effect loses there about as much as it gained on the
/// training set.
const SPEAKS: f64 = 1.0;
/// Least sum of an effect's margin on the training set (gain less penalty) and its gain on the validation set, in log-likelihood.
const SURE: f64 = 7.0;
/// A gain on the validation set below this, without sign and in log-likelihood, means that the set cannot show the effect: no reversal of that joint,
/// no load on it. The effect is then kept if its margin on the training set exceeds [`SURE_ALONE`].
const SILENT: f64 = 0.5;
/// Margin on the training set, in log-likelihood, from which an effect needs no support by the validation set.
const SURE_ALONE: f64 = 50.0;
/// Number of effects, those with the smallest margins, that are validated again after one was removed.
const ASKED_AGAIN: usize = 6;
/// Number of poses of a path before each boundary between sets whose measurements are removed.
const APART: usize = 5;
/// A deviation larger than this many times the median is an outlier.
const FAR: f64 = 8.0;

/// RMS errors of scalar values on the test set.
#[derive(Clone, Debug, PartialEq)]
pub struct Proof {
    /// What the test set consists of, for users.
    pub says: String,
    /// Error of the model as given, with frames and targets estimated: m (rad if only joint positions were measured).
    pub before: f64,
    /// Error with all findings and candidates.
    pub after: f64,
    /// Weighted RMS residual of the training rows, corrected for the degrees of freedom: the noise level.
    pub noise: f64,
    /// Whether the errors are lengths (m) or angles (rad).
    pub is_length: bool,
}

/// Removes the measurements of a path just before each boundary between sets, so that autocorrelated noise does not correlate the sets.
pub(super) fn set_apart(campaign: &mut Campaign, splits: [&Split; 2]) {
    let is_path = |k: usize| {
        let source = campaign.recordings.get(campaign.poses[k].recording);
        source.is_none_or(|source| source.is_path)
    };
    let moving = |k: usize| is_path(k) && campaign.poses[k].arrival == crate::Arrival::FromBefore;
    let count = campaign.poses.len();
    let turns = |k: usize| splits.iter().any(|s| s.training[k] != s.training[k - 1]);
    let borders = (1..count).filter(|k| turns(*k) && moving(*k));
    let near: Vec<usize> = borders.flat_map(|k| k.saturating_sub(APART)..k).collect();
    near.into_iter().for_each(|k| campaign.poses[k].seen.clear());
}

/// Margin of an effect after validation, in log-likelihood; above zero: supported. `margin`: gain less penalty on the training set; `gain`: on the
/// validation set.
pub(super) fn validation_margin(margin: f64, gain: f64) -> f64 {
    if gain.abs() < SILENT && margin > SURE_ALONE {
        return margin - SURE_ALONE;
    }
    (gain - SPEAKS).min(margin + gain - SURE)
}

/// Removes the effects that the validation set does not support; it never adds one.
pub(super) fn confirmed(
    campaign: &Campaign,
    model: &Model,
    (split, kept): (&Split, &[bool]),
    mut selection: Selection,
) -> Selection {
    // The design effect of the full selection is kept: without an effect, measurements of one pose would appear more correlated.
    let together = selection.fit.design_effect;
    let mut margins = vec![f64::NEG_INFINITY; selection.named.len()];
    while !selection.named.is_empty() && kept.contains(&true) {
        let held = Held::new(campaign, (split, kept), &selection.fit);
        let left = held.whitened(&selection.fit);
        let told = |one: &Selected| {
            let mut bare = without(&selection.fit, model, &[one]);
            if one.stated.is_some() {
                // If the parameters stayed free within their stated uncertainty, they would be fitted to the corrected values and the gain would
                // vanish.
                let same = |effect: &AnyEffect| {
                    let candidate = &one.candidate;
                    let kind = candidate.probes.first().map(|probe| probe.effect.spec().kind);
                    Some(effect.spec().kind) == kind && effect.joint() == candidate.joint
                };
                bare.believe(same);
            }
            let bare = held.beside(&bare, &selection.fit);
            validation_margin(one.margin, 0.5 * (held.whitened(&bare) - left) / together)
        };
        // Effects with large margins are supported whatever was removed; only the weakest are validated again.
        let mut order: Vec<usize> = (0..margins.len()).collect();
        order.sort_by(|a, b| margins[*a].total_cmp(&margins[*b]));
        let first = margins.iter().filter(|margin| **margin == f64::NEG_INFINITY).count();
        order.truncate(first.max(ASKED_AGAIN));
        let asked: Vec<f64> = order.par_iter().map(|k| told(&selection.named[*k])).collect();
        order.into_iter().zip(asked).for_each(|(k, margin)| margins[k] = margin);
        let worst = margins.iter().copied().enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((k, _)) = worst.filter(|(_, margin)| *margin < 0.0) else { break };
        margins.remove(k);
        let hypothesis = without(&selection.fit, model, &[&selection.named[k]]);
        let gone = selection.named.remove(k);
        close_up(&mut selection.named, &gone);
        selection.fit = held.beside(&hypothesis, &selection.fit);
    }
    selection
}

/// Evaluates fits on poses that took no part in them.
pub(super) struct Held<'a> {
    pub(super) campaign: &'a Campaign,
    pub(super) split: &'a Split,
    /// Whether each pose is evaluated.
    asked: Vec<bool>,
    /// Whether each measurement counts: of an evaluated pose, of the kind `is_length`, and no outlier.
    counts: Vec<bool>,
    pub(super) is_length: bool,
}

impl<'a> Held<'a> {
    /// `split`: training poses; `asked`: poses to evaluate; `last`: the fit of the final model, which determines the outliers.
    pub(super) fn new(
        campaign: &'a Campaign,
        (split, asked): (&'a Split, &[bool]),
        last: &Fit,
    ) -> Self {
        let off = last.off(campaign);
        let is_length = off.iter().any(|off| off.is_length);
        let lengths = off.iter().filter(|o| o.is_length == is_length).map(|o| o.off.length());
        let far = FAR * median(lengths);
        let counts = off.iter().map(|o| asked[o.pose] && o.is_length == is_length);
        let counts = counts.zip(&off).map(|(counts, o)| counts && o.off.length() <= far).collect();
        Self { campaign, split, asked: asked.to_vec(), counts, is_length }
    }

    /// RMS error of scalar values, m or rad.
    pub(super) fn rms(&self, fit: &Fit) -> f64 {
        let (sum, count) = self.sum(fit);
        (sum / count.max(1) as f64).sqrt()
    }

    /// Difference of the predictions of two fits for the measurements that count.
    pub(super) fn size_between(&self, one: &Fit, other: &Fit) -> Size {
        let numbers = self.campaign.poses.iter().flat_map(|pose| &pose.seen);
        let numbers: Vec<usize> = numbers.map(|seen| seen.reading.count()).collect();
        let (one, other) = (one.off(self.campaign), other.off(self.campaign));
        let asked = one.iter().zip(&other).filter(|(one, _)| self.counts[one.reading]);
        Size::of(asked.flat_map(|(one, other)| {
            let values = (one.off - other.off).to_array();
            values.into_iter().take(numbers[one.reading])
        }))
    }

    /// Sum of squared errors of scalar values, m² or rad², and their number.
    fn sum(&self, fit: &Fit) -> (f64, usize) {
        let (mut sum, mut count) = (0.0, 0_usize);
        let numbers = self.campaign.poses.iter().flat_map(|pose| &pose.seen);
        let numbers: Vec<usize> = numbers.map(|seen| seen.reading.count()).collect();
        for off in fit.off(self.campaign).iter().filter(|off| self.counts[off.reading]) {
            sum += off.off.length_squared();
            count += numbers[off.reading];
        }
        (sum, count)
    }

    /// Mean squared error of scalar values, m² or rad². For measured joint positions the mean of each encoder is subtracted first, since the zero of
    /// an encoder is arbitrary.
    pub(super) fn energy(&self, fit: &Fit) -> f64 {
        if self.is_length {
            return self.rms(fit).powi(2);
        }
        let readings: Vec<_> = self.campaign.poses.iter().flat_map(|pose| &pose.seen).collect();
        let mut encoders: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
        for off in fit.off(self.campaign).iter().filter(|off| self.counts[off.reading]) {
            let of = encoders.entry(stream(&readings[off.reading].reading)).or_default();
            let more = [1.0, off.off.x, off.off.x * off.off.x];
            of.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        }
        let varies = |[count, sum, square]: &[f64; 3]| square - sum * sum / count;
        let count: f64 = encoders.values().map(|of| of[0]).sum();
        encoders.values().map(varies).sum::<f64>() / count.max(1.0)
    }

    /// Sum of squares of the whitened residuals: in units of the noise, autocorrelation removed.
    fn whitened(&self, fit: &Fit) -> f64 {
        let mut sum = 0.0;
        let surroundings = fit.surroundings.clone();
        let state = State { surroundings, hypothesis: fit.hypothesis.clone() };
        let mut filter = Filter::new(self.campaign);
        let look = Look { used: Some(&self.asked), derivatives: false };
        visit(self.campaign, &state, look, |at| {
            let weight = if self.counts[at.reading] { 1.0 } else { 0.0 };
            for part in 0..at.rows.count {
                let scale = weight / fit.factors[at.instrument];
                let mut left = [scale * at.rows.residual[part]];
                filter.pass(at.pose, at.instrument, at.stream, part, &mut left);
                sum += weight * left[0] * left[0];
            }
        });
        sum
    }

    /// Weighted RMS residual of the training rows, corrected for the number of fitted parameters.
    fn rms_in_training(&self, fit: &Fit) -> f64 {
        let numbers = self.campaign.poses.iter().flat_map(|pose| &pose.seen);
        let numbers: Vec<usize> = numbers.map(|seen| seen.reading.count()).collect();
        let (mut sum, mut count) = (0.0, 0.0);
        for off in fit.off(self.campaign) {
            if self.split.training[off.pose] && off.is_length == self.is_length {
                let weight = fit.weights[off.reading];
                sum += weight * off.off.length_squared();
                count += weight * numbers[off.reading] as f64;
            }
        }
        let freedom = (count - fit.columns().len() as f64).max(1.0);
        (sum / freedom).sqrt()
    }

    /// The errors on the test set, `before` with the model as given and `after` with `last`.
    pub(super) fn proof(&self, before: f64, after: f64, last: &Fit) -> Proof {
        let (says, noise) = (self.split.says.clone(), self.rms_in_training(last));
        Proof { says, before, after, noise, is_length: self.is_length }
    }

    /// The fit of `hypothesis` with the weights and noise of `last`, so that the sums of squares can be compared.
    pub(super) fn beside(&self, hypothesis: &Hypothesis, last: &Fit) -> Fit {
        compare(self.campaign, hypothesis, last, &self.split.training)
    }
}

#[cfg(test)]
mod tests {
    use super::{Held, Split};
    use crate::campaign::{Noise, Observation, Reading};
    use crate::fit::{Effort, Settings, fit};
    use crate::hypothesis::Hypothesis;
    use crate::made::{empty, nominal};
    use crate::robust::Influence;
    use glam::DVec3;

    #[test]
    fn where_an_encoders_zero_was_put_makes_no_energy() {
        let (zero, swing) = (5e-4, 1e-4);
        let mut campaign = empty(0, 120);
        for (k, pose) in campaign.poses.iter_mut().enumerate() {
            let off = [zero, if k % 2 == 0 { swing } else { -swing }];
            let whitening = Noise::Equal(1e-5).whitening(DVec3::ZERO).expect("sound");
            let seen = off.iter().enumerate().map(|(joint, off)| Observation {
                reading: Reading::JointPosition { joint, position: pose.inputs.q[joint] + off },
                whitening,
                instrument: 0,
            });
            pose.seen = seen.collect();
        }
        let used = vec![true; 120];
        let (influence, effort) = (Influence::Equal, Effort::Full);
        let settings = Settings { used: &used, influence, from: None, effort };
        let found = fit(&campaign, &Hypothesis::fixed(nominal()), &settings);
        let split = Split { says: String::new(), training: used.clone() };
        let held = Held::new(&campaign, (&split, &used), &found);
        let energy = held.energy(&found);
        assert!((energy - 0.5 * swing * swing).abs() < 1e-12, "{energy}");
        assert!(held.rms(&found) > 0.7 * zero, "the error as it is has it");
    }
}
