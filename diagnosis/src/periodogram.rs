//! Search for periodic joint errors of unknown period, such as those of gears with unknown numbers of teeth.
//!
//! A wave in joint i is one factor per pose times the joint's own column. Each pose's column is projected once on the complement of the fit, so every
//! period costs only one sum over the poses (projected periodogram; Lomb 1976, Scargle 1982, with all fitted parameters as nuisance parameters).
//!
//! Periods that the joint positions cannot distinguish are tried only once. The selection is made in [`mod@crate::diagnose`].

use crate::score_test::ScoreTest;
use crate::simd::dot;
use crate::tool_motion::ToolMotion;
use nalgebra::DMatrix;
use physics::Chain;
use std::f64::consts::TAU;

/// Largest number of cycles per revolution (prismatic joints: radians of phase per metre) that is tried: second harmonic of the largest common gear
/// ratio.
const CYCLES_MAX: f64 = 420.0;
/// Grid steps per width of a spectral line.
const STEPS_PER_LINE: f64 = 4.0;
/// Least number of cycles over the range of a joint; slower errors are modelled by other effects.
pub(crate) const CYCLES_MIN: f64 = 2.0;
/// Periods that are evaluated in one matrix product.
const PERIODS_PER_BLOCK: usize = 32;
/// Positions closer than this are equal, rad or m.
const SAME: f64 = 1e-4;

/// The best period of a joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BestPeriod {
    pub(crate) joint: usize,
    /// Cycles per revolution (prismatic: radians of phase per metre).
    pub(crate) cycles: f64,
}

/// Contribution of one pose to the sums of one joint.
struct PoseSums {
    position: f64,
    information: f64,
    gradient: f64,
    projection: Vec<f64>,
}

/// The best period of each joint with enough positions.
pub(crate) fn best_periods(fitted: &ScoreTest<'_>) -> Vec<BestPeriod> {
    let parts = parts(fitted);
    parts.iter().enumerate().filter_map(|(joint, parts)| best_period(parts, joint)).collect()
}

/// The contributions of all poses for every joint.
fn parts(fitted: &ScoreTest<'_>) -> Vec<Vec<PoseSums>> {
    let active = fitted.fit.columns();
    let width = fitted.state.width();
    let arm = &fitted.state.hypothesis.model.arm;
    let mut parts: Vec<Vec<PoseSums>> = (0..arm.count()).map(|_| Vec::new()).collect();
    let mut pose = usize::MAX;
    let mut motions: Vec<ToolMotion> = Vec::new();
    fitted.linearisation.for_each_reading(|reading, slopes| {
        let scale = fitted.weighing.scale(reading);
        if scale == 0.0 {
            return;
        }
        if reading.pose != pose {
            pose = reading.pose;
            let q = &fitted.campaign.poses[pose].inputs.q;
            let chain = Chain::nominal(arm, q);
            motions =
                (0..arm.count()).map(|joint| ToolMotion::of_joint(arm, &chain, joint)).collect();
            for (parts, position) in parts.iter_mut().zip(q) {
                let projection = vec![0.0; active.len()];
                parts.push(PoseSums {
                    position: *position,
                    information: 0.0,
                    gradient: 0.0,
                    projection,
                });
            }
        }
        for (parts, motion) in parts.iter_mut().zip(&motions) {
            let Some(part) = parts.last_mut() else { continue };
            let column = reading.rows.derivative_along(motion) * scale;
            part.information += column.length_squared();
            part.gradient += column.dot(reading.rows.residual) * scale;
            for k in 0..reading.rows.count {
                let (share, full) = (scale * column[k], &slopes[k * width..]);
                part.projection.iter_mut().zip(active).for_each(|(s, j)| *s += share * full[*j]);
            }
        }
    });
    let right = fitted.right();
    for part in parts.iter_mut().flatten() {
        part.projection = fitted.fit.triangle.forward(std::mem::take(&mut part.projection));
        part.gradient -= dot(&part.projection, right);
    }
    parts
}

fn best_period(parts: &[PoseSums], joint: usize) -> Option<BestPeriod> {
    let positions = || parts.iter().map(|part| part.position);
    let range =
        positions().fold(f64::NEG_INFINITY, f64::max) - positions().fold(f64::INFINITY, f64::min);
    let mut different: Vec<i64> = positions().map(|q| (q / SAME).round() as i64).collect();
    different.sort_unstable();
    different.dedup();
    if range <= SAME || different.len() < 20 {
        return None;
    }
    // Fewer than two different positions per cycle cannot distinguish a wave from a slower one.
    let most = CYCLES_MAX.min(TAU / range * different.len() as f64 / 2.0);
    let step = TAU / range / STEPS_PER_LINE;
    let lowest = CYCLES_MIN * TAU / range;
    let tried = ((most - lowest) / step).floor().max(0.0) as usize;
    let mut turns = PhaseRotation::new(parts, lowest, step);
    let gains = (0..tried.div_ceil(PERIODS_PER_BLOCK)).flat_map(|_| turns.next_gains(parts));
    let all = gains.take(tried).enumerate().map(|(k, gain)| (lowest + step * k as f64, gain));
    let (cycles, _) = all.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(BestPeriod { joint, cycles })
}

/// Sine and cosine of every contribution at successive periods, each computed from the preceding one by a rotation.
struct PhaseRotation {
    now: Vec<(f64, f64)>,
    by: Vec<(f64, f64)>,
    /// Projection of each contribution on the fit's columns, one column per contribution.
    projections: DMatrix<f64>,
    /// One row per contribution: its sines at [`PERIODS_PER_BLOCK`] periods, then its cosines.
    waves: DMatrix<f64>,
}

impl PhaseRotation {
    fn new(parts: &[PoseSums], first: f64, step: f64) -> Self {
        let width = parts.first().map_or(0, |part| part.projection.len());
        let phases_at =
            |cycles: f64| parts.iter().map(|p| libm::sincos(cycles * p.position)).collect();
        let projections =
            DMatrix::from_fn(width, parts.len(), |row, part| parts[part].projection[row]);
        let waves = DMatrix::zeros(parts.len(), 2 * PERIODS_PER_BLOCK);
        Self { now: phases_at(first), by: phases_at(step), projections, waves }
    }

    /// Decrease of the sum of squares by sine and cosine together, for each of the next periods.
    fn next_gains(&mut self, parts: &[PoseSums]) -> [f64; PERIODS_PER_BLOCK] {
        let mut sums = [PeriodSums::default(); PERIODS_PER_BLOCK];
        for (period, sums) in sums.iter_mut().enumerate() {
            let turning = parts.iter().zip(&mut self.now).zip(&self.by);
            for (row, ((part, now), by)) in turning.enumerate() {
                let (sin, cos) = *now;
                sums.add(part, sin, cos);
                self.waves[(row, period)] = sin;
                self.waves[(row, PERIODS_PER_BLOCK + period)] = cos;
                *now = (sin * by.1 + cos * by.0, cos * by.1 - sin * by.0);
            }
        }
        let projected = &self.projections * &self.waves;
        let column =
            |k: usize| &projected.as_slice()[k * projected.nrows()..(k + 1) * projected.nrows()];
        std::array::from_fn(|k| sums[k].gain(column(k), column(PERIODS_PER_BLOCK + k)))
    }
}

/// Sums over the contributions at one period: products of sine and cosine, and their gradients.
#[derive(Clone, Copy, Default)]
struct PeriodSums {
    ss: f64,
    sc: f64,
    cc: f64,
    bs: f64,
    bc: f64,
}

impl PeriodSums {
    fn add(&mut self, part: &PoseSums, sin: f64, cos: f64) {
        self.ss += sin * sin * part.information;
        self.sc += sin * cos * part.information;
        self.cc += cos * cos * part.information;
        self.bs += sin * part.gradient;
        self.bc += cos * part.gradient;
    }

    /// Decrease of the sum of squares by both, given their projections on the fit's columns.
    fn gain(&self, sine: &[f64], cosine: &[f64]) -> f64 {
        let Self { bs, bc, .. } = *self;
        let ss = self.ss - dot(sine, sine);
        let sc = self.sc - dot(sine, cosine);
        let cc = self.cc - dot(cosine, cosine);
        let whole = self.ss.min(self.cc);
        let determinant = ss * cc - sc * sc;
        if determinant <= 1e-6 * whole * whole {
            return 0.0;
        }
        (cc * bs * bs - 2.0 * sc * bs * bc + ss * bc * bc) / determinant
    }
}
