//! Maps every error of the library to its exception class, defined in `trued/errors.py`.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use trued_client::{ConnectError, ErrorKind, InvalidTarget, RequestError, SendError};

/// The exception of that name, with those words.
pub(crate) fn raised(py: Python<'_>, class: &str, message: String) -> PyErr {
    let made = py.import("trued.errors").and_then(|m| m.getattr(class)?.call1((message,)));
    made.map_or_else(|failed| failed, |error| PyErr::from_value(error))
}

fn of_kind(py: Python<'_>, kind: ErrorKind, message: String) -> PyErr {
    let class = match kind {
        ErrorKind::Argument => return PyValueError::new_err(message),
        ErrorKind::NoDaemon => "NoDaemon",
        ErrorKind::DaemonLost => "DaemonLost",
        ErrorKind::DaemonRestarted => "DaemonRestarted",
        ErrorKind::VersionMismatch => "VersionMismatch",
        ErrorKind::WrongUser => "WrongUser",
        ErrorKind::RoleTaken => "RoleTaken",
        ErrorKind::DaemonSilent => "DaemonSilent",
        ErrorKind::TimedOut => "TimedOut",
        ErrorKind::MessageLost => "MessageLost",
        ErrorKind::Transport => "TransportFailed",
        ErrorKind::System => "SystemFailed",
    };
    raised(py, class, message)
}

/// What the library answers an error with.
pub(crate) trait Kind: std::fmt::Display {
    fn kind(&self) -> ErrorKind;

    fn raise(&self, py: Python<'_>) -> PyErr {
        of_kind(py, self.kind(), self.to_string())
    }
}

impl Kind for ConnectError {
    fn kind(&self) -> ErrorKind {
        self.kind()
    }
}

impl Kind for SendError {
    fn kind(&self) -> ErrorKind {
        self.kind()
    }
}

impl Kind for InvalidTarget {
    fn kind(&self) -> ErrorKind {
        self.kind()
    }
}

impl Kind for RequestError {
    fn kind(&self) -> ErrorKind {
        self.kind()
    }
}
