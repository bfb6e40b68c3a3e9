//! All tests of more than one crate, one module per behaviour, in one binary.
#![expect(clippy::unwrap_used, clippy::expect_used, reason = "a test that cannot go on fails")]

mod architecture;
mod readme;
