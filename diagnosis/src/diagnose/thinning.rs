//! Subsampling of the rows of long recordings. It is deterministic and reported to the user; no measured value is changed.

use crate::campaign_import::RecordingSummary;
use std::borrow::Cow;
use std::ops::Range;

/// Largest number of settled poses whose measurements are used.
const SETTLED_MAX: usize = 6000;
/// Largest number of poses of paths whose measurements are used: neighbouring rows contain much the same information.
pub(super) const POSES_MAX: usize = 3000;
/// Number of sections of consecutive rows among them, which are half of all.
pub(super) const SECTIONS: usize = 10;

/// Properties of rows by which they are selected.
pub(super) struct RowProperties<'a> {
    /// Paths: rows that follow each other in time.
    pub(super) paths: Cow<'a, [Range<usize>]>,
    /// Whether the row contains a measurement.
    pub(super) measured: Cow<'a, [bool]>,
    /// Whether a joint has reversed since the row before.
    pub(super) is_reversal: Cow<'a, [bool]>,
    /// Number of joints.
    pub(super) joints: usize,
    /// Acceleration by row and joint, rad/s² or m/s².
    pub(super) acceleration: Box<dyn Fn(usize, usize) -> f64 + 'a>,
}

/// The selected rows.
pub(super) struct RowSelection {
    /// Rows that are kept, if only for their joint positions.
    pub(super) kept: Vec<bool>,
    /// Rows whose measurements are kept.
    pub(super) measured_kept: Vec<bool>,
    /// Message for the user.
    pub(super) note: String,
}

impl<'a> From<&'a RecordingSummary> for RowProperties<'a> {
    fn from(outline: &'a RecordingSummary) -> Self {
        Self {
            paths: outline.paths.as_slice().into(),
            measured: outline.measured.as_slice().into(),
            is_reversal: outline.turned.as_slice().into(),
            joints: outline.rates.len(),
            acceleration: Box::new(|row, joint| outline.rates[joint][row].1),
        }
    }
}

/// Selects rows of a long recording; `None` if all are used.
///
/// - Settled poses: every n-th measurement; all joint positions are kept.
/// - Paths: the sections with the highest accelerations, where flexible modes and servo lag are visible; every n-th of the other rows; and the rows
///   about each reversal, since backlash and hysteresis depend on them.
pub(super) fn select_rows(rows: &RowProperties<'_>) -> Option<RowSelection> {
    let measured = rows.measured.iter().filter(|measured| **measured).count();
    let (most, evenly) = match *rows.paths {
        [] => (SETTLED_MAX, SETTLED_MAX),
        _ => (POSES_MAX, POSES_MAX / 2),
    };
    if measured <= most {
        return None;
    }
    let stride = measured.div_ceil(evenly);
    let mut measured_kept: Vec<bool> = (0..rows.measured.len()).map(|k| k % stride == 0).collect();
    for stretch in most_dynamic_sections(rows) {
        measured_kept[stretch].fill(true);
    }
    let kept = with_reversals(rows, &measured_kept);
    let looked_at = measured_kept.iter().zip(&*rows.measured).filter(|(a, b)| **a && **b).count();
    let which = match *rows.paths {
        [] => format!("one in {stride}"),
        _ => format!(
            "{SECTIONS} sections with the highest dynamics, and one in {stride} of the rest"
        ),
    };
    let note = format!("{looked_at} of {measured} rows were used: {which}");
    Some(RowSelection { kept, measured_kept, note })
}

/// All rows except those of paths that are neither in `read` nor next to a reversal.
fn with_reversals(rows: &RowProperties<'_>, read: &[bool]) -> Vec<bool> {
    let mut kept = vec![true; read.len()];
    for path in &*rows.paths {
        let turns = |k: &usize| *k > path.start && *k < path.end && rows.is_reversal[*k];
        for k in path.clone() {
            // The joint was at its extreme position in the row before.
            kept[k] = read[k] || (k..k + 3).any(|k| turns(&k));
        }
    }
    kept
}

/// The sections of consecutive rows with the highest accelerations.
fn most_dynamic_sections(rows: &RowProperties<'_>) -> Vec<Range<usize>> {
    let length = POSES_MAX / (2 * SECTIONS);
    let pieces = rows.paths.iter().flat_map(|path| {
        let starts = path.clone().step_by(length);
        starts.map(|start| start..(start + length).min(path.end))
    });
    let driven = |piece: &Range<usize>| {
        let of_row = |row| (0..rows.joints).map(move |joint| (rows.acceleration)(row, joint));
        piece.clone().flat_map(of_row).map(|a| a * a).sum::<f64>()
    };
    let mut pieces: Vec<(f64, Range<usize>)> = pieces.map(|p| (driven(&p), p)).collect();
    pieces.sort_by(|a, b| b.0.total_cmp(&a.0));
    pieces.into_iter().take(SECTIONS).map(|(_, piece)| piece).collect()
}
