//! Simulation of robot, instrument and cutter: deterministic by seed.
//!
//! The same inputs and seed give the same bits on every machine of one kind; each kind of
//! randomness has its own stream ([`random`]). No IPC, no clock, no file, no correction.
//!
//! Read in this order: [`path`] and [`slots`] (target of the tool; [`workplace`]: its location),
//! [`ik`] and [`joint_path`] (commands), [`draw`] (a true robot for a calibrated model), [`hidden`]
//! (an effect that the model lacks), [`survey`] (a measuring program), [`robot`] (actual position
//! of the tool), [`cutter`] and [`structural_mode`] (forces of the cut), [`cell`] (all of it, tick by
//! tick). [`contact`] closes the loop over a stiff surface; [`tracker`] is the instrument.
//! [`forward`] runs a recorded motion through a model, with delays, lags and modes ([`dynamics`])
//! and reversals of joints ([`reversal`]); [`drives`] computes recorded drive torques for it, [`servo`]
//! adds a controller; [`milling`] computes the recorded forces of a cut, [`regeneration`] its
//! chatter. [`instrument`] writes what was simulated into a recording.
//!
//! Units are SI; vectors are in base axes unless a name says otherwise.

pub mod cell;
pub mod contact;
mod curve;
pub mod cutter;
pub mod draw;
pub mod drives;
pub mod dynamics;
pub mod executed_path;
pub mod forward;
pub mod hidden;
pub mod ik;
pub mod instrument;
pub mod joint_path;
pub mod milling;
pub mod path;
pub mod profile;
pub mod random;
pub mod regeneration;
pub mod reversal;
pub mod robot;
pub mod servo;
pub mod slots;
pub mod structural_mode;
pub mod survey;
pub mod tracker;
pub mod workplace;

#[cfg(test)]
mod test_arm;
