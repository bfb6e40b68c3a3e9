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
        /// What does not fit.
        what: String,
        /// What to do.
        fix: String,
    },
    /// A port that cannot be opened.
    #[error("cannot listen at {at}: {why}; is another program there, or another bridge?")]
    Listen {
        /// The address.
        at: SocketAddr,
        /// The system's error.
        why: std::io::Error,
    },
    /// Any other error of the system.
    #[error("the system refused a thread or a socket: {0}")]
    System(#[from] std::io::Error),
}

impl BridgeError {
    pub(crate) fn misfit(what: impl Into<String>, fix: impl Into<String>) -> Self {
        Self::Misfit { what: what.into(), fix: fix.into() }
    }
}
