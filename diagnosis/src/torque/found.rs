//! Findings: converts columns to parameters of effects, and likelihoods to probabilities.
//!
//! Promises: parameter names of docs/reference/effects.md, in SI. Never: units of a file.

use glam::DVec3;
use nalgebra::DMatrix;

use super::payload::REACH_M;
use crate::engine::library::{Family, Form};
use crate::engine::normal_equations::Solved;
use crate::engine::posterior::posterior;
use crate::engine::stepwise::{Search, Selection, others};

/// The share of a number that stays open whatever the noise: scale, geometry, the form of a law.
const FLOOR: f64 = 5e-3;
/// What a motor's constant is off by, gear losses included, as a standard share of what currents are called torque by.
const CONSTANT: f64 = 0.1;
/// A first moment that is open by as much, kg m, is one that nothing feels: no arm carries it.
const UNFELT: f64 = 1e4;
/// Names within so much log-likelihood cannot be distinguished.
const ALIKE: f64 = 5.0;
/// A rival explains at least this share of what the name does.
const SHARES: f64 = 0.5;
/// Rivals that are further behind are not listed.
const FAR: f64 = 12.0;

/// A number of an effect, or several of one stem; SI.
#[derive(Clone, Debug, PartialEq)]
pub struct Number {
    /// The key's stem.
    pub stem: &'static str,
    /// SI.
    pub values: Vec<f64>,
    /// Standard uncertainties.
    pub sigma: Vec<f64>,
}

/// Another name that explains the same.
#[derive(Clone, Debug, PartialEq)]
pub struct Rival {
    /// A name of the contract.
    pub kind: &'static str,
    /// From 0; none for the whole robot.
    pub joint: Option<usize>,
    /// Its place in the library.
    pub(crate) place: usize,
    /// Which numbers it takes.
    pub stems: Vec<&'static str>,
    /// By how much it is behind in log-likelihood.
    pub behind: f64,
    /// How many more numbers it takes than what was found.
    pub dearer: f64,
    /// Whether this recording cannot tell it from what was found.
    pub alike: bool,
    /// The probability of this name.
    pub confidence: f64,
}

impl Rival {
    /// A name at this place of the library, so far behind another and dearer; its probability is not told yet.
    pub(super) fn of(family: &Family, place: usize, behind: f64, dearer: f64) -> Self {
        Self {
            kind: family.kind,
            joint: family.joint,
            place,
            stems: stems(family),
            behind,
            dearer,
            alike: behind < ALIKE,
            confidence: 0.0,
        }
    }
}

/// Stems of the numbers that a name takes.
pub(super) fn stems(family: &Family) -> Vec<&'static str> {
    let mut stems = match family.form {
        Form::Plain(stems) => stems.to_vec(),
        Form::Loop => vec!["amplitude_N"],
        Form::Warmth => vec!["per_K"],
        Form::Spring => vec!["stiffness", "rest_position"],
        Form::Wave => vec!["amplitude", "phase"],
        Form::Moment => vec!["first_moment"],
        Form::Payload { .. } => vec!["mass", "com"],
    };
    stems.extend(family.settings.iter().map(|(stem, _)| *stem));
    stems
}

/// What the numbers of a name are told with.
pub(super) struct Context<'a> {
    /// Of the numbers of the fit.
    pub(super) covariance: &'a DMatrix<f64>,
    /// Of its searched number, as a share.
    pub(super) spread: f64,
    /// By how much each column's number depends on rows that were set apart.
    pub(super) moved: &'a dyn Fn(usize) -> f64,
    /// Torque is as sure as a motor's constant.
    pub(super) by_current: bool,
    /// The gain that was found of the joint's drive: what acts is what is recorded over `1 + g`.
    pub(super) gain: f64,
    /// The joint's viscous friction, stated and found, as recorded.
    pub(super) viscous: f64,
}

/// The numbers of a name in a fit.
pub(super) fn numbers(family: &Family, solved: &Solved, context: &Context<'_>) -> Vec<Number> {
    let at = |column: usize| solved.columns.iter().position(|k| *k == column);
    let is_torque = goes_with_torque(family.kind);
    let is_driven = is_torque || family.kind == "load_friction";
    let acting = if is_driven { 1.0 / (1.0 + context.gain) } else { 1.0 };
    let value = |k: usize| acting * solved.value(family.columns[k]).unwrap_or(0.0);
    let shared = |i: usize, j: usize| match (at(family.columns[i]), at(family.columns[j])) {
        (Some(a), Some(b)) => acting * acting * context.covariance[(a, b)],
        _ => 0.0,
    };
    let floor = FLOOR.hypot(if context.by_current && is_torque { CONSTANT } else { 0.0 });
    let sigma = |k: usize| {
        let own = shared(k, k).max(0.0).sqrt().hypot((context.moved)(family.columns[k]));
        own.hypot(floor * value(k))
    };
    let mut all = match family.form {
        Form::Plain(stems) => {
            stems.iter().enumerate().map(|(k, stem)| one(stem, value(k), sigma(k))).collect()
        }
        Form::Warmth => {
            let viscous = context.viscous;
            vec![one("per_K", -value(0) / viscous, sigma(0) / viscous.abs())]
        }
        // The contract's amplitude is the whole height of the loop, the column's a half.
        Form::Loop => vec![one("amplitude_N", 2.0 * value(0), 2.0 * sigma(0))],
        Form::Spring => {
            let (stiffness, rest) = (value(0), -value(1) / value(0));
            let of_rest = (sigma(1) / value(0)).hypot(rest * sigma(0) / value(0));
            vec![one("stiffness", stiffness, sigma(0)), one("rest_position", rest, of_rest)]
        }
        Form::Moment => {
            // Along its axis a joint feels nothing: what comes out there is rounding.
            let felt = |k: usize| if sigma(k) < UNFELT { value(k) } else { 0.0 };
            let values = (0..3).map(felt).collect();
            vec![Number { stem: "first_moment", values, sigma: (0..3).map(sigma).collect() }]
        }
        Form::Wave => wave([value(0), value(1)], shared, floor),
        Form::Payload { about } => {
            let own = |k: usize| at(family.columns[k]).map(|_| shared(k, k).max(0.0).sqrt());
            payload([0, 1, 2, 3].map(value), about, sigma(0), own)
        }
    };
    // How often a wave turns is told by its phase alone, whatever its height.
    let of_form = if family.form == Form::Wave { 0.0 } else { FLOOR };
    all.extend(
        family
            .settings
            .iter()
            .map(|(stem, value)| one(stem, *value, (context.spread.hypot(of_form) * value).abs())),
    );
    all
}

/// `a sin(x) + b cos(x) = A sin(x + φ)`.
fn wave([a, b]: [f64; 2], shared: impl Fn(usize, usize) -> f64, floor: f64) -> Vec<Number> {
    let amplitude = a.hypot(b);
    let square = amplitude * amplitude;
    let cross = 2.0 * a * b * shared(0, 1);
    let along = (a * a * shared(0, 0) + b * b * shared(1, 1) + cross) / square;
    let across = (b * b * shared(0, 0) + a * a * shared(1, 1) - cross) / square;
    let of_amplitude = along.max(0.0).sqrt().hypot(floor * amplitude);
    let of_phase = across.max(0.0).sqrt() / amplitude;
    vec![one("amplitude", amplitude, of_amplitude), one("phase", libm::atan2(b, a), of_phase)]
}

/// Mass and centre from mass and first moment about a point. Both share the torque's scale, which leaves the centre alone.
fn payload(
    [mass, moment @ ..]: [f64; 4],
    about: DVec3,
    of_mass: f64,
    own: impl Fn(usize) -> Option<f64>,
) -> Vec<Number> {
    let com = |k: usize| about[k] + moment[k] / mass;
    let of_mass_alone = own(0).unwrap_or(0.0);
    // Along an axis that no drive feels it may hang anywhere within reach.
    let of_com = |k: usize| {
        let told = |own| libm::hypot(own / mass, of_mass_alone * moment[k] / (mass * mass));
        own(k + 1).map_or(REACH_M, told)
    };
    let values = (0..3).map(com).collect();
    let sigma = (0..3).map(of_com).collect();
    vec![one("mass", mass, of_mass), Number { stem: "com", values, sigma }]
}

fn one(stem: &'static str, value: f64, sigma: f64) -> Number {
    Number { stem, values: vec![value], sigma: vec![sigma] }
}

/// Whether an effect's first numbers are torques: as sure as the torque's scale.
fn goes_with_torque(kind: &str) -> bool {
    !matches!(kind, "load_friction" | "drive_gain" | "torque_delay" | "friction_temperature")
}

/// Other names for what a name explains, the likeliest first, with the probability of the name itself.
pub(super) fn rivals(search: &Search<'_>, selection: &Selection, name: usize) -> (f64, Vec<Rival>) {
    let families = &search.library.families;
    let others = others(&selection.names, name);
    let without = search.solve(&others);
    let worth = selection.solved.gain - without.solved.gain;
    let own = &families[name];
    let is_other = |other: &usize| {
        let form = &families[*other];
        let is_more_of_it = form.is_kin(own) && form.columns.len() >= own.columns.len();
        // What hardens a spring is on top of it, never in its place.
        let is_on_top = form.kind == "spring_hardening" && own.kind == "spring";
        !(selection.names.contains(other) || is_more_of_it || is_on_top)
    };
    let mut best: Vec<Rival> = Vec::new();
    for other in (0..families.len()).filter(is_other) {
        let family = &families[other];
        // What another name would bring in any case is no rival to this one.
        let instead = search.could_bring(&without, other) - search.could_bring(selection, other);
        let behind = worth - instead;
        if instead < SHARES * worth {
            continue;
        }
        if behind > FAR {
            continue;
        }
        let dearer = search.numbers(family) - search.numbers(own);
        let rival = Rival::of(family, other, behind, dearer);
        let known = best.iter().position(|one| {
            one.kind == rival.kind && one.joint == rival.joint && one.stems == rival.stems
        });
        match known {
            Some(at) if best[at].behind > behind => best[at] = rival,
            Some(_) => {}
            None => best.push(rival),
        }
    }
    let penalty = search.criterion().per_parameter();
    let losses: Vec<f64> = best.iter().map(|one| one.behind + one.dearer * penalty).collect();
    let (probability, shares) = posterior(&losses);
    best.iter_mut().zip(shares).for_each(|(rival, share)| rival.confidence = share);
    best.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
    (probability, best)
}
