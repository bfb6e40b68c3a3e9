//! Recordings heard by the same watch as the daemon's, and the lines of their spectra.
//!
//! Offline code: it allocates. A recording comes in pieces without holes; between two pieces the watch's windows start
//! anew, what it learned stays.

mod lines;
mod process;

use crate::alias::Spindle;
use crate::block::{Axis, Block, ProcessState};
use crate::fault::Fault;
use crate::judge::Context;
use crate::sliding::Sighting;
use crate::track::Track;
use crate::verdict::Verdict;
use crate::watch::Watch;

pub use lines::{Averaged, Line, line_near};
pub use process::{path_mm, speed_of_pulses, speed_on};

/// Length of a block that is handed to the watch, s: about what a sensor sends.
const BLOCK_S: f64 = 0.005;

/// A run of samples without a hole.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    /// Time of the first sample, s.
    pub start_s: f64,
    /// Each channel's samples, all of one length.
    pub channels: &'a [&'a [f64]],
}

/// A verdict and when it was said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// The piece that it was said in, from 0.
    pub piece: usize,
    /// Time in the recording, s.
    pub t_s: f64,
    /// What was said.
    pub verdict: Verdict,
}

/// Something wrong with a channel, and how long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finding {
    /// The channel, from 0; `None`: the stream.
    pub channel: Option<usize>,
    /// What is wrong.
    pub fault: Fault,
    /// When it was first seen, s.
    pub from_s: f64,
    /// When it was last seen, s.
    pub to_s: f64,
}

/// What the watch said of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Heard {
    /// Everything that it said, in order.
    pub events: Vec<Event>,
    /// What it found wrong with the channels.
    pub findings: Vec<Finding>,
    /// Verdicts that found no place.
    pub dropped: u64,
    /// The recording was too short for the noise floor to be learned: nothing could be said.
    pub still_learning: bool,
}

/// Hands a recording to a watch in blocks; `process` tells the state at a sample of a piece. Pieces whose channels do not
/// fit the watch are refused by it, and found as a fault of the stream.
pub fn hear(
    watch: &mut Watch,
    rate_hz: f64,
    pieces: &[Piece<'_>],
    mut process: impl FnMut(usize, usize) -> ProcessState,
) -> Heard {
    let frames = ((BLOCK_S * rate_hz) as usize).max(1);
    let mut heard = Heard::default();
    let mut state = None;
    let mut done = 0_u64;
    for (number, piece) in pieces.iter().enumerate() {
        let length = piece.channels.iter().map(|channel| channel.len()).min().unwrap_or(0);
        let start_ns = to_ns(done, rate_hz);
        for (seq, from) in (0..length).step_by(frames).enumerate() {
            let now = process(number, from);
            if state != Some(now) {
                watch.process_state(now);
                state = Some(now);
            }
            let to = (from + frames).min(length);
            let samples: Vec<f64> =
                (from..to).flat_map(|i| piece.channels.iter().map(move |c| c[i])).collect();
            let block = Block {
                // What lies between two pieces is known to be missing: each is a run of its own.
                session: number as u64,
                seq: seq as u64,
                samples_before: None,
                t_ns: to_ns(done, rate_hz),
                rate_hz,
                channels: piece.channels.len(),
                samples: &samples,
            };
            let verdicts = watch.push(&block);
            done += (to - from) as u64;
            let at = |t_ns: u64| piece.start_s + t_ns.saturating_sub(start_ns) as f64 * 1e-9;
            let event = |v: &Verdict| Event { piece: number, t_s: at(v.t_ns), verdict: *v };
            heard.events.extend(verdicts.iter().map(event));
            heard.note(watch, at(to_ns(done, rate_hz)));
        }
    }
    let health = watch.health();
    heard.dropped = health.dropped_verdicts;
    heard.still_learning = health.learning;
    heard
}

fn to_ns(samples: u64, rate_hz: f64) -> u64 {
    (samples as f64 / rate_hz * 1e9).round() as u64
}

impl Heard {
    /// Notes what is wrong now; holes between pieces are known and no finding.
    fn note(&mut self, watch: &Watch, now_s: f64) {
        let health = watch.health();
        let stream = health.stream.iter().filter(|fault| *fault != Fault::Gap).map(|f| (None, f));
        let channels = health.channel.iter().enumerate();
        let channels = channels.flat_map(|(at, faults)| faults.iter().map(move |f| (Some(at), f)));
        for (channel, fault) in stream.chain(channels) {
            let known = self.findings.iter_mut().find(|f| (f.channel, f.fault) == (channel, fault));
            match known {
                Some(finding) => finding.to_s = now_s,
                None => self.findings.push(Finding { channel, fault, from_s: now_s, to_s: now_s }),
            }
        }
    }
}

impl Watch {
    /// What the watch would say of a line that was there all the time, from where it stands alone: whether it was there in
    /// air, whether it grew or followed the feed is not asked. A multiple of the speed that is broader than half the
    /// distance to the next tells nothing: the speed then counts as not known.
    #[must_use]
    pub fn verdict_on(&self, axis: Axis, frequency_hz: f64, standing: &Standing) -> Verdict {
        let sighting = Sighting {
            channel: axis.channel(),
            frequency_hz,
            power: 0.0,
            // One sighting of this weight has that uncertainty.
            ratio: 0.25,
            cell_hz: standing.uncertainty_hz,
            threefold: true,
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
        let context = Context { knows_air: false, spindle, process, ..self.context() };
        context.classify(&mut track);
        context.verdict(&track, 0)
    }
}

/// What the process did while a line stood.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Standing {
    /// Its middle state.
    pub process: ProcessState,
    /// The least and the largest spindle speed, rev/min.
    pub spindle_rpm: [f64; 2],
    /// How far the line's frequency may be off, Hz.
    pub uncertainty_hz: f64,
}

#[cfg(test)]
mod tests;
