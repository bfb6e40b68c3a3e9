//! Comparison of recorded forces with the cutting-force model of a stated cut: identifies the effects of cutter or sensor that explain the
//! differences.
//!
//! Method: the nonlinear tooth model of `physics` is linearised at the current parameters; effects are selected by stepwise and beam search with an
//! information criterion and an AR noise model, refitted by Gauss-Newton iterations, confirmed on a validation set and tested on a test set. SI
//! units.
//!
//! Reading order: `cut_model` (predicted sensor reading), `rows` (which rows are compared), `entry_and_exit`, `spindle` (angle and speed),
//! `gross_errors`, `case` (linearisation, noise), `candidates`, `beam_search` (selection), `residual_lines`, `parameters` (with alternatives),
//! `varying_coefficients`, `unexplained` (unmodelled structure), `finish` (test and verdict), `view` (for the page).
//!
//! Invariants: the same input gives the same bits; no selection and no fit uses test rows; if the statement of the cut is insufficient, the reason is
//! given.

mod beam_search;
mod candidates;
mod case;
mod cut_model;
mod entry_and_exit;
mod finish;
mod gross_errors;
mod parameters;
mod residual_lines;
mod rows;
mod spindle;
#[cfg(test)]
mod tests;
mod unexplained;
mod varying_coefficients;
mod view;

use physics::{CutForce, Inputs, Joints, Memories, Model};
use recording::series::{Channel, Recording};

use super::signal::Signal;
use crate::autocorrelation::ArModel;
use crate::engine::dictionary::CandidateDictionary;
use crate::engine::regression_data::RegressionData;
use crate::engine::stepwise::{TermSearch, without_term};
use case::{Case, Estimates, NuisanceColumns};
use cut_model::{CutModel, Spindle};
use rows::Rows;

pub use finish::CutComparison;
pub use unexplained::UnexplainedForce;
pub use view::ForceTrace;

/// Maximum number of selections, each with a new linearisation.
const ROUNDS: usize = 6;
/// Maximum number of replacements of an effect by a more probable alternative.
const SWAPS: usize = 4;
/// Improvement in log-likelihood, beyond the penalty, from which another angle or speed of the spindle than the stated one is accepted.
const SPINDLE_GAIN_LEAST: f64 = 10.0;
/// Minimum gain in log-likelihood on the validation set for an effect to be kept.
const VALIDATION_GAIN_LEAST: f64 = 0.0;
/// Minimum number of rows in the cut for a comparison.
const ROWS_LEAST: usize = 200;

/// Why forces are not compared with a model of the cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoComparison {
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
    SwappedChannels,
    /// The forces have another magnitude than the stated cut.
    WrongMagnitude,
}

impl NoComparison {
    /// Whether a cut is stated and forces were recorded, but they cannot be compared; then nothing else is claimed of the recording.
    pub(super) fn is_input_error(self) -> bool {
        !matches!(self, Self::NoCut | Self::NoCoefficient | Self::OneDirection | Self::NoForce)
    }

    /// Reason as text, for users.
    #[must_use]
    pub fn reason(self) -> &'static str {
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
            Self::SwappedChannels => {
                "the forces match the stated cut with channels swapped or inverted: rename fx_N, fy_N, fz_N (x along the feed, z out of the workpiece, y = z × x)"
            }
            Self::WrongMagnitude => {
                "the forces are many times those of the stated cut, or a small part of them: another unit, another depth, another material"
            }
        }
    }
}

/// Compares forces with the stated cut of the recording. `sigma`: standard uncertainty of each value of each of the model's effects, SI units.
///
/// # Errors
/// [`NoComparison`], the reason why they cannot be compared.
pub(super) fn compare(
    model: &Model,
    sigma: &[Vec<f64>],
    recording: &Recording,
    signal: &Signal,
) -> Result<CutComparison, NoComparison> {
    let (mut case, rows) = set_up(model, recording, signal)?;
    case.uncertain_parameters = candidates::uncertain_parameters(model, sigma);
    let stated = case.estimates.spindle.clone();
    let found = spindle::find(&case, &case.row_sets.train);
    case.estimates.spindle = found.clone();
    gross_errors::check(&case)?;
    let as_stated = Case { estimates: Estimates::as_stated(stated.clone()), ..case.clone() };
    let mut best = select_effects(as_stated, model, &rows, false);
    if found != stated {
        let other = select_effects(case, model, &rows, true);
        if supports_other_spindle_motion(&best, &other) {
            best = other;
        }
    }
    let names = confirmed_by_validation(&best.0, best.1);
    Ok(finish::finish(best.0, model, recording, &rows, &names))
}

/// Whether the forces support another spindle angle or speed than stated, after a penalty for these parameters; both variants are compared on the
/// same rows with the same noise model.
fn supports_other_spindle_motion(stated: &(Case, Vec<usize>), other: &(Case, Vec<usize>)) -> bool {
    let mut as_stated = stated.0.clone();
    as_stated.table.noise.clone_from(&other.0.table.noise);
    as_stated.table.counts.clone_from(&other.0.table.counts);
    let cost = |case: &Case, names: &[usize]| {
        let products = case.products(&case.row_sets.train);
        let search =
            TermSearch { library: &case.library, products: &products, always: &case.always };
        let (_, misfit) =
            case.fit_nonlinear(&case.estimates, &search.columns(names), &case.row_sets.train);
        let penalties = names.iter().map(|name| search.penalty(&case.library.terms[*name]));
        misfit + penalties.sum::<f64>()
    };
    let free = other.0.nuisance.spindle.len() as f64;
    let rows = as_stated.model.rows.len() as f64;
    cost(&as_stated, &stated.1) - cost(&other.0, &other.1)
        > SPINDLE_GAIN_LEAST + 0.5 * free * rows.ln()
}

/// Selects effects for the given spindle angle and speed, which are fitted too if `is_doubted`.
fn select_effects(
    mut case: Case,
    model: &Model,
    rows: &Rows,
    is_doubted: bool,
) -> (Case, Vec<usize>) {
    let train = case.row_sets.train.clone();
    case.select_counted_rows(&rows.is_transition);
    candidates::library(&mut case);
    case.set_always_fitted(is_doubted);
    case.linearise();
    candidates::set_parameter_limits(&mut case, stated_wear(model));
    candidates::remove_unobservable(&mut case);
    case.estimate_noise();
    let mut names: Vec<usize> = Vec::new();
    let mut listened: Option<Vec<usize>> = None;
    for _ in 0..ROUNDS {
        let before = names.clone();
        names = select_linearised(&case, &names, &train);
        refit(&mut case, &names, &train);
        case.select_counted_rows(&rows.is_transition);
        let has_line = add_line_candidate(&mut case, &names, &mut listened);
        case.linearise();
        case.estimate_noise();
        if before == names && !has_line {
            break;
        }
    }
    for _ in 0..SWAPS {
        let better = beam_search::better_set(&case, &names, &train);
        let better =
            better.or_else(|| parameters::with_likelier_alternative(&case, &names, &train));
        if let Some(better) = &better {
            names.clone_from(better);
            refit(&mut case, &names, &train);
        }
        let has_line = add_line_candidate(&mut case, &names, &mut listened);
        if better.is_none() && !has_line {
            break;
        }
        case.linearise();
        case.estimate_noise();
    }
    if has_spectral_line(&case, &names) {
        case.model.tone_hz = residual_lines::refined_frequency(&case, &train);
        case.linearise();
        refit(&mut case, &names, &train);
        case.linearise();
        case.estimate_noise();
    }
    (case, names)
}

/// Whether a spectral line is among the selected effects.
fn has_spectral_line(case: &Case, names: &[usize]) -> bool {
    names.iter().any(|name| !case.library.terms[*name].settings.is_empty())
}

/// Adds the strongest line of the residual as a candidate, unless a line is selected already; returns whether there is one.
fn add_line_candidate(case: &mut Case, names: &[usize], listened: &mut Option<Vec<usize>>) -> bool {
    // Any effect selected or removed since the last search may have hidden a line.
    if has_spectral_line(case, names) || listened.as_deref() == Some(names) {
        return false;
    }
    *listened = Some(names.to_vec());
    let line_hz = residual_lines::strongest_line(case, &case.row_sets.train);
    if let Some(tone_hz) = line_hz {
        candidates::add_oscillation(case, tone_hz);
    }
    line_hz.is_some()
}

/// Selects effects with the linearised model.
fn select_linearised(case: &Case, start: &[usize], used: &[bool]) -> Vec<usize> {
    let products = case.products(used);
    let search = TermSearch { library: &case.library, products: &products, always: &case.always };
    let one_by_one = search.select(start).terms;
    let score = beam_search::EffectSet::scored(&search, &one_by_one).map(|set| set.score);
    let together = beam_search::best_sets(&search).into_iter().next();
    match together {
        Some(set) if score.is_none_or(|score| set.score > score + 1.0) => set.effects,
        _ => one_by_one,
    }
}

/// Refits the selected effects by the nonlinear model and adopts their parameters.
fn refit(case: &mut Case, names: &[usize], used: &[bool]) {
    let products = case.products(used);
    let search = TermSearch { library: &case.library, products: &products, always: &case.always };
    let selection = search.solve(names);
    let columns = search.columns(names);
    let start = case.estimates_from(&case.estimates, &selection.solved);
    let (estimates, _) = case.fit_nonlinear(&start, &columns, used);
    case.estimates = estimates;
}

/// Drops the effects that the validation set does not support.
fn confirmed_by_validation(case: &Case, mut names: Vec<usize>) -> Vec<usize> {
    let products = case.products(&case.row_sets.train);
    let search = TermSearch { library: &case.library, products: &products, always: &case.always };
    loop {
        let misfit = |names: &[usize]| {
            case.negative_log_likelihood(&search.solve(names).solved, &case.row_sets.validation)
        };
        let whole = misfit(&names);
        let harm = |name: &usize| misfit(&without_term(&names, *name)) - whole;
        let tested = names.iter().filter(|name| !case.library.terms[**name].corrects_stated);
        let worst = tested.map(|name| (*name, harm(name)));
        let worst = worst.min_by(|a, b| a.1.total_cmp(&b.1));
        match worst {
            Some((name, harm)) if harm < VALIDATION_GAIN_LEAST => names.retain(|n| *n != name),
            _ => return names,
        }
    }
}

/// Sets up rows, measured forces and the model of the cut, without candidates.
fn set_up(
    model: &Model,
    recording: &Recording,
    signal: &Signal,
) -> Result<(Case, Rows), NoComparison> {
    let cut = recording.metadata.cut.as_ref().ok_or(NoComparison::NoCut)?;
    if !signal.is_force {
        return Err(NoComparison::NoForce);
    }
    let cutter = cut.cutter();
    if cut.cutting_pa.iter().chain(&cut.edge_n_per_m).all(|number| *number == 0.0) {
        return Err(NoComparison::NoCoefficient);
    }
    // A specific cutting force alone states one direction, and no edge force.
    let is_tangential = |three: &[f64; 3]| three[1] == 0.0 && three[2] == 0.0;
    if cut.turning && is_tangential(&cut.cutting_pa) && is_tangential(&cut.edge_n_per_m) {
        return Err(NoComparison::OneDirection);
    }
    let mut inputs = Inputs::at_rest(Joints::default());
    let memories = Memories::default();
    let mut force = |time_s: f64| {
        inputs.time_s = time_s;
        model.cut_force(&inputs, &memories)
    };
    let rows = Rows::from_recording(recording, &cutter, signal)?;
    let count = rows.indices.len();
    if rows.states.iter().filter(|state| state.is_cutting).count() < ROWS_LEAST {
        return Err(NoComparison::NoRows);
    }
    let mut stated_forces: Vec<CutForce> =
        rows.states.iter().map(|state| force(state.time_s)).collect();
    if stated_forces.iter().all(|force| *force == stated_forces[0]) {
        stated_forces.truncate(1);
    }
    let column = |axis: usize| {
        let (_, samples) = signal.channels.iter().find(|(one, _)| *one == axis)?;
        Some(rows.indices.iter().map(|row| samples[*row]).collect::<Vec<f64>>())
    };
    let measured: [Option<Vec<f64>>; 3] = std::array::from_fn(column);
    let spindle = Spindle { phases: vec![0.0; rows.segments], excess_speed: 0.0 };
    let told_noise = |axis: usize| recording.metadata.sigma.get(&Channel::Wrench(axis)).copied();
    let case = Case {
        model: CutModel { cutter, rows: rows.states.clone(), stated_forces, tone_hz: 0.0 },
        estimates: Estimates::as_stated(spindle),
        table: RegressionData {
            runs: rows.runs.clone(),
            target: measured.to_vec(),
            moves: vec![vec![true; count]; 3],
            counts: vec![vec![true; count]; 3],
            noise: vec![(ArModel::default(), 1.0); 3],
        },
        measured,
        library: CandidateDictionary {
            columns: Vec::new(),
            prior: Vec::new(),
            terms: Vec::new(),
            untested: Vec::new(),
        },
        column_parameters: Vec::new(),
        always: Vec::new(),
        nuisance: NuisanceColumns::default(),
        uncertain_parameters: Vec::new(),
        stated_noise: std::array::from_fn(told_noise),
        row_sets: rows.split(recording),
    };
    Ok((case, rows))
}

fn stated_wear(model: &Model) -> f64 {
    let of_wear = model.effects().filter(|effect| effect.spec().kind == "tool_wear");
    of_wear.flat_map(|effect| effect.values().to_vec()).sum()
}
