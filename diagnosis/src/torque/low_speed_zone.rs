//! Low-speed zone in which no known law describes a joint's torque: located, reported and excluded, so that it does not bias parameters.
//!
//! Compares two noise levels, below and above a threshold velocity, with a single one by the likelihood ratio over several thresholds. A zone must
//! contain few of the rows and be significant.

use physics::{Arm, JointKind};

use super::motion::Motion;
use crate::engine::regression_data::RegressionData;

/// Shares of the rows that are tried as zones.
const TRIED_SHARES: [f64; 8] = [0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.06];
/// Minimum ratio of the RMS residual within the zone to that outside.
const RMS_RATIO_LEAST: f64 = 1.6;
/// Minimum gain in log-likelihood of two noise levels compared with one.
const LIKELIHOOD_GAIN_LEAST: f64 = 20.0;
/// Minimum number of rows in a zone.
const ROWS_LEAST: usize = 20;

/// A velocity range in which a joint's torque follows no known law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zone {
    /// Joint from 0.
    pub joint: usize,
    /// Upper limit of the speed, rad/s or m/s.
    pub speed_limit: f64,
    /// Share of the rows in the zone.
    pub share: f64,
    /// RMS residual within and outside the zone, N m or N.
    pub residual_rms: [f64; 2],
}

impl Zone {
    /// Sentence for users.
    pub(super) fn note(&self, arm: &Arm) -> String {
        let (speed, unit, load) = match arm.joints()[self.joint].kind {
            JointKind::Revolute => (self.speed_limit.to_degrees(), "deg/s", "Nm"),
            JointKind::Prismatic => (1e3 * self.speed_limit, "mm/s", "N"),
        };
        format!(
            "below {speed:.2} {unit}, the torque of joint {} follows no known law ({:.1} % of the rows; the residual is {:.2} {load} there, {:.2} {load} elsewhere): \
             these rows are excluded from the estimation",
            self.joint + 1,
            100.0 * self.share,
            self.residual_rms[0],
            self.residual_rms[1]
        )
    }
}

/// Searches a zone in the residual `left` of a joint, given per row; only `used` rows count.
pub(super) fn find(
    motion: &Motion,
    table: &RegressionData,
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
    let cuts = TRIED_SHARES.map(|share| (share * count as f64) as usize);
    let cuts = cuts.iter().copied().filter(|cut| *cut >= ROWS_LEAST);
    let cut = cuts.max_by(|a, b| gain(*a).total_cmp(&gain(*b)))?;
    let (within, beyond) = order.split_at(cut);
    let rms = |rows: &[usize]| {
        libm::sqrt(rows.iter().map(|r| left[*r] * left[*r]).sum::<f64>() / rows.len().max(1) as f64)
    };
    let sizes = [size(within), size(beyond)].map(libm::sqrt);
    // Consecutive rows at low speed are similar, so their innovations are small: the residual itself must exceed the ratio too.
    let [inside, outside] = [rms(within), rms(beyond)];
    let stands_out = sizes[0] > RMS_RATIO_LEAST * sizes[1]
        && inside > RMS_RATIO_LEAST * outside
        && gain(cut) > LIKELIHOOD_GAIN_LEAST;
    let speed_limit = speeds[*beyond.first()?];
    stands_out.then(|| Zone {
        joint,
        speed_limit,
        share: within.len() as f64 / count as f64,
        residual_rms: [inside, outside],
    })
}

/// Speed of a joint (absolute value), row by row, rad/s or m/s.
pub(super) fn speeds(motion: &Motion, joint: usize) -> Vec<f64> {
    let all = motion.runs.iter().flat_map(|run| {
        let track = &run.joints[joint];
        run.rows.iter().map(|row| track.v[*row].abs())
    });
    all.collect()
}
