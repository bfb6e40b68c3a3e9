//! Liveness of processes: a file lock that the kernel releases when its holder ends, however it ends.
//!
//! Invariant: at most one holder per path; the file contains the holder's process id. A child
//! forked without `exec` keeps the lock of its parent.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rustix::fs::{FlockOperation, flock};

/// A lock that is held until it is dropped.
#[derive(Debug)]
pub(crate) struct Lock {
    file: File,
    path: PathBuf,
}

/// Why a lock was not acquired.
#[derive(Debug)]
pub(crate) enum LockError {
    /// Another process holds it; its id, if it can be read.
    Held(Option<u32>),
    Io(io::Error),
}

impl Lock {
    /// Acquires the lock; retries for `patience`, because [`is_held`] holds it for a moment.
    pub(crate) fn acquire(path: &Path, patience: Duration) -> Result<Self, LockError> {
        let start = Instant::now();
        loop {
            match Self::try_acquire(path) {
                Err(LockError::Held(_)) if start.elapsed() < patience => {
                    std::thread::sleep(Duration::from_millis(5));
                }
                outcome => return outcome,
            }
        }
    }

    fn try_acquire(path: &Path) -> Result<Self, LockError> {
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .open(path)
            .map_err(LockError::Io)?;
        match flock(&file, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => {}
            Err(rustix::io::Errno::WOULDBLOCK) => {
                return Err(LockError::Held(holder_pid(&mut file)));
            }
            Err(e) => return Err(LockError::Io(e.into())),
        }
        let lock = Self { file, path: path.to_owned() };
        if !lock.is_valid() {
            return Err(LockError::Held(None));
        }
        lock.write_pid().map_err(LockError::Io)?;
        Ok(lock)
    }

    /// Whether the file at the path is still the locked one: it may have been removed by a cleanup,
    /// and another process may have locked its successor.
    pub(crate) fn is_valid(&self) -> bool {
        match (self.file.metadata(), fs::metadata(&self.path)) {
            (Ok(a), Ok(b)) => a.ino() == b.ino() && a.dev() == b.dev(),
            _ => false,
        }
    }

    fn write_pid(&self) -> io::Result<()> {
        self.file.set_len(0)?;
        (&self.file).write_all(format!("{}\n", std::process::id()).as_bytes())
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        if self.is_valid() {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Whether a process holds the lock.
pub(crate) fn is_held(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    flock(&file, FlockOperation::NonBlockingLockShared) == Err(rustix::io::Errno::WOULDBLOCK)
}

fn holder_pid(file: &mut File) -> Option<u32> {
    let mut text = String::new();
    file.rewind().ok()?;
    file.read_to_string(&mut text).ok()?;
    text.trim().parse().ok()
}
