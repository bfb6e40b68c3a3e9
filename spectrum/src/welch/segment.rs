//! Segments of a record: division, weighting and transform, and their power for samples that arrive
//! in parts.

use std::sync::Arc;

use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

use super::{Detrend, Scaling, Segments, SpectrumError, Taper};
use crate::transform::line_through;
use crate::window::{density_scale, hann};

/// Plan of the segments for a record of a given length.
pub(super) struct SegmentPlan {
    pub(super) length: usize,
    /// Samples from the start of a segment to that of the next.
    pub(super) step: usize,
    /// Factor from squares to one-sided power, for bins with a mirror image.
    pub(super) scale: f64,
    detrend: Detrend,
    window: Vec<f64>,
    fft: Arc<dyn RealToComplex<f64>>,
}

impl SegmentPlan {
    pub(super) fn new(samples: usize, segments: &Segments) -> Result<Self, SpectrumError> {
        let length = segments.length.min(samples);
        if samples < 2 {
            return Err(SpectrumError::TooShort { samples });
        }
        let usable = segments.rate > 0.0 && segments.rate.is_finite() && segments.length >= 2;
        if !usable || segments.overlap >= segments.length {
            let Segments { rate, length, overlap, .. } = *segments;
            return Err(SpectrumError::Segments { rate, length, overlap });
        }
        let window = match segments.taper {
            Taper::Hann => hann(length),
            Taper::Boxcar => vec![1.0; length],
        };
        let scale = match segments.scaling {
            Scaling::Density => density_scale(&window, segments.rate),
            Scaling::Spectrum => 2.0 / window.iter().sum::<f64>().powi(2),
        };
        Ok(Self {
            length,
            step: length - segments.overlap.min(length - 1),
            scale,
            detrend: segments.detrend,
            window,
            fft: RealFftPlanner::new().plan_fft_forward(length),
        })
    }

    /// Computes the complex spectrum of a segment in `buffers.output`. The lengths are those of the
    /// plan, so that no error is possible.
    pub(super) fn transform(&self, segment: &[f64], buffers: &mut Buffers) {
        let (mean, slope) = match self.detrend {
            Detrend::None => (0.0, 0.0),
            Detrend::Constant => (line_through(segment).0, 0.0),
            Detrend::Linear => line_through(segment),
        };
        let middle = 0.5 * (segment.len() as f64 - 1.0);
        let samples = segment.iter().zip(&self.window).enumerate();
        for (to, (i, (x, w))) in buffers.input.iter_mut().zip(samples) {
            *to = (x - mean - slope * (i as f64 - middle)) * w;
        }
        let Buffers { input, output, scratch } = buffers;
        if self.fft.process_with_scratch(input, output, scratch).is_err() {
            output.fill(Complex::default());
        }
    }

    pub(super) fn buffers(&self) -> Buffers {
        Buffers {
            input: self.fft.make_input_vec(),
            output: self.fft.make_output_vec(),
            scratch: self.fft.make_scratch_vec(),
        }
    }

    /// Whether a bin has no mirror image: the first, and for an even length the last.
    pub(super) fn is_single(&self, bin: usize) -> bool {
        bin == 0 || (self.length.is_multiple_of(2) && bin == self.length / 2)
    }
}

/// Buffers of a transform; the spectrum is `output`.
pub(super) struct Buffers {
    input: Vec<f64>,
    pub(super) output: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

/// The power of the segments of a record, one after another, for samples that arrive in parts of
/// any length.
pub struct SegmentPower {
    plan: SegmentPlan,
    buffers: Buffers,
    rate: f64,
    /// Samples of the segment that is not complete yet.
    pending: Vec<f64>,
    power: Vec<f64>,
    done: usize,
}

impl SegmentPower {
    /// Plans for a record of `samples` samples.
    ///
    /// # Errors
    /// A record that is too short, or invalid segments.
    pub fn new(samples: usize, segments: &Segments) -> Result<Self, SpectrumError> {
        let plan = SegmentPlan::new(samples, segments)?;
        Ok(Self {
            buffers: plan.buffers(),
            rate: segments.rate,
            pending: Vec::with_capacity(plan.length),
            power: vec![0.0; plan.length / 2 + 1],
            plan,
            done: 0,
        })
    }

    /// Frequencies of the powers, cycles per unit.
    #[must_use]
    pub fn frequencies(&self) -> Vec<f64> {
        let length = self.plan.length as f64;
        (0..self.power.len()).map(|bin| bin as f64 * self.rate / length).collect()
    }

    /// Adds the next samples; passes the time (or position) of the middle of every completed
    /// segment, and its power, to `each`.
    pub fn push(&mut self, mut samples: &[f64], mut each: impl FnMut(f64, &[f64])) {
        while let Some((part, rest)) =
            samples.split_at_checked(self.plan.length - self.pending.len())
        {
            self.pending.extend_from_slice(part);
            samples = rest;
            self.complete();
            let start = (self.done * self.plan.step) as f64 / self.rate;
            each(start + 0.5 * self.plan.length as f64 / self.rate, &self.power);
            self.done += 1;
            self.pending.drain(..self.plan.step);
        }
        self.pending.extend_from_slice(samples);
    }

    fn complete(&mut self) {
        self.plan.transform(&self.pending, &mut self.buffers);
        for (bin, (power, value)) in self.power.iter_mut().zip(&self.buffers.output).enumerate() {
            let scale = self.plan.scale * if self.plan.is_single(bin) { 0.5 } else { 1.0 };
            *power = value.norm_sqr() * scale;
        }
    }
}
