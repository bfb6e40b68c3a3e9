//! Random cases: robot, motion, instrument and hidden effects, with a size that suits the tier.
//!
//! The same seed, index and tier give the same case. Kinds are used in turn, so that rare ones are tested as often as common ones. A solver's answers
//! have no influence.

mod numbers;

use crate::arm::Arm;
use crate::bench::{APART, Bench, Judged};
use crate::candidates::{fits, may_answer};
use crate::case::{Case, Known, Tier};
use crate::chance::Chance;
use crate::kinds::{Effect, Kind, Need};
use crate::law::{Law, Trial};
use crate::linear::dot;
use crate::scene::{Has, Richness, Scene};
use crate::space::{mul, shift, turn};
use crate::view::{Measured, Noise, View};

/// Attempts before a null case replaces the requested tier; such replacements are counted in the report.
const ATTEMPTS: u64 = 64;
/// Attempts with one kind before the next kind is used.
const OF_ONE_KIND: u64 = 8;

/// A generated case with the detectability of its effects.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn<C = Case> {
    /// The case.
    pub case: C,
    /// Detectability of each hidden effect.
    pub judged: Vec<Judged>,
}

/// Case `index` of a challenge, of a tier; `turn` selects the kind among those of the tier.
#[must_use]
pub fn case(seed: u64, index: usize, (tier, turn): (Tier, usize)) -> Drawn {
    let number = index as u64;
    let drawn =
        attempts(seed, number, turn, |seed, turn, chance| attempt_at(seed, turn, tier, chance));
    if let Some(drawn) = drawn {
        return drawn;
    }
    let mut chance = Chance::new(seed, number * 1000 + 999);
    let case = empty(number, Tier::Null, &[], None, &mut chance);
    Drawn { case, judged: Vec::new() }
}

/// The first successful attempt: each has its own seed and random stream; after some failures the next kind is used.
pub(crate) fn attempts<T>(
    seed: u64,
    number: u64,
    turn: usize,
    one: impl Fn(u64, usize, &mut Chance) -> Option<T>,
) -> Option<T> {
    (0..ATTEMPTS).find_map(|attempt| {
        let mut chance = Chance::new(seed, number * 1000 + attempt);
        let turn = turn + (attempt / OF_ONE_KIND) as usize;
        one(seed ^ (number << 20) ^ attempt, turn, &mut chance)
    })
}

/// Whether the detectability of the hidden effects meets the conditions of the tier.
pub(crate) fn asks(tier: Tier, judged: &[Judged]) -> bool {
    let shows = |least: f64| judged.iter().all(|j| j.z >= least);
    match tier {
        Tier::Null => true,
        Tier::Single => shows(8.0) && judged.iter().all(|j| j.least_gain >= APART),
        Tier::Multiple => shows(8.0),
        Tier::Limit => shows(2.0),
        Tier::Outside => judged.iter().all(|j| j.unexplained_z >= 10.0),
        Tier::Ambiguous => shows(12.0) && judged.iter().all(|j| !j.rivals.is_empty()),
    }
}

/// Random target value of z for an effect of a tier.
pub(crate) fn wanted_z(tier: Tier, chance: &mut Chance) -> f64 {
    match tier {
        Tier::Limit => chance.log_between(3.0, 14.0),
        Tier::Outside => chance.log_between(30.0, 400.0),
        Tier::Ambiguous => chance.log_between(15.0, 120.0),
        _ => chance.log_between(9.0, 400.0),
    }
}

fn attempt_at(seed: u64, turn: usize, tier: Tier, chance: &mut Chance) -> Option<Drawn> {
    let kinds = hide((turn, tier), &Kind::LIBRARY, &Kind::OUTSIDE, &POOR, chance);
    let settled = settled(&kinds, chance)?;
    let mut case = empty(seed, tier, &kinds, Some(settled), chance);
    for kind in &kinds {
        let effect = effect(&case, *kind, chance)?;
        case.hidden.push(effect);
    }
    size(&mut case, tier, chance)?;
    let judged = judge(&case);
    if !case.is_certain() {
        return None;
    }
    asks(tier, &judged).then_some(Drawn { case, judged })
}

/// Detectability of each hidden effect.
#[must_use]
pub fn judge(case: &Case) -> Vec<Judged> {
    let right = case.measured(&case.scene, 0).right;
    let bench = Bench::of(case, &case.scene, &right);
    let all = case.real();
    let whole = case.exact(&case.scene, &all);
    (0..case.hidden.len())
        .map(|which| {
            let mut without = all.clone();
            without.remove(case.known.len() + which);
            let other = case.exact(&case.scene, &without);
            let shown: Vec<f64> = whole.iter().zip(&other).map(|(a, b)| a - b).collect();
            bench.judge(which, &shown)
        })
        .collect()
}

/// Random kinds to be hidden, from the dictionary, from those outside it, or from those that a poor motion cannot distinguish; the first kind is
/// selected by `turn`.
pub(crate) fn hide<K: Copy>(
    (turn, tier): (usize, Tier),
    library: &[K],
    outside: &[K],
    poor: &[K],
    chance: &mut Chance,
) -> Vec<K> {
    let turn = |list: &[K]| list[turn % list.len()];
    match tier {
        Tier::Null => Vec::new(),
        Tier::Single | Tier::Limit => vec![turn(library)],
        Tier::Outside => vec![turn(outside)],
        Tier::Ambiguous => vec![poor[chance.pick(poor.len())]],
        Tier::Multiple => {
            let count = if chance.happens(0.3) { 3 } else { 2 };
            let mut kinds = vec![turn(library)];
            while kinds.len() < count {
                kinds.push(library[chance.pick(library.len())]);
            }
            kinds
        }
    }
}

/// Kinds that a poor motion cannot distinguish.
const POOR: [Kind; 7] = [
    Kind::JointOffset,
    Kind::JointRatio,
    Kind::JointCompliance,
    Kind::AxisTilt,
    Kind::TransmissionError,
    Kind::BearingCompliance,
    Kind::JointCoupling,
];

/// Whether the case has settled poses or a path, as the kinds need; `None` if they need both.
fn settled(kinds: &[Kind], chance: &mut Chance) -> Option<bool> {
    let needs = |need| kinds.iter().any(|kind| kind.needs(need));
    match (needs(Need::Poses), needs(Need::Path)) {
        (true, true) => None,
        (true, false) => Some(true),
        (false, true) => Some(false),
        (false, false) => Some(chance.happens(0.5)),
    }
}

/// A case without hidden effects.
fn empty(
    seed: u64,
    tier: Tier,
    kinds: &[Kind],
    settled: Option<bool>,
    chance: &mut Chance,
) -> Case {
    let needs = |need| kinds.iter().any(|kind| kind.needs(need));
    let settled = settled.unwrap_or_else(|| chance.happens(0.5));
    let richness = if tier == Tier::Ambiguous { Richness::Poor } else { Richness::Full };
    let masses = needs(Need::Masses) || needs(Need::OwnCompliance) || chance.happens(0.85);
    let arm = Arm::draw(chance, masses);
    let ambient = !needs(Need::NoTemperature) && (needs(Need::Temperature) || chance.happens(0.4));
    let has = Has {
        wrench: needs(Need::Wrench) || masses && chance.happens(0.3),
        ambient,
        joint_temperatures: ambient && chance.happens(0.3),
        spindle: needs(Need::Spindle) || chance.happens(0.1),
    };
    let scene = if settled {
        Scene::poses(arm, has, 300 + chance.pick(300), richness, chance)
    } else {
        // A mode at 15 Hz needs a sampling rate of a hundred rows per second.
        let rate = if kinds.contains(&Kind::FlexibleMode) || kinds.contains(&Kind::ReversalSpike) {
            100.0
        } else {
            [50.0, 100.0][chance.pick(2)]
        };
        let rows = chance.log_between(1000.0, 4000.0) as usize;
        Scene::path(arm, has, (rows, rate), richness, chance)
    };
    let view = view(kinds, chance);
    let noise = noise(&view, settled, chance);
    let mut case =
        Case { tier, scene, richness, view, noise, known: Vec::new(), hidden: Vec::new(), seed };
    know(&mut case, kinds, chance);
    case
}

fn view(kinds: &[Kind], chance: &mut Chance) -> View {
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
    let mut around = |size: f64| chance.between(-size, size);
    let measuring_from_base = mul(
        &shift([around(3.0), around(3.0), around(1.0)]),
        &mul(&turn([0.0, 0.0, around(3.1)]), &turn([around(0.1), around(0.1), 0.0])),
    );
    let places: Vec<[f64; 3]> =
        (0..3).map(|_| [around(0.12), around(0.12), around(0.12)]).collect();
    let frame_known = chance.happens(0.2);
    let base = crate::space::ONE;
    let measuring_from_base = if frame_known { base } else { measuring_from_base };
    if !kinds.is_empty() && kinds.iter().all(of_joints) && chance.happens(0.15) {
        return View {
            places: Vec::new(),
            measuring_from_base: base,
            frame_known: true,
            places_known: true,
            targets: false,
        };
    }
    let targets = [0, 0, 0, 1, 3][chance.pick(5)];
    let places_known = targets == 0 || chance.happens(0.4);
    let places = if targets == 0 { vec![[0.0; 3]] } else { places[..targets].to_vec() };
    View { places, measuring_from_base, frame_known, places_known, targets: targets > 0 }
}

fn noise(view: &View, settled: bool, chance: &mut Chance) -> Noise {
    let links = view.places.is_empty();
    let sigma = if links { chance.log_between(3e-6, 3e-5) } else { chance.log_between(5e-6, 5e-5) };
    let coloured = chance.happens(if settled { 0.2 } else { 0.6 });
    Noise {
        sigma,
        colour: if coloured { chance.between(0.2, if settled { 0.5 } else { 0.85 }) } else { 0.0 },
        digit: if links { 2e-7 } else { f64::min([1e-7, 1e-6, 1e-5][chance.pick(3)], sigma) },
        gaps: if chance.happens(0.4) { chance.between(0.0, 0.02) } else { 0.0 },
        outliers: if chance.happens(0.3) { chance.between(0.0, 0.004) } else { 0.0 },
        stated: chance.happens(0.8),
    }
}

/// Adds effects to the model, with errors within their uncertainty.
fn know(case: &mut Case, kinds: &[Kind], chance: &mut Chance) {
    let n = case.scene.arm.count();
    let wanted = kinds.iter().any(|k| k.needs(Need::Compliance) || k.needs(Need::OwnCompliance));
    let masses = !case.scene.arm.masses.is_empty();
    let mut known = Vec::new();
    if masses && (wanted || chance.happens(0.4)) {
        for joint in [1, 2, 3].into_iter().filter(|j| *j < n) {
            // Joints that carry less mass may be more compliant.
            let compliance = chance.log_between(1e-6, 6e-6) * if joint == 3 { 3.0 } else { 1.0 };
            known.push((
                Kind::JointCompliance,
                joint,
                compliance,
                chance.between(0.01, 0.05) * compliance,
            ));
        }
    }
    if chance.happens(0.4) {
        for joint in 1..n.min(5) {
            let size = 1e-3 * chance.normal();
            known.push((Kind::JointOffset, joint, size, chance.log_between(1e-5, 1e-4)));
        }
    }
    if chance.happens(0.2) {
        let width = chance.between(1e-4, 3e-4);
        known.push((Kind::Backlash, chance.pick(n), width, 0.05 * width));
    }
    for (kind, joint, value, sigma) in known {
        let nominal = Effect { kind, joint, other: joint, numbers: vec![value] };
        let real = value + sigma * chance.normal_within_two();
        let real = Effect {
            numbers: vec![if kind.facts().not_negative { real.max(0.0) } else { real }],
            ..nominal.clone()
        };
        case.known.push(Known { nominal, real, sigma: vec![sigma] });
    }
}

/// A random effect of a kind on a joint where it may be observable, with leading parameters of size one.
fn effect(case: &Case, kind: Kind, chance: &mut Chance) -> Option<Effect> {
    if !(may_answer(case, kind) || kind.name().is_none()) {
        return None;
    }
    let n = case.scene.arm.count();
    let may_stand = |joint: usize| {
        let clashes =
            case.hidden.iter().any(|other| other.joint == joint && alike(other.kind, kind));
        // Joint 1 is confounded with an unknown frame, so effects on it are not used.
        fits(case, &case.scene, kind, joint) && !clashes
    };
    let joints: Vec<usize> = (0..n).filter(|joint| may_stand(*joint)).collect();
    if joints.is_empty() {
        return None;
    }
    let mut joint = if kind.facts().of_joint { joints[chance.pick(joints.len())] } else { 0 };
    // Effects of the model may themselves be wrong (revised).
    let known: Vec<usize> =
        case.known.iter().filter(|k| k.nominal.kind == kind).map(|k| k.nominal.joint).collect();
    if !known.is_empty() && chance.happens(0.4) {
        joint = known[chance.pick(known.len())];
    }
    let same = |other: &Effect| !kind.facts().of_joint && other.kind == kind;
    if case.hidden.iter().any(same) {
        return None;
    }
    let other = (joint + 1 + chance.pick((n - 1).max(1))) % n;
    Some(Effect { kind, joint, other, numbers: numbers::of(case, kind, joint, chance) })
}

/// Whether two kinds on one joint are equivalent.
fn alike(a: Kind, b: Kind) -> bool {
    let soft = |kind| {
        matches!(kind, Kind::GravityCompliance | Kind::LoadCompliance | Kind::JointCompliance)
    };
    let warm = |kind: Kind| matches!(kind.name(), Some("thermal_zero" | "thermal_growth"));
    a == b || soft(a) && soft(b) || warm(a) && warm(b)
}

/// Scales every hidden effect to a random target z; `None` if it would exceed its physical limit.
fn size(case: &mut Case, tier: Tier, chance: &mut Chance) -> Option<()> {
    if case.hidden.is_empty() {
        return Some(());
    }
    let everything = Measured {
        values: Vec::new(),
        there: Vec::new(),
        right: vec![true; case.scene.rows.len()],
    };
    for which in 0..case.hidden.len() {
        let wanted = wanted_z(tier, chance);
        // Two iterations, because large effects are not linear.
        let most = case.hidden[which].kind.facts().most;
        case.hidden[which] =
            case.hidden[which].scaled(1e-2 * most / case.hidden[which].lead().max(1e-300));
        for _ in 0..2 {
            let shows = strength(case, which, &everything.right);
            let factor = wanted / shows;
            if !factor.is_finite() {
                return None;
            }
            let lead = case.hidden[which].lead();
            case.hidden[which] = case.hidden[which].scaled(factor.min(most / lead));
        }
        if case.revised(&case.hidden[which]).is_some()
            && case.hidden[which].kind.facts().not_negative
            && chance.happens(0.5)
        {
            turn_down(case, which);
        }
    }
    Some(())
}

/// A revised parameter may also be smaller than the model states.
fn turn_down(case: &mut Case, which: usize) {
    let hidden = &case.hidden[which];
    let Some(known) = case.revised(hidden) else { return };
    if hidden.numbers[0] < 0.9 * known.real.numbers[0] {
        let turned = hidden.scaled(-1.0);
        case.hidden[which] = turned;
    }
}

fn strength(case: &Case, which: usize, right: &[bool]) -> f64 {
    let bench = Bench::of(case, &case.scene, right);
    let span = bench.nuisances(&[&case.hidden[which]]);
    let rest = span.rest(&bench.column(&case.hidden[which]));
    dot(&rest, &rest).sqrt()
}
