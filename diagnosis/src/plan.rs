//! Optimal experimental design of measuring poses for the identification of a robot model, and the contribution of each pose.
//!
//! Reading order: [`Task`] (parameters, instruments, constraints), [`setup`] and [`starting_point`] (a task from a description and from recordings),
//! [`plan()`] (poses for a [`Criterion`]), [`best_next_pose`] (one pose, and a stopping rule), [`check`] (test of a model after a collision).
//!
//! Based on the information matrix `M = Σ AᵀA + prior`, with `A` the whitened derivatives of a pose's readings with respect to every fitted
//! parameter, scaled by its prior. The unknown measuring frame and targets are included, so that directions confounded with them do not count.
//! Sources: Borm and Menq 1991 (O1), Fedorov 1972 (exchange), Klimchik et al. 2012, arXiv 1211.5739 (test-pose error). SI units.
//!
//! Invariants: the same task and seed give the same poses; every pose is within the limits, visible, and free of the described obstacles
//! ([`arm_constraints`], [`line_of_sight`]). Motions between poses are not checked for collisions, and effects missing in the hypothesis are not considered.

pub mod arm_constraints;
mod candidate_jacobians;
pub mod check;
mod contributions;
pub mod inverse_kinematics;
pub mod iso;
pub mod line_of_sight;
pub mod next_pose;
pub mod pose_order;
mod pose_selection;
pub mod setup;
pub mod starting_point;
pub mod task;
#[cfg(test)]
mod tests;
pub mod working_zone;

pub use contributions::{PoseContribution, UncertaintyReduction};
pub use next_pose::{NextPose, best_next_pose};
pub use pose_selection::Criterion;
pub use task::{MeasurementKind, Task, TouchSurface, calibration_hypothesis};

use crate::campaign::Campaign;
use crate::fit_result::Fit;
use candidate_jacobians::CandidateJacobians;
use contributions::{contributions, parameter_uncertainties};
use physics::Joints;
use pose_selection::{PoseCriterion, exchange, select_greedily};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Number of random neighbours tried for each selected pose.
const NEIGHBOURS: usize = 6;
/// Largest joint displacement of a neighbour, rad or m.
const NEIGHBOUR_DISTANCE: f64 = 0.12;

/// Existing measurements and their fit.
#[derive(Clone, Copy, Debug)]
pub struct ExistingMeasurements<'a> {
    /// The measurements.
    pub campaign: &'a Campaign,
    /// Their fit; its hypothesis and extrinsic parameters are those of the [`Task`].
    pub fit: &'a Fit,
}

/// Settings of a plan.
#[derive(Clone, Copy, Debug)]
pub struct PlanSettings {
    /// Number of poses.
    pub count: usize,
    /// Criterion of optimality.
    pub criterion: Criterion,
    /// Number of random candidate poses.
    pub candidates: usize,
    /// Seed of the random generator.
    pub seed: u64,
}

/// A selected set of poses.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The poses in an order with short moves, each with its contribution.
    pub poses: Vec<PoseContribution>,
    /// Standard uncertainty of every parameter, without and with all poses.
    pub numbers: Vec<UncertaintyReduction>,
    /// Parameters that the poses together do not determine, as sentences.
    pub undetermined: Vec<String>,
    /// Number of candidate poses.
    pub candidates: usize,
}

/// Why there is no plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// Too few poses satisfy the constraints.
    #[error(
        "of {drawn} poses {origin} {free} are free of base, floor and boxes, and {seen} of these can be measured: {wanted} are needed; {remedy}"
    )]
    TooFewPoses {
        /// Number of random poses, or of given ones.
        drawn: usize,
        /// Which of the two.
        origin: &'static str,
        /// Number accepted by [`arm_constraints::ArmConstraints`].
        free: usize,
        /// Number of these that are visible too.
        seen: usize,
        /// Number required.
        wanted: usize,
        /// What to change, of what was stated.
        remedy: &'static str,
    },
    /// The measurements do not depend on any parameter.
    #[error(
        "no pose determines any parameter of the model: what is measured does not depend on them"
    )]
    NothingIdentifiable,
}

/// Selects poses for `task` that complement the measurements in `known`.
///
/// # Errors
/// [`PlanError`] if fewer poses than required satisfy the constraints, or none determines a parameter.
pub fn plan(
    task: &Task,
    known: Option<ExistingMeasurements<'_>>,
    settings: &PlanSettings,
) -> Result<Plan, PlanError> {
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    let drawn = task.draw(&mut rng, settings.candidates, settings.count)?;
    let candidates = drawn.len();
    let mut jacobians = CandidateJacobians::of(task, known, drawn)?;
    let picks = if settings.criterion == Criterion::Random {
        (0..settings.count).map(|place| place * candidates / settings.count).collect()
    } else {
        select_poses(task, &mut jacobians, settings, &mut rng)
    };
    let start = match known.and_then(|known| known.campaign.poses.last()) {
        Some(pose) => pose.inputs.q,
        None => pose_order::home(&task.hypothesis.model.arm, &task.reach),
    };
    let stops: Vec<Joints> = picks.iter().map(|pick| jacobians.candidates[*pick].q).collect();
    let order = pose_order::visit(&task.hypothesis.model.arm, &start, &stops);
    let picks: Vec<usize> = order.into_iter().map(|place| picks[place]).collect();
    Ok(Plan {
        poses: contributions(task, &jacobians, &picks),
        numbers: parameter_uncertainties(task, &jacobians, &picks),
        undetermined: jacobians.undetermined.clone(),
        candidates,
    })
}

/// The best of the candidates, improved by exchanges with neighbours of the selected poses.
fn select_poses(
    task: &Task,
    jacobians: &mut CandidateJacobians,
    settings: &PlanSettings,
    rng: &mut ChaCha8Rng,
) -> Vec<usize> {
    let design = PoseCriterion::of(jacobians, settings.criterion);
    let mut picks = select_greedily(&|picks| design.improvements(picks), settings.count);
    let chosen: Vec<Joints> = picks.iter().map(|pick| jacobians.candidates[*pick].q).collect();
    let neighbours: Vec<_> = chosen
        .iter()
        .flat_map(|q| task.neighbours(rng, q, NEIGHBOUR_DISTANCE, NEIGHBOURS))
        .collect();
    jacobians.add(task, neighbours);
    let design = PoseCriterion::of(jacobians, settings.criterion);
    exchange(&|picks| design.improvements(picks), &mut picks);
    picks
}
