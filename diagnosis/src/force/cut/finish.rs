//! Assembles the result of a comparison of forces with a cut: effects with parameters, improvement on the test set, residual, verdict.
//!
//! The test set is evaluated here for the first time; it can only remove an effect. Indistinguishable effects are not claimed.

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

/// Posterior probability from which an effect is unambiguous; its alternatives are listed beside it.
const LIKELY: f64 = 0.95;
/// Maximum number of replacements or removals after the fit to all rows but the test set.
const SWAPS: usize = 3;
/// Minimum relative advantage of a single smooth law over all selected effects, on training and test rows together; effects approximate such a law to
/// about this share.
const CLEARLY: f64 = 0.01;
/// And minimum advantage in log-likelihood.
const BY_CHANCE: f64 = 10.0;
/// Largest variance inflation, relative to a fit of the parameter alone, up to which an additional parameter is included.
const APART: f64 = 1e5;

/// Result of a comparison with the stated cut.
#[derive(Clone, Debug)]
pub struct Compared {
    /// Verdict.
    pub verdict: Verdict,
    /// Claimed effects, most important first; SI units.
    pub findings: Vec<Finding>,
    /// Selected effects with too low a probability to be claimed. They are part of the fit, of the tested residuals and of the written model.
    pub candidates: Vec<Finding>,
    /// Parameters that the model states with an uncertainty, as refitted. They are not findings, but part of the tested fit.
    pub refits: Vec<Refit>,
    /// Structure in the residual that no candidate effect explains.
    pub unexplained: Option<Rest>,
    /// RMS residual on test rows of the stated cut, and with all findings, N.
    pub heldout: [f64; 2],
    /// RMS residual on training and validation rows, N.
    pub noise: f64,
    /// RMS recorded force, N.
    pub signal: f64,
    /// Number of compared rows.
    pub rows: usize,
    /// How the test rows were chosen, as text.
    pub says: String,
    /// Effects that this recording cannot show, with the reason.
    pub not_tested: Vec<(&'static str, &'static str)>,
    /// Notes on the processing of the data, as text.
    pub notes: Vec<String>,
    /// Whether the feed per tooth was constant in the cut.
    pub has_one_feed: bool,
    /// Whether the tool was ever in air.
    pub has_air: bool,
    /// Plot data of each recorded axis.
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
    // An effect is evaluated in its selected form, and reported with all of its parameters.
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

/// The effects that all rows but the test set support. If they only approximate another structure: none, and `true`.
fn standing(case: &mut Case, names: &[usize], seen: &[bool]) -> (Vec<usize>, bool) {
    let names = settled(case, names, seen);
    let is_patched = is_patched(case, &names);
    (if is_patched { settled(case, &[], seen) } else { names }, is_patched)
}

/// Whether the parameters of an effect, fitted by the nonlinear model, are within their limits.
fn is_within(case: &Case, name: usize) -> bool {
    let family = &case.library.families[name];
    family.columns.iter().zip(&family.signs).all(|(column, sign)| {
        let number = case.belief.numbers.get(*column);
        number.is_none_or(|number| sign.admits(*number))
    })
}

/// An oscillation that is present at all times, as unmodelled structure.
fn a_tone(case: &Case, held: [f64; 2]) -> Rest {
    let words = vec!["t_s".to_owned()];
    Rest { axis: 0, words, held, tone_hz: Some(case.law.tone_hz), carries: 0.0 }
}

/// A mismatch that the effects explain only with parameters that no sensor has.
fn beyond_names(held: [f64; 2]) -> Rest {
    Rest { axis: 0, words: vec!["wrench".to_owned()], held, tone_hz: None, carries: 0.0 }
}

/// Whether the effects only approximate another structure: a single smooth law explains more, or a parameter exceeds the range of a sensor.
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
    // The law must be ahead on test rows too: wear, which grows with feed travel, is hardly distinguishable from a law of time.
    let is_ahead = |law: &laws::Law| {
        law.rest.carries > carried && evidence(law.worth, law.rest.carries) > least
    };
    law.is_some_and(|law| is_ahead(&law))
}

/// Reduction of the residual energy on test rows by a selection, in units of the innovation variance.
fn carried(case: &Case, given: &Selection, selection: &Selection) -> f64 {
    let left = |selection: &Selection| 2.0 * case.left_white(&selection.solved, &case.sets.test);
    (left(given) - left(selection)).max(0.0)
}

/// Effects that are significant and that the test set supports, after a fit to all other rows; adopts their parameters.
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

/// Fits effects by the nonlinear model to all rows but the test set and linearises there.
fn fit(case: &mut Case, names: &[usize], seen: &[bool]) {
    let products = case.products(seen);
    let search = Search { library: &case.library, products: &products, always: &case.always };
    let columns = search.columns(names);
    let (belief, _) = case.fitted(&case.belief, &columns, seen);
    case.belief = belief;
    case.take();
}

/// Gain and alternatives of each effect, by kind.
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

/// Gain and alternatives of each effect, after replacing effects by better alternatives and removing those below their penalty.
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

/// The effects with one replaced by a more probable alternative, or without one whose gain is below its penalty; `None` if there is neither.
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

/// Refitted parameters with a stated uncertainty, of effects that are not findings.
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

/// Extends effects to all of their parameters, if these remain within their limits.
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

/// The effects with all parameters of their kind, where the data determine these: an omitted parameter would be reported as exactly zero.
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
