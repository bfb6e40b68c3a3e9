//! Final checks of selected effects: significance, physical range of parameters, support by the test set. Test rows can remove an effect, never
//! select one.

use super::case::Case;
use super::{Rival, Weighed, found, prove};
use crate::engine::library::Form;
use crate::engine::normal_equations::Solved;
use crate::engine::stepwise::{MARGIN, Search};
use crate::engine::validation;

/// Minimum ratio of a stated parameter's deviation to its standard uncertainty, from blocks of time, for it to be added after the effect that may
/// have stood in for it was removed.
const OFF: f64 = 4.0;

/// Effects that pass, with gains and alternatives, and those that the test set contradicts.
pub(super) fn stand(
    case: &Case,
    search: &Search<'_>,
    weighed: &[Weighed],
    seen: &[bool],
) -> (Vec<Weighed>, Vec<usize>) {
    let mut weighed = whole(case, search, replaced(search, weighed), seen);
    let names = weighed.iter().map(|one| one.name).collect();
    let (mut names, refuted) = borne_out(case, search, names, seen);
    weighed.retain(|one| names.contains(&one.name));
    while !refuted.is_empty() {
        let Some(name) = contradicted(case, search, &names, seen) else { break };
        names.push(name);
        let selection = search.solve(&names);
        let (confidence, rivals) = found::rivals(search, &selection, name);
        weighed.push(Weighed { name, gain: search.worth(&selection, name), confidence, rivals });
    }
    (weighed, refuted)
}

/// The stated parameter that the training and validation rows contradict most, if a removed effect may have stood in for it.
pub(super) fn contradicted(
    case: &Case,
    search: &Search<'_>,
    names: &[usize],
    seen: &[bool],
) -> Option<usize> {
    let families = &case.library.families;
    let selection = search.solve(names);
    let open = (0..families.len()).filter(|name| families[*name].revises && !names.contains(name));
    let worth = |name| (name, search.brings(&selection, name) - search.penalty(&families[name]));
    let best = open.map(worth).max_by(|a, b| a.1.total_cmp(&b.1));
    let (name, _) = best.filter(|best| best.1 > MARGIN)?;
    let with: Vec<usize> = names.iter().copied().chain([name]).collect();
    let is_sure = prove::sure(case, search, &with, families[name].columns[0], seen) > OFF;
    (is_sure && search.admissible(with.clone()) == with).then_some(name)
}

/// Extends each effect to its form with more parameters where an additional one is larger than its uncertainty: omitting it would bias the others.
fn whole(case: &Case, search: &Search<'_>, weighed: Vec<Weighed>, seen: &[bool]) -> Vec<Weighed> {
    let families = &case.library.families;
    let mut names: Vec<usize> = weighed.iter().map(|one| one.name).collect();
    let mut all = weighed;
    for at in 0..names.len() {
        let own = &families[names[at]];
        let is_more = |name: &usize| {
            let other = &families[*name];
            other.is_kin(own)
                && other.columns.len() > own.columns.len()
                && own.columns.iter().all(|column| other.columns.contains(column))
        };
        let Some(more) = (0..families.len()).find(is_more) else { continue };
        let mut with = names.clone();
        with[at] = more;
        let added = families[more].columns.iter().filter(|column| !own.columns.contains(column));
        let is_told = |column: &usize| prove::sure(case, search, &with, *column, seen) > 1.0;
        if added.into_iter().any(is_told) {
            (names[at], all[at].name) = (more, more);
        }
    }
    all
}

/// Effects that are significant and not contradicted by the test set, and those that it contradicts. Repeated, since a removal can make another
/// effect insignificant.
fn borne_out(
    case: &Case,
    search: &Search<'_>,
    mut names: Vec<usize>,
    seen: &[bool],
) -> (Vec<usize>, Vec<usize>) {
    let covariance = |solved: &Solved| prove::covariance(case, solved, seen);
    let mut refuted = Vec::new();
    loop {
        let before = names.len();
        let (kept, fell) =
            prove::borne_out(case, search, search.admissible(names), &case.rows.test);
        refuted.extend(fell);
        names = search.admissible(validation::significant(search, kept, &covariance, &|_| false));
        if names.len() == before {
            return (names, refuted);
        }
    }
}

/// Replaces an effect by an alternative. A spring with negative stiffness remains an alternative; any other effect with parameters outside its range
/// is excluded, and its probability is distributed to the rest.
fn instead(search: &Search<'_>, one: &mut Weighed, rival: &Rival) {
    let former = &search.library.families[one.name];
    let is_rival = former.form == Form::Spring;
    let rest = if is_rival { 1.0 } else { 1.0 - one.confidence };
    one.rivals.iter_mut().for_each(|other| {
        other.confidence /= rest;
        other.behind -= rival.behind;
        other.dearer -= rival.dearer;
    });
    if is_rival {
        let past = Rival::of(former, one.name, -rival.behind, -rival.dearer);
        one.rivals.push(Rival { confidence: one.confidence, ..past });
    }
    (one.name, one.confidence) = (rival.place, rival.confidence / rest);
    one.rivals.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
}

/// Effects, each with inadmissible parameters replaced by its most probable indistinguishable alternative with admissible ones.
fn replaced(search: &Search<'_>, weighed: &[Weighed]) -> Vec<Weighed> {
    let names: Vec<usize> = weighed.iter().map(|one| one.name).collect();
    let stand = search.admissible(names.clone());
    let one = |one: &Weighed| {
        let mut one = one.clone();
        if stand.contains(&one.name) {
            return one;
        }
        let fits = |rival: &Rival| {
            let with: Vec<usize> = stand.iter().copied().chain([rival.place]).collect();
            search.admissible(with.clone()) == with
        };
        let alike = one.rivals.iter().position(|rival| rival.alike && fits(rival));
        if let Some(rival) = alike.map(|at| one.rivals.remove(at)) {
            instead(search, &mut one, &rival);
        }
        one
    };
    weighed.iter().map(one).collect()
}
