//! One windowed transform: linear detrend if requested, Hann, zero-padding, `realfft`.
//!
//! Without detrending, the Hann window suppresses a mean beyond the second bin, and a ramp
//! decreases with the third power of the bin, which is sufficient for spectra far from 0 Hz.
//!
//! Planned once ([`Transform::new`] allocates), executed without allocation. Spectra are scaled
//! so that `|X|` is the amplitude of a tone in the middle of its bin.

use crate::window::hann;
use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// A planned transform of `n` samples, padded to `padded` points.
pub(crate) struct Transform {
    window: Vec<f64>,
    ramp: Vec<f64>,
    plan: Arc<dyn RealToComplex<f64>>,
    input: Vec<f64>,
    spectrum: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

impl Transform {
    /// Plans a transform of `n` samples, padded with zeros to at least `pad * n` points.
    pub(crate) fn new(
        planner: &mut RealFftPlanner<f64>,
        n: usize,
        pad: usize,
        detrend: bool,
    ) -> Self {
        let padded = (pad.max(1) * n).next_power_of_two();
        let plan = planner.plan_fft_forward(padded);
        let scale = crate::window::amplitude_scale(&hann(n));
        let window: Vec<f64> = hann(n).iter().map(|w| w * scale).collect();
        let middle = 0.5 * (n as f64 - 1.0);
        let ramp = window.iter().enumerate().map(|(i, w)| w * (i as f64 - middle));
        Self {
            ramp: if detrend { ramp.collect() } else { Vec::new() },
            window,
            input: plan.make_input_vec(),
            spectrum: plan.make_output_vec(),
            scratch: plan.make_scratch_vec(),
            plan,
        }
    }

    /// Points after padding.
    pub(crate) fn padded(&self) -> usize {
        self.input.len()
    }

    /// The spectrum of the samples; empty if their number is not the planned one.
    pub(crate) fn run(&mut self, samples: &[f64]) -> &[Complex<f64>] {
        let n = self.window.len();
        if samples.len() != n {
            return &[];
        }
        if self.ramp.is_empty() {
            for ((to, x), w) in self.input.iter_mut().zip(samples).zip(&self.window) {
                *to = w * x;
            }
        } else {
            let (mean, slope) = line_through(samples);
            let weights = self.window.iter().zip(&self.ramp);
            for ((to, x), (w, r)) in self.input.iter_mut().zip(samples).zip(weights) {
                *to = w * (x - mean) - slope * r;
            }
        }
        self.input[n..].fill(0.0);
        let done =
            self.plan.process_with_scratch(&mut self.input, &mut self.spectrum, &mut self.scratch);
        if done.is_ok() { &self.spectrum } else { &[] }
    }
}

/// Mean, and slope per sample, of the least-squares line through equally spaced samples.
pub(crate) fn line_through(samples: &[f64]) -> (f64, f64) {
    let n = samples.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let mut sums = [[0.0_f64; 4]; 2];
    let quads = samples.chunks_exact(4);
    let rest = quads.remainder();
    let done = samples.len() - rest.len();
    for (k, quad) in quads.enumerate() {
        let base = (4 * k) as f64 - middle;
        for (lane, &x) in quad.iter().enumerate() {
            sums[0][lane] += x;
            sums[1][lane] += x * (base + lane as f64);
        }
    }
    for (i, &x) in rest.iter().enumerate() {
        sums[0][0] += x;
        sums[1][0] += x * ((done + i) as f64 - middle);
    }
    let total = |s: [f64; 4]| (s[0] + s[1]) + (s[2] + s[3]);
    let spread = n * (n * n - 1.0) / 12.0;
    (total(sums[0]) / n, if spread > 0.0 { total(sums[1]) / spread } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn spectrum(n: usize, pad: usize, x: impl Fn(f64) -> f64) -> (Vec<Complex<f64>>, usize) {
        let mut transform = Transform::new(&mut RealFftPlanner::new(), n, pad, true);
        let samples: Vec<f64> = (0..n).map(|i| x(i as f64)).collect();
        let padded = transform.padded();
        (transform.run(&samples).to_vec(), padded)
    }

    #[test]
    fn a_ramp_leaves_nothing() {
        let (bins, _) = spectrum(256, 1, |i| 40.0 + 3.0 * i);
        assert!(bins.iter().all(|b| b.norm() < 1e-10));
    }

    #[test]
    fn without_detrend_a_ramp_is_gone_eight_bins_up() {
        let mut transform = Transform::new(&mut RealFftPlanner::new(), 256, 1, false);
        let ramp: Vec<f64> = (0..256).map(|i| 1e3 + f64::from(i)).collect();
        assert!(transform.run(&ramp)[8..].iter().all(|b| b.norm() < 256.0 * 7e-4));
    }

    #[test]
    fn a_tone_in_the_middle_of_a_bin_reads_its_amplitude() {
        let (bins, padded) =
            spectrum(256, 4, |i| 3.5 * (std::f64::consts::TAU * 20.0 * i / 256.0 + 0.3).sin());
        let bin = 20 * padded / 256;
        assert!((bins[bin].norm() - 3.5).abs() < 2e-3, "{}", bins[bin].norm());
    }

    #[test]
    fn a_run_of_the_wrong_length_is_refused() {
        let mut transform = Transform::new(&mut RealFftPlanner::new(), 64, 1, true);
        assert!(transform.run(&[0.0; 63]).is_empty());
    }

    proptest! {
        #[test]
        fn the_transform_is_linear(a in -5.0..5.0_f64, b in -5.0..5.0_f64, f in 3.0..30.0_f64) {
            let one = |i: f64| (f * i / 10.0).sin();
            let two = |i: f64| (i * i * 0.01).cos();
            let (first, _) = spectrum(64, 2, one);
            let (second, _) = spectrum(64, 2, two);
            let (both, _) = spectrum(64, 2, |i| a * one(i) + b * two(i));
            for ((x, y), z) in first.iter().zip(&second).zip(&both) {
                prop_assert!((x * a + y * b - z).norm() < 1e-12);
            }
        }
    }
}
