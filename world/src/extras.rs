//! What a calibration missed: effects from a menu, of engineering size, small at the TCP.
//!
//! Ranges are for an arm of the IRB 1600's class (docs of each entry below). An effect is drawn by kind, then joint, then
//! parameters; its amplitude is set for a drawn size at the TCP and must then lie in its engineering range, else
//! the draw is repeated. Size: root mean square of the TCP's displacement over the given poses, without wrench.
//!
//! Promises: kinds and joints that the model lacks (compliances count as one kind); the size together lies in the asked range.
//! Never: a look at a correction's success.

use crate::draw::{DrawError, TrueRobot};
use crate::robot::{Robot, Servo};
use physics::{AnyEffect, Arm, Given, JointKind, Joints, Model, Wrench};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// How many effects the calibrated model lacks, and how large they are together at the TCP (root mean square, m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtraSize {
    /// How many.
    pub count: usize,
    /// Least size together, m.
    pub least_m: f64,
    /// Largest size together, m.
    pub largest_m: f64,
}

impl Default for ExtraSize {
    /// Two effects, 20 to 60 µm together.
    fn default() -> Self {
        Self { count: 2, least_m: 20e-6, largest_m: 60e-6 }
    }
}

/// An effect that the calibrated model lacks.
#[derive(Clone, Debug, PartialEq)]
pub struct Extra {
    /// Its name in the contract.
    pub kind: &'static str,
    /// Its size alone at the TCP.
    pub size: TcpSize,
    /// What it is, for the report.
    pub words: String,
}

/// How far an effect moves the TCP over some poses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TcpSize {
    /// Root mean square, m.
    pub rms_m: f64,
    /// Largest, m.
    pub largest_m: f64,
}

/// An entry of the menu: the amplitude's stem and its range, SI, for main axes and for the wrist.
struct Entry {
    kind: &'static str,
    amplitude: &'static str,
    main: (f64, f64),
    wrist: (f64, f64),
    of_joint: bool,
}

const ARCSEC: f64 = TAU / 360.0 / 3600.0;
const COMPLIANCES: [&str; 4] =
    ["joint_compliance", "gravity_compliance", "load_compliance", "gravity_sag"];

/// Engineering ranges. Slamani, Nubiola and Bonev (2012) measured the same arm; the base's is ours: a steel stand on a floor.
const MENU: &[Entry] = &[
    // 10 to 40 arcsec in the main axes, 30 to 120 in the wrist.
    joint("backlash", "width", (10.0 * ARCSEC, 40.0 * ARCSEC), (30.0 * ARCSEC, 120.0 * ARCSEC)),
    // Eccentric output wheels, 5 to 30 arcsec, wrist 20 to 200; one or two cycles per revolution.
    joint(
        "transmission_error",
        "amplitude",
        (5.0 * ARCSEC, 30.0 * ARCSEC),
        (20.0 * ARCSEC, 200.0 * ARCSEC),
    ),
    joint("joint_ratio", "ratio", (1e-6, 1e-4), (1e-6, 1e-4)),
    // 2e5 to 8e5 Nm/rad in the main axes, 2e4 to 1.5e5 in the wrist.
    joint("joint_compliance", "compliance", (1.0 / 8e5, 1.0 / 2e5), (1.0 / 1.5e5, 1.0 / 2e4)),
    // 2e6 to 2e7 Nm/rad.
    Entry { of_joint: false, ..joint("base_compliance", "compliance", (5e-8, 5e-7), (0.0, 0.0)) },
    // 1e6 to 5e6 Nm/rad about the axes that the bearing has to hold.
    joint("bearing_compliance", "compliance", (2e-7, 1e-6), (2e-7, 1e-6)),
    // Pre-sliding in preloaded gears: half of what a gap of the same drive would be, over some milliradians.
    joint("hysteresis", "amplitude", (5.0 * ARCSEC, 20.0 * ARCSEC), (15.0 * ARCSEC, 60.0 * ARCSEC)),
    // Per metre of link, iron to aluminium; the range is times the link's length.
    joint("thermal_growth", "growth", (11e-6, 23.6e-6), (11e-6, 23.6e-6)),
];

const fn joint(
    kind: &'static str,
    amplitude: &'static str,
    main: (f64, f64),
    wrist: (f64, f64),
) -> Entry {
    Entry { kind, amplitude, main, wrist, of_joint: true }
}

/// One draw from the menu, its amplitude still open.
struct Candidate {
    entry: &'static Entry,
    joint: Option<usize>,
    range: (f64, f64),
    sign: f64,
    rest: Vec<(&'static str, f64)>,
}

/// How far `other` puts the TCP from where `model` puts it, over `poses` run through as a path.
pub fn size(model: &Model, other: &Model, poses: &[Joints], ambient_celsius: f64) -> TcpSize {
    let Some(first) = poses.first() else { return TcpSize::default() };
    let start = |model| Robot::at_rest(model, Servo::ideal(1e-3), *first, ambient_celsius);
    let (mut a, mut b) = (start(model), start(other));
    let (mut squares, mut largest) = (0.0, 0.0_f64);
    for q in poses {
        a.follow(q, Wrench::ZERO);
        b.follow(q, Wrench::ZERO);
        let off = (b.base_from_tool().origin - a.base_from_tool().origin).length_squared();
        squares += off;
        largest = largest.max(off);
    }
    let rms_m = libm::sqrt(squares / poses.len() as f64);
    TcpSize { rms_m, largest_m: libm::sqrt(largest) }
}

/// Adds the extras to `truth`.
pub(crate) fn draw_extras(
    truth: &mut TrueRobot,
    asked: &ExtraSize,
    poses: &[Joints],
    rng: &mut ChaCha8Rng,
) -> Result<(), DrawError> {
    if asked.count == 0 {
        return Ok(());
    }
    for _ in 0..1000 {
        let total = rng.random_range(asked.least_m..=asked.largest_m);
        let Some((model, extras)) = attempt(truth, asked.count, total, poses, rng)? else {
            continue;
        };
        let together = size(&truth.model, &model, poses, truth.ambient_celsius).rms_m;
        if (asked.least_m..=asked.largest_m).contains(&together) {
            truth.model = model;
            truth.extras = extras;
            return Ok(());
        }
    }
    let ExtraSize { count, least_m, largest_m } = *asked;
    Err(DrawError::NoExtras { count, least_m, largest_m })
}

/// Effects of random shares of the total's square; none where one does not fit its engineering range.
fn attempt(
    truth: &TrueRobot,
    count: usize,
    total: f64,
    poses: &[Joints],
    rng: &mut ChaCha8Rng,
) -> Result<Option<(Model, Vec<Extra>)>, DrawError> {
    let (mut model, mut extras) = (truth.model, Vec::new());
    let mut left = total * total;
    for k in 0..count {
        let share = if k + 1 == count { 1.0 } else { rng.random_range(0.3..0.7) };
        let wanted = libm::sqrt(share * left);
        left *= 1.0 - share;
        let Some(candidate) = candidate(&model, &extras, rng) else { return Ok(None) };
        let ambient = truth.ambient_celsius;
        let Some(effect) = sized(&truth.model, &candidate, wanted, poses, ambient)? else {
            return Ok(None);
        };
        let mut alone = truth.model;
        alone.push(effect)?;
        model.push(effect)?;
        let size = size(&truth.model, &alone, poses, ambient);
        let words = words(&truth.model.arm, &candidate, &effect, size);
        extras.push(Extra { kind: candidate.entry.kind, size, words });
    }
    Ok(Some((model, extras)))
}

/// A kind that is not yet among the extras, at a place where the model lacks it.
fn candidate(model: &Model, extras: &[Extra], rng: &mut ChaCha8Rng) -> Option<Candidate> {
    let entry = &MENU[rng.random_range(0..MENU.len())];
    let arm = &model.arm;
    let i = rng.random_range(0..arm.count());
    let joint = entry.of_joint.then_some(i);
    let revolute = arm.joints()[i].kind == JointKind::Revolute;
    let taken = extras.iter().any(|extra| extra.kind == entry.kind);
    if taken || !lacks(model, entry.kind, joint) || (entry.of_joint && !revolute) {
        return None;
    }
    let (mut low, mut high) =
        if i + 3 < arm.count() || !entry.of_joint { entry.main } else { entry.wrist };
    let mut rest = Vec::new();
    let mut sign = 1.0;
    match entry.kind {
        "transmission_error" => {
            rest.push(("cycles", f64::from(rng.random_range(1_u8..=2))));
            rest.push(("phase", rng.random_range(0.0..TAU)));
        }
        "hysteresis" => rest.push(("reversal", rng.random_range(5e-4..5e-3))),
        "joint_ratio" => sign = if rng.random() { 1.0 } else { -1.0 },
        "thermal_growth" => {
            let link = (arm.next_point(i) - arm.joints()[i].point).length();
            if link < 1e-3 {
                return None;
            }
            (low, high) = (low * link, high * link);
        }
        _ => {}
    }
    Some(Candidate { entry, joint, range: (low, high), sign, rest })
}

/// Whether nothing of the kind, or alike, stands there. Gear errors at many cycles per revolution are not like the once or
/// twice per revolution of an eccentric output wheel.
fn lacks(model: &Model, kind: &str, joint: Option<usize>) -> bool {
    let alike = |other: &AnyEffect| {
        let name = other.spec().kind;
        let fast = kind == "transmission_error" && other.values().get(1).is_some_and(|n| *n > 2.5);
        (name == kind && !fast) || (COMPLIANCES.contains(&kind) && COMPLIANCES.contains(&name))
    };
    !model.effects().any(|effect| effect.joint() == joint && alike(effect))
}

/// The effect with the amplitude that moves the TCP by `wanted` (m); none where that is out of its range.
fn sized(
    model: &Model,
    candidate: &Candidate,
    wanted: f64,
    poses: &[Joints],
    ambient_celsius: f64,
) -> Result<Option<AnyEffect>, DrawError> {
    let (low, high) = candidate.range;
    if high <= 0.0 {
        return Ok(None);
    }
    let mut probe = *model;
    probe.push(build(&model.arm, candidate, high)?)?;
    let at_most = size(model, &probe, poses, ambient_celsius).rms_m;
    let amplitude = high * wanted / at_most;
    if !(low..=high).contains(&amplitude) {
        return Ok(None);
    }
    build(&model.arm, candidate, amplitude).map(Some)
}

fn build(arm: &Arm, candidate: &Candidate, amplitude: f64) -> Result<AnyEffect, DrawError> {
    let kind = candidate.entry.kind;
    let amplitude = [candidate.sign * amplitude];
    let rest = candidate.rest.iter().map(|(stem, value)| (*stem, core::slice::from_ref(value)));
    let given: Vec<_> =
        core::iter::once((candidate.entry.amplitude, amplitude.as_slice())).chain(rest).collect();
    AnyEffect::build(kind, arm, candidate.joint, Given(&given))
        .map_err(|error| DrawError::Menu { kind, error })
}

/// `backlash on joint 2: width_mrad 0.083; 31 µm at the TCP`.
fn words(arm: &Arm, candidate: &Candidate, effect: &AnyEffect, size: TcpSize) -> String {
    let kind = candidate.joint.map_or(JointKind::Revolute, |i| arm.joints()[i].kind);
    let amplitude = candidate.entry.amplitude;
    let numbers =
        core::iter::once((amplitude, effect.values()[0])).chain(candidate.rest.iter().copied());
    let mut said = Vec::new();
    for (stem, value) in numbers {
        if let Some(parameter) = effect.spec().parameters.iter().find(|p| p.stem == stem) {
            let si = parameter.unit.suffix_and_si(kind).1;
            said.push(format!("{} {}", parameter.key(kind), three_digits(value / si)));
        }
    }
    let place = candidate.joint.map_or(String::new(), |i| format!(" on joint {}", i + 1));
    let at_tcp = 1e6 * size.rms_m;
    format!("{}{place}: {}; {at_tcp:.0} µm at the TCP", candidate.entry.kind, said.join(", "))
}

/// Three significant digits: `0.0831`, `12.3`, `2`, `3.51e-5`.
fn three_digits(x: f64) -> String {
    let magnitude = libm::floor(libm::log10(x.abs()));
    if x == libm::rint(x) {
        format!("{x}")
    } else if magnitude < -3.0 {
        format!("{x:.2e}")
    } else {
        format!("{x:.*}", (2.0 - magnitude).max(0.0) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_said_with_three_digits() {
        let said = [0.083_12, 12.345, 2.0, 3.512e-5, -0.5, 1234.5, 0.0].map(three_digits);
        assert_eq!(said, ["0.0831", "12.3", "2", "3.51e-5", "-0.500", "1234", "0"]);
    }
}
