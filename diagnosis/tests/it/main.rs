//! Calibration of real robots, where their recordings are at hand.
#![expect(
    clippy::expect_used,
    clippy::print_stderr,
    reason = "a test says what it expected, and what it skipped"
)]

mod irb120;
mod kuka_3smr;
mod sets;

use std::path::PathBuf;

/// A real recording, where it is at hand: `TRUED_DATA`, or `../shared/data` beside the house.
fn data(name: &str) -> Option<PathBuf> {
    let house = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let beside = house.join("../shared/data");
    let folder = std::env::var_os("TRUED_DATA").map_or(beside, PathBuf::from);
    let path = folder.join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("SKIPPED: {name} is not at hand (TRUED_DATA)");
    None
}
