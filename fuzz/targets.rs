//! The targets of `tests/src/fuzz`, for libFuzzer: the same functions, one program each.
//!
//! Never: a target that CI does not run too.

#[expect(dead_code, reason = "examples and shares are for CI")]
#[path = "../tests/src/fuzz/mod.rs"]
mod fuzz;

pub use fuzz::run;
