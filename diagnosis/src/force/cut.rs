//! Forces compared with the model of a stated cut: differences, and the effects of cutter or sensor that explain them.
//!
//! Read in this order: `law` (predicted sensor reading), `rows` (which rows are compared), `ways` (entry and exit), `spindle` (angle and speed), `gross` (gross errors), `case` (linearisation, noise), `names` (candidates), `sets` (selection),
//! `tone`, `found` (parameters and alternatives), `laws`, `rest` (unmodelled structure), `finish` (test and verdict), `view` (for the page).
//!
//! Promises: the same input gives the same bits; held-out rows are seen by no selection and no fit; if the statement of the cut is insufficient, the reason is given.
//! Never: a file, a cutting law other than that of `physics`.

mod case;
mod finish;
mod found;
mod gross;
mod law;
mod laws;
mod names;
mod rest;
mod rows;
mod sets;
mod spindle;
#[cfg(test)]
mod tests;
mod tone;
mod view;
mod ways;

use physics::{CutForce, Inputs, Joints, Memories, Model};
use recording::series::{Channel, Recording};

use super::signal::Signal;
use crate::colour::Colour;
use crate::engine::library::Library;
use crate::engine::stepwise::{Search, others};
use crate::engine::table::Table;
use case::{Anyway, Belief, Case};
use law::{Law, Spindle};
use rows::Rows;

pub use finish::Compared;
pub use rest::Rest;
pub use view::Traced;

/// Rounds of selection, each with the law taken anew.
const ROUNDS: usize = 6;
/// Rounds in which a likelier rival takes a name's place.
const SWAPS: usize = 4;
/// Improvement in log-likelihood, beyond the penalty, from which another angle or speed of the spindle than the stated one is accepted.
const INSISTS: f64 = 10.0;
/// A name that brings less than this on rows that took no part in its selection, in log-likelihood, tells nothing.
const TELLS: f64 = 0.0;
/// Rows of the cut from which on anything can be compared.
const ROWS_LEAST: usize = 200;

/// Why forces are not compared with the law of a cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Silence {
    /// No cut.
    NoCut,
    /// No coefficient.
    NoCoefficient,
    /// Turning, with a specific cutting force alone.
    OneDirection,
    /// No force.
    NoForce,
    /// No speed.
    NoSpeed,
    /// No feed.
    NoFeed,
    /// Nothing is cut.
    NoRows,
    /// Channels are not where they are said to be.
    Places,
    /// Another size.
    Size,
}

impl Silence {
    /// Whether a cut was told that the recording should have been held against: then nothing else is claimed of it.
    pub(super) fn is_grave(self) -> bool {
        !matches!(self, Self::NoCut | Self::NoCoefficient | Self::OneDirection | Self::NoForce)
    }

    /// In words.
    #[must_use]
    pub fn why(self) -> &'static str {
        match self {
            Self::NoCut => "the recording has no [cut]: teeth, depth and engagement are not known",
            Self::NoCoefficient => "[cut] states no coefficient, so no force can be predicted",
            Self::OneDirection => {
                "[cut] states only the specific cutting force, so forces in the other directions cannot be predicted"
            }
            Self::NoForce => "no force was recorded",
            Self::NoSpeed => "no column holds the spindle speed: give spindle_rpm, or tacho",
            Self::NoFeed => "no column holds the feed: give feed_mm_s",
            Self::NoRows => {
                "spindle or feed stand still in nearly all rows, or are not known: nothing is cut"
            }
            Self::Places => {
                "the forces match the stated cut with channels swapped or inverted: rename fx_N, fy_N, fz_N (x along the feed, z out of the workpiece, y = z × x)"
            }
            Self::Size => {
                "the forces are many times those of the stated cut, or a small part of them: another unit, another depth, another material"
            }
        }
    }
}

/// Compares forces with the cut that the recording tells of; `sigma`: of each value of each of the model's effects.
///
/// # Errors
/// Why they cannot be compared.
pub(super) fn compare(
    model: &Model,
    sigma: &[Vec<f64>],
    recording: &Recording,
    signal: &Signal,
) -> Result<Compared, Silence> {
    let (mut case, rows) = begun(model, recording, signal)?;
    case.doubts = names::doubts(model, sigma);
    let told = case.belief.spindle.clone();
    let found = spindle::find(&case, &case.sets.train);
    case.belief.spindle = found.clone();
    gross::look(&case)?;
    let as_told = Case { belief: Belief::as_told(told.clone()), ..case.clone() };
    let mut best = answered(as_told, model, &rows, false);
    if found != told {
        let other = answered(case, model, &rows, true);
        if turns_otherwise(&best, &other) {
            best = other;
        }
    }
    let names = confirmed(&best.0, best.1);
    Ok(finish::finish(best.0, model, recording, &rows, &names))
}

/// Whether forces insist on a spindle that stands otherwise than is told: both are weighed on the same rows, by the same noise.
fn turns_otherwise(told: &(Case, Vec<usize>), other: &(Case, Vec<usize>)) -> bool {
    let mut as_told = told.0.clone();
    as_told.table.noise.clone_from(&other.0.table.noise);
    as_told.table.counts.clone_from(&other.0.table.counts);
    let cost = |case: &Case, names: &[usize]| {
        let products = case.products(&case.sets.train);
        let search = Search { library: &case.library, products: &products, always: &case.always };
        let (_, misfit) = case.fitted(&case.belief, &search.columns(names), &case.sets.train);
        let prices = names.iter().map(|name| search.penalty(&case.library.families[*name]));
        misfit + prices.sum::<f64>()
    };
    let free = other.0.anyway.spindle.len() as f64;
    let rows = as_told.law.rows.len() as f64;
    cost(&as_told, &told.1) - cost(&other.0, &other.1) > INSISTS + 0.5 * free * rows.ln()
}

/// The names that forces ask for where the spindle stands as is believed, or about there.
fn answered(mut case: Case, model: &Model, rows: &Rows, is_doubted: bool) -> (Case, Vec<usize>) {
    let train = case.sets.train.clone();
    case.count(&rows.is_between);
    names::library(&mut case);
    case.doubt_spindle(is_doubted);
    case.take();
    names::limit(&mut case, stated_wear(model));
    names::narrow(&mut case);
    case.estimate_noise();
    let mut names: Vec<usize> = Vec::new();
    let mut listened: Option<Vec<usize>> = None;
    for _ in 0..ROUNDS {
        let before = names.clone();
        names = chosen(&case, &names, &train);
        stand(&mut case, &names, &train);
        case.count(&rows.is_between);
        let is_heard = listen(&mut case, &names, &mut listened);
        case.take();
        case.estimate_noise();
        if before == names && !is_heard {
            break;
        }
    }
    for _ in 0..SWAPS {
        let better = sets::likelier(&case, &names, &train);
        let better = better.or_else(|| found::likelier(&case, &names, &train));
        if let Some(better) = &better {
            names.clone_from(better);
            stand(&mut case, &names, &train);
        }
        let is_heard = listen(&mut case, &names, &mut listened);
        if better.is_none() && !is_heard {
            break;
        }
        case.take();
        case.estimate_noise();
    }
    if rings(&case, &names) {
        case.law.tone_hz = tone::refined(&case, &train);
        case.take();
        stand(&mut case, &names, &train);
        case.take();
        case.estimate_noise();
    }
    (case, names)
}

/// Whether a tone is named.
fn rings(case: &Case, names: &[usize]) -> bool {
    names.iter().any(|name| !case.library.families[*name].settings.is_empty())
}

/// Asks for the loudest tone that these names leave, where none of them rings; whether there is one.
fn listen(case: &mut Case, names: &[usize], listened: &mut Option<Vec<usize>>) -> bool {
    // Whatever was named or taken back since may have hidden a tone.
    if rings(case, names) || listened.as_deref() == Some(names) {
        return false;
    }
    *listened = Some(names.to_vec());
    let heard = tone::loudest(case, &case.sets.train);
    if let Some(tone_hz) = heard {
        names::add_tone(case, tone_hz);
    }
    heard.is_some()
}

/// The names that the rows ask for, by slopes.
fn chosen(case: &Case, start: &[usize], used: &[bool]) -> Vec<usize> {
    let products = case.products(used);
    let search = Search { library: &case.library, products: &products, always: &case.always };
    let one_by_one = search.choose(start).names;
    let score = sets::Set::of(&search, &one_by_one).map(|set| set.score);
    let together = sets::likely(&search).into_iter().next();
    match together {
        Some(set) if score.is_none_or(|score| set.score > score + 1.0) => set.names,
        _ => one_by_one,
    }
}

/// Believes names where the law itself fits best with them.
fn stand(case: &mut Case, names: &[usize], used: &[bool]) {
    let products = case.products(used);
    let search = Search { library: &case.library, products: &products, always: &case.always };
    let selection = search.solve(names);
    let columns = search.columns(names);
    let start = case.believed(&case.belief, &selection.solved);
    let (belief, _) = case.fitted(&start, &columns, used);
    case.belief = belief;
}

/// Drops the effects that the validation set does not support.
fn confirmed(case: &Case, mut names: Vec<usize>) -> Vec<usize> {
    let products = case.products(&case.sets.train);
    let search = Search { library: &case.library, products: &products, always: &case.always };
    loop {
        let of =
            |names: &[usize]| case.left_white(&search.solve(names).solved, &case.sets.validation);
        let whole = of(&names);
        let harm = |name: &usize| of(&others(&names, *name)) - whole;
        let asked = names.iter().filter(|name| !case.library.families[**name].revises);
        let worst = asked.map(|name| (*name, harm(name)));
        let worst = worst.min_by(|a, b| a.1.total_cmp(&b.1));
        match worst {
            Some((name, harm)) if harm < TELLS => names.retain(|n| *n != name),
            _ => return names,
        }
    }
}

/// Rows, measured forces and the law, nothing yet asked.
fn begun(model: &Model, recording: &Recording, signal: &Signal) -> Result<(Case, Rows), Silence> {
    let cut = recording.about.cut.as_ref().ok_or(Silence::NoCut)?;
    if !signal.is_force {
        return Err(Silence::NoForce);
    }
    let cutter = cut.cutter();
    if cut.cutting_pa.iter().chain(&cut.edge_n_per_m).all(|number| *number == 0.0) {
        return Err(Silence::NoCoefficient);
    }
    // Who tells of turning the specific cutting force alone has told of one direction, and nothing of what rubs.
    let is_tangential = |three: &[f64; 3]| three[1] == 0.0 && three[2] == 0.0;
    if cut.turning && is_tangential(&cut.cutting_pa) && is_tangential(&cut.edge_n_per_m) {
        return Err(Silence::OneDirection);
    }
    let mut inputs = Inputs::at_rest(Joints::default());
    let memories = Memories::default();
    let mut force = |time_s: f64| {
        inputs.time_s = time_s;
        model.cut_force(&inputs, &memories)
    };
    let rows = Rows::of(recording, &cutter, signal)?;
    let count = rows.at.len();
    if rows.stood.iter().filter(|stood| stood.cuts).count() < ROWS_LEAST {
        return Err(Silence::NoRows);
    }
    let mut base: Vec<CutForce> = rows.stood.iter().map(|stood| force(stood.time_s)).collect();
    if base.iter().all(|force| *force == base[0]) {
        base.truncate(1);
    }
    let column = |axis: usize| {
        let (_, samples) = signal.channels.iter().find(|(one, _)| *one == axis)?;
        Some(rows.at.iter().map(|row| samples[*row]).collect::<Vec<f64>>())
    };
    let measured: [Option<Vec<f64>>; 3] = std::array::from_fn(column);
    let spindle = Spindle { phases: vec![0.0; rows.segments], faster: 0.0 };
    let told_noise = |axis: usize| recording.about.sigma.get(&Channel::Wrench(axis)).copied();
    let case = Case {
        law: Law { cutter, rows: rows.stood.clone(), base, tone_hz: 0.0 },
        belief: Belief::as_told(spindle),
        table: Table {
            runs: rows.runs.clone(),
            target: measured.to_vec(),
            moves: vec![vec![true; count]; 3],
            counts: vec![vec![true; count]; 3],
            noise: vec![(Colour::default(), 1.0); 3],
        },
        measured,
        library: Library {
            columns: Vec::new(),
            prior: Vec::new(),
            families: Vec::new(),
            untested: Vec::new(),
        },
        directions: Vec::new(),
        always: Vec::new(),
        anyway: Anyway::default(),
        doubts: Vec::new(),
        told_noise: std::array::from_fn(told_noise),
        sets: rows.sets(recording),
    };
    Ok((case, rows))
}

fn stated_wear(model: &Model) -> f64 {
    let of_wear = model.effects().filter(|effect| effect.spec().kind == "tool_wear");
    of_wear.flat_map(|effect| effect.values().to_vec()).sum()
}
