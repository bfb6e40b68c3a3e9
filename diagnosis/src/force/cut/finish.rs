//! The result of forces held against a cut: names with their numbers, what they bring on held-out rows, what remains, the verdict.
//!
//! Promises: held-out rows are read here first, and change no choice but to take a name out. Never: a claim of what cannot be told apart.

use physics::Model;
use recording::series::Recording;
use std::f64::consts::TAU;

use super::case::{Belief, Case};
use super::found;
use super::law::{LEAK, SCALE, Slot, TURN};
use super::names::{KINDS, TONE};
use super::rest::{self, Rest};
use super::rows::Rows;
use crate::diagnose::Verdict;
use crate::torque::Finding;
use crate::torque::choose::{Asking, Choice};
use crate::torque::prove::{borne_out_by, order_by, told_by};
use crate::torque::table::Solved;

/// Names must carry this share of what stands above the noise on held-out rows, as energy; else the structure is unknown.
const CARRIED: f64 = 0.98;
/// Where more than this share of what is named cannot be told apart, nothing is claimed.
const CLEAR: f64 = 0.5;
/// One law says more than all names where it carries more by this share.
const CLEARLY: f64 = 0.02;
/// And by so much more than chance makes of it, in units of the noise, squared.
const BY_CHANCE: f64 = 20.0;
/// The other numbers make one no less sure than this, as a ratio of variances, or it is not asked for.
const APART: f64 = 300.0;
/// Sensors are off by at most this share, and turned by at most this, rad.
const BEYOND: f64 = 0.5;
/// Points of a trace at most.
const POINTS: usize = 1500;
/// A feed that changes by less than this share of itself is one.
const ONE_FEED: f64 = 0.02;

/// One axis of the forces, for the page.
#[derive(Clone, Debug)]
pub struct Traced {
    /// From 0: x, y, z.
    pub axis: usize,
    /// s.
    pub t_s: Vec<f64>,
    /// Of the spindle, in turns from 0 to 1.
    pub turn: Vec<f64>,
    /// What was read, N.
    pub read: Vec<f64>,
    /// Off: by the law as told, and with what was found.
    pub off: [Vec<f64>; 2],
    /// What the law as told, and with what was found, reads.
    pub law: [Vec<f64>; 2],
    /// The first run, unthinned, off before and after, with its rate in Hz, for spectra.
    pub run: [Vec<f64>; 2],
    /// Hz.
    pub rate_hz: f64,
}

/// Forces held against the told cut.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The verdict.
    pub verdict: Verdict,
    /// Most important first; SI.
    pub findings: Vec<Finding>,
    /// Structure beyond them.
    pub unexplained: Option<Rest>,
    /// Held-out root mean square as told and with what was found, N.
    pub heldout: [f64; 2],
    /// What no name explains, N.
    pub noise: f64,
    /// Of what was read, N.
    pub signal: f64,
    /// Rows that were compared.
    pub rows: usize,
    /// How rows were held out.
    pub says: String,
    /// What could not have shown, and why.
    pub not_tested: Vec<(&'static str, &'static str)>,
    /// What was done with the data, in words.
    pub notes: Vec<String>,
    /// Whether the feed was always the same.
    pub has_one_feed: bool,
    /// Whether the tool was ever in air.
    pub has_air: bool,
    /// Per axis that was recorded.
    pub traces: Vec<Traced>,
}

pub(super) fn finish(
    mut case: Case,
    model: &Model,
    recording: &Recording,
    rows: &Rows,
    names: &[usize],
) -> Compared {
    let seen = case.sets.seen();
    let mut names = settled(&mut case, names, &seen);
    let is_patched = is_patched(&case, &names, &seen);
    if is_patched {
        names = settled(&mut case, &[], &seen);
    }
    let held = case.sets.held.clone();
    let products = case.products(&seen);
    let asking = Asking { library: &case.library, products: &products, always: &case.always };
    let choice = asking.solve(&names);
    let rms = |solved: &Solved| case.rms(solved, &held);
    let listed = order_by(&asking, &choice, &rms);
    let covariance = case.covariance(&choice.solved, &seen);
    let stated = |kind: &str| model.effects().any(|effect| effect.spec().kind == kind);
    let mut findings = Vec::new();
    let mut hum = None;
    for (name, heldout) in &listed {
        let family = &case.library.families[*name];
        if family.kind == TONE {
            hum = Some(*heldout);
            continue;
        }
        let weighed = found::weighed(&case, &asking, &choice, *name, &seen);
        findings.push(Finding {
            kind: family.kind,
            joint: None,
            recording: None,
            is_change: stated(family.kind),
            numbers: found::numbers(&case, model, &asking, &choice, family, &covariance),
            confidence: weighed.confidence,
            gain: weighed.gain,
            rivals: weighed.rivals,
            heldout: *heldout,
        });
    }
    let law = rest::rest(&case, &choice.solved, &case.belief);
    let given = asking.solve(&[]);
    let heldout = [&given, &choice].map(|one| rms(&one.solved));
    let is_strange = is_patched || hum.is_some();
    let verdict = verdict(&case, &findings, (&given, &choice), law.as_ref(), is_strange);
    let nameless = || is_patched.then(|| beyond_names(heldout));
    let unexplained = hum.map(|held| a_tone(&case, held)).or(law).or_else(nameless);
    Compared {
        verdict,
        findings,
        unexplained,
        heldout,
        noise: case.rms(&choice.solved, &seen),
        signal: signal(&case),
        rows: rows.at.len(),
        says: case.sets.says.clone(),
        not_tested: not_tested(&case),
        notes: notes(&case, recording),
        has_one_feed: has_one_feed(&case),
        has_air: case.law.rows.iter().any(|stood| !stood.cuts),
        traces: traces(&case),
    }
}

/// Whether the numbers of a name, as the law itself has them, keep their limits.
fn is_within(case: &Case, name: usize) -> bool {
    let family = &case.library.families[name];
    family.columns.iter().zip(&family.signs).all(|(column, sign)| {
        let number = case.belief.numbers.get(*column);
        number.is_none_or(|number| sign.admits(*number))
    })
}

/// A tone that is of no cut.
fn a_tone(case: &Case, held: [f64; 2]) -> Rest {
    let words = vec!["t_s".to_owned()];
    Rest { axis: 0, words, held, tone_hz: Some(case.law.tone_hz), carries: 0.0 }
}

/// A mismatch that names explain with numbers that no sensor has.
fn beyond_names(held: [f64; 2]) -> Rest {
    Rest { axis: 0, words: vec!["wrench".to_owned()], held, tone_hz: None, carries: 0.0 }
}

/// Whether names are patches on something that is none of them: one law of one axis says more than all of them, or a number is beyond what a sensor can be off by.
fn is_patched(case: &Case, names: &[usize], seen: &[bool]) -> bool {
    if names.is_empty() {
        return false;
    }
    let numbers = &case.belief.numbers;
    let is_beyond = |slot: Slot| slot.of(numbers).iter().any(|number| number.abs() > BEYOND);
    if [SCALE, TURN, LEAK].into_iter().any(is_beyond) {
        return true;
    }
    let products = case.products(seen);
    let asking = Asking { library: &case.library, products: &products, always: &case.always };
    let (given, choice) = (asking.solve(&[]), asking.solve(names));
    let told = Belief::as_told(case.belief.spindle.clone());
    let law = rest::law(case, &given.solved, &told);
    let least = BY_CHANCE + (1.0 + CLEARLY) * carried(case, &given, &choice);
    law.is_some_and(|law| law.carries > least)
}

/// What a choice carries on held-out rows of the energy that is off as given, in units of the noise.
fn carried(case: &Case, given: &Choice, choice: &Choice) -> f64 {
    let held = &case.sets.held;
    let energy = |choice: &Choice| {
        let rms = case.rms(&choice.solved, held);
        rms * rms
    };
    let axes: Vec<usize> = case.table.joints().collect();
    let count: f64 = axes
        .iter()
        .map(|axis| {
            let counts = case.table.counts[*axis].iter().zip(held);
            counts.filter(|(a, b)| **a && **b).count() as f64
        })
        .sum();
    let scale = axes.iter().map(|axis| case.table.noise[*axis].1.ln()).sum::<f64>();
    let scale = libm::exp(2.0 * scale / (axes.len().max(1) as f64));
    (energy(given) - energy(choice)).max(0.0) * count / scale
}

/// The names that stand on all rows that were seen, and the belief that they make: numbers that are not nothing, borne out by rows held out.
fn settled(case: &mut Case, names: &[usize], seen: &[bool]) -> Vec<usize> {
    let fit = |case: &mut Case, names: &[usize]| {
        let products = case.products(seen);
        let asking = Asking { library: &case.library, products: &products, always: &case.always };
        let columns = asking.columns(names);
        let (belief, _) = case.fitted(&case.belief, &columns, seen);
        case.belief = belief;
        case.take();
    };
    fit(case, names);
    let mut names = names.to_vec();
    while let Some(wrong) = names.iter().position(|name| !is_within(case, *name)) {
        names.remove(wrong);
        fit(case, &names);
    }
    let kept = {
        let products = case.products(seen);
        let asking = Asking { library: &case.library, products: &products, always: &case.always };
        let covariance = |solved: &Solved| case.covariance(solved, seen);
        let is_belief = |name: usize| case.library.families[name].revises;
        let kept = told_by(&asking, names.clone(), &covariance, &is_belief);
        let left = |solved: &Solved| case.left_white(solved, &case.sets.held);
        borne_out_by(&asking, kept, &left, &is_belief).0
    };
    let full = fullest(case, &kept, seen);
    if full != names {
        fit(case, &full);
    }
    full
}

/// The names with all numbers that theirs may have, where rows tell these apart: a number that is left out is no number that is nothing.
fn fullest(case: &Case, names: &[usize], seen: &[bool]) -> Vec<usize> {
    let families = &case.library.families;
    let products = case.products(seen);
    let asking = Asking { library: &case.library, products: &products, always: &case.always };
    let mut all = names.to_vec();
    for k in 0..all.len() {
        let own = &families[all[k]];
        let same = |place: &usize| {
            families[*place].kind == own.kind && families[*place].settings.is_empty()
        };
        let forms = (0..families.len()).filter(same);
        let Some(full) = forms.max_by_key(|place| families[*place].columns.len()) else { continue };
        let mut tried = all.clone();
        tried[k] = full;
        let solved = asking.solve(&tried).solved;
        let is_apart = |(at, column): (usize, &usize)| {
            let spread = solved.covariance()[(at, at)] * products.gram[(*column, *column)];
            families[full].revises || !families[full].columns.contains(column) || spread < APART
        };
        if own.settings.is_empty() && solved.columns.iter().enumerate().all(is_apart) {
            all = tried;
        }
    }
    all
}

fn verdict(
    case: &Case,
    findings: &[Finding],
    (given, choice): (&Choice, &Choice),
    rest: Option<&Rest>,
    is_strange: bool,
) -> Verdict {
    let explained = carried(case, given, choice);
    let share = rest.map(|rest| explained / (explained + rest.carries).max(f64::MIN_POSITIVE));
    let named: f64 = findings.iter().map(|one| one.gain).sum();
    let is_alike = |one: &&Finding| one.rivals.iter().any(|r| r.alike);
    let alike: f64 = findings.iter().filter(is_alike).map(|one| one.gain).sum();
    match (findings.is_empty(), share) {
        _ if is_strange => Verdict::UnknownStructure,
        (true, None) => Verdict::Consistent,
        (true, Some(_)) => Verdict::UnknownStructure,
        (false, Some(share)) if share < CARRIED => Verdict::UnknownStructure,
        _ if alike > CLEAR * named => Verdict::Undetermined,
        _ => Verdict::MissingPhysics,
    }
}

fn signal(case: &Case) -> f64 {
    let values = case.measured.iter().flatten().flatten();
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), x| (sum + x * x, count + 1.0));
    libm::sqrt(sum / f64::max(count, 1.0))
}

fn feeds(case: &Case) -> [f64; 2] {
    let cuts = case.law.rows.iter().filter(|stood| stood.cuts);
    cuts.map(|stood| stood.feed_per_tooth_m)
        .fold([f64::INFINITY, 0.0], |[low, high], feed| [low.min(feed), high.max(feed)])
}

fn has_one_feed(case: &Case) -> bool {
    let [low, high] = feeds(case);
    high - low <= ONE_FEED * high
}

/// What this recording could not have shown, though it was not found.
fn not_tested(case: &Case) -> Vec<(&'static str, &'static str)> {
    let mut all: Vec<(&'static str, &'static str)> =
        case.library.untested.iter().map(|(kind, _, why)| (*kind, *why)).collect();
    const LACKING: [(&str, &str); 3] = [
        ("fx_N", "fx_N was not recorded or does not change: what shows there alone is not seen"),
        ("fy_N", "fy_N was not recorded or does not change: what shows there alone is not seen"),
        ("fz_N", "fz_N was not recorded or does not change: what shows there alone is not seen"),
    ];
    for (measured, (_, why)) in case.measured.iter().zip(LACKING) {
        if measured.is_none() {
            all.push(("cutting_force", why));
        }
    }
    all
}

fn notes(case: &Case, recording: &Recording) -> Vec<String> {
    let mut notes = Vec::new();
    let faster = case.belief.spindle.faster;
    let is_off = libm::fabs(faster) > 1e-5;
    if is_off {
        notes.push(format!(
            "the spindle turns {:.3} % {} than the recording tells",
            100.0 * libm::fabs(faster),
            if faster > 0.0 { "faster" } else { "slower" }
        ));
    }
    let turned = case.belief.spindle.phases.iter().map(|phase| phase.abs()).fold(0.0, f64::max);
    if turned > 0.02 {
        notes.push(format!(
            "tooth 0 does not stand at angle 0 where a segment begins: off by up to {turned:.2} rad, fitted along"
        ));
    }
    if recording.len() > case.law.rows.len() {
        notes.push(format!(
            "{} of {} rows were compared, in stretches spread over the recording",
            case.law.rows.len(),
            recording.len()
        ));
    }
    notes
}

/// What the page shows.
fn traces(case: &Case) -> Vec<Traced> {
    let told = Belief::as_told(case.belief.spindle.clone());
    let law = [&told, &case.belief].map(|belief| case.readings(belief));
    let off = [&told, &case.belief].map(|belief| case.left(belief));
    let count = case.law.rows.len();
    let thin = count.div_ceil(POINTS).max(1);
    let rows: Vec<usize> = (0..count).step_by(thin).collect();
    let some = |list: &[f64]| -> Vec<f64> { rows.iter().map(|row| list[*row]).collect() };
    let run = case.table.runs.iter().max_by_key(|run| run.len()).cloned().unwrap_or(0..0);
    let time = |row: usize| case.law.rows[row].time_s;
    let lasts_s = if run.len() > 1 { time(run.end - 1) - time(run.start) } else { 0.0 };
    let rate_hz = (run.len().saturating_sub(1)) as f64 / lasts_s.max(f64::MIN_POSITIVE);
    let spindle = &case.belief.spindle;
    KINDS[..3]
        .iter()
        .enumerate()
        .filter_map(|(axis, _)| Some((axis, case.measured[axis].as_ref()?)))
        .map(|(axis, read)| Traced {
            axis,
            t_s: rows.iter().map(|row| time(*row)).collect(),
            turn: rows
                .iter()
                .map(|row| (spindle.angle(&case.law.rows[*row]) / TAU).rem_euclid(1.0))
                .collect(),
            read: some(read),
            off: [some(&off[0][axis]), some(&off[1][axis])],
            law: [some(&law[0][axis]), some(&law[1][axis])],
            run: [off[0][axis][run.clone()].to_vec(), off[1][axis][run.clone()].to_vec()],
            rate_hz,
        })
        .collect()
}
