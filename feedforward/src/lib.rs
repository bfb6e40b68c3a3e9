//! Feedforward for a path that is known ahead: commands that compensate dynamic errors of the joints.
//!
//! Each joint is a linear plant of the model: delay, first-order lags, flexible modes ([`joint_dynamics::plant`]). Its commands come from one step, in the frequency domain and
//! therefore without causality: `c ← c + λ L e`, with the error e of the path, the regularised inverse L of the plant and a factor λ ≤ 1 that makes
//! the step robust for any plant whose parameters deviate by a stated fraction ([`joint_dynamics::inverse`]). With the error that the model predicts this is preview compensation
//! ([`preview()`]), with an error that was measured it is norm-optimal iterative learning ([`learn()`]).
//! The correction satisfies limits of position, rate and jerk, the commands those of position and speed of the model ([`bounds`]).
//!
//! Sources: Bristow, Tharayil, Alleyne, "A survey of iterative learning control", IEEE Control Systems 26(3), 2006 (norm-optimal ILC, robust monotonic
//! convergence `|1 − L G| < 1`); Wiener filter for noise.
//!
//! Read in this order: [`joint_dynamics::plant`], [`joint_dynamics::inverse`], [`bounds`], [`step`], [`path_check`], [`mod@preview`], [`identify`], [`grid`], [`measured`], [`mod@learn`], [`tool`],
//! [`learning`] (learning from recordings), [`history`], [`result`] (what is reported).
//!
//! Invariant: the same input gives the same bits. No file, no clock, no cycle of the daemon.
//! Couplings between joints through inertia are not modelled; effects of the model that are not
//! compensated are listed ([`joint_dynamics::plant::Plants::left_out`]).

pub mod bounds;
pub mod error;
mod fourier;
pub mod grid;
pub mod history;
pub mod identify;
pub mod learn;
pub mod learning;
pub mod measured;
pub mod path_check;
pub mod preview;
pub mod result;
pub mod settings;
pub mod step;
pub mod tool;
#[cfg(test)]
#[path = "../../joint-dynamics/src/virtual_joint.rs"]
mod virtual_joint;

pub use error::FeedforwardError;
pub use learn::learn;
pub use preview::preview;
pub use settings::Settings;
