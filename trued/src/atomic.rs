//! Files that appear whole, under their name, or not at all.
//!
//! Written beside their place under a hidden name, synced, then renamed. After a crash a hidden `.NAME.PID.part` may be
//! left, never half a file under the name. What is no ordinary file (a pipe, `/dev/null`) is written as it comes.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::exit::Failure;

/// A file could not be written; nothing stands under its name that did not before.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}; check that its directory exists, is writable, and has room", path.display())]
pub struct WriteError {
    /// The file that was to be.
    pub path: PathBuf,
    /// What the system said.
    pub source: io::Error,
}

impl From<WriteError> for Failure {
    fn from(error: WriteError) -> Self {
        let kind = error.source.kind();
        let misnamed = [ErrorKind::NotFound, ErrorKind::NotADirectory, ErrorKind::IsADirectory];
        if misnamed.contains(&kind) { Self::input(error) } else { Self::system(error) }
    }
}

/// Writes what `fill` writes to `path`, whole or not at all; replaces what was there, keeps its permissions, and follows
/// links.
///
/// # Errors
///
/// [`WriteError`] with what the system said, or what `fill` returned.
pub fn write(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), WriteError> {
    replace(path, fill).map_err(|source| WriteError { path: path.to_owned(), source })
}

/// Whether [`write()`] could begin now: for what takes long before there is anything to write.
///
/// # Errors
///
/// [`WriteError`] as [`write()`] would.
pub fn check(path: &Path) -> Result<(), WriteError> {
    let tried = match fs::metadata(path) {
        Ok(before) if before.is_dir() => Err(ErrorKind::IsADirectory.into()),
        Ok(before) if !before.is_file() => File::options().write(true).open(path).map(drop),
        Ok(_) => fs::canonicalize(path).and_then(|place| Part::create(&place).map(drop)),
        Err(error) if error.kind() == ErrorKind::NotFound => Part::create(path).map(drop),
        Err(error) => Err(error),
    };
    tried.map_err(|source| WriteError { path: path.to_owned(), source })
}

fn replace(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let before = match fs::metadata(path) {
        Ok(before) => Some(before),
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        Err(error) => return Err(error),
    };
    if before.as_ref().is_some_and(fs::Metadata::is_dir) {
        return Err(ErrorKind::IsADirectory.into());
    }
    if before.as_ref().is_some_and(|before| !before.is_file()) {
        let mut out = BufWriter::new(File::options().write(true).open(path)?);
        fill(&mut out)?;
        return out.flush();
    }
    let place = if before.is_some() { fs::canonicalize(path)? } else { path.to_owned() };
    let part = Part::create(&place)?;
    let mut out = BufWriter::new(&part.file);
    fill(&mut out)?;
    out.flush()?;
    drop(out);
    if let Some(before) = before {
        part.file.set_permissions(before.permissions())?;
    }
    part.file.sync_all()?;
    part.finish(&place)
}

/// The file in the making; removed when dropped unfinished.
struct Part {
    file: File,
    path: Option<PathBuf>,
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
                Ok(file) => return Ok(Self { file, path: Some(path) }),
                Err(error) if error.kind() == ErrorKind::AlreadyExists && attempt < 100 => {}
                Err(error) => return Err(error),
            }
        }
        Err(ErrorKind::AlreadyExists.into())
    }

    fn finish(mut self, place: &Path) -> io::Result<()> {
        if let Some(path) = &self.path {
            fs::rename(path, place)?;
        }
        self.path = None;
        let directory = place.parent().filter(|parent| !parent.as_os_str().is_empty());
        File::open(directory.unwrap_or(Path::new(".")))?.sync_all()
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        if let Some(path) = &self.path {
            // Nothing better can be done here: the error that led here is on its way to the user.
            let _ = fs::remove_file(path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A directory of the test's own, gone afterwards.
    struct Place(PathBuf);

    impl Place {
        fn new(name: &str) -> Self {
            let path = std::env::temp_dir().join(format!("trued-{name}-{}", std::process::id()));
            fs::create_dir_all(&path).expect("a directory");
            Self(path)
        }

        fn names(&self) -> Vec<OsString> {
            let entries = fs::read_dir(&self.0).expect("readable");
            entries.map(|entry| entry.expect("entry").file_name()).collect()
        }
    }

    impl Drop for Place {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn a_file_appears_whole_and_alone() {
        let place = Place::new("whole");
        write(&place.0.join("a.json"), |out| out.write_all(b"{}")).expect("written");
        assert_eq!(fs::read(place.0.join("a.json")).expect("read"), b"{}");
        assert_eq!(place.names(), ["a.json"]);
    }

    #[test]
    fn what_could_not_be_written_is_known_before_and_asking_leaves_nothing() {
        let place = Place::new("check");
        check(&place.0.join("a.json")).expect("can be made");
        assert!(place.names().is_empty());
        fs::write(place.0.join("a.json"), "{}").expect("written");
        check(&place.0.join("a.json")).expect("can be replaced");
        assert_eq!(place.names(), ["a.json"]);
        assert!(check(&place.0).is_err() && check(&place.0.join("none/a.json")).is_err());
        assert!(check(&place.0.join("a.json/b.json")).is_err(), "below a file");
    }

    #[test]
    fn a_failure_leaves_what_was_there() {
        let place = Place::new("failure");
        let path = place.0.join("a.json");
        fs::write(&path, "before").expect("written");
        let failed = write(&path, |out| {
            out.write_all(&[b'x'; 100_000])?;
            Err(ErrorKind::StorageFull.into())
        });
        assert!(matches!(Failure::from(failed.expect_err("fails")), Failure::System(_)));
        assert_eq!(fs::read(&path).expect("read"), b"before");
        assert_eq!(place.names(), ["a.json"]);
    }

    #[test]
    fn a_device_is_written_to_and_never_replaced() {
        write(Path::new("/dev/null"), |out| out.write_all(b"gone")).expect("written");
        assert!(!fs::metadata("/dev/null").expect("there").is_file());
    }

    #[test]
    fn a_link_stays_a_link_and_permissions_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let place = Place::new("link");
        let (file, link) = (place.0.join("file"), place.0.join("link"));
        fs::write(&file, "before").expect("written");
        fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).expect("set");
        symlink(&file, &link).expect("linked");
        write(&link, |out| out.write_all(b"after")).expect("written");
        assert_eq!(fs::read(&file).expect("read"), b"after");
        assert_eq!(fs::metadata(&file).expect("there").permissions().mode() & 0o777, 0o600);
        assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
    }

    #[test]
    fn a_missing_directory_is_bad_input() {
        let failed = write(Path::new("/nowhere/at/all.json"), |_| Ok(())).expect_err("fails");
        assert!(failed.to_string().starts_with("cannot write /nowhere/at/all.json"));
        assert!(matches!(Failure::from(failed), Failure::Input(_)));
    }
}
