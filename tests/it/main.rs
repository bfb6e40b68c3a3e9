//! All tests of more than one crate, one module per behaviour, in one binary.
#![expect(clippy::unwrap_used, clippy::expect_used, reason = "a test that cannot go on fails")]
#![expect(clippy::print_stderr, reason = "what was skipped, and what real data gave, is said")]

mod architecture;
mod cli;
mod program;
mod readme;
mod replay;
