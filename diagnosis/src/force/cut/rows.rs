//! Selection of rows for the comparison with the model of the cut, and data split.
//!
//! Rows without spindle speed or feed are excluded; air is detected from the forces, even with feed; rows in entry and exit are marked.

use crate::engine::split::{RowSets, RunSpan, SplitSettings, reserved};
use physics::Cutter;
use recording::series::{Channel, Recording};
use spectrum::offline::speed_from_pulses;
use std::ops::Range;
use world::milling::{Row, cutter_states};

use super::super::signal::Signal;
use super::NoComparison;
use super::cut_model::RowState;
use super::entry_and_exit::detect;

/// Largest number of rows; longer recordings are subsampled by evenly distributed sections.
const ROWS_MOST: usize = 12_000;
/// Number of sections of a longer recording.
const SECTIONS: usize = 20;
/// Gap between test rows and training rows, for the autocorrelation of the noise.
const GAP: usize = 10;
/// Selects the test sections: the third and every fifth from there, so that the entry is not among them.
const SEED: u64 = 2;

/// The compared rows.
pub(super) struct Rows {
    /// Their indices in the recording.
    pub(super) indices: Vec<usize>,
    /// Ranges of them without gaps.
    pub(super) runs: Vec<Range<usize>>,
    pub(super) states: Vec<RowState>,
    /// Rows in entry or exit, which the model does not describe.
    pub(super) is_transition: Vec<bool>,
    pub(super) segments: usize,
}

/// A channel with the gaps of a slower logger filled by its last value.
fn gaps_filled(samples: &[f64], segment: &[i64]) -> Vec<f64> {
    let mut last = f64::NAN;
    let one = |(k, x): (usize, &f64)| {
        if k > 0 && segment[k] != segment[k - 1] {
            last = f64::NAN;
        }
        if x.is_finite() {
            last = *x;
        }
        last
    };
    samples.iter().enumerate().map(one).collect()
}

/// Spindle speed, rev/min, and feed, m/s, of every row.
fn speed_and_feed(
    recording: &Recording,
    rate_hz: f64,
) -> Result<(Vec<f64>, Vec<f64>), NoComparison> {
    let speed = match (recording.column(Channel::Spindle), recording.column(Channel::Tacho)) {
        (Some(speed), _) => gaps_filled(speed, &recording.segment),
        (None, Some(tacho)) => gaps_filled(&speed_from_pulses(tacho, rate_hz), &recording.segment),
        (None, None) => return Err(NoComparison::NoSpeed),
    };
    let feed = recording.column(Channel::Feed).ok_or(NoComparison::NoFeed)?;
    Ok((speed, gaps_filled(feed, &recording.segment)))
}

impl Rows {
    pub(super) fn from_recording(
        recording: &Recording,
        cutter: &Cutter,
        signal: &Signal,
    ) -> Result<Self, NoComparison> {
        let (speed, feed) = speed_and_feed(recording, signal.rate_hz)?;
        let row = |k: usize| Row {
            t_s: recording.t_s[k],
            segment: recording.segment[k],
            spindle_rpm: speed[k],
            feed_m_s: feed[k],
        };
        let known: Vec<Row> = (0..recording.len()).map(row).collect();
        let states = cutter_states(cutter, &known);
        let is_known = |k: &usize| speed[*k].is_finite() && feed[*k].is_finite();
        let engagement = detect(signal, &states, &recording.segment);
        let mut all = Self {
            indices: Vec::new(),
            runs: Vec::new(),
            states: Vec::new(),
            is_transition: Vec::new(),
            segments: 0,
        };
        let mut names: Vec<i64> = Vec::new();
        for run in sections(&signal.runs) {
            let from = all.indices.len();
            for k in run.filter(is_known) {
                let name = recording.segment[k];
                if names.last() != Some(&name) {
                    names.push(name);
                }
                let state = &states[k];
                all.indices.push(k);
                all.is_transition.push(engagement.is_transition[k]);
                all.states.push(RowState {
                    time_s: state.time_s,
                    angle_rad: state.angle_rad,
                    feed_per_tooth_m: state.feed_per_tooth_m,
                    cut_m: state.cut_m,
                    segment: names.len() - 1,
                    relative_time: 0.0,
                    is_cutting: state.is_cutting() && !engagement.is_air[k],
                });
            }
            if all.indices.len() > from {
                all.runs.push(from..all.indices.len());
            }
        }
        all.segments = names.len().max(1);
        all.set_relative_times();
        Ok(all)
    }

    /// Sets the relative position of each row in its segment.
    fn set_relative_times(&mut self) {
        let mut lasts_s = vec![f64::MIN_POSITIVE; self.segments];
        for state in &self.states {
            let last = &mut lasts_s[state.segment];
            *last = last.max(state.time_s);
        }
        self.states
            .iter_mut()
            .for_each(|state| state.relative_time = state.time_s / lasts_s[state.segment]);
    }

    /// Splits the rows into training, validation and test set.
    pub(super) fn split(&self, recording: &Recording) -> RowSets {
        let run = |run: &Range<usize>| RunSpan {
            rows: run.clone(),
            gap: GAP,
            reserved: reserved(
                &recording.metadata.heldout,
                recording.segment[self.indices[run.start]],
            ),
        };
        let runs: Vec<RunSpan> = self.runs.iter().map(run).collect();
        RowSets::of(&runs, SEED, &SplitSettings::default())
    }
}

/// The runs, or sections of them if they are too long.
fn sections(runs: &[Range<usize>]) -> Vec<Range<usize>> {
    let all: usize = runs.iter().map(ExactSizeIterator::len).sum();
    if all <= ROWS_MOST {
        return runs.to_vec();
    }
    let share = ROWS_MOST as f64 / all as f64;
    let mut windows = Vec::new();
    for run in runs {
        let count = (SECTIONS * run.len()).div_ceil(all);
        for k in 0..count {
            let bound = |k: usize| run.start + k * run.len() / count;
            let length = (share * (bound(k + 1) - bound(k)) as f64) as usize;
            windows.push(bound(k)..bound(k) + length);
        }
    }
    windows
}
