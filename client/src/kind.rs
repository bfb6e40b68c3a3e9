//! The kinds of errors, the same in every language.
//!
//! Invariants: every error of this crate has exactly one kind, and a kind keeps its name. Messages are defined with the errors.

use shm_schema::JoinError;

use crate::{ConnectError, DisconnectReason, InvalidTarget, RequestError, SendError};

/// Kind of an error, for programmatic handling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ErrorKind {
    /// An invalid argument.
    Argument,
    /// No daemon found in time.
    NoDaemon,
    /// The daemon has terminated.
    DaemonLost,
    /// Connected to a new daemon.
    DaemonRestarted,
    /// Daemon and client are of different versions.
    VersionMismatch,
    /// The cell belongs to another user.
    WrongUser,
    /// Another process has this role.
    RoleTaken,
    /// Connected, but the daemon does not respond.
    DaemonSilent,
    /// No answer in time.
    TimedOut,
    /// The daemon does not read messages fast enough.
    MessageLost,
    /// The transport refused.
    Transport,
    /// Error of the operating system.
    System,
}

impl ErrorKind {
    /// Its name: `daemon_lost`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Argument => "argument",
            Self::NoDaemon => "no_daemon",
            Self::DaemonLost => "daemon_lost",
            Self::DaemonRestarted => "daemon_restarted",
            Self::VersionMismatch => "version_mismatch",
            Self::WrongUser => "wrong_user",
            Self::RoleTaken => "role_taken",
            Self::DaemonSilent => "daemon_silent",
            Self::TimedOut => "timed_out",
            Self::MessageLost => "message_lost",
            Self::Transport => "transport",
            Self::System => "system",
        }
    }
}

impl core::fmt::Display for ErrorKind {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name())
    }
}

impl From<DisconnectReason> for ErrorKind {
    fn from(reason: DisconnectReason) -> Self {
        match reason {
            DisconnectReason::DaemonLost => Self::DaemonLost,
            DisconnectReason::DaemonRestarted => Self::DaemonRestarted,
            DisconnectReason::VersionMismatch => Self::VersionMismatch,
            DisconnectReason::WrongUser => Self::WrongUser,
            DisconnectReason::RoleTaken => Self::RoleTaken,
            DisconnectReason::Transport => Self::Transport,
        }
    }
}

impl ConnectError {
    /// Kind of the error.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Refused(JoinError::Cell(_)) => ErrorKind::Argument,
            Self::Refused(e) | Self::TimedOut { last: e, .. } => match DisconnectReason::from(e) {
                DisconnectReason::DaemonLost => ErrorKind::NoDaemon,
                reason => reason.into(),
            },
            Self::Silent { .. } => ErrorKind::DaemonSilent,
            Self::Thread(_) => ErrorKind::System,
        }
    }
}

impl SendError {
    /// Kind of the error.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Disconnected(reason) => (*reason).into(),
            Self::Lost => ErrorKind::MessageLost,
            Self::InvalidTarget(_) | Self::HorizonNotFinite { .. } | Self::Invalid { .. } => {
                ErrorKind::Argument
            }
        }
    }
}

impl InvalidTarget {
    /// Kind of the error.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        ErrorKind::Argument
    }
}

impl RequestError {
    /// Kind of the error.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Disconnected(reason) => (*reason).into(),
            Self::TimedOut { .. } => ErrorKind::TimedOut,
            Self::BadPath { .. } => ErrorKind::Argument,
        }
    }
}
