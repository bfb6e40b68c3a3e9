//! Location of a cell's domain: one directory on tmpfs, and names in `/dev/shm` with a common prefix.
//!
//! ```text
//! /dev/shm/trued-CELL/            or $TRUED_RUNTIME_DIR/trued-CELL/    0700, the daemon's user
//!     current                     present epoch, and versions of both sides
//!     daemon.lock                 held by the daemon while it lives
//!     cell.lock  force.lock  instrument.lock   held by the one client of that role
//!     knock                       a client cannot connect and requests a new epoch
//!     EPOCH/                      the transport's files of one epoch
//! /dev/shm/trued.CELL.PLACE.EPOCH.*    the transport's memory of one epoch
//! ```

use std::fs;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use super::error::DomainError;
use super::lock::is_held;
use crate::layout::hash_text;

/// Environment variable: another directory on tmpfs instead of `/dev/shm`.
pub const RUNTIME_DIR_ENV: &str = "TRUED_RUNTIME_DIR";

pub(crate) const SHARED_MEMORY: &str = "/dev/shm";
/// Longest path that the transport supports, including its own names; it panics beyond.
const PATH_BYTES_MAX: usize = 255;
/// Length of such a path without the cell's directory and name: `/EPOCH/trued..PLACE.EPOCH.`, then the transport's
/// own `HASH_ID_ID.connection` with a hash of 40 digits and two numbers of 128 bits.
const TRANSPORT_BYTES_MAX: usize = 1 + 16 + 1 + 6 + 1 + 8 + 1 + 16 + 1 + 40 + 1 + 39 + 1 + 39 + 11;
/// Required free shared memory: several times what all services of a cell take.
const FREE_BYTES_MIN: u64 = 16 << 20;
const NAME_BYTES_MAX: usize = 24;
const TMPFS_MAGIC: i64 = 0x0102_1994;
const RAMFS_MAGIC: i64 = 0x8584_58f6;

/// A cell installation: its name and its directory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cell {
    name: String,
    dir: PathBuf,
}

impl Cell {
    /// The cell of that name, under `$TRUED_RUNTIME_DIR` or `/dev/shm`.
    ///
    /// # Errors
    /// [`DomainError::BadName`] unless the name is 1 to 24 of `a-z 0-9 -`;
    /// [`DomainError::BadDirectory`] where the directory's path is relative or too long.
    pub fn new(name: &str) -> Result<Self, DomainError> {
        Self::at(&default_root(), name)
    }

    /// This user's cells that a daemon serves now, by name, under `$TRUED_RUNTIME_DIR` or `/dev/shm`.
    #[must_use]
    pub fn served() -> Vec<Self> {
        let root = default_root();
        let cells = entries(&root)
            .filter_map(|(name, _)| Self::at(&root, name.strip_prefix("trued-")?).ok());
        let is_served =
            |cell: &Self| cell.check_owner().is_ok() && is_held(&cell.file("daemon.lock"));
        let mut served: Vec<_> = cells.filter(is_served).collect();
        served.sort_by(|one, other| one.name.cmp(&other.name));
        served
    }

    /// The cell of that name under `root`, which must be on tmpfs.
    ///
    /// # Errors
    /// As [`Cell::new`].
    pub fn at(root: &Path, name: &str) -> Result<Self, DomainError> {
        let allowed = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
        if name.is_empty() || name.len() > NAME_BYTES_MAX || !name.bytes().all(allowed) {
            return Err(DomainError::BadName { name: name.to_owned() });
        }
        let dir = root.join(format!("trued-{name}"));
        let length = dir.as_os_str().len();
        let limit = PATH_BYTES_MAX - TRANSPORT_BYTES_MAX - name.len();
        if !root.is_absolute() || length > limit || dir.to_str().is_none() {
            return Err(DomainError::BadDirectory { dir, limit });
        }
        Ok(Self { name: name.to_owned(), dir })
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its directory.
    #[must_use]
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.dir.join(name)
    }

    pub(crate) fn epoch_dir(&self, epoch: u64) -> PathBuf {
        self.dir.join(format!("{epoch:016x}"))
    }

    /// Prefix of all names of this cell in `/dev/shm`; includes a hash of the directory, because two
    /// installations may use one name in two directories.
    #[must_use]
    pub fn shared_memory_prefix(&self) -> String {
        let place = hash_text(&self.dir.to_string_lossy()) as u32;
        format!("trued.{}.{place:08x}.", self.name)
    }

    pub(crate) fn epoch_prefix(&self, epoch: u64) -> String {
        format!("{}{epoch:016x}.", self.shared_memory_prefix())
    }

    /// Creates the directory, and checks that it belongs to this user, is private and on tmpfs.
    pub(crate) fn make_dir(&self) -> Result<(), DomainError> {
        let io = |source| DomainError::io("create the directory", &self.dir, source);
        match fs::DirBuilder::new().mode(0o700).create(&self.dir) {
            Ok(()) => {}
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(e) => return Err(io(e)),
        }
        if self.is_readable_by_others() {
            let closed = fs::Permissions::from_mode(0o700);
            fs::set_permissions(&self.dir, closed).map_err(io)?;
        }
        self.check_owner()?;
        let fs_type = rustix::fs::statfs(&self.dir).map_err(|e| io(e.into()))?.f_type as i64;
        if fs_type != TMPFS_MAGIC && fs_type != RAMFS_MAGIC {
            self.remove_if_empty();
            return Err(DomainError::NotInMemory { dir: self.dir.clone() });
        }
        Ok(())
    }

    /// Whether other users may read this user's directory, but not write: a client's transport creates it like that if
    /// the original was removed.
    pub(crate) fn is_readable_by_others(&self) -> bool {
        let me = rustix::process::geteuid().as_raw();
        fs::symlink_metadata(&self.dir).is_ok_and(|meta| {
            let mode = meta.mode() & 0o777;
            meta.is_dir() && meta.uid() == me && mode != 0o700 && mode & 0o022 == 0
        })
    }

    /// Checks that the directory is a directory of this user, closed to all others.
    pub(crate) fn check_owner(&self) -> Result<(), DomainError> {
        let meta = fs::symlink_metadata(&self.dir)
            .map_err(|e| DomainError::io("look at the directory", &self.dir, e))?;
        let me = rustix::process::geteuid().as_raw();
        if !meta.is_dir() || meta.uid() != me || meta.mode() & 0o077 != 0 {
            return Err(DomainError::WrongOwner {
                dir: self.dir.clone(),
                owner: meta.uid(),
                me,
                mode: meta.mode() & 0o7777,
            });
        }
        Ok(())
    }

    /// Removes the directory if nothing is left in it.
    pub(crate) fn remove_if_empty(&self) {
        let _ = fs::remove_dir(&self.dir);
    }

    /// Restricts the shared memory of an epoch to its owner: the transport (0.10.0) creates one small block, its counter of
    /// identities, writable for everyone.
    pub(crate) fn restrict_to_owner(&self, epoch: u64) -> std::io::Result<()> {
        let prefix = self.epoch_prefix(epoch);
        for (name, path) in entries(Path::new(SHARED_MEMORY)) {
            if name.starts_with(&prefix) && fs::metadata(&path)?.mode() & 0o077 != 0 {
                fs::set_permissions(&path, fs::Permissions::from_mode(0o600))?;
            }
        }
        Ok(())
    }

    /// Removes every epoch but `keep`: its directory and its memory, both or none.
    /// Processes that still have them mapped keep their mapping; the epochs can no longer be joined.
    pub(crate) fn remove_epochs_except(&self, keep: Option<u64>) {
        let kept_dir = keep.map(|epoch| self.epoch_dir(epoch));
        let kept_prefix = keep.map(|epoch| self.epoch_prefix(epoch));
        for (name, path) in entries(&self.dir) {
            let is_epoch = name.len() == 16 && u64::from_str_radix(&name, 16).is_ok();
            if is_epoch && Some(&path) != kept_dir.as_ref() {
                let _ = fs::remove_dir_all(&path);
            }
        }
        let prefix = self.shared_memory_prefix();
        for (name, path) in entries(Path::new(SHARED_MEMORY)) {
            let kept = kept_prefix.as_ref().is_some_and(|p| name.starts_with(p.as_str()));
            if name.starts_with(&prefix) && !kept {
                let _ = fs::remove_file(&path);
            }
        }
    }
}

/// Default directory of cells.
fn default_root() -> PathBuf {
    std::env::var_os(RUNTIME_DIR_ENV).unwrap_or_else(|| SHARED_MEMORY.into()).into()
}

/// Checks that shared memory has space for a process that joins: a write without space terminates the process (SIGBUS).
pub(crate) fn check_free_space() -> Result<(), String> {
    let Ok(memory) = rustix::fs::statvfs(SHARED_MEMORY) else { return Ok(()) };
    let free_bytes = memory.f_bavail.saturating_mul(memory.f_frsize);
    // A file system without a size limit reports no blocks.
    if memory.f_blocks == 0 || free_bytes >= FREE_BYTES_MIN {
        return Ok(());
    }
    let (free, needed) = (free_bytes >> 20, FREE_BYTES_MIN >> 20);
    Err(format!("{SHARED_MEMORY} has {free} MiB left, expected {needed} or more"))
}

/// Names and paths in a directory; unreadable entries are omitted.
pub(crate) fn entries(dir: &Path) -> impl Iterator<Item = (String, PathBuf)> {
    fs::read_dir(dir)
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|e| Some((e.file_name().into_string().ok()?, e.path())))
}
