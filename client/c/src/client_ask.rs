//! What the robot's side may ask of the daemon. Requests wait, within their limit: not for the robot's loop.

use core::ffi::c_char;

use crate::border::{self, given, path_given};
use crate::client::CLIENTS;
use crate::code::guard;
use crate::reply::ask;
use crate::structs::*;
use crate::{translate, trued_code};

/// Asks for a sign of life. `answer` may be NULL, here and in all requests.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_ping(
    client: *mut trued_client,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        let act = |limit| CLIENTS.with(client.addr(), |client| Ok(client.ping(limit)));
        // SAFETY: the rules of the header.
        unsafe { ask(answer, limit_ns, act) }
    })
}

/// Asks to load a model file and to swap it in; `path` NULL: the one loaded now, read again.
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
        unsafe { ask(answer, limit_ns, act) }
    })
}

/// Asks to ramp the correction out (`on` not 0), or in again.
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
        unsafe { ask(answer, limit_ns, act) }
    })
}

/// Asks to go to shadow mode (`on` 0), or back to the configured one; where that is shadow, the answer is a refusal.
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
        unsafe { ask(answer, limit_ns, act) }
    })
}

/// Asks to go to a mode, a trued_mode: at most to the one that the configuration of the cell allows; else the answer is a refusal.
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
        unsafe { ask(answer, limit_ns, act) }
    })
}

/// Writes a marker with this text into the recording; where nothing is recorded, the answer is a refusal.
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
        unsafe { ask(answer, limit_ns, act) }
    })
}

/// Asks the recorder to start, to stop, or to keep the present recording: `action` is a trued_recorder_action.
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
        unsafe { ask(answer, limit_ns, act) }
    })
}

/// Tells what the process does, in place of what was told before.
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
        unsafe { ask(answer, limit_ns, act) }
    })
}

/// Tells where the tool was measured; the answer says whether the model still holds.
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
        unsafe { ask(answer, limit_ns, act) }
    })
}
