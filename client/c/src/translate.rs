//! Conversion between the C structs and those of the client library.
//!
//! Promise: inputs are checked here, each error with its field; outputs of the library are passed on unchanged.

use core::ffi::c_char;

use ::trued_client::{
    Connection, ConnectionEvent, Corrected, ForceSamples, Measured, ProcessState, Response,
    Samples, Setpoint, Status, Target, Verdict, WrenchFrame,
};
use shm_schema::{InCut, Mode, RecorderAction, RobotState};

use crate::border::{limit, numbers};
use crate::code::Fault;
use crate::structs::*;
use crate::{trued_code, trued_source};

const SETPOINT_FLAGS: u32 = TRUED_HAS_WRENCH
    | TRUED_WRENCH_IN_BASE
    | TRUED_SETTLED
    | TRUED_HAS_DIRECTION
    | TRUED_HAS_TEMPERATURE;
const STATE_FLAGS: u32 = TRUED_STATE_HAS_Q | TRUED_STATE_HAS_TAU | TRUED_STATE_HAS_TEMPERATURE;
const FORCE_CHANNELS_MAX: u32 = 6;
const FORCE_SAMPLES_MAX: u32 = 512;

/// How many joints, where that many can be.
pub(crate) fn joints(count: u32) -> Result<usize, Fault> {
    within("joints", count, 1, TRUED_JOINTS_MAX as u32, "1 to 16").map(|()| count as usize)
}

fn within(
    what: &'static str,
    value: u32,
    min: u32,
    max: u32,
    expected: &'static str,
) -> Result<(), Fault> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    Err(Fault::Argument { what, value: u64::from(value), expected })
}

fn flags(value: u32, known: u32) -> Result<(), Fault> {
    if value & !known == 0 {
        return Ok(());
    }
    let expected = "flags of this version of the library";
    Err(Fault::Argument { what: "flags", value: u64::from(value), expected })
}

pub(crate) fn setpoint(from: &trued_setpoint) -> Result<Setpoint, Fault> {
    let count = joints(from.joints)?;
    flags(from.flags, SETPOINT_FLAGS)?;
    let has = |flag: u32| from.flags & flag != 0;
    let mut to = Setpoint::new(&from.q[..count]).at_ns(from.t_ns);
    if has(TRUED_HAS_WRENCH) {
        let in_base = has(TRUED_WRENCH_IN_BASE);
        to = to.wrench(from.wrench, frame(in_base));
    }
    if has(TRUED_HAS_TEMPERATURE) {
        let [ambient, joints @ ..] = &from.temperature_c;
        to = to.temperatures(*ambient, &joints[..count]);
    }
    if has(TRUED_HAS_DIRECTION) {
        to = to.direction(&from.direction[..count]);
    }
    Ok(if has(TRUED_SETTLED) { to.settled() } else { to })
}

fn frame(in_base: bool) -> WrenchFrame {
    if in_base { WrenchFrame::Base } else { WrenchFrame::Tool }
}

pub(crate) fn robot_state(from: &trued_robot_state) -> Result<RobotState, Fault> {
    joints(from.joints)?;
    flags(from.flags, STATE_FLAGS)?;
    Ok(RobotState {
        t_ns: from.t_ns,
        joints: from.joints,
        flags: from.flags,
        q_measured: from.q_measured,
        tau: from.tau,
        temperature_c: from.temperature_c,
        ..RobotState::default()
    })
}

/// The samples, where they stand.
///
/// # Safety
/// `doubles` or `floats` points to `channels` times `count` readable numbers, for as long as the answer lives.
pub(crate) unsafe fn force<'a>(from: &trued_force_samples) -> Result<ForceSamples<'a>, Fault> {
    within("channels", from.channels, 3, FORCE_CHANNELS_MAX, "3 to 6")?;
    within("count", from.count, 1, FORCE_SAMPLES_MAX, "1 to 512 samples per channel")?;
    within("in_base", from.in_base, 0, 1, "0 or 1")?;
    let count = from.channels as usize * from.count as usize;
    let samples = match (from.doubles.is_null(), from.floats.is_null()) {
        // SAFETY: the caller's promise; the count is bounded above.
        (false, true) => Samples::F64(unsafe { numbers("doubles", from.doubles, count) }?),
        // SAFETY: the same.
        (true, false) => Samples::F32(unsafe { numbers("floats", from.floats, count) }?),
        (true, true) => return Err(Fault::Null("doubles")),
        (false, false) => {
            return Err(Fault::Malformed { what: "floats", expected: "NULL if doubles are given" });
        }
    };
    let (channels, frame) = (from.channels as usize, frame(from.in_base == 1));
    Ok(ForceSamples { t_ns: from.t_ns, rate_hz: from.rate_hz, channels, frame, samples })
}

/// A mode that the program asks for.
pub(crate) fn mode(code: u32) -> Result<Mode, Fault> {
    let (what, value, expected) = ("mode", u64::from(code), "a trued_mode");
    Mode::try_from(code).map_err(|_| Fault::Argument { what, value, expected })
}

/// What the program asks of a recorder.
pub(crate) fn recorder_action(code: u32) -> Result<RecorderAction, Fault> {
    let (what, value, expected) = ("action", u64::from(code), "a trued_recorder_action");
    RecorderAction::try_from(code).map_err(|_| Fault::Argument { what, value, expected })
}

pub(crate) fn process(from: &trued_process) -> Result<ProcessState, Fault> {
    let in_cut = match InCut::try_from(from.in_cut) {
        Ok(InCut::Unknown) => None,
        Ok(InCut::Air) => Some(false),
        Ok(InCut::Cut) => Some(true),
        Err(_) => {
            let (what, value) = ("in_cut", u64::from(from.in_cut));
            return Err(Fault::Argument { what, value, expected: "a trued_in_cut" });
        }
    };
    Ok(ProcessState {
        spindle_rpm: from.spindle_rpm,
        teeth: from.teeth,
        feed_mm_s: from.feed_mm_s,
        in_cut,
        holds_for: if from.holds_ns == 0 { None } else { Some(limit(from.holds_ns)?) },
    })
}

pub(crate) fn measured(from: &trued_measured) -> Result<Measured<'_>, Fault> {
    let count = joints(from.joints)?;
    Ok(Measured {
        joints: &from.q[..count],
        direction: &from.direction[..count],
        point_m: from.point_m,
        sigma_m: from.sigma_m,
        ambient_c: from.ambient_c,
    })
}

pub(crate) fn target(from: &Target) -> trued_target {
    let mut q = [0.0; TRUED_JOINTS_MAX];
    let joints = from.joints();
    q[..joints.len()].copy_from_slice(joints);
    let source = trued_source::from(from.source()) as u32;
    let (joints, feed_override) = (joints.len() as u32, from.feed_override());
    trued_target { struct_size: 0, joints, source, reserved: 0, q, feed_override }
}

pub(crate) fn corrected(from: &Corrected) -> trued_corrected {
    trued_corrected {
        struct_size: 0,
        joints: from.joints,
        status: from.status,
        reason: from.reason,
        wrench_gate: from.wrench_gate,
        iterations: from.iterations,
        seq: from.seq,
        command_seq: from.command_seq,
        t_ns: from.t_ns,
        received_ns: from.received_ns,
        made_ns: from.made_ns,
        model_epoch: from.model_epoch,
        correction: from.correction,
        correction_rate: from.correction_rate,
        correction_acceleration: from.correction_acceleration,
        wanted: from.wanted,
        residual_m: from.residual_m,
        residual_rad: from.residual_rad,
        feed_override: from.feed_override,
    }
}

/// A struct of fields that the message has by the same name, and of others.
macro_rules! copied {
    ($from:ident, $name:ident { $($same:ident),* $(,)? } $($other:ident: $value:expr,)*) => {
        $name { $($same: $from.$same,)* $($other: $value,)* }
    };
}

pub(crate) fn status(from: &Status) -> trued_status {
    copied!(from, trued_status {
            pid, seq, t_ns, started_ns, model_epoch, model_hash, cycles, missed_cycles,
            commands, rejected, held, stale, commands_lost, corrected_lost, force_blocks,
            force_gaps, force_refused, malformed, recorder_dropped, latency_p50_ns,
            latency_p99_ns, latency_p999_ns, latency_max_ns, model_broken_since_ns,
            model_measurements, model_residual_m, wrench_loop_gain, spindle_rpm, feed_mm_s,
            health, mode, bypassed, joints, wrench_gate, recorder, watch, in_cut,
            uncompensated_effects, stream_faults, channel_faults, geometry_hash,
            stale_temperatures, q_command, correction, trim_state, trim_reason, trim_m,
            trim_found_m, trim_measurements, trim_refused, feed_state, feed_reason,
            feed_override, feed_wanted, feed_force_n, feed_programmed_force_n, feed_limit_n,
            feed_speed_m_s, feed_refused, latency_sum_ns, latency_counts,
            lead_state, horizon_points, horizon_points_used, horizons_refused,
        }
        struct_size: 0,
        q_min: from.bounds.min,
        q_max: from.bounds.max,
        correction_max: from.bounds.angle,
        correction_rate_max: from.bounds.rate,
        correction_jerk_max: from.bounds.jerk,
        message: c_text(from.message.as_str()),
        reserved: 0,
        robot_maker: c_text(from.robot_maker.as_str()),
        robot_type: c_text(from.robot_type.as_str()),
        robot_serial: c_text(from.robot_serial.as_str()),
    )
}

pub(crate) fn vibration(from: &Verdict) -> trued_vibration {
    trued_vibration {
        struct_size: 0,
        state: from.state,
        kind: from.class,
        rivals: from.rivals,
        axis: from.axis,
        suspect_alias: from.suspect_alias,
        advice: from.advice,
        sensor_faults: from.sensor_faults,
        advice_lobe: from.advice_lobe,
        gear_joint: from.gear_joint,
        gear_shaft: from.gear_shaft,
        reserved: 0,
        seq: from.seq,
        t_ns: from.t_ns,
        made_ns: from.made_ns,
        event: from.event,
        frequency_hz: from.frequency_hz,
        amplitude: from.amplitude,
        growth_per_s: from.growth_per_s,
        advice_rpm: from.advice_rpm,
        nearest_mode_hz: from.nearest_mode_hz,
        mode_distance_hz: from.mode_distance_hz,
        nearest_harmonic_hz: from.nearest_harmonic_hz,
        harmonic_distance_hz: from.harmonic_distance_hz,
        nearest_alias_hz: from.nearest_alias_hz,
        alias_distance_hz: from.alias_distance_hz,
        sentence: c_text(&from.to_string()),
    }
}

pub(crate) fn connection(from: Connection, why: trued_code) -> trued_connection {
    match from {
        Connection::Connected { pid, epoch } => linked(pid, epoch),
        Connection::Lost => severed(why, ""),
    }
}

pub(crate) fn event(from: &ConnectionEvent) -> trued_connection {
    match from {
        ConnectionEvent::Connected { pid, epoch } => linked(*pid, *epoch),
        ConnectionEvent::Lost { disconnect_reason, why } => {
            severed(::trued_client::ErrorKind::from(*disconnect_reason).into(), why)
        }
    }
}

fn linked(pid: u32, epoch: u64) -> trued_connection {
    let why = trued_code::TRUED_OK as i32;
    trued_connection { struct_size: 0, is_connected: 1, pid, why, epoch, words: c_text("") }
}

fn severed(why: trued_code, text: &str) -> trued_connection {
    let (why, words) = (why as i32, c_text(text));
    trued_connection { struct_size: 0, is_connected: 0, pid: 0, why, epoch: 0, words }
}

pub(crate) fn answer(from: &Response) -> trued_answer {
    let message = c_text(from.message.as_str());
    trued_answer { struct_size: 0, answer: from.answer, t_ns: from.t_ns, message }
}

/// A text in C's form, cut at a whole character where it is too long.
fn c_text<const N: usize>(text: &str) -> [c_char; N] {
    let mut end = text.len().min(N - 1);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let mut bytes = [0; N];
    for (to, from) in bytes.iter_mut().zip(&text.as_bytes()[..end]) {
        *to = from.cast_signed() as c_char;
    }
    bytes
}
