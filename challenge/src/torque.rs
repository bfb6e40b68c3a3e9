//! Blind cases of drive torques: one-axis rigs and arms, with hidden friction, springs, ripple, gains, delays, masses.
//!
//! Rigid-body torques follow from virtual work of point masses: each point is evaluated slightly before and after along the motion, the second
//! difference of its positions is its acceleration, and a joint carries the moment of the inertial force and weight. Hysteresis is a set of
//! elasto-slip elements; delayed torques are those of an earlier instant of a motion given in closed form, as are velocities and accelerations.
//!
//! Read in this order: [`kinds`], [`motion`], [`rig`], [`laws`], [`case`], [`mod@detectability`], [`mod@generate`], [`mod@evaluation`], [`case_files`]; [`inject`] for
//! effects that are added to a real recording.
//!
//! The same seed gives the same bytes. No file, no process, and no code of another crate's physics.

pub mod candidates;
pub mod case;
pub mod case_files;
pub mod detectability;
pub mod evaluation;
pub mod generate;
pub mod inject;
pub mod kinds;
pub mod laws;
pub mod motion;
pub mod predictor;
pub mod rig;
