//! All tests of more than one crate, one module per behaviour, in one binary.
#![expect(clippy::unwrap_used, clippy::expect_used, reason = "a test that cannot go on fails")]
#![expect(clippy::print_stdout, reason = "what a test measures, it prints")]

mod architecture;
mod invariants;
mod kill;
mod readme;
mod reload;
mod status;

/// The program itself.
const TRUED: &str = env!("CARGO_BIN_EXE_trued-under-test");
/// A robot's loop that may be killed.
const RIG_CELL: &str = env!("CARGO_BIN_EXE_rig-cell");
