//! Beam search over sets of effects that explain the forces together.
//!
//! One effect with many parameters (a full cross-talk matrix) can absorb several with few (a misaligned sensor, one leak, an edge force); stepwise selection, which takes it
//! first, does not leave it again. Sets are therefore grown by one effect at a time, many side by side. The best by the linearised model are fitted by the nonlinear one, and
//! the set with the best criterion is taken.
//!
//! A set with a parameter outside its physical range is rejected; the same sums give the same sets. Does not use rows that were set apart.

use std::collections::BTreeMap;

use super::case::Case;
use crate::engine::library::Family;
use crate::engine::stepwise::{Search, Selection, others};

/// What a set must bring beyond its penalty.
const MARGIN: f64 = 5.0;
/// Names of a set, at most.
const DEPTH: usize = 4;
/// Sets of kinds that are grown side by side.
const WIDTH: usize = 24;
/// Rounds in which the names of a set change their forms.
const FORMS: usize = 3;
/// Sets that are fitted by the law itself, at most.
const FITTED: usize = 5;
/// Sets that slopes make less likely by more than this are not, in log-likelihood.
const FAR: f64 = 40.0;
/// Another set takes the place of the one that stands from so much on.
const BETTER: f64 = 1.0;

/// Names, and what they explain beyond their penalty.
#[derive(Clone)]
pub(super) struct Set {
    pub(super) names: Vec<usize>,
    pub(super) score: f64,
}

impl Set {
    /// As slopes have it; none where a number is not its name's to have.
    pub(super) fn of(search: &Search<'_>, names: &[usize]) -> Option<Self> {
        let selection = search.solve(names);
        let score = selection.solved.gain - penalty(search, names);
        let is_admissible = names.iter().all(|name| search.is_admissible(&selection, *name));
        is_admissible.then(|| Self { names: names.to_vec(), score })
    }
}

/// What names cost together: that anything is named at all costs a margin, once.
fn penalty(search: &Search<'_>, names: &[usize]) -> f64 {
    let each = names.iter().map(|name| price_of(search, &search.library.families[*name]));
    each.sum::<f64>() + if names.is_empty() { 0.0 } else { MARGIN }
}

/// What a name costs: its numbers, that so many names were asked, and that it could choose among so many forms of as many numbers (Chen and Chen 2008): the best of
/// fifteen pairs of leaks explains more of anything than the one whole turn of a sensor does.
pub(super) fn price_of(search: &Search<'_>, family: &Family) -> f64 {
    let is_like =
        |one: &&Family| one.kind == family.kind && one.columns.len() == family.columns.len();
    let forms = search.library.families.iter().filter(is_like).count().max(1) as f64;
    search.penalty(family) + forms.ln()
}

/// The likeliest sets by slopes, best first; one for each set of kinds.
pub(super) fn likely(search: &Search<'_>) -> Vec<Set> {
    let mut all: Vec<Set> = Set::of(search, &[]).into_iter().collect();
    let mut level = all.clone();
    for _ in 0..DEPTH {
        let mut next: BTreeMap<Vec<&'static str>, Set> = BTreeMap::new();
        for set in &level {
            for longer in extended(search, set) {
                let kinds = kinds(search, &longer.names);
                let known = next.get(&kinds);
                if known.is_none_or(|known| longer.score > known.score) {
                    next.insert(kinds, longer);
                }
            }
        }
        let mut grown: Vec<Set> = next.into_values().collect();
        sort(&mut grown);
        grown.truncate(WIDTH);
        level = grown.iter().filter_map(|set| Set::of(search, &reformed(search, set))).collect();
        if level.is_empty() {
            break;
        }
        all.extend(level.iter().cloned());
    }
    sort(&mut all);
    all
}

fn sort(sets: &mut [Set]) {
    sets.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.names.cmp(&b.names)));
}

fn kinds(search: &Search<'_>, names: &[usize]) -> Vec<&'static str> {
    let mut kinds: Vec<&str> =
        names.iter().map(|name| search.library.families[*name].kind).collect();
    kinds.sort_unstable();
    kinds
}

/// A set with one name more, of every kind that it lacks and in every form.
fn extended(search: &Search<'_>, set: &Set) -> Vec<Set> {
    let families = &search.library.families;
    let selection = search.solve(&set.names);
    let has = |kind: &str| set.names.iter().any(|name| families[*name].kind == kind);
    let with = |name: usize| Set {
        names: set.names.iter().copied().chain([name]).collect(),
        score: set.score + worth(search, &selection, name),
    };
    (0..families.len()).filter(|name| !has(families[*name].kind)).map(with).collect()
}

/// What a name brings beside a selection beyond its penalty.
fn worth(search: &Search<'_>, selection: &Selection, name: usize) -> f64 {
    let margin = if selection.names.is_empty() { MARGIN } else { 0.0 };
    search.brings(selection, name) - price_of(search, &search.library.families[name]) - margin
}

/// The names of a set, each in the form that brings most beside the others.
fn reformed(search: &Search<'_>, set: &Set) -> Vec<usize> {
    let families = &search.library.families;
    let mut names = set.names.clone();
    for _ in 0..FORMS {
        let before = names.clone();
        for at in 0..names.len() {
            let own = names[at];
            let without = search.solve(&others(&names, own));
            let same = |name: &usize| families[*name].kind == families[own].kind;
            let forms = (0..families.len()).filter(same).map(|k| (k, worth(search, &without, k)));
            let best = forms.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
            names[at] = best.map_or(own, |(best, _)| best);
        }
        if names == before {
            break;
        }
    }
    names
}

/// The set that explains more for its penalty than the one that stands, by the law itself, where there is one.
pub(super) fn likelier(case: &Case, names: &[usize], used: &[bool]) -> Option<Vec<usize>> {
    let products = case.products(used);
    let search = Search { library: &case.library, products: &products, always: &case.always };
    let sets = likely(&search);
    let best = sets.first()?.score;
    let cost = |names: &[usize]| {
        case.fitted(&case.belief, &search.columns(names), used).1 + penalty(&search, names)
    };
    let kinds_of = kinds(&search, names);
    let near = sets.iter().filter(|set| set.score > best - FAR);
    let near = near.filter(|set| kinds(&search, &set.names) != kinds_of).take(FITTED);
    let tried = near.map(|set| (cost(&set.names), &set.names));
    let (least, better) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (least < cost(names) - BETTER).then(|| better.clone())
}
