//! Which effects are missing or wrong: selection, replacement by better alternatives, and the alternatives of each selected effect.
//!
//! Stepwise selection by the extended Bayesian information criterion: gain in log-likelihood less the penalty of the parameters and of the number of
//! candidates; effects are added, removed and exchanged one at a time. Nonlinear parameters are fitted after each selection, and the selection is
//! repeated with them.
//!
//! Alternatives are compared with the same weights and the same noise model. Uses training rows only.

use super::gram_matrix::LinearisedCandidate;
use super::jacobian_cache::JacobianCache;
use super::modes::modes;
use super::stepwise::StepwiseSelection;
use super::substitution::SUBSTITUTION_ROUNDS;
use super::verdict::form_penalty;
use crate::campaign::Campaign;
use crate::candidates::{Candidate, insert};
use crate::fit::{FitEffort, FitSettings, fit_further, refit_with_fixed_weights};
use crate::fit_result::Fit;
use crate::hypothesis::{FreeParameter, Hypothesis, PriorSource};
use crate::progress::StageProgress;
use crate::score_test::ScoreTest;
use physics::{AnyEffect, Model};
use rayon::prelude::*;

/// Largest number of rounds of the preselection.
const PRESELECTION_ROUNDS: usize = 3;
/// An alternative within this difference in log-likelihood is indistinguishable (docs/diagnosis.md).
pub(super) const INDISTINGUISHABLE_LOSS: f64 = 5.0;

/// An alternative to a selected effect: another effect that explains the same error.
#[derive(Clone, Debug)]
pub struct AlternativeEffect {
    /// The alternative effect, with the parameters that were estimated in place of the selected effect, SI.
    pub effect: AnyEffect,
    /// Whether it corrects an effect that the model states.
    pub changes: bool,
    /// Loss in log-likelihood with it in place of the selected effect; negative if it fits better.
    pub likelihood_loss: f64,
    /// Number of its parameters.
    pub numbers: usize,
    /// Whether the whole recording cannot distinguish it from the selected effect.
    pub is_indistinguishable: bool,
    /// The candidate it came from, linearised at the estimated parameters.
    pub(super) candidate: Candidate,
    /// Estimated values of the candidate's linear parameters, SI.
    pub(super) estimates: Vec<f64>,
    /// Parameters that a fit of it holds fixed, by stem (name in files, without the suffix of the unit).
    pub(super) fixed: &'static [&'static str],
}

/// A selected effect with its alternatives.
#[derive(Clone, Debug)]
pub(super) struct SelectedEffect {
    pub(super) candidate: Candidate,
    /// Index among the effects of the fit's model.
    pub(super) effect: usize,
    /// For a correction of an effect that the model states: the priors of its parameters before the correction.
    pub(super) previous_priors: Option<Vec<FreeParameter>>,
    /// Parameters that are held fixed in every fit, by stem (name in files, without the suffix of the unit).
    pub(super) fixed: &'static [&'static str],
    /// Part of the penalty that is waived, in the sum of squares; as in [`LinearisedCandidate`].
    pub(super) waived_penalty: f64,
    /// Gain in log-likelihood by this effect beside the others.
    pub(super) gain: f64,
    /// Gain less the penalty of its parameters and of the number of candidates, in log-likelihood.
    pub(super) margin: f64,
    /// Number of its parameters.
    pub(super) parameter_count: usize,
    /// Share of the measured poses that the comparison with its alternatives used, 0 to 1.
    pub(super) share: f64,
    pub(super) alternatives: Vec<AlternativeEffect>,
    /// The same effect with other values of the fixed parameters, indistinguishable in this recording.
    pub(super) variants: Vec<AnyEffect>,
}

/// The selected effects, and the fit with all of them.
pub(super) struct EffectSelection {
    pub(super) fit: Fit,
    pub(super) selected: Vec<SelectedEffect>,
}

impl EffectSelection {
    /// The empty selection, with a fit of the known model.
    pub(super) fn none(fit: &Fit) -> Self {
        Self { fit: fit.clone(), selected: Vec::new() }
    }

    /// The selection without the effects `removed`, with the fit of the others.
    pub(super) fn without_effects(&self, removed: &[&SelectedEffect], fit: Fit) -> Self {
        let is_removed =
            |one: &SelectedEffect| removed.iter().any(|other| std::ptr::eq(*other, one));
        let mut selected: Vec<SelectedEffect> =
            self.selected.iter().filter(|one| !is_removed(one)).cloned().collect();
        // In descending order, so that the indices of the remaining ones stay valid.
        let mut removed: Vec<&&SelectedEffect> = removed.iter().collect();
        removed.sort_by_key(|one| std::cmp::Reverse(one.effect));
        removed.into_iter().for_each(|one| shift_indices_after(&mut selected, one));
        Self { fit, selected }
    }
}

/// Inputs of a selection run.
pub(super) struct Search<'a> {
    pub(super) campaign: &'a Campaign,
    /// The model as given; parameters with a stated standard uncertainty are free.
    pub(super) known: &'a Hypothesis,
    pub(super) settings: FitSettings<'a>,
    pub(super) dictionary: &'a [Candidate],
    /// Cached tool displacements by each candidate of the dictionary.
    pub(super) cache: &'a JacobianCache,
    /// The stage that this run is part of.
    pub(super) progress: StageProgress<'a>,
}

/// A preselection from the empty selection: a few rounds of selection and fit, which end early at `count_max` effects or if the effects no longer change.
/// Also returns the candidates that were searched for outside the dictionary.
pub(super) fn preselect(
    search: &Search<'_>,
    base: &Fit,
    count_max: usize,
) -> (EffectSelection, Vec<LinearisedCandidate>) {
    let mut selection = EffectSelection::none(base);
    let also = search.searched_candidates(&selection);
    for _ in 0..PRESELECTION_ROUNDS {
        let Some(next) = search.next_selection(&selection, &also) else { break };
        let is_unchanged = keys(&next.selected) == keys(&selection.selected);
        selection = next;
        search.progress.selected(selection.selected.len());
        if is_unchanged || selection.selected.len() >= count_max {
            break;
        }
    }
    (selection, also)
}

/// Selection until no alternative of a selected effect is better once it is fitted; starts from `start`.
pub(super) fn select(search: &Search<'_>, start: EffectSelection) -> EffectSelection {
    let mut selection = start;
    search.progress.selected(selection.selected.len());
    for _ in 0..SUBSTITUTION_ROUNDS {
        let also = search.searched_candidates(&selection);
        selection = search.merge_effects(search.iterate_until_stable(selection, &also));
        let penalty = search.find_alternatives(&mut selection, &also);
        if !search.substitute(&mut selection, penalty) {
            break;
        }
    }
    selection
}

/// Repeats the selection after the noise model was estimated again, from the empty selection (with the fit `refitted`) and from `first`; returns the
/// better one. Under autocorrelated noise single steps from the empty selection can miss the effects of an arm with many errors, whereas steps from
/// `first` also remove effects that are no longer significant.
pub(super) fn restart(
    search: &Search<'_>,
    refitted: &Fit,
    first: EffectSelection,
) -> EffectSelection {
    let fresh = select(search, EffectSelection::none(refitted));
    if keys(&fresh.selected) == keys(&first.selected) {
        return fresh;
    }
    let under = fit_further(search.campaign, &first.fit, &search.settings);
    let kept = select(search, EffectSelection { fit: under, ..first });
    if search.is_better(&kept, &fresh) { kept } else { fresh }
}

impl SelectedEffect {
    /// Penalty of an alternative relative to this effect, in log-likelihood, for its additional parameters and for not being the preferred form of
    /// the same law ([`form_penalty`]). Unless it is another form of the same law, the penalty is at most [`INDISTINGUISHABLE_LOSS`] (times the share of the poses that
    /// were compared) plus ½ per additional parameter, which is the expected gain of a parameter without effect: the effect with fewest parameters is
    /// selected unless the evidence differs by more (docs/reference/effects.md).
    ///
    /// `penalty`: per parameter, in the sum of squares.
    pub(super) fn penalty_difference(&self, rival: &AlternativeEffect, penalty: f64) -> f64 {
        let more = rival.numbers as f64 - self.parameter_count as f64;
        let most = INDISTINGUISHABLE_LOSS * self.share + 0.5 * more.abs();
        let numbers = 0.5 * penalty * more;
        let probe = self.candidate.probes.first();
        let form_term = probe.and_then(|probe| form_penalty(&probe.effect, &rival.effect, numbers));
        form_term.unwrap_or(numbers.clamp(-most, most))
    }
}

/// Updates the indices of effects after `removed` was removed from the model. A correction leaves the number of effects unchanged.
pub(super) fn shift_indices_after(named: &mut [SelectedEffect], removed: &SelectedEffect) {
    if removed.previous_priors.is_none() {
        named.iter_mut().filter(|one| one.effect > removed.effect).for_each(|one| one.effect -= 1);
    }
}

/// Kind and joint of an effect, and whether it is a correction of a stated effect.
pub(super) type EffectKey = (&'static str, Option<usize>, bool);

/// [`EffectKey`] of a candidate; `None` without parameters.
pub(super) fn key(candidate: &Candidate) -> Option<EffectKey> {
    let effect = candidate.probes.first()?.effect;
    Some((effect.spec().kind, effect.joint(), candidate.changes().is_some()))
}

pub(super) fn keys(named: &[SelectedEffect]) -> Vec<Option<EffectKey>> {
    let mut titles: Vec<Option<EffectKey>> = named.iter().map(|one| key(&one.candidate)).collect();
    titles.sort_unstable();
    titles
}

impl Search<'_> {
    /// Share of the measured poses that are used, 0 to 1.
    pub(super) fn used_share(&self) -> f64 {
        let read = |pose: usize| !self.campaign.poses[pose].seen.is_empty();
        let all = (0..self.campaign.poses.len()).filter(|pose| read(*pose)).count();
        let used = self.settings.used.iter().enumerate();
        let used = used.filter(|(pose, used)| **used && read(*pose)).count();
        used as f64 / all.max(1) as f64
    }

    /// Candidates besides the dictionary: flexible modes, springs and hystereses, searched for in the residual of `selection`.
    pub(super) fn searched_candidates(
        &self,
        selection: &EffectSelection,
    ) -> Vec<LinearisedCandidate> {
        let fitted = ScoreTest::new(self.campaign, &selection.fit, &self.settings);
        let found = modes(&fitted, self.cache).into_iter().chain(self.springs(&fitted, selection));
        found
            .chain(self.hystereses(selection))
            .map(|found| LinearisedCandidate::unfitted(found.fixed_stems(), found))
            .collect()
    }

    /// Determines the alternatives of every selected effect. Returns the penalty per parameter, in the sum of squares.
    pub(super) fn find_alternatives(
        &self,
        selection: &mut EffectSelection,
        also: &[LinearisedCandidate],
    ) -> f64 {
        let mut stepwise = StepwiseSelection::new(self, selection, also);
        stepwise.include_previous();
        let steps = self.progress.steps(selection.selected.len());
        let compared = (0..selection.selected.len()).into_par_iter().map(|k| {
            let with_alternatives = stepwise.with_alternatives(self, selection, k);
            steps.step();
            with_alternatives
        });
        selection.selected = compared.collect();
        stepwise.penalty()
    }

    /// Adds a candidate to a hypothesis with the parameters `found`; `None` if the model is full. Returns the index of the effect and, for a
    /// correction, the previous priors.
    pub(super) fn add_candidate(
        hypothesis: &mut Hypothesis,
        entry: &LinearisedCandidate,
        found: &[f64],
    ) -> Option<(usize, Option<Vec<FreeParameter>>)> {
        let joined = match entry.candidate.changes() {
            Some(effect) => (effect, Some(hypothesis.widen_priors(effect))),
            None => (insert(hypothesis, &entry.candidate, entry.fixed, found)?, None),
        };
        // Selected effects come first: of two dependent columns the later one is dropped, but parameters with a stated uncertainty are fitted in any
        // case.
        hypothesis.free.sort_by_key(|free| free.prior_source == PriorSource::Stated);
        Some(joined)
    }

    /// The nonlinear fit with the selected effects.
    pub(super) fn nonlinear_fit(
        &self,
        stepwise: &StepwiseSelection<'_>,
        before: &Fit,
        effort: FitEffort,
    ) -> EffectSelection {
        let mut hypothesis = self.known.clone();
        let mut chosen = Vec::new();
        for entry in &stepwise.selected {
            let gain = stepwise.gram.estimate_beside_others(*entry);
            let entry = &stepwise.entries[*entry];
            if let Some((effect, previous_priors)) =
                Self::add_candidate(&mut hypothesis, entry, &gain.estimates)
            {
                chosen.push(SelectedEffect {
                    candidate: entry.candidate.clone(),
                    effect,
                    previous_priors,
                    fixed: entry.fixed,
                    waived_penalty: entry.waived_penalty,
                    gain: 0.5 * gain.gain / before.design_effect,
                    margin: 0.5 * stepwise.improvement(&gain, entry),
                    parameter_count: gain.parameter_count + entry.nonlinear_count(),
                    share: 1.0,
                    alternatives: Vec::new(),
                    variants: Vec::new(),
                });
            }
        }
        // After a large step the residual of the first iterations is not noise: it is reduced first, with the weights and noise level of the fit
        // before.
        let approximate =
            refit_with_fixed_weights(self.campaign, &hypothesis, before, self.settings.used);
        let settings = FitSettings { effort, ..self.settings };
        EffectSelection {
            fit: fit_further(self.campaign, &approximate, &settings),
            selected: chosen,
        }
    }
}

/// Columns of the fit that are always included (indices among the fitted columns), and the standard uncertainties that the model states of parameters
/// which a correction frees (index in that list, SI).
pub(super) fn nuisance_columns(
    search: &Search<'_>,
    selection: &EffectSelection,
) -> (Vec<usize>, Vec<(usize, f64)>) {
    let fit = &selection.fit;
    let given = search.known.model.effects().len();
    let first = fit.column_of(0);
    let mut places = Vec::new();
    let mut stated = Vec::new();
    for (place, column) in fit.columns().iter().enumerate() {
        let free = column.checked_sub(first).map(|k| fit.hypothesis.free[k]);
        let Some(free) = free else {
            places.push(place);
            continue;
        };
        if free.effect >= given {
            continue;
        }
        let revised = selection
            .selected
            .iter()
            .find(|one| one.previous_priors.is_some() && one.effect == free.effect);
        match revised {
            None => places.push(place),
            Some(one) => {
                let prior =
                    one.previous_priors.iter().flatten().find(|prior| prior.value == free.value);
                if let Some(prior) = prior {
                    stated.push((places.len(), prior.sigma));
                    places.push(place);
                }
            }
        }
    }
    (places, stated)
}

/// Whether another effect of the fit needs this one, as a hardening needs its only linear compliance.
pub(super) fn is_needed(one: &SelectedEffect, fit: &Fit) -> bool {
    one.previous_priors.is_none() && is_invalid_without(&fit.hypothesis, one.effect)
}

/// Whether a valid model is not valid any more without an effect.
fn is_invalid_without(hypothesis: &Hypothesis, effect: usize) -> bool {
    hypothesis.model.check().is_ok() && hypothesis.without(effect).model.check().is_err()
}

/// Whether what this effect adds to is not in the fit: a hardening without a linear compliance.
pub(super) fn lacks_its_base(one: &SelectedEffect, fit: &Fit) -> bool {
    let model = &fit.hypothesis.model;
    let effect = model.effects().nth(one.effect);
    effect.is_some_and(|effect| {
        effect.is_hardening() && !model.effects().any(|other| effect.hardens(other))
    })
}

/// The hypothesis of a fit without these effects.
pub(super) fn hypothesis_without(
    fit: &Fit,
    given: &Model,
    removed: &[&SelectedEffect],
) -> Hypothesis {
    let mut hypothesis = fit.hypothesis.clone();
    let mut removed: Vec<&SelectedEffect> = removed.to_vec();
    // In descending order, so that the indices of the remaining ones stay valid.
    removed.sort_by_key(|one| std::cmp::Reverse(one.effect));
    for one in removed {
        match &one.previous_priors {
            Some(stated) => hypothesis.restore_priors(one.effect, given, stated),
            None => hypothesis = hypothesis.without(one.effect),
        }
    }
    hypothesis
}

#[cfg(test)]
mod tests {
    use super::is_invalid_without;
    use crate::hypothesis::Hypothesis;
    use crate::test_campaigns::nominal_robot;
    use physics::{AnyEffect, ParameterValues};

    #[test]
    fn a_linear_compliance_is_needed_while_it_is_the_only_one_that_is_hardened() {
        let nominal = nominal_robot();
        let effect = |kind, joint, name, value: f64| {
            let values = [(name, &[value][..])];
            AnyEffect::build(kind, &nominal.arm, Some(joint), ParameterValues(&values))
                .expect("an effect")
        };
        let of_gravity = effect("gravity_compliance", 1, "compliance", 2e-6);
        let hardening = effect("stiffness_hardening", 1, "cubic", 1e-13);
        let of_wrench = effect("load_compliance", 1, "compliance", 2e-6);
        let of_another_joint = effect("joint_compliance", 2, "compliance", 2e-6);
        let needed = |effects: &[AnyEffect]| -> Vec<bool> {
            let mut hypothesis = Hypothesis::fixed(nominal);
            for effect in effects {
                hypothesis.add(*effect, &[]).expect("room");
            }
            (0..effects.len()).map(|effect| is_invalid_without(&hypothesis, effect)).collect()
        };
        assert_eq!(needed(&[of_gravity, hardening, of_another_joint]), [true, false, false]);
        assert_eq!(needed(&[of_gravity, hardening, of_wrench]), [false; 3]);
        assert_eq!(needed(&[of_gravity, of_another_joint]), [false; 2]);
    }
}
