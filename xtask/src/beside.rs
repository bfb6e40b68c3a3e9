//! Comparisons with other software, and between languages: programs of the package `tests`, built and run.
//!
//! Never: part of CI, as it is a matter of time.

use std::process::Command;

/// One correction beside Pinocchio's; tells whether its bar was held.
pub(crate) fn peers() -> Result<bool, String> {
    cargo(&["run", "--quiet", "--package", "tests", "--bin", "peers"])
}

/// A round trip through C and C++ beside one through Rust; tells whether its bar was held.
pub(crate) fn languages() -> Result<bool, String> {
    cargo(&["build", "--quiet", "--release", "--package", "tests", "--bins"])?;
    cargo(&["build", "--quiet", "--release", "--package", "trued-client-c"])?;
    cargo(&["run", "--quiet", "--release", "--package", "tests", "--bin", "languages"])
}

/// Runs cargo; tells whether it ended well.
pub(crate) fn cargo(words: &[&str]) -> Result<bool, String> {
    let status = Command::new("cargo").args(words).status().map_err(|why| why.to_string())?;
    Ok(status.success())
}
