//! Torque of a joint that never moves: one constant, which static friction, gravity, a spring, a bias or a drive's gain explain equally well.
//!
//! Evaluated only if nothing else was found. The result is not a claim but the set of all explanations with equal probabilities, never a parameter of
//! one of them alone. The friction model is zero at rest, so static friction is always in the set.

use physics::JointKind;

use super::case::Case;
use super::found::{Number, Rival};
use super::library::GAIN;
use super::{Finding, Stated};
use crate::colour::Colour;
use crate::engine::noise;
use crate::engine::normal_equations::Products;
use crate::engine::table::Column;
use crate::size::Size;

/// Minimum gain of a constant beyond its penalty, in log-likelihood.
const MARGIN: f64 = 10.0;

/// Constant torque of a joint, N m or N, with its standard uncertainty, its gain in log-likelihood, and the RMS before subtracting it.
struct Held {
    joint: usize,
    value: f64,
    sigma: f64,
    gain: f64,
    before: f64,
}

/// Significant constant torques, each as a set of alternative effects.
pub(super) fn findings(case: &Case, stated: &Stated<'_>, always: &[usize]) -> Vec<Finding> {
    let held = case.still.iter().filter_map(|(joint, target)| held(case, *joint, target, always));
    let mut all: Vec<Finding> = held.map(|held| finding(case, stated, &held)).collect();
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    all
}

/// The constant torque of one joint, fitted together with the always-included columns; `None` if not significant.
fn held(case: &Case, joint: usize, target: &[f64], always: &[usize]) -> Option<Held> {
    let seen = case.rows.seen();
    let mut table = case.table.clone();
    table.counts[joint] = vec![true; target.len()];
    let mean = target.iter().sum::<f64>() / target.len().max(1) as f64;
    let about: Vec<f64> = target.iter().map(|x| x - mean).collect();
    table.target[joint] = Some(target.to_vec());
    table.noise[joint] = (Colour::default(), 1.0);
    table.noise[joint] = noise::of_left(&table, joint, &about, &seen, 1.0);
    let one = Column { parts: vec![(joint, vec![1.0; target.len()].into())] };
    let mut columns: Vec<&Column> = always.iter().map(|k| &case.library.columns[*k]).collect();
    let mut prior: Vec<f64> = always.iter().map(|k| case.library.prior[*k]).collect();
    columns.push(&one);
    prior.push(0.0);
    let products = Products::new(&table, &columns, prior, &seen);
    let places: Vec<usize> = (0..columns.len()).collect();
    let whole = products.solve(&places);
    let gain = whole.gain - products.solve(&places[..always.len()]).gain;
    let at = whole.columns.iter().position(|k| *k == always.len())?;
    let penalty = 0.5 * (products.rows.max(3) as f64).ln() + (case.still.len() as f64).ln();
    let sigma = whole.covariance()[(at, at)].sqrt();
    let squares = target.iter().map(|x| x * x).sum::<f64>() / target.len().max(1) as f64;
    (gain > penalty + MARGIN).then(|| Held {
        joint,
        value: whole.values[at],
        sigma,
        gain,
        before: libm::sqrt(squares),
    })
}

fn finding(case: &Case, stated: &Stated<'_>, held: &Held) -> Finding {
    let arm = &stated.model.arm;
    let joint = held.joint;
    let turns = arm.joints()[joint].kind == JointKind::Revolute;
    let torque = &case.stated[joint];
    let usual = torque.iter().sum::<f64>() / torque.len().max(1) as f64;
    let mut others = vec![("coulomb_friction", vec!["level"])];
    if turns {
        others.push(("gravity_torque", vec!["cos", "sin"]));
    }
    others.push(("spring", vec!["stiffness", "rest_position"]));
    if (GAIN[0]..GAIN[1]).contains(&(held.value / usual)) {
        others.push(("drive_gain", vec!["gain"]));
    }
    let confidence = 1.0 / (others.len() + 1) as f64;
    let rival = |(kind, stems): (&'static str, Vec<&'static str>)| Rival {
        kind,
        joint: Some(joint),
        place: usize::MAX,
        dearer: stems.len() as f64 - 1.0,
        stems,
        behind: 0.0,
        alike: true,
        confidence,
    };
    Finding {
        kind: "friction_asymmetry",
        joint: Some(joint),
        recording: None,
        is_change: false,
        numbers: vec![Number { stem: "offset", values: vec![held.value], sigma: vec![held.sigma] }],
        confidence,
        gain: held.gain,
        rivals: others.into_iter().map(rival).collect(),
        heldout: [
            held.before,
            (held.before * held.before - held.value * held.value).max(0.0).sqrt(),
        ],
        heldout_without: held.before,
        size: Size { rms: held.value.abs(), largest: held.value.abs() },
    }
}
