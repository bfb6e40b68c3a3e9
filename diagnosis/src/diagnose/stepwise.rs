//! Stepwise selection on linearised rows: adds, removes and exchanges effects until no single step lowers the criterion; determines the alternatives
//! of each selected effect.
//!
//! Among equally good candidates the earlier one in the dictionary is selected. The data enter only through the products in [`GramMatrix`]; the same
//! products give the same selection.

use super::gram_matrix::{CandidateEstimate, GramMatrix, LinearisedCandidate};
use super::selection::{
    AlternativeEffect, EffectSelection, INDISTINGUISHABLE_LOSS, Search, SelectedEffect,
    hypothesis_without, key, nuisance_columns,
};
use super::verdict::are_forms_of_one_law;
use crate::candidates::{Candidate, CandidateParameter, is_physical, wave_candidate};
use crate::fit::refit_with_fixed_weights;
use crate::hypothesis::parameter_key;
use crate::periodogram::best_periods;
use crate::score_test::ScoreTest;
use crate::tool_jacobian::changes_or_uses_loads;
use physics::spec::Range;
use physics::{AnyEffect, Model};
use std::sync::OnceLock;

/// Largest number of steps (addition, removal, exchange).
const STEPS_MAX: usize = 120;
/// Largest number of alternatives that are fitted per effect, the best first, and of all effects together.
const ALTERNATIVES_FITTED_MAX: usize = 4;
const ALTERNATIVES_FITTED_IN_ALL: usize = 24;
/// An alternative whose linearised loss exceeds twice [`INDISTINGUISHABLE_LOSS`] by more than this share of the effect's gain is not fitted: its
/// nonlinear parameters cannot make up for it.
const LOSS_SHARE_MAX: f64 = 0.2;
/// Loss in the sum of squares below which other values of the fixed parameters of an effect are indistinguishable from its own: the 95 % quantile of
/// χ² with one degree of freedom.
const VARIANT_LOSS_MAX: f64 = 3.84;
/// Largest increase of the criterion for which two effects are replaced by a single one before the nonlinear fit decides: in the sum of squares, and
/// as a share of the gain of the two. The increase follows from linearised rows.
const MERGE_INCREASE_MAX: f64 = 20.0;
const MERGE_INCREASE_SHARE: f64 = 3e-3;
/// Tolerance within which an estimate outside the admissible range of a parameter is set to the limit, in standard deviations.
const LIMIT_TOLERANCE_SIGMAS: f64 = 2.0;
/// Improvements that differ by less than this are equal; the candidate that comes first in the dictionary is then selected.
const TIE_MARGIN: f64 = 1e-3;

/// Stepwise selection on the rows linearised at a fit.
#[derive(Clone)]
pub(super) struct StepwiseSelection<'a> {
    given: &'a Model,
    /// The candidates: those of the dictionary, the effects of the previous selection, those found outside the dictionary.
    pub(super) entries: Vec<LinearisedCandidate>,
    pub(super) gram: GramMatrix,
    /// Indices of the effects of the previous selection, in its order.
    pub(super) previous: Vec<usize>,
    /// Indices of the selected candidates.
    pub(super) selected: Vec<usize>,
    design_effect: f64,
    /// Number of scalar values divided by the design effect; at least 2.
    readings: f64,
    /// Sum of squares of the fit with all selected effects; computed when the first alternative is fitted.
    full_sum: OnceLock<f64>,
}

impl<'a> StepwiseSelection<'a> {
    /// A stepwise selection on the rows linearised at the fit of `selection`; `also`: candidates that are not in the dictionary.
    pub(super) fn new(
        search: &Search<'a>,
        selection: &EffectSelection,
        also: &[LinearisedCandidate],
    ) -> Self {
        let EffectSelection { fit, selected } = selection;
        let fitted = ScoreTest::new(search.campaign, fit, &search.settings);
        let arm = &fit.hypothesis.model.arm;
        let moves = search.cache.columns(&fitted, search.dictionary);
        let of_library =
            search.dictionary.iter().zip(moves).map(|(candidate, moves)| LinearisedCandidate {
                moves: Some(moves),
                ..LinearisedCandidate::unfitted(candidate.fixed_stems(), candidate.clone())
            });
        let mut entries: Vec<LinearisedCandidate> = of_library.collect();
        let mut of_selection = Vec::with_capacity(selected.len());
        for one in selected {
            let effect = fit.hypothesis.model.effects().nth(one.effect);
            let stated_values = &search
                .known
                .model
                .effects()
                .nth(one.effect)
                .filter(|_| one.previous_priors.is_some());
            let stated_values =
                stated_values.map_or(&[][..], |stated_values| stated_values.values());
            // Every selected effect gets an entry, so that the indices follow the order of the selection.
            let unfitted = || (one.candidate.clone(), vec![0.0; one.candidate.probes.len()]);
            let (candidate, linearised_at) = effect.map_or_else(unfitted, |effect| {
                one.candidate.relinearised(arm, effect, stated_values)
            });
            // A correction replaces the dictionary's candidate of the same effect; any other effect may be selected a second time with other values.
            entries.retain(|e| {
                candidate.changes().is_none() || e.candidate.changes() != candidate.changes()
            });
            let open = LinearisedCandidate::unfitted(one.fixed, candidate);
            of_selection.push(LinearisedCandidate {
                linearised_at,
                waived_penalty: one.waived_penalty,
                ..open
            });
        }
        let previous = (entries.len()..entries.len() + of_selection.len()).collect();
        entries.extend(of_selection);
        entries.extend_from_slice(also);
        for line in best_periods(&fitted) {
            let found = wave_candidate(arm, line.joint, line.cycles);
            entries.extend(found.map(|candidate| LinearisedCandidate::unfitted(&[], candidate)));
        }
        let (nuisance, stated) = nuisance_columns(search, selection);
        Self {
            given: &search.known.model,
            gram: GramMatrix::of(&fitted, &entries, &nuisance, &stated),
            entries,
            previous,
            selected: Vec::new(),
            design_effect: fit.design_effect,
            readings: (fit.readings as f64 / fit.design_effect).max(2.0),
            full_sum: OnceLock::new(),
        }
    }

    /// Penalty per parameter, in the sum of squares (Bayesian information criterion).
    pub(super) fn penalty(&self) -> f64 {
        self.readings.ln()
    }

    /// Gain less the penalty of the parameters and of the number of candidates, in the sum of squares.
    pub(super) fn improvement(&self, gain: &CandidateEstimate, entry: &LinearisedCandidate) -> f64 {
        let tried = self.entries.len().max(1) as f64;
        let numbers = (gain.parameter_count + entry.nonlinear_count()) as f64;
        gain.gain / self.design_effect - numbers * self.penalty() + entry.waived_penalty
            - 2.0 * tried.ln()
    }

    /// The criterion, in the sum of squares: residual sum of squares plus all penalties. Every step lowers it.
    pub(super) fn cost(&self) -> f64 {
        let tried = 2.0 * (self.entries.len().max(1) as f64).ln();
        let numbers = |place: &usize| {
            (self.gram.estimate_beside_others(*place).parameter_count
                + self.entries[*place].nonlinear_count()) as f64
        };
        let cost = |place: &usize| {
            numbers(place) * self.penalty() + tried - self.entries[*place].waived_penalty
        };
        self.gram.residual_sum() / self.design_effect + self.selected.iter().map(cost).sum::<f64>()
    }

    /// Takes steps from the current selection until none lowers the criterion.
    pub(super) fn run(&mut self) {
        for _ in 0..STEPS_MAX {
            if !self.step() {
                break;
            }
        }
    }

    /// Takes one step; returns whether there was one.
    pub(super) fn step(&mut self) -> bool {
        self.remove_weakest() || self.add_best() || self.exchange_one()
    }

    /// The selected candidates except `but`, without corrections.
    fn others_than(&self, but: &[usize]) -> Vec<&Candidate> {
        let others = self.selected.iter().filter(|entry| !but.contains(entry));
        let others = others.map(|entry| &self.entries[*entry].candidate);
        others.filter(|other| other.changes().is_none()).collect()
    }

    /// Whether a candidate is compatible with others: it must not describe the same error as one of them, and needs what it adds to.
    fn is_compatible(&self, candidate: &Candidate, beside: &[&Candidate]) -> bool {
        self.has_its_base(candidate, beside)
            && !beside.iter().any(|other| candidate.excludes(other))
    }

    /// Whether the effect that a candidate adds to is there: hardening needs a linear compliance of the joint.
    fn has_its_base(&self, candidate: &Candidate, beside: &[&Candidate]) -> bool {
        let first = |one: &Candidate| one.probes.first().map(|probe| probe.effect);
        let Some(effect) = first(candidate) else { return true };
        let is_base = |other: &AnyEffect| effect.hardens(other);
        !effect.is_hardening()
            || beside.iter().filter_map(|other| first(other)).any(|other| is_base(&other))
            || self.given.effects().any(is_base)
    }

    /// Candidates that are compatible with the selected ones except `but`, the best first; among equals in the order of the dictionary.
    fn ranked_candidates(
        &self,
        gram: &GramMatrix,
        but: &[usize],
    ) -> Vec<(usize, CandidateEstimate, f64)> {
        let beside = self.others_than(but);
        let mut open = Vec::new();
        for (place, entry) in self.entries.iter().enumerate() {
            if !self.is_compatible(&entry.candidate, &beside) || self.selected.contains(&place) {
                continue;
            }
            let Some(mut gain) = gram.estimate_if_added(place) else { continue };
            let Some(found) = self.plausible_estimates(&entry.candidate, &gain) else { continue };
            gain.estimates = found;
            let worth = self.improvement(&gain, entry);
            open.push((place, gain, worth));
        }
        let step = |worth: f64| (worth / TIE_MARGIN).round();
        open.sort_by(|a, b| step(b.2).total_cmp(&step(a.2)).then(a.0.cmp(&b.0)));
        open
    }

    /// The estimates, set to the limits of their admissible ranges if they exceed these by no more than their uncertainty. A parameter between two
    /// limits is always set to the nearer one, since a linearised estimate can overshoot where a fit does not (`1 / (1 + s)` of a sensor's scale).
    /// `None` if another one lies further outside.
    fn plausible_estimates(
        &self,
        candidate: &Candidate,
        gain: &CandidateEstimate,
    ) -> Option<Vec<f64>> {
        let unsure = LIMIT_TOLERANCE_SIGMAS * self.design_effect.sqrt();
        let mut found = gain.estimates.clone();
        for ((probe, value), sigma) in candidate.probes.iter().zip(&mut found).zip(&gain.sigma) {
            let range = parameter_key(&probe.effect, probe.value).map(|key| key.parameter.range);
            let within = range.map_or(*value, |range| range.nearest(*value));
            let is_between = matches!(range, Some(Range::Between(..)));
            let is_near = (within - *value).abs() < unsure * sigma || is_between;
            if !candidate.is_one_mass() && is_near {
                *value = within;
            }
        }
        (is_physical(candidate, &found) && !self.implies_lead(candidate, &found)).then_some(found)
    }

    /// Whether a joint would lead its command, which is impossible: a negative delay of the measurement together with servo lag of other joints
    /// means that.
    fn implies_lead(&self, candidate: &Candidate, found: &[f64]) -> bool {
        let is = |one: &Candidate, kind| key(one).is_some_and(|title| title.0 == kind);
        let comes_early = |found: &[f64]| found.iter().any(|delay| *delay < 0.0);
        let mut chosen = self.selected.iter().map(|place| (place, &self.entries[*place].candidate));
        if is(candidate, "time_delay") {
            return comes_early(found) && chosen.any(|(_, other)| is(other, "servo_lag"));
        }
        let early = |(place, other): (&usize, &Candidate)| {
            is(other, "time_delay")
                && comes_early(&self.gram.estimate_beside_others(*place).estimates)
        };
        is(candidate, "servo_lag") && chosen.any(early)
    }

    /// Adds the best candidate if it lowers the criterion.
    fn add_best(&mut self) -> bool {
        let best = self.ranked_candidates(&self.gram, &[]).into_iter().next();
        let Some((place, ..)) = best.filter(|(_, _, worth)| *worth > 0.0) else { return false };
        self.gram.add(place);
        self.selected.push(place);
        true
    }

    /// Removes the effect with the least improvement, if that is not positive, its parameters are outside their ranges, or what it adds to is gone.
    fn remove_weakest(&mut self) -> bool {
        let worth = |(index, place): (usize, &usize)| {
            let gain = self.gram.estimate_beside_others(*place);
            let entry = &self.entries[*place];
            let sound = self.plausible_estimates(&entry.candidate, &gain).is_some()
                && self.has_its_base(&entry.candidate, &self.others_than(&[*place]));
            (index, if sound { self.improvement(&gain, entry) } else { f64::NEG_INFINITY })
        };
        let weakest =
            self.selected.iter().enumerate().map(worth).min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((index, _)) = weakest.filter(|(_, worth)| *worth <= 0.0) else { return false };
        let place = self.selected.remove(index);
        self.gram.remove(place);
        true
    }

    /// Exchanges the first effect for which there is a better candidate.
    fn exchange_one(&mut self) -> bool {
        for index in 0..self.selected.len() {
            let place = self.selected[index];
            let improvement_now =
                self.improvement(&self.gram.estimate_beside_others(place), &self.entries[place]);
            let mut gram = self.gram.clone();
            gram.remove(place);
            let best = self.ranked_candidates(&gram, &[place]).into_iter().next();
            if let Some((other, ..)) =
                best.filter(|(_, _, worth)| *worth > improvement_now + 2.0 * TIE_MARGIN)
            {
                gram.add(other);
                self.gram = gram;
                self.selected[index] = other;
                return true;
            }
        }
        false
    }

    /// Replaces two effects of one joint by the single candidate with the lowest criterion, if the increase is small enough that the nonlinear fit may
    /// reverse it. Exchanging one effect at a time does not find this.
    pub(super) fn merge_pair(&mut self) -> bool {
        let cost_now = self.cost();
        let (mut cost_min, mut best) = (f64::INFINITY, None);
        let pairs =
            (1..self.selected.len()).flat_map(|second| (0..second).map(move |k| (k, second)));
        for (first, second) in pairs {
            let pair = [self.selected[first], self.selected[second]];
            let [one, other] = pair.map(|place| self.entries[place].candidate.joint);
            if one.is_none() || one != other {
                continue;
            }
            let mut merged = self.clone();
            pair.iter().for_each(|place| merged.gram.remove(*place));
            let improvement_lost =
                (merged.gram.residual_sum() - self.gram.residual_sum()) / self.design_effect;
            // Each of the two alone was already considered before the other was selected.
            let names = pair.map(|place| key(&self.entries[place].candidate));
            let mut open = self.ranked_candidates(&merged.gram, &pair).into_iter();
            let other = open.find(|o| !names.contains(&key(&self.entries[o.0].candidate)));
            let Some((place, ..)) = other else { continue };
            merged.gram.add(place);
            merged.selected.retain(|place| !pair.contains(place));
            merged.selected.push(place);
            let cost = merged.cost();
            if cost
                < cost_min
                    .min(cost_now + MERGE_INCREASE_MAX.max(MERGE_INCREASE_SHARE * improvement_lost))
            {
                (cost_min, best) = (cost, Some(merged));
            }
        }
        let found = best.is_some();
        if let Some(merged) = best {
            *self = merged;
        }
        found
    }

    /// Includes the effects of the previous selection.
    pub(super) fn include_previous(&mut self) {
        self.include(self.previous.clone());
    }

    /// Includes the candidates with these indices.
    pub(super) fn include(&mut self, places: Vec<usize>) {
        for place in places {
            self.gram.add(place);
            self.selected.push(place);
        }
    }

    /// Effect `k` of the selection with its alternatives. Those that nonlinear parameters may make competitive are fitted.
    pub(super) fn with_alternatives(
        &self,
        search: &Search<'_>,
        selection: &EffectSelection,
        k: usize,
    ) -> SelectedEffect {
        let place_now = self.selected[k];
        let gain = self.gram.estimate_beside_others(place_now);
        let mut gram = self.gram.clone();
        gram.remove(place_now);
        let mut keys_seen = vec![key(&self.entries[place_now].candidate)];
        let (mut close, mut variants) = (Vec::new(), Vec::new());
        let arm = &selection.fit.hypothesis.model.arm;
        for (place, estimate, _) in self.ranked_candidates(&gram, &[place_now]) {
            let entry = &self.entries[place];
            let name = key(&entry.candidate);
            let behind = (gain.gain - estimate.gain) / self.design_effect;
            let is_variant =
                name == keys_seen[0] && !entry.fixed.is_empty() && entry.nonlinear_count() == 0;
            if is_variant && behind < VARIANT_LOSS_MAX {
                variants.extend(entry.candidate.effect(arm, &estimate.estimates));
            }
            // Linearised at zero width, backlash differs from backlash of the width that a fit finds, so forms of the same law are always fitted.
            let is_same_law =
                are_forms_of_one_law(&self.entries[place_now].candidate, &entry.candidate);
            let may_come = behind
                < 2.0 * INDISTINGUISHABLE_LOSS + LOSS_SHARE_MAX * gain.gain / self.design_effect;
            if !keys_seen.contains(&name) && (may_come || is_same_law) {
                keys_seen.push(name);
                close.insert(if is_same_law { 0 } else { close.len() }, (place, estimate));
            }
        }
        let fitted = ALTERNATIVES_FITTED_MAX
            .min(ALTERNATIVES_FITTED_IN_ALL / selection.selected.len().max(1))
            .max(1);
        let mut alternatives = Vec::new();
        for (place, estimate) in close.into_iter().take(fitted) {
            let rival = self.alternative(search, selection, k, place, &estimate, gain.gain);
            alternatives
                .extend(rival.filter(|rival| rival.likelihood_loss < 2.0 * INDISTINGUISHABLE_LOSS));
        }
        alternatives.sort_by(|a, b| a.likelihood_loss.total_cmp(&b.likelihood_loss));
        SelectedEffect {
            margin: 0.5 * self.improvement(&gain, &self.entries[place_now]),
            gain: 0.5 * gain.gain / self.design_effect,
            parameter_count: gain.parameter_count + self.entries[place_now].nonlinear_count(),
            share: search.used_share(),
            alternatives,
            variants,
            ..selection.selected[k].clone()
        }
    }
}

impl StepwiseSelection<'_> {
    /// The candidate `place` as an alternative of effect `k`, whose gain is `gain`; fitted if the linearisation does not suffice.
    fn alternative(
        &self,
        search: &Search<'_>,
        selection: &EffectSelection,
        k: usize,
        place: usize,
        estimate: &CandidateEstimate,
        gain: f64,
    ) -> Option<AlternativeEffect> {
        let entry = &self.entries[place];
        let fit = &selection.fit;
        let arm = &fit.hypothesis.model.arm;
        let numbers = estimate.parameter_count + entry.nonlinear_count();
        let changes = entry.candidate.changes();
        let alternative_of =
            |likelihood_loss: f64, effect, candidate, estimates| AlternativeEffect {
                effect,
                changes: changes.is_some(),
                likelihood_loss,
                numbers,
                is_indistinguishable: likelihood_loss
                    < INDISTINGUISHABLE_LOSS * search.used_share(),
                candidate,
                estimates,
                fixed: entry.fixed,
            };
        let named = &selection.selected[k];
        if !self.needs_fit(named, entry) {
            let behind = 0.5 * (gain - estimate.gain) / self.design_effect;
            let effect = entry.candidate.effect(arm, &estimate.estimates)?;
            return Some(alternative_of(
                behind,
                effect,
                entry.candidate.clone(),
                estimate.estimates.clone(),
            ));
        }
        let mut hypothesis = hypothesis_without(fit, &search.known.model, &[named]);
        let (index, _) = Search::add_candidate(&mut hypothesis, entry, &estimate.estimates)?;
        let whole = *self.full_sum.get_or_init(|| {
            refit_with_fixed_weights(search.campaign, &fit.hypothesis, fit, search.settings.used)
                .sum_of_squares
        });
        let fitted =
            refit_with_fixed_weights(search.campaign, &hypothesis, fit, search.settings.used);
        let effect = *fitted.hypothesis.model.effects().nth(index)?;
        let behind = 0.5 * (fitted.sum_of_squares - whole) / self.design_effect;
        let (candidate, found) = match changes {
            Some(_) => (entry.candidate.clone(), estimate.estimates.clone()),
            None => entry.candidate.relinearised(arm, &effect, &[]),
        };
        Some(alternative_of(behind, effect, candidate, found))
    }

    /// Whether an alternative must be fitted because the linearisation does not suffice: nonlinear parameters, corrections, two effects that depend on
    /// loads, backlash.
    fn needs_fit(&self, named: &SelectedEffect, rival: &LinearisedCandidate) -> bool {
        let is_about_loads = |candidate: &Candidate| {
            candidate.probes.first().is_some_and(|probe| changes_or_uses_loads(probe.effect.spec()))
        };
        let both = is_about_loads(&rival.candidate) && is_about_loads(&named.candidate);
        // Backlash of finite width is traversed over several rows, whereas the linearisation at zero width assumes that it is crossed at once.
        let is_gap = |probe: &CandidateParameter| matches!(probe.effect, AnyEffect::Backlash(_));
        let is_gap = rival.candidate.probes.first().is_some_and(is_gap);
        rival.nonlinear_count() > 0 || rival.candidate.changes().is_some() || both || is_gap
    }
}
