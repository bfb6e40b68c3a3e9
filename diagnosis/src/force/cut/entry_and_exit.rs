//! Detection of entry and exit: feed in air, and the transition to the full cut.
//!
//! Means and standard deviations of the forces over whole spindle revolutions are projected on the direction from the start of a pass to the cut. A
//! pass that begins in air is modelled as zero, then a ramp, then a cut that may still increase (least squares over both ends of the ramp); a pass
//! that ends in air is the reverse. A pass that cuts from its first row has no entry; only changes far above the scatter of revolutions are reported.

use crate::engine::statistics::median;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::TAU;
use std::ops::Range;
use world::milling::CutterState;

use super::super::signal::Signal;

/// A relative change of the feed by more than this begins another pass.
const FEED_CHANGE_MOST: f64 = 0.02;
/// Largest number of revolutions before a pass that are included.
const TURNS_BEFORE_MOST: f64 = 24.0;
/// Largest and smallest number of blocks of revolutions in half a pass.
const BLOCKS_MOST: f64 = 90.0;
const BLOCKS_LEAST: usize = 12;
/// Minimum number of rows of a block.
const ROWS_LEAST: f64 = 12.0;
/// Minimum share of a block's rows that must be present.
const PRESENT_SHARE_LEAST: f64 = 0.6;
/// Number of blocks that represent the start of a pass.
const START_BLOCKS: usize = 3;
/// Largest ratio of the force at the start of a pass to that of its cut for a start in air.
const AIR_RATIO_MOST: f64 = 0.5;
/// Minimum rise of the ramp relative to the full cut.
const RAMP_RISE_LEAST: f64 = 0.5;
/// Minimum gain of the ramp over a straight line, in log-likelihood.
const RAMP_GAIN_LEAST: f64 = 12.0;
/// Margin of the excluded part beyond the ramp, in blocks and as a share of the ramp.
const MARGIN_BLOCKS: f64 = 1.5;
const MARGIN_SHARE: f64 = 0.15;

/// State of each row by the forces, beyond what speed and feed state.
pub(super) struct Engagement {
    pub(super) is_air: Vec<bool>,
    pub(super) is_transition: Vec<bool>,
}

/// Detects entry and exit of every pass.
pub(super) fn detect(signal: &Signal, states: &[CutterState], segment: &[i64]) -> Engagement {
    let count = states.len();
    let mut engagement =
        Engagement { is_air: vec![false; count], is_transition: vec![false; count] };
    for pass in passes(states, segment) {
        let middle = (pass.start + pass.end) / 2;
        let is_apart = |row: usize, beside: usize| {
            segment[row] != segment[beside] || !states[beside].is_cutting()
        };
        if pass.start == 0 || is_apart(pass.start, pass.start - 1) {
            let rows: Vec<usize> =
                (last_row_without_cut(states, segment, pass.start, false)..middle).collect();
            engagement.mark_transition(signal, states, &rows);
        }
        if pass.end == count || is_apart(pass.end - 1, pass.end) {
            let last = last_row_without_cut(states, segment, pass.end - 1, true);
            let rows: Vec<usize> = (middle..=last).rev().collect();
            engagement.mark_transition(signal, states, &rows);
        }
    }
    engagement
}

impl Engagement {
    /// Marks the rows of half a pass, ordered from its end inwards.
    fn mark_transition(&mut self, signal: &Signal, states: &[CutterState], rows: &[usize]) {
        let Some((from, to)) = entry_ramp(signal, states, rows) else { return };
        let start = states[rows[0]].angle_rad;
        for row in rows.iter().filter(|row| states[**row].is_cutting()) {
            let turns = (states[*row].angle_rad - start).abs() / TAU;
            self.is_air[*row] = turns < from;
            self.is_transition[*row] = (from..to).contains(&turns);
        }
    }
}

/// Passes: ranges of rows of one segment and one feed.
fn passes(states: &[CutterState], segment: &[i64]) -> Vec<Range<usize>> {
    let mut all: Vec<Range<usize>> = Vec::new();
    for (row, state) in states.iter().enumerate().filter(|(_, state)| state.is_cutting()) {
        let feed = state.feed_per_tooth_m;
        let is_contiguous = |pass: &&mut Range<usize>| {
            let first = states[pass.start].feed_per_tooth_m;
            pass.end == row
                && segment[pass.start] == segment[row]
                && (feed - first).abs() < FEED_CHANGE_MOST * first
        };
        match all.last_mut().filter(is_contiguous) {
            Some(pass) => pass.end = row + 1,
            None => all.push(row..row + 1),
        }
    }
    all
}

/// The farthest row before (or after) a pass, without cut, in the same segment and within [`TURNS_BEFORE_MOST`].
fn last_row_without_cut(
    states: &[CutterState],
    segment: &[i64],
    from: usize,
    is_after: bool,
) -> usize {
    let next = |row: usize| if is_after { Some(row + 1) } else { row.checked_sub(1) };
    let mut reached = from;
    while let Some(row) = next(reached).filter(|row| *row < states.len()) {
        let turns = (states[row].angle_rad - states[from].angle_rad).abs() / TAU;
        if segment[row] != segment[from] || states[row].is_cutting() || turns > TURNS_BEFORE_MOST {
            break;
        }
        reached = row;
    }
    reached
}

/// Start and end of the entry in revolutions from the first of these rows, if there is one.
fn entry_ramp(signal: &Signal, states: &[CutterState], rows: &[usize]) -> Option<(f64, f64)> {
    let first = states[*rows.first()?].angle_rad;
    let turns = (states[*rows.last()?].angle_rad - first).abs() / TAU;
    let per_turn = rows.len() as f64 / turns.max(1e-9);
    let wide = (turns / BLOCKS_MOST).max(ROWS_LEAST / per_turn).ceil().max(1.0);
    let blocks = (turns / wide) as usize;
    if blocks < BLOCKS_LEAST {
        return None;
    }
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); blocks];
    for row in rows {
        let block_index = ((states[*row].angle_rad - first).abs() / (TAU * wide)) as usize;
        let is_there = signal.channels.iter().all(|(_, values)| values[*row].is_finite());
        if let Some(block) = members.get_mut(block_index).filter(|_| is_there) {
            block.push(*row);
        }
    }
    let rows_min = PRESENT_SHARE_LEAST * per_turn * wide;
    let known: Vec<(f64, Vec<f64>)> = members
        .iter()
        .enumerate()
        .filter(|(_, block)| block.len() as f64 >= rows_min)
        .map(|(k, block)| (k as f64 + 0.5, block_statistics(signal, block)))
        .collect();
    let levels = projected(&known)?;
    let (from, to) = fit_ramp(&levels)?;
    let wider = MARGIN_BLOCKS + MARGIN_SHARE * (to - from);
    Some((wide * (from - 1.0), wide * (to + wider)))
}

/// Mean and standard deviation of each channel.
fn block_statistics(signal: &Signal, rows: &[usize]) -> Vec<f64> {
    let count = rows.len().max(1) as f64;
    let mut all = Vec::new();
    for (_, values) in &signal.channels {
        let mean = rows.iter().map(|row| values[*row]).sum::<f64>() / count;
        let square = rows.iter().map(|row| (values[*row] - mean) * (values[*row] - mean));
        all.push(mean);
        all.push(libm::sqrt(square.sum::<f64>() / count));
    }
    all
}

/// Projection of each block on the direction from the first blocks (0) to the later ones (about 1); `None` if the first ones are not quieter.
fn projected(blocks: &[(f64, Vec<f64>)]) -> Option<Vec<(f64, f64)>> {
    if blocks.len() < BLOCKS_LEAST {
        return None;
    }
    let middle =
        |some: &[(f64, Vec<f64>)], k: usize| median(some.iter().map(|(_, traits)| traits[k]));
    let count = blocks[0].1.len();
    let quiet: Vec<f64> = (0..count).map(|k| middle(&blocks[..START_BLOCKS], k)).collect();
    let whole: Vec<f64> = (0..count).map(|k| middle(&blocks[blocks.len() / 2..], k)).collect();
    let size = |traits: &[f64]| libm::sqrt(traits.iter().map(|x| x * x).sum());
    if size(&quiet) > AIR_RATIO_MOST * size(&whole) {
        return None;
    }
    let way: Vec<f64> = whole.iter().zip(&quiet).map(|(a, b)| a - b).collect();
    let square = way.iter().map(|x| x * x).sum::<f64>();
    let projection = |traits: &[f64]| {
        let differences = traits.iter().zip(&quiet).zip(&way);
        differences.map(|((x, from), way)| (x - from) * way).sum::<f64>() / square
    };
    Some(blocks.iter().map(|(turns, traits)| (*turns, projection(traits))).collect())
}

/// Start and end of a ramp, in blocks.
fn fit_ramp(levels: &[(f64, f64)]) -> Option<(f64, f64)> {
    let last = levels.last()?.0;
    let line = least_squares(levels, &|turns| (1.0, turns / last))?;
    let edges = last.ceil() as usize;
    let mut best: Option<(f64, f64, f64)> = None;
    for from in 0..edges {
        for to in from..edges {
            let (from, to) = (from as f64, to as f64);
            let share = |turns: f64| ((turns - from) / (to - from).max(0.5)).clamp(0.0, 1.0);
            let shape = |turns: f64| (share(turns), share(turns) * (turns - to) / last);
            let Some((left, rises)) = least_squares(levels, &shape) else { continue };
            if rises > RAMP_RISE_LEAST && best.is_none_or(|(smallest, _, _)| left < smallest) {
                best = Some((left, from, to));
            }
        }
    }
    let (left, from, to) = best?;
    let gain = 0.5 * levels.len() as f64 * (line.0 / left.max(f64::MIN_POSITIVE)).ln();
    (gain > RAMP_GAIN_LEAST).then_some((from, to))
}

/// Least-squares fit of a constant and two shapes: residual sum of squares, and coefficient of the first shape.
fn least_squares(levels: &[(f64, f64)], shape: &dyn Fn(f64) -> (f64, f64)) -> Option<(f64, f64)> {
    let (mut gram, mut right, mut square) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    for (turns, level) in levels {
        let (rise, grows) = shape(*turns);
        let column = Vector3::new(1.0, rise, grows);
        gram += column * column.transpose();
        right += column * *level;
        square += level * level;
    }
    gram += Matrix3::identity() * 1e-9;
    let numbers = gram.cholesky()?.solve(&right);
    Some((square - right.dot(&numbers), numbers.y))
}
