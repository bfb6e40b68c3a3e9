//! ABB's Externally Guided Motion: the bridge between the controller and the application that guides it.
//!
//! For the controller the bridge is the sensor, for the application it is the robot, so that a cell is retrofitted by changing
//! one address. Facts of the protocol: Application manual EGM, ABB 3HAC073318-001.
//!
//! Read in this order: [`messages`], [`forwarder`] (handling of datagrams), `run` (the sockets).

pub mod classification;
pub mod force;
pub mod forwarder;
pub mod joints;
pub mod messages;
mod path;
mod run;
mod wire;

pub use run::run;
pub use wire::DecodeError;
