//! The spectrum of one channel in one window, with its noise floor and the peaks of previous hops.
//!
//! Planned once; execution does not allocate.

use crate::floor::{Floor, median};
use crate::peak::{Agreement, Grid, Peak, Peaks, strongest};
use realfft::num_complex::Complex;
use std::ops::Range;

/// Ratio of the median power to the floor above which the change is broadband and not a line.
const BROADBAND: f64 = 2.0;
/// Factor on a floor that was learned in the other state (air or cut).
const OTHER_STATE_FACTOR: f64 = 2.0;

/// Spectrum, floor and previous peaks of one channel in one window.
pub(crate) struct ChannelSpectrum {
    pub(crate) floor: Floor,
    pub(crate) spectrum: Vec<Complex<f64>>,
    pub(crate) power: Vec<f64>,
    previous_peaks: Vec<Peaks>,
    hop: usize,
    gain: f64,
}

impl ChannelSpectrum {
    /// For `bins` bins and the peaks of `depth` hops.
    pub(crate) fn new(floor: Floor, bins: usize, depth: usize) -> Self {
        Self {
            floor,
            spectrum: vec![Complex::default(); bins],
            power: vec![0.0; bins],
            previous_peaks: vec![Peaks::default(); depth],
            hop: 0,
            gain: 1.0,
        }
    }

    /// Clears everything except learned floors.
    pub(crate) fn reset(&mut self) {
        self.previous_peaks.fill(Peaks::default());
        self.floor.discard_unfinished();
        self.power.fill(0.0);
    }

    /// Stores a spectrum and its power.
    pub(crate) fn store_spectrum(&mut self, shown: &[Complex<f64>]) {
        for ((to, power), from) in self.spectrum.iter_mut().zip(&mut self.power).zip(shown) {
            *to = *from;
            *power = from.norm_sqr();
        }
    }

    /// The newest peaks.
    pub(crate) fn newest(&self) -> &Peaks {
        &self.previous_peaks[self.hop]
    }

    /// Updates the floor with the present spectrum.
    pub(crate) fn update_floor(&mut self, frozen: &[Range<usize>]) {
        self.floor.update(&self.power, self.gain, frozen);
    }

    /// Power of the floor at a bin, with the broadband gain and the factor for the other state.
    pub(crate) fn effective_floor(&self, bin: usize, least_floor: f64) -> f64 {
        let trust = if self.floor.is_learned_in_state() { 1.0 } else { OTHER_STATE_FACTOR };
        (self.floor.level()[bin] * self.gain * trust).max(least_floor)
    }

    /// Updates the broadband gain: the ratio of the whole band to the floor, by the median of power
    /// over floor.
    pub(crate) fn update_gain(&mut self, cells: &mut [f64], stride: usize, least_floor: f64) {
        let level = self.floor.level();
        let mut count = 0;
        for bin in (0..self.power.len()).step_by(stride.max(1)) {
            cells[count] = self.power[bin] / level[bin].max(least_floor).max(1e-300);
            count += 1;
        }
        let loudness = median(&mut cells[..count]) / std::f64::consts::LN_2;
        self.gain = if loudness > BROADBAND { loudness } else { 1.0 };
    }

    /// The peaks over the floor.
    pub(crate) fn peaks(
        &self,
        grid: &Grid,
        searched: &Range<usize>,
        least_ratio: f64,
        least_floor: f64,
    ) -> Peaks {
        let floor = |bin| self.effective_floor(bin, least_floor);
        strongest(grid, &self.power, &self.spectrum, floor, searched.clone(), least_ratio)
    }

    /// Matches the peaks with those one and two windows earlier, and stores them.
    pub(crate) fn match_previous_peaks(
        &mut self,
        peaks: &mut Peaks,
        rule: &Agreement,
        window_s: f64,
        hops_per_window: usize,
    ) {
        let depth = self.previous_peaks.len();
        self.hop = (self.hop + 1) % depth;
        let ago = |hops: usize| (self.hop + depth - hops) % depth;
        let agreeing = |now: &Peak, hops: usize| {
            self.previous_peaks[ago(hops)]
                .iter()
                .take_while(|then| then.frequency_hz > 0.0)
                .find_map(|then| Some((*then, rule.matching_frequency_hz(now, then, window_s)?)))
        };
        for peak in peaks.iter_mut().take_while(|peak| peak.frequency_hz > 0.0) {
            let Some((then, refined_hz)) = agreeing(peak, hops_per_window) else { continue };
            let before = self.previous_peaks[ago(1)].iter().find(|before| {
                before.frequency_hz > 0.0
                    && (before.frequency_hz - peak.frequency_hz).abs() * window_s < 0.75
            });
            let third = agreeing(&then, 2 * hops_per_window)
                .is_some_and(|(oldest, _)| Agreement::is_steady_tone(peak, &then, &oldest));
            peak.pairs = before.map_or(0, |before| before.pairs) + 1;
            peak.triples = if third { before.map_or(0, |before| before.triples) + 1 } else { 0 };
            peak.frequency_hz = refined_hz;
        }
        self.previous_peaks[self.hop] = *peaks;
    }
}
