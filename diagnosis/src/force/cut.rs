//! Comparison of recorded forces with the cutting-force model of a stated cut: identifies the effects of cutter or sensor that explain the
//! differences.
//!
//! Method: the nonlinear tooth model of `physics` is linearised at the current parameters; effects are selected by stepwise and beam search with an
//! information criterion and an AR noise model, refitted by Gauss-Newton iterations, confirmed on a validation set and tested on a test set. SI
//! units.
//!
//! Reading order: `law` (predicted sensor reading), `rows` (which rows are compared), `ways` (entry and exit), `spindle` (angle and speed), `gross`
//! (gross errors), `case` (linearisation, noise), `names` (candidates), `sets` (selection), `tone`, `found` (parameters and alternatives), `laws`,
//! `rest` (unmodelled structure), `finish` (test and verdict), `view` (for the page).
//!
//! Invariants: the same input gives the same bits; no selection and no fit uses test rows; if the statement of the cut is insufficient, the reason is
//! given.

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

/// Maximum number of selections, each with a new linearisation.
const ROUNDS: usize = 6;
/// Maximum number of replacements of an effect by a more probable alternative.
const SWAPS: usize = 4;
/// Improvement in log-likelihood, beyond the penalty, from which another angle or speed of the spindle than the stated one is accepted.
const INSISTS: f64 = 10.0;
/// Minimum gain in log-likelihood on the validation set for an effect to be kept.
const TELLS: f64 = 0.0;
/// Minimum number of rows in the cut for a comparison.
const ROWS_LEAST: usize = 200;

/// Why forces are not compared with a model of the cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Silence {
    /// No cut is stated.
    NoCut,
    /// No coefficient of the cutting forces is stated.
    NoCoefficient,
    /// A turning cut with only the specific cutting force stated: one direction of three.
    OneDirection,
    /// No force was recorded.
    NoForce,
    /// No spindle speed was recorded.
    NoSpeed,
    /// No feed was recorded.
    NoFeed,
    /// Too few rows in the cut.
    NoRows,
    /// Channels are swapped or inverted.
    Places,
    /// The forces have another magnitude than the stated cut.
    Size,
}

impl Silence {
    /// Whether a cut is stated and forces were recorded, but they cannot be compared; then nothing else is claimed of the recording.
    pub(super) fn is_grave(self) -> bool {
        !matches!(self, Self::NoCut | Self::NoCoefficient | Self::OneDirection | Self::NoForce)
    }

    /// Reason as text, for users.
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

/// Compares forces with the stated cut of the recording. `sigma`: standard uncertainty of each value of each of the model's effects, SI units.
///
/// # Errors
/// [`Silence`], the reason why they cannot be compared.
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

/// Whether the forces support another spindle angle or speed than stated, after a penalty for these parameters; both variants are compared on the
/// same rows with the same noise model.
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

/// Selects effects for the given spindle angle and speed, which are fitted too if `is_doubted`.
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

/// Whether a spectral line is among the selected effects.
fn rings(case: &Case, names: &[usize]) -> bool {
    names.iter().any(|name| !case.library.families[*name].settings.is_empty())
}

/// Adds the strongest line of the residual as a candidate, unless a line is selected already; returns whether there is one.
fn listen(case: &mut Case, names: &[usize], listened: &mut Option<Vec<usize>>) -> bool {
    // Any effect selected or removed since the last search may have hidden a line.
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

/// Selects effects with the linearised model.
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

/// Refits the selected effects by the nonlinear model and adopts their parameters.
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

/// Sets up rows, measured forces and the model of the cut, without candidates.
fn begun(model: &Model, recording: &Recording, signal: &Signal) -> Result<(Case, Rows), Silence> {
    let cut = recording.about.cut.as_ref().ok_or(Silence::NoCut)?;
    if !signal.is_force {
        return Err(Silence::NoForce);
    }
    let cutter = cut.cutter();
    if cut.cutting_pa.iter().chain(&cut.edge_n_per_m).all(|number| *number == 0.0) {
        return Err(Silence::NoCoefficient);
    }
    // A specific cutting force alone states one direction, and no edge force.
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
