//! Time stamps of paths: gaps and uneven steps. Settled poses are not checked, since their times are irrelevant.

use crate::engine::statistics::median;
use recording::series::{Recording, RecordingKind};

/// A step longer than this many times the median is a gap.
const GAP: f64 = 5.0;
/// Relative standard deviation of the steps, compared with the median, above which they are uneven.
const UNEVEN: f64 = 0.02;
/// Least number of steps for any statement.
const STEPS_LEAST: usize = 20;

/// Messages for the user on the time stamps.
pub(super) fn notes(recording: &Recording) -> Vec<String> {
    let t = &recording.t_s;
    let joined = |row: &usize| recording.segment[*row] == recording.segment[row - 1];
    let steps: Vec<(usize, f64)> =
        (1..t.len()).filter(joined).map(|row| (row, t[row] - t[row - 1])).collect();
    if recording.metadata.kind != RecordingKind::Path || steps.len() < STEPS_LEAST {
        return Vec::new();
    }
    let middle = median(steps.iter().map(|step| step.1));
    let mut notes = Vec::new();
    let (gaps, even): (Vec<_>, Vec<_>) = steps.into_iter().partition(|step| step.1 > GAP * middle);
    if let Some((row, longest)) = gaps.iter().max_by(|a, b| a.1.total_cmp(&b.1)) {
        notes.push(format!(
            "time has {} gap{} between rows {:.4} s apart; the longest is {longest:.3} s, after {:.3} s",
            gaps.len(),
            if gaps.len() == 1 { "" } else { "s" },
            middle,
            t[row - 1]
        ));
    }
    let squares: f64 = even.iter().map(|step| (step.1 - middle).powi(2)).sum();
    let spread = (squares / even.len().max(1) as f64).sqrt();
    if spread > UNEVEN * middle {
        notes.push(format!(
            "rows are not evenly spaced: {middle:.4} s apart with a spread of {spread:.4} s"
        ));
    }
    notes
}
