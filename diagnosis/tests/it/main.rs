//! Calibration of real robots; tests are skipped if the recordings are not available.
#![expect(
    clippy::expect_used,
    clippy::print_stderr,
    reason = "a test says what it expected, and what it skipped"
)]

mod irb120;
mod kuka_3smr;
mod sets;

use std::path::PathBuf;

/// Path of a real recording in `TRUED_DATA`, or in `../shared/data` beside the repository; `None` if it does not exist.
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
