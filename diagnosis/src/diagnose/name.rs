//! Which effects are missing or wrong: the best one first, then what is left; what a later one made needless goes again; what another name explains
//! better is renamed; every name with its rivals.
//!
//! A name is worth its gain in log-likelihood less what its numbers cost, by the extended Bayesian information criterion, as in [`mod@crate::select`];
//! here one at a time, and every name may be exchanged for every other. Numbers that are not linear are fitted after each choice, and the choice is made anew
//! with them.
//!
//! Promises: sums of rivals are compared with the same weights and the same noise. Never: a look at held-out poses.

use super::gram::{Entry, Gain, Gram};
use crate::campaign::Campaign;
use crate::candidates::{Candidate, wave_candidate};
use crate::fit::{Effort, Settings, compare, fit};
use crate::hypothesis::{Free, Hypothesis, named};
use crate::result::Fit;
use crate::score::Fitted;
use crate::select::is_sound;
use crate::waves::lines;
use physics::spec::Role;
use physics::{AnyEffect, Model};

/// Rounds of choosing and fitting.
const ROUNDS: usize = 4;
/// Steps of adding, taking out and exchanging.
const STEPS: usize = 120;
/// Rivals that are fitted, the best first.
const FITTED: usize = 4;
/// A rival that is further behind than this share of the gain stays there whatever its nonlinear numbers.
const BEHIND: f64 = 0.2;
/// A rival within this many units of log-likelihood cannot be told apart (contract `diagnosis.md`).
pub(super) const ALIKE: f64 = 5.0;
/// Names that are better by less than this are as good: the earlier in the library is said.
const TIE: f64 = 1e-3;

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
    kept: &'static [&'static str],
    /// By how much log-likelihood is higher with it than without.
    pub(super) gain: f64,
    /// Numbers that it takes.
    pub(super) numbers: usize,
    pub(super) rivals: Vec<Rival>,
}

/// Everything that was named, and the fit with all of it.
pub(super) struct Naming {
    pub(super) fit: Fit,
    pub(super) named: Vec<Named>,
}

/// What is asked, of whom.
pub(super) struct Asking<'a> {
    pub(super) campaign: &'a Campaign,
    /// The model as given, with what it says of its own doubt free.
    pub(super) known: &'a Hypothesis,
    pub(super) settings: Settings<'a>,
    pub(super) library: &'a [Candidate],
}

/// Names what the poses that take part ask for beyond `base`.
pub(super) fn name(asking: &Asking<'_>, base: &Fit) -> Naming {
    let mut naming = Naming { fit: base.clone(), named: Vec::new() };
    for _ in 0..ROUNDS {
        let before = titles(&naming.named);
        let mut choice = Choice::at(asking, &naming);
        choice.make();
        naming = asking.fitted(&choice, &naming.fit, Effort::Sketch);
        if titles(&naming.named) == before {
            break;
        }
    }
    let settings = Settings { from: Some(&naming.fit.surroundings.clone()), ..asking.settings };
    naming.fit = fit(asking.campaign, &naming.fit.hypothesis, &settings);
    let mut choice = Choice::at(asking, &naming);
    // What was named stands at the end of the entries, before the lines.
    choice.stand(&naming.named);
    for k in 0..naming.named.len() {
        choice.compare_rivals(asking, &mut naming, k);
    }
    naming
}

type Title = (&'static str, Option<usize>, bool);

/// Kind, joint, and whether it changes what is there.
fn title(candidate: &Candidate) -> Option<Title> {
    let effect = candidate.probes.first()?.effect;
    Some((effect.spec().kind, effect.joint(), candidate.changes().is_some()))
}

fn titles(named: &[Named]) -> Vec<Option<Title>> {
    let mut titles: Vec<Option<Title>> = named.iter().map(|one| title(&one.candidate)).collect();
    titles.sort_unstable();
    titles
}

impl Asking<'_> {
    fn given(&self) -> &Model {
        &self.known.model
    }

    /// Adds a candidate to a hypothesis; none where there is no room.
    fn joined(
        hypothesis: &mut Hypothesis,
        entry: &Entry,
        found: &[f64],
    ) -> Option<(usize, Option<Vec<Free>>)> {
        if let Some(effect) = entry.candidate.changes() {
            return Some((effect, Some(hypothesis.revise(effect))));
        }
        let effect = entry.candidate.effect(&hypothesis.model.arm, found)?;
        let place = hypothesis.model.effects().len();
        hypothesis.add(effect, entry.kept).ok()?;
        // What was found is where the search starts; what is believed before the data is nothing.
        for free in hypothesis.free.iter_mut().filter(|free| free.effect == place) {
            let linear = named(&effect, free.value)
                .is_some_and(|named| named.parameter.role == Role::Linear);
            free.mean = if linear { 0.0 } else { free.mean };
        }
        Some((place, None))
    }

    /// The fit with what was chosen.
    fn fitted(&self, choice: &Choice, before: &Fit, effort: Effort) -> Naming {
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
                    gain: 0.5 * gain.gain / before.design_effect,
                    numbers: gain.numbers,
                    rivals: Vec::new(),
                });
            }
        }
        let settings = Settings { from: Some(&before.surroundings), effort, ..self.settings };
        Naming { fit: fit(self.campaign, &hypothesis, &settings), named: chosen }
    }
}

/// A choice under way, where a fit stands.
struct Choice {
    entries: Vec<Entry>,
    gram: Gram,
    chosen: Vec<usize>,
    design_effect: f64,
    readings: f64,
}

impl Choice {
    fn at(asking: &Asking<'_>, naming: &Naming) -> Self {
        let Naming { fit, named } = naming;
        let fitted = Fitted::new(asking.campaign, fit, &asking.settings);
        let arm = &fit.hypothesis.model.arm;
        let mut entries: Vec<Entry> = asking
            .library
            .iter()
            .map(|c| Entry {
                stands: vec![0.0; c.probes.len()],
                candidate: c.clone(),
                kept: c.kept(),
            })
            .collect();
        for one in named {
            let Some(effect) = fit.hypothesis.model.effects().nth(one.effect) else { continue };
            let had = asking.given().effects().nth(one.effect).filter(|_| one.stated.is_some());
            let had = had.map_or(&[][..], |had| had.values());
            let (candidate, stands) = one.candidate.standing(arm, effect, had);
            // The change stands for itself; any other is one more number of its kind that is tried.
            entries.retain(|e| {
                candidate.changes().is_none() || e.candidate.changes() != candidate.changes()
            });
            entries.push(Entry { candidate, stands, kept: one.kept });
        }
        for line in lines(&fitted) {
            let found = wave_candidate(arm, line.joint, line.cycles);
            entries.extend(found.map(|candidate| Entry {
                stands: vec![0.0; candidate.probes.len()],
                candidate,
                kept: &[],
            }));
        }
        let (nuisance, stated) = nuisance(asking, naming);
        Self {
            gram: Gram::of(&fitted, &entries, &nuisance, &stated),
            entries,
            chosen: Vec::new(),
            design_effect: fit.design_effect,
            readings: (fit.readings as f64 / fit.design_effect).max(2.0),
        }
    }

    /// A gain less what its numbers cost, in the sum of squares.
    fn worth(&self, gain: &Gain) -> f64 {
        let tried = self.entries.len().max(1) as f64;
        gain.gain / self.design_effect - gain.numbers as f64 * self.readings.ln() - 2.0 * tried.ln()
    }

    fn make(&mut self) {
        for _ in 0..STEPS {
            let moved = self.take_out() || self.add() || self.exchange();
            if !moved {
                break;
            }
        }
    }

    /// Slots of all that was chosen but `but`.
    fn taken(&self, but: Option<usize>) -> Vec<&str> {
        let others = self.chosen.iter().filter(|entry| Some(**entry) != but);
        others.map(|entry| self.entries[*entry].candidate.slot.as_str()).collect()
    }

    /// What could stand beside all that was chosen but `but`, best first; of equals the earlier in the library.
    fn open(&self, gram: &Gram, but: Option<usize>) -> Vec<(usize, Gain, f64)> {
        let taken = self.taken(but);
        let mut open = Vec::new();
        for (place, entry) in self.entries.iter().enumerate() {
            if taken.contains(&entry.candidate.slot.as_str()) || self.chosen.contains(&place) {
                continue;
            }
            let Some(gain) = gram.would_gain(place) else { continue };
            if is_sound(&entry.candidate, &gain.found) {
                let worth = self.worth(&gain);
                open.push((place, gain, worth));
            }
        }
        let step = |worth: f64| (worth / TIE).round();
        open.sort_by(|a, b| step(b.2).total_cmp(&step(a.2)).then(a.0.cmp(&b.0)));
        open
    }

    fn add(&mut self) -> bool {
        let best = self.open(&self.gram, None).into_iter().next();
        let Some((place, ..)) = best.filter(|(_, _, worth)| *worth > 0.0) else { return false };
        self.gram.add(place);
        self.chosen.push(place);
        true
    }

    /// Takes out what is worth least, if it is worth nothing or lies where it may not.
    fn take_out(&mut self) -> bool {
        let worth = |(at, place): (usize, &usize)| {
            let gain = self.gram.gains(*place);
            let sound = is_sound(&self.entries[*place].candidate, &gain.found);
            (at, if sound { self.worth(&gain) } else { f64::NEG_INFINITY })
        };
        let least = self.chosen.iter().enumerate().map(worth).min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((at, _)) = least.filter(|(_, worth)| *worth <= 0.0) else { return false };
        let place = self.chosen.remove(at);
        self.gram.remove(place);
        true
    }

    /// Gives the first effect that has one a better name.
    fn exchange(&mut self) -> bool {
        for at in 0..self.chosen.len() {
            let place = self.chosen[at];
            let own = self.worth(&self.gram.gains(place));
            let mut gram = self.gram.clone();
            gram.remove(place);
            let best = self.open(&gram, Some(place)).into_iter().next();
            if let Some((other, ..)) = best.filter(|(_, _, worth)| *worth > own + 2.0 * TIE) {
                gram.add(other);
                self.gram = gram;
                self.chosen[at] = other;
                return true;
            }
        }
        false
    }

    /// Brings in what was named.
    fn stand(&mut self, named: &[Named]) {
        for one in named {
            let is_it = |entry: &Entry| {
                title(&entry.candidate) == title(&one.candidate)
                    && (entry.stands.iter().any(|x| *x != 0.0) || one.stated.is_some())
            };
            // Every name has an entry at its own numbers.
            let place = self.entries.iter().position(is_it).unwrap_or_default();
            self.gram.add(place);
            self.chosen.push(place);
        }
    }

    /// The rivals of what was named in place `k`; those whose nonlinear numbers might bring them near are fitted.
    fn compare_rivals(&self, asking: &Asking<'_>, naming: &mut Naming, k: usize) {
        let own = self.chosen[k];
        let gain = self.gram.gains(own);
        let mut gram = self.gram.clone();
        gram.remove(own);
        let mut seen = vec![title(&self.entries[own].candidate)];
        let mut near = Vec::new();
        for (place, would, _) in self.open(&gram, Some(own)) {
            let name = title(&self.entries[place].candidate);
            let behind = (gain.gain - would.gain) / self.design_effect;
            let may_come = behind < 2.0 * ALIKE + BEHIND * gain.gain / self.design_effect;
            if !seen.contains(&name) && may_come {
                seen.push(name);
                near.push((place, would));
            }
        }
        let mut rivals = Vec::new();
        for (place, would) in near.into_iter().take(FITTED) {
            let rival = self.rival(asking, naming, k, place, &would, gain.gain);
            rivals.extend(rival.filter(|rival| rival.behind < 2.0 * ALIKE));
        }
        rivals.sort_by(|a, b| a.behind.total_cmp(&b.behind));
        let one = &mut naming.named[k];
        one.gain = 0.5 * gain.gain / self.design_effect;
        one.numbers = gain.numbers;
        one.rivals = rivals;
    }
}

impl Choice {
    /// What the entry in `place` would be in the stead of what was named in place `k`; fitted where it has numbers that are not linear.
    fn rival(
        &self,
        asking: &Asking<'_>,
        naming: &Naming,
        k: usize,
        place: usize,
        would: &Gain,
        own: f64,
    ) -> Option<Rival> {
        let entry = &self.entries[place];
        let changes = entry.candidate.changes().is_some();
        let numbers = would.numbers;
        let behind = 0.5 * (own - would.gain) / self.design_effect;
        let fit = &naming.fit;
        if let Some(change) = entry.candidate.changes() {
            let effect = *fit.hypothesis.model.effects().nth(change)?;
            return Some(Rival { effect, changes, behind, numbers });
        }
        let effect = entry.candidate.effect(&fit.hypothesis.model.arm, &would.found)?;
        let linear =
            |value| named(&effect, value).is_none_or(|named| named.parameter.role == Role::Linear);
        if (0..effect.values().len()).all(linear) || !entry.kept.is_empty() {
            return Some(Rival { effect, changes, behind, numbers });
        }
        let mut hypothesis = without(fit, asking.given(), &[&naming.named[k]]);
        let (at, _) = Asking::joined(&mut hypothesis, entry, &would.found)?;
        let whole = compare(asking.campaign, &fit.hypothesis, fit, asking.settings.used);
        let fitted = compare(asking.campaign, &hypothesis, fit, asking.settings.used);
        let effect = *fitted.hypothesis.model.effects().nth(at)?;
        let behind = 0.5 * (fitted.sum - whole.sum) / self.design_effect;
        Some(Rival { effect, changes, behind, numbers })
    }
}

/// Columns of the fit that are always in, and the doubt that the model states of those that the fit frees from it.
fn nuisance(asking: &Asking<'_>, naming: &Naming) -> (Vec<usize>, Vec<(usize, f64)>) {
    let fit = &naming.fit;
    let given = asking.given().effects().len();
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
