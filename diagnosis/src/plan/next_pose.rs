//! The next pose to measure, and the stopping rule.
//!
//! The stopping rule considers the expected tool error and its reduction by ten more poses only, not errors of the model's form.

use super::candidate_jacobians::CandidateJacobians;
use super::contributions::{contributions, tool_error_m};
use super::pose_order::time_s;
use super::pose_selection::{Criterion, PoseCriterion, select_greedily};
use super::{ExistingMeasurements, PlanError, PoseContribution, Task};
use physics::Joints;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Number of poses of the look-ahead.
pub const LOOKAHEAD_POSES: usize = 10;
/// Among poses with at least this share of the best improvement, the nearest is selected.
const NEARLY_BEST_SHARE: f64 = 0.97;

/// The next measurement.
#[derive(Clone, Debug)]
pub struct NextPose {
    /// The pose and its contribution.
    pub pose: PoseContribution,
    /// RMS of the expected tool error at the test poses, m: now, and with [`LOOKAHEAD_POSES`] more poses.
    pub tool_m: [f64; 2],
    /// Whether [`LOOKAHEAD_POSES`] more poses would reduce the error by less than the required amount.
    pub enough: bool,
}

/// The pose that reduces the expected tool error most; among nearly equal ones, the nearest to the last pose. `worth_m`: smallest reduction of that
/// error by ten more poses that justifies measuring, m.
///
/// # Errors
/// [`PlanError`] if no pose satisfies the constraints, or none determines a parameter.
pub fn best_next_pose(
    task: &Task,
    known: Option<ExistingMeasurements<'_>>,
    candidates: usize,
    worth_m: f64,
    seed: u64,
) -> Result<NextPose, PlanError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let drawn = task.draw(&mut rng, candidates, LOOKAHEAD_POSES)?;
    let jacobians = CandidateJacobians::of(task, known, drawn)?;
    let design = PoseCriterion::of(&jacobians, Criterion::Zone);
    let ahead = select_greedily(&|picks| design.improvements(picks), LOOKAHEAD_POSES);
    let after = design.information(&ahead);
    let last = known.and_then(|known| known.campaign.poses.last()).map(|pose| pose.inputs.q);
    let pick = nearest(task, &jacobians, &design.improvements(&[]), last);
    let pose =
        contributions(task, &jacobians, &[pick]).pop().ok_or(PlanError::NothingIdentifiable)?;
    let tool_m =
        [tool_error_m(&jacobians, &jacobians.prior_information), tool_error_m(&jacobians, &after)];
    Ok(NextPose { pose, tool_m, enough: tool_m[0] - tool_m[1] < worth_m })
}

fn nearest(
    task: &Task,
    jacobians: &CandidateJacobians,
    worths: &[f64],
    last: Option<Joints>,
) -> usize {
    let most = worths.iter().copied().fold(0.0, f64::max);
    let away = |pick: usize| {
        last.map_or(0.0, |last| time_s(task.arm(), &last, &jacobians.candidates[pick].q))
    };
    let good = (0..worths.len()).filter(|pick| worths[*pick] >= NEARLY_BEST_SHARE * most);
    good.min_by(|a, b| away(*a).total_cmp(&away(*b))).unwrap_or(0)
}
