//! Partially invalid recordings: a frozen joint column, measurements of another object.
//!
//! A joint at rest raises no suspicion: the tool error must also increase strongly from there on. No part is excluded automatically.

use super::{SuspectedError, UNEXPLAINED_FRACTION, UNEXPLAINED_LEAST_M, thinned, workspace_radius};
use crate::campaign::Campaign;
use crate::fit::{FitEffort, FitSettings, fit};
use crate::hold_out::PositionErrors;
use crate::hypothesis::Hypothesis;
use crate::robust_weights::Influence;
use physics::Model;

/// A fraction of gross errors above this is not explained by outliers.
const PART: f64 = 0.15;
/// Least number of poses before and after a joint's last motion, as a fraction of all.
const STRETCH: f64 = 0.1;
const LEAST: f64 = 10.0;
/// A frozen column increases the tool error from there on at least by the first factor, and to more than the second fraction of the workspace.
const WORSE: f64 = 5.0;
const SHOWS: f64 = 1e-3;

/// A partial error of the campaign, given that `model` is the measured robot.
#[must_use]
pub fn detect_partial_corruption(campaign: &Campaign, model: &Model) -> Option<SuspectedError> {
    let few = thinned(campaign);
    let spread_m = workspace_radius(&few);
    let joints = model.arm.count();
    let frozen = (0..joints).filter_map(|joint| frozen(&few, model, joint, joints, spread_m));
    let worst = frozen.max_by(|a, b| a.before_m.total_cmp(&b.before_m));
    worst.or_else(|| displaced_part(&few, model, spread_m))
}

fn errors(few: &Campaign, model: &Model, used: &[bool], wanted: &[bool]) -> PositionErrors {
    let influence = Influence::Huber;
    let settings = FitSettings { used, influence, from: None, effort: FitEffort::Sketch };
    PositionErrors::of(&fit(few, &Hypothesis::fixed(*model), &settings), few, wanted)
}

/// A joint whose column is constant from some row on, although the tool moves in a way that only that joint explains.
fn frozen(
    few: &Campaign,
    model: &Model,
    joint: usize,
    joints: usize,
    spread_m: f64,
) -> Option<SuspectedError> {
    let count = few.poses.len();
    let q = |pose: usize| &few.poses[pose].inputs.q;
    let changes = |k: &usize| q(*k)[joint] != q(*k - 1)[joint];
    let last = (1..count).rev().find(changes)?;
    let recording = few.poses[last].recording;
    let is_early = |pose: usize| pose < last && few.poses[pose].recording == recording;
    let early: Vec<bool> = (0..count).map(is_early).collect();
    let late: Vec<bool> =
        (0..count).map(|k| k > last && few.poses[k].recording == recording).collect();
    let count_of = |side: &[bool]| side.iter().filter(|is_member| **is_member).count();
    let rows_min = (STRETCH * count as f64).max(LEAST);
    let others_move = (0..joints).any(|j| (1..count).any(|k| late[k] && q(k)[j] != q(k - 1)[j]));
    // A joint that moved only occasionally may well be at rest.
    let busy = 2 * (1..last).filter(|k| early[*k] && changes(k)).count() > count_of(&early);
    if (count_of(&early) as f64) < rows_min
        || (count_of(&late) as f64) < rows_min
        || !others_move
        || !busy
    {
        return None;
    }
    let before_m = errors(few, model, &early, &late).quantile(0.5);
    let after_m = errors(few, model, &early, &early).quantile(0.5);
    let is_frozen = before_m > WORSE * after_m && before_m > SHOWS * spread_m;
    is_frozen.then(|| SuspectedError {
        message: format!(
            "the position of joint {n} is constant from {:.2} s on (row {}), and from there the tool is {:.1} mm from its predicted position; before, it \
             was {:.1} mm: the column q{n} froze; remove these rows or record again",
            few.poses[last].inputs.time_s,
            few.poses[last].row + 1,
            before_m * 1e3,
            after_m * 1e3,
            n = joint + 1,
        ),
        before_m,
        after_m,
    })
}

/// Too many measurements of something else.
fn displaced_part(few: &Campaign, model: &Model, spread_m: f64) -> Option<SuspectedError> {
    let all = vec![true; few.poses.len()];
    let errors = errors(few, model, &all, &all);
    let edge = UNEXPLAINED_LEAST_M.max(UNEXPLAINED_FRACTION * spread_m);
    let count = errors.sorted_m.iter().filter(|error| **error > edge).count();
    let share = count as f64 / errors.sorted_m.len().max(1) as f64;
    (share > PART).then(|| SuspectedError {
        message: format!(
            "in {:.0} % of the readings the tool was more than {:.0} mm from its predicted position, in the others not: part of the recording is of a different \
             setup; remove these rows or record again",
            1e2 * share,
            1e3 * edge
        ),
        before_m: errors.quantile(1.0 - 0.5 * PART),
        after_m: errors.quantile(0.5),
    })
}
