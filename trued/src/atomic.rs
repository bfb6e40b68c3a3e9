//! Writes all output files of a command or none, and never overwrites a user's file.
//!
//! A file that exists and is not empty is refused, unless it is a result that trued can reproduce
//! (see [`is_result`]) or `--overwrite` is given. Each file is written under a hidden name in the
//! target directory and synced; once all are complete they are renamed. After a failure (a full
//! disk, say) everything created is removed, directories included. A crash may leave hidden
//! `.NAME.PID-N.part` files, but never an incomplete file under its final name. Special files (a
//! pipe, `/dev/null`) are written directly.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use recording::files::named_model;
use recording::mapping::mapping_path;
use recording::series::about_path;
use report::InputFile;
use rustix::fs::{CWD, RenameFlags, renameat_with};
use rustix::io::Errno;

use crate::exit::Failure;
use crate::provenance::{self, Invocation};

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
        /// The file that was to be.
        path: PathBuf,
        /// The operating system's error.
        source: io::Error,
    },
    /// Something is there.
    #[error("{} already exists; nothing was written. Choose another name, or use --overwrite to replace it", .0.display())]
    Exists(PathBuf),
    /// An input would be lost, `--overwrite` or not.
    #[error("{}: the output would overwrite an input file; choose another name", .0.display())]
    Input(PathBuf),
    /// Two outputs have one name.
    #[error("{} is given for two outputs; choose different names", .0.display())]
    Twice(PathBuf),
}

impl From<WriteError> for Failure {
    fn from(error: WriteError) -> Self {
        let misnamed = [ErrorKind::NotFound, ErrorKind::NotADirectory, ErrorKind::IsADirectory];
        match &error {
            WriteError::Io { source, .. } if !misnamed.contains(&source.kind()) => {
                Self::system(error)
            }
            _ => Self::input(error),
        }
    }
}

fn failed(path: &Path) -> impl Fn(io::Error) -> WriteError {
    move |source| WriteError::Io { path: path.to_owned(), source }
}

/// The files of one command.
#[derive(Debug, Default)]
pub struct Outputs {
    may_replace: bool,
    folder: Option<PathBuf>,
    files: Vec<Output>,
    /// Paths of the command's inputs.
    inputs: BTreeSet<PathBuf>,
    /// The program run that is stated on the pages.
    invocation: Invocation,
    /// What was read, as its pages name it.
    read: Vec<InputFile>,
}

#[derive(Debug, Default)]
struct Output {
    path: PathBuf,
    is_result: bool,
    is_page: bool,
    bytes: Option<Vec<u8>>,
}

impl Outputs {
    /// No file yet; `may_replace` is `--overwrite`.
    #[must_use]
    pub fn new(may_replace: bool) -> Self {
        Self { may_replace, ..Self::default() }
    }

    /// Sets the program run that is stated on the pages among the outputs.
    #[must_use]
    pub fn of(self, invocation: Invocation) -> Self {
        Self { invocation, ..self }
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

    /// Announces a result that every run reproduces: JSON, a page, a plot. It may replace an
    /// earlier one.
    #[must_use]
    pub fn result(self, path: impl Into<PathBuf>) -> Self {
        self.with(Output { path: path.into(), is_result: true, ..Output::default() })
    }

    /// Announces a page, which is a result; the files that are read are then hashed by [`Outputs::check`], before anything is computed of them.
    #[must_use]
    pub fn page(self, path: impl Into<PathBuf>) -> Self {
        self.with(Output { path: path.into(), is_result: true, is_page: true, bytes: None })
    }

    /// Announces optional results.
    #[must_use]
    pub fn pages<'a>(self, paths: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        paths.into_iter().fold(self, Self::page)
    }

    fn with(mut self, output: Output) -> Self {
        self.files.push(output);
        self
    }

    /// Sets the content of a page, including the section that states how it was made.
    pub fn put_page(&mut self, path: &Path, page: report::Page) {
        let made = self.invocation.provenance(self.read.clone());
        self.put(path, page.provenance(made).render());
        if let Some(file) = self.files.iter_mut().find(|file| file.path == path) {
            file.is_page = true;
        }
    }

    /// Pages that have their content.
    pub(crate) fn written_pages(&self) -> impl Iterator<Item = PathBuf> + '_ {
        let pages = self.files.iter().filter(|file| file.is_page && file.bytes.is_some());
        pages.map(|file| file.path.clone())
    }

    /// Sets the content of a file. A file without content is not written; an unannounced file is an
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
    /// Leaves no files behind.
    ///
    /// # Errors
    /// As [`Outputs::write`].
    pub fn check<'a>(
        &mut self,
        inputs: impl IntoIterator<Item = &'a PathBuf>,
    ) -> Result<(), WriteError> {
        let named = inputs.into_iter().flat_map(|input| with_companions(input));
        let new: Vec<PathBuf> = named.filter(|input| self.inputs.insert(input.clone())).collect();
        if self.files.iter().any(|file| file.is_page) {
            self.read.extend(new.iter().filter_map(|input| provenance::hashed(input)));
        }
        let mut places = BTreeSet::new();
        for output in &self.files {
            let path = &output.path;
            if self.allowed(output)? == State::Stream {
                continue;
            }
            if !places.insert(place(path)) {
                return Err(WriteError::Twice(path.clone()));
            }
            Part::create(&self.probe(path)).map_err(failed(path))?;
        }
        Ok(())
    }

    /// The existing file at an output's path, if the output may replace it.
    fn allowed(&self, Output { path, is_result, .. }: &Output) -> Result<State, WriteError> {
        let there = state(path).map_err(failed(path))?;
        if matches!(there, State::Stream | State::Missing) {
            return Ok(there);
        }
        if self.inputs.contains(&place(path)) {
            return Err(WriteError::Input(path.clone()));
        }
        let may_go = self.may_replace || (*is_result && self::is_result(path));
        if there == State::Full && !may_go {
            return Err(WriteError::Exists(path.clone()));
        }
        Ok(there)
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
                State::Stream => streams.push((path, bytes)),
                there => {
                    let is_new = there == State::Missing;
                    parts.push(Part::written(path, bytes, is_new).map_err(failed(path))?);
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

/// Renames all temporary files; if one fails, newly created ones are removed again.
fn finish(parts: Vec<Part>) -> Result<(), WriteError> {
    let (mut made, mut folders) = (Vec::new(), BTreeSet::new());
    for part in parts {
        let (place, is_new) = (part.place.clone(), part.is_new);
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
enum State {
    Missing,
    Empty,
    Full,
    /// No ordinary file.
    Stream,
}

fn state(path: &Path) -> io::Result<State> {
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => Err(ErrorKind::IsADirectory.into()),
        Ok(there) if !there.is_file() => Ok(State::Stream),
        Ok(there) if there.len() == 0 => Ok(State::Empty),
        Ok(_) => Ok(State::Full),
        // A link that leads nowhere is no place for a file.
        Err(error) if fs::symlink_metadata(path).is_ok() => Err(error),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(State::Missing),
        Err(error) => Err(error),
    }
}

/// An input, its companion files by name, and the models that these TOML files name.
fn with_companions(input: &Path) -> Vec<PathBuf> {
    let mut all = vec![input.to_owned(), about_path(input), mapping_path(input)];
    let models: Vec<PathBuf> = all.iter().filter_map(|path| named_model(path)).collect();
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
    read.is_ok() && (is_json || head.contains(report::MADE_BY))
}

/// Whether a file was not changed after another that was written with it.
fn is_as_old(path: &Path, beside: &Path) -> bool {
    let changed = |path| fs::metadata(path).and_then(|there| there.modified()).ok();
    let later = changed(path).zip(changed(beside));
    later.is_some_and(|(path, beside)| path <= beside + WRITTEN_TOGETHER)
}

/// A file in the making; removed when dropped unfinished.
struct Part {
    file: File,
    path: Option<PathBuf>,
    place: PathBuf,
    /// Nothing is there that it replaces.
    is_new: bool,
}

impl Part {
    fn create(place: &Path) -> io::Result<Self> {
        let name = place.file_name().ok_or(ErrorKind::IsADirectory)?;
        for attempt in 0.. {
            let mut hidden = OsString::from(".");
            hidden.push(name);
            hidden.push(format!(".{}-{attempt}.part", std::process::id()));
            let path = place.with_file_name(hidden);
            match File::create_new(&path) {
                Ok(file) => {
                    let place = place.to_owned();
                    return Ok(Self { file, path: Some(path), place, is_new: true });
                }
                Err(error) if error.kind() == ErrorKind::AlreadyExists && attempt < 100 => {}
                Err(error) => return Err(error),
            }
        }
        Err(ErrorKind::AlreadyExists.into())
    }

    /// Writes and syncs the whole file, with the permissions of the file that it replaces.
    fn written(path: &Path, bytes: &[u8], is_new: bool) -> io::Result<Self> {
        let mut part = Self::create(&place(path))?;
        part.is_new = is_new;
        if let Ok(before) = fs::metadata(path) {
            part.file.set_permissions(before.permissions())?;
        }
        part.file.write_all(bytes)?;
        part.file.sync_all()?;
        Ok(part)
    }

    fn finish(mut self) -> io::Result<()> {
        if let Some(path) = &self.path {
            rename(path, &self.place, self.is_new)?;
        }
        self.path = None;
        Ok(())
    }
}

/// Renames; a new file replaces no file that was created in the meantime, as far as the file system
/// can guarantee it.
fn rename(from: &Path, to: &Path, is_new: bool) -> io::Result<()> {
    if is_new {
        match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
            Err(Errno::INVAL | Errno::NOSYS | Errno::NOTSUP) => {}
            renamed => return Ok(renamed?),
        }
    }
    fs::rename(from, to)
}

impl Drop for Part {
    fn drop(&mut self) {
        if let Some(path) = &self.path {
            // Nothing more can be done here: the error that led here is reported to the user.
            let _ = fs::remove_file(path);
        }
    }
}

/// A folder and those above it that were missing; they go again when dropped, unless they are kept.
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
            // What others have put there meanwhile stays, and the folder with it.
            let _ = fs::remove_dir(folder);
        }
    }
}

#[cfg(test)]
mod tests;
