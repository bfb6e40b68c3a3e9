//! One correction beside others' kinematics, in one run: what the documents say of it.
//!
//! Never: part of CI, as it is a matter of time.

use std::process::Command;

/// Builds and runs the comparison; tells whether its bar was held.
pub(crate) fn run() -> Result<bool, String> {
    let words = ["run", "--quiet", "--package", "tests", "--bin", "peers"];
    let status = Command::new("cargo").args(words).status().map_err(|why| why.to_string())?;
    Ok(status.success())
}
