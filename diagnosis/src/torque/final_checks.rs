//! Final checks of selected effects: significance, physical range of parameters, support by the test set. Test rows can remove an effect, never
//! select one.

use super::case::Case;
use super::{AlternativeEffect, AssessedEffect, fit_quality, parameters};
use crate::engine::dictionary::CoefficientForm;
use crate::engine::normal_equations::LeastSquaresSolution;
use crate::engine::stepwise::{MARGIN, TermSearch};
use crate::engine::validation;

/// Minimum ratio of a stated parameter's deviation to its standard uncertainty, from blocks of time, for it to be added after the effect that may
/// have stood in for it was removed.
const DEVIATION_LEAST: f64 = 4.0;

/// Effects that pass, with gains and alternatives, and those that the test set contradicts.
pub(super) fn passing_effects(
    case: &Case,
    search: &TermSearch<'_>,
    weighed: &[AssessedEffect],
    fitted_rows: &[bool],
) -> (Vec<AssessedEffect>, Vec<usize>) {
    let mut weighed =
        with_fuller_forms(case, search, with_admissible_parameters(search, weighed), fitted_rows);
    let names = weighed.iter().map(|one| one.candidate).collect();
    let (mut names, refuted) = supported_effects(case, search, names, fitted_rows);
    weighed.retain(|one| names.contains(&one.candidate));
    while !refuted.is_empty() {
        let Some(candidate) = contradicted_parameter(case, search, &names, fitted_rows) else {
            break;
        };
        names.push(candidate);
        let selection = search.solve(&names);
        let (confidence, alternatives) = parameters::alternatives(search, &selection, candidate);
        weighed.push(AssessedEffect {
            candidate,
            gain: search.gain_of(&selection, candidate),
            confidence,
            alternatives,
        });
    }
    (weighed, refuted)
}

/// The stated parameter that the training and validation rows contradict most, if a removed effect may have stood in for it.
pub(super) fn contradicted_parameter(
    case: &Case,
    search: &TermSearch<'_>,
    names: &[usize],
    fitted_rows: &[bool],
) -> Option<usize> {
    let families = &case.library.terms;
    let selection = search.solve(names);
    let open =
        (0..families.len()).filter(|name| families[*name].corrects_stated && !names.contains(name));
    let worth =
        |name| (name, search.gain_beside(&selection, name) - search.penalty(&families[name]));
    let best = open.map(worth).max_by(|a, b| a.1.total_cmp(&b.1));
    let (name, _) = best.filter(|best| best.1 > MARGIN)?;
    let with: Vec<usize> = names.iter().copied().chain([name]).collect();
    let is_sure =
        fit_quality::significance_of(case, search, &with, families[name].columns[0], fitted_rows)
            > DEVIATION_LEAST;
    (is_sure && search.admissible(with.clone()) == with).then_some(name)
}

/// Extends each effect to its form with more parameters where an additional one is larger than its uncertainty: omitting it would bias the others.
fn with_fuller_forms(
    case: &Case,
    search: &TermSearch<'_>,
    weighed: Vec<AssessedEffect>,
    fitted_rows: &[bool],
) -> Vec<AssessedEffect> {
    let families = &case.library.terms;
    let mut names: Vec<usize> = weighed.iter().map(|one| one.candidate).collect();
    let mut all = weighed;
    for index in 0..names.len() {
        let effect = &families[names[index]];
        let is_more = |name: &usize| {
            let other = &families[*name];
            other.is_same_effect(effect)
                && other.columns.len() > effect.columns.len()
                && effect.columns.iter().all(|column| other.columns.contains(column))
        };
        let Some(more) = (0..families.len()).find(is_more) else { continue };
        let mut with = names.clone();
        with[index] = more;
        let added = families[more].columns.iter().filter(|column| !effect.columns.contains(column));
        let is_significant = |column: &usize| {
            fit_quality::significance_of(case, search, &with, *column, fitted_rows) > 1.0
        };
        if added.into_iter().any(is_significant) {
            (names[index], all[index].candidate) = (more, more);
        }
    }
    all
}

/// Effects that are significant and not contradicted by the test set, and those that it contradicts. Repeated, since a removal can make another
/// effect insignificant.
fn supported_effects(
    case: &Case,
    search: &TermSearch<'_>,
    mut names: Vec<usize>,
    fitted_rows: &[bool],
) -> (Vec<usize>, Vec<usize>) {
    let covariance =
        |solved: &LeastSquaresSolution| fit_quality::covariance(case, solved, fitted_rows);
    let mut refuted = Vec::new();
    loop {
        let before = names.len();
        let (kept, fell) = fit_quality::split_by_support(
            case,
            search,
            search.admissible(names),
            &case.row_sets.test,
        );
        refuted.extend(fell);
        names = search.admissible(validation::significant(search, kept, &covariance, &|_| false));
        if names.len() == before {
            return (names, refuted);
        }
    }
}

/// Replaces an effect by an alternative. A spring with negative stiffness remains an alternative; any other effect with parameters outside its range
/// is excluded, and its probability is distributed to the rest.
fn replace_by(search: &TermSearch<'_>, one: &mut AssessedEffect, rival: &AlternativeEffect) {
    let former = &search.library.terms[one.candidate];
    let is_rival = former.form == CoefficientForm::Spring;
    let rest = if is_rival { 1.0 } else { 1.0 - one.confidence };
    one.alternatives.iter_mut().for_each(|other| {
        other.confidence /= rest;
        other.likelihood_loss -= rival.likelihood_loss;
        other.extra_parameters -= rival.extra_parameters;
    });
    if is_rival {
        let past = AlternativeEffect::of(
            former,
            one.candidate,
            -rival.likelihood_loss,
            -rival.extra_parameters,
        );
        one.alternatives.push(AlternativeEffect { confidence: one.confidence, ..past });
    }
    (one.candidate, one.confidence) = (rival.candidate, rival.confidence / rest);
    one.alternatives.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
}

/// Effects, each with inadmissible parameters replaced by its most probable indistinguishable alternative with admissible ones.
fn with_admissible_parameters(
    search: &TermSearch<'_>,
    weighed: &[AssessedEffect],
) -> Vec<AssessedEffect> {
    let names: Vec<usize> = weighed.iter().map(|one| one.candidate).collect();
    let stand = search.admissible(names.clone());
    let one = |one: &AssessedEffect| {
        let mut one = one.clone();
        if stand.contains(&one.candidate) {
            return one;
        }
        let fits = |rival: &AlternativeEffect| {
            let with: Vec<usize> = stand.iter().copied().chain([rival.candidate]).collect();
            search.admissible(with.clone()) == with
        };
        let equivalent =
            one.alternatives.iter().position(|rival| rival.is_indistinguishable && fits(rival));
        if let Some(rival) = equivalent.map(|index| one.alternatives.remove(index)) {
            replace_by(search, &mut one, &rival);
        }
        one
    };
    weighed.iter().map(one).collect()
}
