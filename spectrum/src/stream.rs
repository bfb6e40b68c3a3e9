//! Validation of blocks, and faults of the sensor from samples and times.
//!
//! Counts all refused, replaced and missing data. No allocation after planning, no panic.

use crate::block::Block;
use crate::config::WatchConfig;
use crate::fault::{ChannelCheck, Fault, Faults, Health};

/// What becomes of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Admission {
    /// It follows the one before.
    Next,
    /// It begins a new section, unrelated to earlier blocks.
    Anew,
    Refused,
}

/// A constant value for this long is a still channel, s.
const STILL_S: f64 = 0.1;
/// Fewer equal samples are chance.
const STILL_SAMPLES: f64 = 20.0;
/// After a bad sample no lines are reported for its channel for this long, s.
const HOLD_S: f64 = 0.128;
/// Relative deviation allowed for the rate stated by a block.
const RATE_SAID: f64 = 1e-3;
/// The rate may stray by this part, by the blocks' times over a second.
const RATE_SEEN: f64 = 1e-2;
/// A jump of time by more than this, and a block's length, is a gap, s.
const TIME_JUMP_S: f64 = 0.005;
/// A channel with a spread this many times smaller than that of its kind is dead.
const DEAD_SPREAD: f64 = 1e-5;
/// A sender that restarts sooner than this loses samples each time, s.
const SHORT_RUN_S: f64 = 1.0;
/// Forces; moments follow.
const FORCES: usize = 3;

/// What the next block should be.
#[derive(Clone, Copy, Debug)]
struct Due {
    session: u64,
    seq: u64,
    samples_before: Option<u64>,
    t_ns: u64,
}

/// State of the incoming stream. Used alone if only the sensor is monitored.
#[derive(Debug)]
pub struct Stream {
    rate_hz: f64,
    checks: Vec<ChannelCheck>,
    held_until: Vec<u64>,
    due: Option<Due>,
    run_began: u64,
    recovered: u32,
    samples: u64,
    second_ends: u64,
    rate_since: (u64, u64),
    seen: Faults,
    health: Health,
}

impl Stream {
    /// Of the configuration only rate, channels and full scales matter here.
    #[must_use]
    pub fn new(config: &WatchConfig) -> Self {
        let scale = |c| if c < FORCES { config.full_scale_n } else { config.full_scale_nm };
        Self {
            rate_hz: config.rate_hz,
            checks: (0..config.channels).map(|c| ChannelCheck::new(scale(c))).collect(),
            held_until: vec![0; config.channels],
            due: None,
            run_began: 0,
            recovered: 0,
            samples: 0,
            second_ends: config.rate_hz as u64,
            rate_since: (0, 0),
            seen: Faults::default(),
            health: Health::default(),
        }
    }

    /// Checks a whole block; returns whether it was accepted. For a sensor without vibration
    /// monitoring.
    pub fn push(&mut self, block: &Block<'_>) -> bool {
        if self.admit(block) == Admission::Refused {
            return false;
        }
        for frame in block.samples.chunks_exact(self.checks.len().max(1)) {
            for (channel, sample) in frame.iter().enumerate() {
                self.sample(channel, *sample);
            }
            self.advance(1);
        }
        true
    }

    /// Judges a block by its rate, shape, sequence and time.
    pub(crate) fn admit(&mut self, block: &Block<'_>) -> Admission {
        let right_rate = (block.rate_hz / self.rate_hz - 1.0).abs() <= RATE_SAID;
        let channels = self.checks.len();
        let right_shape =
            block.channels == channels && block.samples.len().is_multiple_of(channels.max(1));
        if !(right_rate && right_shape) {
            return self.refuse(if right_shape { Fault::WrongRate } else { Fault::WrongShape });
        }
        let frames = (block.samples.len() / channels.max(1)) as u64;
        let length_ns = (frames as f64 / self.rate_hz * 1e9) as u64;
        let admission = match self.due {
            None => Admission::Next,
            Some(due) => self.follow(block, &due, length_ns),
        };
        if admission == Admission::Refused {
            return self.refuse(Fault::OutOfOrder);
        }
        self.health.blocks += 1;
        if admission == Admission::Anew || self.due.is_none() {
            self.rate_since = (block.t_ns, self.samples);
        } else {
            self.check_rate(block.t_ns);
        }
        self.due = Some(Due {
            session: block.session,
            seq: block.seq.wrapping_add(1),
            samples_before: block.samples_before.map(|before| before.saturating_add(frames)),
            t_ns: block.t_ns.saturating_add(length_ns),
        });
        admission
    }

    /// Compares a block with the expected one.
    fn follow(&mut self, block: &Block<'_>, due: &Due, length_ns: u64) -> Admission {
        if block.session != due.session {
            self.health.restarts += 1;
            let lived_s = (self.samples - self.run_began) as f64 / self.rate_hz;
            self.run_began = self.samples;
            if lived_s < SHORT_RUN_S {
                self.note_gap(0, 0);
            }
            return Admission::Anew;
        }
        // A smaller number with a later time: the sender restarted its count without a new session.
        if block.seq < due.seq && block.t_ns < due.t_ns {
            return Admission::Refused;
        }
        let jump_ns = block.t_ns.abs_diff(due.t_ns);
        let jumped = jump_ns > length_ns.saturating_add((TIME_JUMP_S * 1e9) as u64);
        let counts = block.samples_before.zip(due.samples_before);
        let miscounted = counts.is_some_and(|(before, due)| before != due);
        if block.seq == due.seq && !miscounted && !jumped {
            return Admission::Next;
        }
        let lost_samples = counts.map_or(0, |(before, due)| before.saturating_sub(due));
        self.note_gap(block.seq.saturating_sub(due.seq), lost_samples);
        Admission::Anew
    }

    fn refuse(&mut self, fault: Fault) -> Admission {
        self.flag(fault);
        self.health.refused_blocks += 1;
        Admission::Refused
    }

    fn note_gap(&mut self, lost_blocks: u64, lost_samples: u64) {
        self.flag(Fault::Gap);
        self.health.gaps += 1;
        self.health.lost_blocks = self.health.lost_blocks.saturating_add(lost_blocks);
        self.health.lost_samples = self.health.lost_samples.saturating_add(lost_samples);
    }

    /// Compares the number of samples in a second or more with the elapsed time.
    fn check_rate(&mut self, t_ns: u64) {
        let (from_ns, from_samples) = self.rate_since;
        let came = (self.samples - from_samples) as f64;
        if came < self.rate_hz {
            return;
        }
        let seen_hz = came * 1e9 / t_ns.saturating_sub(from_ns).max(1) as f64;
        if (seen_hz / self.rate_hz - 1.0).abs() > RATE_SEEN {
            self.flag(Fault::WrongRate);
        }
        self.rate_since = (t_ns, self.samples);
    }

    fn flag(&mut self, fault: Fault) {
        self.seen.set(fault, true);
        self.health.stream.set(fault, true);
    }

    /// Checks a sample of a channel; returns the value for the windows.
    #[inline]
    pub(crate) fn sample(&mut self, channel: usize, sample: f64) -> f64 {
        let check = &mut self.checks[channel];
        let before = check.not_finite;
        let taken = check.take(sample);
        if check.not_finite != before {
            self.held_until[channel] = self.samples + (HOLD_S * self.rate_hz) as u64;
        }
        taken
    }

    /// Whether a channel had bad samples so lately that its windows are not to be believed.
    pub(crate) fn is_held(&self, channel: usize) -> bool {
        let held = self.held_until.get(channel).is_some_and(|&until| self.samples < until);
        held || self.is_still(channel)
    }

    /// Whether a channel stood still within the last second.
    pub(crate) fn is_still(&self, channel: usize) -> bool {
        self.health.channel.get(channel).is_some_and(|faults| faults.is_still())
    }

    /// Channels that stood still and move again, one bit each; reported once.
    pub(crate) fn take_recovered(&mut self) -> u32 {
        std::mem::take(&mut self.recovered)
    }

    /// Notes that every channel has had `run` samples more; ends the second when it is over.
    pub(crate) fn advance(&mut self, run: usize) {
        self.samples += run as u64;
        let still = (STILL_S * self.rate_hz).max(STILL_SAMPLES) as u32;
        for (check, faults) in self.checks.iter_mut().zip(&mut self.health.channel) {
            if let Some(fault) = check.note_still(still) {
                faults.set(fault, true);
            }
            // Certain faults are reported at once; the others need a whole second.
            if check.not_finite > 0 {
                faults.set(Fault::NotFinite, true);
            }
            if check.saturated > 0 {
                faults.set(Fault::Saturated, true);
            }
        }
        if self.samples >= self.second_ends {
            self.second_ends = self.samples + self.rate_hz as u64;
            self.close_second();
        }
    }

    fn close_second(&mut self) {
        let before = self.health.channel;
        for (check, faults) in self.checks.iter_mut().zip(&mut self.health.channel) {
            self.health.not_finite_samples += u64::from(check.not_finite);
            self.health.saturated_samples += u64::from(check.saturated);
            *faults = check.close();
        }
        // Newtons are compared with newtons.
        let largest =
            |checks: &[ChannelCheck]| checks.iter().map(|check| check.spread).fold(0.0, f64::max);
        let (forces, moments) = self.checks.split_at(FORCES.min(self.checks.len()));
        let largest = [largest(forces), largest(moments)];
        for (channel, check) in self.checks.iter().enumerate() {
            let faults = &mut self.health.channel[channel];
            let kind = usize::from(channel >= FORCES);
            let silent = check.spread < DEAD_SPREAD * largest[kind];
            if silent && !faults.contains(Fault::Stuck) {
                faults.set(Fault::Dead, true);
            }
            if before[channel].is_still() && !faults.is_still() {
                self.recovered |= 1 << channel;
            }
        }
        self.health.stream = std::mem::take(&mut self.seen);
    }

    pub(crate) fn note_dropped(&mut self, verdicts: u32) {
        self.health.dropped_verdicts += u64::from(verdicts);
    }

    /// State of sensor and stream; `learning` is set by the monitor.
    #[must_use]
    pub fn health(&self) -> Health {
        self.health
    }
}

#[cfg(test)]
mod tests;
