//! Torque of a joint that never moves: one constant, which static friction, gravity, a spring, a bias or a drive's gain explain equally well.
//!
//! Evaluated only if nothing else was found. The result is not a claim but the set of all explanations with equal probabilities, never a parameter of
//! one of them alone. The friction model is zero at rest, so static friction is always in the set.

use physics::JointKind;

use super::case::Case;
use super::library::GAIN_RANGE;
use super::parameters::{AlternativeEffect, FittedParameter};
use super::{Finding, StatedModel};
use crate::autocorrelation::ArModel;
use crate::effect_size::EffectSize;
use crate::engine::noise;
use crate::engine::normal_equations::NormalEquations;
use crate::engine::regression_data::Regressor;

/// Minimum gain of a constant beyond its penalty, in log-likelihood.
const MARGIN: f64 = 10.0;

/// Constant torque of a joint, N m or N, with its standard uncertainty, its gain in log-likelihood, and the RMS before subtracting it.
struct ConstantTorque {
    joint: usize,
    value: f64,
    sigma: f64,
    gain: f64,
    rms: f64,
}

/// Significant constant torques, each as a set of alternative effects.
pub(super) fn findings(case: &Case, stated: &StatedModel<'_>, always: &[usize]) -> Vec<Finding> {
    let held = case
        .stationary
        .iter()
        .filter_map(|(joint, target)| constant_torque(case, *joint, target, always));
    let mut all: Vec<Finding> = held.map(|held| finding(case, stated, &held)).collect();
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    all
}

/// The constant torque of one joint, fitted together with the always-included columns; `None` if not significant.
fn constant_torque(
    case: &Case,
    joint: usize,
    target: &[f64],
    always: &[usize],
) -> Option<ConstantTorque> {
    let fitted_rows = case.row_sets.fitted();
    let mut table = case.table.clone();
    table.counts[joint] = vec![true; target.len()];
    let mean = target.iter().sum::<f64>() / target.len().max(1) as f64;
    let about: Vec<f64> = target.iter().map(|x| x - mean).collect();
    table.target[joint] = Some(target.to_vec());
    table.noise[joint] = (ArModel::default(), 1.0);
    table.noise[joint] = noise::estimate_from_residual(&table, joint, &about, &fitted_rows, 1.0);
    let one = Regressor { parts: vec![(joint, vec![1.0; target.len()].into())] };
    let mut columns: Vec<&Regressor> = always.iter().map(|k| &case.library.columns[*k]).collect();
    let mut prior: Vec<f64> = always.iter().map(|k| case.library.prior[*k]).collect();
    columns.push(&one);
    prior.push(0.0);
    let products = NormalEquations::new(&table, &columns, prior, &fitted_rows);
    let places: Vec<usize> = (0..columns.len()).collect();
    let whole = products.solve(&places);
    let gain = whole.gain - products.solve(&places[..always.len()]).gain;
    let index = whole.columns.iter().position(|k| *k == always.len())?;
    let penalty = 0.5 * (products.rows.max(3) as f64).ln() + (case.stationary.len() as f64).ln();
    let sigma = whole.covariance()[(index, index)].sqrt();
    let squares = target.iter().map(|x| x * x).sum::<f64>() / target.len().max(1) as f64;
    (gain > penalty + MARGIN).then(|| ConstantTorque {
        joint,
        value: whole.values[index],
        sigma,
        gain,
        rms: libm::sqrt(squares),
    })
}

fn finding(case: &Case, stated: &StatedModel<'_>, held: &ConstantTorque) -> Finding {
    let arm = &stated.model.arm;
    let joint = held.joint;
    let turns = arm.joints()[joint].kind == JointKind::Revolute;
    let torque = &case.stated_torque[joint];
    let usual = torque.iter().sum::<f64>() / torque.len().max(1) as f64;
    let mut others = vec![("coulomb_friction", vec!["level"])];
    if turns {
        others.push(("gravity_torque", vec!["cos", "sin"]));
    }
    others.push(("spring", vec!["stiffness", "rest_position"]));
    if (GAIN_RANGE[0]..GAIN_RANGE[1]).contains(&(held.value / usual)) {
        others.push(("drive_gain", vec!["gain"]));
    }
    let confidence = 1.0 / (others.len() + 1) as f64;
    let rival = |(kind, stems): (&'static str, Vec<&'static str>)| AlternativeEffect {
        kind,
        joint: Some(joint),
        candidate: usize::MAX,
        extra_parameters: stems.len() as f64 - 1.0,
        stems,
        likelihood_loss: 0.0,
        is_indistinguishable: true,
        confidence,
    };
    Finding {
        kind: "friction_asymmetry",
        joint: Some(joint),
        recording: None,
        is_change: false,
        parameters: vec![FittedParameter {
            stem: "offset",
            values: vec![held.value],
            sigma: vec![held.sigma],
        }],
        confidence,
        gain: held.gain,
        alternatives: others.into_iter().map(rival).collect(),
        heldout: [held.rms, (held.rms * held.rms - held.value * held.value).max(0.0).sqrt()],
        heldout_without: held.rms,
        size: EffectSize { rms: held.value.abs(), largest: held.value.abs() },
    }
}
