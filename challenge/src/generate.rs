//! Random cases: robot, motion, instrument and hidden effects, with a size that suits the tier.
//!
//! The same seed, index and tier give the same case. Kinds are used in turn, so that rare ones are tested as often as common ones. A solver's answers
//! have no influence.

mod parameters;

use crate::arm::Arm;
use crate::candidates::{is_admissible, is_observable};
use crate::case::{ModelledEffect, PositionCase, Tier};
use crate::detectability::{DISTINGUISHABLE_GAIN, Detectability, LinearisedCase};
use crate::effect::{BlindCase, EffectKind};
use crate::instrument::{Instrument, Measurements, Noise};
use crate::kinds::{Effect, Kind, Requirement};
use crate::least_squares::dot;
use crate::rng::Rng;
use crate::scene::{Excitation, RecordedInputs, Scene};
use crate::transform::{mul, rotation, translation};

/// Attempts before a null case replaces the requested tier; such replacements are counted in the report.
const ATTEMPTS: u64 = 64;
/// Attempts with one kind before the next kind is used.
const ATTEMPTS_PER_KIND: u64 = 8;

/// A generated case with the detectability of its effects.
#[derive(Clone, Debug, PartialEq)]
pub struct GeneratedCase<C = PositionCase> {
    /// The case.
    pub case: C,
    /// Detectability of each hidden effect.
    pub detectabilities: Vec<Detectability>,
}

/// Case `index` of a challenge, of a tier; `turn` selects the kind among those of the tier.
#[must_use]
pub fn generate_case(seed: u64, index: usize, (tier, turn): (Tier, usize)) -> GeneratedCase {
    let number = index as u64;
    let generated =
        first_success(seed, number, turn, |seed, turn, rng| attempt(seed, turn, tier, rng));
    if let Some(drawn) = generated {
        return drawn;
    }
    let mut rng = Rng::new(seed, number * 1000 + 999);
    let case = case_without_hidden_effects(number, Tier::Null, &[], None, &mut rng);
    GeneratedCase { case, detectabilities: Vec::new() }
}

/// The first successful attempt: each has its own seed and random stream; after some failures the next kind is used.
pub(crate) fn first_success<T>(
    seed: u64,
    number: u64,
    turn: usize,
    one: impl Fn(u64, usize, &mut Rng) -> Option<T>,
) -> Option<T> {
    (0..ATTEMPTS).find_map(|attempt| {
        let mut rng = Rng::new(seed, number * 1000 + attempt);
        let turn = turn + (attempt / ATTEMPTS_PER_KIND) as usize;
        one(seed ^ (number << 20) ^ attempt, turn, &mut rng)
    })
}

/// Whether the detectability of the hidden effects meets the conditions of the tier.
pub(crate) fn meets_tier(tier: Tier, detectability: &[Detectability]) -> bool {
    let all_reach = |z_min: f64| detectability.iter().all(|j| j.z >= z_min);
    match tier {
        Tier::Null => true,
        Tier::Single => {
            all_reach(8.0) && detectability.iter().all(|j| j.least_gain >= DISTINGUISHABLE_GAIN)
        }
        Tier::Multiple => all_reach(8.0),
        Tier::Limit => all_reach(2.0),
        Tier::Outside => detectability.iter().all(|j| j.unexplained_z >= 10.0),
        Tier::Ambiguous => all_reach(12.0) && detectability.iter().all(|j| !j.rivals.is_empty()),
    }
}

/// Random target value of z for an effect of a tier.
pub(crate) fn random_target_z(tier: Tier, rng: &mut Rng) -> f64 {
    match tier {
        Tier::Limit => rng.log_uniform_between(3.0, 14.0),
        Tier::Outside => rng.log_uniform_between(30.0, 400.0),
        Tier::Ambiguous => rng.log_uniform_between(15.0, 120.0),
        _ => rng.log_uniform_between(9.0, 400.0),
    }
}

fn attempt(seed: u64, turn: usize, tier: Tier, rng: &mut Rng) -> Option<GeneratedCase> {
    let kinds = select_hidden_kinds(
        (turn, tier),
        &Kind::DICTIONARY,
        &Kind::OUTSIDE,
        &POORLY_DISTINGUISHED,
        rng,
    );
    let settled = choose_settled(&kinds, rng)?;
    let mut case = case_without_hidden_effects(seed, tier, &kinds, Some(settled), rng);
    for kind in &kinds {
        let effect = random_effect(&case, *kind, rng)?;
        case.hidden.push(effect);
    }
    scale_to_target_z(&mut case, tier, rng)?;
    let detectability = evaluate_detectability(&case);
    if !case.revisions_exceed_uncertainty() {
        return None;
    }
    meets_tier(tier, &detectability)
        .then_some(GeneratedCase { case, detectabilities: detectability })
}

/// Detectability of each hidden effect.
#[must_use]
pub fn evaluate_detectability(case: &PositionCase) -> Vec<Detectability> {
    let right = case.simulate_measurements(&case.scene, 0).usable;
    let linearised = LinearisedCase::of(case, &case.scene, &right);
    let all = case.true_effects();
    let whole = case.exact_values(&case.scene, &all);
    (0..case.hidden.len())
        .map(|which| {
            let mut without = all.clone();
            without.remove(case.modelled.len() + which);
            let other = case.exact_values(&case.scene, &without);
            let shown: Vec<f64> = whole.iter().zip(&other).map(|(a, b)| a - b).collect();
            linearised.evaluate(which, &shown)
        })
        .collect()
}

/// Random kinds to be hidden, from the dictionary, from those outside it, or from those that a poor motion cannot distinguish; the first kind is
/// selected by `turn`.
pub(crate) fn select_hidden_kinds<K: Copy>(
    (turn, tier): (usize, Tier),
    library: &[K],
    outside: &[K],
    poor: &[K],
    rng: &mut Rng,
) -> Vec<K> {
    let turn = |list: &[K]| list[turn % list.len()];
    match tier {
        Tier::Null => Vec::new(),
        Tier::Single | Tier::Limit => vec![turn(library)],
        Tier::Outside => vec![turn(outside)],
        Tier::Ambiguous => vec![poor[rng.uniform_index(poor.len())]],
        Tier::Multiple => {
            let count = if rng.bernoulli(0.3) { 3 } else { 2 };
            let mut kinds = vec![turn(library)];
            while kinds.len() < count {
                kinds.push(library[rng.uniform_index(library.len())]);
            }
            kinds
        }
    }
}

/// Kinds that a poor motion cannot distinguish.
const POORLY_DISTINGUISHED: [Kind; 7] = [
    Kind::JointOffset,
    Kind::JointRatio,
    Kind::JointCompliance,
    Kind::AxisTilt,
    Kind::TransmissionError,
    Kind::BearingCompliance,
    Kind::JointCoupling,
];

/// Whether the case has settled poses or a path, as the kinds need; `None` if they need both.
fn choose_settled(kinds: &[Kind], rng: &mut Rng) -> Option<bool> {
    let needs = |need| kinds.iter().any(|kind| kind.needs(need));
    match (needs(Requirement::Poses), needs(Requirement::Path)) {
        (true, true) => None,
        (true, false) => Some(true),
        (false, true) => Some(false),
        (false, false) => Some(rng.bernoulli(0.5)),
    }
}

/// A case without hidden effects.
fn case_without_hidden_effects(
    seed: u64,
    tier: Tier,
    kinds: &[Kind],
    settled: Option<bool>,
    rng: &mut Rng,
) -> PositionCase {
    let needs = |need| kinds.iter().any(|kind| kind.needs(need));
    let settled = settled.unwrap_or_else(|| rng.bernoulli(0.5));
    let excitation = if tier == Tier::Ambiguous { Excitation::Poor } else { Excitation::Full };
    let masses =
        needs(Requirement::Masses) || needs(Requirement::OwnCompliance) || rng.bernoulli(0.85);
    let arm = Arm::random(rng, masses);
    let ambient = !needs(Requirement::NoTemperature)
        && (needs(Requirement::Temperature) || rng.bernoulli(0.4));
    let recorded_inputs = RecordedInputs {
        wrench: needs(Requirement::Wrench) || masses && rng.bernoulli(0.3),
        ambient,
        joint_temperatures: ambient && rng.bernoulli(0.3),
        spindle: needs(Requirement::Spindle) || rng.bernoulli(0.1),
    };
    let scene = if settled {
        Scene::random_poses(arm, recorded_inputs, 300 + rng.uniform_index(300), excitation, rng)
    } else {
        // A mode at 15 Hz needs a sampling rate of a hundred rows per second.
        let rate = if kinds.contains(&Kind::FlexibleMode) || kinds.contains(&Kind::ReversalSpike) {
            100.0
        } else {
            [50.0, 100.0][rng.uniform_index(2)]
        };
        let rows = rng.log_uniform_between(1000.0, 4000.0) as usize;
        Scene::random_path(arm, recorded_inputs, (rows, rate), excitation, rng)
    };
    let instrument = random_instrument(kinds, rng);
    let noise = random_noise(&instrument, settled, rng);
    let mut case = PositionCase {
        tier,
        scene,
        excitation,
        instrument,
        noise,
        modelled: Vec::new(),
        hidden: Vec::new(),
        seed,
    };
    add_modelled_effects(&mut case, kinds, rng);
    case
}

fn random_instrument(kinds: &[Kind], rng: &mut Rng) -> Instrument {
    let of_joints = |kind: &Kind| {
        matches!(
            kind,
            Kind::Backlash
                | Kind::TransmissionError
                | Kind::ServoLag
                | Kind::LostMotion
                | Kind::Hysteresis
        )
    };
    let mut around = |size: f64| rng.uniform_between(-size, size);
    let measuring_from_base = mul(
        &translation([around(3.0), around(3.0), around(1.0)]),
        &mul(&rotation([0.0, 0.0, around(3.1)]), &rotation([around(0.1), around(0.1), 0.0])),
    );
    let places: Vec<[f64; 3]> =
        (0..3).map(|_| [around(0.12), around(0.12), around(0.12)]).collect();
    let frame_known = rng.bernoulli(0.2);
    let base = crate::transform::IDENTITY;
    let measuring_from_base = if frame_known { base } else { measuring_from_base };
    if !kinds.is_empty() && kinds.iter().all(of_joints) && rng.bernoulli(0.15) {
        return Instrument {
            points: Vec::new(),
            measuring_from_base: base,
            frame_known: true,
            points_known: true,
            targets: false,
        };
    }
    let targets = [0, 0, 0, 1, 3][rng.uniform_index(5)];
    let points_known = targets == 0 || rng.bernoulli(0.4);
    let points = if targets == 0 { vec![[0.0; 3]] } else { places[..targets].to_vec() };
    Instrument { points, measuring_from_base, frame_known, points_known, targets: targets > 0 }
}

fn random_noise(view: &Instrument, settled: bool, rng: &mut Rng) -> Noise {
    let links = view.points.is_empty();
    let sigma = if links {
        rng.log_uniform_between(3e-6, 3e-5)
    } else {
        rng.log_uniform_between(5e-6, 5e-5)
    };
    let coloured = rng.bernoulli(if settled { 0.2 } else { 0.6 });
    Noise {
        sigma,
        autocorrelation: if coloured {
            rng.uniform_between(0.2, if settled { 0.5 } else { 0.85 })
        } else {
            0.0
        },
        quantum: if links {
            2e-7
        } else {
            f64::min([1e-7, 1e-6, 1e-5][rng.uniform_index(3)], sigma)
        },
        gaps: if rng.bernoulli(0.4) { rng.uniform_between(0.0, 0.02) } else { 0.0 },
        outliers: if rng.bernoulli(0.3) { rng.uniform_between(0.0, 0.004) } else { 0.0 },
        stated: rng.bernoulli(0.8),
    }
}

/// Adds effects to the model, with errors within their uncertainty.
fn add_modelled_effects(case: &mut PositionCase, kinds: &[Kind], rng: &mut Rng) {
    let n = case.scene.arm.joint_count();
    let wanted = kinds
        .iter()
        .any(|k| k.needs(Requirement::Compliance) || k.needs(Requirement::OwnCompliance));
    let masses = !case.scene.arm.masses.is_empty();
    let mut modelled = Vec::new();
    if masses && (wanted || rng.bernoulli(0.4)) {
        for joint in [1, 2, 3].into_iter().filter(|j| *j < n) {
            // Joints that carry less mass may be more compliant.
            let compliance =
                rng.log_uniform_between(1e-6, 6e-6) * if joint == 3 { 3.0 } else { 1.0 };
            modelled.push((
                Kind::JointCompliance,
                joint,
                compliance,
                rng.uniform_between(0.01, 0.05) * compliance,
            ));
        }
    }
    if rng.bernoulli(0.4) {
        for joint in 1..n.min(5) {
            let size = 1e-3 * rng.normal();
            modelled.push((Kind::JointOffset, joint, size, rng.log_uniform_between(1e-5, 1e-4)));
        }
    }
    if rng.bernoulli(0.2) {
        let width = rng.uniform_between(1e-4, 3e-4);
        modelled.push((Kind::Backlash, rng.uniform_index(n), width, 0.05 * width));
    }
    for (kind, joint, value, sigma) in modelled {
        let nominal = Effect { kind, joint, other_joint: joint, parameters: vec![value] };
        let real = value + sigma * rng.truncated_normal();
        let true_effect = Effect {
            parameters: vec![if kind.spec().non_negative { real.max(0.0) } else { real }],
            ..nominal.clone()
        };
        case.modelled.push(ModelledEffect { nominal, true_effect, sigma: vec![sigma] });
    }
}

/// A random effect of a kind on a joint where it may be observable, with leading parameters of size one.
fn random_effect(case: &PositionCase, kind: Kind, rng: &mut Rng) -> Option<Effect> {
    if !(is_admissible(case, kind) || kind.name().is_none()) {
        return None;
    }
    let n = case.scene.arm.joint_count();
    let may_stand = |joint: usize| {
        let clashes = case
            .hidden
            .iter()
            .any(|other| other.joint == joint && are_equivalent(other.kind, kind));
        // Joint 1 is confounded with an unknown frame, so effects on it are not used.
        is_observable(case, &case.scene, kind, joint) && !clashes
    };
    let joints: Vec<usize> = (0..n).filter(|joint| may_stand(*joint)).collect();
    if joints.is_empty() {
        return None;
    }
    let mut joint = if kind.spec().per_joint { joints[rng.uniform_index(joints.len())] } else { 0 };
    // Effects of the model may themselves be wrong (revised).
    let modelled: Vec<usize> =
        case.modelled.iter().filter(|k| k.nominal.kind == kind).map(|k| k.nominal.joint).collect();
    if !modelled.is_empty() && rng.bernoulli(0.4) {
        joint = modelled[rng.uniform_index(modelled.len())];
    }
    let same = |other: &Effect| !kind.spec().per_joint && other.kind == kind;
    if case.hidden.iter().any(same) {
        return None;
    }
    let other_joint = (joint + 1 + rng.uniform_index((n - 1).max(1))) % n;
    Some(Effect { kind, joint, other_joint, parameters: parameters::of(case, kind, joint, rng) })
}

/// Whether two kinds on one joint are equivalent.
fn are_equivalent(a: Kind, b: Kind) -> bool {
    let soft = |kind| {
        matches!(kind, Kind::GravityCompliance | Kind::LoadCompliance | Kind::JointCompliance)
    };
    let warm = |kind: Kind| matches!(kind.name(), Some("thermal_zero" | "thermal_growth"));
    a == b || soft(a) && soft(b) || warm(a) && warm(b)
}

/// Scales every hidden effect to a random target z; `None` if it would exceed its physical limit.
fn scale_to_target_z(case: &mut PositionCase, tier: Tier, rng: &mut Rng) -> Option<()> {
    if case.hidden.is_empty() {
        return Some(());
    }
    let everything = Measurements {
        values: Vec::new(),
        recorded: Vec::new(),
        usable: vec![true; case.scene.rows.len()],
    };
    for which in 0..case.hidden.len() {
        let wanted = random_target_z(tier, rng);
        // Two iterations, because large effects are not linear.
        let most = case.hidden[which].kind.spec().max_linear;
        case.hidden[which] = case.hidden[which]
            .scaled(1e-2 * most / case.hidden[which].linear_magnitude().max(1e-300));
        for _ in 0..2 {
            let norm = projected_norm(case, which, &everything.usable);
            let factor = wanted / norm;
            if !factor.is_finite() {
                return None;
            }
            let lead = case.hidden[which].linear_magnitude();
            case.hidden[which] = case.hidden[which].scaled(factor.min(most / lead));
        }
        if case.revised_effect(&case.hidden[which]).is_some()
            && case.hidden[which].kind.spec().non_negative
            && rng.bernoulli(0.5)
        {
            maybe_reduce_revision(case, which);
        }
    }
    Some(())
}

/// A revised parameter may also be smaller than the model states.
fn maybe_reduce_revision(case: &mut PositionCase, which: usize) {
    let hidden = &case.hidden[which];
    let Some(known) = case.revised_effect(hidden) else { return };
    if hidden.parameters[0] < 0.9 * known.true_effect.parameters[0] {
        let turned = hidden.scaled(-1.0);
        case.hidden[which] = turned;
    }
}

fn projected_norm(case: &PositionCase, which: usize, right: &[bool]) -> f64 {
    let linearised = LinearisedCase::of(case, &case.scene, right);
    let basis = linearised.nuisances(&[&case.hidden[which]]);
    let rest = basis.residual(&linearised.column(&case.hidden[which]));
    dot(&rest, &rest).sqrt()
}
