//! A separate cell for one test: runtime directory in memory, configuration, model.

use recording::model::presets::preset;
use shm_schema::{Cell, new_session, remove_leftovers};
use std::fs;
use std::path::{Path, PathBuf};

/// The cell's name.
pub const CELL: &str = "cell";
/// The model used by the tests.
pub const MODEL: &str = "irb1600-6-145-thesis";

/// Rate limit of a correction: slow, so that a step is distinguishable from what may be made up for
/// after a pause.
const RATE_MRAD_S: f64 = 10.0;

/// A runtime directory, removed at the end with its contents.
#[derive(Debug)]
pub struct TestDirectory {
    root: PathBuf,
}

impl TestDirectory {
    /// A new one with `cell.toml`, to which `tables` is appended, and the model [`MODEL`].
    #[must_use]
    pub fn new(mode: &str, tables: &str) -> Self {
        let root = PathBuf::from(format!("/dev/shm/trued-it-{:016x}", new_session()));
        fs::create_dir_all(root.join("files")).expect("a directory in /dev/shm");
        let place = Self { root };
        let model = place.model("model.toml", MODEL);
        let config = format!(
            "schema = \"trued.cell/1\"\ncell = \"{CELL}\"\nmodel = \"{}\"\nmode = \"{mode}\"\n\
             [envelope]\nrate_mrad_s = {RATE_MRAD_S:.1}\n{tables}",
            model.display()
        );
        place.write("cell.toml", &config);
        place
    }

    /// Path of the runtime directory.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The cell, for clients.
    #[must_use]
    pub fn cell(&self) -> Cell {
        Cell::at(&self.root, CELL).expect("a short path")
    }

    /// Path of a file of this test.
    #[must_use]
    pub fn file(&self, name: &str) -> PathBuf {
        self.root.join("files").join(name)
    }

    /// Writes a file of this test.
    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.file(name), text).expect("a file in /dev/shm");
    }

    /// Writes a preset as a model file.
    #[must_use]
    pub fn model(&self, name: &str, known: &str) -> PathBuf {
        self.write(name, preset(known).expect("a preset of the house").text);
        self.file(name)
    }

    /// All names of the cell that still exist, in shared memory and in the runtime directory.
    #[must_use]
    pub fn remaining_names(&self) -> Vec<String> {
        let prefix = self.cell().shared_memory_prefix();
        let memory = names(Path::new("/dev/shm")).into_iter().filter(|n| n.starts_with(&prefix));
        names(&self.root).into_iter().filter(|name| name != "files").chain(memory).collect()
    }
}

impl Drop for TestDirectory {
    fn drop(&mut self) {
        let _ = remove_leftovers(&self.cell());
        let _ = fs::remove_dir_all(&self.root);
    }
}

fn names(dir: &Path) -> Vec<String> {
    let entries = fs::read_dir(dir).into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}
