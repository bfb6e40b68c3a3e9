//! How a correction may change in time: angle, rate and jerk, the same rule on both sides of the
//! shared memory.
//!
//! The daemon's corrector bounds an arm's corrections with [`Limiters`]; the client library ramps the
//! last correction out with the same ones when the daemon is gone. Joint units are rad for a
//! revolute, m for a prismatic joint.
//!
//! What it promises for each joint, whatever `wanted` does and however the cycle jitters:
//! - `|c| ≤ angle` at every output, `|Δc|/dt ≤ rate` between two, and the third divided difference
//!   of any four in a row (`Δ³c/dt³` at an even pace) at most `jerk`, all to rounding. Outputs that
//!   follow each other within 50 µs are held to it against those before that are as far apart: they
//!   stay within `jerk · (50 µs)³` (1e-12 rad at 8 rad/s³) of a motion that keeps it;
//! - the output is `wanted` bit for bit, without lag, while `wanted` stays inside the limits with
//!   room to stop (see [`Limiter::step`]);
//! - after a jump it is back on `wanted` in about the time that half the jerk needs for it, if
//!   `wanted` itself gets by with the other half; noise beyond that is smoothed, without lag.
//!
//! What it never does: read a clock, allocate, log, panic.
#![no_std]

mod elapsed;
mod limiter;
mod limiters;
mod limits;
mod motion;
mod plan;
mod track;

pub use elapsed::{Elapsed, Intervals};
pub use limiter::Limiter;
pub use limiters::Limiters;
pub use limits::{Limits, LimitsError};
