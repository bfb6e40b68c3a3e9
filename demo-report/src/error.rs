//! Why a demonstration ends without a result.

use std::error::Error as StdError;

use recording::files::FileError;
use recording::outputs::WriteError;

/// Why a demonstration ends without a result.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// There is no scene for the seed.
    #[error(transparent)]
    Input(Box<dyn StdError + Send + Sync>),
    /// A file that the demonstration wrote cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The files cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The measurements cannot be diagnosed.
    #[error(transparent)]
    Diagnosis(#[from] diagnosis_report::Error),
    /// A process, the shared memory or an output failed.
    #[error(transparent)]
    System(Box<dyn StdError + Send + Sync>),
    /// It was stopped.
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// For `map_err`: the fault is in the system.
    pub fn system(error: impl Into<Box<dyn StdError + Send + Sync>>) -> Self {
        Self::System(error.into())
    }
}
