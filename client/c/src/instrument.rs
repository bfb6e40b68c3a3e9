//! Sends measured points of the tool to the trim.

use core::ffi::c_char;

use ::trued_client::Instrument;

use crate::border::{numbers, place, put_if_any};
use crate::client::linked;
use crate::code::{Fault, guard};
use crate::handle::Handles;
use crate::reply::{close, connect, put};
use crate::structs::*;
use crate::{translate, trued_code};

static INSTRUMENTS: Handles<Instrument> = Handles::new(4);

/// Connects to the daemon of `cell`, as trued_client_connect() does.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_instrument_connect(
    cell: *const c_char,
    runtime_dir: *const c_char,
    limit_ns: u64,
    instrument: *mut *mut trued_instrument,
) -> trued_code {
    let connect_to = Instrument::connect_to;
    // SAFETY: the rules of the header.
    guard(|| unsafe { connect(&INSTRUMENTS, cell, runtime_dir, limit_ns, instrument, connect_to) })
}

/// Disconnects and frees the handle, within about a second. NULL is not an error.
#[unsafe(no_mangle)]
pub extern "C" fn trued_instrument_close(instrument: *mut trued_instrument) -> trued_code {
    guard(|| close(&INSTRUMENTS, instrument))
}

/// Sends a point in the instrument's own coordinates, three numbers, m, that was measured at `t_ns` of CLOCK_MONOTONIC; 0: the daemon assumes the latency
/// of its configuration. Send nothing while there is no measurement (beam interrupted). Does not block; a point that cannot be sent is lost and counted.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_instrument_send(
    instrument: *mut trued_instrument,
    point_m: *const f64,
    t_ns: u64,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header: three numbers.
        let point = unsafe { numbers("point_m", point_m, 3) }?;
        let point_m = [point[0], point[1], point[2]];
        INSTRUMENTS.with(instrument.addr(), |instrument| {
            instrument.send(point_m, (t_ns != 0).then_some(t_ns))?;
            Ok(trued_code::TRUED_OK)
        })
    })
}

/// Points lost so far.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_instrument_lost(
    instrument: *mut trued_instrument,
    lost: *mut u64,
) -> trued_code {
    guard(|| {
        if lost.is_null() {
            return Err(Fault::Null("lost"));
        }
        let count = INSTRUMENTS.with(instrument.addr(), |instrument| Ok(instrument.lost()))?;
        // SAFETY: the rules of the header.
        unsafe { put_if_any(lost, count) };
        Ok(trued_code::TRUED_OK)
    })
}

/// State of the connection.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_instrument_connection(
    instrument: *mut trued_instrument,
    connection: *mut trued_connection,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let connection = unsafe { place(connection) }?;
        let found = INSTRUMENTS.with(instrument.addr(), |instrument| {
            let away = instrument.disconnect_reason();
            Ok((instrument.connection(), away))
        })?;
        put(connection, Some(linked(found)))
    })
}

/// The next event of the connection not yet taken, oldest first; TRUED_NOTHING where there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_instrument_next_event(
    instrument: *mut trued_instrument,
    event: *mut trued_connection,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let event = unsafe { place(event) }?;
        let found =
            INSTRUMENTS.with(instrument.addr(), |instrument| Ok(instrument.next_event()))?;
        put(event, found.as_ref().map(translate::event))
    })
}
