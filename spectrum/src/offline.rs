//! Offline analysis of recordings: the daemon's vibration monitor, and the lines of averaged
//! spectra.
//!
//! Not for real time: it allocates. A recording consists of pieces without gaps; between two pieces
//! the windows of the monitor are reset, its noise floor is kept.

mod lines;
mod process;

use crate::alias::Spindle;
use crate::block::{Axis, Block, ProcessState};
use crate::fault::Fault;
use crate::line_evaluation::LineContext;
use crate::monitor::VibrationMonitor;
use crate::sliding::Detection;
use crate::track::Track;
use crate::verdict::Verdict;

pub use lines::{AveragedSpectrum, Line, SpectrumAverager, line_near};
pub use process::{feed_along_path, path_mm, speed_from_pulses};

/// Length of a block passed to the monitor, s, as sent by a typical sensor.
const BLOCK_S: f64 = 0.005;

/// Consecutive samples without a gap.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    /// Time of the first sample, s.
    pub start_s: f64,
    /// Samples of each channel, all of equal length.
    pub channels: &'a [&'a [f64]],
}

/// A verdict and its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// The piece of the recording, from 0.
    pub piece: usize,
    /// Time in the recording, s.
    pub t_s: f64,
    /// The verdict.
    pub verdict: Verdict,
}

/// A fault of a channel or of the stream, with the interval in which it was detected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultInterval {
    /// Index of the channel, from 0; `None`: the stream.
    pub channel: Option<usize>,
    /// The fault.
    pub fault: Fault,
    /// Time of its first detection, s.
    pub from_s: f64,
    /// Time of its last detection, s.
    pub to_s: f64,
}

/// Result of the monitor for a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MonitorResult {
    /// All verdicts, in order.
    pub events: Vec<Event>,
    /// All faults of channels and of the stream.
    pub findings: Vec<FaultInterval>,
    /// Number of verdicts dropped.
    pub dropped: u64,
    /// Whether the recording was too short for the noise floor to be learned, so that nothing could
    /// be reported.
    pub still_learning: bool,
}

/// Runs a monitor on a recording, in blocks; `process` returns the process state at a sample of a
/// piece. Pieces whose number of channels is not that of the monitor are rejected, and reported as
/// a fault of the stream.
pub fn run_monitor(
    watch: &mut VibrationMonitor,
    rate_hz: f64,
    pieces: &[Piece<'_>],
    mut process: impl FnMut(usize, usize) -> ProcessState,
) -> MonitorResult {
    let mut run = MonitorRun::new(watch, rate_hz);
    for (number, piece) in pieces.iter().enumerate() {
        let length = piece.channels.iter().map(|channel| channel.len()).min().unwrap_or(0);
        run.begin(piece.start_s, piece.channels.len());
        let samples: Vec<f64> =
            (0..length).flat_map(|frame| piece.channels.iter().map(move |c| c[frame])).collect();
        run.push(&samples, |sample| process(number, sample));
        run.end(|sample| process(number, sample));
    }
    run.finish()
}

/// A run of a monitor on a recording whose samples arrive in parts.
pub struct MonitorRun<'w> {
    watch: &'w mut VibrationMonitor,
    rate_hz: f64,
    result: MonitorResult,
    state: Option<ProcessState>,
    /// Frames passed to the monitor, of all pieces.
    done: u64,
    piece: CurrentPiece,
}

/// The piece being analysed.
#[derive(Default)]
struct CurrentPiece {
    /// Its number from 1; 0 before the first.
    number: usize,
    start_s: f64,
    start_ns: u64,
    channels: usize,
    /// Frames of this piece passed to the monitor.
    frames: usize,
    blocks: u64,
    /// Samples of the next block.
    pending: Vec<f64>,
}

impl<'w> MonitorRun<'w> {
    /// A run without any piece yet.
    pub fn new(watch: &'w mut VibrationMonitor, rate_hz: f64) -> Self {
        let (result, piece) = (MonitorResult::default(), CurrentPiece::default());
        Self { watch, rate_hz, result, state: None, done: 0, piece }
    }

    /// Begins a piece. `start_s`: time of its first sample, s.
    pub fn begin(&mut self, start_s: f64, channels: usize) {
        let number = self.piece.number + 1;
        let start_ns = to_ns(self.done, self.rate_hz);
        self.piece =
            CurrentPiece { number, start_s, start_ns, channels, ..CurrentPiece::default() };
    }

    /// Adds the next samples of the piece, interleaved; `process` returns the process state at a
    /// sample.
    pub fn push(&mut self, samples: &[f64], mut process: impl FnMut(usize) -> ProcessState) {
        let block = ((BLOCK_S * self.rate_hz) as usize).max(1) * self.piece.channels.max(1);
        let mut rest = samples;
        while let Some((part, after)) = rest.split_at_checked(block - self.piece.pending.len()) {
            self.piece.pending.extend_from_slice(part);
            rest = after;
            self.push_block(process(self.piece.frames));
        }
        self.piece.pending.extend_from_slice(rest);
    }

    /// Ends the piece: passes the remaining samples.
    pub fn end(&mut self, mut process: impl FnMut(usize) -> ProcessState) {
        if !self.piece.pending.is_empty() {
            self.push_block(process(self.piece.frames));
        }
    }

    /// The result, after the last piece.
    #[must_use]
    pub fn finish(mut self) -> MonitorResult {
        let health = self.watch.health();
        self.result.dropped = health.dropped_verdicts;
        self.result.still_learning = health.learning;
        self.result
    }

    fn push_block(&mut self, now: ProcessState) {
        let Self { watch, rate_hz, result, state, done, piece } = self;
        if *state != Some(now) {
            watch.set_process_state(now);
            *state = Some(now);
        }
        let number = piece.number.saturating_sub(1);
        let frames = piece.pending.len() / piece.channels.max(1);
        let block = Block {
            // The gap between two pieces is known: each is a separate session.
            session: number as u64,
            seq: piece.blocks,
            samples_before: None,
            t_ns: to_ns(*done, *rate_hz),
            rate_hz: *rate_hz,
            channels: piece.channels,
            samples: &piece.pending,
        };
        let time_s = |t_ns: u64| piece.start_s + t_ns.saturating_sub(piece.start_ns) as f64 * 1e-9;
        let event = |v: &Verdict| Event { piece: number, t_s: time_s(v.t_ns), verdict: *v };
        result.events.extend(watch.push(&block).iter().map(event));
        *done += frames as u64;
        result.record_faults(watch, time_s(to_ns(*done, *rate_hz)));
        piece.frames += frames;
        piece.blocks += 1;
        piece.pending.clear();
    }
}

fn to_ns(samples: u64, rate_hz: f64) -> u64 {
    (samples as f64 / rate_hz * 1e9).round() as u64
}

impl MonitorResult {
    /// Records the present faults; the gaps between pieces are known and not reported.
    fn record_faults(&mut self, watch: &VibrationMonitor, now_s: f64) {
        let health = watch.health();
        let stream = health.stream.iter().filter(|fault| *fault != Fault::Gap).map(|f| (None, f));
        let channels = health.channel.iter().enumerate();
        let channels =
            channels.flat_map(|(channel, faults)| faults.iter().map(move |f| (Some(channel), f)));
        for (channel, fault) in stream.chain(channels) {
            let known = self.findings.iter_mut().find(|f| (f.channel, f.fault) == (channel, fault));
            match known {
                Some(finding) => finding.to_s = now_s,
                None => {
                    self.findings.push(FaultInterval {
                        channel,
                        fault,
                        from_s: now_s,
                        to_s: now_s,
                    });
                }
            }
        }
    }
}

impl VibrationMonitor {
    /// The monitor's verdict on a line present throughout a recording, from its frequency alone:
    /// presence in air, growth and dependence on the feed are not evaluated. If the range of a
    /// harmonic is wider than half the distance between harmonics, the speed is treated as unknown.
    #[must_use]
    pub fn classify_steady_line(
        &self,
        axis: Axis,
        frequency_hz: f64,
        standing: &LineConditions,
    ) -> Verdict {
        let sighting = Detection {
            channel: axis.channel(),
            frequency_hz,
            power: 0.0,
            // A single detection with this weight has that uncertainty.
            ratio: 0.25,
            cell_hz: standing.uncertainty_hz,
            three_windows_agree: true,
            learned_share: 0.0,
            is_asynchronous: false,
        };
        let mut track = Track::new(0, &sighting, 0.0);
        track.from_start = true;
        let mut process = standing.process;
        let [low_hz, high_hz] = standing.spindle_rpm.map(|rpm| rpm / 60.0);
        let hz = process.spindle_rpm / 60.0;
        let mut spindle = Spindle { hz, low_hz, high_hz, teeth: process.teeth };
        if hz <= 0.0 || (frequency_hz / hz).round() * (high_hz - low_hz) >= 0.5 * hz {
            process.spindle_rpm = 0.0;
            spindle = Spindle::default();
        }
        let context = LineContext { air_known: false, spindle, process, ..self.context() };
        context.classify(&mut track);
        context.verdict(&track, 0)
    }
}

/// State of the process while a line was present.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineConditions {
    /// Median state.
    pub process: ProcessState,
    /// The least and the largest spindle speed, rev/min.
    pub spindle_rpm: [f64; 2],
    /// Uncertainty of the line's frequency, Hz.
    pub uncertainty_hz: f64,
}

#[cfg(test)]
mod tests;
