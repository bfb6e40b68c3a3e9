//! Reads a model file that may be being written at the same time.
//!
//! Promises: a recently changed file is read only after it has stopped changing; never waits for a device or a pipe. A truncated
//! file is read as it is: only its own errors can reveal the truncation.

use recording::model::RobotModel;
use std::fs::{self, Metadata};
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::{Duration, SystemTime};

/// A file that has not changed for so long is whole.
const AT_REST: Duration = Duration::from_millis(50);
/// Looks before it is told that the file does not come to rest.
const LOOKS_MAX: u32 = 8;
/// Models are some 10 kB.
const BYTES_MAX: u64 = 16 << 20;

/// The model of that file, or of that preset.
///
/// # Errors
/// In words, with what to do.
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
    Err(format!("{}: is being written; ask again once it is whole", path.display()))
}

/// Changed a moment ago, or in a future that a clock which was set has left behind.
fn is_young(meta: &Metadata) -> bool {
    let changed = meta.modified().ok();
    let age = changed.and_then(|changed| SystemTime::now().duration_since(changed).ok());
    age.is_none_or(|age| age < AT_REST)
}

/// What changes with the file.
fn mark(meta: Option<&Metadata>) -> Option<(u64, u64, i64, i64)> {
    meta.map(|meta| (meta.ino(), meta.len(), meta.mtime(), meta.mtime_nsec()))
}
