//! The selected effects as findings: parameters with uncertainty, alternatives, size, and the error on the test set with and without each.
//!
//! They are ordered by how much they lower the error on the test set, as a mean over all orders in which they can be added (Shapley value): effects
//! that partly explain the same share it equally, whichever was added first.

use super::residual_map;
use super::selection::{SelectedEffect, hypothesis_without};
use super::validation::FitEvaluator;
use super::verdict;
use super::{Finding, NORMAL_QUANTILE_95, RELATIVE_SIGMA_FLOOR};
use crate::chord::RefitsWithout;
use crate::engine::attribution::ErrorEnergies;
use crate::fit_result::Fit;
use crate::hypothesis::{Hypothesis, parameter_key};
use crate::least_squares::FitState;
use crate::progress::StageProgress;
use physics::spec::Unit;
use physics::{AnyEffect, Model};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The findings for all selected effects, the one with the largest Shapley value first. `last`: the final fit, with the standard uncertainty of its
/// columns; `given`: the fit of the model as given.
pub(super) fn findings(
    held: &FitEvaluator<'_>,
    model: &Model,
    (last, uncertainty): (&Fit, &[f64]),
    all: &[SelectedEffect],
    given: &Fit,
    progress: StageProgress<'_>,
) -> Vec<Finding> {
    // Each effect removed, alone, with those before it, and as a finding; none of them and all of them.
    let steps = progress.steps(4 * all.len() + 2);
    let refits = RefitsWithout::of(held.campaign, last, &held.split.training);
    let left = |removed: &[&SelectedEffect]| {
        let places: Vec<usize> = removed.iter().map(|one| one.effect).collect();
        let state = refits.state_without(&hypothesis_without(last, model, removed), &places);
        steps.step();
        RemainingError::of(held, &state)
    };
    let alone_left_out: Vec<RemainingError> = all.par_iter().map(|one| left(&[one])).collect();
    let by_itself = (0..all.len()).into_par_iter().map(|k| {
        let others: Vec<&SelectedEffect> = all[..k].iter().chain(&all[k + 1..]).collect();
        left(&others).energy
    });
    let energies = ErrorEnergies {
        with_none: left(&all.iter().collect::<Vec<_>>()).energy,
        with_one: by_itself.collect(),
        without_one: alone_left_out.iter().map(|left| left.energy).collect(),
        with_all: left(&[]).energy,
    };
    let places = energies.order();
    let order: Vec<&SelectedEffect> = places.iter().map(|place| &all[*place]).collect();
    let first_ones = (0..order.len()).into_par_iter().map(|k| left(&order[k + 1..]).rms);
    let first_ones: Vec<f64> = first_ones.collect();
    let everywhere = vec![true; held.campaign.poses.len()];
    let everywhere = FitEvaluator::new(held.campaign, (held.split, &everywhere), last);
    let groups = correlation_groups(order.len(), |a, b| are_correlated(order[a], order[b], last));
    let whole = &last.hypothesis.model;
    let finding = |k: usize| {
        let one = order[k];
        let effect = whole.effects().nth(one.effect).copied()?;
        let sigma = |value: usize| sigma(one, &effect, value, (last, uncertainty));
        let (confidence, shares) = verdict::confidence(one, last);
        let stated = one.previous_priors.as_ref().and_then(|_| model.effects().nth(one.effect));
        let without = hypothesis_without(last, model, &[one]).model;
        let seen = residual_map::visibility(held.campaign, &last.surroundings, whole, &without);
        let registered = everywhere.compared(&Hypothesis::fixed(*without), last);
        let before = if k == 0 { held.rms(given) } else { first_ones[k - 1] };
        Some(Finding {
            seen,
            sigma: (0..effect.values().len()).map(sigma).collect(),
            determined: determined_values(one, &effect, last),
            effect,
            effect_index: one.effect,
            stated: stated.map(|effect| effect.values().to_vec()),
            settings: one.candidate.settings.clone(),
            confidence,
            gain: one.gain,
            alternatives: one.alternatives.iter().cloned().zip(shares).collect(),
            held_out_rms: [before, first_ones[k]],
            held_out_rms_without: alone_left_out[places[k]].rms,
            size: everywhere.size_between(&registered, last),
            group: groups[k],
        })
    };
    let findings = (0..order.len()).into_par_iter().filter_map(|k| {
        let finding = finding(k);
        steps.step();
        finding
    });
    findings.collect()
}

/// For each parameter of an effect: whether the data determine it, or it was not fitted.
fn determined_values(one: &SelectedEffect, effect: &AnyEffect, last: &Fit) -> Vec<bool> {
    let is_determined =
        |value| free_index(one, value, last).is_none_or(|free| column_index(free, last).is_some());
    (0..effect.values().len()).map(is_determined).collect()
}

/// Errors on the test set with some effects removed.
struct RemainingError {
    /// By [`FitEvaluator::energy`], m² or rad².
    energy: f64,
    /// By [`FitEvaluator::rms`], m or rad.
    rms: f64,
}

impl RemainingError {
    fn of(held: &FitEvaluator<'_>, state: &FitState) -> Self {
        let residuals = state.residuals(held.campaign);
        Self { energy: held.energy(&residuals), rms: held.rms_of(&residuals) }
    }
}

/// Correlation from which two parameters are determined only together; no unit, 0 to 1. Default 0.95: the standard uncertainty of each is then
/// three times what it would be if the other were known, `1/sqrt(1 − ρ²)`.
const CORRELATION_MIN: f64 = 0.95;

/// Whether a parameter of one effect and a parameter of the other correlate by [`CORRELATION_MIN`] or more.
fn are_correlated(one: &SelectedEffect, other: &SelectedEffect, fit: &Fit) -> bool {
    let columns = |one: &SelectedEffect| -> Vec<usize> {
        let free = fit.hypothesis.free.iter().enumerate();
        free.filter(|(_, free)| free.effect == one.effect).map(|(k, _)| fit.column_of(k)).collect()
    };
    let (columns_of_one, others) = (columns(one), columns(other));
    let mut pairs = columns_of_one.iter().flat_map(|a| others.iter().map(move |b| (*a, *b)));
    pairs.any(|(a, b)| {
        fit.correlation(a, b).is_some_and(|correlation| correlation.abs() >= CORRELATION_MIN)
    })
}

/// The connected components with two members or more of a relation between `count` items: for each item the number of its component, from 1.
fn correlation_groups(
    count: usize,
    are_together: impl Fn(usize, usize) -> bool,
) -> Vec<Option<usize>> {
    let mut groups: Vec<Option<usize>> = vec![None; count];
    let mut number = 0;
    for first in 0..count {
        if groups[first].is_some() {
            continue;
        }
        let mut members = vec![first];
        let mut next = 0;
        while next < members.len() {
            let open = (0..count).filter(|k| !members.contains(k));
            let correlated: Vec<usize> = open.filter(|k| are_together(members[next], *k)).collect();
            members.extend(correlated);
            next += 1;
        }
        if members.len() > 1 {
            number += 1;
            members.into_iter().for_each(|k| groups[k] = Some(number));
        }
    }
    groups
}

/// Index of a fitted parameter among the free parameters of the hypothesis; `None` if it was held fixed.
fn free_index(one: &SelectedEffect, value: usize, last: &Fit) -> Option<usize> {
    last.hypothesis.free.iter().position(|free| free.effect == one.effect && free.value == value)
}

/// Position of a free parameter among the fitted columns; `None` if the data do not determine it.
fn column_index(k: usize, last: &Fit) -> Option<usize> {
    last.columns().iter().position(|column| *column == last.column_of(k))
}

/// Standard uncertainty of a parameter, SI, including the spread of indistinguishable variants; `None` if it was neither fitted nor has variants.
fn sigma(
    one: &SelectedEffect,
    effect: &AnyEffect,
    value: usize,
    (last, uncertainty): (&Fit, &[f64]),
) -> Option<f64> {
    let fitted = free_index(one, value, last).map(|k| {
        // The standard uncertainty of a parameter that the data do not determine is that of its prior.
        let prior = last.hypothesis.free[k].sigma;
        let sigma = column_index(k, last).map_or(prior, |place| uncertainty[place]);
        sigma.hypot(RELATIVE_SIGMA_FLOOR * effect.values()[value])
    });
    let is_phase =
        parameter_key(effect, value).is_some_and(|key| key.parameter.unit == Unit::PhaseRadian);
    let away = |variant: &AnyEffect| {
        let away = variant.values()[value] - effect.values()[value];
        if is_phase { libm::remainder(away, TAU).abs() } else { away.abs() }
    };
    let widest = one.variants.iter().map(away).fold(0.0, f64::max) / NORMAL_QUANTILE_95;
    (fitted.is_some() || widest > 0.0).then(|| fitted.unwrap_or_default() + widest)
}

#[cfg(test)]
mod tests {
    use super::correlation_groups;

    #[test]
    fn what_is_together_with_one_of_a_group_is_of_the_group() {
        let pairs = [(0, 2), (2, 4), (3, 5)];
        let are_together = |a, b| pairs.contains(&(a, b)) || pairs.contains(&(b, a));
        let groups = correlation_groups(7, are_together);
        assert_eq!(groups, [Some(1), None, Some(1), Some(2), Some(1), Some(2), None]);
    }
}
