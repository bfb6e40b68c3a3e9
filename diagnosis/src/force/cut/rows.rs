//! Selection of rows for the comparison with the model of the cut, and data split.
//!
//! Promises: rows without spindle speed or feed are excluded; air is detected by the forces, even with feed;
//! rows at the border of engagement are excluded. Never: a selection.

use physics::Cutter;
use recording::series::{Channel, Heldout, Recording};
use spectrum::offline::speed_of_pulses;
use std::ops::Range;
use world::milling::{Row, stands};

use super::super::signal::Signal;
use super::Silence;
use super::law::Stood;
use super::ways::heard;

/// Rows that are looked at, at most; of longer recordings stretches, evenly spread.
const ROWS_MOST: usize = 12_000;
/// Stretches of a recording that is too long.
const WINDOWS: usize = 20;
/// Stretches that all rows together are cut into; of every five one is the test set and one the validation set.
const STRETCHES: usize = 25;
const EVERY: usize = 5;
const HELD: usize = 2;
const LOOK: usize = 4;
/// Runs from which on whole ones are held out.
const RUNS_MANY: usize = 10;
/// Rows beside what is held out that train nothing: the memory of the noise.
const GAP: usize = 10;

/// Which rows are for what.
#[derive(Clone, Debug)]
pub(super) struct Sets {
    pub(super) train: Vec<bool>,
    /// The validation set of the selection; the last fit uses it too.
    pub(super) look: Vec<bool>,
    pub(super) held: Vec<bool>,
    pub(super) says: String,
}

impl Sets {
    /// All rows but those held out.
    pub(super) fn seen(&self) -> Vec<bool> {
        self.train.iter().zip(&self.look).map(|(a, b)| *a || *b).collect()
    }
}

/// The rows that are compared.
pub(super) struct Rows {
    /// Rows of the recording.
    pub(super) at: Vec<usize>,
    /// Of these, which follow one another without a hole.
    pub(super) runs: Vec<Range<usize>>,
    pub(super) stood: Vec<Stood>,
    /// Rows on the way into the work or out of it, which no law describes.
    pub(super) is_between: Vec<bool>,
    pub(super) segments: usize,
}

/// A channel with the gaps of a slower logger filled by what was read last.
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

/// Speed and feed of every row.
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

    /// Tells of each row how far it stands along its segment.
    fn lay_along(&mut self) {
        let mut lasts_s = vec![f64::MIN_POSITIVE; self.segments];
        for stood in &self.stood {
            let last = &mut lasts_s[stood.segment];
            *last = last.max(stood.time_s);
        }
        self.stood.iter_mut().for_each(|stood| stood.along = stood.time_s / lasts_s[stood.segment]);
    }

    /// Sets rows apart that take no part in choices.
    pub(super) fn sets(&self, recording: &Recording) -> Sets {
        let count = self.at.len();
        let (mut held, mut look) = (vec![false; count], vec![false; count]);
        let said = recording.about.heldout != Heldout::Unsaid;
        let whole = self.runs.len() >= RUNS_MANY;
        let (mut stretch, mut kept) = (0, 0);
        for run in &self.runs {
            let is_kept = match &recording.about.heldout {
                Heldout::All => true,
                Heldout::Segments(list) => list.contains(&recording.segment[self.at[run.start]]),
                Heldout::Unsaid => false,
            };
            let share = run.len() as f64 / count.max(1) as f64;
            let pieces =
                if whole { 1 } else { ((STRETCHES as f64 * share).round() as usize).max(1) };
            for piece in 0..pieces {
                let at = |k: usize| run.start + k * run.len() / pieces;
                let here = at(piece)..at(piece + 1);
                let drawn = if said { is_kept } else { stretch % EVERY == HELD };
                kept += usize::from(drawn);
                if drawn {
                    held[here].fill(true);
                } else if stretch % EVERY == LOOK {
                    look[here].fill(true);
                }
                stretch += 1;
            }
        }
        let apart = self.apart(&held, &look);
        let train = (0..count).map(|row| !held[row] && !look[row] && !apart[row]).collect();
        let look = (0..count).map(|row| look[row] && !apart[row]).collect();
        let what = if whole { "runs" } else { "stretches" };
        let says = if said {
            "what the recording keeps for validation".to_owned()
        } else {
            format!("{kept} of {stretch} {what}, never seen by the selection or the fit")
        };
        Sets { train, look, held, says }
    }

    /// Rows beside a border of what is set aside.
    fn apart(&self, held: &[bool], look: &[bool]) -> Vec<bool> {
        let mut apart = vec![false; self.at.len()];
        for run in &self.runs {
            for row in run.start + 1..run.end {
                if (held[row], look[row]) != (held[row - 1], look[row - 1]) {
                    let first = row.saturating_sub(GAP).max(run.start);
                    apart[first..(row + GAP).min(run.end)].fill(true);
                }
            }
        }
        apart
    }
}

/// Runs, or stretches of them where they are too long.
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
