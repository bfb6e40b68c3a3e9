//! Where a bench keeps its files: a directory in memory, gone with all that it made.

use std::fs;
use std::path::{Path, PathBuf};

use shm_schema::{Cell, RUNTIME_DIR_ENV, sweep};

use crate::cost::CELLS;
use crate::error::BenchError;

const SHARED_MEMORY: &str = "/dev/shm";

/// The directory, and the names that belong to it.
#[derive(Debug)]
pub(crate) struct Place {
    dir: PathBuf,
    cell: String,
}

impl Place {
    pub(crate) fn new() -> Result<Self, BenchError> {
        let root = std::env::var_os(RUNTIME_DIR_ENV).unwrap_or_else(|| SHARED_MEMORY.into());
        // Short: the transport bounds its paths. One of that name is of a process that is dead.
        let cell = format!("bench-{:x}", std::process::id());
        let dir = Path::new(&root).join(&cell);
        let _ = fs::remove_dir_all(&dir);
        fs::create_dir_all(&dir).map_err(|e| BenchError::io("make the directory", &dir, e))?;
        Ok(Self { dir, cell })
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.dir.join(name)
    }

    pub(crate) fn dir(&self) -> &Path {
        &self.dir
    }

    /// The name of a cell that the bench serves itself, from 0 on.
    pub(crate) fn cell(&self, k: usize) -> String {
        if k == 0 { self.cell.clone() } else { format!("{}-{k}", self.cell) }
    }

    /// How all names of the plain transport start.
    pub(crate) fn prefix(dir: &Path) -> String {
        let name = dir.file_name().map(|name| name.to_string_lossy().into_owned());
        format!("{}.", name.unwrap_or_default())
    }

    pub(crate) fn write(&self, name: &str, text: &str) -> Result<PathBuf, BenchError> {
        let path = self.path(name);
        fs::write(&path, text).map_err(|e| BenchError::io("write", &path, e))?;
        Ok(path)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        for cell in (0..CELLS).flat_map(|k| Cell::new(&self.cell(k))) {
            // The daemon cleans up after itself, unless it was killed.
            let _ = sweep(&cell);
        }
        let _ = fs::remove_dir_all(&self.dir);
        let prefix = Self::prefix(&self.dir);
        let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
        for entry in entries.filter(|e| e.file_name().to_string_lossy().starts_with(&prefix)) {
            let _ = fs::remove_file(entry.path());
        }
    }
}
