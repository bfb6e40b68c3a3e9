//! A second-order Butterworth low pass for steps that may vary.
//!
//! Bilinear transform with prewarping, so that the corner stays where it is said to be. Source: Oppenheim and Schafer,
//! Discrete-Time Signal Processing, chapter 7.
//! Promises: finite in, finite out for inputs below 1e100; unit gain at rest. Never: a reaction to a step of no time.

use core::f64::consts::{PI, SQRT_2};

/// The corner is at most this share of the sampling rate.
const CORNER_MAX: f64 = 0.45;

/// The filter's state.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LowPass {
    input: [f64; 2],
    past: [f64; 2],
    pub(crate) output: f64,
}

impl LowPass {
    /// Takes one sample, `dt_s` after the last; its output.
    pub(crate) fn step(&mut self, input: f64, corner_hz: f64, dt_s: f64) -> f64 {
        if dt_s <= 0.0 {
            return self.output;
        }
        let k = libm::tan(PI * (corner_hz * dt_s).min(CORNER_MAX));
        let norm = 1.0 / (1.0 + SQRT_2 * k + k * k);
        let [x1, x2] = self.input;
        let [y1, y2] = self.past;
        let forward = k * k * norm * (input + 2.0 * x1 + x2);
        let back = norm * (2.0 * (k * k - 1.0) * y1 + (1.0 - SQRT_2 * k + k * k) * y2);
        self.output = forward - back;
        self.input = [input, x1];
        self.past = [self.output, y1];
        self.output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Amplitude that is left of a sine of unit amplitude.
    fn gain_at(hz: f64, corner_hz: f64) -> f64 {
        let (mut filter, dt_s) = (LowPass::default(), 1e-3);
        let mut largest = 0.0_f64;
        for k in 0..20_000 {
            let out = filter.step(libm::sin(2.0 * PI * hz * k as f64 * dt_s), corner_hz, dt_s);
            largest = if k > 10_000 { largest.max(out.abs()) } else { 0.0 };
        }
        largest
    }

    #[test]
    fn it_has_the_gain_of_a_second_order_butterworth() {
        for hz in [0.3, 1.0, 3.0, 10.0, 40.0_f64] {
            let expected = 1.0 / libm::sqrt(1.0 + (hz / 3.0).powi(4));
            let warped = 0.02 * expected + 1e-4;
            assert!((gain_at(hz, 3.0) - expected).abs() < warped, "{hz} Hz: {}", gain_at(hz, 3.0));
        }
    }

    #[test]
    fn a_constant_passes_at_any_pace() {
        let mut filter = LowPass::default();
        for _ in 0..20_000 {
            filter.step(7.0, 3.0, 1e-3);
        }
        for dt_s in [1e-3, 4e-3, 1e-5, 0.2, 0.0, 1e-3] {
            assert!((filter.step(7.0, 3.0, dt_s) - 7.0).abs() < 1e-6);
        }
    }
}
