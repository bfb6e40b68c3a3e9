//! Why a recording cannot be corrected.

use std::error::Error as StdError;
use std::fmt::Display;
use std::path::Path;

use recording::files::FileError;
use recording::series::Recording;

/// Why a recording cannot be corrected.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The cell's configuration does not fit the robot.
    #[error(transparent)]
    File(#[from] FileError),
    /// Model, recording or settings cannot be used.
    #[error(transparent)]
    Input(Box<dyn StdError + Send + Sync>),
    /// A process, the shared memory or this program failed.
    #[error(transparent)]
    System(Box<dyn StdError + Send + Sync>),
    /// It was stopped.
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// For `map_err`: the fault is in what was given.
    pub(crate) fn input(error: impl Into<Box<dyn StdError + Send + Sync>>) -> Self {
        Self::Input(error.into())
    }

    /// For `map_err`: the fault is in the system.
    pub(crate) fn system(error: impl Into<Box<dyn StdError + Send + Sync>>) -> Self {
        Self::System(error.into())
    }

    /// A faulty input with its row, from 0, in the file.
    pub(crate) fn in_row(self, recording: &Recording, row: usize) -> Self {
        let Self::Input(why) = self else { return self };
        let t_s = recording.t_s.get(row).copied().unwrap_or(f64::NAN);
        let file = recording.file.display();
        Self::input(format!("{file}: row {} of the data (t_s = {t_s}): {why}", row + 1))
    }

    /// For `map_err`: what is wrong with the content of the file `path`, whose message does not name it.
    pub(crate) fn in_file<E: Display>(path: &Path) -> impl Fn(E) -> Self + '_ {
        move |error| Self::input(format!("{}: {error}", path.display()))
    }
}
