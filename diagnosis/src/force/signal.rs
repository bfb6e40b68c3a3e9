//! Channels of a recording as runs of evenly spaced samples without gaps.
//!
//! An empty or constant channel is excluded and reported; a missing sample in any other channel ends a run. Nothing is interpolated.

use crate::engine::statistics::median;
use recording::series::{Channel, Recording};
use std::ops::Range;

use super::DiagnosisError;

/// Minimum number of rows of a run.
const RUN_ROWS_LEAST: usize = 500;
/// A step longer than this multiple of the median step is a gap.
const GAP_STEPS: f64 = 1.5;
/// A channel with a smaller share of finite samples counts as empty.
const FINITE_SHARE_LEAST: f64 = 0.5;

/// A channel is saturated if at least this share of its rows, and at least this number, have its extreme value, and this many times more than have
/// the next value.
const SATURATED_SHARE_LEAST: f64 = 0.01;
const SATURATED_ROWS_LEAST: f64 = 20.0;
const SATURATED_RATIO_LEAST: f64 = 5.0;
/// An extreme value smaller than this share of the largest absolute value is not a saturation limit.
const EXTREME_SHARE_LEAST: f64 = 0.8;

/// The analysed channels.
pub(super) struct Signal {
    pub(super) is_force: bool,
    /// Axis (0 to 2) and samples.
    pub(super) channels: Vec<(usize, Vec<f64>)>,
    pub(super) t_s: Vec<f64>,
    pub(super) runs: Vec<Range<usize>>,
    pub(super) rate_hz: f64,
    pub(super) notes: Vec<String>,
}

impl Signal {
    pub(super) fn from_recording(recording: &Recording) -> Result<Self, DiagnosisError> {
        let has_force = (0..3).any(|k| recording.column(Channel::Wrench(k)).is_some());
        let channel = |k| if has_force { Channel::Wrench(k) } else { Channel::Acceleration(k) };
        let (mut channels, mut notes, mut constant) = (Vec::new(), Vec::new(), 0);
        for axis in 0..3 {
            let Some(samples) = recording.column(channel(axis)) else { continue };
            let taken: Vec<f64> = samples.iter().copied().filter(|x| x.is_finite()).collect();
            let name = channel(axis).base();
            if (taken.len() as f64) < FINITE_SHARE_LEAST * samples.len() as f64 || taken.is_empty()
            {
                notes.push(format!("{name} is empty and was left out"));
            } else if taken.iter().all(|x| *x == taken[0]) {
                constant += 1;
                notes.push(format!("{name} always reads {} and was left out", taken[0]));
            } else if let Some((limit, share)) = saturation_limit(&taken) {
                return Err(DiagnosisError::Saturated {
                    channel: name,
                    limit,
                    percent: 100.0 * share,
                });
            } else {
                channels.push((axis, samples.to_vec()));
            }
        }
        if channels.is_empty() {
            return Err(if constant > 0 {
                DiagnosisError::Constant
            } else {
                DiagnosisError::Empty
            });
        }
        let t_s = recording.t_s.clone();
        let step_s = median_step(&t_s);
        let is_whole = |row: usize| channels.iter().all(|(_, samples)| samples[row].is_finite());
        let mut runs: Vec<Range<usize>> = Vec::new();
        for row in 0..t_s.len() {
            if !is_whole(row) {
                continue;
            }
            let is_contiguous = row > 0
                && recording.segment[row] == recording.segment[row - 1]
                && t_s[row] - t_s[row - 1] < GAP_STEPS * step_s;
            match runs.last_mut().filter(|run| run.end == row && is_contiguous) {
                Some(run) => run.end = row + 1,
                None => runs.push(row..row + 1),
            }
        }
        let longest = runs.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
        if longest < RUN_ROWS_LEAST || step_s <= 0.0 {
            return Err(DiagnosisError::TooShort { rows: longest, least: RUN_ROWS_LEAST });
        }
        runs.retain(|run| run.len() >= RUN_ROWS_LEAST);
        Ok(Self { is_force: has_force, channels, t_s, runs, rate_hz: 1.0 / step_s, notes })
    }

    pub(super) fn rows(&self) -> usize {
        self.runs.iter().map(ExactSizeIterator::len).sum()
    }

    pub(super) fn channel_names(&self) -> Vec<String> {
        let channel = |k| {
            if self.is_force { Channel::Wrench(k) } else { Channel::Acceleration(k) }
        };
        self.channels.iter().map(|(axis, _)| channel(*axis).base()).collect()
    }

    /// RMS of single values.
    pub(super) fn rms(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (_, samples) in &self.channels {
            for x in self.runs.iter().flat_map(|run| &samples[run.clone()]) {
                sum += x * x;
                count += 1.0;
            }
        }
        libm::sqrt(sum / f64::max(count, 1.0))
    }
}

/// Value at which a channel saturates and the share of its rows there, if it does: many more rows have the extreme value than the next one.
fn saturation_limit(taken: &[f64]) -> Option<(f64, f64)> {
    let mut sorted = taken.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rows_min = (SATURATED_SHARE_LEAST * taken.len() as f64).max(SATURATED_ROWS_LEAST);
    let furthest = sorted.iter().map(|x| x.abs()).fold(0.0, f64::max);
    let at_end = |values: &[f64]| {
        let end = *values.first().filter(|end| end.abs() >= EXTREME_SHARE_LEAST * furthest)?;
        let same = values.partition_point(|x| *x == end);
        let beside = *values.get(same)?;
        let next = values[same..].partition_point(|x| *x == beside);
        let is_crowded =
            same as f64 >= rows_min && same as f64 > SATURATED_RATIO_LEAST * next as f64;
        is_crowded.then(|| (end, same as f64 / taken.len() as f64))
    };
    let low = at_end(&sorted);
    sorted.reverse();
    low.or_else(|| at_end(&sorted))
}

fn median_step(t_s: &[f64]) -> f64 {
    median(t_s.windows(2).map(|two| two[1] - two[0]).filter(|step| *step > 0.0))
}
