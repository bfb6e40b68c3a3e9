//! Errors of creating and joining a domain. Each message states what failed, what was expected, and the remedy.

use std::io;
use std::path::{Path, PathBuf};

use super::announcement::Contract;
use crate::port::PortError;
use crate::services::ServiceError;

/// The daemon's domain could not be created.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// The cell's name is invalid.
    #[error("cell name {name:?}: expected 1 to 24 of a-z, 0-9 and '-'")]
    BadName {
        /// The name given.
        name: String,
    },
    /// The path of the cell's directory is invalid.
    #[error("{}: expected an absolute path of at most {limit} bytes of UTF-8; set TRUED_RUNTIME_DIR to a shorter one", dir.display())]
    BadDirectory {
        /// The directory.
        dir: PathBuf,
        /// Maximum length, bytes.
        limit: usize,
    },
    /// The directory is on a disk.
    #[error("{}: expected a directory in memory (tmpfs), which is empty after a reboot; set TRUED_RUNTIME_DIR to one", dir.display())]
    NotInMemory {
        /// The directory.
        dir: PathBuf,
    },
    /// The directory is accessible to other users.
    #[error("{}: belongs to user {owner} with mode {mode:o}, expected user {me} and mode 700; run daemon and clients as the same user, or remove it", dir.display())]
    WrongOwner {
        /// The directory.
        dir: PathBuf,
        /// Its user.
        owner: u32,
        /// This process's user.
        me: u32,
        /// Its mode.
        mode: u32,
    },
    /// Another daemon serves this cell.
    #[error("cell {cell:?}: already served by process {}; stop it, or give this cell another name", pid_text(*.pid))]
    AlreadyServed {
        /// The cell.
        cell: String,
        /// The other daemon's process, as far as known.
        pid: Option<u32>,
    },
    /// The system refused an operation.
    #[error("could not {step} {}: {source}", path.display())]
    Io {
        /// The attempted operation.
        step: &'static str,
        /// The path.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The transport could not be started.
    #[error(
        "cell {cell:?}: cannot start the transport: {cause}; check whether shared memory is full"
    )]
    Transport {
        /// The cell.
        cell: String,
        /// Error of the transport.
        cause: String,
    },
    /// A service could not be created.
    #[error(transparent)]
    Service(#[from] ServiceError),
}

impl DomainError {
    pub(crate) fn io(step: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Io { step, path: path.to_owned(), source }
    }
}

/// A client could not join.
#[derive(Debug, thiserror::Error)]
pub enum JoinError {
    /// The cell's name or directory is invalid.
    #[error(transparent)]
    Cell(#[from] DomainError),
    /// No daemon serves the cell.
    #[error("cell {cell:?}: no daemon found in {}; start `trued run` as this user", dir.display())]
    NoDaemon {
        /// The cell.
        cell: String,
        /// The directory that was searched.
        dir: PathBuf,
    },
    /// The announced daemon has terminated.
    #[error("cell {cell:?}: the daemon (process {pid}) has terminated; start `trued run` again")]
    DaemonDied {
        /// The cell.
        cell: String,
        /// The daemon's last process.
        pid: u32,
    },
    /// The domain belongs to another user.
    #[error("{}: belongs to user {owner}, this process is user {me}; run both as the same user", dir.display())]
    WrongUser {
        /// The directory.
        dir: PathBuf,
        /// Its user.
        owner: u32,
        /// This process's user.
        me: u32,
    },
    /// Daemon and client have different contracts.
    #[error("the daemon is {theirs}, this client is {ours}; install the same version of both")]
    VersionMismatch {
        /// The daemon's.
        theirs: Box<Contract>,
        /// This build's.
        ours: Box<Contract>,
    },
    /// The announcement cannot be parsed.
    #[error("{}: cannot be read by this version; restart the daemon", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
    },
    /// Another process has this role.
    #[error("the role `{role}` is taken by process {}; a cell has one of each", pid_text(*.pid))]
    RoleTaken {
        /// The role.
        role: &'static str,
        /// The other process, as far as known.
        pid: Option<u32>,
    },
    /// The transport refused.
    #[error("epoch {epoch:016x}: {cause}; retry if the daemon has just restarted")]
    Transport {
        /// The epoch.
        epoch: u64,
        /// Error of the transport.
        cause: String,
    },
    /// A port could not be created.
    #[error(transparent)]
    Port(#[from] PortError),
}

impl JoinError {
    /// Whether a later retry may succeed.
    #[must_use]
    pub fn is_transient(&self) -> bool {
        !matches!(self, Self::Cell(_) | Self::WrongUser { .. } | Self::VersionMismatch { .. })
    }
}

fn pid_text(pid: Option<u32>) -> String {
    pid.map_or_else(|| "(unknown)".to_owned(), |pid| pid.to_string())
}
