//! Alternates between selection and nonlinear fit until the selected effects no longer change.
//!
//! A selection uses the linearised rows; its criterion is computed from the nonlinear fit that follows. If effects interact (a mass and a compliance,
//! a nonlinear effect on top of a compliance), the two differ, and accepting every selection that appears better could cycle.
//!
//! The fit with the best information criterion is kept, with the noise level estimated if it is not stated. Uses training rows only.

use super::gram_matrix::LinearisedCandidate;
use super::selection::{EffectSelection, Search, SelectedEffect, keys};
use super::stepwise::StepwiseSelection;
use crate::fit::{FitEffort, fit_further};
use crate::fit_result::Fit;

/// Largest number of rounds of selection and fit.
const ROUNDS_MAX: usize = 40;
/// Least reduction of the criterion for which a round is accepted, in the sum of squares.
const IMPROVEMENT_MIN: f64 = 1.0;
/// Contribution of a scalar value whose measurement is rejected as an outlier (weight 0), in units of the noise variance.
const OUTLIER_COST: f64 = 9.0;

/// Ratio of the sum of squares to the number of scalar values beyond which the excess counts logarithmically, as if the noise level were estimated.
/// An AR model that was estimated before any selection may describe missing effects, and its whitening filter then amplifies white noise.
const EXCESS_RATIO: f64 = 2.0;

/// How far the stepwise selection of a round goes from the current selection.
#[derive(Clone, Copy)]
enum SearchExtent {
    UntilConverged,
    SingleStep,
    Multistart,
}

impl Search<'_> {
    /// Alternates between selection and nonlinear fit until the selected effects no longer change.
    pub(super) fn iterate_until_stable(
        &self,
        start: EffectSelection,
        also: &[LinearisedCandidate],
    ) -> EffectSelection {
        let mut best = start;
        for _ in 0..ROUNDS_MAX {
            let Some(next) = self.next_selection(&best, also) else { break };
            let is_unchanged = keys(&next.selected) == keys(&best.selected);
            best = next;
            self.progress.selected(best.selected.len());
            if is_unchanged {
                break;
            }
        }
        best.fit = fit_further(self.campaign, &best.fit, &self.settings);
        best
    }

    /// Replaces two effects of one joint by a single one if that improves the criterion. Exchanging one effect at a time does not find this.
    pub(super) fn merge_effects(&self, selection: EffectSelection) -> EffectSelection {
        let joints: Vec<usize> =
            selection.selected.iter().filter_map(|one| one.candidate.joint).collect();
        if (1..joints.len()).all(|k| !joints[..k].contains(&joints[k])) {
            return selection;
        }
        let also = self.searched_candidates(&selection);
        let mut stepwise = StepwiseSelection::new(self, &selection, &also);
        stepwise.include_previous();
        if !stepwise.merge_pair() {
            return selection;
        }
        let merged = self.nonlinear_fit(&stepwise, &selection.fit, FitEffort::Full);
        if self.is_better(&merged, &selection) {
            self.iterate_until_stable(merged, &also)
        } else {
            selection
        }
    }

    /// A better selection than `best`: by stepwise selection from there, else by one step from there, else by multistart. If none selects other
    /// effects, `best` with refined parameters, if these improve the criterion; otherwise `None`.
    pub(super) fn next_selection(
        &self,
        best: &EffectSelection,
        also: &[LinearisedCandidate],
    ) -> Option<EffectSelection> {
        let named = &best.selected;
        let ways: &[SearchExtent] = match named.is_empty() {
            // From the empty selection, the result of many linearised steps may be worse once it is fitted, where a single step improves the
            // criterion.
            true => &[SearchExtent::Multistart, SearchExtent::SingleStep],
            false => {
                &[SearchExtent::UntilConverged, SearchExtent::SingleStep, SearchExtent::Multistart]
            }
        };
        let mut same = None;
        let open = StepwiseSelection::new(self, best, also);
        for way in ways {
            let mut stepwise = open.clone();
            match way {
                SearchExtent::UntilConverged => stepwise.run_from_previous(),
                SearchExtent::SingleStep => stepwise.step_from_previous(),
                SearchExtent::Multistart => stepwise.run_multistart(),
            }
            let is_unchanged = stepwise.keys() == keys(named);
            if is_unchanged && same.is_some() {
                continue;
            }
            let next = self.nonlinear_fit(&stepwise, &best.fit, FitEffort::Sketch);
            if self.is_better(&next, same.as_ref().unwrap_or(best)) {
                if !is_unchanged {
                    return Some(next);
                }
                same = Some(next);
            }
        }
        same
    }

    /// Whether `next` has a better extended Bayesian information criterion than `best`, both under the larger design effect of the two.
    pub(super) fn is_better(&self, next: &EffectSelection, best: &EffectSelection) -> bool {
        let together = next.fit.design_effect.max(best.fit.design_effect);
        let cost = |selection: &EffectSelection| {
            let readings = (selection.fit.readings as f64 / together).max(2.0);
            let tried = 2.0 * (self.dictionary.len().max(1) as f64).ln();
            let cost = |one: &SelectedEffect| {
                one.parameter_count as f64 * readings.ln() + tried - one.waived_penalty
            };
            self.deviance(&selection.fit) / together
                + selection.selected.iter().map(cost).sum::<f64>()
        };
        cost(next) < cost(best) - IMPROVEMENT_MIN
    }

    /// Minus twice the log-likelihood, up to a constant.
    fn deviance(&self, fit: &Fit) -> f64 {
        let read = self.campaign.poses.iter().zip(self.settings.used);
        let read = read
            .flat_map(|(pose, used)| pose.seen.iter().map(move |observation| (observation, used)));
        let one =
            |((observation, used), weight): ((&crate::campaign::Observation, &bool), &f64)| {
                let size =
                    2.0 * fit.factors[observation.instrument].ln() + OUTLIER_COST * (1.0 - weight);
                if *used { size * observation.reading.count() as f64 } else { 0.0 }
            };
        let most = EXCESS_RATIO * fit.readings as f64;
        let left = if fit.sum_of_squares > most {
            most * (1.0 + (fit.sum_of_squares / most).ln())
        } else {
            fit.sum_of_squares
        };
        left + read.zip(&fit.weights).map(one).sum::<f64>()
    }
}
