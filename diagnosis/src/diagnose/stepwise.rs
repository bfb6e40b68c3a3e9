//! Stepwise selection on linearised rows: adds, removes and exchanges effects until no single step lowers the criterion; then finds the alternatives of each.
//!
//! Among equally good candidates the earlier one in the library is taken. Sees the data only through the products in [`Gram`]; the same products give the same
//! selection.

use super::gram::{Entry, Gain, Gram};
use super::judge::words;
use super::selection::{ALIKE, Rival, Search, Selected, Selection, nuisance, title, without};
use crate::candidates::{Candidate, Probe, is_sound, wave_candidate};
use crate::fit::compare;
use crate::hypothesis::named;
use crate::motions::is_about_loads;
use crate::score::Fitted;
use crate::waves::lines;
use physics::spec::Range;
use physics::{AnyEffect, Model};
use std::sync::OnceLock;

/// Steps of adding, taking out and exchanging.
const STEPS: usize = 120;
/// Rivals of a name that are fitted, the best first; fewer where there are so many names that all of theirs would be more than this.
const FITTED: usize = 4;
const FITTED_OF_ALL: usize = 24;
/// A rival that is further behind than this share of the gain stays there whatever its nonlinear numbers.
const BEHIND: f64 = 0.2;
/// Other settings of the same name that are behind by less, in the sum of squares, are not told from its own: a 95 % interval holds them.
const VARIANT: f64 = 3.84;
/// A common name of two that the products, which are linear, put further behind, in the sum of squares and as a share of what the two bring, no fit brings back.
const LINEAR: f64 = 20.0;
const LINEAR_SHARE: f64 = 3e-3;
/// A number is as unsure as so many standard deviations.
const UNSURE: f64 = 2.0;
/// Names that are better by less than this are as good: the earlier in the library is said.
const TIE: f64 = 1e-3;

/// A selection under way, where a fit stands.
#[derive(Clone)]
pub(super) struct Stepwise<'a> {
    given: &'a Model,
    pub(super) entries: Vec<Entry>,
    pub(super) gram: Gram,
    /// What was named before, at its own numbers, in that order.
    pub(super) standing: Vec<usize>,
    pub(super) chosen: Vec<usize>,
    design_effect: f64,
    readings: f64,
    /// The sum of squares of a fit with all names, once a rival was fitted.
    whole: OnceLock<f64>,
}

impl<'a> Stepwise<'a> {
    pub(super) fn at(search: &Search<'a>, selection: &Selection, also: &[Entry]) -> Self {
        let Selection { fit, named } = selection;
        let fitted = Fitted::new(search.campaign, fit, &search.settings);
        let arm = &fit.hypothesis.model.arm;
        let moves = search.cache.moves(&fitted, search.library);
        let of_library = search.library.iter().zip(moves).map(|(candidate, moves)| Entry {
            moves: Some(moves),
            ..Entry::open(candidate.kept(), candidate.clone())
        });
        let mut entries: Vec<Entry> = of_library.collect();
        let mut own = Vec::with_capacity(named.len());
        for one in named {
            let effect = fit.hypothesis.model.effects().nth(one.effect);
            let had =
                &search.known.model.effects().nth(one.effect).filter(|_| one.stated.is_some());
            let had = had.map_or(&[][..], |had| had.values());
            // Every name has an entry, so that those that stand are in the order of the names.
            let bare = || (one.candidate.clone(), vec![0.0; one.candidate.probes.len()]);
            let (candidate, stands) =
                effect.map_or_else(bare, |effect| one.candidate.standing(arm, effect, had));
            // The change stands for itself; any other is one more number of its kind that is tried.
            entries.retain(|e| {
                candidate.changes().is_none() || e.candidate.changes() != candidate.changes()
            });
            let open = Entry::open(one.kept, candidate);
            own.push(Entry { stands, spared: one.spared, ..open });
        }
        let standing = (entries.len()..entries.len() + own.len()).collect();
        entries.extend(own);
        entries.extend_from_slice(also);
        for line in lines(&fitted) {
            let found = wave_candidate(arm, line.joint, line.cycles);
            entries.extend(found.map(|candidate| Entry::open(&[], candidate)));
        }
        let (nuisance, stated) = nuisance(search, selection);
        Self {
            given: &search.known.model,
            gram: Gram::of(&fitted, &entries, &nuisance, &stated),
            entries,
            standing,
            chosen: Vec::new(),
            design_effect: fit.design_effect,
            readings: (fit.readings as f64 / fit.design_effect).max(2.0),
            whole: OnceLock::new(),
        }
    }

    /// What a number costs, in the sum of squares.
    pub(super) fn penalty(&self) -> f64 {
        self.readings.ln()
    }

    /// A gain less what its numbers cost, in the sum of squares.
    pub(super) fn improvement(&self, gain: &Gain, entry: &Entry) -> f64 {
        let tried = self.entries.len().max(1) as f64;
        let numbers = (gain.numbers + entry.searched()) as f64;
        gain.gain / self.design_effect - numbers * self.penalty() + entry.spared - 2.0 * tried.ln()
    }

    /// What is left and what the numbers cost: the sum of squares that every step lowers.
    pub(super) fn cost(&self) -> f64 {
        let tried = 2.0 * (self.entries.len().max(1) as f64).ln();
        let numbers = |place: &usize| {
            (self.gram.gains(*place).numbers + self.entries[*place].searched()) as f64
        };
        let cost =
            |place: &usize| numbers(place) * self.penalty() + tried - self.entries[*place].spared;
        self.gram.rest() / self.design_effect + self.chosen.iter().map(cost).sum::<f64>()
    }

    /// Steps from what is chosen so far until none helps.
    pub(super) fn make(&mut self) {
        for _ in 0..STEPS {
            if !self.step() {
                break;
            }
        }
    }

    /// One step; says whether there was one.
    pub(super) fn step(&mut self) -> bool {
        self.take_out() || self.add() || self.exchange()
    }

    /// What is new of all that was chosen but `but`.
    fn beside(&self, but: &[usize]) -> Vec<&Candidate> {
        let others = self.chosen.iter().filter(|entry| !but.contains(entry));
        let others = others.map(|entry| &self.entries[*entry].candidate);
        others.filter(|other| other.changes().is_none()).collect()
    }

    /// Whether a candidate may stand beside these: no other name of one of them, and what it works upon is there.
    fn fits(&self, candidate: &Candidate, beside: &[&Candidate]) -> bool {
        let gives_way = |effect: &AnyEffect| {
            effect.joint() == candidate.joint
                && ["joint_compliance", "gravity_compliance", "load_compliance"]
                    .contains(&effect.spec().kind)
        };
        let needs_ground = candidate
            .probes
            .first()
            .is_some_and(|probe| matches!(probe.effect, AnyEffect::StiffnessHardening(_)));
        let grounded = !needs_ground
            || beside.iter().flat_map(|other| other.probes.first()).any(|p| gives_way(&p.effect))
            || self.given.effects().any(gives_way);
        grounded && !beside.iter().any(|other| candidate.is_rival_to(other))
    }

    /// What could stand beside all that was chosen but `but`, best first; of equals the earlier in the library.
    fn open(&self, gram: &Gram, but: &[usize]) -> Vec<(usize, Gain, f64)> {
        let beside = self.beside(but);
        let mut open = Vec::new();
        for (place, entry) in self.entries.iter().enumerate() {
            if !self.fits(&entry.candidate, &beside) || self.chosen.contains(&place) {
                continue;
            }
            let Some(mut gain) = gram.would_gain(place) else { continue };
            let Some(found) = self.sound(&entry.candidate, &gain) else { continue };
            gain.found = found;
            let worth = self.improvement(&gain, entry);
            open.push((place, gain, worth));
        }
        let step = |worth: f64| (worth / TIE).round();
        open.sort_by(|a, b| step(b.2).total_cmp(&step(a.2)).then(a.0.cmp(&b.0)));
        open
    }

    /// What was found where it may lie: a number that is no further beyond its range than it is unsure ends there, and so does one between two ends, since
    /// products overshoot where a fit does not (`1 / (1 + s)` of a sensor's scale). None where one is further.
    fn sound(&self, candidate: &Candidate, gain: &Gain) -> Option<Vec<f64>> {
        let unsure = UNSURE * self.design_effect.sqrt();
        let mut found = gain.found.clone();
        for ((probe, value), sigma) in candidate.probes.iter().zip(&mut found).zip(&gain.sigma) {
            let range = named(&probe.effect, probe.value).map(|named| named.parameter.range);
            let within = range.map_or(*value, |range| range.nearest(*value));
            let is_between = matches!(range, Some(Range::Between(..)));
            let is_near = (within - *value).abs() < unsure * sigma || is_between;
            if !candidate.is_one_mass() && is_near {
                *value = within;
            }
        }
        (is_sound(candidate, &found) && !self.leads(candidate, &found)).then_some(found)
    }

    /// Whether a joint would lead its command: that is what a measurement that comes too early and a lag of the others say together, and none does.
    fn leads(&self, candidate: &Candidate, found: &[f64]) -> bool {
        let is = |one: &Candidate, kind| title(one).is_some_and(|title| title.0 == kind);
        let comes_early = |found: &[f64]| found.iter().any(|delay| *delay < 0.0);
        let mut chosen = self.chosen.iter().map(|place| (place, &self.entries[*place].candidate));
        if is(candidate, "time_delay") {
            return comes_early(found) && chosen.any(|(_, other)| is(other, "servo_lag"));
        }
        let early = |(place, other): (&usize, &Candidate)| {
            is(other, "time_delay") && comes_early(&self.gram.gains(*place).found)
        };
        is(candidate, "servo_lag") && chosen.any(early)
    }

    fn add(&mut self) -> bool {
        let best = self.open(&self.gram, &[]).into_iter().next();
        let Some((place, ..)) = best.filter(|(_, _, worth)| *worth > 0.0) else { return false };
        self.gram.add(place);
        self.chosen.push(place);
        true
    }

    /// Takes out what is worth least, if it is worth nothing or lies where it may not.
    fn take_out(&mut self) -> bool {
        let worth = |(at, place): (usize, &usize)| {
            let gain = self.gram.gains(*place);
            let entry = &self.entries[*place];
            let sound = self.sound(&entry.candidate, &gain).is_some();
            (at, if sound { self.improvement(&gain, entry) } else { f64::NEG_INFINITY })
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
            let own = self.improvement(&self.gram.gains(place), &self.entries[place]);
            let mut gram = self.gram.clone();
            gram.remove(place);
            let best = self.open(&gram, &[place]).into_iter().next();
            if let Some((other, ..)) = best.filter(|(_, _, worth)| *worth > own + 2.0 * TIE) {
                gram.add(other);
                self.gram = gram;
                self.chosen[at] = other;
                return true;
            }
        }
        false
    }

    /// Gives two effects of one joint the common name that costs the least, if it is near enough for a fit to tell: alone, neither would leave for it.
    pub(super) fn merge(&mut self) -> bool {
        let own = self.cost();
        let (mut least, mut best) = (f64::INFINITY, None);
        let pairs = (1..self.chosen.len()).flat_map(|second| (0..second).map(move |k| (k, second)));
        for (first, second) in pairs {
            let pair = [self.chosen[first], self.chosen[second]];
            let [one, other] = pair.map(|place| self.entries[place].candidate.joint);
            if one.is_none() || one != other {
                continue;
            }
            let mut merged = self.clone();
            pair.iter().for_each(|place| merged.gram.remove(*place));
            let brings = (merged.gram.rest() - self.gram.rest()) / self.design_effect;
            // Either by itself was tried before the other was named.
            let names = pair.map(|place| title(&self.entries[place].candidate));
            let mut open = self.open(&merged.gram, &pair).into_iter();
            let other = open.find(|o| !names.contains(&title(&self.entries[o.0].candidate)));
            let Some((place, ..)) = other else { continue };
            merged.gram.add(place);
            merged.chosen.retain(|place| !pair.contains(place));
            merged.chosen.push(place);
            let cost = merged.cost();
            if cost < least.min(own + LINEAR.max(LINEAR_SHARE * brings)) {
                (least, best) = (cost, Some(merged));
            }
        }
        let found = best.is_some();
        if let Some(merged) = best {
            *self = merged;
        }
        found
    }

    /// Brings in what was named.
    pub(super) fn stand(&mut self) {
        self.put(self.standing.clone());
    }

    /// Brings in the entries in these places.
    pub(super) fn put(&mut self, places: Vec<usize>) {
        for place in places {
            self.gram.add(place);
            self.chosen.push(place);
        }
    }

    /// What was named in place `k`, with its rivals; those whose nonlinear numbers might bring them near are fitted.
    pub(super) fn with_rivals(
        &self,
        search: &Search<'_>,
        selection: &Selection,
        k: usize,
    ) -> Selected {
        let own = self.chosen[k];
        let gain = self.gram.gains(own);
        let mut gram = self.gram.clone();
        gram.remove(own);
        let mut seen = vec![title(&self.entries[own].candidate)];
        let (mut near, mut variants) = (Vec::new(), Vec::new());
        let arm = &selection.fit.hypothesis.model.arm;
        for (place, would, _) in self.open(&gram, &[own]) {
            let entry = &self.entries[place];
            let name = title(&entry.candidate);
            let behind = (gain.gain - would.gain) / self.design_effect;
            let is_variant = name == seen[0] && !entry.kept.is_empty() && entry.searched() == 0;
            if is_variant && behind < VARIANT {
                variants.extend(entry.candidate.effect(arm, &would.found));
            }
            // Play that no row has crossed yet looks unlike what its width will make of it.
            let is_word = words(&self.entries[own].candidate, &entry.candidate);
            let may_come = behind < 2.0 * ALIKE + BEHIND * gain.gain / self.design_effect;
            if !seen.contains(&name) && (may_come || is_word) {
                seen.push(name);
                near.insert(if is_word { 0 } else { near.len() }, (place, would));
            }
        }
        let fitted = FITTED.min(FITTED_OF_ALL / selection.named.len().max(1)).max(1);
        let mut rivals = Vec::new();
        for (place, would) in near.into_iter().take(fitted) {
            let rival = self.rival(search, selection, k, place, &would, gain.gain);
            rivals.extend(rival.filter(|rival| rival.behind < 2.0 * ALIKE));
        }
        rivals.sort_by(|a, b| a.behind.total_cmp(&b.behind));
        Selected {
            margin: 0.5 * self.improvement(&gain, &self.entries[own]),
            gain: 0.5 * gain.gain / self.design_effect,
            numbers: gain.numbers + self.entries[own].searched(),
            share: search.share(),
            rivals,
            variants,
            ..selection.named[k].clone()
        }
    }
}

impl Stepwise<'_> {
    /// What the entry in `place` would be in the stead of what was named in place `k`; fitted where it has numbers that are not linear.
    fn rival(
        &self,
        search: &Search<'_>,
        selection: &Selection,
        k: usize,
        place: usize,
        would: &Gain,
        own: f64,
    ) -> Option<Rival> {
        let entry = &self.entries[place];
        let fit = &selection.fit;
        let arm = &fit.hypothesis.model.arm;
        let numbers = would.numbers + entry.searched();
        let changes = entry.candidate.changes();
        let told = |behind: f64, effect, candidate, found| Rival {
            effect,
            changes: changes.is_some(),
            behind,
            numbers,
            alike: behind < ALIKE * search.share(),
            candidate,
            found,
            kept: entry.kept,
        };
        let named = &selection.named[k];
        if !self.bends(named, entry) {
            let behind = 0.5 * (own - would.gain) / self.design_effect;
            let effect = entry.candidate.effect(arm, &would.found)?;
            return Some(told(behind, effect, entry.candidate.clone(), would.found.clone()));
        }
        let mut hypothesis = without(fit, &search.known.model, &[named]);
        let (at, _) = Search::joined(&mut hypothesis, entry, &would.found)?;
        let whole = *self.whole.get_or_init(|| {
            compare(search.campaign, &fit.hypothesis, fit, search.settings.used).sum
        });
        let fitted = compare(search.campaign, &hypothesis, fit, search.settings.used);
        let effect = *fitted.hypothesis.model.effects().nth(at)?;
        let behind = 0.5 * (fitted.sum - whole) / self.design_effect;
        let (candidate, found) = match changes {
            Some(_) => (entry.candidate.clone(), would.found.clone()),
            None => entry.candidate.standing(arm, &effect, &[]),
        };
        Some(told(behind, effect, candidate, found))
    }

    /// Whether the products, which are linear, do not tell enough of a rival: numbers that bend, or loads that act through what gives way.
    fn bends(&self, named: &Selected, rival: &Entry) -> bool {
        let is_about_loads = |candidate: &Candidate| {
            candidate.probes.first().is_some_and(|probe| is_about_loads(probe.effect.spec()))
        };
        let both = is_about_loads(&rival.candidate) && is_about_loads(&named.candidate);
        // A gap that has a width is not crossed at once, as one without is.
        let is_gap = |probe: &Probe| matches!(probe.effect, AnyEffect::Backlash(_));
        let is_gap = rival.candidate.probes.first().is_some_and(is_gap);
        rival.searched() > 0 || rival.candidate.changes().is_some() || both || is_gap
    }
}
