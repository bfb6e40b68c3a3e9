//! Output structs.
//!
//! Promise: as [`super`] has it.

use core::ffi::c_char;

use super::{TRUED_JOINTS_MAX, TRUED_LATENCY_BUCKETS, TRUED_NAME_MAX, TRUED_WORDS_MAX, grows};

/// A joint target, to be sent to the robot.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_target {
    /// sizeof(trued_target).
    pub struct_size: u32,
    /// As many as the command had.
    pub joints: u32,
    /// Origin of the correction: a trued_source.
    pub source: u32,
    /// Zero.
    pub reserved: u32,
    /// The target.
    pub q: [f64; TRUED_JOINTS_MAX],
    /// The share of the programmed feed to go on with, above 0 to 1; 1 in a cell that adapts no feed.
    pub feed_override: f64,
}

/// The daemon's answer to a command.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_corrected {
    /// sizeof(trued_corrected).
    pub struct_size: u32,
    /// How many joints; 0 before the first valid command.
    pub joints: u32,
    /// A trued_correction_status.
    pub status: u32,
    /// A trued_reason.
    pub reason: u32,
    /// A trued_wrench_gate.
    pub wrench_gate: u32,
    /// Newton iterations.
    pub iterations: u32,
    /// From 1, plus 1 with each answer of this daemon.
    pub seq: u64,
    /// The number of the command that it answers, as returned by trued_client_send().
    pub command_seq: u64,
    /// The `t_ns` of that command.
    pub t_ns: u64,
    /// When the daemon received that command.
    pub received_ns: u64,
    /// When this answer was computed.
    pub made_ns: u64,
    /// Epoch of the model that computed it: plus 1 with each change of the model.
    pub model_epoch: u64,
    /// The correction contained in `q`.
    pub correction: [f64; TRUED_JOINTS_MAX],
    /// Its rate, per s.
    pub correction_rate: [f64; TRUED_JOINTS_MAX],
    /// Its acceleration, per s^2.
    pub correction_acceleration: [f64; TRUED_JOINTS_MAX],
    /// The correction requested by the model, before limiting; not zero in shadow mode, unlike `correction`.
    pub wanted: [f64; TRUED_JOINTS_MAX],
    /// Undamped residual of the solution, position, m.
    pub residual_m: f64,
    /// Undamped residual of the solution, orientation, rad.
    pub residual_rad: f64,
    /// Share of the programmed feed that keeps the force under its limit; trued_target has the one to go on with.
    pub feed_override: f64,
}

/// State of the daemon. Unknown values are NaN.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_status {
    /// sizeof(trued_status).
    pub struct_size: u32,
    /// The daemon's process.
    pub pid: u32,
    /// From 1, plus 1 with each status of this daemon.
    pub seq: u64,
    /// When it was made.
    pub t_ns: u64,
    /// When the daemon started.
    pub started_ns: u64,
    /// Plus 1 with each change of the model.
    pub model_epoch: u64,
    /// Identity of the model.
    pub model_hash: u64,
    /// Cycles run.
    pub cycles: u64,
    /// Cycles that came too late.
    pub missed_cycles: u64,
    /// Commands taken.
    pub commands: u64,
    /// Commands refused.
    pub rejected: u64,
    /// Targets with the last correction held.
    pub held: u64,
    /// Interruptions of the command stream.
    pub stale: u64,
    /// Commands lost.
    pub commands_lost: u64,
    /// Targets that could not be sent.
    pub corrected_lost: u64,
    /// Force blocks taken.
    pub force_blocks: u64,
    /// Force blocks lost.
    pub force_gaps: u64,
    /// Force blocks refused.
    pub force_refused: u64,
    /// Messages that could not be read.
    pub malformed: u64,
    /// Records dropped by the recorder.
    pub recorder_dropped: u64,
    /// Latency from sending a command to its answer: median.
    pub latency_p50_ns: u64,
    /// The same at 99 %.
    pub latency_p99_ns: u64,
    /// The same at 99.9 %.
    pub latency_p999_ns: u64,
    /// The worst.
    pub latency_max_ns: u64,
    /// Since when measurements of the tool contradict the model; 0 while they agree.
    pub model_broken_since_ns: u64,
    /// Measurements of the tool since the model was loaded.
    pub model_measurements: u64,
    /// RMS deviation of the latest of them from the model, m.
    pub model_residual_m: f64,
    /// Loop gain of the wrench correction.
    pub wrench_loop_gain: f64,
    /// Spindle speed used by the vibration monitor, 1/min.
    pub spindle_rpm: f64,
    /// Feed that it uses, mm/s.
    pub feed_mm_s: f64,
    /// A trued_health.
    pub health: u32,
    /// A trued_mode.
    pub mode: u32,
    /// 1 where bypassed.
    pub bypassed: u32,
    /// How many joints the model has.
    pub joints: u32,
    /// A trued_wrench_gate.
    pub wrench_gate: u32,
    /// A trued_recorder_state.
    pub recorder: u32,
    /// A trued_watch_state.
    pub watch: u32,
    /// A trued_in_cut, as reported.
    pub in_cut: u32,
    /// Effects of the model that are not compensated.
    pub uncompensated_effects: u32,
    /// What is wrong with the force stream: bit n is the trued_sensor_fault n.
    pub stream_faults: u32,
    /// The same of each force channel.
    pub channel_faults: [u32; 6],
    /// Lower joint limits.
    pub q_min: [f64; TRUED_JOINTS_MAX],
    /// Upper joint limits.
    pub q_max: [f64; TRUED_JOINTS_MAX],
    /// Largest correction.
    pub correction_max: [f64; TRUED_JOINTS_MAX],
    /// Largest rate of the correction, per s.
    pub correction_rate_max: [f64; TRUED_JOINTS_MAX],
    /// Largest jerk of the correction, per s^3.
    pub correction_jerk_max: [f64; TRUED_JOINTS_MAX],
    /// Message for the operator.
    pub message: [c_char; TRUED_WORDS_MAX],
    /// Hash of the robot's nominal geometry: kinds and axes of the joints, nothing else.
    pub geometry_hash: u64,
    /// Temperatures that are stale: bit 0 the ambient one, bit n that of joint n.
    pub stale_temperatures: u32,
    /// Zero.
    pub reserved: u32,
    /// The robot's manufacturer as the model states it; empty where it does not.
    pub robot_maker: [c_char; TRUED_NAME_MAX],
    /// The robot's type, likewise.
    pub robot_type: [c_char; TRUED_NAME_MAX],
    /// The robot's serial number, likewise.
    pub robot_serial: [c_char; TRUED_NAME_MAX],
    /// The last command, rad or m.
    pub q_command: [f64; TRUED_JOINTS_MAX],
    /// The correction that the daemon allowed for it, rad or m.
    pub correction: [f64; TRUED_JOINTS_MAX],
    /// A trued_trim_state.
    pub trim_state: u32,
    /// A trued_trim_reason.
    pub trim_reason: u32,
    /// Displacement of the tool's target by the trim, base frame, m.
    pub trim_m: [f64; 3],
    /// Estimated error of the model, base frame, m: measured minus predicted.
    pub trim_found_m: [f64; 3],
    /// Measured points received.
    pub trim_measurements: u64,
    /// Measured points refused.
    pub trim_refused: u64,
    /// A trued_feed_state.
    pub feed_state: u32,
    /// A trued_feed_reason.
    pub feed_reason: u32,
    /// The feed override; 1 is the programmed feed.
    pub feed_override: f64,
    /// The override that keeps the force at its limit.
    pub feed_wanted: f64,
    /// The process force, low-passed, N.
    pub feed_force_n: f64,
    /// What it would be at the programmed feed, N.
    pub feed_programmed_force_n: f64,
    /// The limit as a force, N.
    pub feed_limit_n: f64,
    /// Speed of the commanded tool, m/s.
    pub feed_speed_m_s: f64,
    /// Wrenches that were refused: no numbers.
    pub feed_refused: u64,
    /// Sum of all latencies since the start.
    pub latency_sum_ns: u64,
    /// Histogram of latencies since the start: the first entry counts those below 2^10 ns, entry n those from 2^(9+n) to below 2^(10+n) ns, the
    /// last one all longer ones.
    pub latency_counts: [u64; TRUED_LATENCY_BUCKETS],
    /// A trued_lead_state.
    pub lead_state: u32,
    /// Setpoints after the last command that were known, of those that the lead uses.
    pub horizon_points: u32,
    /// Setpoints after a command that the lead uses.
    pub horizon_points_used: u32,
    /// Horizons that were refused: a command differed from them, or no joint could follow them.
    pub horizons_refused: u32,
}

/// One verdict on one line of the force spectrum. Unknown values are NaN.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_vibration {
    /// sizeof(trued_vibration).
    pub struct_size: u32,
    /// A trued_vibration_state.
    pub state: u32,
    /// A trued_vibration_class.
    pub kind: u32,
    /// Possible classes: bit n is the trued_vibration_class n.
    pub rivals: u32,
    /// Channel: 0 to 5 for Fx Fy Fz Mx My Mz.
    pub axis: u32,
    /// 1 if the line may be an alias of a frequency above half the sampling rate.
    pub suspect_alias: u32,
    /// A trued_advice.
    pub advice: u32,
    /// What is wrong with its channel and the stream: bit n is the trued_sensor_fault n.
    pub sensor_faults: u32,
    /// The number of the stability pocket that the advice names; 0: none.
    pub advice_lobe: u32,
    /// The joint with a gear shaft at this frequency, from 1; 0: none.
    pub gear_joint: u32,
    /// Its shaft, from 1, motor side first.
    pub gear_shaft: u32,
    /// Zero.
    pub reserved: u32,
    /// From 1, plus 1 with each verdict of this daemon.
    pub seq: u64,
    /// Time of the last force sample used.
    pub t_ns: u64,
    /// When the verdict was made.
    pub made_ns: u64,
    /// Number of the vibration event, from its first warning to its end.
    pub event: u64,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude (peak) on `axis`, N or N m.
    pub amplitude: f64,
    /// Rate of growth of the amplitude, 1/s.
    pub growth_per_s: f64,
    /// Spindle speed that the advice names, 1/min.
    pub advice_rpm: f64,
    /// Nearest mode of the structure, Hz.
    pub nearest_mode_hz: f64,
    /// Distance to it, Hz.
    pub mode_distance_hz: f64,
    /// Nearest spindle or tooth-passing harmonic, Hz.
    pub nearest_harmonic_hz: f64,
    /// Distance to it, Hz.
    pub harmonic_distance_hz: f64,
    /// Nearest alias of a known line, Hz.
    pub nearest_alias_hz: f64,
    /// Distance to it, Hz.
    pub alias_distance_hz: f64,
    /// The verdict as a sentence: what vibrates, why, and what to do.
    pub sentence: [c_char; TRUED_WORDS_MAX],
}

/// State of the connection, or an event.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_connection {
    /// sizeof(trued_connection).
    pub struct_size: u32,
    /// 1: connected to a live daemon; 0: the library is trying to connect.
    pub is_connected: u32,
    /// The daemon's process; 0 while there is none.
    pub pid: u32,
    /// Why not connected: a trued_code; TRUED_OK where connected.
    pub why: i32,
    /// Changes with each start of the daemon.
    pub epoch: u64,
    /// Why not connected, in words; only in an event.
    pub words: [c_char; TRUED_WORDS_MAX],
}

/// The daemon's answer to a request.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_answer {
    /// sizeof(trued_answer).
    pub struct_size: u32,
    /// A trued_answer_code.
    pub answer: u32,
    /// When it was made.
    pub t_ns: u64,
    /// What was done, or why it was refused.
    pub message: [c_char; TRUED_WORDS_MAX],
}

type Joints = [f64; TRUED_JOINTS_MAX];
type Words = [c_char; TRUED_WORDS_MAX];
type Name = [c_char; TRUED_NAME_MAX];

grows! {
    trued_target 144 = [u32; 4], Joints, f64;
    trued_corrected 600 = [u32; 6], [u64; 6], [Joints; 4], [f64; 3];
    trued_status 1456 = [u32; 2], [u64; 24], [f64; 4], [u32; 10], [u32; 6], [Joints; 5], Words, u64, [u32; 2], [Name; 3], [Joints; 2], [u32; 2], [[f64; 3]; 2], [u64; 2], [u32; 2], [f64; 6], [u64; 2], [u64; TRUED_LATENCY_BUCKETS], [u32; 4];
    trued_vibration 680 = [u32; 12], [u64; 4], [f64; 10], Words;
    trued_connection 544 = [u32; 4], u64, Words;
    trued_answer 536 = [u32; 2], u64, Words;
}
