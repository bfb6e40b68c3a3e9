//! Beam search over sets of effects that explain the forces together.
//!
//! One effect with many parameters (a full cross-talk matrix) can absorb several with few (a misaligned sensor, one leak, an edge force), and
//! stepwise selection does not remove it again. Sets are therefore grown by one effect at a time, many in parallel. The best by the linearised model
//! are fitted by the nonlinear one, and the set with the best criterion is taken.
//!
//! Sets with a parameter outside its physical range are rejected. Deterministic; does not use held-out rows.

use std::collections::BTreeMap;

use super::case::Case;
use crate::engine::dictionary::CandidateTerm;
use crate::engine::stepwise::{TermSearch, TermSelection, without_term};

/// Penalty of a non-empty set in addition to those of its effects, in log-likelihood.
const MARGIN: f64 = 5.0;
/// Largest number of effects in a set.
const EFFECTS_MOST: usize = 4;
/// Beam width: sets of kinds that are grown in parallel.
const BEAM_WIDTH: usize = 24;
/// Maximum number of passes in which the effects of a set change their forms.
const FORM_PASSES: usize = 3;
/// Largest number of sets fitted by the nonlinear model.
const NONLINEAR_FITS_MOST: usize = 5;
/// Sets whose linearised score is further behind, in log-likelihood, are not fitted.
const SCORE_DIFFERENCE_MOST: f64 = 40.0;
/// Minimum improvement of the criterion for another set to replace the current one.
const IMPROVEMENT_LEAST: f64 = 1.0;

/// A set of effects and its score: log-likelihood gain less penalty.
#[derive(Clone)]
pub(super) struct EffectSet {
    pub(super) effects: Vec<usize>,
    pub(super) score: f64,
}

impl EffectSet {
    /// Scores a set with the linearised model; `None` if a parameter is outside its range.
    pub(super) fn scored(search: &TermSearch<'_>, names: &[usize]) -> Option<Self> {
        let selection = search.solve(names);
        let score = selection.solved.gain - penalty(search, names);
        let is_admissible = names.iter().all(|name| search.is_admissible(&selection, *name));
        is_admissible.then(|| Self { effects: names.to_vec(), score })
    }
}

/// Penalty of a set of effects, with the margin of a non-empty set.
fn penalty(search: &TermSearch<'_>, names: &[usize]) -> f64 {
    let each = names.iter().map(|name| penalty_with_forms(search, &search.library.terms[*name]));
    each.sum::<f64>() + if names.is_empty() { 0.0 } else { MARGIN }
}

/// Penalty of an effect: for its parameters, for the number of candidates, and for the number of its forms with as many parameters (extended BIC,
/// Chen and Chen 2008). Without the last, the best of fifteen pairs of cross-talk terms would win over the single rotation of a sensor.
pub(super) fn penalty_with_forms(search: &TermSearch<'_>, family: &CandidateTerm) -> f64 {
    let is_like =
        |one: &&CandidateTerm| one.kind == family.kind && one.columns.len() == family.columns.len();
    let forms = search.library.terms.iter().filter(is_like).count().max(1) as f64;
    search.penalty(family) + forms.ln()
}

/// The best sets by the linearised model, in order of decreasing score; one for each set of kinds.
pub(super) fn best_sets(search: &TermSearch<'_>) -> Vec<EffectSet> {
    let mut all: Vec<EffectSet> = EffectSet::scored(search, &[]).into_iter().collect();
    let mut level = all.clone();
    for _ in 0..EFFECTS_MOST {
        let mut next: BTreeMap<Vec<&'static str>, EffectSet> = BTreeMap::new();
        for set in &level {
            for longer in extended_sets(search, set) {
                let kinds = kinds(search, &longer.effects);
                let known = next.get(&kinds);
                if known.is_none_or(|known| longer.score > known.score) {
                    next.insert(kinds, longer);
                }
            }
        }
        let mut grown: Vec<EffectSet> = next.into_values().collect();
        sort(&mut grown);
        grown.truncate(BEAM_WIDTH);
        level = grown
            .iter()
            .filter_map(|set| EffectSet::scored(search, &with_best_forms(search, set)))
            .collect();
        if level.is_empty() {
            break;
        }
        all.extend(level.iter().cloned());
    }
    sort(&mut all);
    all
}

fn sort(sets: &mut [EffectSet]) {
    sets.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.effects.cmp(&b.effects)));
}

fn kinds(search: &TermSearch<'_>, names: &[usize]) -> Vec<&'static str> {
    let mut kinds: Vec<&str> = names.iter().map(|name| search.library.terms[*name].kind).collect();
    kinds.sort_unstable();
    kinds
}

/// All sets with one effect more, of a kind that the set lacks, in every form.
fn extended_sets(search: &TermSearch<'_>, set: &EffectSet) -> Vec<EffectSet> {
    let families = &search.library.terms;
    let selection = search.solve(&set.effects);
    let has = |kind: &str| set.effects.iter().any(|name| families[*name].kind == kind);
    let with = |name: usize| EffectSet {
        effects: set.effects.iter().copied().chain([name]).collect(),
        score: set.score + gain_less_penalty(search, &selection, name),
    };
    (0..families.len()).filter(|name| !has(families[*name].kind)).map(with).collect()
}

/// Gain of an effect added to a selection, less its penalty.
fn gain_less_penalty(search: &TermSearch<'_>, selection: &TermSelection, name: usize) -> f64 {
    let margin = if selection.terms.is_empty() { MARGIN } else { 0.0 };
    search.gain_beside(selection, name)
        - penalty_with_forms(search, &search.library.terms[name])
        - margin
}

/// The effects of a set, each in the form with the best score, given the others.
fn with_best_forms(search: &TermSearch<'_>, set: &EffectSet) -> Vec<usize> {
    let families = &search.library.terms;
    let mut names = set.effects.clone();
    for _ in 0..FORM_PASSES {
        let before = names.clone();
        for index in 0..names.len() {
            let current = names[index];
            let without = search.solve(&without_term(&names, current));
            let same = |name: &usize| families[*name].kind == families[current].kind;
            let forms = (0..families.len())
                .filter(same)
                .map(|k| (k, gain_less_penalty(search, &without, k)));
            let best = forms.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
            names[index] = best.map_or(current, |(best, _)| best);
        }
        if names == before {
            break;
        }
    }
    names
}

/// A set with a better criterion than the current one by the nonlinear model, if there is one.
pub(super) fn better_set(case: &Case, names: &[usize], used: &[bool]) -> Option<Vec<usize>> {
    let products = case.products(used);
    let search = TermSearch { library: &case.library, products: &products, always: &case.always };
    let sets = best_sets(&search);
    let best = sets.first()?.score;
    let cost = |names: &[usize]| {
        case.fit_nonlinear(&case.estimates, &search.columns(names), used).1
            + penalty(&search, names)
    };
    let kinds_of = kinds(&search, names);
    let promising = sets.iter().filter(|set| set.score > best - SCORE_DIFFERENCE_MOST);
    let promising =
        promising.filter(|set| kinds(&search, &set.effects) != kinds_of).take(NONLINEAR_FITS_MOST);
    let tried = promising.map(|set| (cost(&set.effects), &set.effects));
    let (lowest, better) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (lowest < cost(names) - IMPROVEMENT_LEAST).then(|| better.clone())
}
