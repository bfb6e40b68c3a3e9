//! Inputs besides the command: wrench, temperatures, process state.
//!
//! Invariant: after [`CycleInputs::sanitized`] every number is finite and plausible, or counts as unknown.

use glam::DVec3;
use physics::{JOINTS_MAX, Joints, Wrench};

/// Range of plausible temperatures, °C; outside, the sensor is broken.
const PLAUSIBLE_CELSIUS: core::ops::RangeInclusive<f64> = -60.0..=200.0;
/// Largest plausible force (N) and moment (Nm).
const LOAD_MAX: f64 = 1e5;
/// Largest plausible spindle speed, rev/min.
const SPINDLE_RPM_MAX: f64 = 1e6;

/// A wrench as it was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchSample {
    /// Wrench that the environment exerts on the tool, at the TCP.
    pub wrench: Wrench,
    /// In base axes; else in tool axes.
    pub in_base: bool,
    /// How old it is, ns.
    pub age_ns: u64,
    /// Whether its sensor or force stream has a fault: it is not used.
    pub faulty: bool,
}

/// Inputs besides the command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CycleInputs {
    /// The newest wrench.
    pub wrench: Option<WrenchSample>,
    /// Ambient temperature, °C; NaN where unknown.
    pub ambient_celsius: f64,
    /// Joints' temperatures, °C; NaN where unknown.
    pub joint_celsius: [f64; JOINTS_MAX],
    /// Spindle speed, rev/min; NaN where unknown.
    pub spindle_rpm: f64,
    /// Displacement of the tool by the trim, base frame, m; zero without a trim.
    pub trim_m: DVec3,
    /// Dynamic correction, added to the static one because moving joints follow with delay and lag, rad or m; zero at rest.
    pub lead: Joints,
}

impl Default for CycleInputs {
    fn default() -> Self {
        Self {
            wrench: None,
            ambient_celsius: f64::NAN,
            joint_celsius: [f64::NAN; JOINTS_MAX],
            spindle_rpm: f64::NAN,
            trim_m: DVec3::ZERO,
            lead: [0.0; JOINTS_MAX],
        }
    }
}

impl CycleInputs {
    /// The same without implausible values: temperatures outside −60 to 200 °C and spindle speeds
    /// beyond 1e6 rev/min become unknown; a wrench beyond 1e5 N or Nm counts as stale.
    pub(crate) fn sanitized(&self) -> Self {
        let celsius = |t: f64| if PLAUSIBLE_CELSIUS.contains(&t) { t } else { f64::NAN };
        let spindle = self.spindle_rpm.abs() <= SPINDLE_RPM_MAX;
        Self {
            wrench: self.wrench.map(WrenchSample::sound),
            ambient_celsius: celsius(self.ambient_celsius),
            joint_celsius: self.joint_celsius.map(celsius),
            spindle_rpm: if spindle { self.spindle_rpm } else { f64::NAN },
            trim_m: if self.trim_m.is_finite() { self.trim_m } else { DVec3::ZERO },
            lead: self.lead.map(|lead| if lead.is_finite() { lead } else { 0.0 }),
        }
    }
}

impl WrenchSample {
    /// Whether its values are possible in a robot cell.
    pub(crate) fn is_plausible(&self) -> bool {
        let Wrench { force, moment } = self.wrench;
        let all = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
        all.iter().all(|x| x.abs() <= LOAD_MAX)
    }

    fn sound(self) -> Self {
        if self.is_plausible() {
            self
        } else {
            Self { wrench: Wrench::ZERO, age_ns: u64::MAX, ..self }
        }
    }
}
