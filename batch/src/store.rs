//! The folder of results: `KEY.parquet` for each recording, and the digest over all of them.
//!
//! Results are written atomically (hidden temporary file, synced, renamed), so that a process can be killed at any time and several processes can share the
//! folder. The temporary file `.KEY.parquet.PID.part` of a killed process is removed by the process that writes that result.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use recording::files::{FileError, write_atomic};

use crate::key::Key;
use crate::table;

/// File extension of a result.
const ENDING: &str = ".parquet";

/// Handling of an existing result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Existing {
    /// The run ends with an error.
    Refuse,
    /// It is kept if complete; the recording is not diagnosed again.
    Keep,
    /// It is computed again.
    Replace,
}

/// A folder of results.
#[derive(Debug)]
pub struct Store {
    folder: PathBuf,
    /// Temporary files of killed processes, by the key of the result.
    leftovers: BTreeMap<String, Vec<PathBuf>>,
}

/// The digest of a folder: equals `sha256sum *.parquet | sha256sum` in a folder without other Parquet files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Digest {
    /// Number of results.
    pub results: usize,
    /// SHA-256 over a line `HASH  NAME` for each result, sorted by name.
    pub sha256: String,
}

impl Store {
    /// Opens a folder, creating it if necessary.
    ///
    /// # Errors
    /// The folder cannot be made or listed.
    pub fn open(folder: &Path) -> io::Result<Self> {
        if folder.exists() && !folder.is_dir() {
            return Err(io::ErrorKind::NotADirectory.into());
        }
        fs::create_dir_all(folder)?;
        let mut leftovers: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
        for name in names(folder)? {
            let part = name.strip_prefix('.').filter(|name| name.ends_with(".part"));
            if let Some((key, _)) = part.and_then(|part| part.split_once(ENDING)) {
                leftovers.entry(key.to_owned()).or_default().push(folder.join(&name));
            }
        }
        Ok(Self { folder: folder.to_owned(), leftovers })
    }

    /// Path of the result of a key.
    #[must_use]
    pub fn place(&self, key: Key) -> PathBuf {
        self.folder.join(format!("{key}{ENDING}"))
    }

    /// Whether a complete result of a key exists: its footer can be read and contains that key.
    #[must_use]
    pub fn has(&self, key: Key) -> bool {
        table::key_of(&self.place(key)).is_some_and(|found| found == key.to_string())
    }

    /// Whether the path of a result exists.
    #[must_use]
    pub fn is_taken(&self, key: Key) -> bool {
        self.place(key).exists()
    }

    /// Writes the result of a key, and removes its temporary files of killed processes.
    ///
    /// # Errors
    /// System error; the existing file, if any, is then unchanged.
    pub fn write(&mut self, key: Key, bytes: &[u8]) -> Result<(), FileError> {
        for leftover in self.leftovers.remove(&key.to_string()).into_iter().flatten() {
            // A remaining hidden file is harmless.
            let _ = fs::remove_file(leftover);
        }
        write_atomic(&self.place(key), bytes)
    }

    /// The digest over all results in the folder.
    ///
    /// # Errors
    /// A file cannot be read.
    pub fn digest(&self) -> io::Result<Digest> {
        let mut results: Vec<String> = names(&self.folder)?;
        results.retain(|name| is_result(name));
        results.sort();
        let mut lines = String::new();
        for name in &results {
            let hash = Key::of_file(&self.folder.join(name))?;
            lines.push_str(&format!("{hash}  {name}\n"));
        }
        let sha256 = Key::of_bytes(lines.as_bytes()).to_string();
        Ok(Digest { results: results.len(), sha256 })
    }
}

/// Whether a name is that of a result: a key and the ending.
fn is_result(name: &str) -> bool {
    let is_digit = |c: char| c.is_ascii_digit() || ('a'..='f').contains(&c);
    name.strip_suffix(ENDING).is_some_and(|key| key.len() == 64 && key.chars().all(is_digit))
}

/// Names of the entries of a folder that are valid UTF-8.
fn names(folder: &Path) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        match entry {
            Ok(entry) => names.extend(entry.file_name().into_string().ok()),
            // Another process renamed it meanwhile.
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(error),
        }
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_results_count_in_the_digest_whatever_else_stands_in_the_folder() {
        let folder = std::env::temp_dir().join(format!("trued-store-{}", std::process::id()));
        let mut store = Store::open(&folder).expect("a folder");
        store.write(Key::of_bytes(b"one"), b"a result").expect("written");
        let alone = store.digest().expect("read");
        fs::write(folder.join("theirs.parquet"), "a table").expect("written");
        fs::create_dir(folder.join("spark.parquet")).expect("made");
        assert_eq!(store.digest().expect("read"), alone);
        assert_eq!(alone.results, 1);
        fs::remove_dir_all(&folder).expect("removed");
    }
}
