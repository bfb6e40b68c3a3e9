//! Inputs of the effects.
//!
//! Values are copied; an unknown temperature, torque or spindle speed is NaN. No clock: time is
//! part of the sample.

use crate::{Arm, Chain, JOINTS_MAX, Joints, Loads};
use glam::DVec3;

/// A force and a moment about the TCP, exerted by the environment ON the tool.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force, N.
    pub force: DVec3,
    /// Moment about the TCP, Nm.
    pub moment: DVec3,
}

impl Wrench {
    /// No wrench.
    pub const ZERO: Self = Self { force: DVec3::ZERO, moment: DVec3::ZERO };

    /// The sum of two wrenches about the same point.
    pub fn plus(&self, other: &Self) -> Self {
        Self { force: self.force + other.force, moment: self.moment + other.moment }
    }

    /// This wrench times a number.
    pub fn times(&self, factor: f64) -> Self {
        Self { force: self.force * factor, moment: self.moment * factor }
    }
}

/// Inputs of the robot at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Inputs {
    /// Joint positions, rad or m.
    pub q: Joints,
    /// Joint positions at the previous sample, rad or m; equal to `q` at the first.
    pub q_before: Joints,
    /// Sign of each joint's last motion: −1, 0 (unknown) or 1.
    pub direction: Joints,
    /// Joint speeds, rad/s or m/s; zero for an arm treated as at rest.
    pub velocity: Joints,
    /// Joint accelerations, rad/s² or m/s²; zero for an arm treated as at rest.
    pub acceleration: Joints,
    /// Wrench exerted by the environment on the tool, at the TCP, base axes.
    pub wrench_base: Wrench,
    /// Tilt of the base relative to the frame in which its pose was stated, as measured by an
    /// inclinometer: rotation vector, rad. It rotates the whole arm about the base's origin, and
    /// gravity relative to the arm.
    pub base_tilt: DVec3,
    /// Ambient temperature, °C; NaN where unknown.
    pub ambient_celsius: f64,
    /// Joints' own temperatures, °C; NaN where unknown.
    pub joint_celsius: Joints,
    /// Spindle speed, rev/min; NaN where unknown.
    pub spindle_rpm: f64,
    /// Time since the segment began, s.
    pub time_s: f64,
    /// Time since the previous sample, s; 0 at the first.
    pub dt_s: f64,
}

impl Inputs {
    /// An arm at rest at `q`, unloaded, with nothing else known.
    pub const fn at_rest(q: Joints) -> Self {
        Self {
            q,
            q_before: q,
            direction: [0.0; JOINTS_MAX],
            velocity: [0.0; JOINTS_MAX],
            acceleration: [0.0; JOINTS_MAX],
            wrench_base: Wrench::ZERO,
            base_tilt: DVec3::ZERO,
            ambient_celsius: f64::NAN,
            joint_celsius: [f64::NAN; JOINTS_MAX],
            spindle_rpm: f64::NAN,
            time_s: 0.0,
            dt_s: 0.0,
        }
    }

    /// Sign of joint `i`'s motion: −1, 0 (at rest) or 1.
    pub fn sign_of_velocity(&self, i: usize) -> f64 {
        let velocity = self.velocity[i];
        if velocity == 0.0 { 0.0 } else { velocity.signum() }
    }

    /// Joint `i`'s own temperature, or if unknown the ambient one, °C; NaN if neither is known.
    pub fn celsius(&self, i: usize) -> f64 {
        if self.joint_celsius[i].is_nan() { self.ambient_celsius } else { self.joint_celsius[i] }
    }
}

/// The inputs with derived quantities on the nominal geometry.
#[derive(Clone, Copy, Debug)]
pub struct Signals<'a> {
    /// The nominal arm.
    pub arm: &'a Arm,
    /// The sample.
    pub inputs: &'a Inputs,
    /// The controller's geometry at `inputs.q`.
    pub chain: &'a Chain,
    /// The loads on that geometry.
    pub loads: &'a Loads,
}
