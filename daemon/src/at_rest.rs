//! Reads a model file that another process may be writing at the same time.
//!
//! A recently changed file is read only after it has stopped changing; the function never waits for
//! a device or a pipe. A truncated file is read as it is: only its own errors can reveal the
//! truncation.

use recording::model::RobotModel;
use std::fs::{self, Metadata};
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::{Duration, SystemTime};

/// A file that has not changed for this long is taken as complete.
const AT_REST: Duration = Duration::from_millis(50);
/// Number of attempts before the file is refused as being written.
const LOOKS_MAX: u32 = 8;
/// Largest accepted file; models have some 10 kB.
const BYTES_MAX: u64 = 16 << 20;

/// Reads the model in this file, or the preset of this name.
///
/// # Errors
/// A message with the remedy.
pub fn read(path: &Path) -> Result<RobotModel, String> {
    for _ in 0..LOOKS_MAX {
        let before = fs::metadata(path).ok();
        if let Some(meta) = &before {
            if !meta.is_file() || meta.len() > BYTES_MAX {
                return Err(format!("{}: expected a file of up to 16 MiB", path.display()));
            }
            if is_young(meta) {
                std::thread::sleep(AT_REST);
            }
        }
        let read = RobotModel::read(path);
        if mark(before.as_ref()) == mark(fs::metadata(path).ok().as_ref()) {
            return read.map_err(|fault| fault.to_string());
        }
    }
    Err(format!("{}: is being written; retry when it is complete", path.display()))
}

/// Whether it changed a moment ago, or in the future (by a clock that was set since).
fn is_young(meta: &Metadata) -> bool {
    let changed = meta.modified().ok();
    let age = changed.and_then(|changed| SystemTime::now().duration_since(changed).ok());
    age.is_none_or(|age| age < AT_REST)
}

/// Properties that change with the file.
fn mark(meta: Option<&Metadata>) -> Option<(u64, u64, i64, i64)> {
    meta.map(|meta| (meta.ino(), meta.len(), meta.mtime(), meta.mtime_nsec()))
}
