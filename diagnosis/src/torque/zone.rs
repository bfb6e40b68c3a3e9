//! A zone of low speed in which the torque follows another law: located, reported and excluded, so that it does not bias parameters.
//!
//! Two noise levels, one below and one above a speed, compared with a single one (likelihood ratio over the speed).
//!
//! Promises: a zone is small, significant, and reported with its speed and its share of the rows. Never: an effect.

use physics::{Arm, JointKind};

use super::motion::Motion;
use crate::engine::table::Table;

/// Shares of the rows that are tried.
const SHARES: [f64; 8] = [0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.06];
/// What is left within is so many times what is left beyond, root mean square.
const STANDS_OUT: f64 = 1.6;
/// By so much log-likelihood per row that it takes is two sizes better than one, in all.
const GAIN: f64 = 20.0;
/// Rows within at least.
const ROWS: usize = 20;

/// Where a joint's torque follows no known law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zone {
    /// From 0.
    pub joint: usize,
    /// Slower than this, rad/s or m/s.
    pub below: f64,
    /// The share of the rows.
    pub share: f64,
    /// What is left within and beyond, root mean square, N m or N.
    pub left: [f64; 2],
}

impl Zone {
    /// For people.
    pub(super) fn says(&self, arm: &Arm) -> String {
        let (speed, unit, load) = match arm.joints()[self.joint].kind {
            JointKind::Revolute => (self.below.to_degrees(), "deg/s", "Nm"),
            JointKind::Prismatic => (1e3 * self.below, "mm/s", "N"),
        };
        format!(
            "below {speed:.2} {unit}, the torque of joint {} follows no known law ({:.1} % of the rows; the residual is {:.2} {load} there, {:.2} {load} elsewhere): \
             these rows are excluded from the estimation",
            self.joint + 1,
            100.0 * self.share,
            self.left[0],
            self.left[1]
        )
    }
}

/// Looks for a zone in what is left of a joint, whitened: `left` per row, `used` rows only.
pub(super) fn find(
    motion: &Motion,
    table: &Table,
    joint: usize,
    left: &[f64],
    used: &[bool],
) -> Option<Zone> {
    let speeds = speeds(motion, joint);
    let white = table.whitened(joint, left);
    let mut order: Vec<usize> =
        (0..left.len()).filter(|row| used[*row] && table.moves[joint][*row]).collect();
    order.sort_by(|a, b| speeds[*a].total_cmp(&speeds[*b]).then(a.cmp(b)));
    let count = order.len();
    let sum = |rows: &[usize]| rows.iter().map(|row| white[*row] * white[*row]).sum::<f64>();
    let size = |rows: &[usize]| (sum(rows) / rows.len().max(1) as f64).max(1e-12);
    let all = size(&order);
    let gain = |cut: usize| {
        let (within, beyond) = order.split_at(cut);
        let part = |rows: &[usize]| 0.5 * rows.len() as f64 * (all / size(rows)).ln();
        part(within) + part(beyond)
    };
    let cuts = SHARES.map(|share| (share * count as f64) as usize);
    let cuts = cuts.iter().copied().filter(|cut| *cut >= ROWS);
    let cut = cuts.max_by(|a, b| gain(*a).total_cmp(&gain(*b)))?;
    let (within, beyond) = order.split_at(cut);
    let rms = |rows: &[usize]| {
        libm::sqrt(rows.iter().map(|r| left[*r] * left[*r]).sum::<f64>() / rows.len().max(1) as f64)
    };
    let sizes = [size(within), size(beyond)].map(libm::sqrt);
    // Rows at rest are alike, so that little is new in them: what is left must stand out by itself, too.
    let [inside, outside] = [rms(within), rms(beyond)];
    let stands_out =
        sizes[0] > STANDS_OUT * sizes[1] && inside > STANDS_OUT * outside && gain(cut) > GAIN;
    let below = speeds[*beyond.first()?];
    stands_out.then(|| Zone {
        joint,
        below,
        share: within.len() as f64 / count as f64,
        left: [inside, outside],
    })
}

/// Speeds of a joint, row by row.
pub(super) fn speeds(motion: &Motion, joint: usize) -> Vec<f64> {
    let all = motion.runs.iter().flat_map(|run| {
        let track = &run.joints[joint];
        run.rows.iter().map(|row| track.v[*row].abs())
    });
    all.collect()
}
