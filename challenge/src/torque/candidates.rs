//! Alternatives to a hidden torque effect: every effect that could explain this recording. Nonlinear parameters are taken from a grid, one form per
//! grid point; effects whose inputs were not recorded are excluded.

use crate::candidates::Candidate;
use crate::law::{Law, Trial};

use super::case::Case;
use super::kinds::{Effect, Kind, Need};

/// Whether a kind is possible on a joint.
#[must_use]
pub fn fits(case: &Case, kind: Kind, joint: usize) -> bool {
    kind.facts().needs.iter().all(|need| match need {
        Need::Temperature => case.motion.warms,
        Need::OwnViscous => case.known_of(Kind::ViscousFriction, joint).is_some(),
        Need::OwnSpring => case.known_of(Kind::Spring, joint).is_some(),
        Need::Revolute => !case.rig.slides,
        Need::Several | Need::Arm => case.rig.count() > 1,
    })
}

/// All candidates.
#[must_use]
pub fn candidates(case: &Case) -> Vec<Candidate<Effect>> {
    let mut all = Vec::new();
    for kind in Kind::LIBRARY {
        let facts = kind.facts();
        let Some(name) = facts.name else { continue };
        let joints = if facts.of_joint { 0..case.rig.count() } else { 0..1 };
        for joint in joints.filter(|joint| fits(case, kind, *joint)) {
            all.push(Candidate {
                name,
                joint: facts.of_joint.then_some(joint + 1),
                count: free_numbers(case, kind),
                not_negative: facts.not_negative,
                forms: forms(case, kind, joint),
            });
        }
    }
    all
}

/// Number of free parameters: of a payload, a linear axis determines only the mass, and a single revolute axis no position along it.
fn free_numbers(case: &Case, kind: Kind) -> usize {
    match (kind, case.rig.count(), case.rig.slides) {
        (Kind::Payload, _, true) => 1,
        (Kind::Payload, 1, false) => 3,
        _ => kind.count(),
    }
}

fn forms(case: &Case, kind: Kind, joint: usize) -> Vec<Vec<Effect>> {
    let one = |numbers: &[f64]| Effect::of(kind, joint, numbers);
    let room = case.rig.rooms[joint];
    let unit = |k: usize| {
        let mut numbers = vec![0.0; kind.count()];
        numbers[k] = 1.0;
        one(&numbers)
    };
    match kind {
        Kind::StribeckFriction => {
            let speeds = [0.02, 0.06, 0.2].map(|share| share * room.fastest);
            speeds.iter().map(|speed| vec![one(&[1.0, *speed])]).collect()
        }
        Kind::Hysteresis => {
            let ways = [0.004, 0.02, 0.1].map(|share| share * room.reach);
            ways.iter().map(|way| vec![one(&[1.0, *way])]).collect()
        }
        Kind::TorqueRipple => {
            let quarter = std::f64::consts::FRAC_PI_2;
            let wave = |n: f64| vec![one(&[1.0, n, 0.0]), one(&[1.0, n, quarter])];
            let slow = if case.rig.slides { 0.25 / room.reach } else { 1.0 };
            [1.0, 2.0, 3.0, 5.0, 8.0].iter().map(|n| wave(n * slow)).collect()
        }
        Kind::Spring => {
            vec![vec![one(&[1.0, room.home]), Effect::of(Kind::AsymmetryOffset, joint, &[1.0])]]
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
