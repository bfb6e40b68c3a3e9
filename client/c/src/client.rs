//! The robot's loop: commands out, corrected targets in.

use core::ffi::c_char;

use ::trued_client::{Client, Connection, Setpoint};

use crate::border::{given, limit, numbers, place, put_if_any};
use crate::code::{Fault, guard};
use crate::handle::Handles;
use crate::reply::{close, connect, put};
use crate::structs::*;
use crate::{translate, trued_code};

pub(crate) static CLIENTS: Handles<Client> = Handles::new(1);

/// Connects to the daemon of `cell` within the time limit. `runtime_dir` is the directory given to the daemon by
/// TRUED_RUNTIME_DIR; NULL: that of this process, or /dev/shm. `*client` is NULL where it fails.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_connect(
    cell: *const c_char,
    runtime_dir: *const c_char,
    limit_ns: u64,
    client: *mut *mut trued_client,
) -> trued_code {
    // SAFETY: the rules of the header.
    guard(|| unsafe { connect(&CLIENTS, cell, runtime_dir, limit_ns, client, Client::connect_to) })
}

/// Disconnects and frees the handle, within about a second. NULL is not an error.
#[unsafe(no_mangle)]
pub extern "C" fn trued_client_close(client: *mut trued_client) -> trued_code {
    guard(|| close(&CLIENTS, client))
}

/// Age limit of the daemon's answers in trued_client_target(); default 10 ms.
#[unsafe(no_mangle)]
pub extern "C" fn trued_client_set_fresh(client: *mut trued_client, fresh_ns: u64) -> trued_code {
    guard(|| {
        let fresh = limit(fresh_ns)?;
        CLIENTS.with(client.addr(), |client| {
            client.set_fresh(fresh);
            Ok(trued_code::TRUED_OK)
        })
    })
}

/// Starts a new run: the path history is reset. The correction continues from its present value.
#[unsafe(no_mangle)]
pub extern "C" fn trued_client_start_anew(client: *mut trued_client) -> trued_code {
    guard(|| {
        CLIENTS.with(client.addr(), |client| {
            client.start_anew();
            Ok(trued_code::TRUED_OK)
        })
    })
}

fn send(client: *mut trued_client, setpoint: &Setpoint) -> Result<u64, Fault> {
    CLIENTS.with(client.addr(), |client| Ok(client.send(setpoint)?))
}

/// Sends a commanded target. `seq` (may be NULL) gets its number. Does not block.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_send(
    client: *mut trued_client,
    setpoint: *const trued_setpoint,
    seq: *mut u64,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let setpoint = unsafe { given(setpoint) }?;
        let number = send(client, &translate::setpoint(&setpoint)?)?;
        // SAFETY: the rules of the header.
        unsafe { put_if_any(seq, number) };
        Ok(trued_code::TRUED_OK)
    })
}

/// The same for joints alone, valid now.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_send_joints(
    client: *mut trued_client,
    q: *const f64,
    joints: u32,
    seq: *mut u64,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let q = unsafe { numbers("q", q, translate::joints(joints)?) }?;
        let number = send(client, &Setpoint::new(q))?;
        // SAFETY: the rules of the header.
        unsafe { put_if_any(seq, number) };
        Ok(trued_code::TRUED_OK)
    })
}

/// Sends the measured state of the robot.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_send_state(
    client: *mut trued_client,
    state: *const trued_robot_state,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let state = translate::robot_state(&unsafe { given(state) }?)?;
        CLIENTS.with(client.addr(), |client| {
            client.send_state(&state)?;
            Ok(trued_code::TRUED_OK)
        })
    })
}

/// Sends the setpoints that follow the next command, in order and one command period apart: `count` points of `joints` numbers each, all joints of
/// the first point, then those of the next one. Call it before trued_client_send(). Of more than TRUED_HORIZON_POINTS_MAX points the first are sent; `sent` (may be
/// NULL) gets how many were. It replaces the last horizon; `count` 0 (`points` may be NULL) says that no setpoint is known ahead. Does not block.
/// TRUED_ERROR_ARGUMENT if a number is not finite: nothing was sent then.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_set_horizon(
    client: *mut trued_client,
    points: *const f64,
    joints: u32,
    count: u32,
    sent: *mut u32,
) -> trued_code {
    guard(|| {
        let joints = translate::joints(joints)?;
        let points = match (count as usize).min(TRUED_HORIZON_POINTS_MAX) {
            0 => &[][..],
            // SAFETY: the rules of the header.
            count => unsafe { numbers("points", points, count * joints) }?,
        };
        let count =
            CLIENTS.with(client.addr(), |client| Ok(client.set_horizon_flat(points, joints)?))?;
        // SAFETY: the rules of the header.
        unsafe { put_if_any(sent, count as u32) };
        Ok(trued_code::TRUED_OK)
    })
}

/// The joint target to send to the robot for `q_cmd` at `now_ns` (trued_monotonic_ns()), whatever the state of the daemon: `q_cmd` plus a
/// correction that continues from the last one sent, within the daemon's limits: towards the daemon's while its answer is fresh, else to
/// zero. Does not block. TRUED_ERROR_ARGUMENT if `q_cmd` is not finite: the state is then unchanged, and
/// trued_client_last_target() returns the last target sent.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_target(
    client: *mut trued_client,
    q_cmd: *const f64,
    joints: u32,
    now_ns: u64,
    target: *mut trued_target,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let target = unsafe { place(target) }?;
        // SAFETY: the same.
        let q_cmd = unsafe { numbers("q_cmd", q_cmd, translate::joints(joints)?) }?;
        let found = CLIENTS.with(client.addr(), |client| Ok(client.target_for(q_cmd, now_ns)?))?;
        put(target, Some(translate::target(&found)))
    })
}

/// The last target sent to the robot, for a loop that must send something and has no command; TRUED_NOTHING before the first target.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_last_target(
    client: *mut trued_client,
    target: *mut trued_target,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let target = unsafe { place(target) }?;
        let found = CLIENTS.with(client.addr(), |client| Ok(client.last_target()))?;
        put(target, found.as_ref().map(translate::target))
    })
}

/// Starts a new run. The robot is at its command plus this correction: rad or m, one number per joint. NULL and 0 joints mean zero:
/// the robot's program was restarted, and the controller's sum of corrections with it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_start_from(
    client: *mut trued_client,
    correction: *const f64,
    joints: u32,
) -> trued_code {
    guard(|| {
        let correction = if joints == 0 {
            &[][..]
        } else {
            // SAFETY: the rules of the header.
            unsafe { numbers("correction", correction, translate::joints(joints)?) }?
        };
        CLIENTS.with(client.addr(), |client| {
            client.start_from(correction);
            Ok(trued_code::TRUED_OK)
        })
    })
}

/// Sends joints and waits for the answer within the time limit; fills in `target` like trued_client_target() in any case.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_exchange(
    client: *mut trued_client,
    q_cmd: *const f64,
    joints: u32,
    limit_ns: u64,
    target: *mut trued_target,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let target = unsafe { place(target) }?;
        // SAFETY: the same.
        let q_cmd = unsafe { numbers("q_cmd", q_cmd, translate::joints(joints)?) }?;
        let limit = limit(limit_ns)?;
        let found = CLIENTS.with(client.addr(), |client| Ok(client.exchange(q_cmd, limit)?))?;
        put(target, Some(translate::target(&found)))
    })
}

/// The newest answer of this daemon, however old; TRUED_NOTHING before the first.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_newest(
    client: *mut trued_client,
    corrected: *mut trued_corrected,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let corrected = unsafe { place(corrected) }?;
        let found = CLIENTS.with(client.addr(), |client| Ok(client.newest()))?;
        put(corrected, found.as_ref().map(translate::corrected))
    })
}

/// The answer to the command of that number, within the limit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_wait_corrected(
    client: *mut trued_client,
    seq: u64,
    limit_ns: u64,
    corrected: *mut trued_corrected,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let corrected = unsafe { place(corrected) }?;
        let limit = limit(limit_ns)?;
        let found = CLIENTS.with(client.addr(), |client| {
            let found = client.wait_corrected(seq, limit);
            found.ok_or_else(|| match client.disconnect_reason() {
                Some(away) => Fault::NotSent(away.into()),
                None => Fault::TimedOut(limit),
            })
        })?;
        put(corrected, Some(translate::corrected(&found)))
    })
}

/// The newest status; TRUED_NOTHING before the first.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_status(
    client: *mut trued_client,
    status: *mut trued_status,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let status = unsafe { place(status) }?;
        let found = CLIENTS.with(client.addr(), |client| Ok(client.status()))?;
        put(status, found.as_ref().map(translate::status))
    })
}

/// The next verdict on vibration not yet taken; TRUED_NOTHING where there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_vibration(
    client: *mut trued_client,
    vibration: *mut trued_vibration,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let vibration = unsafe { place(vibration) }?;
        let found = CLIENTS.with(client.addr(), |client| Ok(client.vibration()))?;
        put(vibration, found.as_ref().map(translate::vibration))
    })
}

/// State of the connection.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_connection(
    client: *mut trued_client,
    connection: *mut trued_connection,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let connection = unsafe { place(connection) }?;
        let found = CLIENTS
            .with(client.addr(), |client| Ok((client.connection(), client.disconnect_reason())))?;
        put(connection, Some(linked(found)))
    })
}

/// The next event of the connection not yet taken, oldest first; TRUED_NOTHING where there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trued_client_next_event(
    client: *mut trued_client,
    event: *mut trued_connection,
) -> trued_code {
    guard(|| {
        // SAFETY: the rules of the header.
        let event = unsafe { place(event) }?;
        let found = CLIENTS.with(client.addr(), |client| Ok(client.next_event()))?;
        put(event, found.as_ref().map(translate::event))
    })
}

/// How it is, and why not.
pub(crate) fn linked(
    (how, away): (Connection, Option<::trued_client::DisconnectReason>),
) -> trued_connection {
    let why =
        away.map_or(trued_code::TRUED_OK, |away| ::trued_client::ErrorKind::from(away).into());
    translate::connection(how, why)
}
