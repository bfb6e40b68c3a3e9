//! Peaks of a spectrum, and the test whether two disjoint windows contain the same tone.
//!
//! A step, a shock or a burst of noise can cause a peak like a tone; but in the next window, which
//! shares no sample with it, frequency, power or phase differ. Source: own simulation, research
//! note on vibration monitoring, section 2.5; the phase test is an own development.

use crate::window::hann_response;
use realfft::num_complex::Complex;
use std::f64::consts::{PI, TAU};

/// Number of peaks kept per spectrum.
pub(crate) const PEAKS: usize = 5;

/// One peak of one spectrum.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Peak {
    /// Interpolated frequency, Hz; 0: no peak.
    pub(crate) frequency_hz: f64,
    /// Squared amplitude of a tone at that frequency.
    pub(crate) power: f64,
    /// Power over floor.
    pub(crate) ratio: f64,
    /// Phase at the centre of the window, rad.
    pub(crate) phase_rad: f64,
    /// Number of consecutive hops for which two disjoint windows agreed.
    pub(crate) pairs: u16,
    /// Number of consecutive hops for which three disjoint windows agreed.
    pub(crate) triples: u16,
}

/// The peaks of one spectrum, strongest first.
pub(crate) type Peaks = [Peak; PEAKS];

/// Frequency grid of a spectrum: bins and resolution cells.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    /// Width of a bin, Hz.
    pub(crate) bin_hz: f64,
    /// Bins per cell (zero padding); a cell is the reciprocal of the window length.
    pub(crate) bins_per_cell: f64,
    /// The spectrum's first bin.
    pub(crate) first: usize,
}

impl Grid {
    /// Width of a cell, Hz.
    pub(crate) fn cell_hz(&self) -> f64 {
        self.bin_hz * self.bins_per_cell
    }

    /// Index of the bin nearest to a frequency, `None` beyond `bins`.
    pub(crate) fn place(&self, frequency_hz: f64, bins: usize) -> Option<usize> {
        let bin = (frequency_hz / self.bin_hz).round() - self.first as f64;
        (bin >= 0.0 && bin < bins as f64).then_some(bin as usize)
    }

    /// Frequency, power and phase at the local maximum `at`, interpolated by a parabola through the
    /// logarithms.
    pub(crate) fn measure(&self, power: &[f64], spectrum: &[Complex<f64>], index: usize) -> Peak {
        let log = |i: usize| power[i].max(1e-300).ln();
        let offset = if index == 0 || index + 1 >= power.len() {
            0.0
        } else {
            let (left, mid, right) = (log(index - 1), log(index), log(index + 1));
            let bend = left - 2.0 * mid + right;
            if bend < 0.0 { (0.5 * (left - right) / bend).clamp(-0.5, 0.5) } else { 0.0 }
        };
        let bin = (self.first + index) as f64;
        let kept = hann_response(offset / self.bins_per_cell);
        // Phase at the centre of the window; that of the transform refers to its start.
        let turns = 0.5 * bin / self.bins_per_cell;
        Peak {
            frequency_hz: (bin + offset) * self.bin_hz,
            power: power[index] / (kept * kept),
            phase_rad: wrapped(spectrum[index].arg() + TAU * (turns - turns.floor())),
            ..Peak::default()
        }
    }
}

/// An angle wrapped to −π … π.
pub(crate) fn wrapped(angle_rad: f64) -> f64 {
    angle_rad - TAU * (angle_rad / TAU).round()
}

/// Finds the strongest peaks in the range `within` whose power over floor is at least
/// `least_ratio`.
pub(crate) fn strongest(
    grid: &Grid,
    power: &[f64],
    spectrum: &[Complex<f64>],
    floor: impl Fn(usize) -> f64,
    within: std::ops::Range<usize>,
    least_ratio: f64,
) -> Peaks {
    let mut found: Peaks = Default::default();
    let last = within.end.min(power.len().saturating_sub(1));
    for index in within.start.max(1)..last {
        let p = power[index];
        if p < power[index - 1] || p <= power[index + 1] || p < 0.7 * least_ratio * floor(index) {
            continue;
        }
        let mut peak = grid.measure(power, spectrum, index);
        peak.ratio = peak.power / floor(index).max(1e-300);
        if peak.ratio >= least_ratio {
            insert(&mut found, peak);
        }
    }
    drop_leakage(&mut found, grid.cell_hz());
    found
}

/// Drops peaks that may be leakage of a stronger line: the leakage amplitude of a tone that begins
/// inside the window is inversely proportional to the distance, with a tenth of its power at one
/// cell.
fn drop_leakage(found: &mut Peaks, cell_hz: f64) {
    let all = *found;
    let spilt = |peak: &Peak, by: &Peak| {
        let cells = ((peak.frequency_hz - by.frequency_hz) / cell_hz).abs();
        by.power > peak.power && peak.power * cells * cells < 0.1 * by.power
    };
    let mut kept = 0;
    for peak in &all {
        if peak.frequency_hz > 0.0 && !all.iter().any(|by| spilt(peak, by)) {
            found[kept] = *peak;
            kept += 1;
        }
    }
    found[kept..].fill(Peak::default());
}

fn insert(found: &mut Peaks, mut peak: Peak) {
    for place in found.iter_mut() {
        if peak.ratio > place.ratio {
            std::mem::swap(place, &mut peak);
        }
    }
}

/// The limits of the agreement between two disjoint windows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Agreement {
    /// Least power over floor of the sum of both windows in phase.
    pub(crate) ratio: f64,
    /// Largest frequency difference, cells.
    pub(crate) cells: f64,
    /// Largest ratio of the newer window's power to the older's.
    pub(crate) growth: f64,
}

impl Agreement {
    /// Whether three disjoint windows contain one steady tone: its power has not decreased (as in a
    /// ring-down), and its phase advances uniformly (unlike that of a swept line).
    pub(crate) fn is_steady_tone(now: &Peak, then: &Peak, oldest: &Peak) -> bool {
        let stray = (2.0 / now.ratio.min(then.ratio).min(oldest.ratio)).sqrt();
        let bend = wrapped(now.phase_rad - 2.0 * then.phase_rad + oldest.phase_rad);
        now.power >= 0.85 * (1.0 - 2.0 * stray).max(0.6) * oldest.power.max(then.power)
            && bend.abs() <= (0.4 + 2.0 * stray).min(0.5 * PI)
    }

    /// Tests whether the peak `then`, one window (of `window_s`) before `now`, belongs to the same
    /// tone. Returns the frequency refined by the phase difference, `None` if the windows do not
    /// agree.
    pub(crate) fn matching_frequency_hz(
        &self,
        now: &Peak,
        then: &Peak,
        window_s: f64,
    ) -> Option<f64> {
        let distance_cells = (now.frequency_hz - then.frequency_hz).abs() * window_s;
        let weaker = now.ratio.min(then.ratio);
        // Standard deviation of a steady tone's relative power and of its phase for noise of
        // relative power 1/ratio.
        let stray = (2.0 / weaker).sqrt();
        let grown = now.power / then.power.max(1e-300);
        let steady = grown >= 0.75 * (1.0 - 2.0 * stray).max(0.3) && grown <= self.growth;
        // Sum of both in phase: noise that is strong in one window only passes less often than with
        // the sum of the powers.
        let together = 0.5 * (now.ratio.sqrt() + then.ratio.sqrt()).powi(2);
        if distance_cells > self.cells || !steady || together < self.ratio {
            return None;
        }
        let middle_hz = 0.5 * (now.frequency_hz + then.frequency_hz);
        let turn = wrapped(now.phase_rad - then.phase_rad - TAU * (middle_hz * window_s).fract());
        let coherent = turn.abs() <= (0.5 + 2.0 * stray).min(0.5 * PI);
        coherent.then(|| middle_hz + turn / (TAU * window_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transform::Transform;
    use proptest::prelude::*;
    use realfft::RealFftPlanner;

    const RATE_HZ: f64 = 1250.0;

    fn peak_of(n: usize, pad: usize, x: impl Fn(f64) -> f64, from: usize) -> Peak {
        let mut transform = Transform::new(&mut RealFftPlanner::new(), n, pad, true);
        let samples: Vec<f64> = (from..from + n).map(|i| x(i as f64 / RATE_HZ)).collect();
        let padded = transform.padded();
        let spectrum = transform.run(&samples).to_vec();
        let power: Vec<f64> = spectrum.iter().map(Complex::norm_sqr).collect();
        let grid = Grid {
            bin_hz: RATE_HZ / padded as f64,
            bins_per_cell: padded as f64 / n as f64,
            first: 0,
        };
        strongest(&grid, &power, &spectrum, |_| 1e-6, 2..power.len() - 2, 8.0)[0]
    }

    proptest! {
        #[test]
        fn frequency_and_amplitude_are_found_between_the_bins(f in 40.0..150.0_f64, phase in 0.0..6.0_f64) {
            let tone = |t: f64| 2.0 * (TAU * f * t + phase).cos();
            let padded = peak_of(160, 4, tone, 0);
            prop_assert!((padded.frequency_hz - f).abs() < 0.05, "{} for {f}", padded.frequency_hz);
            prop_assert!((padded.power.sqrt() - 2.0).abs() < 0.02);
            let plain = peak_of(256, 1, tone, 0);
            prop_assert!((plain.frequency_hz - f).abs() < 0.15, "{} for {f}", plain.frequency_hz);
            let middle = wrapped(TAU * f * 80.0 / RATE_HZ + phase);
            prop_assert!(wrapped(padded.phase_rad - middle).abs() < 0.05);
        }

        #[test]
        fn two_windows_of_one_tone_agree_and_sharpen_it(f in 50.0..150.0_f64, phase in 0.0..6.0_f64) {
            let tone = |t: f64| (TAU * f * t + phase).cos();
            let rule = Agreement { ratio: 16.0, cells: 0.75, growth: 30.0 };
            let refined = rule.matching_frequency_hz(&peak_of(80, 4, tone, 80), &peak_of(80, 4, tone, 0), 0.064);
            prop_assert!((refined.unwrap_or(0.0) - f).abs() < 0.02, "{refined:?} for {f}");
        }
    }

    #[test]
    fn a_ring_down_does_not_agree() {
        let decaying = |t: f64| (-t / 0.05).exp() * (TAU * 70.0 * t).cos();
        let rule = Agreement { ratio: 16.0, cells: 0.75, growth: 30.0 };
        let (now, then) = (peak_of(80, 4, decaying, 80), peak_of(80, 4, decaying, 0));
        assert!(rule.matching_frequency_hz(&now, &then, 0.064).is_none());
    }
}
