//! Why a diagnosis, a calibration or a plan gives no result.

use std::error::Error as StdError;

use diagnosis::gross_errors::SuspectedError;
use recording::files::FileError;

/// Why a diagnosis, a calibration or a plan gives no result.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file cannot be written or read.
    #[error(transparent)]
    File(#[from] FileError),
    /// Model or recordings cannot be used.
    #[error(transparent)]
    Input(Box<dyn StdError + Send + Sync>),
    /// Recordings and model do not match, as with swapped columns, a wrong unit, or a mirrored frame; each entry is a possible explanation.
    #[error("the recording and the model do not match: {}", .0.iter().map(|fault| fault.message.as_str()).collect::<Vec<_>>().join("; or "))]
    GrossFaults(Vec<SuspectedError>),
    /// A result cannot be written as file or JSON: a bug of this program.
    #[error(transparent)]
    Internal(Box<dyn StdError + Send + Sync>),
}

impl Error {
    /// For `map_err`: the input is at fault.
    pub(crate) fn input(error: impl Into<Box<dyn StdError + Send + Sync>>) -> Self {
        Self::Input(error.into())
    }

    /// For `map_err`: this program is at fault.
    pub(crate) fn internal(error: impl Into<Box<dyn StdError + Send + Sync>>) -> Self {
        Self::Internal(error.into())
    }
}
