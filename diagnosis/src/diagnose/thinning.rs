//! Subsampling of rows.
//!
//! Promises: deterministic, and reported. Never: a changed reading.

use crate::from_recording::Outline;
use std::borrow::Cow;
use std::ops::Range;

/// Settled poses whose readings are looked at, at most.
const SETTLED_MAX: usize = 6000;
/// Poses of paths whose readings are looked at, at most: neighbours tell much the same.
pub(super) const POSES_MAX: usize = 3000;
/// Stretches of neighbours among them: half of all.
pub(super) const STRETCHES: usize = 10;

/// What of rows tells which are looked at.
pub(super) struct Rows<'a> {
    /// Rows that follow each other in time along a path.
    pub(super) paths: Cow<'a, [Range<usize>]>,
    /// Whether anything was measured.
    pub(super) measured: Cow<'a, [bool]>,
    /// Whether a joint's direction is not the one of the row before.
    pub(super) turned: Cow<'a, [bool]>,
    /// How many the arm has.
    pub(super) joints: usize,
    /// Of a row and a joint, rad/s² or m/s².
    pub(super) acceleration: Box<dyn Fn(usize, usize) -> f64 + 'a>,
}

/// The rows that are looked at.
pub(super) struct Stepwise {
    /// Rows that stay, if only for where the joints were.
    pub(super) kept: Vec<bool>,
    /// Rows whose readings stay.
    pub(super) read: Vec<bool>,
    /// What was done, for users.
    pub(super) says: String,
}

impl<'a> From<&'a Outline> for Rows<'a> {
    fn from(outline: &'a Outline) -> Self {
        Self {
            paths: outline.paths.as_slice().into(),
            measured: outline.measured.as_slice().into(),
            turned: outline.turned.as_slice().into(),
            joints: outline.rates.len(),
            acceleration: Box::new(|row, joint| outline.rates[joint][row].1),
        }
    }
}

/// Chooses among very many rows; none where all are looked at. Of settled poses every n-th, and all stay where the joints were.
/// Of paths: stretches of neighbours where the arm is driven hardest, since what rings and lags shows there, every n-th of the
/// rest, and every row where a joint turns round, since play and hysteresis remember these.
pub(super) fn choose(rows: &Rows<'_>) -> Option<Stepwise> {
    let measured = rows.measured.iter().filter(|measured| **measured).count();
    let (most, evenly) = match *rows.paths {
        [] => (SETTLED_MAX, SETTLED_MAX),
        _ => (POSES_MAX, POSES_MAX / 2),
    };
    if measured <= most {
        return None;
    }
    let stride = measured.div_ceil(evenly);
    let mut read: Vec<bool> = (0..rows.measured.len()).map(|k| k % stride == 0).collect();
    for stretch in hardest(rows) {
        read[stretch].fill(true);
    }
    let kept = with_turns(rows, &read);
    let looked_at = read.iter().zip(&*rows.measured).filter(|(a, b)| **a && **b).count();
    let which = match *rows.paths {
        [] => format!("one in {stride}"),
        _ => format!(
            "{STRETCHES} sections with the highest dynamics, and one in {stride} of the rest"
        ),
    };
    let says = format!("{looked_at} of {measured} rows were used: {which}");
    Some(Stepwise { kept, read, says })
}

/// All rows but those of paths that are neither read nor beside the place where a joint turns round.
fn with_turns(rows: &Rows<'_>, read: &[bool]) -> Vec<bool> {
    let mut kept = vec![true; read.len()];
    for path in &*rows.paths {
        let turns = |k: &usize| *k > path.start && *k < path.end && rows.turned[*k];
        for k in path.clone() {
            // It turned about the row before.
            kept[k] = read[k] || (k..k + 3).any(|k| turns(&k));
        }
    }
    kept
}

/// The stretches of neighbours in which joints are accelerated most.
fn hardest(rows: &Rows<'_>) -> Vec<Range<usize>> {
    let length = POSES_MAX / (2 * STRETCHES);
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
    pieces.into_iter().take(STRETCHES).map(|(_, piece)| piece).collect()
}
