//! What the process did, from what was recorded of it: speed from a tacho's pulses, path from positions.

/// A tacho's signal counts as high above this part of its range, and as low below one minus it.
const HIGH: f64 = 0.65;
/// Positions are averaged over this time before their distances are added: a tracker's noise would lengthen the path.
const PATH_S: f64 = 0.1;

/// Spindle speed at each sample, rev/min, from one pulse per revolution; 0 before the second pulse, and where no pulse
/// has come for twice the time between the last two. Empty where the signal holds no pulses.
#[must_use]
pub fn speed_of_pulses(tacho: &[f64], rate_hz: f64) -> Vec<f64> {
    let finite = || tacho.iter().copied().filter(|x| x.is_finite());
    let (low, high) =
        (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
    if !(high > low) {
        return Vec::new();
    }
    let level = |part: f64| low + part * (high - low);
    let (mut is_high, mut rises) = (true, Vec::new());
    for (at, x) in tacho.iter().enumerate() {
        if is_high && *x < level(1.0 - HIGH) {
            is_high = false;
        } else if !is_high && *x > level(HIGH) {
            is_high = true;
            rises.push(at);
        }
    }
    if rises.len() < 3 {
        return Vec::new();
    }
    let mut speed = vec![0.0; tacho.len()];
    for pair in rises.windows(2) {
        let turn = pair[1] - pair[0];
        let until = (pair[1] + 2 * turn).min(tacho.len());
        // What the next pair says replaces it from its own second pulse on.
        speed[pair[1]..until].fill(60.0 * rate_hz / turn as f64);
    }
    speed
}

/// Length of the path up to each sample, mm, from positions in mm.
///
/// Means over 0.1 s are joined by straight lines; positions that were not taken (NaN) are bridged. Empty where fewer than
/// two such means exist.
#[must_use]
pub fn path_mm(position_mm: &[[f64; 3]], rate_hz: f64) -> Vec<f64> {
    let per_mean = ((PATH_S * rate_hz).round() as usize).max(1);
    let mut means: Vec<(f64, [f64; 3])> = Vec::new();
    for (number, part) in position_mm.chunks(per_mean).enumerate() {
        let taken: Vec<&[f64; 3]> =
            part.iter().filter(|p| p.iter().all(|x| x.is_finite())).collect();
        if taken.is_empty() {
            continue;
        }
        let mean = |axis: usize| taken.iter().map(|p| p[axis]).sum::<f64>() / taken.len() as f64;
        let middle = (number * per_mean) as f64 + 0.5 * (part.len() as f64 - 1.0);
        means.push((middle, [mean(0), mean(1), mean(2)]));
    }
    if means.len() < 2 {
        return Vec::new();
    }
    let mut length = 0.0;
    let mut knots = vec![(means[0].0, 0.0)];
    for pair in means.windows(2) {
        let squares = (0..3).map(|axis| (pair[1].1[axis] - pair[0].1[axis]).powi(2));
        length += squares.sum::<f64>().sqrt();
        knots.push((pair[1].0, length));
    }
    let mut knot = 0;
    let at = |sample: usize| {
        while knot + 2 < knots.len() && knots[knot + 1].0 < sample as f64 {
            knot += 1;
        }
        let ((from, a), (to, b)) = (knots[knot], knots[knot + 1]);
        // Before the first mean and after the last, the feed goes on.
        a + (b - a) * (sample as f64 - from) / (to - from)
    };
    (0..position_mm.len()).map(at).collect()
}

/// Feed at each sample, mm/s, from the path's length.
#[must_use]
pub fn speed_on(path_mm: &[f64], rate_hz: f64) -> Vec<f64> {
    let reach = ((0.5 * PATH_S * rate_hz) as usize).max(1);
    let at = |sample: usize| {
        let from = sample.saturating_sub(reach);
        let to = (sample + reach).min(path_mm.len().saturating_sub(1));
        let steps = (to - from).max(1) as f64;
        (path_mm[to] - path_mm[from]) * rate_hz / steps
    };
    (0..path_mm.len()).map(at).collect()
}
