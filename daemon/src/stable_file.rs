//! Reads a model file that another process may be writing at the same time.
//!
//! A recently changed file is read only after it has stopped changing; devices and pipes are
//! refused. A truncated file is read as it is: only parse errors can reveal the truncation.

use recording::model::RobotModel;
use std::fs::{self, Metadata};
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::{Duration, SystemTime};

/// A file that has not changed for this long is taken as complete.
const STABLE_FOR: Duration = Duration::from_millis(50);
/// Number of attempts before the file is refused as being written.
const ATTEMPTS_MAX: u32 = 8;
/// Largest accepted file; models have some 10 kB.
const BYTES_MAX: u64 = 16 << 20;

/// Reads the model in this file, or the preset of this name.
///
/// # Errors
/// A message with the remedy.
pub fn read(path: &Path) -> Result<RobotModel, String> {
    for _ in 0..ATTEMPTS_MAX {
        let before = fs::metadata(path).ok();
        if let Some(meta) = &before {
            if !meta.is_file() || meta.len() > BYTES_MAX {
                return Err(format!("{}: expected a file of up to 16 MiB", path.display()));
            }
            if changed_recently(meta) {
                std::thread::sleep(STABLE_FOR);
            }
        }
        let read = RobotModel::read(path);
        if fingerprint(before.as_ref()) == fingerprint(fs::metadata(path).ok().as_ref()) {
            return read.map_err(|fault| fault.to_string());
        }
    }
    Err(format!("{}: is being written; retry when it is complete", path.display()))
}

/// Whether it was changed just now, or in the future (the clock was set since).
fn changed_recently(meta: &Metadata) -> bool {
    let changed = meta.modified().ok();
    let age = changed.and_then(|changed| SystemTime::now().duration_since(changed).ok());
    age.is_none_or(|age| age < STABLE_FOR)
}

/// Properties that change with the file.
fn fingerprint(meta: Option<&Metadata>) -> Option<(u64, u64, i64, i64)> {
    meta.map(|meta| (meta.ino(), meta.len(), meta.mtime(), meta.mtime_nsec()))
}
