//! A test cell around the real program: directory, daemon process, robot loop, and monitors.
//!
//! Everything that a test starts ends with it; every test has separate shared memory. Tests are in
//! `it/`.
#![expect(clippy::expect_used, clippy::panic, reason = "a rig that cannot go on fails its test")]

pub mod cell_loop;
pub mod clients;
pub mod egm;
pub mod fault_injection;
pub mod fuzz;
pub mod hang;
pub mod invalid_messages;
pub mod loop_records;
pub mod memory;
pub mod message_corruptor;
pub mod mutator;
pub mod oracle;
pub mod place;
pub mod process;
pub mod python;
pub mod rate_check;
pub mod retrofit;
pub mod rng;
pub mod sensor;
pub mod served_cell;
pub mod simulation;
