//! Requests of the robot's loop to the daemon. They block within their time limit: not for use inside the loop.

use core::ffi::c_char;

use crate::border::{self, given, path_given};
use crate::client::CLIENTS;
use crate::code::guard;
use crate::reply::request;
use crate::structs::*;
use crate::{translate, trued_code};

/// Checks that the daemon responds. `answer` may be NULL, here and in all requests.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_ping(
    client: *mut trued_client,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        let act = |limit| CLIENTS.with(client.addr(), |client| Ok(client.ping(limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Requests that a model file be loaded and activated; `path` NULL: the active one, read again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_reload(
    client: *mut trued_client,
    path: *const c_char,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let path = unsafe { path_given(path) }?;
        let act = |limit| CLIENTS.with(client.addr(), |client| Ok(client.reload(path, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Requests bypass: ramps the correction to zero (`on` not 0), or restores it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_bypass(
    client: *mut trued_client,
    on: u32,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        let act = |limit| CLIENTS.with(client.addr(), |client| Ok(client.bypass(on != 0, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Requests shadow mode (`on` 0), or a return to the configured mode; refused where that is shadow mode.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_arm(
    client: *mut trued_client,
    on: u32,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        let act = |limit| CLIENTS.with(client.addr(), |client| Ok(client.arm(on != 0, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Requests a mode, a trued_mode; refused if it exceeds the one that the cell's configuration allows.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_mode(
    client: *mut trued_client,
    mode: u32,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        let mode = translate::mode(mode)?;
        let act = |limit| CLIENTS.with(client.addr(), |client| Ok(client.mode(mode, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Writes a marker with this text into the recording; refused if nothing is being recorded.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_mark(
    client: *mut trued_client,
    text: *const c_char,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let text = unsafe { border::text("text", text) }?;
        let act = |limit| CLIENTS.with(client.addr(), |client| Ok(client.mark(text, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Starts or stops the recorder, or marks the present recording to be kept: `action` is a trued_recorder_action.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_record(
    client: *mut trued_client,
    action: u32,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        let action = translate::recorder_action(action)?;
        let act = |limit| CLIENTS.with(client.addr(), |client| Ok(client.record(action, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Reports the state of the process, replacing the previous one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_process_state(
    client: *mut trued_client,
    process: *const trued_process,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let process = translate::process(&unsafe { given(process) }?)?;
        let act =
            |limit| CLIENTS.with(client.addr(), |client| Ok(client.process_state(&process, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Reports a measurement of the tool; the answer says whether the model still holds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_measured(
    client: *mut trued_client,
    measured: *const trued_measured,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let given = unsafe { given(measured) }?;
        let measured = translate::measured(&given)?;
        let act =
            |limit| CLIENTS.with(client.addr(), |client| Ok(client.measured(&measured, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}
