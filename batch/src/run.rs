//! Diagnoses the recordings of one shard in turn: existing results are kept, new ones written, failures reported.
//!
//! One recording is in memory at a time. A recording with unusable content gets a result with the reason (a repetition would give the same); one whose
//! files cannot be read gets no result and is tried again by the next run.

use std::io;
use std::path::{Path, PathBuf};

use recording::files::FileError;
use recording::manifest::{Manifest, RecordingEntry, Robot};
use recording::mapping::mapping_path;
use recording::model::presets;
use recording::program;
use recording::series::metadata_path;

use crate::key::{Key, KeyBuilder};
use crate::shard::Shard;
use crate::store::{Digest, Existing, Store};
use crate::table::{self, ResultHeader, Row};

/// A recording to be diagnosed, with resolved paths.
#[derive(Debug, Clone, PartialEq)]
pub struct Item<'a> {
    /// Its robot in the manifest.
    pub robot: &'a Robot,
    /// Its entry in the manifest.
    pub entry: &'a RecordingEntry,
    /// Its files.
    pub files: Vec<PathBuf>,
    /// The robot's model: a file, or the name of a preset.
    pub model: PathBuf,
    /// The robot's mapping, if it has one.
    pub mapping: Option<PathBuf>,
}

/// Why a recording was not diagnosed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DiagnosisError {
    /// Its content cannot be used.
    Refused(String),
    /// System error.
    Unread(String),
}

/// A recording that was not diagnosed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UndiagnosedRecording {
    /// Its files as the manifest names them, joined by `, `.
    pub files: String,
    /// Why.
    pub why: String,
}

/// Result of a shard.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Summary {
    /// Results written.
    pub written: usize,
    /// Existing results kept.
    pub kept: usize,
    /// Of these: recordings that were refused.
    pub refused: Vec<UndiagnosedRecording>,
    /// Recordings without a result.
    pub unread: Vec<UndiagnosedRecording>,
    /// Digest of all results in the folder, of all shards.
    pub digest: Digest,
}

/// Errors that end a batch. Written results remain.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A result exists already.
    #[error(
        "{} already exists, for {files}; keep existing results, recompute them, or use another folder",
        path.display()
    )]
    Exists {
        /// The result.
        path: PathBuf,
        /// The recording.
        files: String,
    },
    /// The folder of results cannot be read.
    #[error("cannot use {} as the folder of results: {source}; give a folder, or a name that is not taken", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The system error.
        source: io::Error,
    },
    /// A result cannot be written.
    #[error(transparent)]
    Write(#[from] FileError),
    /// A result cannot be encoded.
    #[error("a result cannot be encoded as Parquet: {0}")]
    Encode(#[from] parquet::errors::ParquetError),
}

/// A shard of a manifest, and its output folder.
#[derive(Debug, Clone, Copy)]
pub struct Job<'a> {
    /// The recordings.
    pub manifest: &'a Manifest,
    /// The manifest's folder, for relative paths.
    pub base: &'a Path,
    /// The shard.
    pub shard: Shard,
    /// The output folder.
    pub out: &'a Path,
    /// Handling of existing results.
    pub existing: Existing,
}

impl Job<'_> {
    /// Number of recordings of the shard.
    #[must_use]
    pub fn count(&self) -> usize {
        (0..self.manifest.recordings.len()).filter(|place| self.shard.has(*place)).count()
    }
}

/// Diagnoses the recordings of a shard with `diagnose` and writes a result for each; `done` is called after each.
///
/// # Errors
/// See [`RunError`].
pub fn run(
    job: Job<'_>,
    mut diagnose: impl FnMut(&Item<'_>) -> Result<Vec<Row>, DiagnosisError>,
    mut done: impl FnMut(),
) -> Result<Summary, RunError> {
    let folder = |source| RunError::Folder { path: job.out.to_owned(), source };
    let mut store = Store::open(job.out).map_err(folder)?;
    let (mut written, mut kept) = (0, 0);
    let (mut refused, mut unread) = (Vec::new(), Vec::new());
    for (place, entry) in job.manifest.recordings.iter().enumerate() {
        let Some(robot) = job.manifest.robots.get(entry.robot) else { continue };
        if !job.shard.has(place) {
            continue;
        }
        let item = Item::of(job.base, robot, entry);
        match diagnose_one(job, &item, &mut store, &mut diagnose)? {
            Outcome::Written(why) => {
                written += 1;
                refused.extend(why.map(|why| item.undiagnosed(why)));
            }
            Outcome::Kept(why) => {
                kept += 1;
                refused.extend(why.map(|why| item.undiagnosed(why)));
            }
            Outcome::Unread(why) => unread.push(item.undiagnosed(why)),
        }
        done();
    }
    let digest = store.digest().map_err(folder)?;
    Ok(Summary { written, kept, refused, unread, digest })
}

/// Outcome of one recording, with the reason of a refusal.
enum Outcome {
    Written(Option<String>),
    Kept(Option<String>),
    Unread(String),
}

fn diagnose_one(
    job: Job<'_>,
    item: &Item<'_>,
    store: &mut Store,
    diagnose: &mut impl FnMut(&Item<'_>) -> Result<Vec<Row>, DiagnosisError>,
) -> Result<Outcome, RunError> {
    let key = match item.key(job.manifest) {
        Ok(key) => key,
        Err(why) => return Ok(Outcome::Unread(why)),
    };
    if job.existing == Existing::Keep && store.has(key) {
        return Ok(Outcome::Kept(table::refusal(&store.place(key))));
    }
    if job.existing == Existing::Refuse && store.is_taken(key) {
        return Err(RunError::Exists { path: store.place(key), files: item.names() });
    }
    let (rows, why) = match diagnose(item) {
        Ok(rows) => (rows, None),
        Err(DiagnosisError::Refused(why)) => (vec![Row::refused(why.clone())], Some(why)),
        Err(DiagnosisError::Unread(why)) => return Ok(Outcome::Unread(why)),
    };
    let recorded = ResultHeader {
        key,
        version: program::version().to_owned(),
        robot: item.robot.name.clone(),
        serial: item.robot.serial.clone(),
        recorded_at_us: item.entry.recorded_at_us,
        files: item.names(),
        seed: job.manifest.seed,
    };
    store.write(key, &table::to_parquet(&recorded, &rows)?)?;
    Ok(Outcome::Written(why))
}

/// The model of a robot: a file relative to the manifest's folder, otherwise a preset.
#[must_use]
pub fn robot_model_path(base: &Path, robot: &Robot) -> PathBuf {
    let file = base.join(&robot.model);
    let is_preset = !file.is_file() && presets::by_path(&robot.model).is_some();
    if is_preset { robot.model.clone() } else { file }
}

impl<'a> Item<'a> {
    fn of(base: &Path, robot: &'a Robot, entry: &'a RecordingEntry) -> Self {
        Self {
            robot,
            entry,
            files: entry.files.iter().map(|file| base.join(file)).collect(),
            model: robot_model_path(base, robot),
            mapping: robot.mapping.as_ref().map(|mapping| base.join(mapping)),
        }
    }

    /// Its files as the manifest names them.
    #[must_use]
    pub fn names(&self) -> String {
        self.entry.files.join(", ")
    }

    /// A message with each path as in the manifest.
    #[must_use]
    pub fn as_named(&self, text: &str) -> String {
        let files = self.files.iter().zip(self.entry.files.iter().map(String::as_str));
        let model = self.robot.model.to_str().map(|name| (&self.model, name));
        let mapping = self.mapping.as_ref().zip(self.robot.mapping.as_ref());
        let mapping = mapping.and_then(|(path, name)| Some((path, name.to_str()?)));
        let named = files.chain(model).chain(mapping);
        named.fold(text.to_owned(), |text, (path, name)| {
            text.replace(&path.display().to_string(), name)
        })
    }

    fn undiagnosed(&self, why: String) -> UndiagnosedRecording {
        UndiagnosedRecording { files: self.names(), why }
    }

    /// The key of its result: over its entry in the manifest, the content of all files that are read for it, the settings, and the program version.
    ///
    /// # Errors
    /// Which file cannot be read, and why.
    pub fn key(&self, manifest: &Manifest) -> Result<Key, String> {
        let unread = |path: &Path| {
            let path = path.display().to_string();
            move |source| format!("cannot read {path}: {source}")
        };
        let time = self.entry.recorded_at_us.map(i64::to_le_bytes);
        let band = manifest.band_hz.map(|hz| hz.to_bits().to_le_bytes());
        let mut key = KeyBuilder::of(table::SCHEMA)
            .part("version", program::version().as_bytes())
            .part("seed", &manifest.seed.to_le_bytes())
            .optional_part("band", band.as_ref().map(|bytes| &bytes[..]))
            .part("robot", self.robot.name.as_bytes())
            .part("model's name", self.robot.model.as_os_str().as_encoded_bytes())
            .optional_part("serial", self.robot.serial.as_ref().map(String::as_bytes))
            .optional_part("recorded at", time.as_ref().map(|bytes| &bytes[..]));
        key = if presets::by_path(&self.model).is_some() && !self.model.is_file() {
            key.part("preset", self.model.as_os_str().as_encoded_bytes())
        } else {
            key.file("model", &self.model).map_err(unread(&self.model))?
        };
        if let (Some(mapping), Some(name)) = (&self.mapping, &self.robot.mapping) {
            key = key.part("mapping's name", name.as_os_str().as_encoded_bytes());
            key = key.file("mapping", mapping).map_err(unread(mapping))?;
        }
        for (name, path) in self.entry.files.iter().zip(&self.files) {
            key = key.part("name", name.as_bytes());
            key = key.file("recording", path).map_err(unread(path))?;
            let beside = self.mapping.is_none().then(|| mapping_path(path));
            for companion in [Some(metadata_path(path)), beside].into_iter().flatten() {
                key = if companion.is_file() {
                    key.file("beside", &companion).map_err(unread(&companion))?
                } else {
                    key.optional_part("beside", None)
                };
            }
        }
        Ok(key.finish())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn manifest(model: &str) -> Manifest {
        let text = format!(
            "schema = \"trued.manifest/1\"\n[[robot]]\nname = \"A\"\nmodel = \"{model}\"\n\
             [[recording]]\nrobot = \"A\"\nfiles = [\"a.csv\"]\n"
        );
        Manifest::parse("m.toml", &text).expect("a manifest")
    }

    #[test]
    fn a_name_that_stands_in_a_result_is_part_of_its_key() {
        let folder = std::env::temp_dir().join(format!("trued-run-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("made");
        for name in ["one.toml", "other.toml", "a.csv"] {
            std::fs::write(folder.join(name), "the same").expect("written");
        }
        let key = |model: &str| {
            let manifest = manifest(model);
            let (robot, entry) = (&manifest.robots[0], &manifest.recordings[0]);
            let item = Item::of(&folder, robot, entry);
            let text = format!("{} and {}", item.model.display(), item.files[0].display());
            assert_eq!(item.as_named(&text), format!("{model} and a.csv"));
            item.key(&manifest).expect("a key")
        };
        assert_eq!(key("one.toml"), key("one.toml"));
        assert_ne!(key("one.toml"), key("other.toml"), "refusals name the model");
        std::fs::remove_dir_all(&folder).expect("removed");
    }
}
