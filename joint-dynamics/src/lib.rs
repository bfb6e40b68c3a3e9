//! Delay, lags and flexible modes of joints, by the model, and their inverse: what has to be added to commands so that joints are on their path at each instant.
//!
//! Each joint is a linear plant of the model: delay, first-order lags, flexible modes ([`plant`]). Its regularised inverse in the frequency domain ([`inverse`])
//! serves whole paths (crate `feedforward`). As taps of a finite impulse response ([`taps`]) it serves a path that arrives point by point: [`filter`] adds up
//! the past commands and the setpoints that are known ahead.
//!
//! Units: SI, rad or m for joints. Couplings between joints through inertia are not modelled. Never: a file, a clock.

pub mod filter;
pub mod inverse;
pub mod plant;
pub mod taps;
#[cfg(test)]
mod virtual_joint;
// `virtual_joint.rs` is compiled in the tests of `feedforward` too.
#[cfg(test)]
extern crate self as joint_dynamics;

pub use filter::{Filter, Lookahead};
pub use taps::{FilterTaps, TapsError, TapsSettings};
