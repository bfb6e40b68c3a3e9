//! Blind cases of drive torques: one-axis rigs and arms, with hidden friction, springs, ripple, gains, delays, masses.
//!
//! The rigid body's share is the work of points: each of a link's points is carried a little forward and back along the motion, the second difference of
//! its places is its acceleration, and a joint holds the moment of its force. Hysteresis is springs that slip; what is recorded late is the torque of
//! an earlier instant of a motion that is known at any instant; velocities and accelerations are those of the motion's own formula.
//!
//! Read in this order: [`kinds`], [`motion`], [`rig`], [`laws`], [`case`], [`mod@bench`], [`mod@draw`], [`proof`], [`mod@write`]; [`inject`] for effects that are
//! added to a real recording.
//!
//! Promises: the same seed gives the same bytes. Never: a file, a process, a line of another crate's physics.

pub mod bench;
pub mod candidates;
pub mod case;
pub mod draw;
pub mod inject;
pub mod kinds;
pub mod laws;
pub mod motion;
pub mod predictor;
pub mod proof;
pub mod rig;
pub mod write;
