//! A file that is written under a hidden name and gets its final name when it is complete.

use std::ffi::OsString;
use std::fs::{self, File, Permissions};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use rustix::fs::{CWD, RenameFlags, renameat_with};
use rustix::io::Errno;

/// A hidden file, removed when dropped before it has its final name.
pub(crate) struct Part {
    file: File,
    path: Option<PathBuf>,
    place: PathBuf,
    /// Whether there is no file that it replaces.
    pub(crate) is_new: bool,
}

impl Part {
    /// An empty file in the folder of `place`, under the hidden name `.NAME.PID-N.part`.
    pub(crate) fn create(place: &Path) -> io::Result<Self> {
        let mut hidden = OsString::from(".");
        hidden.push(place.file_name().ok_or(ErrorKind::IsADirectory)?);
        // Processes of several machines or containers may share the folder, with equal process numbers.
        let chance = RandomState::new().build_hasher().finish();
        hidden.push(format!(".{}-{chance:016x}.part", std::process::id()));
        let path = place.with_file_name(hidden);
        let file = File::create_new(&path)?;
        Ok(Self { file, path: Some(path), place: place.to_owned(), is_new: false })
    }

    /// Where the file will be.
    pub(crate) fn place(&self) -> &Path {
        &self.place
    }

    pub(crate) fn set_permissions(&self, permissions: Permissions) -> io::Result<()> {
        self.file.set_permissions(permissions)
    }

    /// Writes and syncs the whole file.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.file.write_all(bytes)?;
        self.file.sync_all()
    }

    /// Gives the file its final name.
    pub(crate) fn finish(mut self) -> io::Result<()> {
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
