//! Alternates between selection and nonlinear fit until the selected effects no longer change.
//!
//! A selection uses the linearised rows; its criterion is computed from the nonlinear fit that follows. If effects interact (a mass and a compliance,
//! a nonlinear effect on top of a compliance), the two differ, and accepting every selection that appears better could cycle.
//!
//! The fit with the best information criterion is kept, with the noise level estimated if it is not stated. Uses training rows only.

use super::gram::Entry;
use super::selection::{Search, Selected, Selection, titles};
use super::stepwise::Stepwise;
use crate::fit::{Effort, Settings, fit};
use crate::result::Fit;

/// Largest number of rounds of selection and fit.
const ROUNDS: usize = 40;
/// Least reduction of the criterion for which a round is accepted, in the sum of squares.
const BETTER: f64 = 1.0;
/// Contribution of a scalar value whose measurement is rejected as an outlier (weight 0), in units of the noise variance.
const OUTSIDE: f64 = 9.0;

/// Ratio of the sum of squares to the number of scalar values beyond which the excess counts logarithmically, as if the noise level were estimated.
/// An AR model that was estimated before any selection may describe missing effects, and its whitening filter then amplifies white noise.
const LOUD: f64 = 2.0;

/// How far the stepwise selection of a round goes from the current selection.
#[derive(Clone, Copy)]
enum Way {
    AsFarAsSteps,
    OneStep,
    FromAnyStart,
}

impl Search<'_> {
    /// Alternates between selection and nonlinear fit until the selected effects no longer change.
    pub(super) fn until_stable(&self, start: Selection, also: &[Entry]) -> Selection {
        let mut best = start;
        for _ in 0..ROUNDS {
            let Some(next) = self.next(&best, also) else { break };
            let stands = titles(&next.named) == titles(&best.named);
            best = next;
            if stands {
                break;
            }
        }
        let around = best.fit.surroundings.clone();
        let settings = Settings { from: Some(&around), ..self.settings };
        best.fit = fit(self.campaign, &best.fit.hypothesis, &settings);
        best
    }

    /// Replaces two effects of one joint by a single one if that improves the criterion. Exchanging one effect at a time does not find this.
    pub(super) fn merged(&self, selection: Selection) -> Selection {
        let joints: Vec<usize> =
            selection.named.iter().filter_map(|one| one.candidate.joint).collect();
        if (1..joints.len()).all(|k| !joints[..k].contains(&joints[k])) {
            return selection;
        }
        let also = self.searched(&selection);
        let mut stepwise = Stepwise::at(self, &selection, &also);
        stepwise.stand();
        if !stepwise.merge() {
            return selection;
        }
        let merged = self.fitted(&stepwise, &selection.fit, Effort::Full);
        if self.is_better(&merged, &selection) {
            self.until_stable(merged, &also)
        } else {
            selection
        }
    }

    /// A better selection than `best`: by stepwise selection from there, else by one step from there, else by multistart. If none selects other
    /// effects, `best` with refined parameters, if these improve the criterion; otherwise `None`.
    pub(super) fn next(&self, best: &Selection, also: &[Entry]) -> Option<Selection> {
        let named = &best.named;
        let ways: &[Way] = match named.is_empty() {
            // From the empty selection, the result of many linearised steps may be worse once it is fitted, where a single step improves the
            // criterion.
            true => &[Way::FromAnyStart, Way::OneStep],
            false => &[Way::AsFarAsSteps, Way::OneStep, Way::FromAnyStart],
        };
        let mut same = None;
        let open = Stepwise::at(self, best, also);
        for way in ways {
            let mut stepwise = open.clone();
            match way {
                Way::AsFarAsSteps => stepwise.make_from(),
                Way::OneStep => stepwise.step_from(),
                Way::FromAnyStart => stepwise.make_best(),
            }
            let stands = stepwise.titles() == titles(named);
            if stands && same.is_some() {
                continue;
            }
            let next = self.fitted(&stepwise, &best.fit, Effort::Sketch);
            if self.is_better(&next, same.as_ref().unwrap_or(best)) {
                if !stands {
                    return Some(next);
                }
                same = Some(next);
            }
        }
        same
    }

    /// Whether `next` has a better extended Bayesian information criterion than `best`, both under the larger design effect of the two.
    pub(super) fn is_better(&self, next: &Selection, best: &Selection) -> bool {
        let together = next.fit.design_effect.max(best.fit.design_effect);
        let cost = |selection: &Selection| {
            let readings = (selection.fit.readings as f64 / together).max(2.0);
            let tried = 2.0 * (self.library.len().max(1) as f64).ln();
            let cost = |one: &Selected| one.numbers as f64 * readings.ln() + tried - one.spared;
            self.misfit(&selection.fit) / together + selection.named.iter().map(cost).sum::<f64>()
        };
        cost(next) < cost(best) - BETTER
    }

    /// Minus twice the log-likelihood, up to a constant.
    fn misfit(&self, fit: &Fit) -> f64 {
        let read = self.campaign.poses.iter().zip(self.settings.used);
        let read = read.flat_map(|(pose, used)| pose.seen.iter().map(move |seen| (seen, used)));
        let one = |((seen, used), weight): ((&crate::campaign::Observation, &bool), &f64)| {
            let size = 2.0 * fit.factors[seen.instrument].ln() + OUTSIDE * (1.0 - weight);
            if *used { size * seen.reading.count() as f64 } else { 0.0 }
        };
        let most = LOUD * fit.readings as f64;
        let left = if fit.sum > most { most * (1.0 + (fit.sum / most).ln()) } else { fit.sum };
        left + read.zip(&fit.weights).map(one).sum::<f64>()
    }
}
