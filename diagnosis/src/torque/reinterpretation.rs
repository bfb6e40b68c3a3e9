//! Prefers the simpler of two effects that explain nearly the same: a spring for spring hardening without a spring, an asymmetric friction for a
//! spring, dry friction for a hysteresis that is too narrow for the band. Adds no effect.

use super::StatedModel;
use super::case::Case;
use super::nonlinear_parameters;
use super::regressors::shortest_reversal;
use crate::engine::dictionary::CoefficientForm;
use crate::engine::stepwise::{TermSearch, without_term};

/// Minimum share of an effect's gain that must be lost under the simpler effect for it to be kept.
const LOST_GAIN_SHARE_LEAST: f64 = 0.05;
/// Or this multiple of a spring's penalty.
const LOST_GAIN_PENALTIES: f64 = 4.0;

/// Replaces spring hardening by a spring where no spring is stated or selected.
pub(super) fn hardening_as_spring(
    case: &Case,
    stated: &StatedModel<'_>,
    names: &[usize],
) -> Vec<usize> {
    let families = &case.library.terms;
    let is_spring =
        |name: usize, joint| families[name].kind == "spring" && families[name].joint == joint;
    let one = |name: &usize| {
        let joint = families[*name].joint;
        let has_spring = joint.is_some_and(|joint| stated.has_spring(joint))
            || names.iter().any(|other| is_spring(*other, joint));
        if families[*name].kind != "spring_hardening" || has_spring {
            return *name;
        }
        (0..families.len()).find(|other| is_spring(*other, joint)).unwrap_or(*name)
    };
    names.iter().map(one).collect()
}

/// Replaces a spring by an asymmetric friction, which is constant over position, where that explains almost as much.
pub(super) fn spring_as_asymmetry(search: &TermSearch<'_>, mut names: Vec<usize>) -> Vec<usize> {
    let families = &search.library.terms;
    let springs: Vec<usize> = names
        .iter()
        .copied()
        .filter(|name| families[*name].form == CoefficientForm::Spring)
        .collect();
    for spring in springs {
        let is_even = |name: usize| {
            families[name].kind == "friction_asymmetry"
                && families[name].joint == families[spring].joint
        };
        let gain = |names: &[usize]| search.solve(names).solved.gain;
        let (whole, without) = (gain(&names), gain(&without_term(&names, spring)));
        let rest: Vec<usize> =
            names.iter().copied().filter(|n| *n != spring && !is_even(*n)).collect();
        let with = |even: usize| rest.iter().copied().chain([even]).collect::<Vec<usize>>();
        let little = (LOST_GAIN_SHARE_LEAST * (whole - without))
            .min(LOST_GAIN_PENALTIES * search.penalty(&families[spring]));
        let is_enough = |names: &Vec<usize>| whole - gain(names) < little;
        let mut instead = (0..families.len()).filter(|name| is_even(*name)).map(with);
        names = instead.find(is_enough).unwrap_or(names);
    }
    names
}

/// Replaces a hysteresis whose reversal distance is the shortest resolvable by dry friction, where that explains almost as much.
pub(super) fn hysteresis_as_friction(
    case: &Case,
    always: &[usize],
    mut names: Vec<usize>,
) -> Vec<usize> {
    let families = &case.library.terms;
    let products = case.products(&case.row_sets.fitted());
    let search = nonlinear_parameters::search(case, &products, always);
    for index in 0..names.len() {
        let effect = &families[names[index]];
        let (CoefficientForm::Loop, Some(joint), Some((_, way))) =
            (effect.form, effect.joint, effect.settings.first())
        else {
            continue;
        };
        let is_dry = |name: &usize| {
            families[*name].kind == "coulomb_friction" && families[*name].joint == Some(joint)
        };
        let Some(dry) = (0..families.len()).find(is_dry).filter(|dry| !names.contains(dry)) else {
            continue;
        };
        let gain = |names: &[usize]| search.solve(names).solved.gain;
        let mut with = names.clone();
        with[index] = dry;
        let (whole, without) = (gain(&names), gain(&without_term(&names, names[index])));
        let is_sudden = *way <= shortest_reversal(&case.motion, joint);
        if is_sudden && whole - gain(&with) < LOST_GAIN_SHARE_LEAST * (whole - without) {
            names = with;
        }
    }
    names
}
