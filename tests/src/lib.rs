//! A test cell around the real program: directory, daemon process, robot loop, and monitors.
//!
//! Everything that a test starts ends with it; every test has separate shared memory. Tests are in
//! `it/`.
#![expect(clippy::expect_used, clippy::panic, reason = "a rig that cannot go on fails its test")]

pub mod cell_loop;
pub mod chance;
pub mod clients;
pub mod egm;
pub mod fuzz;
pub mod gauge;
pub mod hang;
pub mod hostile;
pub mod loop_records;
pub mod memory;
pub mod mutate;
pub mod oracle;
pub mod pair;
pub mod place;
pub mod process;
pub mod python;
pub mod retrofit;
pub mod scribbler;
pub mod sensor;
pub mod simulation;
pub mod strikes;
