//! Directory of a bench: in memory, removed at the end.

use std::fs;
use std::path::{Path, PathBuf};

use shm_schema::{Cell, RUNTIME_DIR_ENV, remove_leftovers};

use crate::cost::CELLS;
use crate::error::BenchError;

const SHARED_MEMORY: &str = "/dev/shm";
/// Prefix of the names of a bench's cells, followed by the process number.
const CELL_PREFIX: &str = "bench-";

/// The directory, and the names that belong to it.
#[derive(Debug)]
pub(crate) struct BenchDirectory {
    dir: PathBuf,
    cell: String,
}

impl BenchDirectory {
    pub(crate) fn new() -> Result<Self, BenchError> {
        let root = std::env::var_os(RUNTIME_DIR_ENV).unwrap_or_else(|| SHARED_MEMORY.into());
        remove_stale(Path::new(&root));
        // Short, because the transport limits its paths. An existing one belongs to a process that
        // has ended.
        let cell = cell(std::process::id());
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

    /// The name of the `k`-th cell served by the bench.
    pub(crate) fn cell(&self, k: usize) -> String {
        numbered(&self.cell, k)
    }

    /// Prefix of all names of the plain transport.
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

/// Removes everything made by the bench of a process: its cells' memory, its directory, files of
/// the plain transport.
fn remove(root: &Path, pid: u32) {
    let (cell, dir) = (cell(pid), root.join(cell(pid)));
    for cell in (0..CELLS).flat_map(|k| Cell::new(&numbered(&cell, k))) {
        // The daemon cleans up after itself, unless it was killed.
        let _ = remove_leftovers(&cell);
    }
    let _ = fs::remove_dir_all(&dir);
    let prefix = BenchDirectory::prefix(&dir);
    for entry in entries(Path::new(SHARED_MEMORY)) {
        if entry.file_name().to_string_lossy().starts_with(&prefix) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Removes the remains of killed benches.
fn remove_stale(root: &Path) {
    let names = entries(root).map(|entry| entry.file_name().to_string_lossy().into_owned());
    let mut pids: Vec<u32> = names.filter_map(|name| pid_in(&name)).collect();
    pids.sort_unstable();
    pids.dedup();
    for pid in pids.into_iter().filter(|pid| !Path::new(&format!("/proc/{pid}")).exists()) {
        remove(root, pid);
    }
}

fn entries(dir: &Path) -> impl Iterator<Item = fs::DirEntry> + use<> {
    fs::read_dir(dir).into_iter().flatten().flatten()
}

/// The process that made a file or directory of this name.
fn pid_in(name: &str) -> Option<u32> {
    let name = name.strip_prefix("trued-").unwrap_or(name).strip_prefix(CELL_PREFIX)?;
    u32::from_str_radix(name.split(['-', '.']).next()?, 16).ok()
}

fn cell(pid: u32) -> String {
    format!("{CELL_PREFIX}{pid:x}")
}

fn numbered(cell: &str, k: usize) -> String {
    if k == 0 { cell.to_owned() } else { format!("{cell}-{k}") }
}

impl Drop for BenchDirectory {
    fn drop(&mut self) {
        if let (Some(root), Some(pid)) = (self.dir.parent(), pid_in(&self.cell)) {
            remove(root, pid);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_killed_bench_has_left_is_gone_with_the_next_and_others_stay() {
        let root = std::env::temp_dir().join(format!("trued-place-{}", std::process::id()));
        // No process number exceeds the kernel's largest, 2²².
        let (dead, living) = (root.join(cell(u32::MAX)), root.join(cell(std::process::id())));
        for dir in [&dead, &living, &root.join("cell-7")] {
            fs::create_dir_all(dir).expect("a directory");
        }
        remove_stale(&root);
        let left = entries(&root).count();
        let _ = fs::remove_dir_all(&root);
        assert_eq!(left, 2, "the living one's and the other's");
    }
}
