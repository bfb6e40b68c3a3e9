//! The next pose to measure, and the stopping rule.
//!
//! The stopping rule considers the expected tool error and its reduction by ten more poses only, not errors of the model's form.

use super::bank::Bank;
use super::choose::{Criterion, Design, choose};
use super::gain::{gains, tool_m};
use super::order::time_s;
use super::{Added, Known, NoPlan, Task};
use physics::Joints;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Number of poses of the look-ahead.
pub const AHEAD: usize = 10;
/// Among poses with at least this share of the best improvement, the nearest is selected.
const AS_GOOD: f64 = 0.97;

/// The next measurement.
#[derive(Clone, Debug)]
pub struct Next {
    /// The pose and its contribution.
    pub pose: Added,
    /// RMS of the expected tool error at the test poses, m: now, and with [`AHEAD`] more poses.
    pub tool_m: [f64; 2],
    /// Whether [`AHEAD`] more poses would reduce the error by less than the required amount.
    pub enough: bool,
}

/// The pose that reduces the expected tool error most; among nearly equal ones, the nearest to the last pose. `worth_m`: smallest reduction of that
/// error by ten more poses that justifies measuring, m.
///
/// # Errors
/// [`NoPlan`] if no pose satisfies the constraints, or none determines a parameter.
pub fn next(
    task: &Task,
    known: Option<Known<'_>>,
    candidates: usize,
    worth_m: f64,
    seed: u64,
) -> Result<Next, NoPlan> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let drawn = task.draw(&mut rng, candidates, AHEAD)?;
    let bank = Bank::of(task, known, drawn)?;
    let design = Design::of(&bank, Criterion::Zone);
    let ahead = choose(&|picks| design.worths(picks), AHEAD);
    let after = design.information(&ahead);
    let last = known.and_then(|known| known.campaign.poses.last()).map(|pose| pose.inputs.q);
    let pick = nearest(task, &bank, &design.worths(&[]), last);
    let pose = gains(task, &bank, &[pick]).pop().ok_or(NoPlan::Nothing)?;
    let tool_m = [tool_m(&bank, &bank.before), tool_m(&bank, &after)];
    Ok(Next { pose, tool_m, enough: tool_m[0] - tool_m[1] < worth_m })
}

fn nearest(task: &Task, bank: &Bank, worths: &[f64], last: Option<Joints>) -> usize {
    let most = worths.iter().copied().fold(0.0, f64::max);
    let away =
        |pick: usize| last.map_or(0.0, |last| time_s(task.arm(), &last, &bank.candidates[pick].q));
    let good = (0..worths.len()).filter(|pick| worths[*pick] >= AS_GOOD * most);
    good.min_by(|a, b| away(*a).total_cmp(&away(*b))).unwrap_or(0)
}
