//! One cycle without I/O: validate the command, compute the requested correction, limit it.
//!
//! ```text
//! let wanted  = corrector.correct(&model, &command, &world, now_ns);
//! let allowed = corrector.bound(&model, &wanted);
//! corrector.prepare(&model);
//! ```
//!
//! Invariants for any input: `allowed.correction` is finite, within the position limit, and changes within the rate and jerk
//! limits; the same sequence of inputs gives the same bits.
//! No clock (time is an argument), no heap, no log, no panic.
#![cfg_attr(not(test), no_std)]

mod ageing;
mod bounded;
mod compliance;
mod corrector;
mod damping;
mod direction;
mod feed;
mod history;
mod joints;
mod judge;
mod limited;
mod loop_gain;
mod low_pass;
mod normal;
mod outcome;
mod path;
mod rows;
mod settings;
mod slopes;
mod solve;
mod trace;
mod trim;
mod world;
mod wrench;

pub use crate::corrector::{Corrector, Wanted};
pub use ageing::Ageing;
pub use feed::{FEED_DELAYS, Feed, FeedInput, FeedLimit, FeedReport, FeedRules, FeedSettings};
pub use judge::{Command, Judge};
pub use outcome::{
    FeedReason, FeedState, Gate, Outcome, Reason, Residual, Status, TrimReason, TrimState,
};
pub use settings::{LIMITED_SHARE, Mode, Settings, Task, WrenchSettings};
pub use solve::{Solution, Solver, solve};
pub use trim::{DELAYS, GateRules, PointSample, Trim, TrimReport, TrimRules, TrimSettings};
pub use world::{World, WrenchSample};
