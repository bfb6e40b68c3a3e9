//! Liveness of processes: a file lock that the kernel releases when its holder ends, however it ends.
//!
//! Promise: at most one holder per path; the file names the holder's process. Beware: a child
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

/// Why a lock was not had.
#[derive(Debug)]
pub(crate) enum LockError {
    /// Another process has it; its id as far as it can be read.
    Held(Option<u32>),
    Io(io::Error),
}

impl Lock {
    /// Takes the lock; tries for `patience`, as a look at it by [`is_held`] hinders for a moment.
    pub(crate) fn take(path: &Path, patience: Duration) -> Result<Self, LockError> {
        let start = Instant::now();
        loop {
            match Self::try_take(path) {
                Err(LockError::Held(_)) if start.elapsed() < patience => {
                    std::thread::sleep(Duration::from_millis(5));
                }
                outcome => return outcome,
            }
        }
    }

    fn try_take(path: &Path) -> Result<Self, LockError> {
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
            Err(rustix::io::Errno::WOULDBLOCK) => return Err(LockError::Held(holder(&mut file))),
            Err(e) => return Err(LockError::Io(e.into())),
        }
        let lock = Self { file, path: path.to_owned() };
        if !lock.holds() {
            return Err(LockError::Held(None));
        }
        lock.write_pid().map_err(LockError::Io)?;
        Ok(lock)
    }

    /// Whether the file under the path is still the one that is locked: who cleans up may have
    /// removed it, and another process locked its successor.
    pub(crate) fn holds(&self) -> bool {
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
        if self.holds() {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Whether a process holds the lock.
pub(crate) fn is_held(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    flock(&file, FlockOperation::NonBlockingLockShared) == Err(rustix::io::Errno::WOULDBLOCK)
}

fn holder(file: &mut File) -> Option<u32> {
    let mut text = String::new();
    file.rewind().ok()?;
    file.read_to_string(&mut text).ok()?;
    text.trim().parse().ok()
}
