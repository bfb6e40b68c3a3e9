//! The next pose to measure, and the stopping rule.
//!
//! Promises: "enough" refers only to the expected tool error and its reduction by ten more poses. Never: to errors of the model's form.

use super::bank::Bank;
use super::choose::{Criterion, Design, choose};
use super::gain::{gains, tool_m};
use super::order::time_s;
use super::{Added, Known, NoPlan, Task};
use physics::Joints;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Poses that are looked ahead.
pub const AHEAD: usize = 10;
/// Of poses that are about as good (this share of the best), the nearest is taken.
const AS_GOOD: f64 = 0.97;

/// What to do next.
#[derive(Clone, Debug)]
pub struct Next {
    /// The pose, and what it brings.
    pub pose: Added,
    /// Expected error of the tool at the poses asked, m: now, and with [`AHEAD`] more poses.
    pub tool_m: [f64; 2],
    /// Whether ten more would take off less than what was said to be worth it.
    pub enough: bool,
}

/// The pose that takes most off the tool's expected error, near the last one where several are about as good. `worth_m`: what ten more poses have to take off
/// that error to be worth measuring.
///
/// # Errors
/// Where no pose passes the constraints, or none tells anything.
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
