//! From measurements to a model with its uncertainty: identification, selection of effects, validation on held-out data.
//!
//! Read in this order: [`campaign`] (what was measured), [`hypothesis`] (the present model and its free parameters),
//! [`mod@geometry`] (the tolerances that fix gauge freedoms),
//! [`fit()`] (parameters, their uncertainty, and those that the data do not determine), `residual` (one rule per kind of measurement).
//!
//! The same input and seed give the same bits. No shared memory, no clock, no file access, no special treatment of a data set.

mod blocks;
pub mod campaign;
mod candidates;
pub mod circle;
pub mod colour;
pub mod diagnose;
mod engine;
pub mod enhanced;
pub mod expected;
pub mod fit;
pub mod force;
pub mod from_recording;
pub mod geometry;
pub mod gross;
pub mod hypothesis;
mod independent;
pub mod iso9283;
pub mod joint_error;
mod linearisation;
pub mod loaded;
#[cfg(test)]
mod made;
mod minimise;
pub mod motion;
mod motions;
pub mod nests;
pub mod on_links;
pub mod per_joint;
pub mod plan;
mod problem;
pub mod proof;
pub mod readback;
mod residual;
pub mod result;
mod rides;
pub mod rigid;
pub mod robust;
mod score;
pub mod share;
pub mod simulate;
pub mod simulated;
pub mod single_joint;
pub mod size;
pub mod start;
pub mod stiffness;
pub mod surroundings;
pub mod sweeps;
pub mod threads;
pub mod torque;
pub mod triangle;
mod waves;
mod wide;

pub use campaign::{
    Arrival, Campaign, Instrument, Noise, Observation, Place, Pose, Reading, Source,
};
pub use diagnose::{Chosen, Selection, select};
pub use fit::{Effort, Settings, fit};
pub use geometry::{Tolerances, geometry, geometry_within};
pub use hypothesis::{Free, Hypothesis};
pub use result::{Conditioning, Fit, Undetermined};
pub use robust::Influence;
pub use surroundings::{Anchor, Fitted, Plane, Sphere, Station, Surroundings};
