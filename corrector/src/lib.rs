//! One cycle without I/O: validate the command, compute the requested correction, limit it.
//!
//! ```text
//! let requested = corrector.correct(&model, &command, &inputs, now_ns);
//! let limited = corrector.limit(&model, &requested);
//! corrector.prepare(&model);
//! ```
//!
//! Invariants for any input: `limited.correction` is finite, within the position limit, and changes within the rate and jerk
//! limits; the same sequence of inputs gives the same bits.
//! No clock (time is an argument), no heap, no log, no panic.
#![cfg_attr(not(test), no_std)]

mod ageing;
mod bounded_minimum;
mod bounded_solution;
mod command;
mod compliance;
mod corrector;
mod cycle_inputs;
mod damping;
mod direction;
mod feed;
mod history;
mod joints;
mod linearisation;
mod loop_gain;
mod low_pass;
mod normal_equations;
mod outcome;
mod path;
mod settings;
mod solve;
mod task_rows;
mod trim;
mod warm_start;
mod wrench;

pub use crate::corrector::{Corrector, RequestedCorrection};
pub use ageing::AgeingTest;
pub use command::{Command, CommandValidator};
pub use cycle_inputs::{CycleInputs, WrenchSample};
pub use feed::{
    FEED_TIME_CONSTANT_DELAYS, Feed, FeedInput, FeedLimit, FeedReport, FeedRules, FeedSettings,
};
pub use outcome::{
    FeedReason, FeedState, GateState, Outcome, Reason, Residual, Status, TrimReason, TrimState,
};
pub use settings::{LIMITED_SHARE, Mode, Settings, Task, WrenchSettings};
pub use solve::{Solution, Solver, solve};
pub use trim::{
    OutlierRules, PointSample, TRIM_TIME_CONSTANT_DELAYS, Trim, TrimReport, TrimRules, TrimSettings,
};
