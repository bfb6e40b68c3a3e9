//! What the library fills in.
//!
//! Promise: as [`super`] has it.

use core::ffi::c_char;

use super::{TRUED_JOINTS_MAX, TRUED_NAME_MAX, TRUED_WORDS_MAX, grows};

/// A joint target, to be sent to the robot.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_target {
    /// sizeof(trued_target).
    pub struct_size: u32,
    /// As many as the command had.
    pub joints: u32,
    /// What the correction in it is: a trued_source.
    pub source: u32,
    /// Zero.
    pub reserved: u32,
    /// The target.
    pub q: [f64; TRUED_JOINTS_MAX],
}

/// What the daemon answers to a command.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_corrected {
    /// sizeof(trued_corrected).
    pub struct_size: u32,
    /// How many joints; 0 where no good command has come yet.
    pub joints: u32,
    /// A trued_correction_status.
    pub status: u32,
    /// A trued_reason.
    pub reason: u32,
    /// A trued_wrench_gate.
    pub wrench_gate: u32,
    /// Newton steps spent.
    pub iterations: u32,
    /// From 1, plus 1 with each answer of this daemon.
    pub seq: u64,
    /// The number of the command that it answers, as trued_client_send() told it.
    pub command_seq: u64,
    /// The `t_ns` of that command.
    pub t_ns: u64,
    /// When the daemon took that command.
    pub received_ns: u64,
    /// When this answer was made.
    pub made_ns: u64,
    /// Which model made it: plus 1 with each swap.
    pub model_epoch: u64,
    /// What of `q` is correction.
    pub correction: [f64; TRUED_JOINTS_MAX],
    /// How fast that changes, per s.
    pub correction_rate: [f64; TRUED_JOINTS_MAX],
    /// How fast the rate changes, per s^2.
    pub correction_acceleration: [f64; TRUED_JOINTS_MAX],
    /// What the model asks for before the envelope; in shadow mode `correction` is zero, this is not.
    pub wanted: [f64; TRUED_JOINTS_MAX],
    /// Undamped residual of the solution, position, m.
    pub residual_m: f64,
    /// Undamped residual of the solution, orientation, rad.
    pub residual_rad: f64,
}

/// How the daemon is. Numbers that are not known are NaN.
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
    /// Plus 1 with each swap of the model.
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
    /// Times that the commands fell silent.
    pub stale: u64,
    /// Commands that never came.
    pub commands_lost: u64,
    /// Targets that could not be handed over.
    pub corrected_lost: u64,
    /// Force blocks taken.
    pub force_blocks: u64,
    /// Force blocks that never came.
    pub force_gaps: u64,
    /// Force blocks refused.
    pub force_refused: u64,
    /// Messages that could not be read.
    pub malformed: u64,
    /// Entries that the black box dropped.
    pub recorder_dropped: u64,
    /// From a command's sending to its answer, the middle.
    pub latency_p50_ns: u64,
    /// The same at 99 %.
    pub latency_p99_ns: u64,
    /// The same at 99.9 %.
    pub latency_p999_ns: u64,
    /// The worst.
    pub latency_max_ns: u64,
    /// Since when the model does not hold, by measurements of the tool; 0 while it holds.
    pub model_broken_since_ns: u64,
    /// Measurements of the tool since the model was loaded.
    pub model_measurements: u64,
    /// How far the last of them were from the model, root mean square, m.
    pub model_residual_m: f64,
    /// Loop gain of the wrench correction.
    pub wrench_loop_gain: f64,
    /// Spindle speed that the vibration watch goes by, 1/min.
    pub spindle_rpm: f64,
    /// Feed that it goes by, mm/s.
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
    /// A trued_in_cut, as told.
    pub in_cut: u32,
    /// Effects in the model that the cycle does not correct.
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
    /// What a person should know.
    pub message: [c_char; TRUED_WORDS_MAX],
    /// Hash of the robot's nominal geometry: kinds and axes of the joints, nothing else.
    pub geometry_hash: u64,
    /// Temperatures that were known and are too old: bit 0 the ambient one, bit n that of joint n.
    pub stale_temperatures: u32,
    /// Zero.
    pub reserved: u32,
    /// The robot's maker as the model states it; empty where it does not.
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
    /// What the tool's target is displaced by, base frame, m.
    pub trim_m: [f64; 3],
    /// What the instrument finds of the model's error, base frame, m: real minus predicted.
    pub trim_found_m: [f64; 3],
    /// Measured points that came.
    pub trim_measurements: u64,
    /// Those of them that were refused.
    pub trim_refused: u64,
}

/// One verdict on one line of the force spectrum. Numbers that are not known are NaN.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_vibration {
    /// sizeof(trued_vibration).
    pub struct_size: u32,
    /// A trued_vibration_state.
    pub state: u32,
    /// A trued_vibration_class.
    pub kind: u32,
    /// Classes not ruled out: bit n is the trued_vibration_class n.
    pub rivals: u32,
    /// Channel: 0 to 5 for Fx Fy Fz Mx My Mz.
    pub axis: u32,
    /// 1 where the line may stand above half the sampling rate in truth.
    pub suspect_alias: u32,
    /// A trued_advice.
    pub advice: u32,
    /// What is wrong with its channel and the stream: bit n is the trued_sensor_fault n.
    pub sensor_faults: u32,
    /// The number of the stability pocket that the advice names; 0: none.
    pub advice_lobe: u32,
    /// The joint whose gear train turns at this frequency, from 1; 0: none.
    pub gear_joint: u32,
    /// Its shaft, from 1, motor side first.
    pub gear_shaft: u32,
    /// Zero.
    pub reserved: u32,
    /// From 1, plus 1 with each verdict of this daemon.
    pub seq: u64,
    /// Time of the last force sample that took part.
    pub t_ns: u64,
    /// When the verdict was made.
    pub made_ns: u64,
    /// Names one ringing from its first warning to its end.
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
    /// All of it as a sentence: what rings, why, and what to do.
    pub sentence: [c_char; TRUED_WORDS_MAX],
}

/// How the connection is, or what happened to it.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_connection {
    /// sizeof(trued_connection).
    pub struct_size: u32,
    /// 1: joined, and the daemon lives; 0: the library is trying.
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

/// What the daemon answered to a request.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_answer {
    /// sizeof(trued_answer).
    pub struct_size: u32,
    /// A trued_answer_code.
    pub answer: u32,
    /// When it was made.
    pub t_ns: u64,
    /// What was done, or why not.
    pub message: [c_char; TRUED_WORDS_MAX],
}

type Joints = [f64; TRUED_JOINTS_MAX];
type Words = [c_char; TRUED_WORDS_MAX];
type Name = [c_char; TRUED_NAME_MAX];

grows! {
    trued_target 144 = [u32; 4], Joints;
    trued_corrected 600 = [u32; 6], [u64; 6], [Joints; 4], [f64; 2];
    trued_status 1456 = [u32; 2], [u64; 24], [f64; 4], [u32; 10], [u32; 6], [Joints; 5], Words, u64, [u32; 2], [Name; 3], [Joints; 2], [u32; 2], [[f64; 3]; 2], [u64; 2];
    trued_vibration 680 = [u32; 12], [u64; 4], [f64; 10], Words;
    trued_connection 544 = [u32; 4], u64, Words;
    trued_answer 536 = [u32; 2], u64, Words;
}
