//! Which effects are missing or wrong: selection, replacement by better alternatives, and the alternatives of each selected effect.
//!
//! An effect is judged by its gain in log-likelihood less the penalty of its parameters, by the extended Bayesian information criterion;
//! one effect at a time, and each may be exchanged for every other. Nonlinear parameters are fitted after each selection, and the selection is repeated
//! with them.
//!
//! Alternatives are compared with the same weights and the same noise. Uses training rows only.

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

/// Rounds of the preselection.
const PRESELECTION_ROUNDS: usize = 3;
/// A rival within this many units of log-likelihood cannot be distinguished (docs/diagnosis.md).
pub(super) const ALIKE: f64 = 5.0;

/// Another name for what a finding explains.
#[derive(Clone, Debug)]
pub struct Rival {
    /// The effect, with the numbers that it would take.
    pub effect: AnyEffect,
    /// Whether it is a change of what the model has.
    pub changes: bool,
    /// By how much log-likelihood is lower with it; below zero: higher.
    pub behind: f64,
    /// Numbers that it takes.
    pub numbers: usize,
    /// Whether the recording, all of it, could not tell it from the name that it stands beside.
    pub alike: bool,
    /// Where it came from, at the numbers that it would take.
    pub(super) candidate: Candidate,
    /// The numbers of its probes.
    pub(super) found: Vec<f64>,
    /// Entries that a fit of it keeps.
    pub(super) kept: &'static [&'static str],
}

/// A name with its rivals.
#[derive(Clone, Debug)]
pub(super) struct Selected {
    pub(super) candidate: Candidate,
    /// Its place among the effects of the fit's model.
    pub(super) effect: usize,
    /// For a change of what the model has: what was believed of its numbers.
    pub(super) stated: Option<Vec<Free>>,
    /// Entries that no fit changes.
    pub(super) kept: &'static [&'static str],
    /// What its numbers need not pay, as in [`Entry`].
    pub(super) spared: f64,
    /// By how much log-likelihood is higher with it than without.
    pub(super) gain: f64,
    /// The same less what its numbers and the size of the library cost.
    pub(super) margin: f64,
    /// Numbers that it takes.
    pub(super) numbers: usize,
    /// The share of what was read that its rivals were weighed on.
    pub(super) share: f64,
    pub(super) rivals: Vec<Rival>,
    /// The same name with other settings, which the recording does not tell from these.
    pub(super) variants: Vec<AnyEffect>,
}

/// Everything that was named, and the fit with all of it.
pub(super) struct Selection {
    pub(super) fit: Fit,
    pub(super) named: Vec<Selected>,
}

impl Selection {
    /// Nothing is named yet.
    pub(super) fn none(fit: &Fit) -> Self {
        Self { fit: fit.clone(), named: Vec::new() }
    }

    /// The names but those that are `gone`, with the fit of these.
    pub(super) fn without(&self, gone: &[&Selected], fit: Fit) -> Self {
        let is_gone = |one: &Selected| gone.iter().any(|gone| std::ptr::eq(*gone, one));
        let mut named: Vec<Selected> =
            self.named.iter().filter(|one| !is_gone(one)).cloned().collect();
        // From the last place down, so that those before keep theirs.
        let mut gone: Vec<&&Selected> = gone.iter().collect();
        gone.sort_by_key(|one| std::cmp::Reverse(one.effect));
        gone.into_iter().for_each(|one| close_up(&mut named, one));
        Self { fit, named }
    }
}

/// Inputs of a selection run.
pub(super) struct Search<'a> {
    pub(super) campaign: &'a Campaign,
    /// The model as given, with what it says of its own doubt free.
    pub(super) known: &'a Hypothesis,
    pub(super) settings: Settings<'a>,
    pub(super) library: &'a [Candidate],
    /// How the tool moves with each candidate of the library.
    pub(super) cache: &'a JacobianCache,
}

/// Names after the first rounds of choosing and fitting from where nothing is named, until they are `many` or stand; and what was asked besides the library.
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

/// The same; rivals that are better once they are fitted take a name's place.
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

/// Names under noise that is told otherwise than when `first` was named: from nothing, which a `bare` model leaves, and from there. Noise that remembers itself
/// hides from single steps what an arm with many things amiss lacks first, while names that stand are taken out again where they are worth nothing.
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
    /// What a rival pays, in log-likelihood, for the numbers that it takes beyond these and for its word: the fewest win, unless the evidence differs by
    /// more than [`ALIKE`] (docs/reference/effects.md), of which the rows that were asked hold their share, beyond what as many numbers gain by chance.
    /// `penalty`: of a number, in the sum of squares.
    pub(super) fn dearer(&self, rival: &Rival, penalty: f64) -> f64 {
        let more = rival.numbers as f64 - self.numbers as f64;
        let most = ALIKE * self.share + 0.5 * more.abs();
        let numbers = 0.5 * penalty * more;
        let own = self.candidate.probes.first();
        let word = own.and_then(|own| of_word(&own.effect, &rival.effect, numbers));
        word.unwrap_or(numbers.clamp(-most, most))
    }
}

/// The places of effects once `gone` has left the model; a change leaves none.
pub(super) fn close_up(named: &mut [Selected], gone: &Selected) {
    if gone.stated.is_none() {
        named.iter_mut().filter(|one| one.effect > gone.effect).for_each(|one| one.effect -= 1);
    }
}

pub(super) type Title = (&'static str, Option<usize>, bool);

/// Kind, joint, and whether it changes what is there.
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
    /// The share of what was read that is used.
    pub(super) fn share(&self) -> f64 {
        let read = |pose: usize| !self.campaign.poses[pose].seen.is_empty();
        let all = (0..self.campaign.poses.len()).filter(|pose| read(*pose)).count();
        let used = self.settings.used.iter().enumerate();
        let used = used.filter(|(pose, used)| **used && read(*pose)).count();
        used as f64 / all.max(1) as f64
    }

    /// Candidates besides the library: modes, springs and hystereses that are searched in the residual of `selection`.
    pub(super) fn searched(&self, selection: &Selection) -> Vec<Entry> {
        let fitted = Fitted::new(self.campaign, &selection.fit, &self.settings);
        let found = modes(&fitted, self.cache).into_iter().chain(self.springs(&fitted, selection));
        found
            .chain(self.hystereses(selection))
            .map(|found| Entry::open(found.kept(), found))
            .collect()
    }

    /// Finds every name's rivals; gives the penalty of a number, in the sum of squares.
    pub(super) fn compare(&self, selection: &mut Selection, also: &[Entry]) -> f64 {
        let mut stepwise = Stepwise::at(self, selection, also);
        stepwise.stand();
        let compared = (0..selection.named.len()).into_par_iter();
        let compared = compared.map(|k| stepwise.with_rivals(self, selection, k));
        selection.named = compared.collect();
        stepwise.penalty()
    }

    /// Adds a candidate to a hypothesis; none where there is no room.
    pub(super) fn joined(
        hypothesis: &mut Hypothesis,
        entry: &Entry,
        found: &[f64],
    ) -> Option<(usize, Option<Vec<Free>>)> {
        let joined = match entry.candidate.changes() {
            Some(effect) => (effect, Some(hypothesis.revise(effect))),
            None => (put(hypothesis, &entry.candidate, entry.kept, found)?, None),
        };
        // What was named is asked of the data before what is believed: a belief is in the fit whether the data show it or not.
        hypothesis.free.sort_by_key(|free| free.belief == Belief::Stated);
        Some(joined)
    }

    /// The fit with what was chosen.
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
        // A step that goes far ends near only after a few more: until then what it leaves is no noise.
        let near = compare(self.campaign, &hypothesis, before, self.settings.used);
        let settings = Settings { from: Some(&near.surroundings), effort, ..self.settings };
        Selection { fit: fit(self.campaign, &near.hypothesis, &settings), named: chosen }
    }
}

/// Columns of the fit that are always in, and the doubt that the model states of those that the fit frees from it.
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

/// The fit's hypothesis without these.
pub(super) fn without(fit: &Fit, given: &Model, gone: &[&Selected]) -> Hypothesis {
    let mut hypothesis = fit.hypothesis.clone();
    let mut gone: Vec<&Selected> = gone.to_vec();
    // From the last place down, so that those before keep theirs.
    gone.sort_by_key(|one| std::cmp::Reverse(one.effect));
    for one in gone {
        match &one.stated {
            Some(stated) => hypothesis.restore(one.effect, given, stated),
            None => hypothesis = hypothesis.without(one.effect),
        }
    }
    hypothesis
}
