//! Errors of the client library: where, what, what was expected, what to do.

use std::time::Duration;

use shm_schema::{DomainError, JOINTS_MAX, JoinError, SendOutcome};

/// Why there is no connection to a daemon. The library keeps trying.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Away {
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
    /// The cell is another user's now.
    #[error("the cell now belongs to another user; run daemon and clients as the same user")]
    WrongUser,
    /// Another process has taken this role.
    #[error("another process has this role; a cell has one process per role, so stop one of them")]
    RoleTaken,
    /// The transport refuses.
    #[error("cannot connect to the running daemon; check whether shared memory is full")]
    Transport,
}

impl From<&JoinError> for Away {
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

/// No connection came about.
#[derive(Debug, thiserror::Error)]
pub enum ConnectError {
    /// Trying again does not help.
    #[error(transparent)]
    Refused(#[from] JoinError),
    /// Time limit exceeded; `last` is the last obstacle.
    #[error("not connected within {limit:?}: {last}")]
    TimedOut {
        /// The limit given.
        limit: Duration,
        /// What stood in the way.
        last: JoinError,
    },
    /// Joined, and the daemon says nothing.
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
pub enum NotATarget {
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

impl NotATarget {
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
pub enum NotSent {
    /// There is no daemon; keep sending the targets of `target_for`.
    #[error(transparent)]
    Away(#[from] Away),
    /// The daemon is running, and the message was lost; it is counted.
    #[error(
        "the message was lost because the daemon did not read it; check whether it is overloaded"
    )]
    Lost,
    /// The command is no joint target.
    #[error(transparent)]
    NotATarget(#[from] NotATarget),
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
    /// The message makes no sense.
    #[error("{what} is {value}, expected {expected}")]
    Invalid {
        /// What makes no sense.
        what: &'static str,
        /// Its value.
        value: usize,
        /// What was expected.
        expected: &'static str,
    },
}

impl NotSent {
    /// What became of a message.
    ///
    /// # Errors
    /// [`NotSent::Lost`] if it was not received.
    pub(crate) fn unless_delivered(outcome: SendOutcome) -> Result<(), Self> {
        match outcome {
            SendOutcome::Delivered => Ok(()),
            SendOutcome::NoReader | SendOutcome::Lost => Err(Self::Lost),
        }
    }
}

/// A request got no answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AskError {
    /// There is no daemon to ask.
    #[error(transparent)]
    Away(#[from] Away),
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
        /// Most bytes.
        limit: usize,
    },
}
