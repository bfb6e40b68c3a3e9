//! What cell software links: send commanded joint targets, take corrected ones.
//!
//! ```no_run
//! use std::time::Duration;
//! use trued_client::{Client, monotonic_ns};
//!
//! # fn next_target() -> [f64; 6] { [0.0; 6] }
//! # fn publish(q: &[f64]) {}
//! # fn main() -> Result<(), trued_client::ConnectError> {
//! let mut trued = Client::connect("cell-1", Duration::from_secs(2))?;
//! loop {
//!     let q_cmd = next_target(); // rad
//!     let _ = trued.send(&q_cmd.into()); // refused while the daemon is away: see below
//!     let target = trued.target_for(&q_cmd, monotonic_ns());
//!     publish(target.joints());
//! }
//! # }
//! ```
//!
//! Promise: nothing here blocks without a time limit, panics, or logs. [`Client::target_for`] always
//! answers: with the daemon's correction while it is fresh (10 ms unless told otherwise), else with
//! the last one ramped out by the daemon's own envelope, and with the plain command in the end. When
//! the daemon comes back, the client joins it by itself and blends the correction in again.
//! What goes wrong has one [`ErrorKind`], the same in every language.
//!
//! Joining, and watching whether the daemon lives, is done by a thread of the library; the calls of
//! the robot's loop make no system call. Never: a correction of its own.

mod client;
mod error;
mod follow;
mod force;
mod kind;
mod link;
mod measured;
mod monitor;
mod process;
mod setpoint;
mod target;

pub use client::Client;
pub use error::{AskError, Away, ConnectError, NotSent};
#[doc(hidden)] // For a simulation that brings its own time.
pub use follow::Follower;
pub use force::{ForceSamples, ForceSource, Samples};
pub use kind::ErrorKind;
pub use link::{Connection, ConnectionEvent};
pub use measured::Measured;
pub use monitor::Monitor;
pub use process::ProcessState;
pub use setpoint::{Setpoint, WrenchFrame};
pub use shm_schema::{
    Advice, Answer, CHANNEL_NAMES, Corrected, CorrectionStatus, ForceFault, Health, InCut,
    JOINTS_MAX, Mode, Reason, Response, RobotState, SendOutcome, SensorFault, Status, Verdict,
    VibrationClass, VibrationState, WatchState, channel_name, monotonic_ns,
};
pub use target::{Source, Target};

/// This build's version, and the contract by which it understands a daemon, for people.
#[must_use]
pub fn contract() -> String {
    shm_schema::Contract::ours().to_string()
}
