//! Removes shared-memory files that were created but never sized: their creator was killed between the two steps, and they may block other processes.
//!
//! The transport (0.10.0) waits for such a file indefinitely, in any thread that opens it, and continues as soon as it is removed. The
//! daemon has a thread for this, which never uses the transport and so cannot be blocked by it.
//! A running creator needs microseconds; a file is removed after 100 ms by the monotonic clock.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::cell::{Cell, SHARED_MEMORY, entries};

const PERIOD: Duration = Duration::from_millis(20);
/// A file without a size is removed after this time.
const UNSIZED_AFTER: Duration = Duration::from_millis(100);

/// Shared-memory files of a cell without a size, each with the time of its first observation.
#[derive(Debug, Default)]
pub(crate) struct UnsizedFiles {
    known: Vec<(PathBuf, u64, Instant)>,
}

impl UnsizedFiles {
    /// Removes files that have had no size for [`UNSIZED_AFTER`]; to be called every few milliseconds.
    pub(crate) fn remove_expired(&mut self, cell: &Cell) {
        let prefix = cell.shared_memory_prefix();
        let empty = |path: &PathBuf| {
            fs::metadata(path).ok().filter(|meta| meta.len() == 0).map(|meta| meta.ino())
        };
        let now = Instant::now();
        let found: Vec<_> = entries(Path::new(SHARED_MEMORY))
            .filter(|(name, _)| name.starts_with(&prefix))
            .filter_map(|(_, path)| Some((empty(&path)?, path)))
            .map(|(file, path)| {
                let known = self.known.iter().find(|(p, f, _)| (p, *f) == (&path, file));
                let since = known.map_or(now, |(_, _, since)| *since);
                (path, file, since)
            })
            .collect();
        let (old, young): (Vec<_>, Vec<_>) =
            found.into_iter().partition(|(_, _, since)| now - *since > UNSIZED_AFTER);
        self.known = young;
        for (path, _, _) in old {
            let _ = fs::remove_file(path);
        }
    }
}

/// Removes unsized files of a cell in a thread, until it is dropped.
#[derive(Debug)]
pub(crate) struct UnsizedFileCleaner {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl UnsizedFileCleaner {
    pub(crate) fn start(cell: &Cell) -> std::io::Result<Self> {
        let (stop, stopped) = channel();
        let cell = cell.clone();
        let thread =
            std::thread::Builder::new().name("trued-mender".to_owned()).spawn(move || {
                let mut half_made = UnsizedFiles::default();
                while stopped.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                    half_made.remove_expired(&cell);
                }
            })?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for UnsizedFileCleaner {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
