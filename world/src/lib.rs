//! Simulation of robot, instrument and cutter: deterministic by seed.
//!
//! Promises: the same inputs and seed give the same bits on every machine of one kind; each kind of chance has a
//! stream of its own ([`random`]).
//! Never: IPC, a clock, a file, a correction.
//!
//! Read in this order: [`path`] and [`slots`] (where the tool shall go, [`workplace`]: where there), [`ik`] and [`joint_path`] (the commands for it),
//! [`draw`] (a true robot for a calibrated model), [`hidden`] (what that model lacks), [`survey`] (a measuring program), [`robot`] (where its tool really goes), [`cutter`] and
//! [`ringing`] (what the cut exerts), [`cell`] (all of it, tick by tick). [`contact`] closes the loop over a stiff
//! surface; [`tracker`] is the instrument. [`forward`] runs a recorded motion through a model, with [`dynamics`]' delays, lags and modes, by way of where joints [`turn`];
//! [`drives`] says what is recorded of the drives on it, [`servo`] puts a controller into the loop; [`milling`] says what is recorded of a cut,
//! [`regeneration`] whether it rings by itself.
//!
//! Units are SI; vectors are in base axes unless a name says otherwise.

pub mod cell;
pub mod contact;
mod curve;
pub mod cutter;
pub mod draw;
pub mod drives;
pub mod dynamics;
pub mod forward;
pub mod hidden;
pub mod ik;
pub mod joint_path;
pub mod milling;
pub mod path;
pub mod profile;
pub mod random;
pub mod regeneration;
pub mod ride;
pub mod ringing;
pub mod robot;
pub mod servo;
pub mod slots;
pub mod survey;
pub mod tracker;
pub mod turn;
pub mod workplace;

#[cfg(test)]
mod test_arm;
