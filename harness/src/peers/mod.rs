//! Reference transports of a round trip: the limit of the machine, the plain transport, transports of the kernel.
//!
//! Each carries the same number of bytes as trued, a command in one direction and a corrected
//! target back, copied in and out on both sides, without correction. All except the atomics use a
//! separate process. No allocation per trip in our code.

pub(crate) mod atomics;
pub(crate) mod datagram;
pub(crate) mod echo;
pub(crate) mod plain;
pub(crate) mod trued;

use std::time::Duration;

use serde::Serialize;
use shm_schema::{Command, Corrected, monotonic_ns};

/// Bytes of a command.
pub(crate) const COMMAND_BYTES: usize = size_of::<Command>();
/// Bytes of an answer.
pub(crate) const ANSWER_BYTES: usize = size_of::<Corrected>();
/// Time limit after which an answer counts as lost.
pub(crate) const ANSWER_WITHIN: Duration = Duration::from_secs(1);
/// Polls between two readings of the clock.
const POLLS_PER_CLOCK: u32 = 1024;

/// Transport that is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Transport {
    /// trued: client, daemon with its correction, client.
    Trued,
    /// The plain transport without correction.
    Iceoryx2,
    /// Atomic words between two cores, with a copy of the payload.
    Atomics,
    /// One atomic word between two cores.
    Bare,
    /// Unix datagrams.
    Unix,
    /// UDP over the loopback.
    Udp,
    /// Two pipes.
    Pipe,
    /// No round trip: a timer of the kernel and the thread that it wakes, by the tool of that name.
    Cyclictest,
}

impl Transport {
    /// All of them, in the order of their chunks.
    pub const ALL: [Self; 8] = [
        Self::Trued,
        Self::Iceoryx2,
        Self::Atomics,
        Self::Bare,
        Self::Unix,
        Self::Udp,
        Self::Pipe,
        Self::Cyclictest,
    ];

    /// The name in the JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Trued => "trued",
            Self::Iceoryx2 => "iceoryx2",
            Self::Atomics => "atomics",
            Self::Bare => "bare",
            Self::Unix => "unix",
            Self::Udp => "udp",
            Self::Pipe => "pipe",
            Self::Cyclictest => "cyclictest",
        }
    }

    /// Description.
    #[must_use]
    pub fn description(self) -> &'static str {
        match self {
            Self::Trued => "trued, with correction",
            Self::Iceoryx2 => "plain iceoryx2",
            Self::Atomics => "atomics, with a copy",
            Self::Bare => "atomics, one word",
            Self::Unix => "Unix datagram",
            Self::Udp => "UDP loopback",
            Self::Pipe => "pipe",
            Self::Cyclictest => "cyclictest, its wake-up",
        }
    }

    /// Index in [`Self::ALL`].
    pub(crate) fn index(self) -> usize {
        self as usize
    }
}

/// How both sides wait for a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WakeMode {
    /// By polling.
    Poll,
    /// By sleeping until the kernel wakes them.
    Wake,
}

/// An answering side.
pub(crate) trait RoundTrip {
    /// Sends message `seq`, which increases by one each time, and awaits its answer: time from just
    /// before the sending to the reception, ns; `None` if it was lost.
    fn round_trip(&mut self, seq: u64) -> Option<u64>;
}

/// Polls until there is a result; `None` after [`ANSWER_WITHIN`].
pub(crate) fn poll<T>(mut poll_once: impl FnMut() -> Option<T>) -> Option<T> {
    let since_ns = monotonic_ns();
    loop {
        for _ in 0..POLLS_PER_CLOCK {
            if let Some(found) = poll_once() {
                return Some(found);
            }
            std::hint::spin_loop();
        }
        if monotonic_ns() - since_ns > ANSWER_WITHIN.as_nanos() as u64 {
            return None;
        }
    }
}

/// The number at the head of a message.
pub(crate) fn seq_of(message: &[u8]) -> Option<u64> {
    message.first_chunk().map(|bytes| u64::from_le_bytes(*bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_peers_are_in_the_stated_order() {
        assert!(Transport::ALL.iter().enumerate().all(|(place, kind)| kind.index() == place));
    }
}
