//! The last five minutes of a cell: latency, events, spectra of the force. A page that is opened or reloaded, and a report, show them.
//!
//! Times are arrival times by this computer's clock, ms since 1970. The memory is bounded, whatever the rate of events and spectra.

use std::collections::VecDeque;
use std::sync::Arc;

use serde::{Serialize, Serializer};
use shm_schema::{Spectrum, Status, Verdict, VibrationClass, VibrationState, channel_name};

use crate::changes::Changes;
use crate::report::Report;

/// Length of the history.
pub(crate) const SPAN_MS: u64 = 300_000;
/// Interval of the latency, and of the columns of the spectrogram.
pub(crate) const STEP_MS: u64 = 500;
/// Largest number of entries of each kind: all steps and some more.
const ENTRIES_MAX: usize = 640;

/// Latency at one time.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Latency {
    /// Arrival time, ms since 1970.
    pub(crate) t_ms: u64,
    /// 99th percentile since the start of the daemon; 0 before the first.
    #[serde(rename = "p99_us")]
    pub(crate) p99_us: f64,
    /// Time and number of commands by the daemon, for their period.
    #[serde(skip)]
    pub(crate) counted: (u64, u64),
}

/// An event.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Event {
    /// Arrival time, ms since 1970.
    pub(crate) t_ms: u64,
    /// Description.
    pub(crate) says: String,
    /// The line, if it is a verdict of the vibration monitor.
    #[serde(flatten)]
    pub(crate) line: Option<Line>,
}

/// A line of the vibration monitor.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Line {
    /// Number of the vibration event, the same from its first warning to its end.
    pub(crate) event: u64,
    /// Name of the [`VibrationState`].
    pub(crate) state: &'static str,
    /// Name of the [`VibrationClass`].
    pub(crate) class: &'static str,
    /// Its frequency.
    #[serde(rename = "frequency_Hz")]
    pub(crate) frequency_hz: f64,
    /// Its amplitude, N or Nm.
    pub(crate) amplitude: f64,
    /// Its channel.
    pub(crate) channel: &'static str,
}

/// The largest amplitudes within a step.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Column {
    /// Begin of the step, ms since 1970.
    pub(crate) t_ms: u64,
    /// Centre of the first bin.
    #[serde(rename = "first_Hz")]
    pub(crate) first_hz: f64,
    /// Width of a bin.
    #[serde(rename = "bin_Hz")]
    pub(crate) bin_hz: f64,
    /// Amplitude in each bin, two digits.
    #[serde(rename = "amplitude_N", serialize_with = "two_digits")]
    pub(crate) amplitude_n: Vec<f64>,
}

/// Rounds to two digits: finer than a step of the colour scale, and a third of the bytes.
fn two_digits<S: Serializer>(values: &[f64], to: S) -> Result<S::Ok, S::Error> {
    let rounded = |value: &f64| format!("{value:.1e}").parse::<f64>().unwrap_or(0.0);
    to.collect_seq(values.iter().map(rounded))
}

/// Entries of one kind, numbered from 0.
#[derive(Clone, Debug)]
struct EventLog<T> {
    kept: VecDeque<T>,
    next: u64,
}

impl<T> Default for EventLog<T> {
    fn default() -> Self {
        Self { kept: VecDeque::new(), next: 0 }
    }
}

impl<T: Clone> EventLog<T> {
    fn push(&mut self, entry: T) {
        self.kept.push_back(entry);
        self.next += 1;
        while self.kept.len() > ENTRIES_MAX {
            self.kept.pop_front();
        }
    }

    /// Entries from a number on, of those that are kept.
    fn since(&self, number: u64) -> Vec<T> {
        let first = self.next - self.kept.len() as u64;
        let known = number.saturating_sub(first) as usize;
        self.kept.iter().skip(known).cloned().collect()
    }

    fn drop_while(&mut self, is_old: impl Fn(&T) -> bool) {
        while self.kept.front().is_some_and(&is_old) {
            self.kept.pop_front();
        }
    }
}

/// The history.
#[derive(Debug, Default)]
pub(crate) struct History {
    latency: EventLog<Latency>,
    events: EventLog<Event>,
    spectra: EventLog<Arc<Column>>,
    /// The column of the present step.
    open: Option<Column>,
    changes: Changes,
}

/// Position of a reader in the history.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct HistoryPosition {
    latency: u64,
    events: u64,
    spectra: u64,
}

/// Entries, oldest first.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Entries {
    pub(crate) latency: Vec<Latency>,
    pub(crate) events: Vec<Event>,
    #[serde(serialize_with = "columns")]
    pub(crate) spectra: Vec<Arc<Column>>,
}

fn columns<S: Serializer>(all: &[Arc<Column>], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(all.iter().map(AsRef::as_ref))
}

impl History {
    /// Adds a status.
    pub(crate) fn add_status(&mut self, t_ms: u64, status: &Status, report: &Report) {
        self.advance(t_ms);
        for says in self.changes.since_last(report) {
            self.events.push(Event { t_ms, says, line: None });
        }
        let is_due = self.latency.kept.back().is_none_or(|last| t_ms >= last.t_ms + STEP_MS);
        if is_due && report.away.is_none() {
            let counted = (status.t_ns, status.commands);
            self.latency.push(Latency { t_ms, p99_us: report.latency_us.p99, counted });
        }
    }

    /// Adds a verdict of the vibration monitor.
    pub(crate) fn add_verdict(&mut self, t_ms: u64, verdict: &Verdict) {
        let line = Line {
            event: verdict.event,
            state: verdict.state().map_or("unknown", VibrationState::name),
            class: verdict.class().map_or("unknown", VibrationClass::name),
            frequency_hz: verdict.frequency_hz,
            amplitude: verdict.amplitude,
            channel: channel_name(verdict.axis),
        };
        self.events.push(Event { t_ms, says: verdict.to_string(), line: Some(line) });
    }

    /// Adds a spectrum.
    pub(crate) fn add_spectrum(&mut self, t_ms: u64, spectrum: &Spectrum) {
        self.advance(t_ms);
        let (found, t_ms) = (spectrum.amplitudes_n(), t_ms - t_ms % STEP_MS);
        let fits = |open: &&mut Column| {
            (open.first_hz, open.bin_hz, open.amplitude_n.len())
                == (spectrum.first_hz, spectrum.bin_hz, found.len())
        };
        if let Some(open) = self.open.as_mut().filter(fits) {
            for (most, amplitude) in open.amplitude_n.iter_mut().zip(found) {
                *most = most.max(*amplitude);
            }
        } else {
            let (first_hz, bin_hz) = (spectrum.first_hz, spectrum.bin_hz);
            self.open = Some(Column { t_ms, first_hz, bin_hz, amplitude_n: found.to_vec() });
        }
    }

    /// Closes the column of a step that has ended, and drops old entries.
    pub(crate) fn advance(&mut self, t_ms: u64) {
        if let Some(done) = self.open.take_if(|open| t_ms >= open.t_ms + STEP_MS) {
            self.spectra.push(Arc::new(done));
        }
        let is_old = |at_ms: u64| at_ms + SPAN_MS < t_ms;
        self.latency.drop_while(|one| is_old(one.t_ms));
        self.events.drop_while(|one| is_old(one.t_ms));
        self.spectra.drop_while(|one| is_old(one.t_ms));
    }

    /// Entries since a position, which is advanced to the end.
    pub(crate) fn since(&self, mark: &mut HistoryPosition) -> Entries {
        let entries = Entries {
            latency: self.latency.since(mark.latency),
            events: self.events.since(mark.events),
            spectra: self.spectra.since(mark.spectra),
        };
        *mark = HistoryPosition {
            latency: self.latency.next,
            events: self.events.next,
            spectra: self.spectra.next,
        };
        entries
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW_MS: u64 = 1_700_000_000_000;

    fn spectrum(amplitude: f64) -> Spectrum {
        let mut one = Spectrum { bins: 2, first_hz: 10.0, bin_hz: 5.0, ..Spectrum::default() };
        one.amplitude_n[1] = amplitude;
        one
    }

    #[test]
    fn a_column_has_the_largest_amplitudes_of_its_half_second() {
        let mut history = History::default();
        for (after_ms, amplitude) in [(0, 1.0), (100, 0.123_456), (499, 0.2), (500, 7.0)] {
            history.add_spectrum(NOW_MS + after_ms, &spectrum(amplitude));
        }
        let mut mark = HistoryPosition::default();
        let first = history.since(&mut mark).spectra;
        assert_eq!((first.len(), first[0].amplitude_n[1], first[0].t_ms), (1, 1.0, NOW_MS));
        history.advance(NOW_MS + 1000);
        let next = history.since(&mut mark).spectra;
        assert_eq!((next.len(), next[0].amplitude_n[1]), (1, 7.0), "without another spectrum");
        assert!(history.since(&mut mark).spectra.is_empty());
        let long = Column { amplitude_n: vec![0.123_456, 0.0], ..(*next[0]).clone() };
        let written = serde_json::to_string(&long).expect("JSON");
        assert!(written.ends_with("\"amplitude_N\":[0.12,0.0]}"), "{written}");
    }

    #[test]
    fn what_is_older_than_five_minutes_is_gone_and_a_flood_of_verdicts_is_bounded() {
        let mut history = History::default();
        for step in 0..2000 {
            let t_ms = NOW_MS + step * STEP_MS;
            let status = Status { t_ns: t_ms * 1_000_000, joints: 6, ..Status::default() };
            history.add_status(t_ms, &status, &Report::new("cell", &status, None));
            history.add_spectrum(t_ms, &spectrum(1.0));
            (0..5).for_each(|_| history.add_verdict(t_ms, &Verdict::default()));
        }
        let all = history.since(&mut HistoryPosition::default());
        let last_ms = NOW_MS + 1999 * STEP_MS;
        assert_eq!(all.latency.len() as u64, SPAN_MS / STEP_MS + 1);
        assert!(
            all.latency[0].t_ms + SPAN_MS >= last_ms && all.spectra[0].t_ms + SPAN_MS >= last_ms
        );
        assert_eq!(all.events.len(), ENTRIES_MAX);
    }

    #[test]
    fn a_change_of_mode_is_an_event_with_its_time() {
        let mut history = History::default();
        for (after_ms, mode) in [(0, 0), (40, 0), (80, 2)] {
            let status = Status { mode, ..Status::default() };
            history.add_status(NOW_MS + after_ms, &status, &Report::new("cell", &status, None));
        }
        let events = history.since(&mut HistoryPosition::default()).events;
        assert_eq!((events.len(), events[0].t_ms), (1, NOW_MS + 80));
        assert_eq!(events[0].says, "mode shadow -> full");
    }
}
