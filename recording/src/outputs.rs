//! Writes all output files of a program run or none, and never overwrites a user's file.
//!
//! A file that exists and is not empty is refused, unless it is a result that trued can reproduce
//! (see [`is_result`]) or replacing was allowed. Each file is written under a hidden name in the
//! target directory and synced; once all are complete they are renamed. After a failure (a full
//! disk, say) everything created is removed, directories included. A crash may leave hidden
//! `.NAME.PID-N.part` files, but never an incomplete file under its final name. Special files (a
//! pipe, `/dev/null`) are written directly.
//!
//! ```
//! use recording::outputs::Outputs;
//!
//! # fn main() -> Result<(), recording::outputs::WriteError> {
//! let folder = std::env::temp_dir().join(format!("outputs-{}", std::process::id()));
//! let model = folder.join("model.toml");
//! let mut outputs = Outputs::new(false).in_folder(&folder).file(&model);
//! outputs.check([])?;
//! // Here the long computation.
//! outputs.put(&model, "name = \"arm\"\n");
//! outputs.write()?;
//! assert!(model.is_file());
//! # std::fs::remove_dir_all(&folder).ok();
//! # Ok(())
//! # }
//! ```

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::files::referenced_model;
use crate::mapping::mapping_path;
use crate::partial_file::Part;
use crate::program::MADE_BY;
use crate::series::metadata_path;

/// Files of one command have modification times within this span; a file changed later was edited.
const WRITTEN_TOGETHER: Duration = Duration::from_secs(2);
/// Number of bytes at the start of a file within which a result must name trued as its author.
const HEAD: u64 = 1024;

/// Why no file was written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The system refused.
    #[error("cannot write {}: {source}; check that its folder exists and is writable, and that the disk is not full", path.display())]
    Io {
        /// The file to be written.
        path: PathBuf,
        /// The operating system's error.
        source: io::Error,
    },
    /// The file exists.
    #[error("{} already exists; nothing was written. Choose another name, or permit it to be replaced", .0.display())]
    Exists(PathBuf),
    /// An input would be overwritten; refused even with `--overwrite`.
    #[error("{}: the output would overwrite an input file; choose another name", .0.display())]
    Input(PathBuf),
    /// Two outputs have one name.
    #[error("{} is given for two outputs; choose different names", .0.display())]
    Twice(PathBuf),
}

fn failed(path: &Path) -> impl Fn(io::Error) -> WriteError {
    move |source| WriteError::Io { path: path.to_owned(), source }
}

/// The output files of one run.
#[derive(Debug, Default)]
pub struct Outputs {
    may_replace: bool,
    folder: Option<PathBuf>,
    files: Vec<Output>,
    /// Paths of the run's inputs.
    inputs: BTreeSet<PathBuf>,
}

#[derive(Debug, Default)]
struct Output {
    path: PathBuf,
    is_result: bool,
    bytes: Option<Vec<u8>>,
}

impl Outputs {
    /// No file yet; with `may_replace` (`--overwrite`) every file may be replaced, except inputs.
    #[must_use]
    pub fn new(may_replace: bool) -> Self {
        Self { may_replace, ..Self::default() }
    }

    /// Sets the directory of the files, which is created if it is missing.
    #[must_use]
    pub fn in_folder(mut self, folder: &Path) -> Self {
        self.folder = Some(folder.to_owned());
        self
    }

    /// Declares an output file, so that [`Outputs::check`] verifies it.
    #[must_use]
    pub fn file(self, path: impl Into<PathBuf>) -> Self {
        self.with(Output { path: path.into(), ..Output::default() })
    }

    /// Declares a result that every run reproduces: JSON, a page, a plot. It may replace an
    /// earlier one.
    #[must_use]
    pub fn result(self, path: impl Into<PathBuf>) -> Self {
        self.with(Output { path: path.into(), is_result: true, ..Output::default() })
    }

    fn with(mut self, output: Output) -> Self {
        self.files.push(output);
        self
    }

    /// Sets the content of a file. A file without content is not written; an undeclared file is an
    /// ordinary one.
    pub fn put(&mut self, path: &Path, bytes: impl Into<Vec<u8>>) {
        let bytes = Some(bytes.into());
        match self.files.iter_mut().find(|file| file.path == path) {
            Some(file) => file.bytes = bytes,
            None => self.files.push(Output { path: path.to_owned(), bytes, ..Output::default() }),
        }
    }

    /// Checks, before a long computation, that all outputs can be written and that none is an
    /// input: one of `inputs`, the TOML or mapping beside it, or the model that such a TOML names.
    /// Leaves no files behind. Returns the paths of the inputs that were not checked before,
    /// including those that belong to them.
    ///
    /// # Errors
    /// As [`Outputs::write`].
    pub fn check<'a>(
        &mut self,
        inputs: impl IntoIterator<Item = &'a PathBuf>,
    ) -> Result<Vec<PathBuf>, WriteError> {
        let named = inputs.into_iter().flat_map(|input| with_companions(input));
        let new: Vec<PathBuf> = named.filter(|input| self.inputs.insert(input.clone())).collect();
        let mut places = BTreeSet::new();
        for output in &self.files {
            let path = &output.path;
            if self.allowed(output)? == TargetState::Stream {
                continue;
            }
            if !places.insert(place(path)) {
                return Err(WriteError::Twice(path.clone()));
            }
            Part::create(&self.probe(path)).map_err(failed(path))?;
        }
        Ok(new)
    }

    /// The existing file at an output's path, if the output may replace it.
    fn allowed(&self, Output { path, is_result, .. }: &Output) -> Result<TargetState, WriteError> {
        let state = state(path).map_err(failed(path))?;
        if matches!(state, TargetState::Stream | TargetState::Missing) {
            return Ok(state);
        }
        if self.inputs.contains(&place(path)) {
            return Err(WriteError::Input(path.clone()));
        }
        let may_go = self.may_replace || (*is_result && self::is_result(path));
        if state == TargetState::Full && !may_go {
            return Err(WriteError::Exists(path.clone()));
        }
        Ok(state)
    }

    /// Where to test that `path` can be written: in the nearest existing directory, if its own will
    /// be created later.
    fn probe(&self, path: &Path) -> PathBuf {
        match &self.folder {
            Some(folder) if path.starts_with(folder) && !folder_of(path).exists() => {
                let above = folder_of(path).ancestors().find(|above| above.exists());
                above.unwrap_or(Path::new(".")).join(path.file_name().unwrap_or_default())
            }
            _ => place(path),
        }
    }

    /// Writes all files that have content, or none.
    ///
    /// # Errors
    /// A file that exists, a directory that does not, or an error of the operating system.
    pub fn write(mut self) -> Result<(), WriteError> {
        self.check([])?;
        let folder = self.folder.as_deref().map(Folder::make).transpose()?;
        let (mut parts, mut streams) = (Vec::new(), Vec::new());
        for output in &self.files {
            let (path, Some(bytes)) = (&output.path, &output.bytes) else { continue };
            match self.allowed(output)? {
                TargetState::Stream => streams.push((path, bytes)),
                state => {
                    let is_new = state == TargetState::Missing;
                    parts.push(written_part(path, bytes, is_new).map_err(failed(path))?);
                }
            }
        }
        for (path, bytes) in streams {
            let file = File::options().write(true).open(path);
            file.and_then(|mut file| file.write_all(bytes)).map_err(failed(path))?;
        }
        finish(parts)?;
        folder.into_iter().for_each(Folder::keep);
        Ok(())
    }
}

/// The whole file under its hidden name, with the permissions of the file that it replaces.
fn written_part(path: &Path, bytes: &[u8], is_new: bool) -> io::Result<Part> {
    let mut part = Part::create(&place(path))?;
    part.is_new = is_new;
    if let Ok(before) = fs::metadata(path) {
        part.set_permissions(before.permissions())?;
    }
    part.write(bytes)?;
    Ok(part)
}

/// Renames all temporary files; if one fails, newly created ones are removed again.
fn finish(parts: Vec<Part>) -> Result<(), WriteError> {
    let (mut made, mut folders) = (Vec::new(), BTreeSet::new());
    for part in parts {
        let (place, is_new) = (part.place().to_owned(), part.is_new);
        if let Err(source) = part.finish() {
            for path in made {
                // The error that led here is the one to report.
                let _ = fs::remove_file(path);
            }
            return Err(match source.kind() {
                ErrorKind::AlreadyExists => WriteError::Exists(place),
                _ => WriteError::Io { path: place, source },
            });
        }
        folders.insert(folder_of(&place).to_owned());
        if is_new {
            made.push(place);
        }
    }
    let synced = |folder: &PathBuf| {
        File::open(folder).and_then(|folder| folder.sync_all()).map_err(failed(folder))
    };
    folders.iter().try_for_each(synced)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum TargetState {
    Missing,
    Empty,
    Full,
    /// Not a regular file, such as a pipe.
    Stream,
}

fn state(path: &Path) -> io::Result<TargetState> {
    match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => Err(ErrorKind::IsADirectory.into()),
        Ok(metadata) if !metadata.is_file() => Ok(TargetState::Stream),
        Ok(metadata) if metadata.len() == 0 => Ok(TargetState::Empty),
        Ok(_) => Ok(TargetState::Full),
        // A dangling symbolic link is refused.
        Err(error) if fs::symlink_metadata(path).is_ok() => Err(error),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(TargetState::Missing),
        Err(error) => Err(error),
    }
}

/// An input, its companion files by name, and the models that these TOML files name. A recording of
/// the daemon has no companions.
fn with_companions(input: &Path) -> Vec<PathBuf> {
    if input.extension().is_some_and(|end| end.eq_ignore_ascii_case("mcap")) {
        // A recording of the daemon stands alone: what is called like it may be made from it.
        return vec![place(input)];
    }
    let mut all = vec![input.to_owned(), metadata_path(input), mapping_path(input)];
    let models: Vec<PathBuf> = all.iter().filter_map(|path| referenced_model(path)).collect();
    all.extend(models);
    all.iter().map(|path| place(path)).collect()
}

/// The canonical path of a file, or the given path if it does not exist.
fn place(path: &Path) -> PathBuf {
    let canonical = fs::canonicalize(path).or_else(|_| {
        let name = path.file_name().ok_or(ErrorKind::IsADirectory)?;
        Ok::<_, io::Error>(fs::canonicalize(folder_of(path))?.join(name))
    });
    canonical.unwrap_or_else(|_| path.to_owned())
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether trued made this JSON, page or plot: its first lines say so, and another run reproduces
/// its content. This includes the `model.toml` beside a `diagnosis.json`, unless it was edited
/// since.
#[must_use]
pub fn is_result(path: &Path) -> bool {
    if path.file_name().is_some_and(|name| name == "model.toml") {
        let diagnosis = path.with_file_name("diagnosis.json");
        return is_result(&diagnosis) && is_as_old(path, &diagnosis);
    }
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut head));
    let head = String::from_utf8_lossy(&head);
    let json = head.trim_start().strip_prefix('{').map(str::trim_start);
    let is_json = json.is_some_and(|json| json.starts_with("\"schema\": \"trued."));
    read.is_ok() && (is_json || head.contains(MADE_BY))
}

/// Whether a file was not changed after another that was written with it.
fn is_as_old(path: &Path, beside: &Path) -> bool {
    let changed = |path| fs::metadata(path).and_then(|metadata| metadata.modified()).ok();
    let later = changed(path).zip(changed(beside));
    later.is_some_and(|(path, beside)| path <= beside + WRITTEN_TOGETHER)
}

/// A created folder with its created parents; they are removed when dropped, unless kept.
struct Folder(Vec<PathBuf>);

impl Folder {
    fn make(folder: &Path) -> Result<Self, WriteError> {
        let missing =
            folder.ancestors().take_while(|above| !above.as_os_str().is_empty() && !above.exists());
        let made = Self(missing.map(Path::to_owned).collect());
        fs::create_dir_all(folder).map_err(failed(folder))?;
        Ok(made)
    }

    fn keep(mut self) {
        self.0.clear();
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        for folder in &self.0 {
            // A folder into which others have written meanwhile stays.
            let _ = fs::remove_dir(folder);
        }
    }
}

#[cfg(test)]
mod tests;
