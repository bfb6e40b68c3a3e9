//! One hop of the full-rate window, for the benchmark of its computing time.

use crate::history::History;
use crate::sliding::{SlidingWindow, WindowPlan};
use realfft::RealFftPlanner;

/// A full-rate window over several channels of pseudo-random noise.
pub struct HopBench {
    window: SlidingWindow,
    histories: Vec<History>,
    pushed: usize,
}

impl HopBench {
    /// A window of `samples` at `rate_hz` over `channels`, filled and with a learned noise floor.
    #[must_use]
    pub fn new(samples: usize, rate_hz: f64, channels: usize) -> Self {
        let plan = WindowPlan {
            samples,
            hop: samples / 8,
            pad: 1,
            detrend: false,
            band_hz: [160.0, 1000.0],
            least_ratio: 6.0,
            ratio: 24.0,
            hops_to_agree: 2,
        };
        let planner = &mut RealFftPlanner::new();
        let window = SlidingWindow::new(planner, plan, rate_hz, channels, [0.01; 2], 0.5);
        let mut histories: Vec<_> = (0..channels).map(|_| History::new(samples)).collect();
        let mut state = 7_u64;
        for history in &mut histories {
            for _ in 0..samples {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                history.push((state >> 40) as f64 / 1e6);
            }
        }
        let mut bench = Self { window, histories, pushed: 0 };
        for _ in 0..1000 {
            bench.hop();
        }
        bench
    }

    /// One hop over all channels; returns the total number of detections.
    pub fn hop(&mut self) -> usize {
        self.window.hop(&self.histories, &[], |_| self.pushed += 1);
        self.pushed
    }
}
