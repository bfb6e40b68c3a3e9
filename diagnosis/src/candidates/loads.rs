//! Counterbalance springs, and polynomials for the remaining error of a joint.
//!
//! A spring is a candidate at the joint with the largest gravity load; polynomials of a few terms are empirical descriptions and tried last.

use super::{Candidate, CandidateParameter, ParameterMapping};
use crate::campaign::Campaign;
use glam::DVec3;
use physics::{AnyEffect, Arm, Evaluation, JointKind, Loads, Memories, Model, ParameterValues};
use std::f64::consts::TAU;

/// Identifiable shape parameters of a spring: its angle, and the ratio of second to first harmonic. To first order in `a/L` the moment is
/// `k a L ((1 - s0/L) sin + (s0 a / 2 L²) sin 2)`: free length and fixed pivot are confounded.
pub(super) const SHAPE: usize = 2;
/// Joint loads below this are zero up to rounding, as for a vertical axis, Nm or N.
const ROUNDING: f64 = 1e-6;
/// Distance between the trial positions of masses, m.
const APART_M: f64 = 0.2;
/// Number of trial angles of a spring.
const ANGLES: u32 = 24;
/// Distance of the moving pivot from the axis, m: fixed, because only ratios of lengths are identifiable.
const CARRIED_M: f64 = 0.5;
/// Trial distances of the fixed pivot, as fractions of that of the moving one.
const FIXED: [f64; 3] = [0.25, 0.5, 0.75];
/// Trial free lengths, as fractions of the same distance.
const FREE_LENGTHS: [f64; 3] = [0.3, 0.6, 0.9];
/// Chebyshev terms of a joint error polynomial, including the constant; the first two are equivalent to an offset and a ratio, and stay zero.
const TERMS: usize = 6;
const FIRST_TERM: usize = 2;
/// Least number of different positions per term.
const DENSE: usize = 5;
/// Positions closer than this are equal, rad or m.
const SAME: f64 = 1e-4;

/// A mass at the flange at an unknown position: four masses at fixed corners, since the problem is linear in mass and first moment, but not in
/// position.
pub(super) fn payload(arm: &Arm) -> Option<Candidate> {
    let corners = std::iter::once(DVec3::ZERO).chain(DVec3::AXES);
    let one = |corner: DVec3| {
        let com = (arm.tool.tcp + corner * APART_M).to_array();
        let given: &[(&str, &[f64])] = &[("mass", &[0.0]), ("com", &com)];
        let effect = AnyEffect::build("payload", arm, None, ParameterValues(given)).ok()?;
        Some(CandidateParameter { effect, value: 0 })
    };
    let probes = corners.map(one).collect::<Option<Vec<CandidateParameter>>>()?;
    let slot = super::slot(&probes.first()?.effect);
    Some(Candidate {
        slot,
        joint: None,
        probes,
        settings: Vec::new(),
        mapping: ParameterMapping::Masses,
    })
}

/// The sum of masses at their centre of mass; `None` if the total mass gives no finite centre.
pub(super) fn at_centre_of_mass(probes: &[CandidateParameter], found: &[f64]) -> Option<AnyEffect> {
    let place = |effect: &AnyEffect| match effect.values() {
        [_, x, y, z] => DVec3::new(*x, *y, *z),
        _ => DVec3::ZERO,
    };
    let mut effect = probes.first()?.effect;
    let mass: f64 = found.iter().sum();
    let moment: DVec3 = probes.iter().zip(found).map(|(p, m)| place(&p.effect) * *m).sum();
    let middle = moment / mass;
    middle.is_finite().then(|| {
        effect.values_mut().copy_from_slice(&[mass, middle.x, middle.y, middle.z]);
        effect
    })
}

/// Masses at the corners that are equivalent to one mass at `middle`.
pub(super) fn as_corner_masses(
    probes: &[CandidateParameter],
    mass: f64,
    middle: &[f64],
) -> Vec<f64> {
    let place =
        |probe: &CandidateParameter| probe.effect.values().get(1..).unwrap_or_default().to_vec();
    let first = probes.first().map(place).unwrap_or_default();
    let away = |axis: usize| {
        let from = first.get(axis).copied().unwrap_or_default();
        mass * (middle.get(axis).copied().unwrap_or_default() - from) / APART_M
    };
    let others: Vec<f64> = (0..probes.len().saturating_sub(1)).map(away).collect();
    std::iter::once(mass - others.iter().sum::<f64>()).chain(others).collect()
}

/// Springs at the joint with the largest gravity load.
pub(super) fn springs(arm: &Arm, campaign: &Campaign) -> Vec<Candidate> {
    let turns = |joint: &usize| arm.joints()[*joint].kind == JointKind::Revolute;
    let hangs = |j: usize| move |loads: &Loads| loads.gravity_torque[j] + loads.wrench_torque[j];
    let loads = (0..arm.count()).filter(turns).map(|j| (largest_load(arm, campaign, hangs(j)), j));
    let most = loads.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(load, _)| *load > 0.0);
    most.map_or_else(Vec::new, |(_, joint)| springs_at(arm, joint))
}

/// Springs of all trial shapes at a joint.
pub(crate) fn springs_at(arm: &Arm, joint: usize) -> Vec<Candidate> {
    let shapes = FIXED.iter().flat_map(|a| FREE_LENGTHS.iter().map(move |free| (*a, *free)));
    let all = shapes.flat_map(|shape| (0..ANGLES).map(move |k| (shape, k)));
    let one = |((a, free), k): ((f64, f64), u32)| {
        let angle = f64::from(k) * TAU / f64::from(ANGLES);
        let given: &[(&str, &[f64])] = &[
            ("stiffness", &[0.0]),
            ("free_length", &[free * CARRIED_M]),
            ("a", &[a * CARRIED_M]),
            ("L", &[CARRIED_M]),
            ("angle", &[angle]),
        ];
        let effect =
            AnyEffect::build("counterbalance", arm, Some(joint), ParameterValues(given)).ok()?;
        let probes = vec![CandidateParameter { effect, value: 0 }];
        let slot = super::slot(&effect);
        Some(Candidate {
            slot,
            joint: Some(joint),
            probes,
            settings: Vec::new(),
            mapping: ParameterMapping::Spring,
        })
    };
    all.filter_map(one).collect()
}

/// The compliance of each joint that carries a weight; none if a varying wrench determines each of them separately.
pub(crate) fn loaded_compliances(arm: &Arm, campaign: &Campaign) -> Vec<Candidate> {
    let wrenches = campaign.poses.iter().map(|pose| pose.inputs.wrench_base);
    if wrenches.clone().zip(wrenches.skip(1)).any(|(one, next)| one != next) {
        return Vec::new();
    }
    let one = |joint: usize| {
        let carries_load = largest_load(arm, campaign, |loads| loads.torque(joint)) > 0.0;
        let given: &[(&str, &[f64])] = &[("compliance", &[0.0])];
        let built = AnyEffect::build("joint_compliance", arm, Some(joint), ParameterValues(given));
        built.ok().filter(|_| carries_load).map(|effect| Candidate::of_values(&effect))
    };
    (0..arm.count()).filter_map(one).collect()
}

/// An empirical polynomial of each joint's error over the measured positions, if these are dense enough: between few positions it would oscillate.
pub(crate) fn joint_polynomials(arm: &Arm, campaign: &Campaign, used: &[bool]) -> Vec<Candidate> {
    let one = |joint: usize| {
        let used = campaign.poses.iter().zip(used).filter(|(_, used)| **used);
        let mut positions: Vec<f64> = used.map(|(pose, _)| pose.inputs.q[joint]).collect();
        positions.sort_by(f64::total_cmp);
        positions.dedup_by(|a, b| (*a - *b).abs() < SAME);
        if positions.len() < DENSE * (TERMS - FIRST_TERM) {
            return None;
        }
        let (low, high) = positions
            .iter()
            .copied()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| (l.min(q), h.max(q)));
        let range = [low, high];
        let given: &[(&str, &[f64])] = &[("coefficients", &[0.0; TERMS]), ("range", &range)];
        let effect =
            AnyEffect::build("joint_polynomial", arm, Some(joint), ParameterValues(given)).ok()?;
        Some(Candidate {
            slot: super::slot(&effect),
            joint: Some(joint),
            probes: (FIRST_TERM..TERMS).map(|value| CandidateParameter { effect, value }).collect(),
            settings: vec![("range", range.to_vec())],
            mapping: ParameterMapping::Part,
        })
    };
    (0..arm.count()).filter_map(one).collect()
}

/// Largest absolute value of a joint load over the campaign, Nm or N; zero if it is rounding.
pub(super) fn largest_load(
    arm: &Arm,
    campaign: &Campaign,
    quantity: impl Fn(&Loads) -> f64,
) -> f64 {
    let (model, memories) = (Model::nominal(*arm), Memories::default());
    let mut evaluation = Evaluation::default();
    let load = |pose: &crate::Pose| {
        model.evaluate_into(&pose.inputs, &memories, &mut evaluation);
        quantity(&evaluation.loads).abs()
    };
    let most = campaign.poses.iter().map(load).fold(0.0, f64::max);
    if most > ROUNDING { most } else { 0.0 }
}
