//! Why a bridge does not start.

use std::net::SocketAddr;

use recording::files::FileError;

/// A bridge does not start.
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
    /// A port cannot be had.
    #[error("cannot listen at {at}: {why}; is another program there, or another bridge?")]
    Listen {
        /// The address.
        at: SocketAddr,
        /// The system's word.
        why: std::io::Error,
    },
    /// The system refused something else.
    #[error("the system refused a thread or a socket: {0}")]
    System(#[from] std::io::Error),
}

impl BridgeError {
    pub(crate) fn misfit(what: impl Into<String>, fix: impl Into<String>) -> Self {
        Self::Misfit { what: what.into(), fix: fix.into() }
    }
}
