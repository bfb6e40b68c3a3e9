//! Comparisons with other software, and between languages: programs of the package `tests`, built and run.
//!
//! Not part of CI, because it measures time.

use std::process::Command;

/// Compares one correction with Pinocchio's; returns whether the limit is met.
pub(crate) fn peers() -> Result<bool, String> {
    cargo(&["run", "--quiet", "--package", "tests", "--bin", "peers"])
}

/// Compares a round trip through C and C++ with one through Rust; returns whether the limit is met.
pub(crate) fn languages() -> Result<bool, String> {
    cargo(&["build", "--quiet", "--release", "--package", "tests", "--bins"])?;
    cargo(&["build", "--quiet", "--release", "--package", "trued-client-c"])?;
    cargo(&["run", "--quiet", "--release", "--package", "tests", "--bin", "languages"])
}

/// Runs cargo; returns whether it succeeded.
pub(crate) fn cargo(arguments: &[&str]) -> Result<bool, String> {
    let status = Command::new("cargo").args(arguments).status().map_err(|why| why.to_string())?;
    Ok(status.success())
}
