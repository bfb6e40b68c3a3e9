//! Outputs of the library as Python objects: read-only fields, and arrays that are created once and then viewed.

use numpy::{PyArray1, PyArrayMethods, PyUntypedArrayMethods, ToPyArray};
use pyo3::prelude::*;
use shm_schema::{
    Advice, InCut, RecorderState, Response, SensorFault, Verdict, VibrationClass, VibrationState,
    WrenchGate,
};
use trued_client::{ConnectionEvent, ErrorKind, ForceFault, Source, channel_name};

type Array = Py<PyArray1<f64>>;

/// An array that Python may look at and not change.
fn array(py: Python<'_>, numbers: &[f64]) -> Array {
    let made = numbers.to_pyarray(py);
    debug_assert!(made.len() == numbers.len());
    made.readwrite().make_nonwriteable();
    made.unbind()
}

/// A code as its name; a later daemon's as its number.
fn code_name<T: TryFrom<u32> + std::fmt::Display>(code: u32) -> String {
    T::try_from(code).map_or_else(|_| format!("code {code}"), |known| known.to_string())
}

/// Those of a set, as words.
fn set<T: TryFrom<u32> + std::fmt::Display>(bits: u32) -> Vec<String> {
    (0..32).filter(|bit| bits & 1 << bit != 0).map(code_name::<T>).collect()
}

/// A joint target, to be sent to the robot.
#[pyclass(frozen, get_all, module = "trued")]
pub(crate) struct Target {
    joints: Array,
    source: &'static str,
    feed_override: f64,
}

impl Target {
    pub(crate) fn new(py: Python<'_>, from: &trued_client::Target) -> Self {
        let source = match from.source() {
            Source::Corrected => "corrected",
            Source::LastCorrection => "last_correction",
            Source::Ramping => "ramping",
            Source::Plain => "plain",
        };
        let joints = array(py, from.joints());
        Self { joints, source, feed_override: from.feed_override() }
    }
}

/// The daemon's answer to a command.
#[pyclass(frozen, get_all, module = "trued")]
pub(crate) struct Corrected {
    seq: u64,
    command_seq: u64,
    t_ns: u64,
    received_ns: u64,
    made_ns: u64,
    model_epoch: u64,
    status: String,
    reason: String,
    wrench_gate: String,
    iterations: u32,
    correction: Array,
    correction_rate: Array,
    correction_acceleration: Array,
    wanted: Array,
    residual_m: f64,
    residual_rad: f64,
    feed_override: f64,
}

impl Corrected {
    pub(crate) fn new(py: Python<'_>, from: &trued_client::Corrected) -> Self {
        let count = from.correction().len();
        let all = |numbers: &[f64]| array(py, &numbers[..count]);
        Self {
            seq: from.seq,
            command_seq: from.command_seq,
            t_ns: from.t_ns,
            received_ns: from.received_ns,
            made_ns: from.made_ns,
            model_epoch: from.model_epoch,
            status: code_name::<trued_client::CorrectionStatus>(from.status),
            reason: code_name::<trued_client::Reason>(from.reason),
            wrench_gate: code_name::<WrenchGate>(from.wrench_gate),
            iterations: from.iterations,
            correction: all(&from.correction),
            correction_rate: all(&from.correction_rate),
            correction_acceleration: all(&from.correction_acceleration),
            wanted: all(&from.wanted),
            residual_m: from.residual_m,
            residual_rad: from.residual_rad,
            feed_override: from.feed_override,
        }
    }
}

/// State of the daemon.
#[pyclass(frozen, get_all, module = "trued")]
pub(crate) struct Status {
    pid: u32,
    seq: u64,
    t_ns: u64,
    started_ns: u64,
    model_epoch: u64,
    model_hash: u64,
    cycles: u64,
    missed_cycles: u64,
    commands: u64,
    rejected: u64,
    held: u64,
    stale: u64,
    commands_lost: u64,
    corrected_lost: u64,
    force_blocks: u64,
    force_gaps: u64,
    force_refused: u64,
    malformed: u64,
    recorder_dropped: u64,
    latency_p50_ns: u64,
    latency_p99_ns: u64,
    latency_p999_ns: u64,
    latency_max_ns: u64,
    model_broken_since_ns: u64,
    model_measurements: u64,
    model_residual_m: f64,
    wrench_loop_gain: f64,
    spindle_rpm: f64,
    feed_mm_s: f64,
    health: String,
    mode: String,
    bypassed: bool,
    joints: u32,
    wrench_gate: String,
    recorder: String,
    watch: String,
    in_cut: String,
    uncompensated_effects: u32,
    force_faults: Vec<String>,
    q_min: Array,
    q_max: Array,
    correction_max: Array,
    correction_rate_max: Array,
    correction_jerk_max: Array,
    message: String,
    geometry_hash: u64,
    stale_temperatures: u32,
    robot_maker: String,
    robot_type: String,
    robot_serial: String,
    q_command: Array,
    correction: Array,
    trim_state: String,
    trim_reason: String,
    trim_m: (f64, f64, f64),
    trim_found_m: (f64, f64, f64),
    trim_measurements: u64,
    trim_refused: u64,
    feed_state: String,
    feed_reason: String,
    feed_override: f64,
    feed_wanted: f64,
    feed_force_n: f64,
    feed_programmed_force_n: f64,
    feed_limit_n: f64,
    feed_speed_m_s: f64,
    feed_refused: u64,
    latency_sum_ns: u64,
    latency_counts: Vec<u64>,
    lead_state: String,
    horizon_points: u32,
    horizon_points_used: u32,
    horizons_refused: u32,
}

/// A struct of fields that the message has by the same name, and of others.
macro_rules! copied {
    ($from:ident, $name:ident { $($same:ident),* $(,)? } $($other:ident: $value:expr,)*) => {
        $name { $($same: $from.$same,)* $($other: $value,)* }
    };
}

impl Status {
    pub(crate) fn new(py: Python<'_>, from: &trued_client::Status) -> Self {
        let count = (from.joints as usize).min(trued_client::JOINTS_MAX);
        let all = |numbers: &[f64]| array(py, &numbers[..count]);
        copied!(from, Self {
                pid, seq, t_ns, started_ns, model_epoch, model_hash, cycles, missed_cycles,
                commands, rejected, held, stale, commands_lost, corrected_lost, force_blocks,
                force_gaps, force_refused, malformed, recorder_dropped, latency_p50_ns,
                latency_p99_ns, latency_p999_ns, latency_max_ns, model_broken_since_ns,
                model_measurements, model_residual_m, wrench_loop_gain, spindle_rpm, feed_mm_s,
                joints, uncompensated_effects, geometry_hash, stale_temperatures,
                trim_measurements, trim_refused, feed_override, feed_wanted, feed_force_n,
                feed_programmed_force_n, feed_limit_n, feed_speed_m_s, feed_refused, latency_sum_ns,
                horizon_points, horizon_points_used, horizons_refused,
            }
            health: code_name::<trued_client::Health>(from.health),
            mode: code_name::<trued_client::Mode>(from.mode),
            bypassed: from.bypassed != 0,
            wrench_gate: code_name::<WrenchGate>(from.wrench_gate),
            recorder: code_name::<RecorderState>(from.recorder),
            watch: code_name::<trued_client::WatchState>(from.watch),
            in_cut: code_name::<InCut>(from.in_cut),
            force_faults: from.force_faults().map(|f: ForceFault| f.to_string()).collect(),
            q_min: all(&from.bounds.min),
            q_max: all(&from.bounds.max),
            correction_max: all(&from.bounds.angle),
            correction_rate_max: all(&from.bounds.rate),
            correction_jerk_max: all(&from.bounds.jerk),
            message: from.message.to_string(),
            robot_maker: from.robot_maker.to_string(),
            robot_type: from.robot_type.to_string(),
            robot_serial: from.robot_serial.to_string(),
            q_command: all(&from.q_command),
            correction: all(&from.correction),
            lead_state: code_name::<trued_client::LeadState>(from.lead_state),
            trim_state: code_name::<trued_client::TrimState>(from.trim_state),
            trim_reason: code_name::<trued_client::TrimReason>(from.trim_reason),
            trim_m: from.trim_m.into(),
            trim_found_m: from.trim_found_m.into(),
            feed_state: code_name::<trued_client::FeedState>(from.feed_state),
            feed_reason: code_name::<trued_client::FeedReason>(from.feed_reason),
            latency_counts: from.latency_counts.to_vec(),
        )
    }
}

#[pymethods]
impl Status {
    /// For `print`: the state in one line, and the daemon's words.
    fn __str__(&self) -> String {
        let bypassed = if self.bypassed { "bypassed" } else { "not bypassed" };
        format!(
            "{}, mode {}, {bypassed}; commands {} (rejected {}), late cycles {}; \
             latency 99 % {:.1} us; recorder {}\n{}",
            self.health,
            self.mode,
            self.commands,
            self.rejected,
            self.missed_cycles,
            self.latency_p99_ns as f64 * 1e-3,
            self.recorder,
            self.message
        )
    }

    fn __repr__(&self) -> String {
        let bypassed = if self.bypassed { "True" } else { "False" };
        format!(
            "Status(health={:?}, mode={:?}, bypassed={bypassed}, message={:?})",
            self.health, self.mode, self.message
        )
    }
}

/// One verdict on one line of the force spectrum.
#[pyclass(frozen, get_all, module = "trued")]
pub(crate) struct Vibration {
    state: String,
    kind: String,
    rivals: Vec<String>,
    axis: &'static str,
    suspect_alias: bool,
    advice: String,
    sensor_faults: Vec<String>,
    advice_lobe: u32,
    gear_joint: u32,
    gear_shaft: u32,
    seq: u64,
    t_ns: u64,
    made_ns: u64,
    event: u64,
    frequency_hz: f64,
    amplitude: f64,
    growth_per_s: f64,
    advice_rpm: f64,
    nearest_mode_hz: f64,
    mode_distance_hz: f64,
    nearest_harmonic_hz: f64,
    harmonic_distance_hz: f64,
    nearest_alias_hz: f64,
    alias_distance_hz: f64,
    sentence: String,
}

impl From<&Verdict> for Vibration {
    fn from(from: &Verdict) -> Self {
        Self {
            state: code_name::<VibrationState>(from.state),
            kind: code_name::<VibrationClass>(from.class),
            rivals: set::<VibrationClass>(from.rivals),
            axis: channel_name(from.axis),
            suspect_alias: from.suspect_alias != 0,
            advice: code_name::<Advice>(from.advice),
            sensor_faults: set::<SensorFault>(from.sensor_faults),
            advice_lobe: from.advice_lobe,
            gear_joint: from.gear_joint,
            gear_shaft: from.gear_shaft,
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
            sentence: from.to_string(),
        }
    }
}

/// State of the connection, or an event.
#[pyclass(frozen, get_all, module = "trued")]
pub(crate) struct Connection {
    is_connected: bool,
    pid: Option<u32>,
    epoch: Option<u64>,
    why: Option<&'static str>,
    words: String,
}

impl Connection {
    pub(crate) fn new(
        from: trued_client::Connection,
        away: Option<trued_client::DisconnectReason>,
    ) -> Self {
        match from {
            trued_client::Connection::Connected { pid, epoch } => Self::joined(pid, epoch),
            trued_client::Connection::Lost => {
                Self::lost(away, away.map(|away| away.to_string()).unwrap_or_default())
            }
        }
    }

    fn joined(pid: u32, epoch: u64) -> Self {
        let words = format!("connected to the daemon with process ID {pid}");
        let (pid, epoch) = (Some(pid), Some(epoch));
        Self { is_connected: true, pid, epoch, why: None, words }
    }

    fn lost(away: Option<trued_client::DisconnectReason>, words: String) -> Self {
        let why = away.map(|away| ErrorKind::from(away).name());
        Self { is_connected: false, pid: None, epoch: None, why, words }
    }
}

impl From<ConnectionEvent> for Connection {
    fn from(from: ConnectionEvent) -> Self {
        match from {
            ConnectionEvent::Connected { pid, epoch } => Self::joined(pid, epoch),
            ConnectionEvent::Lost { disconnect_reason, why } => {
                Self::lost(Some(disconnect_reason), why)
            }
        }
    }
}

/// The daemon's answer to a request.
#[pyclass(frozen, get_all, module = "trued")]
pub(crate) struct Answer {
    t_ns: u64,
    message: String,
}

#[pymethods]
impl Answer {
    fn __repr__(&self) -> String {
        format!("Answer(message={:?})", self.message)
    }
}

impl From<&Response> for Answer {
    fn from(from: &Response) -> Self {
        Self { t_ns: from.t_ns, message: from.message.to_string() }
    }
}
