//! The kinds of errors, the same in every language.
//!
//! Promise: every error of this crate has one kind, and a kind keeps its name. Never: messages; these belong to the errors.

use shm_schema::JoinError;

use crate::{AskError, Away, ConnectError, NotATarget, NotSent};

/// Kind of an error, for programmatic handling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ErrorKind {
    /// What was given makes no sense.
    Argument,
    /// No daemon found in time.
    NoDaemon,
    /// The daemon was there and is gone.
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

impl From<Away> for ErrorKind {
    fn from(away: Away) -> Self {
        match away {
            Away::DaemonLost => Self::DaemonLost,
            Away::DaemonRestarted => Self::DaemonRestarted,
            Away::VersionMismatch => Self::VersionMismatch,
            Away::WrongUser => Self::WrongUser,
            Away::RoleTaken => Self::RoleTaken,
            Away::Transport => Self::Transport,
        }
    }
}

impl ConnectError {
    /// What kind of error it is.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Refused(JoinError::Cell(_)) => ErrorKind::Argument,
            Self::Refused(e) | Self::TimedOut { last: e, .. } => match Away::from(e) {
                Away::DaemonLost => ErrorKind::NoDaemon,
                away => away.into(),
            },
            Self::Silent { .. } => ErrorKind::DaemonSilent,
            Self::Thread(_) => ErrorKind::System,
        }
    }
}

impl NotSent {
    /// What kind of error it is.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Away(away) => (*away).into(),
            Self::Lost => ErrorKind::MessageLost,
            Self::NotATarget(_) | Self::HorizonNotFinite { .. } | Self::Invalid { .. } => {
                ErrorKind::Argument
            }
        }
    }
}

impl NotATarget {
    /// What kind of error it is.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        ErrorKind::Argument
    }
}

impl AskError {
    /// What kind of error it is.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Away(away) => (*away).into(),
            Self::TimedOut { .. } => ErrorKind::TimedOut,
            Self::BadPath { .. } => ErrorKind::Argument,
        }
    }
}
