//! The physical model of the robot: geometry, loads, and one file per physical effect behind one trait.
//!
//! All functions are pure; the same input gives the same bits on every machine of one kind (all
//! transcendental functions come from `libm`, not from the system's C library). No clock, input or
//! output, shared memory, heap, or panic on finite input.
//!
//! Read in this order: [`arm`] (the controller's geometry), [`chain`] (forward
//! kinematics), [`loads`] (loads of the joints), [`dynamics`] (torques of the drives), [`effect`] (the interface of an effect),
//! [`model`] (the sum of the effects: real position of the tool), [`drive`] (their sum at the drives), [`cut`] (their sum at a cutter).
//!
//! Units are SI throughout: rad (m for a prismatic joint), N, Nm, kg, s; temperatures in °C.
//! Vectors are in base axes unless a name says otherwise (`force_tool`).
#![cfg_attr(not(test), no_std)]

pub mod arm;
pub mod chain;
pub mod cut;
pub mod deviation;
pub mod drive;
pub mod dynamics;
pub mod effect;
pub mod effects;
pub mod frame;
pub mod gears;
mod inertia;
mod lane_pose;
pub mod lanes;
pub mod laws;
pub mod loads;
pub mod model;
pub mod signals;
pub mod slopes;
pub mod spec;
mod thermal;
pub mod tool_motions;
pub mod trig;

pub use arm::{Arm, ArmError, Body, Joint, JointKind, Tool};
pub use chain::{Chain, Jacobian};
pub use cut::{CutForce, Cutter, ForceTerm, ToothForces};
pub use deviation::{Contribution, Deviation};
pub use drive::{DriveTerm, DriveTorques};
pub use dynamics::inverse_dynamics;
pub use effect::{BuildError, Effect, Memory, ParameterValues};
pub use effects::AnyEffect;
pub use frame::Frame;
pub use loads::{LoadChange, Loads};
pub use model::{Evaluation, LoadOutOfRange, Memories, Model, ModelError};
pub use signals::{Inputs, Signals, Wrench};
pub use slopes::{LoadSlopes, Slope, SlopeSums};
pub use tool_motions::Motions;

/// Largest number of joints of an arm.
pub const JOINTS_MAX: usize = 16;

/// Largest number of effects of a model.
pub const EFFECTS_MAX: usize = 128;

/// One value per joint: rad for a revolute joint, m for a prismatic one, or a quantity per joint. Entries beyond the arm's joint count are zero and
/// never read.
pub type Joints = [f64; JOINTS_MAX];

#[cfg(test)]
mod tests;
