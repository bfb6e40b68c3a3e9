//! A path with even time steps that begins and ends at rest.
//!
//! Even rows are kept; others are interpolated by the curve through the samples (`world::forward::positions_at`) at the median step.

use crate::FeedforwardError;
use crate::error::PathRow;
use physics::JointKind;
use recording::series::{Channel, Recording, RecordingKind};
use world::forward::positions_at;

/// Least number of rows of a path.
pub const ROWS_LEAST: usize = 8;
/// Time stamps that deviate by less than this share of a step count as even.
const EVEN_TOLERANCE: f64 = 0.02;
/// Longest time between two rows that is interpolated, in median steps: a curve over a longer gap invents motion.
const GAP_STEPS_MAX: f64 = 10.0;

/// A path on even time stamps.
#[derive(Clone, Debug, PartialEq)]
pub struct Extended {
    /// Commands and loads, without measurements.
    pub recording: Recording,
    /// s.
    pub step_s: f64,
    /// Rows at rest before the first and after the last row of the path.
    pub lead_rows: usize,
    /// Whether rows were interpolated to other times.
    pub is_resampled: bool,
    /// The rows of the recording.
    pub source: SourceRows,
}

/// The rows from which a path was made, so that messages name rows of the user's file and not those of the path.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceRows {
    times_s: Vec<f64>,
}

impl SourceRows {
    /// The rows of a recording.
    #[must_use]
    pub fn of(recording: &Recording) -> Self {
        Self { times_s: recording.t_s.clone() }
    }

    /// The row at or before `t_s`; the first or the last one during the rest at the ends.
    #[must_use]
    pub fn at(&self, t_s: f64) -> PathRow {
        // Even times differ from those of the file by rounding.
        let half_s =
            self.times_s.windows(2).map(|t| 0.5 * (t[1] - t[0])).fold(f64::INFINITY, f64::min);
        let half_s = if half_s.is_finite() { half_s } else { 0.0 };
        let row = self.times_s.partition_point(|time_s| *time_s <= t_s + half_s).saturating_sub(1);
        let t_s = self.times_s.get(row).copied().unwrap_or(t_s);
        PathRow { row: row + 1, t_s }
    }
}

fn row_of(recording: &Recording, row: usize) -> PathRow {
    PathRow { row: row + 1, t_s: recording.t_s[row] }
}

/// Median time from one row to the next, s.
///
/// # Errors
/// Fewer rows than [`ROWS_LEAST`].
pub fn median_step_s(times_s: &[f64]) -> Result<f64, FeedforwardError> {
    if times_s.len() < ROWS_LEAST {
        return Err(FeedforwardError::TooShort(times_s.len()));
    }
    let mut steps: Vec<f64> = times_s.windows(2).map(|t| t[1] - t[0]).collect();
    let middle = steps.len() / 2;
    Ok(*steps.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The path of a recording, with a rest of `lead_s` before and after it.
///
/// # Errors
/// Poses instead of a path, several segments, too few rows, a gap in time, a row without a command.
pub fn extend(
    recording: &Recording,
    kinds: &[JointKind],
    lead_s: f64,
) -> Result<Extended, FeedforwardError> {
    let even = even_times(recording)?;
    for joint in 0..kinds.len() {
        let column = recording.input(joint).unwrap_or_default();
        let missing = (0..recording.len())
            .find(|row| column.get(*row).is_none_or(|position| !position.is_finite()));
        if let Some(row) = missing {
            let at = row_of(recording, row);
            return Err(FeedforwardError::NoCommand { at, joint: joint + 1 });
        }
    }
    // A whole number of steps stays one in spite of rounding.
    let lead_rows = (lead_s / even.step_s - 1e-6).ceil() as usize;
    let first_s = recording.t_s[0];
    let last_s = even.times_s.last().copied().unwrap_or(first_s);
    let before = (1..=lead_rows).rev().map(|k| first_s - k as f64 * even.step_s);
    let after = (1..=lead_rows).map(|k| last_s + k as f64 * even.step_s);
    let times_s: Vec<f64> = before.chain(even.times_s.iter().copied()).chain(after).collect();
    let mut extended = Recording::new(times_s);
    extended.file.clone_from(&recording.file);
    extended.metadata = recording.metadata.clone();
    extended.metadata.input = None;
    extended.units = recording.units;
    for (joint, kind) in kinds.iter().enumerate() {
        extended.set_joint_kind(joint, *kind);
        let column = recording.input(joint).unwrap_or_default();
        let on_grid = positions_at(&recording.t_s, column, &extended.t_s);
        extended.set(Channel::Command(joint), on_grid);
    }
    let loads: Vec<Channel> = recording.channels().filter(is_load).collect();
    for channel in loads {
        let column = recording.column(channel).unwrap_or_default();
        extended.set(channel, sample_and_hold(&recording.t_s, column, &extended.t_s));
    }
    if !even.is_resampled {
        let beside = |text: &[String]| {
            let empty = || std::iter::repeat_n(String::new(), lead_rows);
            empty().chain(text.iter().cloned()).chain(empty()).collect()
        };
        let other = recording.other.iter();
        extended.other = other.map(|(name, text)| (name.clone(), beside(text))).collect();
    }
    let EvenTimes { step_s, is_resampled, .. } = even;
    let source = SourceRows::of(recording);
    Ok(Extended { recording: extended, step_s, lead_rows, is_resampled, source })
}

/// Even times of a path.
struct EvenTimes {
    times_s: Vec<f64>,
    step_s: f64,
    is_resampled: bool,
}

fn even_times(recording: &Recording) -> Result<EvenTimes, FeedforwardError> {
    if recording.metadata.kind == RecordingKind::Poses {
        return Err(FeedforwardError::Poses);
    }
    let segments = recording.segment.chunk_by(|a, b| a == b).count();
    if segments > 1 {
        return Err(FeedforwardError::Segments(segments));
    }
    let step_s = median_step_s(&recording.t_s)?;
    let (first_s, last_s) = (recording.t_s[0], recording.t_s[recording.len() - 1]);
    let mean_s = (last_s - first_s) / (recording.len() - 1) as f64;
    let is_even = |(k, t_s): (usize, &f64)| {
        (t_s - (first_s + k as f64 * mean_s)).abs() <= EVEN_TOLERANCE * mean_s
    };
    if recording.t_s.iter().enumerate().all(is_even) {
        let times_s = recording.t_s.clone();
        return Ok(EvenTimes { times_s, step_s: mean_s, is_resampled: false });
    }
    let is_gap = |t: &[f64]| t[1] - t[0] > GAP_STEPS_MAX * step_s;
    if let Some(before) = recording.t_s.windows(2).position(is_gap) {
        return Err(FeedforwardError::Gap {
            at: row_of(recording, before + 1),
            gap_s: recording.t_s[before + 1] - recording.t_s[before],
            most_s: GAP_STEPS_MAX * step_s,
        });
    }
    // The last row is at or after the end of the path.
    let rows = ((last_s - first_s) / step_s).ceil() as usize;
    let times_s = (0..=rows).map(|k| first_s + k as f64 * step_s).collect();
    Ok(EvenTimes { times_s, step_s, is_resampled: true })
}

fn is_load(channel: &Channel) -> bool {
    matches!(
        channel,
        Channel::Wrench(_)
            | Channel::Ambient
            | Channel::JointTemperature(_)
            | Channel::Spindle
            | Channel::Feed
    )
}

/// The last sample at or before each time; before the first row the first sample.
fn sample_and_hold(times_s: &[f64], samples: &[f64], at_s: &[f64]) -> Vec<f64> {
    let row = |t_s: &f64| times_s.partition_point(|time_s| time_s <= t_s).saturating_sub(1);
    at_s.iter().map(|t_s| samples.get(row(t_s)).copied().unwrap_or(f64::NAN)).collect()
}

#[cfg(test)]
mod tests;
