//! Faults of the force signal and their remedies as text: one place for daemon, status and clients.

use core::fmt;

use crate::codes::codes;
use crate::force::FORCE_CHANNELS_MAX;

/// Names of the force channels, in their order.
pub const CHANNEL_NAMES: [&str; FORCE_CHANNELS_MAX] = ["x", "y", "z", "mx", "my", "mz"];

/// The name of a force channel; `?` for an invalid number.
#[must_use]
pub fn channel_name(channel: u32) -> &'static str {
    CHANNEL_NAMES.get(channel as usize).copied().unwrap_or("?")
}

codes! {
    /// Fault of the force signal.
    pub enum SensorFault {
        /// No fault.
        None = 0 "none",
        /// A channel is at the end of its range.
        Saturated = 1 "saturated",
        /// A channel's value is frozen.
        Stuck = 2 "stuck",
        /// A channel contains values that are not finite.
        NotFinite = 3 "not_finite",
        /// Blocks or samples are missing, or time jumped.
        Gaps = 4 "gaps",
        /// The sampling rate differs from the configured one, by the rate stated in the blocks or by their time stamps.
        WrongRate = 5 "wrong_rate",
        /// A channel reads only zero, or has no noise while other channels have some.
        Dead = 6 "dead",
        /// The number of channels differs from the configuration, or the blocks cannot be read.
        WrongShape = 7 "wrong_shape",
        /// Blocks arrive twice or out of order.
        OutOfOrder = 8 "out_of_order",
        /// No block arrives.
        Silent = 9 "silent",
        /// Block time stamps lie in the future: another clock, or a clock that was set.
        InFuture = 10 "in_future",
        /// Block time stamps are much older than their arrival: another clock, or a delay in transit.
        Late = 11 "late",
    }
}

impl SensorFault {
    /// Its bit in a set: bit `n` is the fault of code `n`.
    #[must_use]
    pub const fn bit(self) -> u32 {
        1 << self.code()
    }

    /// The faults in a set.
    pub fn in_set(set: u32) -> impl Iterator<Item = Self> {
        Self::ALL
            .iter()
            .copied()
            .filter(move |fault| *fault != Self::None && set & fault.bit() != 0)
    }

    /// Description and remedy.
    const fn description(self) -> (&'static str, &'static str) {
        match self {
            Self::None => ("is OK", "nothing to do"),
            Self::Saturated => ("is saturated", "choose a larger range or cut with less force"),
            Self::Stuck => ("is stuck", "check the sensor"),
            Self::NotFinite => ("contains NaN or infinite samples", "check the sensor's driver"),
            Self::Gaps => ("has gaps", "check the sender and the load of the computer"),
            Self::WrongRate => {
                ("has a different rate than configured", "correct force.rate_Hz or the sender")
            }
            Self::Dead => ("is dead", "check cable and amplifier"),
            Self::WrongShape => {
                ("has different channels than configured", "correct force.channels or the sender")
            }
            Self::OutOfOrder => ("delivers blocks twice or out of order", "check the sender"),
            Self::Silent => {
                ("delivers no data", "start the sender or remove [force] from the cell")
            }
            Self::InFuture => (
                "has timestamps in the future",
                "stamp blocks with this computer's CLOCK_MONOTONIC",
            ),
            Self::Late => (
                "has timestamps long before arrival",
                "stamp blocks with this computer's CLOCK_MONOTONIC, or send them at once",
            ),
        }
    }
}

/// A fault of one force channel, or of the stream as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ForceFault {
    /// Channel, 0 to 5; `None`: the stream.
    pub channel: Option<u32>,
    /// The fault.
    pub fault: SensorFault,
}

impl ForceFault {
    /// All faults of a stream and its channels, given as sets.
    pub fn all(stream: u32, channels: [u32; FORCE_CHANNELS_MAX]) -> impl Iterator<Item = Self> {
        let of_channel = |(set, channel): (u32, u32)| {
            SensorFault::in_set(set).map(move |fault| Self { channel: Some(channel), fault })
        };
        let of_stream = SensorFault::in_set(stream).map(|fault| Self { channel: None, fault });
        of_stream.chain(channels.into_iter().zip(0..).flat_map(of_channel))
    }
}

/// Description and remedy: "force channel z is stuck: check the sensor".
impl fmt::Display for ForceFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (wrong, remedy) = self.fault.description();
        match self.channel {
            Some(channel) => write!(f, "force channel {} {wrong}: {remedy}", channel_name(channel)),
            None => write!(f, "force stream {wrong}: {remedy}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_of_a_set_is_named_with_its_channel_and_a_remedy() {
        let mut channels = [0; FORCE_CHANNELS_MAX];
        channels[2] = SensorFault::Stuck.bit() | SensorFault::NotFinite.bit();
        let all: Vec<_> = ForceFault::all(SensorFault::Gaps.bit() | 1 | 1 << 31, channels)
            .map(|fault| fault.to_string())
            .collect();
        assert_eq!(
            all,
            [
                "force stream has gaps: check the sender and the load of the computer",
                "force channel z is stuck: check the sensor",
                "force channel z contains NaN or infinite samples: check the sensor's driver",
            ]
        );
    }
}
