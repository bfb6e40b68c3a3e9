//! One sliding window over all channels of one sampling rate.
//!
//! It stores, per channel, the noise floor and the peaks of previous hops, and reports peaks on
//! which two or three disjoint windows agree. Planned once; execution does not allocate.

use crate::floor::Floor;
use crate::history::History;
use crate::peak::{Agreement, Grid, Peak};
use crate::surroundings::Surroundings;
use crate::track::TRACKS;
use crate::transform::Transform;
use crate::view::View;
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
    /// Lines are searched in this band, Hz.
    pub(crate) band_hz: [f64; 2],
    /// Least power over floor of a peak.
    pub(crate) least_ratio: f64,
    /// Least power over floor of two disjoint windows added in phase.
    pub(crate) ratio: f64,
    /// Hops in a row that must agree.
    pub(crate) hops_to_agree: u16,
}

/// A tone that disjoint windows agree on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sighting {
    pub(crate) channel: usize,
    pub(crate) frequency_hz: f64,
    pub(crate) power: f64,
    pub(crate) ratio: f64,
    pub(crate) cell_hz: f64,
    /// Three disjoint windows agree, not only two.
    pub(crate) threefold: bool,
    /// The mean power heard here while the noise was learned, over the peak's.
    pub(crate) heard: f64,
    /// Whether it was seen in the signal without spindle multiples.
    pub(crate) apart: bool,
}

impl Sighting {
    /// Whether the windows that agree began after the spindle's speed last changed: before, lines
    /// that move with it, and the front end that follows it, are not reliable.
    pub(crate) fn is_after_change(&self, settled_s: f64) -> bool {
        let windows = if self.threefold { 3.0 } else { 2.0 };
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
    views: Vec<View>,
    cells: Vec<f64>,
    rule: Agreement,
    least_power: [f64; 2],
}

/// Allowance for the delay of the reported speed and of the front end, s.
const CHANGE_MARGIN_S: f64 = 0.05;
/// Windows after one another that a floor is learned from, at least, after the first: the low branch's 128 ms then take 0.9 s. With five a
/// real stable cut (turning, 10 kHz) was judged by too little air and alarmed.
const WARM_WINDOWS: f64 = 6.0;
/// Cells over which a broadband change is judged.
const BROAD_CELLS: f64 = 32.0;
/// Lower limit of the floor, relative to the power of the smallest amplitude.
const LEAST_FLOOR: f64 = 0.01;

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
        // At least this many cells are needed to distinguish a broadband change from a line.
        let first = bin(plan.band_hz[0]).saturating_sub(reach).max(bins_per_cell as usize);
        let broad = first + (BROAD_CELLS * bins_per_cell) as usize;
        let end = (bin(plan.band_hz[1]) + reach).max(broad).min(9 * padded / 20);
        let bins = end.saturating_sub(first).max(1);
        let searched = bin(plan.band_hz[0]).saturating_sub(first)
            ..(bin(plan.band_hz[1]) + 1).saturating_sub(first).min(bins);
        let hop_s = plan.hop as f64 / rate_hz;
        let window_s = plan.samples as f64 / rate_hz;
        let warm_frames = ((learn_s - window_s).max(WARM_WINDOWS * window_s) / hop_s) as u32;
        let view = || {
            let floor = Floor::new(bins, warm_frames, 4.0 / hop_s, reach);
            View::new(floor, bins, 2 * plan.samples / plan.hop + 1)
        };
        Self {
            grid: Grid { bin_hz, bins_per_cell, first },
            window_s,
            searched,
            views: (0..channels).map(|_| view()).collect(),
            cells: vec![0.0; bins],
            rule: Agreement { ratio: plan.ratio, cells: 0.75, growth: 30.0 },
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
        self.views.iter().all(|view| view.floor.is_known())
    }

    /// Changes the surroundings of all floors.
    pub(crate) fn switch(&mut self, surroundings: Surroundings) {
        for view in &mut self.views {
            view.floor.switch(surroundings);
        }
    }

    /// Clears everything except learned floors.
    pub(crate) fn reset(&mut self) {
        for view in &mut self.views {
            view.reset();
        }
    }

    /// Clears the learned floor of a channel.
    pub(crate) fn forget(&mut self, channel: usize) {
        if let Some(view) = self.views.get_mut(channel) {
            view.reset();
            view.floor.forget();
        }
    }

    /// Transforms the newest window of every channel and passes every agreed peak to `sighted`.
    /// `lines_hz` are the live lines, whose bins do not update the floors.
    pub(crate) fn hop(
        &mut self,
        histories: &[History],
        lines_hz: &[f64],
        mut sighted: impl FnMut(Sighting),
    ) {
        let (frozen, live) = self.frozen(lines_hz);
        for (channel, history) in histories.iter().enumerate() {
            if let Some(samples) = history.newest(self.plan.samples) {
                self.take(channel, samples, &frozen[..live]);
            }
        }
        for (channel, view) in self.views.iter().enumerate() {
            for peak in view.newest().iter().filter(|p| p.power >= self.least_power(channel)) {
                if self.is_agreed(channel, peak, |p| p.pairs) {
                    sighted(Sighting {
                        channel,
                        frequency_hz: peak.frequency_hz,
                        power: peak.power,
                        ratio: peak.ratio,
                        cell_hz: self.grid.cell_hz(),
                        threefold: self.is_agreed(channel, peak, |p| p.triples),
                        heard: self.heard(view, peak),
                        apart: false,
                    });
                }
            }
        }
    }

    fn take(&mut self, channel: usize, samples: &[f64], frozen: &[Range<usize>]) {
        let least_floor = LEAST_FLOOR * self.least_power(channel);
        let Some(view) = self.views.get_mut(channel) else { return };
        view.see(self.transform.run(samples).get(self.grid.first..).unwrap_or(&[]));
        if view.floor.is_known() {
            let stride = self.grid.bins_per_cell as usize;
            view.weigh(&mut self.cells, stride, least_floor);
            let mut peaks =
                view.peaks(&self.grid, &self.searched, self.plan.least_ratio, least_floor);
            view.judge(&mut peaks, &self.rule, self.window_s, self.plan.samples / self.plan.hop);
        }
        view.learn(frozen);
    }

    /// Whether a peak has agreed for long enough, and on the channel that sees it best too: a fading
    /// line may pass for a steady one where it is half lost in noise.
    fn is_agreed(&self, channel: usize, peak: &Peak, hops: impl Fn(&Peak) -> u16) -> bool {
        let long = |p: &Peak| hops(p) >= self.plan.hops_to_agree;
        let near = |p: &&Peak| {
            (p.frequency_hz - peak.frequency_hz).abs() * self.window_s < 0.75
                && p.power > 1.5 * peak.power
                && p.ratio > 1.5 * peak.ratio
        };
        let others = self.views.iter().enumerate();
        let alike = others.filter(|(other, _)| *other != channel && (*other < 3) == (channel < 3));
        long(peak) && alike.flat_map(|(_, view)| view.newest()).filter(near).all(long)
    }

    /// The part of a peak's power that was there while the noise was learned.
    fn heard(&self, view: &View, peak: &Peak) -> f64 {
        let bin = self.grid.place(peak.frequency_hz, view.power.len());
        bin.map_or(0.0, |bin| view.floor.heard_near(bin)) / peak.power.max(1e-300)
    }

    fn least_power(&self, channel: usize) -> f64 {
        self.least_power[usize::from(channel >= 3)]
    }

    /// The runs of bins that belong to the live lines, and how many there are.
    fn frozen(&self, lines_hz: &[f64]) -> ([Range<usize>; TRACKS], usize) {
        let mut frozen: [Range<usize>; TRACKS] = std::array::from_fn(|_| 0..0);
        let reach = 2.0 * self.grid.bins_per_cell;
        for (run, line_hz) in frozen.iter_mut().zip(lines_hz) {
            let bin = line_hz / self.grid.bin_hz - self.grid.first as f64;
            *run = (bin - reach).max(0.0) as usize..(bin + reach + 1.0).max(0.0) as usize;
        }
        (frozen, lines_hz.len().min(TRACKS))
    }

    /// Strongest value within one cell of a frequency: power, and power over floor; `None` if the
    /// floor is unknown.
    pub(crate) fn strength(&self, channel: usize, frequency_hz: f64) -> (f64, f64) {
        let Some(view) = self.views.get(channel).filter(|view| view.floor.is_known()) else {
            return (0.0, 0.0);
        };
        let bins = view.power.len();
        let Some(place) = self.grid.place(frequency_hz, bins) else { return (0.0, 0.0) };
        let reach = (0.75 * self.grid.bins_per_cell).ceil() as usize;
        let least_floor = LEAST_FLOOR * self.least_power(channel);
        let mut strongest = place;
        for at in place.saturating_sub(reach)..(place + reach + 1).min(bins) {
            if view.power[at] > view.power[strongest] {
                strongest = at;
            }
        }
        let beside = [strongest.wrapping_sub(1), strongest + 1];
        let is_slope = |at: &usize| view.power.get(*at).is_some_and(|p| *p > view.power[strongest]);
        if beside.iter().any(is_slope) {
            // The skirt of a stronger line nearby: nothing of this line remains.
            return (0.0, 0.0);
        }
        let peak = self.grid.measure(&view.power, &view.spectrum, strongest);
        (peak.power, peak.power / view.effective_floor(strongest, least_floor).max(1e-300))
    }

    /// The newest spectrum's value nearest to a frequency.
    pub(crate) fn value(&self, channel: usize, frequency_hz: f64) -> Option<Complex<f64>> {
        let view = self.views.get(channel)?;
        view.spectrum.get(self.grid.place(frequency_hz, view.spectrum.len())?).copied()
    }

    /// The part of a window between two transforms.
    pub(crate) fn hop_windows(&self) -> f64 {
        self.plan.hop as f64 / self.plan.samples as f64
    }
}
