//! KUKA's Robot Sensor Interface: the bridge is the sensor, the robot's program is not changed, and only the correction is
//! sent.
//!
//! Tags are those of the controller's configuration. Read in this order: [`telegram`], [`answer`] (handling of telegrams), `run`.

pub mod answer;
mod run;
pub mod telegram;

pub use run::run;
