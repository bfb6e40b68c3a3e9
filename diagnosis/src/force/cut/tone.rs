//! The tone that carries most of what is left and is no multiple of the spindle's speed.
//!
//! Promises: a multiple of the spindle's speed, folded or not, is none. Never: a name; whether it stands in the cut alone is asked like any other question.

use spectrum::folded_hz;
use spectrum::offline::Averaged;
use spectrum::welch::Segments;
use std::f64::consts::TAU;

use super::case::Case;

/// Length of a segment of the first look, s, and its fewest rows.
const SEGMENT_S: f64 = 0.5;
const ROWS_LEAST: usize = 64;
/// Tones that are looked at more closely.
const CLOSER: usize = 4;
/// Steps per bin of a whole run.
const STEPS: f64 = 4.0;
/// Steps at most.
const STEPS_MOST: f64 = 800.0;
/// Multiples of the spindle's speed that are forced.
const MULTIPLES: u32 = 60;

/// Its frequency, Hz.
pub(super) fn loudest(case: &Case, used: &[bool]) -> Option<f64> {
    let left = case.left(&case.belief);
    let table = &case.table;
    let longest = table.runs.iter().max_by_key(|run| run.len())?;
    let time = |row: usize| case.law.rows[row].time_s;
    let lasts_s = time(longest.end - 1) - time(longest.start);
    let rate_hz = (longest.len() - 1) as f64 / lasts_s;
    let length = ((SEGMENT_S * rate_hz) as usize).min(longest.len());
    if length < ROWS_LEAST || !rate_hz.is_finite() {
        return None;
    }
    let plan = Segments::new(rate_hz, length);
    let bin_hz = rate_hz / length as f64;
    let span_s = case.law.rows.iter().map(|stood| stood.time_s).fold(0.0, f64::max);
    let mut best: Option<(f64, f64)> = None;
    for axis in table.joints() {
        let size = table.noise[axis].1;
        let values = &left[axis];
        let runs: Vec<&[f64]> = table.runs.iter().map(|run| &values[run.clone()]).collect();
        let Ok(heard) = Averaged::of(runs, &plan) else { continue };
        let rows: Vec<usize> =
            (0..values.len()).filter(|row| used[*row] && table.counts[axis][*row]).collect();
        for line in heard.lines().into_iter().take(CLOSER) {
            let step = (1.0 / (STEPS * span_s)).max(2.0 * bin_hz / STEPS_MOST);
            let steps = (bin_hz / step) as i32;
            let near = (-steps..=steps).map(|k| line.frequency + f64::from(k) * step);
            let power = |hz: f64| {
                let (mut c, mut s) = (0.0, 0.0);
                for row in &rows {
                    let (sin, cos) = libm::sincos(TAU * hz * time(*row));
                    c += values[*row] * cos;
                    s += values[*row] * sin;
                }
                (c * c + s * s) / (size * size * rows.len().max(1) as f64)
            };
            let found = near.map(|hz| (hz, power(hz))).max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((hz, power)) = found else { continue };
            if !is_forced(case, hz, rate_hz, 1.5 / span_s)
                && best.is_none_or(|(_, most)| power > most)
            {
                best = Some((hz, power));
            }
        }
    }
    best.map(|(hz, _)| hz)
}

/// Whether a frequency is a multiple of the spindle's, as sampled, at each of its speeds: a line that is forced moves with the speed.
fn is_forced(case: &Case, hz: f64, rate_hz: f64, width_hz: f64) -> bool {
    let rows = &case.law.rows;
    let speeds = case.table.runs.iter().filter_map(|run| {
        let (first, last) = (&rows[run.start], &rows[run.end - 1]);
        let turned = (last.angle_rad - first.angle_rad) * (1.0 + case.belief.spindle.faster);
        let speed = turned / (TAU * (last.time_s - first.time_s));
        (speed.is_finite() && speed > 0.0).then_some(speed)
    });
    let speeds: Vec<f64> = speeds.collect();
    speeds.iter().all(|speed| {
        (1..=MULTIPLES).any(|k| (folded_hz(f64::from(k) * speed, rate_hz) - hz).abs() < width_hz)
    })
}
