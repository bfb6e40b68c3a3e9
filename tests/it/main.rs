//! All tests of more than one crate, one module per behaviour, in one binary.
#![expect(clippy::unwrap_used, clippy::expect_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "what was measured or skipped is said"
)]

mod ageing;
mod architecture;
mod batch;
mod bench;
mod bridge;
mod calibrate;
mod challenge;
mod challenge_forces;
mod challenge_torques;
mod cli;
mod clients;
mod convert;
mod diagnose;
mod diagnose_alike;
mod diagnose_forces;
mod diagnose_garbage;
mod diagnose_torques;
mod dynamics;
mod evidence;
mod faults;
mod feed;
mod force;
mod gate;
mod gauges;
mod gears;
mod guide;
mod in_time;
mod invariants;
mod kill;
mod limiter;
mod live;
mod log;
mod outputs;
mod pages;
mod plan;
mod process;
mod program;
mod readme;
mod recordings;
mod reference;
mod reload;
mod replay;
mod schemas;
mod security;
mod sensor;
mod service;
mod several;
mod simulate;
mod simulate_forces;
mod simulate_torques;
mod simulation;
mod spectrum;
mod stability;
mod status;
mod steering;
mod surface;
mod sweeps;
mod tables;
mod tap;
mod top;
mod trim;
mod waves;
mod width;

use tests::served_cell::Programs;

/// The program itself.
const TRUED: &str = env!("CARGO_BIN_EXE_trued-under-test");
/// A robot's loop that may be killed.
const PROGRAMS: Programs<'static> = Programs { trued: TRUED, rig: env!("CARGO_BIN_EXE_rig-cell") };
