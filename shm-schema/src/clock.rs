//! The clock shared by both sides (`CLOCK_MONOTONIC`).

use rustix::time::{ClockId, clock_gettime};

/// `CLOCK_MONOTONIC`, ns: the same for all processes of one machine, never set back.
#[must_use]
pub fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    (now.tv_sec as u64).wrapping_mul(1_000_000_000).wrapping_add(now.tv_nsec as u64)
}

/// A number that identifies one run of a sender, unique on this machine.
#[must_use]
pub fn new_session() -> u64 {
    let pid = rustix::process::getpid().as_raw_nonzero().get() as u64;
    crate::layout::mix(crate::layout::hash_text("session"), monotonic_ns() ^ (pid << 40))
}
