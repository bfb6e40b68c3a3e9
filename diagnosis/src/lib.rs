//! From measurements to a model with its uncertainty: identification, selection of effects, validation on held-out data.
//!
//! Read in this order: [`campaign`] (what was measured), [`hypothesis`] (the present model and its free parameters),
//! [`mod@geometry`] (the tolerances that fix gauge freedoms),
//! [`fit()`] (parameters, their uncertainty, and those that the data do not determine), `residual` (one rule per kind of measurement).
//!
//! The same input and seed give the same bits. No shared memory, no clock, no file access, no special treatment of a data set.

pub mod autocorrelation;
pub mod campaign;
pub mod campaign_import;
pub mod campaign_simulation;
mod candidates;
mod chord;
pub mod circle_point;
mod cluster_robust;
pub mod diagnose;
pub mod effect_size;
mod engine;
pub mod enhanced_stiffness;
pub mod extrinsics;
pub mod fit;
pub mod fit_result;
pub mod force;
pub mod frame_drift;
pub mod geometry;
pub mod gross_errors;
pub mod hold_out;
pub mod hypothesis;
mod identifiability;
pub mod initial_extrinsics;
pub mod iso9283;
pub mod joint_error;
pub mod joint_readback;
pub mod joint_regression;
mod least_squares;
mod levenberg_marquardt;
mod linearisation;
pub mod link_targets;
pub mod load_pairs;
mod outlier_runs;
mod path_dynamics;
mod periodogram;
pub mod plan;
pub mod progress;
pub mod qr;
pub mod recording_simulation;
mod residual;
pub mod rigid_motion;
pub mod robust_weights;
mod score_test;
mod simd;
pub mod single_joint;
pub mod stiffness;
pub mod sweeps;
#[cfg(test)]
mod test_campaigns;
pub mod threads;
pub mod tool_displacement;
mod tool_jacobian;
pub mod tool_motion;
pub mod torque;
pub mod uncertainty_propagation;

pub use campaign::{
    Arrival, Campaign, Instrument, Observation, Pose, Reading, ReadingNoise, RecordingInfo,
    ToolPoint,
};
pub use diagnose::{AddedEffect, ExtendedModel, select_effects};
pub use extrinsics::{Anchor, Extrinsics, FitParameter, MeasuringFrame, Plane, Sphere};
pub use fit::{FitEffort, FitSettings, fit};
pub use fit_result::{Conditioning, Fit, UndeterminedParameter};
pub use geometry::{Tolerances, geometry, geometry_with_tolerances};
pub use hypothesis::{FreeParameter, Hypothesis};
pub use robust_weights::Influence;
