//! Reference transports of a round trip: the limit of the machine, the plain transport, transports of the kernel.
//!
//! Promises: each carries the same bytes as trued does, a command there and a corrected target back, copied in and out on both
//! sides; none corrects anything. All but the atomics go to a process of its own. Never: an allocation per trip of our own making.

pub(crate) mod atomics;
pub(crate) mod datagram;
pub(crate) mod echo;
pub(crate) mod plain;
pub(crate) mod trued;

use std::time::Duration;

use serde::Serialize;
use shm_schema::{Command, Corrected, monotonic_ns};

/// Bytes of what goes there.
pub(crate) const THERE: usize = size_of::<Command>();
/// Bytes of what comes back.
pub(crate) const BACK: usize = size_of::<Corrected>();
/// How long an answer is waited for before it counts as lost.
pub(crate) const ANSWER_WITHIN: Duration = Duration::from_secs(1);
/// Looks between two looks at the clock, while polling.
const LOOKS_PER_CLOCK: u32 = 1024;

/// Who answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// trued: client, daemon with its correction, client.
    Trued,
    /// The plain transport, nothing corrected.
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

impl Kind {
    /// Everybody, in the order in which their chunks follow each other.
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

    /// The word for it, as in the JSON.
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

    /// What it is, for people.
    #[must_use]
    pub fn what(self) -> &'static str {
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

    /// Where it stands in [`Self::ALL`].
    pub(crate) fn place(self) -> usize {
        self as usize
    }
}

/// How both sides wait for a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Way {
    /// By looking again and again.
    Poll,
    /// Asleep, until the kernel wakes.
    Wake,
}

/// One that answers.
pub(crate) trait Peer {
    /// Sends message `seq`, which goes up by one each time, and awaits its answer: from just before the sending to the taking, ns; none
    /// where it was lost.
    fn round_trip(&mut self, seq: u64) -> Option<u64>;
}

/// Looks until there is something; none after [`ANSWER_WITHIN`].
pub(crate) fn poll<T>(mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let since_ns = monotonic_ns();
    loop {
        for _ in 0..LOOKS_PER_CLOCK {
            if let Some(found) = look() {
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
    fn everybody_stands_where_the_order_says() {
        assert!(Kind::ALL.iter().enumerate().all(|(place, kind)| kind.place() == place));
    }
}
