//! Random cases of torques: rig, motion, instrument and hidden effects, with a size that suits the tier.
//!
//! The same seed, index and tier give the same case; kinds are used in turn. A solver's answers have no influence.

use crate::arm::{JOINTS, Joints};
use crate::case::Tier;
use crate::effect::{BlindCase, EffectKind};
use crate::generate::{first_success, meets_tier, random_target_z, select_hidden_kinds};
use crate::rng::Rng;
use crate::scene::Excitation;

use super::candidates::is_observable;
use super::case::{ModelledEffect, Noise, TorqueCase};
use super::detectability::LinearisedCase;
use super::kinds::{Effect, Kind, Requirement};
use super::laws::{SampledMotion, recorded_torques};
use super::motion::Motion;
use super::rig::Rig;

/// A generated case with the detectability of its effects.
pub type GeneratedCase = crate::generate::GeneratedCase<TorqueCase>;

/// Typical values of a joint.
#[derive(Clone, Copy, Debug)]
pub struct JointScale {
    /// Root mean square of the torque, Nm or N.
    pub torque: f64,
    /// Maximum velocity, rad/s or m/s.
    pub speed: f64,
    /// Acceleration, rad/s² or m/s².
    pub acceleration: f64,
    /// Half of the range, rad or m.
    pub half_range: f64,
}

/// Case `index` of a challenge, of a tier; `turn` selects the kind among those of the tier.
#[must_use]
pub fn generate_case(seed: u64, index: usize, (tier, turn): (Tier, usize)) -> GeneratedCase {
    let number = index as u64;
    let generated =
        first_success(seed, number, turn, |seed, turn, rng| attempt(seed, turn, tier, rng));
    generated.unwrap_or_else(|| {
        let mut rng = Rng::new(seed, number * 1000 + 999);
        let case = case_without_hidden_effects(number, Tier::Null, &[], &mut rng).0;
        GeneratedCase { case, detectabilities: Vec::new() }
    })
}

fn attempt(seed: u64, turn: usize, tier: Tier, rng: &mut Rng) -> Option<GeneratedCase> {
    let kinds = select_hidden_kinds(
        (turn, tier),
        &Kind::DICTIONARY,
        &Kind::OUTSIDE,
        &POORLY_DISTINGUISHED,
        rng,
    );
    let (mut case, scales) = case_without_hidden_effects(seed, tier, &kinds, rng);
    for kind in &kinds {
        let effect = random_effect(&case, &scales, *kind, rng)?;
        case.hidden.push(effect);
    }
    let ride = SampledMotion::from_motion(&case.rig, &case.motion, 0.0);
    let recorded = case.simulate_measurements(&case.motion, &ride, 0).recorded;
    scale_to_target_z(&mut case, &scales, (&ride, &recorded), rng)?;
    if !case.revisions_exceed_uncertainty() {
        return None;
    }
    let judge = |which| {
        LinearisedCase::of(&case, (&case.motion, &ride), &recorded, Some(which)).evaluate(which)
    };
    let detectability: Vec<_> = (0..case.hidden.len()).map(judge).collect();
    meets_tier(tier, &detectability)
        .then_some(GeneratedCase { case, detectabilities: detectability })
}

/// Kinds that a poor motion cannot distinguish.
const POORLY_DISTINGUISHED: [Kind; 9] = [
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
fn case_without_hidden_effects(
    seed: u64,
    tier: Tier,
    kinds: &[Kind],
    rng: &mut Rng,
) -> (TorqueCase, Vec<JointScale>) {
    let needs = |need| kinds.iter().any(|kind| kind.needs(need));
    let of_masses = |kind: &Kind| {
        let masses = [Kind::Inertia, Kind::GravityTorque, Kind::GravityMoment, Kind::Payload];
        masses.contains(kind) || *kind == Kind::DriveGain
    };
    let stated = kinds.iter().any(of_masses) || rng.bernoulli(0.6);
    let which = rng.uniform_index(10);
    let rig = if needs(Requirement::Arm) || needs(Requirement::Several) || which < 5 {
        Rig::arm(stated, rng)
    } else if needs(Requirement::Revolute) || which < 7 {
        Rig::pendulum(stated, rng)
    } else {
        Rig::linear_axis(stated, rng)
    };
    let single = rig.count() == 1;
    let excitation = if tier == Tier::Ambiguous { Excitation::Poor } else { Excitation::Full };
    let rate_hz = if single {
        [250.0, 500.0, 1000.0][rng.uniform_index(3)]
    } else {
        [125.0, 250.0][rng.uniform_index(2)]
    };
    let length_s =
        if single { rng.uniform_between(12.0, 24.0) } else { rng.uniform_between(20.0, 32.0) };
    let warms = needs(Requirement::Temperature) || rng.bernoulli(0.2);
    let motion = Motion::random(&rig.ranges, (length_s, rate_hz), warms, excitation, rng);
    let quiet = Noise {
        sigma: [0.0; JOINTS],
        quantum: [0.0; JOINTS],
        autocorrelation: 0.0,
        encoder_quantum: 0.0,
        gaps: 0,
    };
    let mut case = TorqueCase {
        tier,
        rig,
        motion,
        excitation,
        noise: quiet,
        modelled: Vec::new(),
        hidden: Vec::new(),
        seed,
    };
    let scales = joint_scales(&case);
    case.noise = random_noise(&case, &scales, rng);
    add_modelled_effects(&mut case, &scales, kinds, rng);
    (case, scales)
}

/// Typical values of each joint on this motion.
fn joint_scales(case: &TorqueCase) -> Vec<JointScale> {
    let ride = SampledMotion::from_motion(&case.rig, &case.motion, 0.0);
    let torques = recorded_torques(&case.rig, &case.motion, &ride, &[]);
    let rows = torques.len() as f64;
    let rms = |quantity: &dyn Fn(usize) -> f64| {
        ((0..torques.len()).map(|row| quantity(row).powi(2)).sum::<f64>() / rows).sqrt()
    };
    let all: Vec<f64> = (0..case.rig.count()).map(|i| rms(&|row| torques[row][i])).collect();
    let most = all.iter().fold(0.1, |most: f64, x| most.max(*x));
    let of_joint = |i: usize| JointScale {
        torque: all[i].max(0.03 * most),
        speed: case.rig.ranges[i].max_speed,
        acceleration: rms(&|row| ride.states[row][i][2]).max(0.1),
        half_range: case.rig.ranges[i].half_range,
    };
    (0..case.rig.count()).map(of_joint).collect()
}

fn random_noise(case: &TorqueCase, scales: &[JointScale], rng: &mut Rng) -> Noise {
    let mut sigma: Joints = [0.0; JOINTS];
    let share = rng.log_uniform_between(0.003, 0.03);
    for (sigma, scale) in sigma.iter_mut().zip(scales) {
        *sigma = share * scale.torque * rng.uniform_between(0.7, 1.4);
    }
    let coarse = [0.03, 0.3, 1.0][rng.uniform_index(3)];
    // The quantisation of positions, differentiated in a band of 40 Hz, stays well below the torque noise.
    let loudest = scales
        .iter()
        .zip(&sigma)
        .map(|(scale, sigma)| 0.2 * sigma * scale.acceleration / (3300.0 * scale.torque));
    let finest = loudest.fold(f64::INFINITY, f64::min);
    let steps = if case.rig.is_prismatic { [1e-6, 2e-7, 5e-8] } else { [6e-6, 1.5e-6, 3.7e-7] };
    let encoder_quantum = steps.iter().copied().find(|step| *step < finest).unwrap_or(1e-8);
    Noise {
        sigma,
        quantum: sigma.map(|sigma| coarse * sigma),
        autocorrelation: if rng.bernoulli(0.5) { rng.uniform_between(0.2, 0.8) } else { 0.0 },
        encoder_quantum,
        gaps: if rng.bernoulli(0.2) { 1 + rng.uniform_index(3) } else { 0 },
    }
}

/// Adds effects to the model, with errors within their uncertainty.
fn add_modelled_effects(
    case: &mut TorqueCase,
    scales: &[JointScale],
    kinds: &[Kind],
    rng: &mut Rng,
) {
    let needs = |need| kinds.iter().any(|kind| kind.needs(need));
    let friction = needs(Requirement::OwnViscous) || rng.bernoulli(0.5);
    let springs = needs(Requirement::OwnSpring) || rng.bernoulli(0.1);
    let mut modelled = Vec::new();
    for (joint, scale) in scales.iter().enumerate() {
        if friction {
            let level = scale.torque * rng.uniform_between(0.03, 0.2);
            modelled.push(Effect::of(Kind::CoulombFriction, joint, &[level]));
            let viscous = scale.torque / scale.speed * rng.uniform_between(0.05, 0.4);
            modelled.push(Effect::of(Kind::ViscousFriction, joint, &[viscous]));
        }
        if springs {
            let stiffness = scale.torque / scale.half_range * rng.uniform_between(0.1, 0.5);
            let rest = case.rig.ranges[joint].centre
                + 0.3 * scale.half_range * rng.uniform_between(-1.0, 1.0);
            modelled.push(Effect::of(Kind::Spring, joint, &[stiffness, rest]));
        }
    }
    for nominal in modelled {
        let sigma = nominal.parameters[0] * rng.uniform_between(0.01, 0.1);
        let mut true_effect = nominal.clone();
        true_effect.parameters[0] += sigma * rng.truncated_normal();
        case.modelled.push(ModelledEffect { nominal, true_effect, sigma: vec![sigma] });
    }
}

/// A random effect of a kind on a joint where it may be observable.
fn random_effect(
    case: &TorqueCase,
    scales: &[JointScale],
    kind: Kind,
    rng: &mut Rng,
) -> Option<Effect> {
    let of_joint = kind.spec().per_joint;
    let clashes = |joint: usize| {
        case.hidden
            .iter()
            .any(|other| other.kind.name() == kind.name() && (!of_joint || other.joint == joint))
    };
    // A new spring would be confounded with a known one.
    let is_suitable = |joint: &usize| {
        is_observable(case, kind, *joint)
            && !clashes(*joint)
            && !(kind == Kind::Spring && case.modelled_effect(kind, *joint).is_some())
    };
    let joints: Vec<usize> = (0..case.rig.count()).filter(is_suitable).collect();
    if joints.is_empty() {
        return None;
    }
    let joint = if of_joint { joints[rng.uniform_index(joints.len())] } else { 0 };
    let n = case.rig.count();
    let other_joint = (joint + 1 + rng.uniform_index((n - 1).max(1))) % n;
    let parameters = random_parameters(case, &scales[joint], kind, joint, rng);
    Some(Effect { kind, joint, other_joint, parameters })
}

/// Parameters of a kind, the leading ones of size one.
pub(super) fn random_parameters(
    case: &TorqueCase,
    scale: &JointScale,
    kind: Kind,
    joint: usize,
    rng: &mut Rng,
) -> Vec<f64> {
    let sign = if kind.spec().non_negative { 1.0 } else { rng.random_sign() };
    let mut around = || rng.uniform_between(-1.0, 1.0);
    match kind {
        Kind::StribeckFriction => vec![1.0, scale.speed * rng.log_uniform_between(0.02, 0.15)],
        Kind::AsymmetryBoth => vec![sign, sign * rng.uniform_between(0.5, 2.0) / scale.speed],
        Kind::GravityTorque => vec![around(), around()],
        Kind::GravityMoment => vec![around(), around(), around()],
        Kind::TorqueRipple => {
            let phase = 3.1 * around();
            let radians = if case.rig.is_prismatic { std::f64::consts::TAU } else { 1.0 };
            // From one and a half waves over the range to 12 waves per second at maximum velocity.
            let low = 1.5 * std::f64::consts::PI / (scale.half_range * radians);
            let high = 12.0 * std::f64::consts::TAU / (scale.speed * radians);
            let cycles = rng.log_uniform_between(low, high.max(1.1 * low));
            vec![1.0, cycles.round().max(2.0), phase]
        }
        Kind::Spring => vec![1.0, case.rig.ranges[joint].centre + scale.half_range * around()],
        Kind::Hysteresis => vec![1.0, scale.half_range * rng.log_uniform_between(0.01, 0.1)],
        Kind::Payload => {
            let tcp = case.rig.tcp();
            vec![1.0, tcp[0] + 0.1 * around(), tcp[1] + 0.1 * around(), tcp[2] + 0.1 * around()]
        }
        _ => vec![sign],
    }
}

/// Largest physically possible leading parameter.
pub(super) fn max_linear_parameter(effect: &Effect, scale: &JointScale) -> f64 {
    let JointScale { torque, speed, acceleration, half_range } = *scale;
    match effect.kind {
        Kind::ViscousFriction | Kind::AsymmetrySlope | Kind::PlaceDamping => torque / speed,
        Kind::LoadFriction => 0.4,
        Kind::FrictionTemperature => 0.08,
        Kind::Inertia => torque / acceleration,
        Kind::GravityMoment => 0.1 * torque,
        Kind::Spring => torque / half_range,
        Kind::SpringHardening => torque / half_range.powi(3),
        Kind::DriveGain => 0.3,
        Kind::TorqueDelay => 0.02,
        Kind::Payload => 10.0,
        Kind::SpeedCube => torque / speed.powi(3),
        _ => torque,
    }
}

/// Scales every hidden effect to a random target z; `None` if it would exceed its physical limit.
fn scale_to_target_z(
    case: &mut TorqueCase,
    scales: &[JointScale],
    (ride, there): (&SampledMotion, &[bool]),
    rng: &mut Rng,
) -> Option<()> {
    for which in 0..case.hidden.len() {
        let wanted = random_target_z(case.tier, rng);
        let most = max_linear_parameter(&case.hidden[which], &scales[case.hidden[which].joint]);
        case.hidden[which] = case.hidden[which]
            .scaled(1e-2 * most / case.hidden[which].linear_magnitude().max(1e-300));
        let motion = case.motion.clone();
        let linearised = LinearisedCase::of(case, (&motion, ride), there, Some(which));
        let basis = linearised.nuisances(&case.hidden[which]);
        let mut sized = case.hidden[which].clone();
        // Two iterations, because temperature and delay effects are not linear.
        for _ in 0..2 {
            let factor = wanted / linearised.strength(&sized, &basis);
            if !factor.is_finite() {
                return None;
            }
            sized = sized.scaled(factor.min(most / sized.linear_magnitude()));
        }
        if let Some(known) = case.revised_effect(&sized) {
            // A revised parameter may also be smaller than the model states.
            if sized.linear_magnitude() < 0.9 * known.true_effect.parameters[0]
                && rng.bernoulli(0.5)
            {
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
    use crate::comparison::DISTINGUISHABLE_GAIN;

    #[test]
    fn a_level_shows_as_its_rows_in_motion_over_the_noise() {
        // A linear axis with stated masses: no nuisance parameters, white noise; z is the friction level times the square root of the number of
        // moving rows over σ.
        let mut rng = Rng::new(4, 0);
        let rig = Rig::linear_axis(true, &mut rng);
        let motion = Motion::random(&rig.ranges, (8.0, 250.0), false, Excitation::Full, &mut rng);
        let noise = Noise {
            sigma: [2.0; JOINTS],
            quantum: [0.0; JOINTS],
            autocorrelation: 0.0,
            encoder_quantum: 0.0,
            gaps: 0,
        };
        let hidden = vec![Effect::of(Kind::CoulombFriction, 0, &[0.7])];
        let (tier, excitation) = (Tier::Single, Excitation::Full);
        let case = TorqueCase {
            tier,
            rig,
            motion,
            excitation,
            noise,
            modelled: Vec::new(),
            hidden,
            seed: 1,
        };
        let ride = SampledMotion::from_motion(&case.rig, &case.motion, 0.0);
        let recorded = vec![true; case.motion.rows()];
        let detectability =
            LinearisedCase::of(&case, (&case.motion, &ride), &recorded, Some(0)).evaluate(0);
        let moving = ride.states.iter().filter(|states| states[0][1] != 0.0).count() as f64;
        let z = 0.7 * moving.sqrt() / 2.0;
        assert!((detectability.z / z - 1.0).abs() < 1e-6, "{} not {z}", detectability.z);
    }

    #[test]
    fn on_a_slide_a_payload_and_an_inertia_are_one_thing_and_untold_masses_swallow_both() {
        let mut rng = Rng::new(7, 0);
        let mut rig = Rig::linear_axis(true, &mut rng);
        rig.arm.gravity = [0.0, 0.0, -9.8];
        let motion = Motion::random(&rig.ranges, (8.0, 250.0), false, Excitation::Full, &mut rng);
        let noise = Noise {
            sigma: [0.1; JOINTS],
            quantum: [0.0; JOINTS],
            autocorrelation: 0.0,
            encoder_quantum: 0.0,
            gaps: 0,
        };
        let hidden = vec![Effect::of(Kind::Payload, 0, &[0.5, 0.1, 0.0, 0.0])];
        let (tier, excitation) = (Tier::Single, Excitation::Full);
        let mut case = TorqueCase {
            tier,
            rig,
            motion,
            excitation,
            noise,
            modelled: Vec::new(),
            hidden,
            seed: 1,
        };
        let judge = |case: &TorqueCase| {
            let ride = SampledMotion::from_motion(&case.rig, &case.motion, 0.0);
            let recorded = vec![true; case.motion.rows()];
            LinearisedCase::of(case, (&case.motion, &ride), &recorded, Some(0)).evaluate(0)
        };
        let level = case.rig.arm.links[0][2][2].abs() < 1e-9;
        let detectability = judge(&case);
        assert_eq!(detectability.same.contains(&("inertia", Some(1))), level, "{detectability:?}");
        assert!(detectability.z > 8.0);
        case.rig.masses_stated = false;
        assert!(judge(&case).z < 1e-3, "unstated masses explain both");
    }

    #[test]
    fn singles_of_every_kind_are_drawn_and_can_be_told() {
        let mut generated: Vec<Kind> = Vec::new();
        for turn in 0..Kind::DICTIONARY.len() {
            let one = generate_case(3, turn, (Tier::Single, turn));
            assert!(
                one.detectabilities
                    .iter()
                    .all(|j| j.z >= 8.0 && j.least_gain >= DISTINGUISHABLE_GAIN)
            );
            generated.extend(one.case.hidden.iter().map(|hidden| hidden.kind));
        }
        let missing: Vec<&Kind> =
            Kind::DICTIONARY.iter().filter(|kind| !generated.contains(kind)).collect();
        assert!(missing.is_empty(), "{missing:?}");
    }
}
