//! Detection of air, entry, cut and exit from the signal: in the cut, mean or amplitude differs from that at rest.
//!
//! Each block of time has a level: the distance of its mean from that of the quietest blocks, combined with its standard deviation. Two
//! well-separated groups of levels are air and cut (Otsu 1979, on logarithms); the ends of a cut, up to where the level first and last reaches most
//! of its median, are entry and exit. Without two separate groups, no phases are distinguished. No threshold is in newtons.

use super::Finding;
use super::signal::Signal;
use crate::engine::statistics::median;

/// Length of a block, s, and its minimum number of rows.
const BLOCK_S: f64 = 0.02;
const BLOCK_ROWS: usize = 16;
/// Share of the blocks that count as the quietest.
const QUIET_SHARE: f64 = 0.15;
/// Minimum ratio of the median level of the cut to the 90 % quantile of air.
const LEVEL_RATIO_LEAST: f64 = 2.0;
/// Shorter phases, s, are merged with their surroundings.
const PHASE_LEAST_S: f64 = 0.1;
/// A cut begins where its level reaches this share of its median level.
const FULL_CUT_SHARE: f64 = 0.85;
/// One block of air out of this many is held out.
const HELD_OUT_EVERY: usize = 5;
/// Blocks of air whose level exceeds this multiple of their median are excluded from the bias.
const CONTACT_LEVEL: f64 = 3.0;
/// Minimum ratio of a bias to its standard uncertainty.
const SIGNIFICANCE_LEAST: f64 = 4.0;

/// State of the tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// The tool is not in contact.
    Air,
    /// The tool enters the workpiece.
    Entry,
    /// The tool is fully engaged.
    Cut,
    /// The tool leaves the workpiece.
    Exit,
    /// Air and cut cannot be distinguished.
    Unknown,
}

impl State {
    /// Name in result files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Air => "air",
            Self::Entry => "entry",
            Self::Cut => "cut",
            Self::Exit => "exit",
            Self::Unknown => "unknown",
        }
    }
}

/// A period of one state.
#[derive(Clone, Debug, PartialEq)]
pub struct Phase {
    /// State of the tool.
    pub state: State,
    /// Start time, s.
    pub from_s: f64,
    /// End time, s.
    pub to_s: f64,
    /// Mean of each analysed channel, N or m/s².
    pub mean: Vec<f64>,
    /// Standard deviation of single values of each channel, N or m/s².
    pub scatter: Vec<f64>,
    /// Range of blocks.
    pub(super) blocks: std::ops::Range<usize>,
    /// Range of rows.
    pub(super) rows: std::ops::Range<usize>,
}

/// A block of time.
pub(super) struct Block {
    rows: std::ops::Range<usize>,
    run: usize,
    mean: Vec<f64>,
    scatter: Vec<f64>,
    level: f64,
}

/// All blocks in time order.
pub(super) struct BlockLevels {
    blocks: Vec<Block>,
    axes: Vec<usize>,
    t_s: Vec<f64>,
}

impl BlockLevels {
    /// Level over time, for plots: time in s, level.
    pub(super) fn plot(&self) -> Vec<(f64, f64)> {
        self.blocks.iter().map(|block| (self.t_s[block.rows.start], block.level)).collect()
    }
}

pub(super) fn block_levels(signal: &Signal) -> BlockLevels {
    let length = ((BLOCK_S * signal.rate_hz) as usize).max(BLOCK_ROWS);
    let mut blocks = Vec::new();
    for (number, run) in signal.runs.iter().enumerate() {
        let mut from = run.start;
        while from + length <= run.end {
            let rows = from..from + length;
            let moments_of = |samples: &Vec<f64>| moments(&samples[rows.clone()]);
            let (mean, scatter) =
                signal.channels.iter().map(|(_, samples)| moments_of(samples)).unzip();
            blocks.push(Block { rows, run: number, mean, scatter, level: 0.0 });
            from += length;
        }
    }
    let swing = |block: &Block| block.scatter.iter().map(|x| x * x).sum::<f64>();
    let mut order: Vec<usize> = (0..blocks.len()).collect();
    order.sort_by(|a, b| swing(&blocks[*a]).total_cmp(&swing(&blocks[*b])));
    let quiet = &order[..((QUIET_SHARE * order.len() as f64) as usize).clamp(1, order.len())];
    let channels = signal.channels.len();
    let base: Vec<f64> =
        (0..channels).map(|k| median(quiet.iter().map(|b| blocks[*b].mean[k]))).collect();
    for block in &mut blocks {
        let squares =
            block.mean.iter().zip(&base).map(|(mean, base)| (mean - base) * (mean - base));
        block.level = libm::sqrt(squares.sum::<f64>() + swing(block));
    }
    let axes = signal.channels.iter().map(|(axis, _)| *axis).collect();
    BlockLevels { blocks, axes, t_s: signal.t_s.clone() }
}

fn moments(samples: &[f64]) -> (f64, f64) {
    let count = samples.len().max(1) as f64;
    let mean = samples.iter().sum::<f64>() / count;
    let square = samples.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>();
    (mean, libm::sqrt(square / count))
}

/// Level that separates two groups (Otsu), if there are two.
fn separating_level(levels: &[f64]) -> Option<f64> {
    let mut logs: Vec<f64> = levels.iter().map(|x| x.max(1e-300).ln()).collect();
    logs.sort_by(f64::total_cmp);
    let count = logs.len();
    let total: f64 = logs.iter().sum();
    let mut best = (0.0, 0);
    let mut low = 0.0;
    for k in 1..count {
        low += logs[k - 1];
        let (n, m) = (k as f64, (count - k) as f64);
        let apart = low / n - (total - low) / m;
        let between = n * m * apart * apart;
        if between > best.0 {
            best = (between, k);
        }
    }
    let k = best.1;
    if k == 0 || k >= count {
        return None;
    }
    // Compares the upper part of air with the median of the cut.
    let (air, cut) = (logs[k * 9 / 10], logs[k + (count - k) / 2]);
    (cut - air > LEVEL_RATIO_LEAST.ln()).then_some((0.5 * (air + cut)).exp())
}

pub(super) fn find_phases(signal: &Signal, levels: &BlockLevels) -> Vec<Phase> {
    let all: Vec<f64> = levels.blocks.iter().map(|block| block.level).collect();
    let Some(border) = separating_level(&all) else {
        return phases_from_states(signal, levels, &vec![State::Unknown; all.len()]);
    };
    let mut states: Vec<State> =
        all.iter().map(|x| if *x > border { State::Cut } else { State::Air }).collect();
    let block_s = levels.blocks.first().map_or(BLOCK_S, |b| b.rows.len() as f64 / signal.rate_hz);
    let short = (PHASE_LEAST_S / block_s).ceil() as usize;
    // Short periods take the state of their surroundings: first short gaps in a cut, then short cuts.
    for wanted in [State::Air, State::Cut] {
        for piece in blocks_of_one_state(&states, levels) {
            if states[piece.start] == wanted && piece.len() < short && piece.len() < states.len() {
                let other = if wanted == State::Air { State::Cut } else { State::Air };
                states[piece].fill(other);
            }
        }
    }
    for piece in blocks_of_one_state(&states, levels) {
        if states[piece.start] != State::Cut {
            continue;
        }
        let middle = median(all[piece.clone()].iter().copied());
        let is_whole = |block: &usize| all[*block] >= FULL_CUT_SHARE * middle;
        let first = piece.clone().find(is_whole).unwrap_or(piece.start);
        let last = piece.clone().rev().find(is_whole).map_or(piece.end, |block| block + 1);
        states[piece.start..first].fill(State::Entry);
        states[last.max(first)..piece.end].fill(State::Exit);
    }
    phases_from_states(signal, levels, &states)
}

/// Ranges of blocks of one state and one run.
fn blocks_of_one_state(states: &[State], levels: &BlockLevels) -> Vec<std::ops::Range<usize>> {
    let mut all: Vec<std::ops::Range<usize>> = Vec::new();
    for k in 0..states.len() {
        let run = |k: usize| levels.blocks[k].run;
        let is_contiguous = k > 0 && states[k] == states[k - 1] && run(k) == run(k - 1);
        match all.last_mut().filter(|_| is_contiguous) {
            Some(piece) => piece.end = k + 1,
            None => all.push(k..k + 1),
        }
    }
    all
}

fn phases_from_states(signal: &Signal, levels: &BlockLevels, states: &[State]) -> Vec<Phase> {
    let one = |blocks: std::ops::Range<usize>| {
        let rows = levels.blocks[blocks.start].rows.start..levels.blocks[blocks.end - 1].rows.end;
        let moments_of = |samples: &Vec<f64>| moments(&samples[rows.clone()]);
        let (mean, scatter) =
            signal.channels.iter().map(|(_, samples)| moments_of(samples)).unzip();
        Phase {
            state: states[blocks.start],
            from_s: signal.t_s[rows.start],
            to_s: signal.t_s[rows.end - 1],
            mean,
            scatter,
            blocks,
            rows,
        }
    };
    blocks_of_one_state(states, levels).into_iter().map(one).collect()
}

/// The period of air used for the bias: the longest before the first cut, since afterwards the tool may still touch, or the sensor may have drifted.
fn first_air(phases: &[Phase]) -> Option<&Phase> {
    let first_cut = phases.iter().position(|phase| phase.state == State::Cut);
    let is_air = |phase: &&Phase| phase.state == State::Air;
    let before = phases[..first_cut.unwrap_or(phases.len())].iter().filter(is_air);
    before.max_by_key(|phase| phase.blocks.len()).or_else(|| phases.iter().find(is_air))
}

/// Sensor bias in air, tested on held-out blocks.
pub(super) fn bias_finding(levels: &BlockLevels, phases: &[Phase]) -> Option<Finding> {
    let air = first_air(phases)?;
    let blocks = &levels.blocks[air.blocks.clone()];
    // The ends belong to transitions.
    let edge = (blocks.len() / 20).max(1);
    let blocks = blocks.get(edge..blocks.len().saturating_sub(edge))?;
    // A raised level indicates contact.
    let usual = median(blocks.iter().map(|block| block.level));
    let blocks: Vec<&Block> =
        blocks.iter().filter(|block| block.level < CONTACT_LEVEL * usual).collect();
    if blocks.len() < 2 * HELD_OUT_EVERY {
        return None;
    }
    let (mut force, mut sigma) = ([0.0; 3], [0.0; 3]);
    let mut heldout = [0.0; 2];
    let (mut held, mut is_sure) = (0.0, false);
    for (k, axis) in levels.axes.iter().enumerate() {
        let training = blocks.iter().enumerate().filter(|(index, _)| index % HELD_OUT_EVERY != 0);
        let means: Vec<f64> = training.map(|(_, block)| block.mean[k]).collect();
        let (mean, scatter) = moments(&means);
        // Block means are autocorrelated, so the difference of the two halves is included in the uncertainty.
        let (a, b) = means.split_at(means.len() / 2);
        let wander = 0.5 * (moments(a).0 - moments(b).0).abs();
        let uncertain = (scatter / libm::sqrt(means.len() as f64)).hypot(wander);
        for (_, block) in blocks.iter().enumerate().filter(|(index, _)| index % HELD_OUT_EVERY == 0)
        {
            let swing = block.scatter[k] * block.scatter[k];
            heldout[0] += block.mean[k] * block.mean[k] + swing;
            heldout[1] += (block.mean[k] - mean) * (block.mean[k] - mean) + swing;
            held += 1.0;
        }
        (force[*axis], sigma[*axis]) = (mean, uncertain);
        let noise = moments(&blocks.iter().map(|block| block.scatter[k]).collect::<Vec<f64>>()).0;
        is_sure |= mean.abs() > SIGNIFICANCE_LEAST * uncertain && mean.abs() > noise;
    }
    let heldout = heldout.map(|sum| libm::sqrt(sum / f64::max(held, 1.0)));
    (is_sure && heldout[1] < heldout[0]).then_some(Finding::Bias { force, sigma, heldout })
}

/// A note if the sensor's zero after the cut differs from that before.
pub(super) fn drift_note(levels: &BlockLevels, phases: &[Phase]) -> Option<String> {
    let first = first_air(phases)?;
    let last = phases.iter().rfind(|phase| phase.state == State::Air)?;
    if last.from_s <= first.from_s {
        return None;
    }
    let change: Vec<f64> = last.mean.iter().zip(&first.mean).map(|(b, a)| b - a).collect();
    let scatter = last.scatter.iter().chain(&first.scatter).copied().fold(0.0, f64::max);
    let size = change.iter().map(|x| x * x).sum::<f64>();
    let names = ["x", "y", "z"];
    let parts: Vec<String> = levels
        .axes
        .iter()
        .zip(&change)
        .map(|(axis, by)| format!("{} by {by:.1} N", names[*axis % 3]))
        .collect();
    (libm::sqrt(size) > scatter).then(|| {
        format!(
            "The sensor has a different zero after the cut than before ({}): it drifts, or the tool is still in contact.",
            parts.join(", ")
        )
    })
}

/// Standard deviation of single values in air; of all blocks if there is no air.
pub(super) fn noise_in_air(levels: &BlockLevels, phases: &[Phase]) -> f64 {
    let blocks =
        first_air(phases).map_or(&levels.blocks[..], |air| &levels.blocks[air.blocks.clone()]);
    median(blocks.iter().map(|block| {
        let square: f64 = block.scatter.iter().map(|x| x * x).sum();
        libm::sqrt(square / block.scatter.len().max(1) as f64)
    }))
}
