//! Which effects are missing or wrong: the best one first, then what is left; what a later one made needless goes again; what another name explains
//! better is renamed; every name with its rivals.
//!
//! A name is worth its gain in log-likelihood less what its numbers cost, by the extended Bayesian information criterion, as in [`mod@crate::select`];
//! here one at a time, and every name may be exchanged for every other. Numbers that are not linear are fitted after each choice, and the choice is made anew
//! with them.
//!
//! Promises: sums of rivals are compared with the same weights and the same noise. Never: a look at held-out poses.

use super::bank::Bank;
use super::choice::Choice;
use super::gram::Entry;
use super::judge::of_word;
use super::modes::modes;
use super::renaming::RENAMING;
use crate::campaign::Campaign;
use crate::candidates::Candidate;
use crate::fit::{Effort, Settings, compare, fit};
use crate::hypothesis::{Belief, Free, Hypothesis};
use crate::result::Fit;
use crate::score::Fitted;
use crate::select::put;
use physics::{AnyEffect, Model};
use rayon::prelude::*;

/// Rounds of a first glimpse.
const GLIMPSES: usize = 3;
/// A rival within this many units of log-likelihood cannot be told apart (contract `diagnosis.md`).
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
pub(super) struct Named {
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
pub(super) struct Naming {
    pub(super) fit: Fit,
    pub(super) named: Vec<Named>,
}

impl Naming {
    /// Nothing is named yet.
    pub(super) fn none(fit: &Fit) -> Self {
        Self { fit: fit.clone(), named: Vec::new() }
    }

    /// The names but those that are `gone`, with the fit of these.
    pub(super) fn without(&self, gone: &[&Named], fit: Fit) -> Self {
        let is_gone = |one: &Named| gone.iter().any(|gone| std::ptr::eq(*gone, one));
        let mut named: Vec<Named> =
            self.named.iter().filter(|one| !is_gone(one)).cloned().collect();
        // From the last place down, so that those before keep theirs.
        let mut gone: Vec<&&Named> = gone.iter().collect();
        gone.sort_by_key(|one| std::cmp::Reverse(one.effect));
        gone.into_iter().for_each(|one| close_up(&mut named, one));
        Self { fit, named }
    }
}

/// What is asked, of whom.
pub(super) struct Asking<'a> {
    pub(super) campaign: &'a Campaign,
    /// The model as given, with what it says of its own doubt free.
    pub(super) known: &'a Hypothesis,
    pub(super) settings: Settings<'a>,
    pub(super) library: &'a [Candidate],
    /// How the tool moves with each candidate of the library.
    pub(super) bank: &'a Bank,
}

/// Names after the first rounds of choosing and fitting from where nothing is named, until they are `many` or stand; and what was asked besides the library.
pub(super) fn glimpsed(asking: &Asking<'_>, base: &Fit, many: usize) -> (Naming, Vec<Entry>) {
    let mut naming = Naming::none(base);
    let also = asking.searched(&naming);
    for _ in 0..GLIMPSES {
        let Some(next) = asking.next(&naming, &also) else { break };
        let stands = titles(&next.named) == titles(&naming.named);
        naming = next;
        if stands || naming.named.len() >= many {
            break;
        }
    }
    (naming, also)
}

/// The same; rivals that are better once they are fitted take a name's place.
pub(super) fn name(asking: &Asking<'_>, start: Naming) -> Naming {
    let mut naming = start;
    for _ in 0..RENAMING {
        let also = asking.searched(&naming);
        naming = asking.merged(asking.settled(naming, &also));
        let price = asking.compare(&mut naming, &also);
        if !asking.rename(&mut naming, price) {
            break;
        }
    }
    naming
}

/// Names under noise that is told otherwise than when `first` was named: from nothing, which a `bare` model leaves, and from there. Noise that remembers itself
/// hides from single steps what an arm with many things amiss lacks first, while names that stand are taken out again where they are worth nothing.
pub(super) fn anew(asking: &Asking<'_>, bare: &Fit, first: Naming) -> Naming {
    let fresh = name(asking, Naming::none(bare));
    if titles(&fresh.named) == titles(&first.named) {
        return fresh;
    }
    let around = first.fit.surroundings.clone();
    let settings = Settings { from: Some(&around), ..asking.settings };
    let under = fit(asking.campaign, &first.fit.hypothesis, &settings);
    let kept = name(asking, Naming { fit: under, ..first });
    if asking.is_better(&kept, &fresh) { kept } else { fresh }
}

impl Named {
    /// What a rival pays, in log-likelihood, for the numbers that it takes beyond these and for its word: the fewest win, unless the evidence differs by
    /// more than [`ALIKE`] (contract `effects.md`), of which the rows that were asked hold their share, beyond what as many numbers gain by chance.
    /// `price`: of a number, in the sum of squares.
    pub(super) fn dearer(&self, rival: &Rival, price: f64) -> f64 {
        let more = rival.numbers as f64 - self.numbers as f64;
        let most = ALIKE * self.share + 0.5 * more.abs();
        let numbers = 0.5 * price * more;
        let own = self.candidate.probes.first();
        let word = own.and_then(|own| of_word(&own.effect, &rival.effect, numbers));
        word.unwrap_or(numbers.clamp(-most, most))
    }
}

/// The places of effects once `gone` has left the model; a change leaves none.
pub(super) fn close_up(named: &mut [Named], gone: &Named) {
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

pub(super) fn titles(named: &[Named]) -> Vec<Option<Title>> {
    let mut titles: Vec<Option<Title>> = named.iter().map(|one| title(&one.candidate)).collect();
    titles.sort_unstable();
    titles
}

impl Asking<'_> {
    /// The share of what was read that is used.
    pub(super) fn share(&self) -> f64 {
        let read = |pose: usize| !self.campaign.poses[pose].seen.is_empty();
        let all = (0..self.campaign.poses.len()).filter(|pose| read(*pose)).count();
        let used = self.settings.used.iter().enumerate();
        let used = used.filter(|(pose, used)| **used && read(*pose)).count();
        used as f64 / all.max(1) as f64
    }

    /// What is asked besides the library where `naming` stands: what is searched for in the rest.
    pub(super) fn searched(&self, naming: &Naming) -> Vec<Entry> {
        let fitted = Fitted::new(self.campaign, &naming.fit, &self.settings);
        let found = modes(&fitted, self.bank).into_iter().chain(self.springs(&fitted, naming));
        found.chain(self.hystereses(naming)).map(|found| Entry::open(found.kept(), found)).collect()
    }

    /// Finds every name's rivals; gives the price of a number, in the sum of squares.
    pub(super) fn compare(&self, naming: &mut Naming, also: &[Entry]) -> f64 {
        let mut choice = Choice::at(self, naming, also);
        choice.stand();
        let compared = (0..naming.named.len()).into_par_iter();
        let compared = compared.map(|k| choice.with_rivals(self, naming, k));
        naming.named = compared.collect();
        choice.price()
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
    pub(super) fn fitted(&self, choice: &Choice<'_>, before: &Fit, effort: Effort) -> Naming {
        let mut hypothesis = self.known.clone();
        let mut chosen = Vec::new();
        for entry in &choice.chosen {
            let gain = choice.gram.gains(*entry);
            let entry = &choice.entries[*entry];
            if let Some((effect, stated)) = Self::joined(&mut hypothesis, entry, &gain.found) {
                chosen.push(Named {
                    candidate: entry.candidate.clone(),
                    effect,
                    stated,
                    kept: entry.kept,
                    spared: entry.spared,
                    gain: 0.5 * gain.gain / before.design_effect,
                    margin: 0.5 * choice.worth(&gain, entry),
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
        Naming { fit: fit(self.campaign, &near.hypothesis, &settings), named: chosen }
    }
}

/// Columns of the fit that are always in, and the doubt that the model states of those that the fit frees from it.
pub(super) fn nuisance(asking: &Asking<'_>, naming: &Naming) -> (Vec<usize>, Vec<(usize, f64)>) {
    let fit = &naming.fit;
    let given = asking.known.model.effects().len();
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
            naming.named.iter().find(|one| one.stated.is_some() && one.effect == free.effect);
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
pub(super) fn without(fit: &Fit, given: &Model, gone: &[&Named]) -> Hypothesis {
    let mut hypothesis = fit.hypothesis.clone();
    let mut gone: Vec<&Named> = gone.to_vec();
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
