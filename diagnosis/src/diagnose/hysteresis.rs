//! Search for hysteresis: the one that best explains a joint in place of all effects selected there.
//!
//! Backlash and a spike at each reversal resemble hysteresis with a reversal distance far from those of the dictionary, and with precise instruments
//! even neighbouring distances fit much worse. The best candidates are therefore fitted, including distances near the width of the backlash. Fits are
//! compared under the weights and noise of the present one. The result is a further candidate; `selection` decides.

use super::selection::{EffectSelection, Search, SelectedEffect, hypothesis_without};
use crate::candidates::{Candidate, CandidateList, insert, is_physical};
use crate::fit::refit_with_fixed_weights;
use crate::score_test::ScoreTest;
use physics::AnyEffect;

/// Reversal distances that are tried besides those of the dictionary, relative to the width of the backlash.
const DISTANCES: [f64; 2] = [1.0, 4.0];
/// Number of candidates that are fitted, the best first.
const CANDIDATES_FITTED: usize = 3;

impl Search<'_> {
    /// The best hysteresis of every joint with selected backlash or hysteresis, in place of all effects selected there.
    pub(super) fn hystereses(&self, selection: &EffectSelection) -> Vec<Candidate> {
        let model = &selection.fit.hypothesis.model;
        let new = selection.selected.iter().filter(|one| one.previous_priors.is_none());
        let play = new.filter_map(|one| match model.effects().nth(one.effect)? {
            AnyEffect::Backlash(_) | AnyEffect::Hysteresis(_) => model.effects().nth(one.effect),
            _ => None,
        });
        play.filter_map(|play| self.best_hysteresis(selection, play)).collect()
    }

    fn best_hysteresis(&self, selection: &EffectSelection, play: &AnyEffect) -> Option<Candidate> {
        let arm = &selection.fit.hypothesis.model.arm;
        let is_asked = |one: &&Candidate| {
            one.joint == play.joint()
                && one.changes().is_none()
                && one.probes.iter().any(|p| matches!(p.effect, AnyEffect::Hysteresis(_)))
        };
        let mut all: Vec<Candidate> = self.dictionary.iter().filter(is_asked).cloned().collect();
        // The dictionary has a hysteresis only where most moves are small: only these show how it builds up.
        all.first()?;
        let mut list = CandidateList::new(arm, self.campaign);
        for share in DISTANCES {
            let distance: &[(&str, &[f64])] =
                &[("amplitude", &[0.0]), ("reversal", &[share * play.values()[0]])];
            list.add_effect("hysteresis", play.joint(), distance);
        }
        all.extend(list.candidates);
        let of_joint = selection.selected.iter().filter(|one| one.candidate.joint == play.joint());
        let of_joint: Vec<&SelectedEffect> = of_joint.collect();
        let without = hypothesis_without(&selection.fit, &self.known.model, &of_joint);
        let without =
            refit_with_fixed_weights(self.campaign, &without, &selection.fit, self.settings.used);
        let fitted = ScoreTest::new(self.campaign, &without, &self.settings);
        let mut scores = fitted.scores(&all);
        scores.retain(|score| is_physical(&all[score.candidate], &score.values));
        scores.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let fits = scores.iter().take(CANDIDATES_FITTED).filter_map(|score| {
            let candidate = &all[score.candidate];
            let mut hypothesis = without.hypothesis.clone();
            let index = insert(&mut hypothesis, candidate, candidate.fixed_stems(), &score.values)?;
            let fit =
                refit_with_fixed_weights(self.campaign, &hypothesis, &without, self.settings.used);
            let effect = fit.hypothesis.model.effects().nth(index)?;
            Some((fit.sum_of_squares, candidate.relinearised(arm, effect, &[]).0))
        });
        fits.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, candidate)| candidate)
    }
}
