//! Monitoring a cell and sending requests to its daemon, from any number of processes.

use core::ffi::c_char;

use ::trued_client::Monitor;

use crate::border::{self, given, path_given, place};
use crate::client::linked;
use crate::code::guard;
use crate::handle::Handles;
use crate::reply::{close, connect, put, request};
use crate::structs::*;
use crate::{translate, trued_code};

static MONITORS: Handles<Monitor> = Handles::new(2);

/// Connects to the daemon of `cell`, as trued_client_connect() does.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_connect(
    cell: *const c_char,
    runtime_dir: *const c_char,
    limit_ns: u64,
    monitor: *mut *mut trued_monitor,
) -> trued_code {
    let connect_to = Monitor::connect_to;
    // SAFETY: the rules of the header.
    guard(|| unsafe { connect(&MONITORS, cell, runtime_dir, limit_ns, monitor, connect_to) })
}

/// Disconnects and frees the handle, within about a second. NULL is not an error.
#[unsafe(no_mangle)]
pub extern "C" fn trued_monitor_close(monitor: *mut trued_monitor) -> trued_code {
    guard(|| close(&MONITORS, monitor))
}

/// The newest status; TRUED_NOTHING before the first.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_status(
    monitor: *mut trued_monitor,
    status: *mut trued_status,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let status = unsafe { place(status) }?;
        let found = MONITORS.with(monitor.addr(), |monitor| Ok(monitor.status()))?;
        put(status, found.as_ref().map(translate::status))
    })
}

/// The next verdict on vibration not yet taken; TRUED_NOTHING where there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_vibration(
    monitor: *mut trued_monitor,
    vibration: *mut trued_vibration,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let vibration = unsafe { place(vibration) }?;
        let found = MONITORS.with(monitor.addr(), |monitor| Ok(monitor.vibration()))?;
        put(vibration, found.as_ref().map(translate::vibration))
    })
}

/// State of the connection.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_connection(
    monitor: *mut trued_monitor,
    connection: *mut trued_connection,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let connection = unsafe { place(connection) }?;
        let found = MONITORS.with(monitor.addr(), |monitor| {
            Ok((monitor.connection(), monitor.disconnect_reason()))
        })?;
        put(connection, Some(linked(found)))
    })
}

/// The next event of the connection not yet taken, oldest first; TRUED_NOTHING where there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_next_event(
    monitor: *mut trued_monitor,
    event: *mut trued_connection,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let event = unsafe { place(event) }?;
        let found = MONITORS.with(monitor.addr(), |monitor| Ok(monitor.next_event()))?;
        put(event, found.as_ref().map(translate::event))
    })
}

/// Checks that the daemon responds. `answer` may be NULL, here and in all requests.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_ping(
    monitor: *mut trued_monitor,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        let act = |limit| MONITORS.with(monitor.addr(), |monitor| Ok(monitor.ping(limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Requests that a model file be loaded and activated; `path` NULL: the active one, read again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_reload(
    monitor: *mut trued_monitor,
    path: *const c_char,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let path = unsafe { path_given(path) }?;
        let act = |limit| MONITORS.with(monitor.addr(), |monitor| Ok(monitor.reload(path, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// The same for a model of another robot, or one whose joint limits the arm already exceeds: in shadow mode only.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_reload_other_robot(
    monitor: *mut trued_monitor,
    path: *const c_char,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let path = unsafe { path_given(path) }?;
        let act = |limit| {
            let reload = |monitor: &mut Monitor| Ok(monitor.reload_other_robot(path, limit));
            MONITORS.with(monitor.addr(), reload)
        };
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Requests bypass: ramps the correction to zero (`on` not 0), or restores it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_bypass(
    monitor: *mut trued_monitor,
    on: u32,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        let act =
            |limit| MONITORS.with(monitor.addr(), |monitor| Ok(monitor.bypass(on != 0, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Requests shadow mode (`on` 0), or a return to the configured mode; refused where that is shadow mode.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_arm(
    monitor: *mut trued_monitor,
    on: u32,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        let act = |limit| MONITORS.with(monitor.addr(), |monitor| Ok(monitor.arm(on != 0, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Requests a mode, a trued_mode; refused if it exceeds the one that the cell's configuration allows.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_mode(
    monitor: *mut trued_monitor,
    mode: u32,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        let mode = translate::mode(mode)?;
        let act = |limit| MONITORS.with(monitor.addr(), |monitor| Ok(monitor.mode(mode, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Writes a marker with this text into the recording; refused if nothing is being recorded.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_mark(
    monitor: *mut trued_monitor,
    text: *const c_char,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let text = unsafe { border::text("text", text) }?;
        let act = |limit| MONITORS.with(monitor.addr(), |monitor| Ok(monitor.mark(text, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Starts or stops the recorder, or marks the present recording to be kept: `action` is a trued_recorder_action.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_record(
    monitor: *mut trued_monitor,
    action: u32,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        let action = translate::recorder_action(action)?;
        let act =
            |limit| MONITORS.with(monitor.addr(), |monitor| Ok(monitor.record(action, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Reports the state of the process, replacing the previous one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_process_state(
    monitor: *mut trued_monitor,
    process: *const trued_process,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let process = translate::process(&unsafe { given(process) }?)?;
        let act = |limit| {
            MONITORS.with(monitor.addr(), |monitor| Ok(monitor.process_state(&process, limit)))
        };
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}

/// Reports a measurement of the tool; the answer says whether the model still holds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_monitor_measured(
    monitor: *mut trued_monitor,
    measured: *const trued_measured,
    limit_ns: u64,
    answer: *mut trued_answer,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let given = unsafe { given(measured) }?;
        let measured = translate::measured(&given)?;
        let act =
            |limit| MONITORS.with(monitor.addr(), |monitor| Ok(monitor.measured(&measured, limit)));
        // SAFETY: the rules of the header.
        unsafe { request(answer, limit_ns, act) }
    })
}
