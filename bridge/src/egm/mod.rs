//! ABB's Externally Guided Motion: in the middle between the controller and the application that guides it.
//!
//! To the controller the bridge is the sensor, to the application it is the robot, so that a cell is retrofitted by changing
//! one address. Facts of the protocol: Application manual EGM, ABB 3HAC073318-001.
//!
//! Read in this order: [`messages`], [`middle`] (every policy), `run` (the sockets).

pub mod force;
pub mod joints;
pub mod messages;
pub mod middle;
mod path;
mod run;
pub mod screened;
mod wire;

pub use run::run;
pub use wire::Broken;
