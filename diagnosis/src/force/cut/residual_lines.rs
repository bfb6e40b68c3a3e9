//! The strongest spectral line of the residual that is not a harmonic of the spindle speed.
//!
//! The residual while a tooth cuts (and, separately, at all times) is summed over all segments on a common time grid from the start of the segment: a
//! line of constant phase adds up, noise does not. A line is compared with the median of its neighbouring bins, since the noise is coloured.
//! Harmonics, aliased or not, are excluded. Frequencies in Hz.

use spectrum::folded_hz;
use spectrum::welch::{Detrend, Segments, Taper, welch};
use std::f64::consts::TAU;

use super::case::Case;
use super::cut_model::{CHATTER, PERMANENT_TONE, Slot};
use crate::engine::statistics::median;

/// Minimum and maximum number of points of the time grid.
const POINTS_LEAST: usize = 256;
const POINTS_MOST: usize = 1 << 20;
/// Bins whose median gives the noise level around a line.
const FLOOR_BINS: usize = 120;
/// Number of lines examined, strongest first.
const PEAKS_MOST: usize = 60;
/// Minimum ratio of a line's power to the noise level.
const PEAK_RATIO_LEAST: f64 = 8.0;
/// Steps of the refinement on each side of a line, and steps per resolution interval (inverse of the duration).
const STEPS: i32 = 12;
const STEPS_PER_RESOLUTION: f64 = 8.0;
/// Iterations of the golden-section search for a frequency.
const GOLDEN_SECTION_STEPS: usize = 24;
/// Largest harmonic of the spindle speed that is excluded.
const HARMONICS_MOST: u32 = 60;

/// Frequency of the strongest line, Hz.
pub(super) fn strongest_line(case: &Case, used: &[bool]) -> Option<f64> {
    let left = case.residual(&case.estimates);
    let spindle = &case.estimates.spindle;
    let rows = &case.model.rows;
    let longest = case.table.runs.iter().max_by_key(|run| run.len())?;
    let lasts_s = rows[longest.end - 1].time_s - rows[longest.start].time_s;
    let rate_hz = (longest.len() - 1) as f64 / lasts_s;
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        return None;
    }
    let engaged: Vec<bool> = rows
        .iter()
        .map(|state| case.model.tooth_forces(spindle, state, 0.0).engaged > 0.0)
        .collect();
    let mut best: Option<(f64, f64)> = None;
    for axis in case.table.joints() {
        let counts = &case.table.counts[axis];
        for cuts_only in [true, false] {
            let is_in = |row: usize| used[row] && counts[row] && (engaged[row] || !cuts_only);
            let kept: Vec<(f64, f64)> = (0..rows.len())
                .filter(|row| is_in(*row))
                .map(|row| (rows[row].time_s, left[axis][row]))
                .collect();
            let found = strongest_peak(&kept, rate_hz, |hz, width_hz| {
                is_spindle_harmonic(case, hz, rate_hz, width_hz)
            });
            if let Some((hz, ratio)) = found.filter(|f| best.is_none_or(|(_, most)| f.1 > most)) {
                best = Some((hz, ratio));
            }
        }
    }
    best.map(|(hz, _)| hz)
}

/// The strongest line of samples (time, value) that is not excluded: frequency in Hz, and power relative to the noise level.
fn strongest_peak(
    kept: &[(f64, f64)],
    rate_hz: f64,
    is_forced: impl Fn(f64, f64) -> bool,
) -> Option<(f64, f64)> {
    let span_s = kept.iter().map(|(time_s, _)| *time_s).fold(0.0, f64::max);
    let points = ((2.0 * span_s * rate_hz) as usize).next_power_of_two();
    let points = points.clamp(POINTS_LEAST, POINTS_MOST);
    let mean = kept.iter().map(|(_, x)| x).sum::<f64>() / kept.len().max(1) as f64;
    let mut grid = vec![0.0; points];
    let about: Vec<(f64, f64)> = kept.iter().map(|(time_s, x)| (*time_s, x - mean)).collect();
    let kept = &about[..];
    for (time_s, x) in kept {
        if let Some(point) = grid.get_mut((time_s * rate_hz).round() as usize) {
            *point += x;
        }
    }
    let plan = Segments {
        overlap: 0,
        detrend: Detrend::None,
        taper: Taper::Boxcar,
        ..Segments::new(rate_hz, points)
    };
    let spectrum = welch(&grid, &plan).ok()?;
    let power = &spectrum.power;
    let middle = |some: &[f64]| median(some.iter().copied()).max(f64::MIN_POSITIVE);
    let floors: Vec<f64> = power.chunks(FLOOR_BINS).map(middle).collect();
    let is_peak = |bin: &usize| power[*bin] >= power[*bin - 1] && power[*bin] >= power[*bin + 1];
    let peaks = (2..power.len().saturating_sub(2)).filter(is_peak);
    let mut peaks: Vec<(usize, f64)> =
        peaks.map(|bin| (bin, power[bin] / floors[bin / FLOOR_BINS])).collect();
    peaks.retain(|(_, ratio)| *ratio > PEAK_RATIO_LEAST);
    peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
    let width_hz = 1.5 / span_s;
    let mut free = peaks.into_iter().take(PEAKS_MOST).map(|(bin, r)| (spectrum.frequency[bin], r));
    let (middle, ratio) = free.find(|(hz, _)| !is_forced(*hz, width_hz))?;
    let fine = (-STEPS..=STEPS).map(|k| middle + f64::from(k) / (STEPS_PER_RESOLUTION * span_s));
    let best = fine.map(|hz| (hz, power_at(kept, hz))).max_by(|a, b| a.1.total_cmp(&b.1));
    best.map(|(hz, _)| (refine_frequency(kept, hz, 1.0 / (STEPS_PER_RESOLUTION * span_s)), ratio))
}

/// Power of samples at a frequency, up to a constant factor.
fn power_at(kept: &[(f64, f64)], hz: f64) -> f64 {
    let sums = kept.iter().fold([0.0; 2], |[c, s], (time_s, x)| {
        let (sin, cos) = libm::sincos(TAU * hz * time_s);
        [c + x * cos, s + x * sin]
    });
    sums[0] * sums[0] + sums[1] * sums[1]
}

/// Frequency of largest power within `reach_hz` of another, Hz (golden section).
fn refine_frequency(kept: &[(f64, f64)], hz: f64, reach_hz: f64) -> f64 {
    let golden = 0.5 * (libm::sqrt(5.0) - 1.0);
    let (mut low, mut high) = (hz - reach_hz, hz + reach_hz);
    let inner = |low: f64, high: f64| [high - golden * (high - low), low + golden * (high - low)];
    let [mut a, mut b] = inner(low, high);
    let (mut at_a, mut at_b) = (power_at(kept, a), power_at(kept, b));
    for _ in 0..GOLDEN_SECTION_STEPS {
        if at_a > at_b {
            (high, b, at_b) = (b, a, at_a);
            a = inner(low, high)[0];
            at_a = power_at(kept, a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = inner(low, high)[1];
            at_b = power_at(kept, b);
        }
    }
    0.5 * (low + high)
}

/// Frequency of a selected line, refined on the residual of all other selected effects, Hz.
pub(super) fn refined_frequency(case: &Case, used: &[bool]) -> f64 {
    let mut still = case.estimates.clone();
    let amplitude_squared = |axis: usize| {
        let amplitudes =
            |slot: Slot| slot.of(&case.estimates.parameters)[2 * axis..2 * axis + 2].iter();
        amplitudes(CHATTER).chain(amplitudes(PERMANENT_TONE)).map(|x| x * x).sum::<f64>()
    };
    let axis =
        case.table.joints().max_by(|a, b| amplitude_squared(*a).total_cmp(&amplitude_squared(*b)));
    let Some(axis) = axis else { return case.model.tone_hz };
    let is_hum = squared_norm(&case.estimates.parameters, PERMANENT_TONE) > 0.0;
    for slot in [CHATTER, PERMANENT_TONE] {
        still.parameters[slot.from..slot.from + slot.count].fill(0.0);
    }
    let left = case.residual(&still);
    let rows = &case.model.rows;
    let engaged = |row: usize| {
        case.model.tooth_forces(&case.estimates.spindle, &rows[row], 0.0).engaged > 0.0
    };
    let counts = |row: usize| used[row] && case.table.counts[axis][row];
    let kept: Vec<(f64, f64)> = (0..rows.len())
        .filter(|row| counts(*row) && (is_hum || engaged(*row)))
        .map(|row| (rows[row].time_s, left[axis][row]))
        .collect();
    let span_s = kept.iter().map(|(time_s, _)| *time_s).fold(0.0, f64::max);
    if span_s > 0.0 {
        refine_frequency(&kept, case.model.tone_hz, 1.0 / (STEPS_PER_RESOLUTION * span_s))
    } else {
        case.model.tone_hz
    }
}

fn squared_norm(numbers: &[f64], slot: Slot) -> f64 {
    slot.of(numbers).iter().map(|x| x * x).sum()
}

/// Whether a frequency is a harmonic of the spindle, aliasing included, at all of its speeds: a forced line moves with the speed.
fn is_spindle_harmonic(case: &Case, hz: f64, rate_hz: f64, width_hz: f64) -> bool {
    let rows = &case.model.rows;
    let speeds = case.table.runs.iter().filter_map(|run| {
        let (first, last) = (&rows[run.start], &rows[run.end - 1]);
        let turned =
            (last.angle_rad - first.angle_rad) * (1.0 + case.estimates.spindle.excess_speed);
        let speed = turned / (TAU * (last.time_s - first.time_s));
        (speed.is_finite() && speed > 0.0).then_some(speed)
    });
    let speeds: Vec<f64> = speeds.collect();
    speeds.iter().all(|speed| {
        (1..=HARMONICS_MOST)
            .any(|k| (folded_hz(f64::from(k) * speed, rate_hz) - hz).abs() < width_hz)
    })
}
