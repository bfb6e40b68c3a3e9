//! Plot data of the HTML page on torques: measured values, and residuals without and with findings,
//! evenly subsampled.

use super::case::Case;
use crate::engine::stepwise::TermSelection;

/// Maximum number of points of a trace.
const POINTS: usize = 1500;

/// Measured and residual torque of one joint over time.
#[derive(Clone, Debug)]
pub struct Trace {
    /// Joint from 0.
    pub joint: usize,
    /// Time without the pauses between runs, s.
    pub t_s: Vec<f64>,
    /// Velocity, rad/s or m/s.
    pub speed: Vec<f64>,
    /// Recorded torque, filtered, N m or N.
    pub torque: Vec<f64>,
    /// Residual torque of the given model, and with all findings, N m or N.
    pub residuals: [Vec<f64>; 2],
    /// Whether a row belongs to the test set.
    pub is_test_row: Vec<bool>,
}

/// RMS recorded torque of a joint on `used` rows, N m or N.
pub(super) fn torque_rms(case: &Case, joint: usize, used: &[bool]) -> f64 {
    let torque = torque(case, joint);
    let kept = torque.iter().zip(used).filter(|(_, used)| **used).map(|(x, _)| x * x);
    let (sum, count) = kept.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    if count > 0.0 { libm::sqrt(sum / count) } else { 0.0 }
}

fn torque(case: &Case, joint: usize) -> Vec<f64> {
    let target = case.table.target[joint].iter().flatten();
    target.zip(&case.stated_torque[joint]).map(|(rest, stated)| rest + stated).collect()
}

/// Plot data of one joint.
pub(super) fn trace(
    case: &Case,
    (given, selection): (&TermSelection, &TermSelection),
    joint: usize,
) -> Trace {
    let residuals = [given, selection].map(|one| case.residual(&one.solved, joint));
    let torque = torque(case, joint);
    let (mut t_s, mut speed) = (Vec::new(), Vec::new());
    let mut start = 0.0;
    for run in &case.motion.runs {
        let first = run.rows.first().copied().unwrap_or(0);
        t_s.extend(run.rows.iter().map(|row| start + (row - first) as f64 * run.step_s));
        speed.extend(run.rows.iter().map(|row| run.joints[joint].v[*row]));
        start = t_s.last().copied().unwrap_or(start);
    }
    let thin = torque.len().div_ceil(POINTS).max(1);
    let some = |list: &[f64]| list.iter().copied().step_by(thin).collect::<Vec<f64>>();
    Trace {
        joint,
        t_s: some(&t_s),
        speed: some(&speed),
        torque: some(&torque),
        residuals: residuals.map(|list| some(&list)),
        is_test_row: case.row_sets.test.iter().copied().step_by(thin).collect(),
    }
}
