//! Requests to the daemon, with an answer: the same methods for every client that may send them, [`crate::Client`] and [`crate::Monitor`].

use std::path::Path;

use shm_schema::{Mode, Operation, PATH_BYTES_MAX, RecorderAction, Request, Text};

use crate::RequestError;

/// Implements a method for each request on a client that has `fn request(&mut self, Request, Duration) -> Result<Response, RequestError>`.
macro_rules! requests {
    ($client:ty) => {
        impl $client {
            /// Checks that the daemon responds. Like all requests it blocks: do not use it in the robot's loop.
            ///
            /// # Errors
            /// See [`crate::RequestError`].
            pub fn ping(
                &mut self,
                limit: std::time::Duration,
            ) -> Result<shm_schema::Response, $crate::RequestError> {
                self.request($crate::requests::ping(), limit)
            }

            /// Requests that a model file be loaded and activated (`None`: the active one, read again).
            ///
            /// # Errors
            /// See [`crate::RequestError`]; a refusal is an answer, not an error.
            pub fn reload(
                &mut self,
                path: Option<&std::path::Path>,
                limit: std::time::Duration,
            ) -> Result<shm_schema::Response, $crate::RequestError> {
                self.request($crate::requests::reload(path)?, limit)
            }

            /// Requests bypass: ramps the correction to zero, or restores it.
            ///
            /// # Errors
            /// See [`crate::RequestError`].
            pub fn bypass(
                &mut self,
                on: bool,
                limit: std::time::Duration,
            ) -> Result<shm_schema::Response, $crate::RequestError> {
                self.request($crate::requests::switch(shm_schema::Operation::Bypass, on), limit)
            }

            /// Requests shadow mode (`false`), or a return to the configured mode; refused if that is shadow mode.
            ///
            /// # Errors
            /// See [`crate::RequestError`]; a refusal is an answer, not an error.
            pub fn arm(
                &mut self,
                on: bool,
                limit: std::time::Duration,
            ) -> Result<shm_schema::Response, $crate::RequestError> {
                self.request($crate::requests::switch(shm_schema::Operation::Arm, on), limit)
            }

            /// Requests a mode, at most the one that the cell's configuration allows (`mode_max`); the change passes the limiter.
            ///
            /// # Errors
            /// See [`crate::RequestError`]; a refusal is an answer, not an error.
            pub fn mode(
                &mut self,
                mode: shm_schema::Mode,
                limit: std::time::Duration,
            ) -> Result<shm_schema::Response, $crate::RequestError> {
                self.request($crate::requests::to_mode(mode), limit)
            }

            /// Writes a marker with this text into the recording: up to 256 bytes, longer text is truncated.
            ///
            /// # Errors
            /// See [`crate::RequestError`]; a refusal is an answer, not an error.
            pub fn mark(
                &mut self,
                text: &str,
                limit: std::time::Duration,
            ) -> Result<shm_schema::Response, $crate::RequestError> {
                self.request($crate::requests::mark(text), limit)
            }

            /// Starts or stops the recorder, or marks the present recording to be kept. A stopped recording is closed when the answer arrives.
            ///
            /// # Errors
            /// See [`crate::RequestError`]; a refusal is an answer, not an error.
            pub fn record(
                &mut self,
                action: shm_schema::RecorderAction,
                limit: std::time::Duration,
            ) -> Result<shm_schema::Response, $crate::RequestError> {
                self.request($crate::requests::record(action), limit)
            }

            /// Reports the state of the process, replacing the previous one.
            ///
            /// # Errors
            /// See [`crate::RequestError`]; a refusal is an answer, not an error.
            pub fn process_state(
                &mut self,
                process: &$crate::ProcessState,
                limit: std::time::Duration,
            ) -> Result<shm_schema::Response, $crate::RequestError> {
                self.request(process.request(), limit)
            }

            /// Reports a measurement of the tool: the answer states the deviation from the model, and whether the model still holds.
            ///
            /// # Errors
            /// See [`crate::RequestError`]; a refusal is an answer, not an error.
            pub fn measured(
                &mut self,
                measured: &$crate::Measured<'_>,
                limit: std::time::Duration,
            ) -> Result<shm_schema::Response, $crate::RequestError> {
                self.request(measured.request(), limit)
            }
        }
    };
}
pub(crate) use requests;

pub(crate) fn ping() -> Request {
    Request { operation: Operation::Ping.code(), ..Request::default() }
}

pub(crate) fn reload(path: Option<&Path>) -> Result<Request, RequestError> {
    let text = match path {
        None => Text::new(""),
        Some(path) => path.to_str().and_then(Text::whole).ok_or_else(|| RequestError::BadPath {
            path: path.to_owned(),
            limit: PATH_BYTES_MAX,
        })?,
    };
    Ok(Request { operation: Operation::Reload.code(), path: text, ..Request::default() })
}

pub(crate) fn switch(operation: Operation, on: bool) -> Request {
    Request { operation: operation.code(), on: u32::from(on), ..Request::default() }
}

pub(crate) fn to_mode(mode: Mode) -> Request {
    Request { operation: Operation::Mode.code(), on: mode.code(), ..Request::default() }
}

pub(crate) fn mark(text: &str) -> Request {
    Request { operation: Operation::Mark.code(), path: Text::new(text), ..Request::default() }
}

pub(crate) fn record(action: RecorderAction) -> Request {
    Request { operation: Operation::Record.code(), on: action.code(), ..Request::default() }
}
