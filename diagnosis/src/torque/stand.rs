//! Final checks of selected effects: significance, physical range of parameters, confirmation on held-out rows.
//!
//! Promises: held-out rows can remove an effect, never select one.

use super::case::Case;
use super::{Rival, Weighed, found, prove};
use crate::engine::library::Form;
use crate::engine::normal_equations::Solved;
use crate::engine::stepwise::{MARGIN, Search};
use crate::engine::validation;

/// A stated number that a name stood for is off by so many times its uncertainty, from blocks of time, before it is told itself.
const OFF: f64 = 4.0;

/// The names that stand, with what they bring, and those that held-out rows speak against.
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

/// The number that the model states and that what is seen contradicts most, where a name that fell may have stood for it.
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

/// Names, those of which a form with more numbers stands in the library in that form where a number more is at least as large as its uncertainty: left out, it
/// would bend the others by as much.
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

/// The names that are sure and that held-out rows bear out, and those that these speak against: a name that falls may leave another unsure.
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

/// Puts a rival in a name's place. A spring past its dead point is a rival still; another name whose numbers are not its own is none, and leaves its
/// probability to the rest.
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

/// Names, each whose numbers are not its own to have in this fit in the place of the likeliest rival that cannot be distinguished from it, if one has them.
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
