//! Converts fitted columns to parameters of effects, and log-likelihoods to posterior probabilities. Parameter names as in docs/reference/effects.md,
//! SI units.

use glam::DVec3;
use nalgebra::DMatrix;

use super::payload::REACH_M;
use crate::engine::dictionary::{CandidateTerm, CoefficientForm};
use crate::engine::normal_equations::LeastSquaresSolution;
use crate::engine::posterior::posterior;
use crate::engine::stepwise::{TermSearch, TermSelection, without_term};

/// Relative standard uncertainty of a parameter that does not decrease with noise: scale factors, geometry, form of the law.
const RELATIVE_SIGMA_LEAST: f64 = 5e-3;
/// Relative standard uncertainty of a motor constant, gear losses included, where torque is computed from current.
const MOTOR_CONSTANT_SIGMA: f64 = 0.1;
/// A first moment with a larger standard uncertainty, kg m, is unobservable: no arm carries as much.
const OBSERVABLE_SIGMA_MOST: f64 = 1e4;
/// Effects whose log-likelihoods differ by less are indistinguishable.
const INDISTINGUISHABLE: f64 = 5.0;
/// Smallest share of an effect's gain that an alternative must explain to be listed.
const GAIN_SHARE_LEAST: f64 = 0.5;
/// Alternatives further behind in log-likelihood are not listed.
const LISTED_LOSS_MOST: f64 = 12.0;

/// A parameter of an effect, or the components of a vector parameter, SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedParameter {
    /// Stem of the parameter's key, without unit.
    pub stem: &'static str,
    /// Values, SI units.
    pub values: Vec<f64>,
    /// Standard uncertainty of each value, SI units.
    pub sigma: Vec<f64>,
}

/// An alternative effect that explains the same.
#[derive(Clone, Debug, PartialEq)]
pub struct AlternativeEffect {
    /// Name of the effect in docs/reference/effects.md.
    pub kind: &'static str,
    /// Joint from 0; `None` if the effect concerns the whole robot.
    pub joint: Option<usize>,
    /// Index among the families of the library.
    pub(crate) candidate: usize,
    /// Stems of its parameters.
    pub stems: Vec<&'static str>,
    /// Log-likelihood of the finding minus that of this alternative.
    pub likelihood_loss: f64,
    /// Number of its parameters minus that of the finding.
    pub extra_parameters: f64,
    /// Whether these recordings cannot distinguish it from the finding.
    pub is_indistinguishable: bool,
    /// Posterior probability of this alternative, 0 to 1.
    pub confidence: f64,
}

impl AlternativeEffect {
    /// An alternative at this index of the library; its probability is computed later.
    pub(super) fn of(
        family: &CandidateTerm,
        candidate: usize,
        likelihood_loss: f64,
        extra_parameters: f64,
    ) -> Self {
        Self {
            kind: family.kind,
            joint: family.joint,
            candidate,
            stems: stems(family),
            likelihood_loss,
            extra_parameters,
            is_indistinguishable: likelihood_loss < INDISTINGUISHABLE,
            confidence: 0.0,
        }
    }
}

/// Stems of the parameters of a candidate.
pub(super) fn stems(family: &CandidateTerm) -> Vec<&'static str> {
    let mut stems = match family.form {
        CoefficientForm::Plain(stems) => stems.to_vec(),
        CoefficientForm::Loop => vec!["amplitude_N"],
        CoefficientForm::Warmth => vec!["per_K"],
        CoefficientForm::Spring => vec!["stiffness", "rest_position"],
        CoefficientForm::Wave => vec!["amplitude", "phase"],
        CoefficientForm::Moment => vec!["first_moment"],
        CoefficientForm::Payload { .. } => vec!["mass", "com"],
    };
    stems.extend(family.settings.iter().map(|(stem, _)| *stem));
    stems
}

/// Inputs of the conversion of columns to parameters.
pub(super) struct ParameterContext<'a> {
    /// Covariance of the fit's parameters.
    pub(super) covariance: &'a DMatrix<f64>,
    /// Relative standard uncertainty of the searched parameter.
    pub(super) searched_sigma: f64,
    /// Additional standard uncertainty of a column's parameter: by rows in excluded zones, and by the form of a hysteresis law.
    pub(super) systematic_sigma: &'a dyn Fn(usize) -> f64,
    /// Whether torque is computed from current, so that the uncertainty of the motor constant applies.
    pub(super) is_torque_from_current: bool,
    /// Fitted relative gain `g` of the joint's drive: the acting torque is the recorded one divided by `1 + g`.
    pub(super) gain: f64,
    /// Viscous friction of the joint, stated plus found, in units of the recorded torque.
    pub(super) viscous: f64,
}

/// Parameters of an effect with their standard uncertainties.
pub(super) fn parameters_of(
    family: &CandidateTerm,
    solved: &LeastSquaresSolution,
    context: &ParameterContext<'_>,
) -> Vec<FittedParameter> {
    let index_of = |column: usize| solved.columns.iter().position(|k| *k == column);
    let is_torque = is_torque_parameter(family.kind);
    let is_driven = is_torque || family.kind == "load_friction";
    let acting = if is_driven { 1.0 / (1.0 + context.gain) } else { 1.0 };
    let value = |k: usize| acting * solved.value(family.columns[k]).unwrap_or(0.0);
    let shared =
        |i: usize, j: usize| match (index_of(family.columns[i]), index_of(family.columns[j])) {
            (Some(a), Some(b)) => acting * acting * context.covariance[(a, b)],
            _ => 0.0,
        };
    let floor = RELATIVE_SIGMA_LEAST.hypot(if context.is_torque_from_current && is_torque {
        MOTOR_CONSTANT_SIGMA
    } else {
        0.0
    });
    let sigma = |k: usize| {
        let statistical =
            shared(k, k).max(0.0).sqrt().hypot((context.systematic_sigma)(family.columns[k]));
        statistical.hypot(floor * value(k))
    };
    let mut all = match family.form {
        CoefficientForm::Plain(stems) => {
            stems.iter().enumerate().map(|(k, stem)| scalar(stem, value(k), sigma(k))).collect()
        }
        CoefficientForm::Warmth => {
            let viscous = context.viscous;
            vec![scalar("per_K", -value(0) / viscous, sigma(0) / viscous.abs())]
        }
        // `amplitude_N` is the full height of the loop, the column's parameter half of it.
        CoefficientForm::Loop => vec![scalar("amplitude_N", 2.0 * value(0), 2.0 * sigma(0))],
        CoefficientForm::Spring => {
            let (stiffness, rest) = (value(0), -value(1) / value(0));
            let of_rest = (sigma(1) / value(0)).hypot(rest * sigma(0) / value(0));
            vec![scalar("stiffness", stiffness, sigma(0)), scalar("rest_position", rest, of_rest)]
        }
        CoefficientForm::Moment => {
            // The component along the joint's axis is unobservable: its value is rounding error.
            let observable =
                |k: usize| if sigma(k) < OBSERVABLE_SIGMA_MOST { value(k) } else { 0.0 };
            let values = (0..3).map(observable).collect();
            vec![FittedParameter {
                stem: "first_moment",
                values,
                sigma: (0..3).map(sigma).collect(),
            }]
        }
        CoefficientForm::Wave => amplitude_and_phase([value(0), value(1)], shared, floor),
        CoefficientForm::Payload { about } => {
            let sigma_of =
                |k: usize| index_of(family.columns[k]).map(|_| shared(k, k).max(0.0).sqrt());
            mass_and_centre([0, 1, 2, 3].map(value), about, sigma(0), sigma_of)
        }
    };
    // The cycles of a wave are determined by its phase, which scale errors do not affect.
    let of_form = if family.form == CoefficientForm::Wave { 0.0 } else { RELATIVE_SIGMA_LEAST };
    all.extend(family.settings.iter().map(|(stem, value)| {
        scalar(stem, *value, (context.searched_sigma.hypot(of_form) * value).abs())
    }));
    all
}

/// Amplitude and phase: `a sin(x) + b cos(x) = A sin(x + φ)`.
fn amplitude_and_phase(
    [a, b]: [f64; 2],
    shared: impl Fn(usize, usize) -> f64,
    floor: f64,
) -> Vec<FittedParameter> {
    let amplitude = a.hypot(b);
    let square = amplitude * amplitude;
    let cross = 2.0 * a * b * shared(0, 1);
    let along = (a * a * shared(0, 0) + b * b * shared(1, 1) + cross) / square;
    let across = (b * b * shared(0, 0) + a * a * shared(1, 1) - cross) / square;
    let of_amplitude = along.max(0.0).sqrt().hypot(floor * amplitude);
    let of_phase = across.max(0.0).sqrt() / amplitude;
    vec![scalar("amplitude", amplitude, of_amplitude), scalar("phase", libm::atan2(b, a), of_phase)]
}

/// Mass and centre of mass from mass and first moment about a point. A scale error of the torque cancels in the centre of mass.
fn mass_and_centre(
    [mass, moment @ ..]: [f64; 4],
    about: DVec3,
    of_mass: f64,
    sigma_of: impl Fn(usize) -> Option<f64>,
) -> Vec<FittedParameter> {
    let com = |k: usize| about[k] + moment[k] / mass;
    let of_mass_alone = sigma_of(0).unwrap_or(0.0);
    // Along an axis that no drive torque depends on, the centre of mass is only known to be within reach.
    let of_com = |k: usize| {
        let sigma_of_com =
            |sigma| libm::hypot(sigma / mass, of_mass_alone * moment[k] / (mass * mass));
        sigma_of(k + 1).map_or(REACH_M, sigma_of_com)
    };
    let values = (0..3).map(com).collect();
    let sigma = (0..3).map(of_com).collect();
    vec![scalar("mass", mass, of_mass), FittedParameter { stem: "com", values, sigma }]
}

fn scalar(stem: &'static str, value: f64, sigma: f64) -> FittedParameter {
    FittedParameter { stem, values: vec![value], sigma: vec![sigma] }
}

/// Whether an effect's leading parameters are torques, subject to the torque's scale error.
fn is_torque_parameter(kind: &str) -> bool {
    !matches!(kind, "load_friction" | "drive_gain" | "torque_delay" | "friction_temperature")
}

/// Posterior probability of a selected effect, and its alternatives in order of decreasing probability.
pub(super) fn alternatives(
    search: &TermSearch<'_>,
    selection: &TermSelection,
    name: usize,
) -> (f64, Vec<AlternativeEffect>) {
    let families = &search.library.terms;
    let others = without_term(&selection.terms, name);
    let without = search.solve(&others);
    let worth = selection.solved.gain - without.solved.gain;
    let effect = &families[name];
    let is_other = |other: &usize| {
        let form = &families[*other];
        let is_more_of_it =
            form.is_same_effect(effect) && form.columns.len() >= effect.columns.len();
        // Hardening adds to a spring and cannot replace it.
        let is_on_top = form.kind == "spring_hardening" && effect.kind == "spring";
        !(selection.terms.contains(other) || is_more_of_it || is_on_top)
    };
    let mut best: Vec<AlternativeEffect> = Vec::new();
    for other in (0..families.len()).filter(is_other) {
        let family = &families[other];
        // Only what the alternative would explain in place of the effect counts, not what it would add to it.
        let instead =
            search.alternative_gain(&without, other) - search.alternative_gain(selection, other);
        let behind = worth - instead;
        if instead < GAIN_SHARE_LEAST * worth {
            continue;
        }
        if behind > LISTED_LOSS_MOST {
            continue;
        }
        let dearer = search.parameter_count(family) - search.parameter_count(effect);
        let rival = AlternativeEffect::of(family, other, behind, dearer);
        let known = best.iter().position(|one| {
            one.kind == rival.kind && one.joint == rival.joint && one.stems == rival.stems
        });
        match known {
            Some(index) if best[index].likelihood_loss > behind => best[index] = rival,
            Some(_) => {}
            None => best.push(rival),
        }
    }
    let penalty = search.criterion().per_parameter();
    let losses: Vec<f64> =
        best.iter().map(|one| one.likelihood_loss + one.extra_parameters * penalty).collect();
    let (probability, shares) = posterior(&losses);
    best.iter_mut().zip(shares).for_each(|(rival, share)| rival.confidence = share);
    best.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
    (probability, best)
}
