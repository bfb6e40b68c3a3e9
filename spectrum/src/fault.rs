//! Detection of sensor and stream faults.
//!
//! Checks samples before the windows. The monitor continues in any case: an invalid sample is
//! replaced by the previous one and its channel suspended, an invalid block is rejected, a gap is
//! counted.

use crate::block::CHANNELS_MAX;
use std::fmt;

/// A fault of a channel or of the stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// NaN or infinite samples.
    NotFinite,
    /// A constant value other than zero for 100 ms.
    Stuck,
    /// Samples at the sensor's full scale, or flat tops if that is unknown.
    Saturated,
    /// Only zeros for 100 ms, or no noise although other channels of the same kind have noise.
    Dead,
    /// Blocks were lost, or time jumped.
    Gap,
    /// The sampling rate, stated by the block or computed from the times, is not the configured
    /// one.
    WrongRate,
    /// The number of channels or samples is wrong.
    WrongShape,
    /// A block was repeated, or arrived after a later one.
    OutOfOrder,
}

impl Fault {
    /// All faults.
    pub const ALL: [Self; 8] = [
        Self::NotFinite,
        Self::Stuck,
        Self::Saturated,
        Self::Dead,
        Self::Gap,
        Self::WrongRate,
        Self::WrongShape,
        Self::OutOfOrder,
    ];

    /// Name in status and JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::NotFinite => "not_finite",
            Self::Stuck => "stuck",
            Self::Saturated => "saturated",
            Self::Dead => "dead",
            Self::Gap => "gap",
            Self::WrongRate => "wrong_rate",
            Self::WrongShape => "wrong_shape",
            Self::OutOfOrder => "out_of_order",
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "samples are NaN or infinite: check the sensor's driver",
            Self::Stuck => "the value does not move at all: check the sensor",
            Self::Saturated => "samples stand at full scale: choose a larger range",
            Self::Dead => "no signal: check cable and amplifier",
            Self::Gap => "samples were lost: windows start anew; check the sender",
            Self::WrongRate => "the rate is not the configured one: correct rate_hz or the sender",
            Self::WrongShape => "channels or samples do not fit: correct channels or the sender",
            Self::OutOfOrder => "blocks come twice or too late: check the sender",
        })
    }
}

/// A set of faults.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Faults(u8);

impl Faults {
    /// Whether the set contains the fault.
    #[must_use]
    pub fn contains(self, fault: Fault) -> bool {
        self.0 & (1 << fault as u8) != 0
    }

    /// Whether the set is empty.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The faults in the set.
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL.into_iter().filter(move |&fault| self.contains(fault))
    }

    /// Whether the channel was stuck or dead: its samples, and a noise floor learned from them, are
    /// invalid.
    pub(crate) fn is_stuck_or_dead(self) -> bool {
        self.contains(Fault::Stuck) || self.contains(Fault::Dead)
    }

    pub(crate) fn set(&mut self, fault: Fault, is_present: bool) {
        let bit = 1 << fault as u8;
        self.0 = if is_present { self.0 | bit } else { self.0 & !bit };
    }
}

impl fmt::Debug for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.iter()).finish()
    }
}

/// The state of sensor and stream, with counts since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Health {
    /// Blocks accepted.
    pub blocks: u64,
    /// Blocks rejected for their rate, number of samples or channels, or order.
    pub refused_blocks: u64,
    /// Sessions of the sender after the first one.
    pub restarts: u64,
    /// Gaps detected.
    pub gaps: u64,
    /// Blocks lost in gaps, according to the sequence numbers.
    pub lost_blocks: u64,
    /// Samples per channel lost in gaps, if the sender counts them.
    pub lost_samples: u64,
    /// Samples that were NaN or infinite.
    pub not_finite_samples: u64,
    /// Samples at full scale.
    pub saturated_samples: u64,
    /// Verdicts dropped because a block's list was full.
    pub dropped_verdicts: u64,
    /// Faults of the stream, in the last second.
    pub stream: Faults,
    /// Faults of each channel, in the last second.
    pub channel: [Faults; CHANNELS_MAX],
    /// Whether the noise floor is still being learned: nothing is reported yet.
    pub learning: bool,
}

impl Health {
    /// Whether there is no fault.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.stream.is_empty() && self.channel.iter().all(|faults| faults.is_empty())
    }
}

/// Number of equal samples at an extreme value that counts as clipping if the full scale is
/// unknown.
const FLAT_TOP_SAMPLES: u32 = 8;
/// Flat tops per second that count as saturation.
const FLAT_TOPS_PER_S: u32 = 3;

/// Plausibility checks on the samples of one channel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ChannelCheck {
    full_scale: f64,
    last: f64,
    run: u32,
    low: f64,
    high: f64,
    flat_tops: [u32; 2],
    pub(crate) spread: f64,
    pub(crate) not_finite: u32,
    pub(crate) saturated: u32,
    constant_fault: Option<Fault>,
}

impl ChannelCheck {
    pub(crate) fn new(full_scale: f64) -> Self {
        Self {
            full_scale,
            last: 0.0,
            run: 0,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            flat_tops: [0; 2],
            spread: 0.0,
            not_finite: 0,
            saturated: 0,
            constant_fault: None,
        }
    }

    /// Checks a sample; returns the value for the windows, which is the previous one if the sample
    /// is invalid.
    #[inline]
    pub(crate) fn check_sample(&mut self, sample: f64) -> f64 {
        if sample.is_nan() || sample.abs() >= 1e30 {
            self.not_finite += 1;
            return self.last;
        }
        if sample.abs() >= 0.999 * self.full_scale {
            self.saturated += 1;
        }
        if sample.to_bits() == self.last.to_bits() {
            self.run = self.run.saturating_add(1);
            if self.run == FLAT_TOP_SAMPLES {
                self.flat_tops[0] += u32::from(sample <= self.low);
                self.flat_tops[1] += u32::from(sample >= self.high);
            }
            return sample;
        }
        self.run = 0;
        self.last = sample;
        if sample < self.low {
            self.low = sample;
            self.flat_tops[0] = 0;
        }
        if sample > self.high {
            self.high = sample;
            self.flat_tops[1] = 0;
        }
        sample
    }

    /// The fault of a value that has been constant for this many samples, if any; kept until the
    /// end of the second.
    pub(crate) fn check_constant(&mut self, samples: u32) -> Option<Fault> {
        if self.run >= samples {
            self.constant_fault = Some(if self.last == 0.0 { Fault::Dead } else { Fault::Stuck });
        }
        self.constant_fault
    }

    /// Ends an interval of one second: returns its faults, except those that depend on other
    /// channels.
    pub(crate) fn end_second(&mut self) -> Faults {
        let mut faults = Faults::default();
        let flat =
            self.high > self.low && self.flat_tops.iter().any(|&tops| tops >= FLAT_TOPS_PER_S);
        let clipped = flat && self.full_scale.is_infinite();
        faults.set(Fault::NotFinite, self.not_finite > 0);
        faults.set(Fault::Saturated, self.saturated > 0 || clipped);
        self.spread = if self.high > self.low { self.high - self.low } else { 0.0 };
        faults.set(Fault::Dead, self.spread <= 0.0 && (self.last == 0.0 || self.not_finite > 0));
        if let Some(still) = self.constant_fault {
            faults.set(still, true);
        }
        *self = Self {
            last: self.last,
            run: self.run,
            spread: self.spread,
            ..Self::new(self.full_scale)
        };
        faults
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn second(check: &mut ChannelCheck, sample: impl Fn(usize) -> f64) -> Faults {
        for i in 0..1000 {
            check.check_sample(sample(i));
            check.check_constant(100);
        }
        check.end_second()
    }

    fn tone(i: usize) -> f64 {
        (0.37 * i as f64).sin()
    }

    #[test]
    fn every_fault_of_a_channel_is_named() {
        let fresh = || ChannelCheck::new(f64::INFINITY);
        assert!(second(&mut fresh(), tone).is_empty());
        let named = |sample: &dyn Fn(usize) -> f64, fault| {
            let faults = second(&mut fresh(), sample);
            assert!(faults.contains(fault), "{faults:?} lacks {fault:?}");
        };
        named(&|i| if i == 7 { f64::NAN } else { tone(i) }, Fault::NotFinite);
        named(&|i| if i > 500 { 2.5 } else { tone(i) }, Fault::Stuck);
        named(&|i| (3.0 * (0.02 * i as f64).sin()).clamp(-1.0, 1.0), Fault::Saturated);
        named(&|_| 0.0, Fault::Dead);
        named(&|_| f64::INFINITY, Fault::Dead);
        let faults = second(&mut ChannelCheck::new(0.9), tone);
        assert!(faults.contains(Fault::Saturated));
    }

    #[test]
    fn a_bad_sample_is_replaced_by_the_one_before() {
        let mut check = ChannelCheck::new(f64::INFINITY);
        check.check_sample(4.0);
        assert_eq!([f64::NAN, f64::NEG_INFINITY, 1e300].map(|x| check.check_sample(x)), [4.0; 3]);
    }
}
