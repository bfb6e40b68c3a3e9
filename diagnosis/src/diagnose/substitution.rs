//! Replaces a selected effect by an alternative. Alternatives are proposed by linearised sums of squares; a nonlinear fit decides.

use super::gram_matrix::LinearisedCandidate;
use super::selection::{
    AlternativeEffect, EffectSelection, INDISTINGUISHABLE_LOSS, Search, SelectedEffect,
    hypothesis_without, is_needed, shift_indices_after,
};
use crate::fit::{fit_further, refit_with_fixed_weights};
use crate::hypothesis::Hypothesis;

/// Largest number of rounds in which alternatives may replace selected effects.
pub(super) const SUBSTITUTION_ROUNDS: usize = 3;
/// Least gain in penalised log-likelihood for a replacement.
const REPLACEMENT_GAIN_MIN: f64 = 0.25;
/// Number of alternatives of an effect that are refitted to verify that they are as good as the linearisation predicts.
const REFITS_MAX: usize = 3;

/// Determines the alternatives of each selected effect on the rows that `search` uses, and replaces effects by better alternatives. The number of
/// effects stays the same.
pub(super) fn with_alternatives(
    search: &Search<'_>,
    mut selection: EffectSelection,
) -> EffectSelection {
    search.progress.selected(selection.selected.len());
    for round in 0..=SUBSTITUTION_ROUNDS {
        let also = search.searched_candidates(&selection);
        let penalty = search.find_alternatives(&mut selection, &also);
        if round == SUBSTITUTION_ROUNDS || !search.substitute(&mut selection, penalty) {
            search.refit_alternatives(&mut selection, penalty);
            break;
        }
        selection.fit = fit_further(search.campaign, &selection.fit, &search.settings);
    }
    selection
}

impl SelectedEffect {
    /// Loss in penalised log-likelihood of an alternative compared with the selected effect.
    fn penalised_loss(&self, rival: &AlternativeEffect, penalty: f64) -> f64 {
        rival.likelihood_loss + self.penalty_difference(rival, penalty)
    }

    /// Index of the best alternative if it is better than the selected effect.
    fn best_replacement(&self, penalty: f64) -> Option<usize> {
        let losses =
            self.alternatives.iter().map(|rival| self.penalised_loss(rival, penalty)).enumerate();
        let (best, loss) = losses.min_by(|a, b| a.1.total_cmp(&b.1))?;
        (loss < -REPLACEMENT_GAIN_MIN).then_some(best)
    }
}

/// Whether an alternative of effect `k` is compatible with the other selected effects: two of them must not be replaced by the same effect, and a
/// hardening keeps its linear compliance.
fn is_compatible(selection: &EffectSelection, k: usize, rival: &AlternativeEffect) -> bool {
    let effects = &selection.fit.hypothesis.model;
    let new = selection
        .selected
        .iter()
        .enumerate()
        .filter(|(index, one)| *index != k && one.previous_priors.is_none());
    let mut others = new.filter_map(|(_, one)| effects.effects().nth(one.effect));
    let keeps_base = !is_needed(&selection.selected[k], &selection.fit)
        || effects.effects().any(|effect| effect.hardens(&rival.effect));
    keeps_base && !others.any(|effect| rival.candidate.excludes_effect(effect))
}

impl Search<'_> {
    /// Replaces effects by alternatives that are better after a nonlinear fit; returns whether any was replaced.
    pub(super) fn substitute(&self, selection: &mut EffectSelection, penalty: f64) -> bool {
        let mut any = false;
        for k in 0..selection.selected.len() {
            let one = &selection.selected[k];
            let better = one.best_replacement(penalty).map(|place| &one.alternatives[place]);
            let better = better.filter(|rival| is_compatible(selection, k, rival));
            let renamed =
                better.and_then(|rival| self.with_replacement(selection, k, rival, penalty));
            if let Some((renamed, _)) = renamed.filter(|(_, loss)| *loss < -REPLACEMENT_GAIN_MIN) {
                (*selection, any) = (renamed, true);
            }
        }
        any
    }

    /// Refits alternatives that appear better and corrects their loss in log-likelihood. Alternatives that are incompatible with the other effects
    /// are removed.
    fn refit_alternatives(&self, selection: &mut EffectSelection, penalty: f64) {
        for k in 0..selection.selected.len() {
            for _ in 0..REFITS_MAX {
                let one = &selection.selected[k];
                let Some(place) = one.best_replacement(penalty) else { break };
                let rival = &one.alternatives[place];
                if !is_compatible(selection, k, rival) {
                    selection.selected[k].alternatives.remove(place);
                    continue;
                }
                let behind = self
                    .with_replacement(selection, k, rival, penalty)
                    .map(|(_, loss)| loss - one.penalty_difference(rival, penalty));
                let Some(behind) = behind.filter(|behind| *behind > rival.likelihood_loss) else {
                    break;
                };
                let rival = &mut selection.selected[k].alternatives[place];
                rival.likelihood_loss = behind;
                rival.is_indistinguishable = behind < INDISTINGUISHABLE_LOSS * self.used_share();
            }
            selection.selected[k]
                .alternatives
                .sort_by(|a, b| a.likelihood_loss.total_cmp(&b.likelihood_loss));
        }
    }

    /// The selection with `rival` in place of effect `k`, and the loss in penalised log-likelihood.
    fn with_replacement(
        &self,
        selection: &EffectSelection,
        k: usize,
        rival: &AlternativeEffect,
        penalty: f64,
    ) -> Option<(EffectSelection, f64)> {
        let mut selected = selection.selected.clone();
        let replaced = &selection.selected[k];
        let mut hypothesis = hypothesis_without(&selection.fit, &self.known.model, &[replaced]);
        let entry = LinearisedCandidate::unfitted(rival.fixed, rival.candidate.clone());
        let (effect, previous_priors) =
            Self::add_candidate(&mut hypothesis, &entry, &rival.estimates)?;
        shift_indices_after(&mut selected, replaced);
        let compared = |hypothesis: &Hypothesis| {
            refit_with_fixed_weights(self.campaign, hypothesis, &selection.fit, self.settings.used)
        };
        let fit = compared(&hypothesis);
        // Compared with the present fit, since other effects may have been replaced after the alternatives were determined.
        let before = compared(&selection.fit.hypothesis).sum_of_squares;
        let behind = 0.5 * (fit.sum_of_squares - before) / selection.fit.design_effect;
        let loss = behind + replaced.penalty_difference(rival, penalty);
        let more = rival.numbers.saturating_sub(replaced.parameter_count) as f64;
        selected[k] = SelectedEffect {
            candidate: entry.candidate,
            effect,
            previous_priors,
            fixed: rival.fixed,
            waived_penalty: replaced.waived_penalty.max(penalty * more),
            gain: replaced.gain - behind,
            margin: replaced.margin - loss,
            parameter_count: rival.numbers,
            share: replaced.share,
            alternatives: Vec::new(),
            variants: Vec::new(),
        };
        Some((EffectSelection { fit, selected }, loss))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign_simulation;
    use crate::diagnose::dictionary::candidate_dictionary;
    use crate::diagnose::jacobian_cache::JacobianCache;
    use crate::diagnose::selection::{key, preselect};
    use crate::diagnose::verdict::confidence;
    use crate::fit::{FitSettings, fit};
    use crate::progress::{Stage, StageProgress, ignore};
    use crate::robust_weights::Influence;
    use crate::test_campaigns::{nominal_robot, unmeasured_campaign};
    use physics::{AnyEffect, ParameterValues};

    #[test]
    fn a_rival_that_sums_call_better_counts_as_far_behind_as_its_fit_is() {
        let model = nominal_robot();
        let mut truth = model;
        let given: &[(&str, &[f64])] = &[("offset", &[2e-3])];
        let zero = AnyEffect::build("joint_offset", &model.arm, Some(2), ParameterValues(given));
        truth.push(zero.expect("an effect")).expect("room");
        let unmeasured = unmeasured_campaign(3, 60);
        let campaign = campaign_simulation::simulate_readings(
            &unmeasured,
            &truth,
            &unmeasured.surroundings,
            1.0,
            5,
        );
        let known = Hypothesis::fixed(model);
        let used = vec![true; 60];
        let settings = FitSettings::full(&used, Influence::Equal);
        let base = fit(&campaign, &known, &settings);
        let (library, cache) = (candidate_dictionary(&model, &campaign), JacobianCache::default());
        let search = Search {
            campaign: &campaign,
            known: &known,
            settings,
            dictionary: &library,
            cache: &cache,
            progress: StageProgress::begin(&ignore, Stage::Alternatives),
        };
        let (mut selection, also) = preselect(&search, &base, 10);
        let penalty = search.find_alternatives(&mut selection, &also);
        let kinds: Vec<_> = selection.selected.iter().map(|one| key(&one.candidate)).collect();
        assert_eq!(kinds, [Some(("joint_offset", Some(2), false))]);
        // A scale error of the last joint, which explains nothing of a zero offset.
        let wrong = |candidate: &&crate::candidates::Candidate| {
            key(candidate) == Some(("joint_ratio", Some(5), false))
        };
        let candidate = library.iter().find(wrong).expect("in the library").clone();
        let effect = candidate.effect(&model.arm, &[1e-6]).expect("an effect");
        let rival = AlternativeEffect {
            effect,
            changes: false,
            likelihood_loss: -40.0,
            numbers: 1,
            is_indistinguishable: true,
            candidate,
            estimates: vec![1e-6],
            fixed: &[],
        };
        selection.selected[0].alternatives = vec![rival];
        assert!(confidence(&selection.selected[0], &selection.fit).0 < 0.01, "by the sums");
        search.refit_alternatives(&mut selection, penalty);
        let rival = &selection.selected[0].alternatives[0];
        assert!(
            rival.likelihood_loss > 20.0 && !rival.is_indistinguishable,
            "{}",
            rival.likelihood_loss
        );
        assert!(confidence(&selection.selected[0], &selection.fit).0 > 0.99, "by the fit");
    }
}
