//! The client library for cell software: send commanded joint targets, receive corrected ones.
//!
//! ```no_run
//! use std::time::Duration;
//! use trued_client::{Client, monotonic_ns};
//!
//! # fn next_target() -> [f64; 6] { [0.0; 6] }
//! # fn publish(q: &[f64]) {}
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut trued = Client::connect("cell-1", Duration::from_secs(2))?;
//! loop {
//!     let q_cmd = next_target(); // rad
//!     let _ = trued.send(&q_cmd.into()); // fails while no daemon runs: see below
//!     match trued.target_for(&q_cmd, monotonic_ns()) {
//!         Ok(target) => publish(target.joints()),
//!         Err(not_a_target) => return Err(not_a_target.into()), // stop, or send `last_target` again
//!     }
//! }
//! # }
//! ```
//!
//! [`Client::target_for`] always returns the command plus a correction that is limited here, in
//! position, rate and jerk, relative to the last one sent: towards the daemon's while that is fresh (10 ms
//! by default), otherwise towards zero. A daemon that dies, returns, rejects a command, or
//! changes its model, mode or limits changes the target of the correction, and never causes a step. A command
//! that is not finite is an error; a loop that must send something can then send
//! [`Client::last_target`]. Every error has one [`ErrorKind`], the same in every language.
//!
//! Nothing here blocks without a time limit, panics, or logs. Connecting and monitoring the
//! daemon are done by a thread of the library; the calls of the robot's loop make no system
//! calls.

mod client;
mod error;
mod feed;
mod force;
mod horizon;
mod instrument;
mod kind;
mod link;
mod measured;
mod monitor;
mod output;
mod process;
mod requests;
mod setpoint;
mod target;

pub use client::Client;
pub use error::{ConnectError, DisconnectReason, InvalidTarget, RequestError, SendError};
pub use force::{ForceSamples, ForceSource, Samples};
pub use horizon::HORIZON_POINTS_MAX;
pub use instrument::Instrument;
pub use kind::ErrorKind;
pub use link::{Connection, ConnectionEvent};
pub use measured::Measured;
pub use monitor::Monitor;
#[doc(hidden)] // For simulations with their own time.
pub use output::Output;
pub use process::ProcessState;
pub use setpoint::{Setpoint, WrenchFrame};
pub use shm_schema::{
    Advice, Answer, CHANNEL_NAMES, Corrected, CorrectionStatus, FeedReason, FeedState, ForceFault,
    Health, InCut, JOINTS_MAX, LeadState, Mode, Reason, RecorderAction, RecorderState, Response,
    RobotState, SendOutcome, SensorFault, Spectrum, Status, TrimReason, TrimState, Verdict,
    VibrationClass, VibrationState, WatchState, channel_name, monotonic_ns,
};
pub use target::{Source, Target};

/// Version of this build and of the shared-memory contract, as text for users.
#[must_use]
pub fn contract() -> String {
    shm_schema::Contract::of_this_build().to_string()
}
