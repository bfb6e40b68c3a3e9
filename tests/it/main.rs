//! All tests of more than one crate, one module per behaviour, in one binary.
#![expect(clippy::unwrap_used, clippy::expect_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "what was measured or skipped is said"
)]

mod ageing;
mod architecture;
mod bench;
mod bridge;
mod calibrate;
mod challenge;
mod cli;
mod clients;
mod diagnose;
mod diagnose_garbage;
mod force;
mod gauges;
mod gears;
mod invariants;
mod kill;
mod plan;
mod process;
mod program;
mod readme;
mod reload;
mod replay;
mod sensor;
mod simulate;
mod spectrum;
mod status;
mod surface;
mod sweeps;
mod tap;

/// The program itself.
const TRUED: &str = env!("CARGO_BIN_EXE_trued-under-test");
/// A robot's loop that may be killed.
const RIG_CELL: &str = env!("CARGO_BIN_EXE_rig-cell");
