//! A processing branch: the samples of one rate and the sliding windows over them.
//!
//! The monitor has two branches: a low one (about 1.25 kHz) with short, middle and long windows,
//! and one at the sensor's own rate for higher frequencies. Planned once; execution does not
//! allocate.

use crate::config::MonitorConfig;
use crate::cut_detection::CutState;
use crate::history::History;
use crate::sliding::{Detection, SlidingWindow, WindowPlan};
use crate::track::Tracks;
use realfft::RealFftPlanner;

/// Upper frequency limit of the low branch if there is a full-rate branch, Hz.
pub(crate) const SPLIT_HZ: f64 = 160.0;
/// Hop of the low branch, s.
const LOW_HOP_S: f64 = 0.004;
/// Length of the full-rate window, s, before it is rounded to a power of two.
const FULL_WINDOW_S: f64 = 0.08;

/// The samples of one rate, and the windows over them, shortest first.
pub(crate) struct Branch {
    hop: usize,
    rate_hz: f64,
    hops: usize,
    measuring_window: usize,
    pub(crate) samples_to_hop: usize,
    pub(crate) histories: Vec<History>,
    windows: Vec<SlidingWindow>,
}

impl Branch {
    /// The branch behind the front end: windows of about 28, 72, 128 and 512 ms. Their thresholds
    /// were tuned with `examples/watch_figures`: earliest warning without a false alarm.
    pub(crate) fn low(
        planner: &mut RealFftPlanner<f64>,
        config: &MonitorConfig,
        factor: usize,
        top_hz: f64,
    ) -> Self {
        let rate_hz = config.rate_hz / factor as f64;
        let hop = ((LOW_HOP_S * rate_hz).round() as usize).max(1);
        let plan = |hops: usize, stride: usize, cycles: f64, ratio: f64| {
            let samples = hops * hop;
            let slowest_hz = cycles * rate_hz / samples as f64;
            WindowPlan {
                samples,
                hop: stride * hop,
                pad: 2,
                detrend: true,
                band_hz: [config.band_hz[0].max(slowest_hz), top_hz],
                least_ratio: 4.0,
                ratio: config.threshold * ratio,
                hops_to_agree: 2,
            }
        };
        let plans = [
            plan(7, 1, 1.2, 26.0),
            plan(18, 2, 2.0, 20.5),
            plan(32, 4, 2.0, 23.0),
            plan(128, 16, 2.0, 24.0),
        ];
        Self::new(planner, config, rate_hz, &plans, 2)
    }

    /// The branch at the sensor's own rate: windows of about 40 and 80 ms.
    pub(crate) fn full(planner: &mut RealFftPlanner<f64>, config: &MonitorConfig) -> Self {
        let exponent = (FULL_WINDOW_S * config.rate_hz).log2().round() as u32;
        let samples = 1_usize << exponent.clamp(5, 20);
        let plan = |samples: usize| WindowPlan {
            samples,
            hop: samples / 8,
            pad: 1,
            detrend: false,
            band_hz: [config.band_hz[0].max(SPLIT_HZ), config.band_top_hz()],
            least_ratio: 6.0,
            ratio: config.threshold * 24.0,
            hops_to_agree: 2,
        };
        Self::new(planner, config, config.rate_hz, &[plan(samples / 2), plan(samples)], 1)
    }

    fn new(
        planner: &mut RealFftPlanner<f64>,
        config: &MonitorConfig,
        rate_hz: f64,
        plans: &[WindowPlan],
        measuring_window: usize,
    ) -> Self {
        let least_power = [config.least_amplitude_n.powi(2), config.least_amplitude_nm.powi(2)];
        let window = |plan: &WindowPlan, planner: &mut RealFftPlanner<f64>| {
            SlidingWindow::new(
                planner,
                *plan,
                rate_hz,
                config.channels,
                least_power,
                config.learn_s,
            )
        };
        let longest = plans.iter().map(|plan| plan.samples).max().unwrap_or(1);
        let hop = plans.first().map_or(1, |plan| plan.hop);
        Self {
            hop,
            rate_hz,
            hops: 0,
            measuring_window,
            samples_to_hop: hop,
            histories: (0..config.channels).map(|_| History::new(longest)).collect(),
            windows: plans.iter().map(|plan| window(plan, planner)).collect(),
        }
    }

    /// Whether the noise floors of the windows up to the measuring one are learned; longer windows
    /// take longer.
    pub(crate) fn is_ready(&self) -> bool {
        self.windows.iter().take(self.measuring_window + 1).all(SlidingWindow::is_ready)
    }

    /// Selects the noise floors for air or cut.
    pub(crate) fn set_cut_state(&mut self, surroundings: CutState) {
        for window in &mut self.windows {
            window.set_cut_state(surroundings);
        }
    }

    /// Clears samples and peaks; learned floors are kept.
    pub(crate) fn reset(&mut self) {
        self.samples_to_hop = self.hop;
        self.hops = 0;
        for history in &mut self.histories {
            history.clear();
        }
        for window in &mut self.windows {
            window.reset();
        }
    }

    /// Clears the learned floor of a channel.
    pub(crate) fn clear_floor(&mut self, channel: usize) {
        for window in &mut self.windows {
            window.clear_floor(channel);
        }
    }

    /// Evaluates every window whose hop is due, for every channel, and passes on detections.
    pub(crate) fn process_hop(&mut self, lines_hz: &[f64], mut sighted: impl FnMut(Detection)) {
        self.samples_to_hop = self.hop;
        self.hops = self.hops.wrapping_add(1);
        let due = |window: &&mut SlidingWindow| {
            (self.hops * self.hop).is_multiple_of(window.hop_samples())
        };
        for window in self.windows.iter_mut().filter(due) {
            window.hop(&self.histories, lines_hz, &mut sighted);
        }
    }

    /// Measures the lines at frequencies that it `covers`, in the measuring window; `gain` is the
    /// front end's gain at a frequency. Stuck and dead channels are ignored.
    pub(crate) fn measure(
        &self,
        tracks: &mut Tracks,
        now_s: f64,
        covers: impl Fn(f64) -> bool,
        gain: impl Fn(f64) -> f64,
        is_still: impl Fn(usize) -> bool,
    ) {
        let Some(window) = self.windows.get(self.measuring_window) else { return };
        if !(self.hops * self.hop).is_multiple_of(window.hop_samples()) {
            return;
        }
        let step_s = window.hop_samples() as f64 / self.rate_hz;
        for track in tracks.iter_mut().filter(|track| covers(track.frequency_hz)) {
            let kept = gain(track.frequency_hz).powi(2);
            let strength = |channel| {
                if is_still(channel) {
                    return (0.0, 0.0);
                }
                let (power, ratio) = window.strength(channel, track.frequency_hz);
                (power / kept, ratio)
            };
            let measured: [(f64, f64); crate::block::CHANNELS_MAX] = std::array::from_fn(strength);
            track.measure(|channel| measured[channel], self.histories.len(), now_s, step_s);
            let value = |channel| window.value(channel, track.frequency_hz);
            if let (Some(x), Some(y)) = (value(0), value(1)) {
                track.ellipse.add(x, y, window.hop_windows());
            }
        }
    }
}
