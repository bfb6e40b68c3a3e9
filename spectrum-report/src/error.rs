//! Why an analysis gives no result.

use std::error::Error as StdError;
use std::path::PathBuf;

use recording::files::FileError;

/// Why an analysis gives no result.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A model cannot be read.
    #[error("{}: {source}", name.display())]
    Model {
        /// Its file, or the name of a preset.
        name: PathBuf,
        /// Why.
        source: FileError,
    },
    /// The input cannot be used.
    #[error(transparent)]
    Input(Box<dyn StdError + Send + Sync>),
    /// A result cannot be written as file or JSON: a fault of this program.
    #[error(transparent)]
    Internal(Box<dyn StdError + Send + Sync>),
}

impl Error {
    /// For `map_err`: an error of the input.
    pub(crate) fn input(error: impl Into<Box<dyn StdError + Send + Sync>>) -> Self {
        Self::Input(error.into())
    }

    /// For `map_err`: the fault is in this program.
    pub(crate) fn internal(error: impl Into<Box<dyn StdError + Send + Sync>>) -> Self {
        Self::Internal(error.into())
    }
}
