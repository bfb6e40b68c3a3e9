//! Errors of the start of a bridge.

use std::net::SocketAddr;

use recording::files::FileError;

/// Why a bridge did not start.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// A file cannot be used.
    #[error(transparent)]
    File(#[from] FileError),
    /// The files do not fit together.
    #[error("{what}; {fix}")]
    Misfit {
        /// What is incompatible.
        what: String,
        /// What to do.
        fix: String,
    },
    /// A port that cannot be opened.
    #[error("cannot listen on {at}: {why}; check whether another program or bridge uses it")]
    Listen {
        /// The address.
        at: SocketAddr,
        /// The system's error.
        why: std::io::Error,
    },
    /// Any other error of the system.
    #[error("cannot create a thread or a socket: {0}")]
    System(#[from] std::io::Error),
}

impl BridgeError {
    pub(crate) fn misfit(what: impl Into<String>, fix: impl Into<String>) -> Self {
        Self::Misfit { what: what.into(), fix: fix.into() }
    }
}
