//! Search for counterbalances: the spring that best explains a joint in place of all effects selected there.
//!
//! The force of a spring depends nonlinearly on three parameters. The grid of the dictionary is coarse, and the gain at a grid point says little about
//! its neighbours: the best spring of each lever length is therefore fitted. Fits are compared under the weights and noise of the present one. The
//! result is a further candidate; `selection` decides.

use super::selection::{EffectSelection, Search, SelectedEffect, hypothesis_without};
use crate::candidates::{Candidate, insert, is_physical, springs_at};
use crate::fit::refit_with_fixed_weights;
use crate::hypothesis::FreeParameter;
use crate::score_test::{CandidateScore, ScoreTest};
use crate::tool_jacobian::changes_or_uses_loads;
use physics::AnyEffect;

/// Gain in the sum of squares below which no spring is fitted.
const FITTED_GAIN_MIN: f64 = 15.0;
/// Share of the largest gain from which a lever length is fitted.
const FITTED_GAIN_SHARE: f64 = 0.5;
/// Index of the lever length among the parameters of a spring.
const LEVER: usize = 2;

impl Search<'_> {
    /// The best spring of every joint with a compliance or a load effect, in place of all effects selected there.
    pub(super) fn springs(
        &self,
        fitted: &ScoreTest<'_>,
        selection: &EffectSelection,
    ) -> Vec<Candidate> {
        let model = &selection.fit.hypothesis.model;
        let is_at = |effect: &AnyEffect, joint| effect.joint() == Some(joint);
        let is_compliant = |joint: &usize| {
            model
                .effects()
                .any(|effect| changes_or_uses_loads(effect.spec()) && is_at(effect, *joint))
        };
        let best = |joint| {
            let named = selection.selected.iter().filter(|one| one.candidate.joint == Some(joint));
            let named: Vec<&SelectedEffect> = named.collect();
            if named.is_empty() {
                return self.best_spring(fitted, joint, &fitted.state.hypothesis.free);
            }
            let mut without = hypothesis_without(&selection.fit, &self.known.model, &named);
            let free = without.free.clone();
            // Without the spring, the fitted compliance would be too small and hide it: compliances keep their stated values during the search.
            without.fix_at_stated_means(|effect| changes_or_uses_loads(effect.spec()));
            let without = refit_with_fixed_weights(
                self.campaign,
                &without,
                &selection.fit,
                self.settings.used,
            );
            self.best_spring(&ScoreTest::new(self.campaign, &without, &self.settings), joint, &free)
        };
        (0..model.arm.count()).filter(is_compliant).filter_map(best).collect()
    }

    /// The best spring of a joint beside the effects of `fitted`, with its shape fitted together with the parameters `free`.
    fn best_spring(
        &self,
        fitted: &ScoreTest<'_>,
        joint: usize,
        free: &[FreeParameter],
    ) -> Option<Candidate> {
        let arm = &fitted.state.hypothesis.model.arm;
        let all = springs_at(arm, joint);
        let mut scores = fitted.scores(&all);
        scores.retain(|score| is_physical(&all[score.candidate], &score.values));
        scores.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let best = scores.first()?;
        if best.gain < FITTED_GAIN_MIN * fitted.fit.design_effect {
            return Some(all[best.candidate].clone());
        }
        let lever = |score: &CandidateScore| {
            Some(all[score.candidate].probes.first()?.effect.values()[LEVER])
        };
        let mut levers = Vec::new();
        let mut is_first = |score: &&CandidateScore| {
            let lever_of = lever(score);
            let is_new = !levers.contains(&lever_of);
            levers.push(lever_of);
            is_new
        };
        let nearly_best =
            scores.iter().take_while(|score| score.gain >= FITTED_GAIN_SHARE * best.gain);
        let shaped = nearly_best.filter(|score| is_first(score)).filter_map(|score| {
            let candidate = &all[score.candidate];
            let mut hypothesis = fitted.fit.hypothesis.clone();
            hypothesis.free = free.to_vec();
            let index = insert(&mut hypothesis, candidate, candidate.fixed_stems(), &score.values)?;
            let shaped = refit_with_fixed_weights(
                self.campaign,
                &hypothesis,
                fitted.fit,
                self.settings.used,
            );
            let effect = shaped.hypothesis.model.effects().nth(index)?;
            Some((shaped.sum_of_squares, candidate.relinearised(arm, effect, &[]).0))
        });
        let best = shaped.min_by(|a, b| a.0.total_cmp(&b.0));
        best.map(|(_, candidate)| candidate)
    }
}
