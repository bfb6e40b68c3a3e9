//! Validation and test: removes effects that the validation set does not support; computes errors on the test set.
//!
//! Frames and targets are estimated on training rows. Outliers of the final model are excluded for all models. Changes no parameter.

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

/// A name is borne out where rows that chose nothing speak for it by this much in log-likelihood: what is not there loses there about what it promised.
const SPEAKS: f64 = 1.0;
/// And where both looks together are as sure as this, in log-likelihood beyond what its numbers and the size of the library cost.
const SURE: f64 = 7.0;
/// A validation set that gains or loses less than this, in log-likelihood, cannot show the effect: no reversal of that joint, no load on it. An effect with
/// this margin by itself is kept then.
const SILENT: f64 = 0.5;
const SURE_ALONE: f64 = 50.0;
/// Names that are asked again once one has gone.
const ASKED_AGAIN: usize = 6;
/// Poses of a path between training and held-out stretches.
const APART: usize = 5;
/// A reading further off than this many times the middle one is an outlier.
const FAR: f64 = 8.0;

/// Root mean squares over single numbers, held out.
#[derive(Clone, Debug, PartialEq)]
pub struct Proof {
    /// What was held out, in words.
    pub says: String,
    /// The model as given, only frames and targets fitted: m (rad where only joints were measured).
    pub before: f64,
    /// With all that was found.
    pub after: f64,
    /// What the instrument cannot see below.
    pub noise: f64,
    /// Whether they are lengths.
    pub is_length: bool,
}

/// Takes the readings next to held-out stretches of a path out of the campaign, so that noise which remembers itself does not tell on both sides.
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

/// Above zero where the gain of the validation set supports an effect that was selected with `margin` above its penalty; both in log-likelihood.
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
    // Readings of one pose err together as much as with all names: what goes makes them seem to err together more.
    let together = selection.fit.design_effect;
    let mut margins = vec![f64::NEG_INFINITY; selection.named.len()];
    while !selection.named.is_empty() && kept.contains(&true) {
        let held = Held::new(campaign, (split, kept), &selection.fit);
        let left = held.whitened(&selection.fit);
        let told = |one: &Selected| {
            let mut bare = without(&selection.fit, model, &[one]);
            if one.stated.is_some() {
                // Left free within its doubt, a number that is far off would be fitted to where the data have it, and nothing would be missing.
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
        // What stood by far stands: those that stood by least are asked again.
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

/// Readings that took no part in a fit, ready to be asked for any.
pub(super) struct Held<'a> {
    pub(super) campaign: &'a Campaign,
    pub(super) split: &'a Split,
    asked: Vec<bool>,
    counts: Vec<bool>,
    pub(super) is_length: bool,
}

impl<'a> Held<'a> {
    /// `split`: what trained; `asked`: the poses that are asked; `last`: the fit with everything, which says what is an outlier.
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

    /// The root mean square of single numbers.
    pub(super) fn rms(&self, fit: &Fit) -> f64 {
        let (sum, count) = self.sum(fit);
        (sum / count.max(1) as f64).sqrt()
    }

    /// By how much two fits differ at the readings that are asked.
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

    /// The sum of squares of single numbers, m² or rad², and how many they are.
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

    /// The mean square of single numbers. Of joints that encoders of their own read, what never changes is left out: an encoder's zero is where somebody put it.
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

    /// The sum of squares of single numbers in units of the noise, what it remembers of itself taken out.
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

    /// The same for the training rows of a fit: what is left where everything was fitted.
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

    /// The proof with these errors, of the model as given and of `last`.
    pub(super) fn proof(&self, before: f64, after: f64, last: &Fit) -> Proof {
        let (says, noise) = (self.split.says.clone(), self.rms_in_training(last));
        Proof { says, before, after, noise, is_length: self.is_length }
    }

    /// The fit of `hypothesis` beside `last`, with its weights.
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
