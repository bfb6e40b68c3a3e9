//! Spectrum of a path: extended by rest at both ends and returned to its start, so that its periodic continuation has no jump.
//!
//! Forward and inverse transform are exact to rounding. The rest is long enough for the plant to
//! settle, if the caller states the settling time.

use realfft::num_complex::Complex64;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// Transforms of paths of one length.
pub(crate) struct Transform {
    samples: usize,
    pad: usize,
    step_s: f64,
    forward: Arc<dyn RealToComplex<f64>>,
    backward: Arc<dyn ComplexToReal<f64>>,
}

impl Transform {
    /// For `samples` samples every `step_s`; the path rests for `settle_s` at both ends.
    pub(crate) fn new(samples: usize, step_s: f64, settle_s: f64) -> Self {
        let pad = (settle_s / step_s).ceil() as usize;
        let half = (samples + 2 * pad).next_multiple_of(256);
        let mut planner = RealFftPlanner::new();
        let (forward, backward) =
            (planner.plan_fft_forward(2 * half), planner.plan_fft_inverse(2 * half));
        Self { samples, pad, step_s, forward, backward }
    }

    fn length(&self) -> usize {
        self.forward.len()
    }

    /// Frequencies of its bins, Hz.
    pub(crate) fn bins_hz(&self) -> Vec<f64> {
        let spacing_hz = 1.0 / (self.length() as f64 * self.step_s);
        (0..=self.length() / 2).map(|k| k as f64 * spacing_hz).collect()
    }

    /// The spectrum of as many samples as stated in [`Transform::new`].
    pub(crate) fn spectrum(&self, samples: &[f64]) -> Vec<Complex64> {
        let (half, last) = (self.length() / 2, self.samples.saturating_sub(1));
        let sample_at = |k: usize| samples.get(k.saturating_sub(self.pad).min(last)).copied();
        let forward = (0..half).map(|k| sample_at(k).unwrap_or(0.0));
        let mut signal: Vec<f64> = forward.clone().chain(forward.rev()).collect();
        let mut spectrum = self.forward.make_output_vec();
        // The lengths are those of the plan, so that it cannot return an error.
        let done = self.forward.process(&mut signal, &mut spectrum);
        debug_assert!(done.is_ok());
        spectrum
    }

    /// The samples of a spectrum.
    pub(crate) fn samples(&self, mut spectrum: Vec<Complex64>) -> Vec<f64> {
        // Of a real signal both are real; an imaginary part from a gain is dropped.
        let last = spectrum.len() - 1;
        (spectrum[0].im, spectrum[last].im) = (0.0, 0.0);
        let mut signal = self.backward.make_output_vec();
        let done = self.backward.process(&mut spectrum, &mut signal);
        debug_assert!(done.is_ok());
        let scale = 1.0 / self.length() as f64;
        signal[self.pad..self.pad + self.samples].iter().map(|value| value * scale).collect()
    }

    /// Filters samples by a frequency response at the bins.
    pub(crate) fn through(&self, samples: &[f64], response: &[Complex64]) -> Vec<f64> {
        self.samples(product(&self.spectrum(samples), response))
    }
}

/// Product, bin by bin.
pub(crate) fn product(a: &[Complex64], b: &[Complex64]) -> Vec<Complex64> {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}
