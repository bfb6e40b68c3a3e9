//! Random cases of torques: rig, motion, instrument and hidden effects, with a size that suits the tier.
//!
//! The same seed, index and tier give the same case; kinds are used in turn. A solver's answers have no influence.

use crate::arm::{JOINTS, Joints};
use crate::case::Tier;
use crate::chance::Chance;
use crate::draw::{asks, attempts, hide, wanted_z};
use crate::law::{Law, Trial};
use crate::scene::Richness;

use super::bench::Bench;
use super::candidates::fits;
use super::case::{Case, Known, Noise};
use super::kinds::{Effect, Kind, Need};
use super::laws::{Ride, recorded};
use super::motion::Motion;
use super::rig::Rig;

/// A generated case with the detectability of its effects.
pub type Drawn = crate::draw::Drawn<Case>;

/// Typical values of a joint.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// Root mean square of the torque, Nm or N.
    pub torque: f64,
    /// Maximum velocity, rad/s or m/s.
    pub speed: f64,
    /// Acceleration, rad/s² or m/s².
    pub acceleration: f64,
    /// Half of the range, rad or m.
    pub reach: f64,
}

/// Case `index` of a challenge, of a tier; `turn` selects the kind among those of the tier.
#[must_use]
pub fn case(seed: u64, index: usize, (tier, turn): (Tier, usize)) -> Drawn {
    let number = index as u64;
    let drawn =
        attempts(seed, number, turn, |seed, turn, chance| attempt_at(seed, turn, tier, chance));
    drawn.unwrap_or_else(|| {
        let mut chance = Chance::new(seed, number * 1000 + 999);
        let case = empty(number, Tier::Null, &[], &mut chance).0;
        Drawn { case, judged: Vec::new() }
    })
}

fn attempt_at(seed: u64, turn: usize, tier: Tier, chance: &mut Chance) -> Option<Drawn> {
    let kinds = hide((turn, tier), &Kind::LIBRARY, &Kind::OUTSIDE, &POOR, chance);
    let (mut case, scales) = empty(seed, tier, &kinds, chance);
    for kind in &kinds {
        let effect = effect(&case, &scales, *kind, chance)?;
        case.hidden.push(effect);
    }
    let ride = Ride::of(&case.rig, &case.motion, 0.0);
    let there = case.measured(&case.motion, &ride, 0).there;
    size(&mut case, &scales, (&ride, &there), chance)?;
    if !case.is_certain() {
        return None;
    }
    let judge = |which| Bench::of(&case, (&case.motion, &ride), &there, Some(which)).judge(which);
    let judged: Vec<_> = (0..case.hidden.len()).map(judge).collect();
    asks(tier, &judged).then_some(Drawn { case, judged })
}

/// Kinds that a poor motion cannot distinguish.
const POOR: [Kind; 9] = [
    Kind::CoulombFriction,
    Kind::ViscousFriction,
    Kind::StribeckFriction,
    Kind::AsymmetryOffset,
    Kind::Inertia,
    Kind::GravityTorque,
    Kind::Spring,
    Kind::TorqueDelay,
    Kind::DriveGain,
];

/// A case without hidden effects, with the typical values of its joints.
fn empty(seed: u64, tier: Tier, kinds: &[Kind], chance: &mut Chance) -> (Case, Vec<Scale>) {
    let needs = |need| kinds.iter().any(|kind| kind.needs(need));
    let of_masses = |kind: &Kind| {
        let masses = [Kind::Inertia, Kind::GravityTorque, Kind::GravityMoment, Kind::Payload];
        masses.contains(kind) || *kind == Kind::DriveGain
    };
    let told = kinds.iter().any(of_masses) || chance.happens(0.6);
    let which = chance.pick(10);
    let rig = if needs(Need::Arm) || needs(Need::Several) || which < 5 {
        Rig::arm(told, chance)
    } else if needs(Need::Revolute) || which < 7 {
        Rig::pendulum(told, chance)
    } else {
        Rig::slide(told, chance)
    };
    let single = rig.count() == 1;
    let richness = if tier == Tier::Ambiguous { Richness::Poor } else { Richness::Full };
    let rate_hz = if single {
        [250.0, 500.0, 1000.0][chance.pick(3)]
    } else {
        [125.0, 250.0][chance.pick(2)]
    };
    let length_s = if single { chance.between(12.0, 24.0) } else { chance.between(20.0, 32.0) };
    let warms = needs(Need::Temperature) || chance.happens(0.2);
    let motion = Motion::draw(&rig.rooms, (length_s, rate_hz), warms, richness, chance);
    let quiet =
        Noise { sigma: [0.0; JOINTS], digit: [0.0; JOINTS], colour: 0.0, step: 0.0, gaps: 0 };
    let mut case = Case {
        tier,
        rig,
        motion,
        richness,
        noise: quiet,
        known: Vec::new(),
        hidden: Vec::new(),
        seed,
    };
    let scales = scales(&case);
    case.noise = noise(&case, &scales, chance);
    know(&mut case, &scales, kinds, chance);
    (case, scales)
}

/// Typical values of each joint on this motion.
fn scales(case: &Case) -> Vec<Scale> {
    let ride = Ride::of(&case.rig, &case.motion, 0.0);
    let torques = recorded(&case.rig, &case.motion, &ride, &[]);
    let rows = torques.len() as f64;
    let rms = |of: &dyn Fn(usize) -> f64| {
        ((0..torques.len()).map(|row| of(row).powi(2)).sum::<f64>() / rows).sqrt()
    };
    let all: Vec<f64> = (0..case.rig.count()).map(|i| rms(&|row| torques[row][i])).collect();
    let most = all.iter().fold(0.1, |most: f64, x| most.max(*x));
    let of_joint = |i: usize| Scale {
        torque: all[i].max(0.03 * most),
        speed: case.rig.rooms[i].fastest,
        acceleration: rms(&|row| ride.states[row][i][2]).max(0.1),
        reach: case.rig.rooms[i].reach,
    };
    (0..case.rig.count()).map(of_joint).collect()
}

fn noise(case: &Case, scales: &[Scale], chance: &mut Chance) -> Noise {
    let mut sigma: Joints = [0.0; JOINTS];
    let share = chance.log_between(0.003, 0.03);
    for (sigma, scale) in sigma.iter_mut().zip(scales) {
        *sigma = share * scale.torque * chance.between(0.7, 1.4);
    }
    let coarse = [0.03, 0.3, 1.0][chance.pick(3)];
    // The quantisation of positions, differentiated in a band of 40 Hz, stays well below the torque noise.
    let loudest = scales
        .iter()
        .zip(&sigma)
        .map(|(scale, sigma)| 0.2 * sigma * scale.acceleration / (3300.0 * scale.torque));
    let finest = loudest.fold(f64::INFINITY, f64::min);
    let steps = if case.rig.slides { [1e-6, 2e-7, 5e-8] } else { [6e-6, 1.5e-6, 3.7e-7] };
    let step = steps.iter().copied().find(|step| *step < finest).unwrap_or(1e-8);
    Noise {
        sigma,
        digit: sigma.map(|sigma| coarse * sigma),
        colour: if chance.happens(0.5) { chance.between(0.2, 0.8) } else { 0.0 },
        step,
        gaps: if chance.happens(0.2) { 1 + chance.pick(3) } else { 0 },
    }
}

/// Adds effects to the model, with errors within their uncertainty.
fn know(case: &mut Case, scales: &[Scale], kinds: &[Kind], chance: &mut Chance) {
    let needs = |need| kinds.iter().any(|kind| kind.needs(need));
    let friction = needs(Need::OwnViscous) || chance.happens(0.5);
    let springs = needs(Need::OwnSpring) || chance.happens(0.1);
    let mut known = Vec::new();
    for (joint, scale) in scales.iter().enumerate() {
        if friction {
            let level = scale.torque * chance.between(0.03, 0.2);
            known.push(Effect::of(Kind::CoulombFriction, joint, &[level]));
            let viscous = scale.torque / scale.speed * chance.between(0.05, 0.4);
            known.push(Effect::of(Kind::ViscousFriction, joint, &[viscous]));
        }
        if springs {
            let stiffness = scale.torque / scale.reach * chance.between(0.1, 0.5);
            let rest = case.rig.rooms[joint].home + 0.3 * scale.reach * chance.between(-1.0, 1.0);
            known.push(Effect::of(Kind::Spring, joint, &[stiffness, rest]));
        }
    }
    for nominal in known {
        let sigma = nominal.numbers[0] * chance.between(0.01, 0.1);
        let mut real = nominal.clone();
        real.numbers[0] += sigma * chance.normal_within_two();
        case.known.push(Known { nominal, real, sigma: vec![sigma] });
    }
}

/// A random effect of a kind on a joint where it may be observable.
fn effect(case: &Case, scales: &[Scale], kind: Kind, chance: &mut Chance) -> Option<Effect> {
    let of_joint = kind.facts().of_joint;
    let clashes = |joint: usize| {
        case.hidden
            .iter()
            .any(|other| other.kind.name() == kind.name() && (!of_joint || other.joint == joint))
    };
    // A new spring would be confounded with a known one.
    let stands = |joint: &usize| {
        fits(case, kind, *joint)
            && !clashes(*joint)
            && !(kind == Kind::Spring && case.known_of(kind, *joint).is_some())
    };
    let joints: Vec<usize> = (0..case.rig.count()).filter(stands).collect();
    if joints.is_empty() {
        return None;
    }
    let joint = if of_joint { joints[chance.pick(joints.len())] } else { 0 };
    let n = case.rig.count();
    let other = (joint + 1 + chance.pick((n - 1).max(1))) % n;
    let numbers = numbers(case, &scales[joint], kind, joint, chance);
    Some(Effect { kind, joint, other, numbers })
}

/// Parameters of a kind, the leading ones of size one.
pub(super) fn numbers(
    case: &Case,
    scale: &Scale,
    kind: Kind,
    joint: usize,
    chance: &mut Chance,
) -> Vec<f64> {
    let sign = if kind.facts().not_negative { 1.0 } else { chance.sign() };
    let mut around = || chance.between(-1.0, 1.0);
    match kind {
        Kind::StribeckFriction => vec![1.0, scale.speed * chance.log_between(0.02, 0.15)],
        Kind::AsymmetryBoth => vec![sign, sign * chance.between(0.5, 2.0) / scale.speed],
        Kind::GravityTorque => vec![around(), around()],
        Kind::GravityMoment => vec![around(), around(), around()],
        Kind::TorqueRipple => {
            let phase = 3.1 * around();
            let radians = if case.rig.slides { std::f64::consts::TAU } else { 1.0 };
            // From one and a half waves over the range to 12 waves per second at maximum velocity.
            let low = 1.5 * std::f64::consts::PI / (scale.reach * radians);
            let high = 12.0 * std::f64::consts::TAU / (scale.speed * radians);
            let cycles = chance.log_between(low, high.max(1.1 * low));
            vec![1.0, cycles.round().max(2.0), phase]
        }
        Kind::Spring => vec![1.0, case.rig.rooms[joint].home + scale.reach * around()],
        Kind::Hysteresis => vec![1.0, scale.reach * chance.log_between(0.01, 0.1)],
        Kind::Payload => {
            let tcp = case.rig.tcp();
            vec![1.0, tcp[0] + 0.1 * around(), tcp[1] + 0.1 * around(), tcp[2] + 0.1 * around()]
        }
        _ => vec![sign],
    }
}

/// Largest physically possible leading parameter.
pub(super) fn most(effect: &Effect, scale: &Scale) -> f64 {
    let Scale { torque, speed, acceleration, reach } = *scale;
    match effect.kind {
        Kind::ViscousFriction | Kind::AsymmetrySlope | Kind::PlaceDamping => torque / speed,
        Kind::LoadFriction => 0.4,
        Kind::FrictionTemperature => 0.08,
        Kind::Inertia => torque / acceleration,
        Kind::GravityMoment => 0.1 * torque,
        Kind::Spring => torque / reach,
        Kind::SpringHardening => torque / reach.powi(3),
        Kind::DriveGain => 0.3,
        Kind::TorqueDelay => 0.02,
        Kind::Payload => 10.0,
        Kind::SpeedCube => torque / speed.powi(3),
        _ => torque,
    }
}

/// Scales every hidden effect to a random target z; `None` if it would exceed its physical limit.
fn size(
    case: &mut Case,
    scales: &[Scale],
    (ride, there): (&Ride, &[bool]),
    chance: &mut Chance,
) -> Option<()> {
    for which in 0..case.hidden.len() {
        let wanted = wanted_z(case.tier, chance);
        let most = most(&case.hidden[which], &scales[case.hidden[which].joint]);
        case.hidden[which] =
            case.hidden[which].scaled(1e-2 * most / case.hidden[which].lead().max(1e-300));
        let motion = case.motion.clone();
        let bench = Bench::of(case, (&motion, ride), there, Some(which));
        let span = bench.nuisances(&case.hidden[which]);
        let mut sized = case.hidden[which].clone();
        // Two iterations, because temperature and delay effects are not linear.
        for _ in 0..2 {
            let factor = wanted / bench.strength(&sized, &span);
            if !factor.is_finite() {
                return None;
            }
            sized = sized.scaled(factor.min(most / sized.lead()));
        }
        if let Some(known) = case.revised(&sized) {
            // A revised parameter may also be smaller than the model states.
            if sized.lead() < 0.9 * known.real.numbers[0] && chance.happens(0.5) {
                sized = sized.scaled(-1.0);
            }
        }
        case.hidden[which] = sized;
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weigh::APART;

    #[test]
    fn a_level_shows_as_its_rows_in_motion_over_the_noise() {
        // A linear axis with stated masses: no nuisance parameters, white noise; z is the friction level times the square root of the number of
        // moving rows over σ.
        let mut chance = Chance::new(4, 0);
        let rig = Rig::slide(true, &mut chance);
        let motion = Motion::draw(&rig.rooms, (8.0, 250.0), false, Richness::Full, &mut chance);
        let noise =
            Noise { sigma: [2.0; JOINTS], digit: [0.0; JOINTS], colour: 0.0, step: 0.0, gaps: 0 };
        let hidden = vec![Effect::of(Kind::CoulombFriction, 0, &[0.7])];
        let (tier, richness) = (Tier::Single, Richness::Full);
        let case = Case { tier, rig, motion, richness, noise, known: Vec::new(), hidden, seed: 1 };
        let ride = Ride::of(&case.rig, &case.motion, 0.0);
        let there = vec![true; case.motion.rows()];
        let judged = Bench::of(&case, (&case.motion, &ride), &there, Some(0)).judge(0);
        let moving = ride.states.iter().filter(|states| states[0][1] != 0.0).count() as f64;
        let z = 0.7 * moving.sqrt() / 2.0;
        assert!((judged.z / z - 1.0).abs() < 1e-6, "{} not {z}", judged.z);
    }

    #[test]
    fn on_a_slide_a_payload_and_an_inertia_are_one_thing_and_untold_masses_swallow_both() {
        let mut chance = Chance::new(7, 0);
        let mut rig = Rig::slide(true, &mut chance);
        rig.arm.gravity = [0.0, 0.0, -9.8];
        let motion = Motion::draw(&rig.rooms, (8.0, 250.0), false, Richness::Full, &mut chance);
        let noise =
            Noise { sigma: [0.1; JOINTS], digit: [0.0; JOINTS], colour: 0.0, step: 0.0, gaps: 0 };
        let hidden = vec![Effect::of(Kind::Payload, 0, &[0.5, 0.1, 0.0, 0.0])];
        let (tier, richness) = (Tier::Single, Richness::Full);
        let mut case =
            Case { tier, rig, motion, richness, noise, known: Vec::new(), hidden, seed: 1 };
        let judge = |case: &Case| {
            let ride = Ride::of(&case.rig, &case.motion, 0.0);
            let there = vec![true; case.motion.rows()];
            Bench::of(case, (&case.motion, &ride), &there, Some(0)).judge(0)
        };
        let level = case.rig.arm.links[0][2][2].abs() < 1e-9;
        let judged = judge(&case);
        assert_eq!(judged.same.contains(&("inertia", Some(1))), level, "{judged:?}");
        assert!(judged.z > 8.0);
        case.rig.told = false;
        assert!(judge(&case).z < 1e-3, "masses that nobody told take both");
    }

    #[test]
    fn singles_of_every_kind_are_drawn_and_can_be_told() {
        let mut drawn: Vec<Kind> = Vec::new();
        for turn in 0..Kind::LIBRARY.len() {
            let one = case(3, turn, (Tier::Single, turn));
            assert!(one.judged.iter().all(|j| j.z >= 8.0 && j.least_gain >= APART));
            drawn.extend(one.case.hidden.iter().map(|hidden| hidden.kind));
        }
        let missing: Vec<&Kind> =
            Kind::LIBRARY.iter().filter(|kind| !drawn.contains(kind)).collect();
        assert!(missing.is_empty(), "{missing:?}");
    }
}
