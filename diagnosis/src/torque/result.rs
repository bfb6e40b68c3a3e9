//! Result of a torque diagnosis. SI units; joints are numbered from 0.

use crate::diagnose::Verdict;

use crate::effect_size::EffectSize;

use super::{
    AlternativeEffect, FittedParameter, RefittedParameter, Trace, UnexplainedTorque, Zone,
};

/// An effect that the model of the drives lacks, or states with wrong parameters.
#[derive(Clone, Debug)]
pub struct Finding {
    /// Name of the effect in docs/reference/effects.md.
    pub kind: &'static str,
    /// Joint from 0; `None` if the effect concerns the whole robot.
    pub joint: Option<usize>,
    /// The one recording in which it acts, from 0; `None`: all recordings.
    pub recording: Option<usize>,
    /// Whether the model states the effect; `parameters` are then differences to its stated parameters.
    pub is_change: bool,
    /// Parameters of the effect, SI units.
    pub parameters: Vec<FittedParameter>,
    /// Posterior probability of the effect among its alternatives, 0 to 1.
    pub confidence: f64,
    /// Gain in log-likelihood compared with the fit without it.
    pub gain: f64,
    /// Alternative effects that explain the same.
    pub alternatives: Vec<AlternativeEffect>,
    /// RMS residual on test rows with all earlier findings of the list applied: without this one, and with it; N m or N.
    pub heldout: [f64; 2],
    /// RMS residual on test rows if only this effect is removed and all others are refitted, N m or N.
    pub heldout_without: f64,
    /// Contribution of this effect to the torques or forces on which it acts, N m or N.
    pub size: EffectSize,
}

/// Test of the fit for one joint, N m or N.
#[derive(Clone, Debug, PartialEq)]
pub struct JointValidation {
    /// Joint from 0.
    pub joint: usize,
    /// RMS torque on test rows.
    pub torque: f64,
    /// RMS residual of the given model on test rows, with unstated masses fitted.
    pub before: f64,
    /// RMS residual on test rows with all findings.
    pub after: f64,
    /// RMS residual on test rows with all findings, excluding the low-speed zones.
    pub after_outside: f64,
    /// Noise: RMS residual of the fit of all candidates to the training rows, corrected for the degrees of freedom.
    pub noise: f64,
}

/// Result of a torque diagnosis.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// Verdict on the model.
    pub verdict: Verdict,
    /// Claimed effects, most important first.
    pub findings: Vec<Finding>,
    /// Selected effects with too low a probability to be claimed. They are part of the fit, of the tested residuals and of the written model.
    pub candidates: Vec<Finding>,
    /// Parameters that the model states with an uncertainty, as refitted. They are not findings, but part of the tested fit.
    pub refits: Vec<RefittedParameter>,
    /// Structure in the residual that no candidate effect explains.
    pub unexplained: Option<UnexplainedTorque>,
    /// Low-speed zones excluded from the fit because no known law describes the torque there.
    pub zones: Vec<Zone>,
    /// RMS residual on test rows, of the given model and with all findings, N m or N; joints are weighted by their noise (docs/reference/results.md).
    pub heldout: [f64; 2],
    /// RMS residual on training and validation rows with all findings, weighted likewise, N m or N.
    pub noise: f64,
    /// Test per joint.
    pub by_joint: Vec<JointValidation>,
    /// RMS torque on test rows over all joints, N m or N.
    pub signal: f64,
    /// Edge of the low-pass filter, Hz.
    pub band_hz: f64,
    /// Number of rows per joint.
    pub rows: usize,
    /// How the test rows were chosen, as text.
    pub heldout_description: String,
    /// Effects that these recordings cannot show: name, joint from 0, reason.
    pub not_tested: Vec<(&'static str, Option<usize>, &'static str)>,
    /// Whether all joints are prismatic: forces in N instead of torques in N m.
    pub all_prismatic: bool,
    /// Notes on the processing of the data, as text.
    pub notes: Vec<String>,
    /// Torque over time, for the HTML page.
    pub traces: Vec<Trace>,
}
