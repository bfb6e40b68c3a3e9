//! Sends force samples to the vibration monitor.

use core::ffi::c_char;

use ::trued_client::ForceSource;

use crate::border::{given, place, put_if_any};
use crate::client::linked;
use crate::code::{Fault, guard};
use crate::handle::Handles;
use crate::reply::{close, connect, put};
use crate::structs::*;
use crate::{translate, trued_code};

static SOURCES: Handles<ForceSource> = Handles::new(3);

/// Connects to the daemon of `cell`, as trued_client_connect() does.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_force_connect(
    cell: *const c_char,
    runtime_dir: *const c_char,
    limit_ns: u64,
    force: *mut *mut trued_force,
) -> trued_code {
    let connect_to = ForceSource::connect_to;
    // SAFETY: the rules of the header.
    guard(|| unsafe { connect(&SOURCES, cell, runtime_dir, limit_ns, force, connect_to) })
}

/// Disconnects and frees the handle, within about a second. NULL is not an error.
#[unsafe(no_mangle)]
pub extern "C" fn trued_force_close(force: *mut trued_force) -> trued_code {
    guard(|| close(&SOURCES, force))
}

/// Sends one block. Does not block; a block that cannot be sent is lost, and counted on both sides.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_force_send(
    force: *mut trued_force,
    samples: *const trued_force_samples,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let given = unsafe { given(samples) }?;
        // SAFETY: the rules of the header, for the pointers within.
        let samples = unsafe { translate::force(&given) }?;
        SOURCES.with(force.addr(), |source| {
            source.send(&samples)?;
            Ok(trued_code::TRUED_OK)
        })
    })
}

/// Blocks lost so far.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_force_lost(force: *mut trued_force, lost: *mut u64) -> trued_code {
    guard(|| {
        if lost.is_null() {
            return Err(Fault::Null("lost"));
        }
        let count = SOURCES.with(force.addr(), |source| Ok(source.lost()))?;
        // SAFETY: the rules of the header.
        unsafe { put_if_any(lost, count) };
        Ok(trued_code::TRUED_OK)
    })
}

/// State of the connection.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_force_connection(
    force: *mut trued_force,
    connection: *mut trued_connection,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let connection = unsafe { place(connection) }?;
        let found = SOURCES.with(force.addr(), |source| {
            let away = source.disconnect_reason();
            Ok((source.connection(), away))
        })?;
        put(connection, Some(linked(found)))
    })
}

/// The next event of the connection not yet taken, oldest first; TRUED_NOTHING where there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_force_next_event(
    force: *mut trued_force,
    event: *mut trued_connection,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let event = unsafe { place(event) }?;
        let found = SOURCES.with(force.addr(), |source| Ok(source.next_event()))?;
        put(event, found.as_ref().map(translate::event))
    })
}
