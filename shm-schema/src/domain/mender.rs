//! Removes memory that was created and never sized: its creator was killed between the two, and other processes may be blocked by it.
//!
//! The transport (0.10.0) waits for such a file indefinitely, in any thread that opens it, and continues as soon as it is removed. The
//! daemon has a thread for this, which never uses the transport and so cannot block itself.
//! Promise: a live creator needs microseconds and gets 100 ms, by the monotonic clock.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::place::{Cell, SHARED_MEMORY, entries};

const PERIOD: Duration = Duration::from_millis(20);
/// Memory without a size is given up after this time.
const HALF_MADE_AFTER: Duration = Duration::from_millis(100);

/// A cell's memory files without a size, and since when they are known.
#[derive(Debug, Default)]
pub(crate) struct HalfMade {
    known: Vec<(PathBuf, u64, Instant)>,
}

impl HalfMade {
    /// One look; to be called every few milliseconds. Removes what has had no size since long enough.
    pub(crate) fn mend(&mut self, cell: &Cell) {
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
            found.into_iter().partition(|(_, _, since)| now - *since > HALF_MADE_AFTER);
        self.known = young;
        for (path, _, _) in old {
            let _ = fs::remove_file(path);
        }
    }
}

/// Mends a cell's memory until it is dropped.
#[derive(Debug)]
pub(crate) struct Mender {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Mender {
    pub(crate) fn start(cell: &Cell) -> std::io::Result<Self> {
        let (stop, stopped) = channel();
        let cell = cell.clone();
        let thread =
            std::thread::Builder::new().name("trued-mender".to_owned()).spawn(move || {
                let mut half_made = HalfMade::default();
                while stopped.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                    half_made.mend(&cell);
                }
            })?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for Mender {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
