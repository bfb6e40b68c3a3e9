//! Validation of blocks, and detection of sensor faults from samples and times.
//!
//! All rejected, replaced and missing data are counted. No allocation after planning, no panic.

use crate::block::Block;
use crate::config::MonitorConfig;
use crate::fault::{ChannelCheck, Fault, Faults, Health};

/// Result of the validation of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BlockAdmission {
    /// It continues the previous one.
    Continuous,
    /// It begins a new section after a gap or a restart.
    Restarted,
    Rejected,
}

/// Duration of a constant value that counts as stuck or dead, s.
const CONSTANT_S: f64 = 0.1;
/// Least number of equal samples that counts as stuck or dead.
const CONSTANT_SAMPLES: f64 = 20.0;
/// Time after an invalid sample for which no lines are reported for its channel, s.
const SUSPENSION_S: f64 = 0.128;
/// Relative tolerance of the rate stated by a block.
const STATED_RATE_TOLERANCE: f64 = 1e-3;
/// Relative tolerance of the rate measured by the times of the blocks over a second.
const MEASURED_RATE_TOLERANCE: f64 = 1e-2;
/// Tolerance of a block's time, s, beyond the length of the block; a larger deviation is a gap.
const TIME_JUMP_S: f64 = 0.005;
/// Peak-to-peak value of a dead channel relative to the largest of the same kind.
const DEAD_SPREAD: f64 = 1e-5;
/// Least duration of a session, s; a shorter one counts as a gap.
const SHORT_SESSION_S: f64 = 1.0;
/// Number of force channels; moments follow.
const FORCES: usize = 3;

/// Expected properties of the next block.
#[derive(Clone, Copy, Debug)]
struct ExpectedBlock {
    session: u64,
    seq: u64,
    samples_before: Option<u64>,
    t_ns: u64,
}

/// Validation and fault detection of the incoming stream. Used alone if only the sensor is
/// monitored, without vibration.
#[derive(Debug)]
pub struct SensorStream {
    rate_hz: f64,
    checks: Vec<ChannelCheck>,
    suspended_until: Vec<u64>,
    expected: Option<ExpectedBlock>,
    session_start_sample: u64,
    recovered: u32,
    samples: u64,
    second_ends: u64,
    rate_since: (u64, u64),
    found: Faults,
    health: Health,
}

impl SensorStream {
    /// Only rate, channels and full scales of the configuration are used.
    #[must_use]
    pub fn new(config: &MonitorConfig) -> Self {
        let scale = |c| if c < FORCES { config.full_scale_n } else { config.full_scale_nm };
        Self {
            rate_hz: config.rate_hz,
            checks: (0..config.channels).map(|c| ChannelCheck::new(scale(c))).collect(),
            suspended_until: vec![0; config.channels],
            expected: None,
            session_start_sample: 0,
            recovered: 0,
            samples: 0,
            second_ends: config.rate_hz as u64,
            rate_since: (0, 0),
            found: Faults::default(),
            health: Health::default(),
        }
    }

    /// Checks a whole block; returns whether it was accepted. For a sensor without vibration
    /// monitoring.
    pub fn push(&mut self, block: &Block<'_>) -> bool {
        if self.admit(block) == BlockAdmission::Rejected {
            return false;
        }
        for frame in block.samples.chunks_exact(self.checks.len().max(1)) {
            for (channel, sample) in frame.iter().enumerate() {
                self.check_sample(channel, *sample);
            }
            self.advance(1);
        }
        true
    }

    /// Validates a block by its rate, number of samples and channels, sequence and time.
    pub(crate) fn admit(&mut self, block: &Block<'_>) -> BlockAdmission {
        let right_rate = (block.rate_hz / self.rate_hz - 1.0).abs() <= STATED_RATE_TOLERANCE;
        let channels = self.checks.len();
        let right_shape =
            block.channels == channels && block.samples.len().is_multiple_of(channels.max(1));
        if !(right_rate && right_shape) {
            return self.reject(if right_shape { Fault::WrongRate } else { Fault::WrongShape });
        }
        let frames = (block.samples.len() / channels.max(1)) as u64;
        let length_ns = (frames as f64 / self.rate_hz * 1e9) as u64;
        let admission = match self.expected {
            None => BlockAdmission::Continuous,
            Some(due) => self.compare_with_expected(block, &due, length_ns),
        };
        if admission == BlockAdmission::Rejected {
            return self.reject(Fault::OutOfOrder);
        }
        self.health.blocks += 1;
        if admission == BlockAdmission::Restarted || self.expected.is_none() {
            self.rate_since = (block.t_ns, self.samples);
        } else {
            self.check_rate(block.t_ns);
        }
        self.expected = Some(ExpectedBlock {
            session: block.session,
            seq: block.seq.wrapping_add(1),
            samples_before: block.samples_before.map(|before| before.saturating_add(frames)),
            t_ns: block.t_ns.saturating_add(length_ns),
        });
        admission
    }

    /// Compares a block with the expected one.
    fn compare_with_expected(
        &mut self,
        block: &Block<'_>,
        due: &ExpectedBlock,
        length_ns: u64,
    ) -> BlockAdmission {
        if block.session != due.session {
            self.health.restarts += 1;
            let session_s = (self.samples - self.session_start_sample) as f64 / self.rate_hz;
            self.session_start_sample = self.samples;
            if session_s < SHORT_SESSION_S {
                self.count_gap(0, 0);
            }
            return BlockAdmission::Restarted;
        }
        // With a later time, a smaller number means that the sender restarted its count without a
        // new session.
        if block.seq < due.seq && block.t_ns < due.t_ns {
            return BlockAdmission::Rejected;
        }
        let jump_ns = block.t_ns.abs_diff(due.t_ns);
        let jumped = jump_ns > length_ns.saturating_add((TIME_JUMP_S * 1e9) as u64);
        let counts = block.samples_before.zip(due.samples_before);
        let miscounted = counts.is_some_and(|(before, due)| before != due);
        if block.seq == due.seq && !miscounted && !jumped {
            return BlockAdmission::Continuous;
        }
        let lost_samples = counts.map_or(0, |(before, due)| before.saturating_sub(due));
        self.count_gap(block.seq.saturating_sub(due.seq), lost_samples);
        BlockAdmission::Restarted
    }

    fn reject(&mut self, fault: Fault) -> BlockAdmission {
        self.flag(fault);
        self.health.refused_blocks += 1;
        BlockAdmission::Rejected
    }

    fn count_gap(&mut self, lost_blocks: u64, lost_samples: u64) {
        self.flag(Fault::Gap);
        self.health.gaps += 1;
        self.health.lost_blocks = self.health.lost_blocks.saturating_add(lost_blocks);
        self.health.lost_samples = self.health.lost_samples.saturating_add(lost_samples);
    }

    /// Compares the number of samples in a second or more with the elapsed time.
    fn check_rate(&mut self, t_ns: u64) {
        let (from_ns, from_samples) = self.rate_since;
        let received = (self.samples - from_samples) as f64;
        if received < self.rate_hz {
            return;
        }
        let measured_hz = received * 1e9 / t_ns.saturating_sub(from_ns).max(1) as f64;
        if (measured_hz / self.rate_hz - 1.0).abs() > MEASURED_RATE_TOLERANCE {
            self.flag(Fault::WrongRate);
        }
        self.rate_since = (t_ns, self.samples);
    }

    fn flag(&mut self, fault: Fault) {
        self.found.set(fault, true);
        self.health.stream.set(fault, true);
    }

    /// Checks a sample of a channel; returns the value for the windows.
    #[inline]
    pub(crate) fn check_sample(&mut self, channel: usize, sample: f64) -> f64 {
        let check = &mut self.checks[channel];
        let before = check.not_finite;
        let taken = check.check_sample(sample);
        if check.not_finite != before {
            self.suspended_until[channel] = self.samples + (SUSPENSION_S * self.rate_hz) as u64;
        }
        taken
    }

    /// Whether the windows of a channel contain invalid samples, or the channel is stuck or dead.
    pub(crate) fn is_suspended(&self, channel: usize) -> bool {
        let held = self.suspended_until.get(channel).is_some_and(|&until| self.samples < until);
        held || self.is_stuck_or_dead(channel)
    }

    /// Whether a channel was stuck or dead within the last second.
    pub(crate) fn is_stuck_or_dead(&self, channel: usize) -> bool {
        self.health.channel.get(channel).is_some_and(|faults| faults.is_stuck_or_dead())
    }

    /// Channels that have recovered from being stuck or dead, one bit each; returned once.
    pub(crate) fn take_recovered(&mut self) -> u32 {
        std::mem::take(&mut self.recovered)
    }

    /// Advances by `run` samples per channel, and ends the second when it is over.
    pub(crate) fn advance(&mut self, run: usize) {
        self.samples += run as u64;
        let still = (CONSTANT_S * self.rate_hz).max(CONSTANT_SAMPLES) as u32;
        for (check, faults) in self.checks.iter_mut().zip(&mut self.health.channel) {
            if let Some(fault) = check.check_constant(still) {
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
            self.end_second();
        }
    }

    fn end_second(&mut self) {
        let before = self.health.channel;
        for (check, faults) in self.checks.iter_mut().zip(&mut self.health.channel) {
            self.health.not_finite_samples += u64::from(check.not_finite);
            self.health.saturated_samples += u64::from(check.saturated);
            *faults = check.end_second();
        }
        // Forces are compared with forces, moments with moments.
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
            if before[channel].is_stuck_or_dead() && !faults.is_stuck_or_dead() {
                self.recovered |= 1 << channel;
            }
        }
        self.health.stream = std::mem::take(&mut self.found);
    }

    pub(crate) fn count_dropped(&mut self, verdicts: u32) {
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
