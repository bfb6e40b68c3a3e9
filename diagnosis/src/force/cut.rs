//! Forces against a told cut: where they differ from what the law of the teeth says, and which effect of cutter or sensor that is.
//!
//! Read in this order: `law` (what a sensor would read), `rows` (which rows are compared), `spindle` (where it stands), `gross` (whether it is this cut), `case` (slopes, noise), `names` (what may
//! be missing), `tone`, `found` (numbers and rivals), `rest` (what no name explains), `finish` (the proof, the verdict).
//!
//! Promises: the same input gives the same bits; held-out rows are seen by no choice and no fit; where the told cut does not say enough, why is said.
//! Never: a file, a law of cutting that `physics` does not have.

mod case;
mod finish;
mod found;
mod gross;
mod law;
mod names;
mod rest;
mod rows;
mod spindle;
#[cfg(test)]
mod tests;
mod tone;

use physics::{Inputs, Joints, Memories, Model};
use recording::series::Recording;
use world::milling::Stand;

use super::phases::Phase;
use super::signal::Signal;
use crate::colour::Colour;
use crate::torque::choose::{Asking, others};
use crate::torque::table::Table;
use case::{Belief, Case};
use law::{Law, NUMBERS, Spindle};
use rows::Rows;

pub use finish::{Compared, Traced};
pub use rest::Rest;

/// Rounds of choice, each with the law taken anew.
const ROUNDS: usize = 6;
/// Rounds in which a likelier rival takes a name's place.
const SWAPS: usize = 4;
/// A name that brings less than this share of what is left, on rows that took no part in its choice, tells nothing.
const TELLS: f64 = 1e-3;
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
            Self::NoCoefficient => "[cut] tells no coefficient: there is no force to compare with",
            Self::OneDirection => {
                "[cut] tells the specific cutting force alone: forces of the other directions have no law to be compared with"
            }
            Self::NoForce => "no force was recorded",
            Self::NoSpeed => "no column tells the spindle's speed: give spindle_rpm, or tacho",
            Self::NoFeed => "no column tells the feed: give feed_mm_s",
            Self::NoRows => {
                "spindle or feed stand still in nearly all rows, or are not known: nothing is cut"
            }
            Self::Places => {
                "the forces are those of the told cut with channels swapped or turned in sign: name fx_N, fy_N, fz_N anew (x along the feed, z up out of the work, y = z × x)"
            }
            Self::Size => {
                "the forces are many times those of the told cut, or a small part of them: another unit, another depth, another material"
            }
        }
    }
}

/// Compares forces with the cut that the recording tells of.
///
/// # Errors
/// Why they cannot be compared.
pub(super) fn compare(
    model: &Model,
    recording: &Recording,
    signal: &Signal,
    phases: &[Phase],
) -> Result<Compared, Silence> {
    let (mut case, rows) = begun(model, recording, signal, phases)?;
    let train = case.sets.train.clone();
    case.belief.spindle = spindle::find(&case, &train);
    gross::look(&case)?;
    case.count(&rows.is_between);
    names::library(&mut case);
    case.take();
    names::limit(&mut case, stated_wear(model));
    names::narrow(&mut case);
    case.hear_noise();
    let mut names: Vec<usize> = Vec::new();
    let mut is_listening = true;
    for _ in 0..ROUNDS {
        let before = names.clone();
        names = chosen(&mut case, &names, &train);
        case.count(&rows.is_between);
        let rings = names.iter().any(|k| !case.library.families[*k].settings.is_empty());
        let heard = (is_listening && !rings).then(|| tone::loudest(&case, &train)).flatten();
        is_listening = heard.is_some() && is_listening;
        if let Some(tone_hz) = heard {
            names::add_tone(&mut case, tone_hz);
            is_listening = false;
        }
        case.take();
        case.hear_noise();
        if before == names && heard.is_none() {
            break;
        }
    }
    for _ in 0..SWAPS {
        let Some(better) = found::likelier(&case, &names, &train) else { break };
        names = chosen(&mut case, &better, &train);
        case.take();
        case.hear_noise();
    }
    let names = confirmed(&case, names);
    Ok(finish::finish(case, model, recording, &rows, &names))
}

/// The names that the rows ask for, and the belief that they make.
fn chosen(case: &mut Case, start: &[usize], used: &[bool]) -> Vec<usize> {
    let products = case.products(used);
    let asking = Asking { library: &case.library, products: &products, always: &case.always };
    let choice = asking.choose(start);
    let columns = asking.columns(&choice.names);
    let start = case.believed(&case.belief, &choice.solved);
    let (belief, _) = case.fitted(&start, &columns, used);
    case.belief = belief;
    choice.names
}

/// Without the names that rows kept for a second look do not bear out.
fn confirmed(case: &Case, mut names: Vec<usize>) -> Vec<usize> {
    let products = case.products(&case.sets.train);
    let asking = Asking { library: &case.library, products: &products, always: &case.always };
    loop {
        let of = |names: &[usize]| case.rms(&asking.solve(names).solved, &case.sets.look);
        let whole = of(&names);
        let harm = |name: &usize| of(&others(&names, *name)) - whole;
        let worst = names.iter().map(|name| (*name, harm(name)));
        let worst = worst.min_by(|a, b| a.1.total_cmp(&b.1));
        match worst {
            Some((name, harm)) if harm < TELLS * whole => names.retain(|n| *n != name),
            _ => return names,
        }
    }
}

/// Rows, measured forces and the law, nothing yet asked.
fn begun(
    model: &Model,
    recording: &Recording,
    signal: &Signal,
    phases: &[Phase],
) -> Result<(Case, Rows), Silence> {
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
    let first = force(0.0);
    let size = |stand: &Stand| {
        let bite = cutter.mean(stand.feed_per_tooth_m);
        if stand.cuts() { first.acting(&cutter, &bite, stand.cut_m).length() } else { 0.0 }
    };
    let rows = Rows::of(recording, &cutter, signal, phases, &size)?;
    let count = rows.at.len();
    if rows.stood.iter().filter(|stood| stood.cuts).count() < ROWS_LEAST {
        return Err(Silence::NoRows);
    }
    let base = rows.stood.iter().map(|stood| force(stood.time_s)).collect();
    let column = |axis: usize| {
        let (_, samples) = signal.channels.iter().find(|(one, _)| *one == axis)?;
        Some(rows.at.iter().map(|row| samples[*row]).collect::<Vec<f64>>())
    };
    let measured: [Option<Vec<f64>>; 3] = std::array::from_fn(column);
    let phases = vec![0.0; rows.segments];
    let case = Case {
        law: Law { cutter, rows: rows.stood.clone(), base, tone_hz: 0.0 },
        belief: Belief { numbers: vec![0.0; NUMBERS], spindle: Spindle { phases, faster: 0.0 } },
        table: Table {
            runs: rows.runs.clone(),
            target: measured.to_vec(),
            moves: vec![vec![true; count]; 3],
            counts: vec![vec![true; count]; 3],
            noise: vec![(Colour::default(), 1.0); 3],
        },
        measured,
        library: crate::torque::library::Library {
            columns: Vec::new(),
            prior: Vec::new(),
            families: Vec::new(),
            untested: Vec::new(),
        },
        directions: Vec::new(),
        always: Vec::new(),
        sets: rows.sets(recording),
    };
    Ok((case, rows))
}

fn stated_wear(model: &Model) -> f64 {
    let of_wear = model.effects().filter(|effect| effect.spec().kind == "tool_wear");
    of_wear.flat_map(|effect| effect.values().to_vec()).sum()
}
