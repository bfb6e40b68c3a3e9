//! Whether a block may come in, and what its samples and times tell of the sensor.
//!
//! Counts everything it refuses, replaces or misses. No allocation after planning.

use crate::block::Block;
use crate::config::WatchConfig;
use crate::fault::{ChannelCheck, Fault, Faults, Health};

/// What becomes of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Admission {
    Next,
    AfterGap,
    Refused,
}

/// A value that stands still this long is stuck, s.
const STUCK_S: f64 = 0.1;
/// After a bad sample its channel tells no lines for this long, s.
const HOLD_S: f64 = 0.128;
/// The rate may stray by this part, by the block's own word.
const RATE_SAID: f64 = 1e-3;
/// The rate may stray by this part, by the blocks' times over a second.
const RATE_SEEN: f64 = 1e-2;
/// A jump of time by more than this, and a block's length, is a gap, s.
const TIME_JUMP_S: f64 = 0.005;
/// A channel whose samples spread this many times less than the others' is dead.
const DEAD_SPREAD: f64 = 1e-5;

/// The incoming stream's bookkeeping.
#[derive(Debug)]
pub(crate) struct Stream {
    rate_hz: f64,
    checks: Vec<ChannelCheck>,
    held_until: Vec<u64>,
    next_seq: Option<u64>,
    next_t_ns: u64,
    samples: u64,
    second_ends: u64,
    rate_since: (u64, u64),
    seen: Faults,
    health: Health,
}

impl Stream {
    pub(crate) fn new(config: &WatchConfig) -> Self {
        let scale = |c| if c < 3 { config.full_scale_n } else { config.full_scale_nm };
        Self {
            rate_hz: config.rate_hz,
            checks: (0..config.channels).map(|c| ChannelCheck::new(scale(c))).collect(),
            held_until: vec![0; config.channels],
            next_seq: None,
            next_t_ns: 0,
            samples: 0,
            second_ends: config.rate_hz as u64,
            rate_since: (0, 0),
            seen: Faults::default(),
            health: Health::default(),
        }
    }

    /// Judges a block by its rate, shape, sequence and time.
    pub(crate) fn admit(&mut self, block: &Block<'_>) -> Admission {
        let right_rate = (block.rate_hz / self.rate_hz - 1.0).abs() <= RATE_SAID;
        let channels = self.checks.len();
        let right_shape =
            block.channels == channels && block.samples.len().is_multiple_of(channels);
        if !(right_rate && right_shape) {
            self.flag(if right_rate { Fault::WrongShape } else { Fault::WrongRate });
            self.health.refused_blocks += 1;
            return Admission::Refused;
        }
        self.health.blocks += 1;
        let frames = (block.samples.len() / channels) as u64;
        let length_ns = (frames as f64 / self.rate_hz * 1e9) as u64;
        let known = self.next_seq.replace(block.seq.wrapping_add(1));
        let late_ns = block.t_ns.saturating_sub(self.next_t_ns);
        self.next_t_ns = block.t_ns.saturating_add(length_ns);
        let Some(expected) = known else {
            self.rate_since = (block.t_ns, self.samples);
            return Admission::Next;
        };
        let jumped = late_ns > length_ns.saturating_add((TIME_JUMP_S * 1e9) as u64);
        if expected != block.seq || jumped {
            self.note_gap(block.seq.saturating_sub(expected));
            self.rate_since = (block.t_ns, self.samples);
            return Admission::AfterGap;
        }
        self.check_rate(block.t_ns);
        Admission::Next
    }

    fn note_gap(&mut self, lost_blocks: u64) {
        self.flag(Fault::Gap);
        self.health.gaps += 1;
        self.health.lost_blocks = self.health.lost_blocks.saturating_add(lost_blocks);
    }

    /// Compares the samples that came in a second or more with the time that passed.
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

    /// Takes a sample of a channel; returns what may enter the windows.
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
        self.held_until.get(channel).is_some_and(|&until| self.samples < until)
    }

    /// Notes that every channel has had `run` samples more; ends the second when it is over.
    pub(crate) fn advance(&mut self, run: usize) {
        self.samples += run as u64;
        let stuck = (STUCK_S * self.rate_hz) as u32;
        for (check, faults) in self.checks.iter_mut().zip(&mut self.health.channel) {
            if check.note_stuck(stuck) {
                faults.set(Fault::Stuck, true);
            }
            if check.not_finite > 0 {
                faults.set(Fault::NotFinite, true);
            }
        }
        if self.samples >= self.second_ends {
            self.second_ends = self.samples + self.rate_hz as u64;
            self.close_second();
        }
    }

    fn close_second(&mut self) {
        for (check, faults) in self.checks.iter_mut().zip(&mut self.health.channel) {
            self.health.not_finite_samples += u64::from(check.not_finite);
            self.health.saturated_samples += u64::from(check.saturated);
            *faults = check.close();
        }
        let largest = self.checks.iter().map(|check| check.spread).fold(0.0, f64::max);
        for (check, faults) in self.checks.iter().zip(&mut self.health.channel) {
            let silent = check.spread < DEAD_SPREAD * largest && !faults.contains(Fault::Stuck);
            faults.set(Fault::Dead, faults.contains(Fault::Dead) || silent);
        }
        self.health.stream = std::mem::take(&mut self.seen);
    }

    pub(crate) fn note_dropped(&mut self, verdicts: u32) {
        self.health.dropped_verdicts += u64::from(verdicts);
    }

    pub(crate) fn health(&self) -> Health {
        self.health
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stream() -> Stream {
        Stream::new(&WatchConfig { rate_hz: 1000.0, ..WatchConfig::default() })
    }

    fn block(seq: u64, t_ns: u64, samples: &[f64]) -> Block<'_> {
        Block { seq, t_ns, rate_hz: 1000.0, channels: 3, samples }
    }

    #[test]
    fn blocks_in_order_are_taken_and_a_jump_is_a_gap() {
        let mut stream = stream();
        let samples = [0.0; 30];
        assert_eq!(stream.admit(&block(7, 0, &samples)), Admission::Next);
        assert_eq!(stream.admit(&block(8, 10_000_000, &samples)), Admission::Next);
        assert_eq!(stream.admit(&block(11, 40_000_000, &samples)), Admission::AfterGap);
        assert_eq!((stream.health().gaps, stream.health().lost_blocks), (1, 2));
        assert!(stream.health().stream.contains(Fault::Gap));
        assert_eq!(stream.admit(&block(12, 90_000_000, &samples)), Admission::AfterGap);
    }

    #[test]
    fn a_wrong_rate_or_shape_is_refused_and_named() {
        let mut stream = stream();
        let wrong = Block { rate_hz: 2000.0, ..block(0, 0, &[0.0; 3]) };
        assert_eq!(stream.admit(&wrong), Admission::Refused);
        assert_eq!(stream.admit(&block(0, 0, &[0.0; 4])), Admission::Refused);
        let nan = Block { rate_hz: f64::NAN, ..block(0, 0, &[0.0; 3]) };
        assert_eq!(stream.admit(&nan), Admission::Refused);
        let health = stream.health();
        assert_eq!(health.refused_blocks, 3);
        assert!(
            health.stream.contains(Fault::WrongRate) && health.stream.contains(Fault::WrongShape)
        );
    }

    #[test]
    fn a_sender_that_samples_slower_than_it_says_is_found_out() {
        let mut stream = stream();
        let samples = [0.0; 30];
        for seq in 0..300 {
            stream.admit(&block(seq, seq * 10_500_000, &samples));
            stream.advance(10);
        }
        assert!(stream.health().stream.contains(Fault::WrongRate));
    }

    #[test]
    fn one_silent_channel_among_noisy_ones_is_dead() {
        let mut stream = stream();
        for i in 0..1500 {
            let x = (0.7 * f64::from(i)).sin();
            for (channel, sample) in [x, 1e-9 * x, x].into_iter().enumerate() {
                stream.sample(channel, sample);
            }
            stream.advance(1);
        }
        let channel = stream.health().channel;
        assert!(channel[1].contains(Fault::Dead) && channel[0].is_empty(), "{channel:?}");
    }
}
