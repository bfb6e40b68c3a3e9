//! Ownership of a library object by a Python object: used by one thread at a time, closed once.
//!
//! Promise: a second thread gets an error and does not wait; so does a call on a closed object. Time limits and arrays are checked here.

use std::path::Path;
use std::sync::Mutex;
use std::time::Duration;

use numpy::{AllowTypeChange, PyArrayLike1, PyArrayLikeDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use shm_schema::{Answer as Code, Cell, Response};
use trued_client::{ConnectError, JOINTS_MAX, RequestError};

use crate::errors::{Kind, raised};
use crate::told::Answer;

/// Longest wait that may be asked for.
const LONGEST_S: f64 = 3600.0;

/// Numbers of Python: any sequence, an array of doubles without a copy.
pub(crate) type Numbers<'py> = PyArrayLike1<'py, f64, AllowTypeChange>;

/// A table of numbers: a sequence of sequences, or an array.
pub(crate) type Rows<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

/// One connection.
pub(crate) struct Held<T>(Mutex<Option<T>>);

impl<T: Send> Held<T> {
    /// Connects, with the interpreter free meanwhile.
    pub(crate) fn connect(
        py: Python<'_>,
        cell: &str,
        timeout: f64,
        runtime_dir: Option<&str>,
        connect: impl FnOnce(&Cell, Duration) -> Result<T, ConnectError> + Send,
    ) -> PyResult<Self> {
        let limit = limit(timeout)?;
        let cell = match runtime_dir {
            None => Cell::new(cell),
            Some(dir) => Cell::at(Path::new(dir), cell),
        };
        let cell = cell.map_err(|e| PyValueError::new_err(e.to_string()))?;
        let made = py.detach(|| connect(&cell, limit)).map_err(|e| e.raise(py))?;
        Ok(Self(Mutex::new(Some(made))))
    }

    /// Does something that waits for nothing.
    pub(crate) fn with<R>(&self, py: Python<'_>, act: impl FnOnce(&mut T) -> R) -> PyResult<R> {
        self.locked(act).map_err(|no| no.raise(py))
    }

    /// Does something that may wait, with the interpreter free meanwhile.
    pub(crate) fn wait<R: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut T) -> R + Send,
    ) -> PyResult<R> {
        py.detach(|| self.locked(act)).map_err(|no| no.raise(py))
    }

    /// Asks; what was not done is raised.
    pub(crate) fn request(
        &self,
        py: Python<'_>,
        timeout: f64,
        request: impl FnOnce(&mut T, Duration) -> Result<Response, RequestError> + Send,
    ) -> PyResult<Answer> {
        let limit = limit(timeout)?;
        let response = self.wait(py, |held| request(held, limit))?.map_err(|e| e.raise(py))?;
        match response.answer() {
            Ok(Code::Done) => Ok(Answer::from(&response)),
            Ok(Code::Failed) => Err(raised(py, "Failed", response.message.to_string())),
            Ok(Code::Refused | Code::Malformed) | Err(_) => {
                Err(raised(py, "Refused", response.message.to_string()))
            }
        }
    }

    /// Closes; once more is no error.
    pub(crate) fn close(&self, py: Python<'_>) -> PyResult<()> {
        let taken = match self.0.try_lock() {
            Ok(mut held) => held.take(),
            Err(_) => return Err(No::Busy.raise(py)),
        };
        py.detach(|| drop(taken));
        Ok(())
    }

    fn locked<R>(&self, act: impl FnOnce(&mut T) -> R) -> Result<R, No> {
        let mut held = self.0.try_lock().map_err(|_| No::Busy)?;
        held.as_mut().map(act).ok_or(No::Closed)
    }
}

enum No {
    Closed,
    Busy,
}

impl No {
    fn raise(self, py: Python<'_>) -> PyErr {
        let (class, message) = match self {
            Self::Closed => ("Closed", "this object is closed; connect again"),
            Self::Busy => (
                "Busy",
                "another thread is in a call with this object; use one from one thread at a time",
            ),
        };
        raised(py, class, message.to_owned())
    }
}

/// A time limit, which every wait has.
pub(crate) fn limit(seconds: f64) -> PyResult<Duration> {
    if !(0.0..=LONGEST_S).contains(&seconds) {
        let message = format!("the time limit is {seconds} s, expected 0 to {LONGEST_S}");
        return Err(PyValueError::new_err(message));
    }
    Ok(Duration::from_secs_f64(seconds))
}

/// The one of a closed list that has this name.
pub(crate) fn named<T: Copy>(
    what: &str,
    all: &[T],
    name: impl Fn(T) -> &'static str,
    wanted: &str,
) -> PyResult<T> {
    all.iter().copied().find(|one| name(*one) == wanted).ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|one| name(*one)).collect();
        PyValueError::new_err(format!(
            "`{what}` is {wanted:?}, expected one of {}",
            names.join(", ")
        ))
    })
}

/// An array as it lies in memory.
pub(crate) fn slice<'a>(what: &str, numbers: &'a Numbers<'_>) -> PyResult<&'a [f64]> {
    let error = || {
        PyValueError::new_err(format!("`{what}` is not contiguous; use numpy.ascontiguousarray()"))
    };
    numbers.as_slice().map_err(|_| error())
}

/// Row after row, and how many joints a row has: any number where there is no row. A copy, as an array may be stored column by column.
pub(crate) fn rows(what: &str, table: &Rows<'_>) -> PyResult<(Vec<f64>, usize)> {
    let table = table.as_array();
    let joints = match *table.shape() {
        [0] => JOINTS_MAX,
        [_, joints] => joints,
        _ => {
            let shape = table.shape();
            let message = format!("`{what}` has the shape {shape:?}, expected one row per point");
            return Err(PyValueError::new_err(message));
        }
    };
    Ok((table.iter().copied().collect(), joints))
}

/// Joints: 1 to 16.
pub(crate) fn joints<'a>(what: &str, numbers: &'a Numbers<'_>) -> PyResult<&'a [f64]> {
    let all = slice(what, numbers)?;
    if all.is_empty() || all.len() > JOINTS_MAX {
        let message = format!("`{what}` has {} joints, expected 1 to {JOINTS_MAX}", all.len());
        return Err(PyValueError::new_err(message));
    }
    Ok(all)
}

/// Sides from which joints come.
pub(crate) fn sides(direction: &[i64]) -> Vec<i8> {
    direction.iter().map(|side| side.signum() as i8).collect()
}
