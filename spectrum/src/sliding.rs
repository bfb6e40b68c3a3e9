//! A sliding window over all channels of one sampling rate.
//!
//! Per channel it stores the noise floor and the peaks of previous hops; it reports peaks on which
//! two or three disjoint windows agree. Planned once; execution does not allocate.

use crate::channel_spectrum::ChannelSpectrum;
use crate::cut_detection::CutState;
use crate::floor::Floor;
use crate::history::History;
use crate::peak::{Agreement, Grid, Peak};
use crate::track::TRACKS;
use crate::transform::Transform;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use std::ops::Range;

/// Properties of a window.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WindowPlan {
    /// Samples per window: a multiple of `hop`.
    pub(crate) samples: usize,
    /// Samples between two transforms.
    pub(crate) hop: usize,
    /// Zero-padding factor.
    pub(crate) pad: usize,
    /// Whether a linear trend is subtracted from the samples first.
    pub(crate) detrend: bool,
    /// Band in which lines are searched, Hz.
    pub(crate) band_hz: [f64; 2],
    /// Least power over floor of a peak.
    pub(crate) least_ratio: f64,
    /// Least power over floor of the sum of two disjoint windows in phase.
    pub(crate) ratio: f64,
    /// Number of consecutive hops that must agree.
    pub(crate) hops_to_agree: u16,
}

/// A tone that disjoint windows agree on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Detection {
    pub(crate) channel: usize,
    pub(crate) frequency_hz: f64,
    pub(crate) power: f64,
    pub(crate) ratio: f64,
    pub(crate) cell_hz: f64,
    /// Whether three disjoint windows agree, not only two.
    pub(crate) three_windows_agree: bool,
    /// Mean power at this frequency while the noise floor was learned, over the peak's power.
    pub(crate) learned_share: f64,
    /// Whether it was detected in the signal without spindle harmonics.
    pub(crate) is_asynchronous: bool,
}

impl Detection {
    /// Whether all agreeing windows began after the last change of the spindle speed: earlier
    /// windows are not reliable, because harmonics and the front-end filter change with the speed.
    pub(crate) fn is_after_change(&self, settled_s: f64) -> bool {
        let windows = if self.three_windows_agree { 3.0 } else { 2.0 };
        settled_s > windows / self.cell_hz + CHANGE_MARGIN_S
    }
}

/// A sliding window over all channels.
pub(crate) struct SlidingWindow {
    plan: WindowPlan,
    transform: Transform,
    grid: Grid,
    window_s: f64,
    searched: Range<usize>,
    channel_spectra: Vec<ChannelSpectrum>,
    cells: Vec<f64>,
    agreement: Agreement,
    least_power: [f64; 2],
}

/// Allowance for the delay of the reported speed and of the front end, s.
const CHANGE_MARGIN_S: f64 = 0.05;
/// Least number of consecutive windows, after the first, from which a floor is learned: 0.9 s for
/// the 128 ms of the low branch. With five, a real stable cut (turning, 10 kHz) raised an alarm
/// because the air time was too short.
const LEARNING_WINDOWS_MIN: f64 = 6.0;
/// Least number of cells for the detection of a broadband change.
const BROADBAND_CELLS: f64 = 32.0;
/// Lower limit of the floor, relative to the squared smallest amplitude.
const FLOOR_MIN: f64 = 0.01;

impl SlidingWindow {
    /// Plans a window at `rate_hz` for `channels`; `least_power` is the squared least amplitude of
    /// forces and of moments; the floor is learned over `learn_s`.
    pub(crate) fn new(
        planner: &mut RealFftPlanner<f64>,
        plan: WindowPlan,
        rate_hz: f64,
        channels: usize,
        least_power: [f64; 2],
        learn_s: f64,
    ) -> Self {
        let transform = Transform::new(planner, plan.samples, plan.pad, plan.detrend);
        let padded = transform.padded();
        let bins_per_cell = padded as f64 / plan.samples as f64;
        let bin_hz = rate_hz / padded as f64;
        let bin = |hz: f64| (hz / bin_hz).round() as usize;
        let reach = (2.0 * bins_per_cell).ceil() as usize;
        // Enough cells to distinguish a broadband change from a line.
        let first = bin(plan.band_hz[0]).saturating_sub(reach).max(bins_per_cell as usize);
        let broad = first + (BROADBAND_CELLS * bins_per_cell) as usize;
        let end = (bin(plan.band_hz[1]) + reach).max(broad).min(9 * padded / 20);
        let bins = end.saturating_sub(first).max(1);
        let searched = bin(plan.band_hz[0]).saturating_sub(first)
            ..(bin(plan.band_hz[1]) + 1).saturating_sub(first).min(bins);
        let hop_s = plan.hop as f64 / rate_hz;
        let window_s = plan.samples as f64 / rate_hz;
        let warm_frames =
            ((learn_s - window_s).max(LEARNING_WINDOWS_MIN * window_s) / hop_s) as u32;
        let view = || {
            let floor = Floor::new(bins, warm_frames, 4.0 / hop_s, reach);
            ChannelSpectrum::new(floor, bins, 2 * plan.samples / plan.hop + 1)
        };
        Self {
            grid: Grid { bin_hz, bins_per_cell, first },
            window_s,
            searched,
            channel_spectra: (0..channels).map(|_| view()).collect(),
            cells: vec![0.0; bins],
            agreement: Agreement { ratio: plan.ratio, cells: 0.75, growth: 30.0 },
            least_power,
            plan,
            transform,
        }
    }

    /// Samples between two transforms.
    pub(crate) fn hop_samples(&self) -> usize {
        self.plan.hop
    }

    /// Whether the floors are learned, so that lines can be distinguished from noise.
    pub(crate) fn is_ready(&self) -> bool {
        self.channel_spectra.iter().all(|view| view.floor.is_known())
    }

    /// Changes the surroundings of all floors.
    pub(crate) fn set_cut_state(&mut self, surroundings: CutState) {
        for view in &mut self.channel_spectra {
            view.floor.set_cut_state(surroundings);
        }
    }

    /// Clears everything except learned floors.
    pub(crate) fn reset(&mut self) {
        for view in &mut self.channel_spectra {
            view.reset();
        }
    }

    /// Clears the learned floor of a channel.
    pub(crate) fn clear_floor(&mut self, channel: usize) {
        if let Some(view) = self.channel_spectra.get_mut(channel) {
            view.reset();
            view.floor.clear();
        }
    }

    /// Transforms the newest window of every channel and passes every peak on which the windows
    /// agree to `sighted`. `lines_hz` are the live lines, whose bins do not update the floors.
    pub(crate) fn hop(
        &mut self,
        histories: &[History],
        lines_hz: &[f64],
        mut sighted: impl FnMut(Detection),
    ) {
        let (frozen, live) = self.frozen_bins(lines_hz);
        for (channel, history) in histories.iter().enumerate() {
            if let Some(samples) = history.newest(self.plan.samples) {
                self.transform_channel(channel, samples, &frozen[..live]);
            }
        }
        for (channel, view) in self.channel_spectra.iter().enumerate() {
            for peak in view.newest().iter().filter(|p| p.power >= self.least_power(channel)) {
                if self.windows_agree(channel, peak, |p| p.pairs) {
                    sighted(Detection {
                        channel,
                        frequency_hz: peak.frequency_hz,
                        power: peak.power,
                        ratio: peak.ratio,
                        cell_hz: self.grid.cell_hz(),
                        three_windows_agree: self.windows_agree(channel, peak, |p| p.triples),
                        learned_share: self.learned_share(view, peak),
                        is_asynchronous: false,
                    });
                }
            }
        }
    }

    fn transform_channel(&mut self, channel: usize, samples: &[f64], frozen: &[Range<usize>]) {
        let least_floor = FLOOR_MIN * self.least_power(channel);
        let Some(view) = self.channel_spectra.get_mut(channel) else { return };
        view.store_spectrum(self.transform.run(samples).get(self.grid.first..).unwrap_or(&[]));
        if view.floor.is_known() {
            let stride = self.grid.bins_per_cell as usize;
            view.update_gain(&mut self.cells, stride, least_floor);
            let mut peaks =
                view.peaks(&self.grid, &self.searched, self.plan.least_ratio, least_floor);
            view.match_previous_peaks(
                &mut peaks,
                &self.agreement,
                self.window_s,
                self.plan.samples / self.plan.hop,
            );
        }
        view.update_floor(frozen);
    }

    /// Whether a peak has agreed for enough hops, also on the channel where it is strongest: on a
    /// noisy channel a decaying line may appear steady.
    fn windows_agree(&self, channel: usize, peak: &Peak, hops: impl Fn(&Peak) -> u16) -> bool {
        let long = |p: &Peak| hops(p) >= self.plan.hops_to_agree;
        let is_same_frequency = |p: &&Peak| {
            (p.frequency_hz - peak.frequency_hz).abs() * self.window_s < 0.75
                && p.power > 1.5 * peak.power
                && p.ratio > 1.5 * peak.ratio
        };
        let others = self.channel_spectra.iter().enumerate();
        let others_of_kind =
            others.filter(|(other, _)| *other != channel && (*other < 3) == (channel < 3));
        long(peak)
            && others_of_kind
                .flat_map(|(_, view)| view.newest())
                .filter(is_same_frequency)
                .all(long)
    }

    /// The share of a peak's power that was present while the noise floor was learned.
    fn learned_share(&self, view: &ChannelSpectrum, peak: &Peak) -> f64 {
        let bin = self.grid.place(peak.frequency_hz, view.power.len());
        bin.map_or(0.0, |bin| view.floor.learned_mean_near(bin)) / peak.power.max(1e-300)
    }

    fn least_power(&self, channel: usize) -> f64 {
        self.least_power[usize::from(channel >= 3)]
    }

    /// The ranges of bins of the live lines, and their number.
    fn frozen_bins(&self, lines_hz: &[f64]) -> ([Range<usize>; TRACKS], usize) {
        let mut frozen: [Range<usize>; TRACKS] = std::array::from_fn(|_| 0..0);
        let reach = 2.0 * self.grid.bins_per_cell;
        for (run, line_hz) in frozen.iter_mut().zip(lines_hz) {
            let bin = line_hz / self.grid.bin_hz - self.grid.first as f64;
            *run = (bin - reach).max(0.0) as usize..(bin + reach + 1.0).max(0.0) as usize;
        }
        (frozen, lines_hz.len().min(TRACKS))
    }

    /// Strongest value within one cell of a frequency: power, and power over floor; zeros if the
    /// floor is unknown.
    pub(crate) fn strength(&self, channel: usize, frequency_hz: f64) -> (f64, f64) {
        let Some(view) = self.channel_spectra.get(channel).filter(|view| view.floor.is_known())
        else {
            return (0.0, 0.0);
        };
        let bins = view.power.len();
        let Some(place) = self.grid.place(frequency_hz, bins) else { return (0.0, 0.0) };
        let reach = (0.75 * self.grid.bins_per_cell).ceil() as usize;
        let least_floor = FLOOR_MIN * self.least_power(channel);
        let mut strongest = place;
        for bin in place.saturating_sub(reach)..(place + reach + 1).min(bins) {
            if view.power[bin] > view.power[strongest] {
                strongest = bin;
            }
        }
        let beside = [strongest.wrapping_sub(1), strongest + 1];
        let is_slope =
            |bin: &usize| view.power.get(*bin).is_some_and(|p| *p > view.power[strongest]);
        if beside.iter().any(is_slope) {
            // The flank of a stronger line nearby hides this line.
            return (0.0, 0.0);
        }
        let peak = self.grid.measure(&view.power, &view.spectrum, strongest);
        (peak.power, peak.power / view.effective_floor(strongest, least_floor).max(1e-300))
    }

    /// The newest spectrum's value nearest to a frequency.
    pub(crate) fn value(&self, channel: usize, frequency_hz: f64) -> Option<Complex<f64>> {
        let view = self.channel_spectra.get(channel)?;
        view.spectrum.get(self.grid.place(frequency_hz, view.spectrum.len())?).copied()
    }

    /// The hop as a fraction of the window length.
    pub(crate) fn hop_windows(&self) -> f64 {
        self.plan.hop as f64 / self.plan.samples as f64
    }
}
