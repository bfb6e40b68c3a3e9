//! Process state from a recording: spindle speed from tacho pulses, path length and feed from
//! positions.

/// Trigger level of a pulse, relative to the height of the largest pulse over the median of the
/// signal: short pulses are sampled once or twice, at different heights.
const RISE_PART: f64 = 0.4;
/// Reset level of a pulse, likewise.
const FALL_PART: f64 = 0.2;
/// A pulse interval longer than this many revolutions is a standstill.
const STANDSTILL_TURNS: f64 = 3.5;
/// Averaging time of the speed, s: single revolutions are resolved in whole samples only.
const SPEED_S: f64 = 0.2;
/// Averaging time of the positions, s: without it, the noise of a tracker would lengthen the path.
const PATH_S: f64 = 0.1;

/// Spindle speed at each sample, rev/min, from one pulse per revolution of either polarity; missed
/// pulses are bridged. 0 before the third pulse, and after two revolutions without a pulse. Empty
/// without pulses.
#[must_use]
pub fn speed_from_pulses(tacho: &[f64], rate_hz: f64) -> Vec<f64> {
    let rises = rising_edges(tacho);
    if rises.len() < 3 {
        return Vec::new();
    }
    let turns: Vec<usize> = rises.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut speed = vec![0.0; tacho.len()];
    let mut first = 0;
    for last in 1..turns.len() {
        while first < last && rises[last + 1] - rises[first + 1] >= (SPEED_S * rate_hz) as usize {
            first += 1;
        }
        let median_turn = median(&turns[first..=last]);
        if turns[last] as f64 > STANDSTILL_TURNS * median_turn {
            first = last + 1;
            continue;
        }
        let window = turns.get(first..=last).unwrap_or_default();
        let count: f64 =
            window.iter().map(|turn| (*turn as f64 / median_turn).round().max(1.0)).sum();
        let rpm = 60.0 * rate_hz * count / window.iter().sum::<usize>().max(1) as f64;
        let rise = rises[last + 1];
        let until = (rise + (2.0 * median_turn) as usize).min(tacho.len());
        // Overwritten from the next pulse on.
        speed[rise..until].fill(rpm);
    }
    speed
}

/// The samples at which pulses begin.
fn rising_edges(tacho: &[f64]) -> Vec<usize> {
    let mut finite: Vec<f64> = tacho.iter().copied().filter(|x| x.is_finite()).collect();
    if finite.is_empty() {
        return Vec::new();
    }
    let half = finite.len() / 2;
    let base = *finite.select_nth_unstable_by(half, f64::total_cmp).1;
    let (up, down) = finite
        .iter()
        .fold((0.0, 0.0), |(up, down): (f64, f64), x| (up.max(x - base), down.max(base - x)));
    let height = if up >= down { up } else { -down };
    if height == 0.0 {
        return Vec::new();
    }
    let (mut is_high, mut rises) = (true, Vec::new());
    for (index, x) in tacho.iter().enumerate() {
        let part = (x - base) / height;
        if is_high && part < FALL_PART {
            is_high = false;
        } else if !is_high && part > RISE_PART {
            is_high = true;
            rises.push(index);
        }
    }
    rises
}

fn median(turns: &[usize]) -> f64 {
    let mut sorted = turns.to_vec();
    sorted.sort_unstable();
    sorted.get(sorted.len() / 2).map_or(1.0, |turn| *turn as f64)
}

/// Path length up to each sample, mm, from positions in mm.
///
/// Means over 0.1 s are joined by straight lines; missing positions (NaN) are bridged. Empty if
/// there are fewer than two such means.
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
    let position = |sample: usize| {
        while knot + 2 < knots.len() && knots[knot + 1].0 < sample as f64 {
            knot += 1;
        }
        let ((from, a), (to, b)) = (knots[knot], knots[knot + 1]);
        // Before the first mean and after the last, the feed is extrapolated.
        a + (b - a) * (sample as f64 - from) / (to - from)
    };
    (0..position_mm.len()).map(position).collect()
}

/// Feed at each sample, mm/s, from the path length.
#[must_use]
pub fn feed_along_path(path_mm: &[f64], rate_hz: f64) -> Vec<f64> {
    let reach = ((0.5 * PATH_S * rate_hz) as usize).max(1);
    let speed = |sample: usize| {
        let from = sample.saturating_sub(reach);
        let to = (sample + reach).min(path_mm.len().saturating_sub(1));
        let steps = (to - from).max(1) as f64;
        (path_mm[to] - path_mm[from]) * rate_hz / steps
    };
    (0..path_mm.len()).map(speed).collect()
}
