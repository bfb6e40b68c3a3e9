//! Parameters of the selected effects of a cut, with uncertainties and alternatives.
//!
//! Alternatives are fitted by the nonlinear model, since a large effect (a scale error of 20 %) changes all other parameters. Keys as in
//! docs/reference/effects.md, SI units.

use glam::DVec2;
use nalgebra::DMatrix;
use physics::Model;

use super::case::Case;
use super::names::{TONE, slot};
use super::sets::price_of;
use crate::engine::library::Family;
use crate::engine::posterior::posterior;
use crate::engine::stepwise::{Search, Selection, others};
use crate::torque::{Number, Rival};

/// Relative standard uncertainty of a parameter that does not decrease with noise.
const FLOOR: f64 = 5e-3;
/// Effects whose criteria differ by less, in log-likelihood, are indistinguishable.
const ALIKE: f64 = 5.0;
/// Alternatives further behind in log-likelihood are not listed.
const FAR: f64 = 12.0;
/// Minimum share of an effect's gain that an alternative must explain by the linearised model to be fitted by the nonlinear one.
const SHARES: f64 = 0.5;
/// Minimum improvement of the criterion for an alternative to replace an effect.
const BETTER: f64 = 1.0;

/// An effect with its gain, posterior probability and alternatives.
pub(super) struct Weighed {
    pub(super) gain: f64,
    pub(super) confidence: f64,
    pub(super) rivals: Vec<Rival>,
    /// Whether its gain is smaller than its penalty.
    pub(super) is_idle: bool,
}

impl Weighed {
    /// The alternative with a better criterion than the effect, if there is one.
    pub(super) fn better(&self, search: &Search<'_>) -> Option<usize> {
        let penalty = search.criterion().per_parameter();
        let cost = |one: &Rival| one.behind + one.dearer * penalty;
        let best = self.rivals.iter().min_by(|a, b| cost(a).total_cmp(&cost(b)))?;
        (cost(best) < -BETTER).then_some(best.place)
    }
}

/// Gain of an effect by the nonlinear model, and its alternatives.
pub(super) fn weighed(
    case: &Case,
    search: &Search<'_>,
    selection: &Selection,
    name: usize,
    used: &[bool],
) -> Weighed {
    let families = &search.library.families;
    let own = &families[name];
    let others = others(&selection.names, name);
    let misfit = |names: &[usize]| case.fitted(&case.belief, &search.columns(names), used).1;
    let whole = misfit(&selection.names);
    let gain = misfit(&others) - whole;
    let without = search.solve(&others);
    let by_slopes = selection.solved.gain - without.solved.gain;
    let penalty = search.criterion().per_parameter();
    let cost = |one: &Rival| one.behind + one.dearer * penalty;
    let mut rivals: Vec<Rival> = Vec::new();
    for (place, family) in families.iter().enumerate() {
        let is_taken = others.iter().any(|n| families[*n].kind == family.kind);
        if is_taken || family.kind == own.kind {
            continue;
        }
        if search.brings(&without, place) < SHARES * by_slopes {
            continue;
        }
        let names: Vec<usize> = others.iter().copied().chain([place]).collect();
        let behind = misfit(&names) - whole;
        // In units of the penalty per parameter, so that a choice among many forms counts as part of one.
        let dearer = (price_of(search, family) - price_of(search, own)) / penalty;
        if behind > FAR {
            continue;
        }
        let rival = Rival {
            kind: family.kind,
            joint: None,
            place,
            stems: Vec::new(),
            behind,
            dearer,
            // An alternative that needs more parameters for the same fit is worse by their penalty.
            alike: behind + dearer.max(0.0) * penalty < ALIKE,
            confidence: 0.0,
        };
        match rivals.iter().position(|one| one.kind == rival.kind) {
            Some(at) if cost(&rivals[at]) > cost(&rival) => rivals[at] = rival,
            Some(_) => {}
            None => rivals.push(rival),
        }
    }
    // The null hypothesis, without any effect, is an alternative too.
    let nothing = gain - price_of(search, own);
    let losses: Vec<f64> = rivals.iter().map(cost).chain([nothing]).collect();
    let (confidence, shares) = posterior(&losses);
    rivals.iter_mut().zip(shares).for_each(|(rival, share)| rival.confidence = share);
    rivals.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
    rivals.retain(|rival| rival.kind != TONE);
    let is_idle = gain < price_of(search, own);
    Weighed { gain, confidence, rivals, is_idle }
}

/// The effects with one replaced by a more probable alternative, if there is one.
pub(super) fn likelier(case: &Case, names: &[usize], used: &[bool]) -> Option<Vec<usize>> {
    let products = case.products(used);
    let search = Search { library: &case.library, products: &products, always: &case.always };
    let selection = search.solve(names);
    names.iter().find_map(|name| {
        let better = weighed(case, &search, &selection, *name, used).better(&search)?;
        Some(with_instead(names, *name, better))
    })
}

/// The effects with one replaced by another.
pub(super) fn with_instead(names: &[usize], name: usize, other: usize) -> Vec<usize> {
    names.iter().map(|n| if *n == name { other } else { *n }).collect()
}

/// Parameters of an effect as differences to the model, with standard uncertainties.
pub(super) fn numbers(
    case: &Case,
    model: &Model,
    search: &Search<'_>,
    selection: &Selection,
    family: &Family,
    covariance: &DMatrix<f64>,
) -> Vec<Number> {
    let slot = slot(family.kind);
    let values = slot.of(&case.belief.numbers).to_vec();
    let sigma: Vec<f64> = (0..slot.count)
        .map(|k| doubt(case, search, selection, slot.from + k, covariance).hypot(FLOOR * values[k]))
        .collect();
    let many = |stem, values: Vec<f64>, sigma: Vec<f64>| vec![Number { stem, values, sigma }];
    match family.kind {
        "runout" => runout(case, model, &values, &sigma),
        "wrench_scale" => {
            let six = |list: &[f64]| list.iter().copied().chain([0.0; 3]).collect();
            many("scale", six(&values), six(&sigma))
        }
        "tool_wear" => many("growth", values, sigma),
        "wrench_bias" => many("bias", values, sigma),
        "wrench_misalignment" => many("turn", values, sigma),
        "cross_talk" => many("matrix", values, sigma),
        "chatter" => {
            let amplitude = libm::sqrt(values.iter().map(|x| x * x).sum());
            let pull: f64 = values.iter().zip(&sigma).map(|(x, s)| x * x * s * s).sum();
            let sigma = libm::sqrt(pull) / amplitude.max(f64::MIN_POSITIVE);
            let frequency = case.law.tone_hz;
            let lasts_s = case.law.rows.iter().map(|stood| stood.time_s).fold(0.0, f64::max);
            // Standard uncertainty of a frequency from that of the phase (Rife and Boorstyn 1974).
            let sharp = libm::sqrt(6.0) * sigma
                / (amplitude.max(f64::MIN_POSITIVE) * std::f64::consts::PI * lasts_s.max(1e-9));
            let least = 0.25 / lasts_s.max(1e-9);
            vec![
                Number {
                    stem: "frequency",
                    values: vec![frequency],
                    sigma: vec![sharp.max(least)],
                },
                Number { stem: "amplitude", values: vec![amplitude], sigma: vec![sigma] },
            ]
        }
        _ => many("coefficient", values, sigma),
    }
}

/// Standard uncertainty of one parameter: from the fit, or, if the effect's form does not include it, from a fit extended by it.
fn doubt(
    case: &Case,
    search: &Search<'_>,
    selection: &Selection,
    number: usize,
    covariance: &DMatrix<f64>,
) -> f64 {
    let weights = |columns: &[usize]| -> Vec<f64> {
        let of = |k: &usize| {
            let parts = case.directions[*k].iter().filter(|(at, _)| *at == number);
            parts.map(|(_, weight)| *weight).sum::<f64>()
        };
        columns.iter().map(of).collect()
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
    let mut columns = search.columns(&selection.names);
    columns.push(number);
    let solved = search.products.solve(&columns);
    spread(solved.covariance(), &weights(&solved.columns))
}

/// Runout as radius and phase, as differences to the model.
fn runout(case: &Case, model: &Model, values: &[f64], sigma: &[f64]) -> Vec<Number> {
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
    let across = if case.law.cutter.teeth == 2 { 1.0 } else { across };
    let phase = if whole.y == 0.0 && whole.x < 0.0 {
        std::f64::consts::PI
    } else {
        libm::atan2(whole.y, whole.x)
    };
    let (had, at) = if stated.length() > 0.0 {
        (stated.length(), libm::atan2(stated.y, stated.x))
    } else {
        (0.0, 0.0)
    };
    vec![
        Number { stem: "radial", values: vec![radial - had], sigma: vec![along] },
        Number { stem: "phase", values: vec![phase - at], sigma: vec![across] },
    ]
}
