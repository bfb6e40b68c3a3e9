//! Alternatives to a hidden torque effect: every effect that could explain this recording. Nonlinear parameters are taken from a grid, one form per
//! grid point; effects whose inputs were not recorded are excluded.

use crate::candidates::Candidate;
use crate::effect::{BlindCase, EffectKind};

use super::case::TorqueCase;
use super::kinds::{Effect, Kind, Requirement};

/// Whether a kind is possible on a joint.
#[must_use]
pub fn is_observable(case: &TorqueCase, kind: Kind, joint: usize) -> bool {
    kind.spec().needs.iter().all(|need| match need {
        Requirement::Temperature => case.motion.has_temperatures,
        Requirement::OwnViscous => case.modelled_effect(Kind::ViscousFriction, joint).is_some(),
        Requirement::OwnSpring => case.modelled_effect(Kind::Spring, joint).is_some(),
        Requirement::Revolute => !case.rig.is_prismatic,
        Requirement::Several | Requirement::Arm => case.rig.count() > 1,
    })
}

/// All candidates.
#[must_use]
pub fn candidates(case: &TorqueCase) -> Vec<Candidate<Effect>> {
    let mut all = Vec::new();
    for kind in Kind::DICTIONARY {
        let spec = kind.spec();
        let Some(name) = spec.name else { continue };
        let joints = if spec.per_joint { 0..case.rig.count() } else { 0..1 };
        for joint in joints.filter(|joint| is_observable(case, kind, *joint)) {
            all.push(Candidate {
                name,
                joint: spec.per_joint.then_some(joint + 1),
                parameter_count: free_parameter_count(case, kind),
                non_negative: spec.non_negative,
                forms: forms(case, kind, joint),
            });
        }
    }
    all
}

/// Number of free parameters: of a payload, a linear axis determines only the mass, and a single revolute axis no position along it.
fn free_parameter_count(case: &TorqueCase, kind: Kind) -> usize {
    match (kind, case.rig.count(), case.rig.is_prismatic) {
        (Kind::Payload, _, true) => 1,
        (Kind::Payload, 1, false) => 3,
        _ => kind.count(),
    }
}

fn forms(case: &TorqueCase, kind: Kind, joint: usize) -> Vec<Vec<Effect>> {
    let one = |parameters: &[f64]| Effect::of(kind, joint, parameters);
    let range = case.rig.ranges[joint];
    let unit = |k: usize| {
        let mut parameters = vec![0.0; kind.count()];
        parameters[k] = 1.0;
        one(&parameters)
    };
    match kind {
        Kind::StribeckFriction => {
            let speeds = [0.02, 0.06, 0.2].map(|share| share * range.max_speed);
            speeds.iter().map(|speed| vec![one(&[1.0, *speed])]).collect()
        }
        Kind::Hysteresis => {
            let ways = [0.004, 0.02, 0.1].map(|share| share * range.half_range);
            ways.iter().map(|way| vec![one(&[1.0, *way])]).collect()
        }
        Kind::TorqueRipple => {
            let quarter = std::f64::consts::FRAC_PI_2;
            let wave = |n: f64| vec![one(&[1.0, n, 0.0]), one(&[1.0, n, quarter])];
            let slow = if case.rig.is_prismatic { 0.25 / range.half_range } else { 1.0 };
            [1.0, 2.0, 3.0, 5.0, 8.0].iter().map(|n| wave(n * slow)).collect()
        }
        Kind::Spring => {
            vec![vec![one(&[1.0, range.centre]), Effect::of(Kind::AsymmetryOffset, joint, &[1.0])]]
        }
        Kind::FrictionTemperature => vec![vec![one(&[1e-3])]],
        Kind::DriveGain => vec![vec![one(&[1e-2])]],
        Kind::TorqueDelay => vec![vec![one(&[2e-4])]],
        Kind::Payload => {
            let tcp = case.rig.tcp();
            let at = |by: [f64; 3]| one(&[1.0, tcp[0] + by[0], tcp[1] + by[1], tcp[2] + by[2]]);
            vec![vec![at([0.0; 3]), at([0.1, 0.0, 0.0]), at([0.0, 0.1, 0.0]), at([0.0, 0.0, 0.1])]]
        }
        _ => vec![(0..kind.count()).map(unit).collect()],
    }
}
