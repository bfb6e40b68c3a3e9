//! KUKA's Robot Sensor Interface: the bridge is the sensor, the robot's program stays as it is, and what is sent is the
//! correction alone.
//!
//! Tags are those of the site's own configuration. Read in this order: [`telegram`], [`answer`] (every policy), `run`.

pub mod answer;
mod run;
pub mod telegram;

pub use run::run;
