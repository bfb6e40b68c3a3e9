//! Faults of a running cell, each applied to real processes: `docs/faults.md` states the outcomes,
//! its table names these tests.
//!
//! After each: no published target broke a limit, the robot's loop is answered again, nothing is
//! left in shared memory, and recordings are readable. `TRUED_SEED` repeats a run. Recovery has to
//! take at most a second; here ten are allowed, because the machine may be busy; the time is
//! printed, and `cargo xtask soak` checks the second.

mod clock;
mod disk;
mod memory;
mod model;
mod payload;
mod readers;
mod signals;
mod table;

use crate::PROGRAMS;
use std::time::{Duration, Instant};
use tests::rng::TestRng;
use tests::served_cell::ServedCell;
use trued_client::monotonic_ns;

/// A pair that is at work, the correction in.
fn at_work() -> ServedCell<'static> {
    let mut pair = ServedCell::start(PROGRAMS);
    pair.wait_answered();
    pair
}

/// Random numbers whose seed is printed.
fn chance() -> TestRng {
    let given = std::env::var("TRUED_SEED").ok().and_then(|n| n.parse().ok());
    let seed = given.unwrap_or_else(monotonic_ns);
    println!("TRUED_SEED={seed}");
    TestRng::new(seed)
}

/// Waits until the condition holds.
pub(crate) fn wait_for(limit: Duration, mut holds: impl FnMut() -> bool) -> bool {
    let start = Instant::now();
    while !holds() {
        if start.elapsed() > limit {
            return false;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    true
}
