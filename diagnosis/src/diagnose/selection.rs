//! Which effects are missing or wrong: selection, replacement by better alternatives, and the alternatives of each selected effect.
//!
//! Stepwise selection by the extended Bayesian information criterion: gain in log-likelihood less the penalty of the parameters and of the number of
//! candidates; effects are added, removed and exchanged one at a time. Nonlinear parameters are fitted after each selection, and the selection is
//! repeated with them.
//!
//! Alternatives are compared with the same weights and the same noise model. Uses training rows only.

use super::gram::Entry;
use super::jacobian_cache::JacobianCache;
use super::judge::of_word;
use super::modes::modes;
use super::stepwise::Stepwise;
use super::substitution::SUBSTITUTION_ROUNDS;
use crate::campaign::Campaign;
use crate::candidates::{Candidate, put};
use crate::fit::{Effort, Settings, compare, fit};
use crate::hypothesis::{Belief, Free, Hypothesis};
use crate::result::Fit;
use crate::score::Fitted;
use physics::{AnyEffect, Model};
use rayon::prelude::*;

/// Largest number of rounds of the preselection.
const PRESELECTION_ROUNDS: usize = 3;
/// An alternative within this difference in log-likelihood is indistinguishable (docs/diagnosis.md).
pub(super) const ALIKE: f64 = 5.0;

/// An alternative to a selected effect: another effect that explains the same error.
#[derive(Clone, Debug)]
pub struct Rival {
    /// The alternative effect, with the parameters that were estimated in place of the selected effect, SI.
    pub effect: AnyEffect,
    /// Whether it corrects an effect that the model states.
    pub changes: bool,
    /// Loss in log-likelihood with it in place of the selected effect; negative if it fits better.
    pub behind: f64,
    /// Number of its parameters.
    pub numbers: usize,
    /// Whether the whole recording cannot distinguish it from the selected effect.
    pub alike: bool,
    /// The candidate it came from, linearised at the estimated parameters.
    pub(super) candidate: Candidate,
    /// Estimated values of the candidate's linear parameters, SI.
    pub(super) found: Vec<f64>,
    /// Parameters that a fit of it holds fixed, by stem (name in files, without the suffix of the unit).
    pub(super) kept: &'static [&'static str],
}

/// A selected effect with its alternatives.
#[derive(Clone, Debug)]
pub(super) struct Selected {
    pub(super) candidate: Candidate,
    /// Index among the effects of the fit's model.
    pub(super) effect: usize,
    /// For a correction of an effect that the model states: the priors of its parameters before the correction.
    pub(super) stated: Option<Vec<Free>>,
    /// Parameters that are held fixed in every fit, by stem (name in files, without the suffix of the unit).
    pub(super) kept: &'static [&'static str],
    /// Part of the penalty that is waived, in the sum of squares; as in [`Entry`].
    pub(super) spared: f64,
    /// Gain in log-likelihood by this effect beside the others.
    pub(super) gain: f64,
    /// Gain less the penalty of its parameters and of the number of candidates, in log-likelihood.
    pub(super) margin: f64,
    /// Number of its parameters.
    pub(super) numbers: usize,
    /// Share of the measured poses that the comparison with its alternatives used, 0 to 1.
    pub(super) share: f64,
    pub(super) rivals: Vec<Rival>,
    /// The same effect with other values of the fixed parameters, indistinguishable in this recording.
    pub(super) variants: Vec<AnyEffect>,
}

/// The selected effects, and the fit with all of them.
pub(super) struct Selection {
    pub(super) fit: Fit,
    pub(super) named: Vec<Selected>,
}

impl Selection {
    /// The empty selection, with a fit of the known model.
    pub(super) fn none(fit: &Fit) -> Self {
        Self { fit: fit.clone(), named: Vec::new() }
    }

    /// The selection without the effects `gone`, with the fit of the others.
    pub(super) fn without(&self, gone: &[&Selected], fit: Fit) -> Self {
        let is_gone = |one: &Selected| gone.iter().any(|gone| std::ptr::eq(*gone, one));
        let mut named: Vec<Selected> =
            self.named.iter().filter(|one| !is_gone(one)).cloned().collect();
        // In descending order, so that the indices of the remaining ones stay valid.
        let mut gone: Vec<&&Selected> = gone.iter().collect();
        gone.sort_by_key(|one| std::cmp::Reverse(one.effect));
        gone.into_iter().for_each(|one| close_up(&mut named, one));
        Self { fit, named }
    }
}

/// Inputs of a selection run.
pub(super) struct Search<'a> {
    pub(super) campaign: &'a Campaign,
    /// The model as given; parameters with a stated standard uncertainty are free.
    pub(super) known: &'a Hypothesis,
    pub(super) settings: Settings<'a>,
    pub(super) library: &'a [Candidate],
    /// Cached tool displacements by each candidate of the library.
    pub(super) cache: &'a JacobianCache,
}

/// A preselection from the empty selection: a few rounds of selection and fit, which end early at `many` effects or if the effects no longer change.
/// Also returns the candidates that were searched for outside the library.
pub(super) fn preselected(search: &Search<'_>, base: &Fit, many: usize) -> (Selection, Vec<Entry>) {
    let mut selection = Selection::none(base);
    let also = search.searched(&selection);
    for _ in 0..PRESELECTION_ROUNDS {
        let Some(next) = search.next(&selection, &also) else { break };
        let stands = titles(&next.named) == titles(&selection.named);
        selection = next;
        if stands || selection.named.len() >= many {
            break;
        }
    }
    (selection, also)
}

/// Selection until no alternative of a selected effect is better once it is fitted; starts from `start`.
pub(super) fn select(search: &Search<'_>, start: Selection) -> Selection {
    let mut selection = start;
    for _ in 0..SUBSTITUTION_ROUNDS {
        let also = search.searched(&selection);
        selection = search.merged(search.until_stable(selection, &also));
        let penalty = search.compare(&mut selection, &also);
        if !search.substitute(&mut selection, penalty) {
            break;
        }
    }
    selection
}

/// Repeats the selection after the noise model was estimated again, from the empty selection (with the fit `bare`) and from `first`; returns the
/// better one. Under autocorrelated noise single steps from the empty selection can miss the effects of an arm with many errors, whereas steps from
/// `first` also remove effects that are no longer significant.
pub(super) fn restarted(search: &Search<'_>, bare: &Fit, first: Selection) -> Selection {
    let fresh = select(search, Selection::none(bare));
    if titles(&fresh.named) == titles(&first.named) {
        return fresh;
    }
    let around = first.fit.surroundings.clone();
    let settings = Settings { from: Some(&around), ..search.settings };
    let under = fit(search.campaign, &first.fit.hypothesis, &settings);
    let kept = select(search, Selection { fit: under, ..first });
    if search.is_better(&kept, &fresh) { kept } else { fresh }
}

impl Selected {
    /// Penalty of an alternative relative to this effect, in log-likelihood, for its additional parameters and for not being the preferred form of
    /// the same law ([`of_word`]). Unless it is another form of the same law, the penalty is at most [`ALIKE`] (times the share of the poses that
    /// were compared) plus ½ per additional parameter, which is the expected gain of a parameter without effect: the effect with fewest parameters is
    /// selected unless the evidence differs by more (docs/reference/effects.md).
    ///
    /// `penalty`: per parameter, in the sum of squares.
    pub(super) fn dearer(&self, rival: &Rival, penalty: f64) -> f64 {
        let more = rival.numbers as f64 - self.numbers as f64;
        let most = ALIKE * self.share + 0.5 * more.abs();
        let numbers = 0.5 * penalty * more;
        let own = self.candidate.probes.first();
        let word = own.and_then(|own| of_word(&own.effect, &rival.effect, numbers));
        word.unwrap_or(numbers.clamp(-most, most))
    }
}

/// Updates the indices of effects after `gone` was removed from the model. A correction leaves the number of effects unchanged.
pub(super) fn close_up(named: &mut [Selected], gone: &Selected) {
    if gone.stated.is_none() {
        named.iter_mut().filter(|one| one.effect > gone.effect).for_each(|one| one.effect -= 1);
    }
}

/// Kind and joint of an effect, and whether it is a correction of a stated effect.
pub(super) type Title = (&'static str, Option<usize>, bool);

/// [`Title`] of a candidate; `None` without parameters.
pub(super) fn title(candidate: &Candidate) -> Option<Title> {
    let effect = candidate.probes.first()?.effect;
    Some((effect.spec().kind, effect.joint(), candidate.changes().is_some()))
}

pub(super) fn titles(named: &[Selected]) -> Vec<Option<Title>> {
    let mut titles: Vec<Option<Title>> = named.iter().map(|one| title(&one.candidate)).collect();
    titles.sort_unstable();
    titles
}

impl Search<'_> {
    /// Share of the measured poses that are used, 0 to 1.
    pub(super) fn share(&self) -> f64 {
        let read = |pose: usize| !self.campaign.poses[pose].seen.is_empty();
        let all = (0..self.campaign.poses.len()).filter(|pose| read(*pose)).count();
        let used = self.settings.used.iter().enumerate();
        let used = used.filter(|(pose, used)| **used && read(*pose)).count();
        used as f64 / all.max(1) as f64
    }

    /// Candidates besides the library: flexible modes, springs and hystereses, searched for in the residual of `selection`.
    pub(super) fn searched(&self, selection: &Selection) -> Vec<Entry> {
        let fitted = Fitted::new(self.campaign, &selection.fit, &self.settings);
        let found = modes(&fitted, self.cache).into_iter().chain(self.springs(&fitted, selection));
        found
            .chain(self.hystereses(selection))
            .map(|found| Entry::open(found.kept(), found))
            .collect()
    }

    /// Determines the alternatives of every selected effect. Returns the penalty per parameter, in the sum of squares.
    pub(super) fn compare(&self, selection: &mut Selection, also: &[Entry]) -> f64 {
        let mut stepwise = Stepwise::at(self, selection, also);
        stepwise.stand();
        let compared = (0..selection.named.len()).into_par_iter();
        let compared = compared.map(|k| stepwise.with_rivals(self, selection, k));
        selection.named = compared.collect();
        stepwise.penalty()
    }

    /// Adds a candidate to a hypothesis with the parameters `found`; `None` if the model is full. Returns the index of the effect and, for a
    /// correction, the previous priors.
    pub(super) fn joined(
        hypothesis: &mut Hypothesis,
        entry: &Entry,
        found: &[f64],
    ) -> Option<(usize, Option<Vec<Free>>)> {
        let joined = match entry.candidate.changes() {
            Some(effect) => (effect, Some(hypothesis.revise(effect))),
            None => (put(hypothesis, &entry.candidate, entry.kept, found)?, None),
        };
        // Selected effects come first: of two dependent columns the later one is dropped, but parameters with a stated uncertainty are fitted in any
        // case.
        hypothesis.free.sort_by_key(|free| free.belief == Belief::Stated);
        Some(joined)
    }

    /// The nonlinear fit with the selected effects.
    pub(super) fn fitted(
        &self,
        stepwise: &Stepwise<'_>,
        before: &Fit,
        effort: Effort,
    ) -> Selection {
        let mut hypothesis = self.known.clone();
        let mut chosen = Vec::new();
        for entry in &stepwise.chosen {
            let gain = stepwise.gram.gains(*entry);
            let entry = &stepwise.entries[*entry];
            if let Some((effect, stated)) = Self::joined(&mut hypothesis, entry, &gain.found) {
                chosen.push(Selected {
                    candidate: entry.candidate.clone(),
                    effect,
                    stated,
                    kept: entry.kept,
                    spared: entry.spared,
                    gain: 0.5 * gain.gain / before.design_effect,
                    margin: 0.5 * stepwise.improvement(&gain, entry),
                    numbers: gain.numbers + entry.searched(),
                    share: 1.0,
                    rivals: Vec::new(),
                    variants: Vec::new(),
                });
            }
        }
        // After a large step the residual of the first iterations is not noise: it is reduced first, with the weights and noise level of the fit
        // before.
        let near = compare(self.campaign, &hypothesis, before, self.settings.used);
        let settings = Settings { from: Some(&near.surroundings), effort, ..self.settings };
        Selection { fit: fit(self.campaign, &near.hypothesis, &settings), named: chosen }
    }
}

/// Columns of the fit that are always included (indices among the fitted columns), and the standard uncertainties that the model states of parameters
/// which a correction frees (index in that list, SI).
pub(super) fn nuisance(
    search: &Search<'_>,
    selection: &Selection,
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
        let revised =
            selection.named.iter().find(|one| one.stated.is_some() && one.effect == free.effect);
        match revised {
            None => places.push(place),
            Some(one) => {
                let said = one.stated.iter().flatten().find(|said| said.value == free.value);
                if let Some(said) = said {
                    stated.push((places.len(), said.sigma));
                    places.push(place);
                }
            }
        }
    }
    (places, stated)
}

/// The hypothesis of a fit without these effects.
pub(super) fn without(fit: &Fit, given: &Model, gone: &[&Selected]) -> Hypothesis {
    let mut hypothesis = fit.hypothesis.clone();
    let mut gone: Vec<&Selected> = gone.to_vec();
    // In descending order, so that the indices of the remaining ones stay valid.
    gone.sort_by_key(|one| std::cmp::Reverse(one.effect));
    for one in gone {
        match &one.stated {
            Some(stated) => hypothesis.restore(one.effect, given, stated),
            None => hypothesis = hypothesis.without(one.effect),
        }
    }
    hypothesis
}
