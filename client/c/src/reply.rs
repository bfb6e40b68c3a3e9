//! Common parts of the handles: connecting, and returning the daemon's answers.
//!
//! Promise: an invalid output argument is detected before a request is sent.

use core::ffi::c_char;
use core::time::Duration;
use std::path::Path;

use ::trued_client::{Answer, ConnectError, RequestError, Response};
use shm_schema::Cell;

use crate::border::{Grows, Place, limit, place_if_any, text};
use crate::code::Fault;
use crate::handle::Handles;
use crate::structs::trued_answer;
use crate::{translate, trued_code};

/// Connects, keeps what came about, and hands out its handle.
///
/// # Safety
/// The pointers are null or what `trued.h` says of them.
pub(crate) unsafe fn connect<T, H>(
    table: &Handles<T>,
    cell: *const c_char,
    runtime_dir: *const c_char,
    limit_ns: u64,
    handle: *mut *mut H,
    connect_to: impl FnOnce(&Cell, Duration) -> Result<T, ConnectError>,
) -> Result<trued_code, Fault> {
    if handle.is_null() {
        return Err(Fault::Null("handle"));
    }
    // SAFETY: not null, so it is a place for a pointer.
    unsafe { handle.write_unaligned(core::ptr::null_mut()) };
    // SAFETY: the caller's promise.
    let name = unsafe { text("cell", cell) }?;
    let cell = if runtime_dir.is_null() {
        Cell::new(name)
    } else {
        // SAFETY: not null, and so a text.
        Cell::at(Path::new(unsafe { text("runtime_dir", runtime_dir) }?), name)
    };
    let made = connect_to(&cell.map_err(ConnectError::from)?, limit(limit_ns)?)?;
    let number = table.open(made)?;
    // SAFETY: as above. The pointer is a number for the table; nothing stands behind it.
    unsafe { handle.write_unaligned(core::ptr::without_provenance_mut(number)) };
    Ok(trued_code::TRUED_OK)
}

/// Gives a handle up; NULL is none.
pub(crate) fn close<T, H>(table: &Handles<T>, handle: *mut H) -> Result<trued_code, Fault> {
    if !handle.is_null() {
        drop(table.close(handle.addr())?);
    }
    Ok(trued_code::TRUED_OK)
}

/// Fills in what there is, or says that there is nothing.
pub(crate) fn put<T: Grows>(to: Place<T>, found: Option<T>) -> Result<trued_code, Fault> {
    match found {
        Some(value) => {
            to.put(&value);
            Ok(trued_code::TRUED_OK)
        }
        None => Ok(trued_code::TRUED_NOTHING),
    }
}

/// Asks, and hands out the answer; what was not done is an error, with the daemon's words.
///
/// # Safety
/// `answer` is null or a struct with its size set.
pub(crate) unsafe fn request(
    answer: *mut trued_answer,
    limit_ns: u64,
    request: impl FnOnce(Duration) -> Result<Result<Response, RequestError>, Fault>,
) -> Result<trued_code, Fault> {
    // SAFETY: the caller's promise.
    let answer = unsafe { place_if_any(answer) }?;
    let response = request(limit(limit_ns)?)??;
    if let Some(answer) = answer {
        answer.put(&translate::answer(&response));
    }
    match response.answer() {
        Ok(Answer::Done) => Ok(trued_code::TRUED_OK),
        Ok(Answer::Failed) => Err(Fault::Failed(Box::new(response))),
        Ok(Answer::Refused | Answer::Malformed) | Err(_) => Err(Fault::Refused(Box::new(response))),
    }
}
