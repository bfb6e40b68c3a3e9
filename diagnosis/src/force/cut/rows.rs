//! Selection of rows for the comparison with the model of the cut, and data split.
//!
//! Rows without spindle speed or feed are excluded; air is detected from the forces, even with feed; rows in entry and exit are marked.

use crate::engine::split::{RowSets, RunRows, SplitSettings, reserved};
use physics::Cutter;
use recording::series::{Channel, Recording};
use spectrum::offline::speed_of_pulses;
use std::ops::Range;
use world::milling::{Row, stands};

use super::super::signal::Signal;
use super::Silence;
use super::law::Stood;
use super::ways::heard;

/// Largest number of rows; longer recordings are subsampled by evenly distributed sections.
const ROWS_MOST: usize = 12_000;
/// Number of sections of a longer recording.
const WINDOWS: usize = 20;
/// Gap between test rows and training rows, for the autocorrelation of the noise.
const GAP: usize = 10;
/// Selects the test sections: the third and every fifth from there, so that the entry is not among them.
const SEED: u64 = 2;

/// The compared rows.
pub(super) struct Rows {
    /// Their indices in the recording.
    pub(super) at: Vec<usize>,
    /// Ranges of them without gaps.
    pub(super) runs: Vec<Range<usize>>,
    pub(super) stood: Vec<Stood>,
    /// Rows in entry or exit, which the model does not describe.
    pub(super) is_between: Vec<bool>,
    pub(super) segments: usize,
}

/// A channel with the gaps of a slower logger filled by its last value.
fn filled(samples: &[f64], segment: &[i64]) -> Vec<f64> {
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
fn process(recording: &Recording, rate_hz: f64) -> Result<(Vec<f64>, Vec<f64>), Silence> {
    let speed = match (recording.column(Channel::Spindle), recording.column(Channel::Tacho)) {
        (Some(speed), _) => filled(speed, &recording.segment),
        (None, Some(tacho)) => filled(&speed_of_pulses(tacho, rate_hz), &recording.segment),
        (None, None) => return Err(Silence::NoSpeed),
    };
    let feed = recording.column(Channel::Feed).ok_or(Silence::NoFeed)?;
    Ok((speed, filled(feed, &recording.segment)))
}

impl Rows {
    pub(super) fn of(
        recording: &Recording,
        cutter: &Cutter,
        signal: &Signal,
    ) -> Result<Self, Silence> {
        let (speed, feed) = process(recording, signal.rate_hz)?;
        let row = |k: usize| Row {
            t_s: recording.t_s[k],
            segment: recording.segment[k],
            spindle_rpm: speed[k],
            feed_m_s: feed[k],
        };
        let known: Vec<Row> = (0..recording.len()).map(row).collect();
        let stands = stands(cutter, &known);
        let is_known = |k: &usize| speed[*k].is_finite() && feed[*k].is_finite();
        let heard = heard(signal, &stands, &recording.segment);
        let mut all = Self {
            at: Vec::new(),
            runs: Vec::new(),
            stood: Vec::new(),
            is_between: Vec::new(),
            segments: 0,
        };
        let mut names: Vec<i64> = Vec::new();
        for run in windows(&signal.runs) {
            let from = all.at.len();
            for k in run.filter(is_known) {
                let name = recording.segment[k];
                if names.last() != Some(&name) {
                    names.push(name);
                }
                let stand = &stands[k];
                all.at.push(k);
                all.is_between.push(heard.is_between[k]);
                all.stood.push(Stood {
                    time_s: stand.time_s,
                    angle_rad: stand.angle_rad,
                    feed_per_tooth_m: stand.feed_per_tooth_m,
                    cut_m: stand.cut_m,
                    segment: names.len() - 1,
                    along: 0.0,
                    cuts: stand.cuts() && !heard.is_air[k],
                });
            }
            if all.at.len() > from {
                all.runs.push(from..all.at.len());
            }
        }
        all.segments = names.len().max(1);
        all.lay_along();
        Ok(all)
    }

    /// Sets the relative position of each row in its segment.
    fn lay_along(&mut self) {
        let mut lasts_s = vec![f64::MIN_POSITIVE; self.segments];
        for stood in &self.stood {
            let last = &mut lasts_s[stood.segment];
            *last = last.max(stood.time_s);
        }
        self.stood.iter_mut().for_each(|stood| stood.along = stood.time_s / lasts_s[stood.segment]);
    }

    /// Splits the rows into training, validation and test set.
    pub(super) fn sets(&self, recording: &Recording) -> RowSets {
        let run = |run: &Range<usize>| RunRows {
            rows: run.clone(),
            gap: GAP,
            reserved: reserved(&recording.about.heldout, recording.segment[self.at[run.start]]),
        };
        let runs: Vec<RunRows> = self.runs.iter().map(run).collect();
        RowSets::of(&runs, SEED, &SplitSettings::default())
    }
}

/// The runs, or sections of them if they are too long.
fn windows(runs: &[Range<usize>]) -> Vec<Range<usize>> {
    let all: usize = runs.iter().map(ExactSizeIterator::len).sum();
    if all <= ROWS_MOST {
        return runs.to_vec();
    }
    let share = ROWS_MOST as f64 / all as f64;
    let mut windows = Vec::new();
    for run in runs {
        let count = (WINDOWS * run.len()).div_ceil(all);
        for k in 0..count {
            let at = |k: usize| run.start + k * run.len() / count;
            let length = (share * (at(k + 1) - at(k)) as f64) as usize;
            windows.push(at(k)..at(k) + length);
        }
    }
    windows
}
