//! The result of a comparison of forces with a cut: effects with their parameters, improvement on the test set, residual, verdict.
//!
//! The test set is read here for the first time; it can only remove an effect. Effects that cannot be distinguished are not claimed.

use nalgebra::DMatrix;
use physics::Model;
use recording::series::Recording;
use std::collections::BTreeMap;

use super::case::{Belief, Case};
use super::found::{self, Weighed, with_instead};
use super::law::{LEAK, SCALE, Slot, TURN};
use super::laws;
use super::names::{BEYOND, KINDS, TONE};
use super::rest::{self, Rest};
use super::rows::Rows;
use super::sets;
use super::view::{Traced, has_one_feed, not_tested, notes, signal, traces};
use crate::engine::library::Family;
use crate::engine::normal_equations::Solved;
use crate::engine::stepwise::{Search, Selection, others};
use crate::engine::validation::{Listed, attributed, significant, size_of, supported};
use crate::engine::verdict::{Verdict, VerdictSettings, Weight, claimed, decide_verdict};
use crate::torque::{Finding, Refit};

/// A name that is likelier than all its rivals together by so much is a claim, its rivals told beside it.
const LIKELY: f64 = 0.95;
/// Rounds in which a likelier rival takes a name's place once all rows are seen.
const SWAPS: usize = 3;
/// One law says more than all names where it is worth more by this share, rows that train and rows held out together: names are the cut's own law to about as much.
const CLEARLY: f64 = 0.01;
/// And by so much more than chance makes of it, in log-likelihood.
const BY_CHANCE: f64 = 10.0;
/// The other numbers make one no less sure than this, as a ratio of variances, or it is not asked for.
const APART: f64 = 1e5;

/// Forces held against the told cut.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The verdict.
    pub verdict: Verdict,
    /// What is claimed, most important first; SI.
    pub findings: Vec<Finding>,
    /// Less probable than that: no claims. The fit, the proof and the model hold them too.
    pub candidates: Vec<Finding>,
    /// The model's own numbers of stated uncertainty, fitted along: no findings, but what the proof is with.
    pub refits: Vec<Refit>,
    /// Structure beyond them.
    pub unexplained: Option<Rest>,
    /// Held-out root mean square as told and with what was found, N.
    pub heldout: [f64; 2],
    /// What no effect explains, N.
    pub noise: f64,
    /// Of what was read, N.
    pub signal: f64,
    /// Rows that were compared.
    pub rows: usize,
    /// How rows were held out.
    pub says: String,
    /// What could not have shown, and why.
    pub not_tested: Vec<(&'static str, &'static str)>,
    /// What was done with the data, in words.
    pub notes: Vec<String>,
    /// Whether the feed was always the same.
    pub has_one_feed: bool,
    /// Whether the tool was ever in air.
    pub has_air: bool,
    /// Per axis that was recorded.
    pub traces: Vec<Traced>,
}

pub(super) fn finish(
    mut case: Case,
    model: &Model,
    recording: &Recording,
    rows: &Rows,
    names: &[usize],
) -> Compared {
    let seen = case.sets.seen();
    let (mut names, is_patched) = standing(&mut case, names, &seen);
    // A name is weighed in the form that was chosen, and told with all of its numbers.
    let mut weighed = reweighed(&mut case, &mut names, &seen);
    names = filled(&mut case, names, &seen);
    let products = case.products(&seen);
    let search = Search { library: &case.library, products: &products, always: &case.always };
    let selection = search.solve(&names);
    let rms = |solved: &Solved| case.rms(solved, &case.sets.test);
    let listed = attributed(&search, &selection, &rms);
    let covariance = case.covariance(&selection.solved, &seen);
    let is_tone = |one: &&Listed| case.library.families[one.name].kind == TONE;
    let hum = listed.iter().find(is_tone).map(|one| one.heldout);
    let stated = |kind: &str| model.effects().any(|effect| effect.spec().kind == kind);
    let finding = |one: Listed| {
        let family = &case.library.families[one.name];
        let own = search.own_columns(&selection, one.name);
        let weighed = weighed.remove(family.kind).filter(|_| family.kind != TONE)?;
        Some(Finding {
            kind: family.kind,
            joint: None,
            recording: None,
            is_change: stated(family.kind),
            numbers: found::numbers(&case, model, &search, &selection, family, &covariance),
            confidence: weighed.confidence,
            gain: weighed.gain,
            rivals: weighed.rivals,
            heldout: one.heldout,
            heldout_without: one.heldout_without,
            size: size_of(&case.table, &case.library.columns, &selection.solved, &own),
        })
    };
    let findings: Vec<Finding> = listed.into_iter().filter_map(finding).collect();
    let refits = refits(&case, model, &search, &selection, &covariance);
    let (law, given) = (rest::rest(&case, &search.columns(&names)), search.solve(&[]));
    let heldout = [&given, &selection].map(|one| rms(&one.solved));
    let creeping = rest::creeping(&case, &case.belief);
    let is_strange = is_patched || hum.is_some() || creeping.is_some();
    let verdict = verdict(&case, &findings, (&given, &selection), law.as_ref(), is_strange);
    let (findings, candidates) =
        claimed(verdict, findings, &VerdictSettings::DRIVE_OR_CUT, |one| one.confidence);
    let tone = hum.map(|held| a_tone(&case, held));
    let nameless = is_patched.then(|| beyond_names(heldout));
    let unexplained = tone.or(law).or(creeping).or(nameless);
    Compared {
        verdict,
        findings,
        candidates,
        refits,
        unexplained,
        heldout,
        noise: case.rms(&selection.solved, &seen),
        signal: signal(&case),
        rows: rows.at.len(),
        says: case.sets.says.clone(),
        not_tested: not_tested(&case),
        notes: notes(&case, recording),
        has_one_feed: has_one_feed(&case),
        has_air: case.law.rows.iter().any(|stood| !stood.cuts),
        traces: traces(&case),
    }
}

/// The effects that all rows outside the held-out ones support. Where they are only patches on something else: none, and `true`.
fn standing(case: &mut Case, names: &[usize], seen: &[bool]) -> (Vec<usize>, bool) {
    let names = settled(case, names, seen);
    let is_patched = is_patched(case, &names);
    (if is_patched { settled(case, &[], seen) } else { names }, is_patched)
}

/// Whether the numbers of a name, as the law itself has them, keep their limits.
fn is_within(case: &Case, name: usize) -> bool {
    let family = &case.library.families[name];
    family.columns.iter().zip(&family.signs).all(|(column, sign)| {
        let number = case.belief.numbers.get(*column);
        number.is_none_or(|number| sign.admits(*number))
    })
}

/// A tone that is of no cut.
fn a_tone(case: &Case, held: [f64; 2]) -> Rest {
    let words = vec!["t_s".to_owned()];
    Rest { axis: 0, words, held, tone_hz: Some(case.law.tone_hz), carries: 0.0 }
}

/// A mismatch that names explain with numbers that no sensor has.
fn beyond_names(held: [f64; 2]) -> Rest {
    Rest { axis: 0, words: vec!["wrench".to_owned()], held, tone_hz: None, carries: 0.0 }
}

/// Whether names are patches on something that is none of them: one law says more than all of them, or a number is beyond what a sensor can be off by.
fn is_patched(case: &Case, names: &[usize]) -> bool {
    if names.is_empty() {
        return false;
    }
    let numbers = &case.belief.numbers;
    let is_beyond = |slot: Slot| slot.of(numbers).iter().any(|number| number.abs() > BEYOND);
    if [SCALE, TURN, LEAK].into_iter().any(is_beyond) {
        return true;
    }
    let products = case.products(&case.sets.train);
    let search = Search { library: &case.library, products: &products, always: &case.always };
    let (given, selection) = (search.solve(&[]), search.solve(names));
    let prices = names.iter().map(|name| sets::price_of(&search, &case.library.families[*name]));
    let worth = selection.solved.gain - given.solved.gain - prices.sum::<f64>();
    let bare = Case { belief: Belief::as_told(case.belief.spindle.clone()), ..case.clone() };
    let law = laws::law(&bare, &case.always, &bare.belief);
    let evidence = |worth: f64, carries: f64| worth + 0.5 * carries;
    let carried = carried(case, &given, &selection);
    let least = (1.0 + CLEARLY) * evidence(worth, carried) + BY_CHANCE;
    // Rows held out may not say otherwise: a law of time is near wear, which goes by the way.
    let is_ahead = |law: &laws::Law| {
        law.rest.carries > carried && evidence(law.worth, law.rest.carries) > least
    };
    law.is_some_and(|law| is_ahead(&law))
}

/// What a selection carries on held-out rows of the energy that is off as given, in units of what is new in the noise.
fn carried(case: &Case, given: &Selection, selection: &Selection) -> f64 {
    let left = |selection: &Selection| 2.0 * case.left_white(&selection.solved, &case.sets.test);
    (left(given) - left(selection)).max(0.0)
}

/// The names that stand on all rows that were seen, and the belief that they make: numbers that are not nothing, borne out by rows held out.
fn settled(case: &mut Case, names: &[usize], seen: &[bool]) -> Vec<usize> {
    fit(case, names, seen);
    let mut names = names.to_vec();
    while let Some(wrong) = names.iter().position(|name| !is_within(case, *name)) {
        names.remove(wrong);
        fit(case, &names, seen);
    }
    let kept = {
        let products = case.products(seen);
        let search = Search { library: &case.library, products: &products, always: &case.always };
        let covariance = |solved: &Solved| case.covariance(solved, seen);
        let is_belief = |name: usize| case.library.families[name].revises;
        let kept = significant(&search, names.clone(), &covariance, &is_belief);
        let left = |solved: &Solved| case.left_white(solved, &case.sets.test);
        supported(&search, kept, &left, &is_belief).0
    };
    if kept != names {
        fit(case, &kept, seen);
    }
    kept
}

/// Believes names where the law fits best with them on all rows that were seen, and takes it anew there.
fn fit(case: &mut Case, names: &[usize], seen: &[bool]) {
    let products = case.products(seen);
    let search = Search { library: &case.library, products: &products, always: &case.always };
    let columns = search.columns(names);
    let (belief, _) = case.fitted(&case.belief, &columns, seen);
    case.belief = belief;
    case.take();
}

/// What each name brings and who rivals it, by kind.
fn weighed(case: &Case, names: &[usize], seen: &[bool]) -> BTreeMap<&'static str, Weighed> {
    let products = case.products(seen);
    let search = Search { library: &case.library, products: &products, always: &case.always };
    let selection = search.solve(names);
    let one = |name: &usize| {
        let kind = case.library.families[*name].kind;
        (kind, found::weighed(case, &search, &selection, *name, seen))
    };
    names.iter().map(one).collect()
}

/// What each name brings, once none is left that another says more than, or that brings less than it costs.
fn reweighed(
    case: &mut Case,
    names: &mut Vec<usize>,
    seen: &[bool],
) -> BTreeMap<&'static str, Weighed> {
    for _ in 0..SWAPS {
        let weighed = weighed(case, names, seen);
        let Some(better) = better(case, names, &weighed, seen) else { return weighed };
        *names = settled(case, &better, seen);
    }
    weighed(case, names, seen)
}

/// The effects without one that brings less than its penalty, or with a likelier alternative in its place, by the validation set.
fn better(
    case: &Case,
    names: &[usize],
    weighed: &BTreeMap<&'static str, Weighed>,
    seen: &[bool],
) -> Option<Vec<usize>> {
    let products = case.products(seen);
    let search = Search { library: &case.library, products: &products, always: &case.always };
    let families = &case.library.families;
    let asked = || names.iter().filter(|name| !families[**name].revises);
    let of = |name: &usize| weighed.get(families[*name].kind);
    let swapped = asked().find_map(|name| {
        let better = of(name)?.better(&search)?;
        Some(with_instead(names, *name, better))
    });
    let idle = || asked().find(|name| of(name).is_some_and(|one| one.is_idle));
    swapped.or_else(|| idle().map(|name| others(names, *name)))
}

/// The model's own numbers as the fit has them, of effects that are no finding.
fn refits(
    case: &Case,
    model: &Model,
    search: &Search<'_>,
    selection: &Selection,
    covariance: &DMatrix<f64>,
) -> Vec<Refit> {
    let families = &case.library.families;
    let is_named = |kind: &str| selection.names.iter().any(|name| families[*name].kind == kind);
    let is_open = |slot: &Slot| {
        let own = slot.from..slot.from + slot.count;
        case.doubts.iter().any(|doubt| own.contains(&doubt.number))
    };
    let open = KINDS.iter().filter(|(kind, slot)| is_open(slot) && !is_named(kind));
    let family = |(kind, _): &(&str, Slot)| families.iter().find(|family| family.kind == *kind);
    let of = |family: &Family| {
        let kind = family.kind;
        let numbers = found::numbers(case, model, search, selection, family, covariance);
        numbers.into_iter().map(move |number| Refit { kind, joint: None, number })
    };
    open.filter_map(family).flat_map(of).collect()
}

/// Names with all of their numbers, believed, where these are their names' to have: those that are not are what rows do not tell apart.
fn filled(case: &mut Case, names: Vec<usize>, seen: &[bool]) -> Vec<usize> {
    let full = fullest(case, &names, seen);
    if full == names {
        return names;
    }
    let chosen = case.clone();
    fit(case, &full, seen);
    if full.iter().all(|name| is_within(case, *name)) {
        return full;
    }
    *case = chosen;
    names
}

/// The names with all numbers that theirs may have, where rows tell these apart: a number that is left out is no number that is nothing.
fn fullest(case: &Case, names: &[usize], seen: &[bool]) -> Vec<usize> {
    let families = &case.library.families;
    let products = case.products(seen);
    let search = Search { library: &case.library, products: &products, always: &case.always };
    let mut all = names.to_vec();
    for k in 0..all.len() {
        let own = &families[all[k]];
        let same = |place: &usize| {
            families[*place].kind == own.kind && families[*place].settings.is_empty()
        };
        let forms = (0..families.len()).filter(same);
        let Some(full) = forms.max_by_key(|place| families[*place].columns.len()) else { continue };
        let mut tried = all.clone();
        tried[k] = full;
        let solved = search.solve(&tried).solved;
        let is_apart = |(at, column): (usize, &usize)| {
            let spread = solved.covariance()[(at, at)] * products.gram[(*column, *column)];
            families[full].revises || !families[full].columns.contains(column) || spread < APART
        };
        if own.settings.is_empty() && solved.columns.iter().enumerate().all(is_apart) {
            all = tried;
        }
    }
    all
}

fn verdict(
    case: &Case,
    findings: &[Finding],
    (given, selection): (&Selection, &Selection),
    rest: Option<&Rest>,
    is_strange: bool,
) -> Verdict {
    let explained = carried(case, given, selection);
    let share = rest.map(|rest| explained / (explained + rest.carries).max(f64::MIN_POSITIVE));
    if is_strange {
        return Verdict::UnknownStructure;
    }
    let is_ambiguous = |one: &Finding| one.confidence < LIKELY && !one.rivals.is_empty();
    let weight = |one: &Finding| Weight { gain: one.gain, is_ambiguous: is_ambiguous(one) };
    let weights: Vec<Weight> = findings.iter().map(weight).collect();
    decide_verdict(&weights, share, &VerdictSettings::DRIVE_OR_CUT)
}
