//! Limits of a correction in position, rate and jerk, by the same rule on both sides of the
//! shared memory.
//!
//! The daemon's corrector limits the corrections of an arm with [`Limiters`]; the client library uses the
//! same ones to ramp the last correction to zero when the daemon is gone. Joint units are rad for a
//! revolute, m for a prismatic joint.
//!
//! Guarantees for each joint, for any `requested` and any jitter of the cycle:
//! - `|c| ≤ angle` at every output, `|Δc|/dt ≤ rate` between two, and the third divided difference
//!   of any four in a row (`Δ³c/dt³` for even spacing) at most `jerk`, all to rounding. For outputs less
//!   than 50 µs apart this applies to those that are 50 µs apart: they
//!   stay within `jerk · (50 µs)³` (1e-12 rad at 8 rad/s³) of a motion that satisfies it;
//! - the output is `requested` bit for bit, without lag, while `requested` stays inside the limits with
//!   room to stop (see [`Limiter::step`]);
//! - after a jump it returns to `requested` in about the time that half the jerk limit takes, if
//!   `requested` itself needs no more than the other half; noise beyond that is smoothed, without lag.
//!
//! It never reads a clock, allocates, logs or panics.
#![no_std]

mod elapsed;
mod limiter;
mod limiters;
mod limits;
mod motion;
mod override_limits;
mod plan;
mod track;

pub use elapsed::{Elapsed, Intervals};
pub use limiter::Limiter;
pub use limiters::Limiters;
pub use limits::{Limits, LimitsError};
pub use override_limits::OverrideLimits;
