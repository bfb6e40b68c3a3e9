//! A search for waves of unknown period in the joints: gears whose teeth nobody wrote down.
//!
//! A wave in joint i is one number per pose times the joint's own column. With each pose's column brought to what the fit leaves of it
//! once, every period costs one sum over the poses (the projected periodogram; Lomb 1976, Scargle 1982, with all that is fitted anyway taken out).
//!
//! Promises: periods that the positions of the joint cannot tell apart are not tried twice.
//! Never: a decision; see [`mod@crate::select`].

use crate::motion::Motion;
use crate::score::Fitted;
use crate::triangle::dot;
use physics::Chain;
use std::f64::consts::TAU;

/// The most cycles per revolution (per radian of phase for a prismatic joint) that are tried: twice the ratio of the largest common gears, and their wave.
const CYCLES_MAX: f64 = 420.0;
/// Steps per width of a line.
const STEPS_PER_LINE: f64 = 4.0;
/// Below this many cycles over the range of a joint, slow effects stand for it.
pub(crate) const CYCLES_MIN: f64 = 2.0;
/// Positions closer than this are one, rad or m.
const SAME: f64 = 1e-4;

/// The best period of a joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) joint: usize,
    /// Cycles per revolution (prismatic: radians of phase per metre).
    pub(crate) cycles: f64,
    /// By how much the sum of squares would fall.
    pub(crate) gain: f64,
    /// How many periods were tried on this joint.
    pub(crate) tried: usize,
}

/// What one pose adds to the sums of one joint.
struct Part {
    position: f64,
    own: f64,
    pull: f64,
    seen: Vec<f64>,
}

/// The best line of each joint.
pub(crate) fn lines(fitted: &Fitted<'_>) -> Vec<Line> {
    let parts = parts(fitted);
    parts.iter().enumerate().filter_map(|(joint, parts)| best(parts, joint)).collect()
}

/// The parts of every joint.
fn parts(fitted: &Fitted<'_>) -> Vec<Vec<Part>> {
    let active = fitted.fit.columns();
    let width = fitted.state.width();
    let arm = &fitted.state.hypothesis.model.arm;
    let mut parts: Vec<Vec<Part>> = (0..arm.count()).map(|_| Vec::new()).collect();
    let mut pose = usize::MAX;
    let mut motions: Vec<Motion> = Vec::new();
    fitted.linearisation.look(|at, slopes| {
        let scale = fitted.weighing.scale(at);
        if scale == 0.0 {
            return;
        }
        if at.pose != pose {
            pose = at.pose;
            let q = &fitted.campaign.poses[pose].inputs.q;
            let chain = Chain::nominal(arm, q);
            motions = (0..arm.count()).map(|joint| Motion::of_joint(arm, &chain, joint)).collect();
            for (parts, position) in parts.iter_mut().zip(q) {
                let seen = vec![0.0; active.len()];
                parts.push(Part { position: *position, own: 0.0, pull: 0.0, seen });
            }
        }
        for (parts, motion) in parts.iter_mut().zip(&motions) {
            let Some(part) = parts.last_mut() else { continue };
            let column = at.rows.along(motion) * scale;
            part.own += column.length_squared();
            part.pull += column.dot(at.rows.residual) * scale;
            for k in 0..at.rows.count {
                let (share, full) = (scale * column[k], &slopes[k * width..]);
                part.seen.iter_mut().zip(active).for_each(|(s, j)| *s += share * full[*j]);
            }
        }
    });
    let right = fitted.right();
    for part in parts.iter_mut().flatten() {
        part.seen = fitted.fit.triangle.forward(std::mem::take(&mut part.seen));
        part.pull -= dot(&part.seen, right);
    }
    parts
}

fn best(parts: &[Part], joint: usize) -> Option<Line> {
    let positions = || parts.iter().map(|part| part.position);
    let range =
        positions().fold(f64::NEG_INFINITY, f64::max) - positions().fold(f64::INFINITY, f64::min);
    let mut different: Vec<i64> = positions().map(|q| (q / SAME).round() as i64).collect();
    different.sort_unstable();
    different.dedup();
    if range <= SAME || different.len() < 20 {
        return None;
    }
    // Fewer different positions than two per cycle cannot tell a wave from a slower one.
    let most = CYCLES_MAX.min(TAU / range * different.len() as f64 / 2.0);
    let step = TAU / range / STEPS_PER_LINE;
    let least = CYCLES_MIN * TAU / range;
    let tried = ((most - least) / step).floor().max(0.0) as usize;
    let mut turns = Turns::new(parts, least, step);
    let all = (0..tried).map(|k| (least + step * k as f64, turns.next_gain(parts)));
    let (cycles, gain) = all.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(Line { joint, cycles, gain, tried })
}

/// Sine and cosine of every part at one period after the other, each turned on from the one before, and room for their sums.
struct Turns {
    now: Vec<(f64, f64)>,
    by: Vec<(f64, f64)>,
    sine: Vec<f64>,
    cosine: Vec<f64>,
}

impl Turns {
    fn new(parts: &[Part], first: f64, step: f64) -> Self {
        let width = parts.first().map_or(0, |part| part.seen.len());
        let at = |cycles: f64| parts.iter().map(|p| libm::sincos(cycles * p.position)).collect();
        let (sine, cosine) = (vec![0.0; width], vec![0.0; width]);
        Self { now: at(first), by: at(step), sine, cosine }
    }

    /// By how much sine and cosine together would lower the sum of squares; then on to the next period.
    fn next_gain(&mut self, parts: &[Part]) -> f64 {
        self.sine.fill(0.0);
        self.cosine.fill(0.0);
        let (mut ss, mut sc, mut cc, mut bs, mut bc) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for ((part, now), by) in parts.iter().zip(&mut self.now).zip(&self.by) {
            let (sin, cos) = *now;
            ss += sin * sin * part.own;
            sc += sin * cos * part.own;
            cc += cos * cos * part.own;
            bs += sin * part.pull;
            bc += cos * part.pull;
            let sums = self.sine.iter_mut().zip(&mut self.cosine);
            for ((sine, cosine), y) in sums.zip(&part.seen) {
                *sine += sin * y;
                *cosine += cos * y;
            }
            *now = (sin * by.1 + cos * by.0, cos * by.1 - sin * by.0);
        }
        let whole = ss.min(cc);
        ss -= dot(&self.sine, &self.sine);
        sc -= dot(&self.sine, &self.cosine);
        cc -= dot(&self.cosine, &self.cosine);
        let determinant = ss * cc - sc * sc;
        if determinant <= 1e-6 * whole * whole {
            return 0.0;
        }
        (cc * bs * bs - 2.0 * sc * bs * bc + ss * bc * bc) / determinant
    }
}
