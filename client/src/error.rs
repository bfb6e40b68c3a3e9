//! Errors of the client library. Each message states what failed, what was expected, and the remedy.

use std::time::Duration;

use shm_schema::{DomainError, JOINTS_MAX, JoinError, SendOutcome};

/// Why there is no connection to a daemon. The library reconnects automatically.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DisconnectReason {
    /// The daemon is gone.
    #[error("no daemon is running; start `trued run`, the client reconnects automatically")]
    DaemonLost,
    /// Connected to a new daemon; reported once, nothing was sent.
    #[error(
        "the daemon restarted and the client reconnected: repeat the settings made before \
         (bypass, arm, process state). Reported once; nothing was sent, so call again"
    )]
    DaemonRestarted,
    /// The present daemon has another version.
    #[error("the running daemon has a different version; install the same version of both")]
    VersionMismatch,
    /// The cell now belongs to another user.
    #[error("the cell now belongs to another user; run daemon and clients as the same user")]
    WrongUser,
    /// Another process has taken this role.
    #[error("another process has this role; a cell has one process per role, so stop one of them")]
    RoleTaken,
    /// The transport refused the connection.
    #[error("cannot connect to the running daemon; check whether shared memory is full")]
    Transport,
}

impl From<&JoinError> for DisconnectReason {
    fn from(e: &JoinError) -> Self {
        match e {
            JoinError::NoDaemon { .. } | JoinError::DaemonDied { .. } => Self::DaemonLost,
            JoinError::VersionMismatch { .. } | JoinError::Unreadable { .. } => {
                Self::VersionMismatch
            }
            JoinError::WrongUser { .. } => Self::WrongUser,
            JoinError::RoleTaken { .. } => Self::RoleTaken,
            JoinError::Cell(_) | JoinError::Transport { .. } | JoinError::Port(_) => {
                Self::Transport
            }
        }
    }
}

/// The connection could not be established.
#[derive(Debug, thiserror::Error)]
pub enum ConnectError {
    /// A permanent error: a retry does not help.
    #[error(transparent)]
    Refused(#[from] JoinError),
    /// Time limit exceeded; `last` is the error of the last attempt.
    #[error("not connected within {limit:?}: {last}")]
    TimedOut {
        /// The limit given.
        limit: Duration,
        /// Error of the last attempt.
        last: JoinError,
    },
    /// Connected, but the daemon published no status.
    #[error(
        "connected to the daemon (process {pid}), but received no status within {limit:?}; check whether it is stopped or overloaded"
    )]
    Silent {
        /// The daemon's process.
        pid: u32,
        /// The limit given.
        limit: Duration,
    },
    /// The library's own thread could not be started.
    #[error("could not start a thread: {0}; increase the process limit")]
    Thread(#[from] std::io::Error),
}

impl From<DomainError> for ConnectError {
    fn from(e: DomainError) -> Self {
        Self::Refused(e.into())
    }
}

/// A command is not a valid joint target: nothing was sent, and the state is unchanged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum InvalidTarget {
    /// Invalid number of joints.
    #[error("the command has {0} joints, expected 1 to 16")]
    Joints(usize),
    /// A joint position that is not finite.
    #[error(
        "joint {joint} of the command is not finite, expected rad (m for a linear joint); to keep sending, repeat the last target"
    )]
    NotFinite {
        /// The first such joint, from 1.
        joint: usize,
    },
}

impl InvalidTarget {
    pub(crate) fn check(q_cmd: &[f64]) -> Result<(), Self> {
        const { assert!(JOINTS_MAX == 16) };
        if q_cmd.is_empty() || q_cmd.len() > JOINTS_MAX {
            return Err(Self::Joints(q_cmd.len()));
        }
        match q_cmd.iter().position(|q| !q.is_finite()) {
            Some(place) => Err(Self::NotFinite { joint: place + 1 }),
            None => Ok(()),
        }
    }
}

/// A message was not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SendError {
    /// There is no daemon; keep sending the targets of `target_for`.
    #[error(transparent)]
    Disconnected(#[from] DisconnectReason),
    /// The daemon is running, and the message was lost; it is counted.
    #[error(
        "the message was lost because the daemon did not read it; check whether it is overloaded"
    )]
    Lost,
    /// The command is not a valid joint target.
    #[error(transparent)]
    InvalidTarget(#[from] InvalidTarget),
    /// A setpoint of the horizon is not finite: nothing was sent, and the horizon sent before remains.
    #[error(
        "joint {joint} of point {point} of the horizon is not finite, expected rad (m for a linear joint); end the horizon before that point"
    )]
    HorizonNotFinite {
        /// The first such point, from 1.
        point: usize,
        /// Its first such joint, from 1.
        joint: usize,
    },
    /// The content of the message is invalid.
    #[error("{what} is {value}, expected {expected}")]
    Invalid {
        /// The invalid quantity.
        what: &'static str,
        /// Its value.
        value: usize,
        /// Expected value.
        expected: &'static str,
    },
}

impl SendError {
    /// The result of sending a message.
    ///
    /// # Errors
    /// [`SendError::Lost`] if it was not received.
    pub(crate) fn from_outcome(outcome: SendOutcome) -> Result<(), Self> {
        match outcome {
            SendOutcome::Delivered => Ok(()),
            SendOutcome::NoReader | SendOutcome::Lost => Err(Self::Lost),
        }
    }
}

/// A request was not answered.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RequestError {
    /// There is no connection to a daemon.
    #[error(transparent)]
    Disconnected(#[from] DisconnectReason),
    /// No answer in time; whether the request was executed is unknown.
    #[error("no answer within {limit:?}; see the daemon's status for whether it was done")]
    TimedOut {
        /// The limit given.
        limit: Duration,
    },
    /// The path cannot be sent.
    #[error("path {path:?}: expected at most {limit} bytes of UTF-8")]
    BadPath {
        /// The path.
        path: std::path::PathBuf,
        /// Maximum length, bytes.
        limit: usize,
    },
}
