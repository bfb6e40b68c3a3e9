//! Conversion of shared-memory messages to the messages of recordings and live views.

use recording::mcap_recording::{StatusRecord, VerdictRecord};
use shm_schema::{
    Health, JOINTS_MAX, Mode, Status, Verdict, VibrationClass, VibrationState, channel_name,
};

/// The daemon's state.
#[must_use]
pub fn status(status: &Status) -> StatusRecord {
    let count = (status.joints as usize).min(JOINTS_MAX);
    let joints = |all: &[f64; JOINTS_MAX]| all[..count].to_vec();
    StatusRecord {
        t_ns: status.t_ns,
        health: status.health().map_or("", Health::name).to_owned(),
        says: status.message.to_string(),
        cycles: status.cycles,
        missed: status.missed_cycles,
        rejected: status.rejected,
        dropped: status.recorder_dropped,
        mode: status.mode().map_or("", Mode::name).to_owned(),
        bypassed: u8::from(status.bypassed != 0),
        model_epoch: status.model_epoch,
        latency_p50_ns: status.latency_p50_ns,
        latency_p99_ns: status.latency_p99_ns,
        latency_p999_ns: status.latency_p999_ns,
        latency_max_ns: status.latency_max_ns,
        q_command: joints(&status.q_command),
        correction: joints(&status.correction),
    }
}

/// A verdict of the vibration monitor.
#[must_use]
pub fn verdict(verdict: &Verdict) -> VerdictRecord {
    let state = verdict.state().unwrap_or(VibrationState::Over);
    let class = verdict.class().unwrap_or(VibrationClass::Unknown);
    VerdictRecord {
        t_ns: verdict.t_ns,
        state: state.to_string(),
        class: class.to_string(),
        axis: channel_name(verdict.axis).to_owned(),
        frequency_hz: verdict.frequency_hz,
        amplitude_n: verdict.amplitude,
        floor_n: f64::NAN,
        suspect_alias: u8::from(verdict.suspect_alias != 0),
    }
}
