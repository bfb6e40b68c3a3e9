//! Input structs.
//!
//! Promise: as [`super`] has it.

use super::{TRUED_JOINTS_MAX, TRUED_TEMPERATURES_MAX, grows};

/// trued_setpoint: `wrench` is set; in tool axes unless TRUED_WRENCH_IN_BASE is set too.
pub const TRUED_HAS_WRENCH: u32 = 1;
/// trued_setpoint: `wrench` is in base axes, at the TCP.
pub const TRUED_WRENCH_IN_BASE: u32 = 2;
/// trued_setpoint: a pose at rest, without rate or jerk bound. Honoured only in a lockstep replay.
pub const TRUED_SETTLED: u32 = 4;
/// trued_setpoint: `direction` is set.
pub const TRUED_HAS_DIRECTION: u32 = 8;
/// trued_setpoint: `temperature_c` is set.
pub const TRUED_HAS_TEMPERATURE: u32 = 16;

/// trued_robot_state: `q_measured` is set.
pub const TRUED_STATE_HAS_Q: u32 = 1;
/// trued_robot_state: `tau` is set.
pub const TRUED_STATE_HAS_TAU: u32 = 2;
/// trued_robot_state: `temperature_c` is set.
pub const TRUED_STATE_HAS_TEMPERATURE: u32 = 4;

/// One commanded joint target with optional inputs.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_setpoint {
    /// sizeof(trued_setpoint).
    pub struct_size: u32,
    /// How many joints, 1 to 16.
    pub joints: u32,
    /// Which fields are set: the TRUED_HAS_... flags.
    pub flags: u32,
    /// Zero.
    pub reserved: u32,
    /// When the target holds, CLOCK_MONOTONIC or a recording's time; 0: now.
    pub t_ns: u64,
    /// Joint angles or lengths.
    pub q: [f64; TRUED_JOINTS_MAX],
    /// Force, then moment, acting on the robot at the TCP.
    pub wrench: [f64; 6],
    /// Ambient, then one per joint, degrees Celsius; NaN where unknown.
    pub temperature_c: [f64; TRUED_TEMPERATURES_MAX],
    /// Direction of approach of each joint: -1, 0 or 1.
    pub direction: [i8; TRUED_JOINTS_MAX],
}

/// Measured state of the robot.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_robot_state {
    /// sizeof(trued_robot_state).
    pub struct_size: u32,
    /// How many joints, 1 to 16.
    pub joints: u32,
    /// Which fields are set: TRUED_STATE_HAS_...
    pub flags: u32,
    /// Zero.
    pub reserved: u32,
    /// Time of measurement.
    pub t_ns: u64,
    /// Measured joint positions.
    pub q_measured: [f64; TRUED_JOINTS_MAX],
    /// Measured joint torques or forces.
    pub tau: [f64; TRUED_JOINTS_MAX],
    /// Ambient, then one per joint, degrees Celsius; NaN where unknown.
    pub temperature_c: [f64; TRUED_TEMPERATURES_MAX],
}

/// A block of evenly spaced force samples.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_force_samples {
    /// sizeof(trued_force_samples).
    pub struct_size: u32,
    /// 3 to 6: the first of Fx Fy Fz Mx My Mz.
    pub channels: u32,
    /// Samples per channel, 1 to 512.
    pub count: u32,
    /// 1: the samples are in base axes; 0: in tool axes.
    pub in_base: u32,
    /// Time of the first sample.
    pub t_ns: u64,
    /// Sampling rate, Hz.
    pub rate_hz: f64,
    /// Sample by sample, `channels` doubles each; or NULL where the samples are floats.
    pub doubles: *const f64,
    /// The same as floats; or NULL.
    pub floats: *const f32,
}

/// State of the cutting process, for the vibration monitor.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_process {
    /// sizeof(trued_process).
    pub struct_size: u32,
    /// Teeth of the cutter; 0 where unknown.
    pub teeth: u32,
    /// A trued_in_cut.
    pub in_cut: u32,
    /// Zero.
    pub reserved: u32,
    /// How long this holds; 0: until the next one.
    pub holds_ns: u64,
    /// Spindle speed, 1/min; 0 if stopped, NaN if unknown.
    pub spindle_rpm: f64,
    /// Feed along the path, mm/s; NaN: the daemon takes it from the commanded path.
    pub feed_mm_s: f64,
}

/// The tool centre point as measured by an instrument, at rest and without external force.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct trued_measured {
    /// sizeof(trued_measured).
    pub struct_size: u32,
    /// How many joints, 1 to 16.
    pub joints: u32,
    /// The joint positions that were published there.
    pub q: [f64; TRUED_JOINTS_MAX],
    /// The tool centre point in the robot's base frame, m.
    pub point_m: [f64; 3],
    /// Standard uncertainty of each of its numbers, instrument and model together, m.
    pub sigma_m: f64,
    /// Temperature around the robot, degrees Celsius; NaN where unknown.
    pub ambient_c: f64,
    /// Direction of approach of each joint: -1 or 1; 0 where unknown.
    pub direction: [i8; TRUED_JOINTS_MAX],
}

type Joints = [f64; TRUED_JOINTS_MAX];
type Temperatures = [f64; TRUED_TEMPERATURES_MAX];
type Sides = [i8; TRUED_JOINTS_MAX];

grows! {
    trued_setpoint 352 = [u32; 4], u64, Joints, [f64; 6], Temperatures, Sides;
    trued_robot_state 416 = [u32; 4], u64, Joints, Joints, Temperatures;
    trued_force_samples 48 = [u32; 4], u64, f64, *const f64, *const f32;
    trued_process 40 = [u32; 4], u64, [f64; 2];
    trued_measured 192 = [u32; 2], Joints, [f64; 3], [f64; 2], Sides;
}
