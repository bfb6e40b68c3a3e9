//! Parameters of the selected effects of a cut, with uncertainties and alternatives.
//!
//! Alternatives are fitted by the nonlinear model, since a large effect (a scale error of 20 %) changes all other parameters. Keys as in
//! docs/reference/effects.md, SI units.

use glam::DVec2;
use nalgebra::DMatrix;
use physics::Model;

use super::beam_search::penalty_with_forms;
use super::candidates::{PERMANENT_TONE_KIND, parameters_of_kind};
use super::case::Case;
use crate::engine::dictionary::CandidateTerm;
use crate::engine::posterior::posterior;
use crate::engine::stepwise::{TermSearch, TermSelection, without_term};
use crate::torque::{AlternativeEffect, FittedParameter};

/// Relative standard uncertainty of a parameter that does not decrease with noise.
const RELATIVE_SIGMA_LEAST: f64 = 5e-3;
/// Effects whose criteria differ by less, in log-likelihood, are indistinguishable.
const INDISTINGUISHABLE: f64 = 5.0;
/// Alternatives further behind in log-likelihood are not listed.
const LISTED_LOSS_MOST: f64 = 12.0;
/// Minimum share of an effect's gain that an alternative must explain by the linearised model to be fitted by the nonlinear one.
const GAIN_SHARE_LEAST: f64 = 0.5;
/// Minimum improvement of the criterion for an alternative to replace an effect.
const IMPROVEMENT_LEAST: f64 = 1.0;

/// An effect with its gain, posterior probability and alternatives.
pub(super) struct AssessedEffect {
    pub(super) gain: f64,
    pub(super) confidence: f64,
    pub(super) alternatives: Vec<AlternativeEffect>,
    /// Whether its gain is smaller than its penalty.
    pub(super) is_below_penalty: bool,
}

impl AssessedEffect {
    /// The alternative with a better criterion than the effect, if there is one.
    pub(super) fn better_alternative(&self, search: &TermSearch<'_>) -> Option<usize> {
        let penalty = search.criterion().per_parameter();
        let cost = |one: &AlternativeEffect| one.likelihood_loss + one.extra_parameters * penalty;
        let best = self.alternatives.iter().min_by(|a, b| cost(a).total_cmp(&cost(b)))?;
        (cost(best) < -IMPROVEMENT_LEAST).then_some(best.candidate)
    }
}

/// Gain of an effect by the nonlinear model, and its alternatives.
pub(super) fn assess_effect(
    case: &Case,
    search: &TermSearch<'_>,
    selection: &TermSelection,
    name: usize,
    used: &[bool],
) -> AssessedEffect {
    let families = &search.library.terms;
    let effect = &families[name];
    let others = without_term(&selection.terms, name);
    let misfit =
        |names: &[usize]| case.fit_nonlinear(&case.estimates, &search.columns(names), used).1;
    let whole = misfit(&selection.terms);
    let gain = misfit(&others) - whole;
    let without = search.solve(&others);
    let by_slopes = selection.solved.gain - without.solved.gain;
    let penalty = search.criterion().per_parameter();
    let cost = |one: &AlternativeEffect| one.likelihood_loss + one.extra_parameters * penalty;
    let mut alternatives: Vec<AlternativeEffect> = Vec::new();
    for (candidate, family) in families.iter().enumerate() {
        let is_taken = others.iter().any(|n| families[*n].kind == family.kind);
        if is_taken || family.kind == effect.kind {
            continue;
        }
        if search.gain_beside(&without, candidate) < GAIN_SHARE_LEAST * by_slopes {
            continue;
        }
        let names: Vec<usize> = others.iter().copied().chain([candidate]).collect();
        let likelihood_loss = misfit(&names) - whole;
        // In units of the penalty per parameter, so that a choice among many forms counts as part of one.
        let extra_parameters =
            (penalty_with_forms(search, family) - penalty_with_forms(search, effect)) / penalty;
        if likelihood_loss > LISTED_LOSS_MOST {
            continue;
        }
        let rival = AlternativeEffect {
            kind: family.kind,
            joint: None,
            candidate,
            stems: Vec::new(),
            likelihood_loss,
            extra_parameters,
            // An alternative that needs more parameters for the same fit is worse by their penalty.
            is_indistinguishable: likelihood_loss + extra_parameters.max(0.0) * penalty
                < INDISTINGUISHABLE,
            confidence: 0.0,
        };
        match alternatives.iter().position(|one| one.kind == rival.kind) {
            Some(index) if cost(&alternatives[index]) > cost(&rival) => alternatives[index] = rival,
            Some(_) => {}
            None => alternatives.push(rival),
        }
    }
    // The null hypothesis, without any effect, is an alternative too.
    let nothing = gain - penalty_with_forms(search, effect);
    let losses: Vec<f64> = alternatives.iter().map(cost).chain([nothing]).collect();
    let (confidence, shares) = posterior(&losses);
    alternatives.iter_mut().zip(shares).for_each(|(rival, share)| rival.confidence = share);
    alternatives.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
    alternatives.retain(|rival| rival.kind != PERMANENT_TONE_KIND);
    let is_below_penalty = gain < penalty_with_forms(search, effect);
    AssessedEffect { gain, confidence, alternatives, is_below_penalty }
}

/// The effects with one replaced by a more probable alternative, if there is one.
pub(super) fn with_likelier_alternative(
    case: &Case,
    names: &[usize],
    used: &[bool],
) -> Option<Vec<usize>> {
    let products = case.products(used);
    let search = TermSearch { library: &case.library, products: &products, always: &case.always };
    let selection = search.solve(names);
    names.iter().find_map(|name| {
        let better =
            assess_effect(case, &search, &selection, *name, used).better_alternative(&search)?;
        Some(with_replacement(names, *name, better))
    })
}

/// The effects with one replaced by another.
pub(super) fn with_replacement(names: &[usize], name: usize, other: usize) -> Vec<usize> {
    names.iter().map(|n| if *n == name { other } else { *n }).collect()
}

/// Parameters of an effect as differences to the model, with standard uncertainties.
pub(super) fn parameters_of(
    case: &Case,
    model: &Model,
    search: &TermSearch<'_>,
    selection: &TermSelection,
    family: &CandidateTerm,
    covariance: &DMatrix<f64>,
) -> Vec<FittedParameter> {
    let slot = parameters_of_kind(family.kind);
    let values = slot.of(&case.estimates.parameters).to_vec();
    let sigma: Vec<f64> = (0..slot.count)
        .map(|k| {
            parameter_sigma(case, search, selection, slot.from + k, covariance)
                .hypot(RELATIVE_SIGMA_LEAST * values[k])
        })
        .collect();
    let single_parameter =
        |stem, values: Vec<f64>, sigma: Vec<f64>| vec![FittedParameter { stem, values, sigma }];
    match family.kind {
        "runout" => runout_polar(case, model, &values, &sigma),
        "wrench_scale" => {
            let six = |list: &[f64]| list.iter().copied().chain([0.0; 3]).collect();
            single_parameter("scale", six(&values), six(&sigma))
        }
        "tool_wear" => single_parameter("growth", values, sigma),
        "wrench_bias" => single_parameter("bias", values, sigma),
        "wrench_misalignment" => single_parameter("turn", values, sigma),
        "cross_talk" => single_parameter("matrix", values, sigma),
        "chatter" => {
            let amplitude = libm::sqrt(values.iter().map(|x| x * x).sum());
            let pull: f64 = values.iter().zip(&sigma).map(|(x, s)| x * x * s * s).sum();
            let sigma = libm::sqrt(pull) / amplitude.max(f64::MIN_POSITIVE);
            let frequency = case.model.tone_hz;
            let lasts_s = case.model.rows.iter().map(|state| state.time_s).fold(0.0, f64::max);
            // Standard uncertainty of a frequency from that of the phase (Rife and Boorstyn 1974).
            let sharp = libm::sqrt(6.0) * sigma
                / (amplitude.max(f64::MIN_POSITIVE) * std::f64::consts::PI * lasts_s.max(1e-9));
            let resolution = 0.25 / lasts_s.max(1e-9);
            vec![
                FittedParameter {
                    stem: "frequency",
                    values: vec![frequency],
                    sigma: vec![sharp.max(resolution)],
                },
                FittedParameter { stem: "amplitude", values: vec![amplitude], sigma: vec![sigma] },
            ]
        }
        _ => single_parameter("coefficient", values, sigma),
    }
}

/// Standard uncertainty of one parameter: from the fit, or, if the effect's form does not include it, from a fit extended by it.
fn parameter_sigma(
    case: &Case,
    search: &TermSearch<'_>,
    selection: &TermSelection,
    number: usize,
    covariance: &DMatrix<f64>,
) -> f64 {
    let weights = |columns: &[usize]| -> Vec<f64> {
        let weight_of = |k: &usize| {
            let parts =
                case.column_parameters[*k].iter().filter(|(parameter, _)| *parameter == number);
            parts.map(|(_, weight)| *weight).sum::<f64>()
        };
        columns.iter().map(weight_of).collect()
    };
    let spread = |covariance: &DMatrix<f64>, weights: &[f64]| {
        let mut sum = 0.0;
        for (i, a) in weights.iter().enumerate() {
            for (j, b) in weights.iter().enumerate() {
                sum += a * b * covariance[(i, j)];
            }
        }
        libm::sqrt(sum.max(0.0))
    };
    let inside = weights(&selection.solved.columns);
    if inside.iter().any(|weight| *weight != 0.0) {
        return spread(covariance, &inside);
    }
    let mut columns = search.columns(&selection.terms);
    columns.push(number);
    let solved = search.products.solve(&columns);
    spread(solved.covariance(), &weights(&solved.columns))
}

/// Runout as radius and phase, as differences to the model.
fn runout_polar(case: &Case, model: &Model, values: &[f64], sigma: &[f64]) -> Vec<FittedParameter> {
    let runouts = model.effects().filter(|effect| effect.spec().kind == "runout");
    let stated: DVec2 = runouts
        .map(|effect| match effect.values() {
            [radial, phase, ..] => DVec2::from_angle(*phase) * *radial,
            _ => DVec2::ZERO,
        })
        .sum();
    let whole = stated + DVec2::new(values[0], values[1]);
    let radial = whole.length().max(f64::MIN_POSITIVE);
    let along = (whole.x * sigma[0]).hypot(whole.y * sigma[1]) / radial;
    let across = (whole.y * sigma[0]).hypot(whole.x * sigma[1]) / (radial * radial);
    // With two teeth, only one direction of the runout has an influence.
    let across = if case.model.cutter.teeth == 2 { 1.0 } else { across };
    let phase = if whole.y == 0.0 && whole.x < 0.0 {
        std::f64::consts::PI
    } else {
        libm::atan2(whole.y, whole.x)
    };
    let (stated_radial, stated_phase) = if stated.length() > 0.0 {
        (stated.length(), libm::atan2(stated.y, stated.x))
    } else {
        (0.0, 0.0)
    };
    vec![
        FittedParameter {
            stem: "radial",
            values: vec![radial - stated_radial],
            sigma: vec![along],
        },
        FittedParameter { stem: "phase", values: vec![phase - stated_phase], sigma: vec![across] },
    ]
}
