//! Beam search over sets of effects that explain the forces together.
//!
//! One effect with many parameters (a full cross-talk matrix) can absorb several with few (a misaligned sensor, one leak, an edge force), and
//! stepwise selection does not remove it again. Sets are therefore grown by one effect at a time, many in parallel. The best by the linearised model
//! are fitted by the nonlinear one, and the set with the best criterion is taken.
//!
//! Sets with a parameter outside its physical range are rejected. Deterministic; does not use held-out rows.

use std::collections::BTreeMap;

use super::case::Case;
use crate::engine::library::Family;
use crate::engine::stepwise::{Search, Selection, others};

/// Penalty of a non-empty set in addition to those of its effects, in log-likelihood.
const MARGIN: f64 = 5.0;
/// Largest number of effects in a set.
const DEPTH: usize = 4;
/// Beam width: sets of kinds that are grown in parallel.
const WIDTH: usize = 24;
/// Maximum number of passes in which the effects of a set change their forms.
const FORMS: usize = 3;
/// Largest number of sets fitted by the nonlinear model.
const FITTED: usize = 5;
/// Sets whose linearised score is further behind, in log-likelihood, are not fitted.
const FAR: f64 = 40.0;
/// Minimum improvement of the criterion for another set to replace the current one.
const BETTER: f64 = 1.0;

/// A set of effects and its score: log-likelihood gain less penalty.
#[derive(Clone)]
pub(super) struct Set {
    pub(super) names: Vec<usize>,
    pub(super) score: f64,
}

impl Set {
    /// Scores a set with the linearised model; `None` if a parameter is outside its range.
    pub(super) fn of(search: &Search<'_>, names: &[usize]) -> Option<Self> {
        let selection = search.solve(names);
        let score = selection.solved.gain - penalty(search, names);
        let is_admissible = names.iter().all(|name| search.is_admissible(&selection, *name));
        is_admissible.then(|| Self { names: names.to_vec(), score })
    }
}

/// Penalty of a set of effects, with the margin of a non-empty set.
fn penalty(search: &Search<'_>, names: &[usize]) -> f64 {
    let each = names.iter().map(|name| price_of(search, &search.library.families[*name]));
    each.sum::<f64>() + if names.is_empty() { 0.0 } else { MARGIN }
}

/// Penalty of an effect: for its parameters, for the number of candidates, and for the number of its forms with as many parameters (extended BIC,
/// Chen and Chen 2008). Without the last, the best of fifteen pairs of cross-talk terms would win over the single rotation of a sensor.
pub(super) fn price_of(search: &Search<'_>, family: &Family) -> f64 {
    let is_like =
        |one: &&Family| one.kind == family.kind && one.columns.len() == family.columns.len();
    let forms = search.library.families.iter().filter(is_like).count().max(1) as f64;
    search.penalty(family) + forms.ln()
}

/// The best sets by the linearised model, in order of decreasing score; one for each set of kinds.
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

/// All sets with one effect more, of a kind that the set lacks, in every form.
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

/// Gain of an effect added to a selection, less its penalty.
fn worth(search: &Search<'_>, selection: &Selection, name: usize) -> f64 {
    let margin = if selection.names.is_empty() { MARGIN } else { 0.0 };
    search.brings(selection, name) - price_of(search, &search.library.families[name]) - margin
}

/// The effects of a set, each in the form with the best score beside the others.
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

/// A set with a better criterion than the current one by the nonlinear model, if there is one.
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
