//! Results of a command as types and exit codes.
//!
//! | code | meaning |
//! | --- | --- |
//! | 0 | done |
//! | 1 | done, with a negative result: a check that found errors, a benchmark below a required
//! limit |
//! | 2 | bad input or usage |
//! | 3 | the system failed: no shared memory, no permission, disk full |
//! | 130 | interrupted |

use std::error::Error;
use std::io::ErrorKind;
use std::path::PathBuf;
use std::process::ExitCode;

use recording::outputs::WriteError;

/// The answer of a command that was done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// Done.
    Done,
    /// Done, and the answer is no.
    No,
}

/// Why a command failed. The message is that of the inner error.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The input cannot be used.
    #[error(transparent)]
    Input(Box<dyn Error + Send + Sync>),
    /// The operating system failed.
    #[error(transparent)]
    System(Box<dyn Error + Send + Sync>),
    /// The command was interrupted.
    #[error("interrupted")]
    Interrupted,
}

impl From<diagnosis_report::Error> for Failure {
    fn from(error: diagnosis_report::Error) -> Self {
        match error {
            diagnosis_report::Error::File(error) => crate::input::unusable(error),
            diagnosis_report::Error::Input(error) => Self::Input(error),
            faults @ diagnosis_report::Error::GrossFaults(_) => Self::input(faults),
            diagnosis_report::Error::Internal(error) => Self::System(error),
        }
    }
}

impl From<spectrum_report::Error> for Failure {
    fn from(error: spectrum_report::Error) -> Self {
        match error {
            spectrum_report::Error::File(error) => crate::input::unusable(error),
            spectrum_report::Error::Model { name, source } => {
                crate::input::unusable_model(&name, source)
            }
            spectrum_report::Error::Input(error) => Self::Input(error),
            spectrum_report::Error::Internal(error) => Self::System(error),
        }
    }
}

impl From<correction_report::Error> for Failure {
    fn from(error: correction_report::Error) -> Self {
        match error {
            correction_report::Error::File(error) => crate::input::unusable(error),
            correction_report::Error::Input(error) => Self::Input(error),
            correction_report::Error::System(error) => Self::System(error),
            correction_report::Error::Interrupted => Self::Interrupted,
        }
    }
}

impl From<WriteError> for Failure {
    fn from(error: WriteError) -> Self {
        let misnamed = [ErrorKind::NotFound, ErrorKind::NotADirectory, ErrorKind::IsADirectory];
        match &error {
            WriteError::Exists(path) => Self::input(AlreadyExists(path.clone())),
            WriteError::Io { source, .. } if !misnamed.contains(&source.kind()) => {
                Self::system(error)
            }
            _ => Self::input(error),
        }
    }
}

/// [`WriteError::Exists`] with the option that permits it.
#[derive(Debug, thiserror::Error)]
#[error("{} already exists; nothing was written. Choose another name, or use --overwrite to replace it", .0.display())]
struct AlreadyExists(PathBuf);

/// How a command ends.
pub type Outcome = Result<Answer, Failure>;

impl Failure {
    /// For `map_err`: an error in the input.
    pub fn input(error: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Input(error.into())
    }

    /// For `map_err`: the fault is in the system.
    pub fn system(error: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::System(error.into())
    }
}

/// The exit code of an outcome.
#[must_use]
pub fn code(outcome: &Outcome) -> ExitCode {
    ExitCode::from(number(outcome))
}

fn number(outcome: &Outcome) -> u8 {
    match outcome {
        Ok(Answer::Done) => 0,
        Ok(Answer::No) => 1,
        Err(Failure::Input(_)) => 2,
        Err(Failure::System(_)) => 3,
        Err(Failure::Interrupted) => crate::interrupt::EXIT_CODE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_name_is_bad_input_and_a_full_disk_is_not() {
        let io_error = |kind: ErrorKind| WriteError::Io { path: "a".into(), source: kind.into() };
        for bad in [WriteError::Exists("a".into()), io_error(ErrorKind::NotFound)] {
            assert!(matches!(Failure::from(bad), Failure::Input(_)));
        }
        assert!(matches!(Failure::from(io_error(ErrorKind::StorageFull)), Failure::System(_)));
    }

    #[test]
    fn exit_codes_are_those_of_the_contract() {
        let outcomes = [
            Ok(Answer::Done),
            Ok(Answer::No),
            Err(Failure::input("no such model")),
            Err(Failure::system("disk full")),
            Err(Failure::Interrupted),
        ];
        assert_eq!(outcomes.each_ref().map(number), [0, 1, 2, 3, 130]);
    }
}
