//! Offline spectra by averaged segments: Welch's method, cross spectrum, coherence, detrending.
//!
//! Agrees with `welch`, `csd`, `coherence` and `detrend` of `scipy.signal` to 1e-9 relative; the
//! tests contain its results. Not for real time: it allocates. Frequencies are cycles per unit of
//! `1/rate`: seconds for forces, millimetres for surfaces. Valid for signals stationary over the
//! record.

mod segment;

use self::segment::SegmentPlan;
use crate::transform::line_through;
use realfft::num_complex::Complex;

pub use self::segment::SegmentPower;

/// Trend removed from each segment before its transform.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Detrend {
    /// Nothing.
    None,
    /// The mean.
    #[default]
    Constant,
    /// The least-squares line.
    Linear,
}

/// The window over each segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Taper {
    /// Periodic Hann.
    #[default]
    Hann,
    /// No window: all ones.
    Boxcar,
}

/// Scaling of the values of a spectrum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scaling {
    /// Power per unit of frequency: its integral is the mean square.
    #[default]
    Density,
    /// Power: a tone in the middle of a bin reads half its amplitude squared.
    Spectrum,
}

/// Division of a record into segments, and their weighting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segments {
    /// Samples per unit (s, mm).
    pub rate: f64,
    /// Samples per segment; longer than the record means the whole record.
    pub length: usize,
    /// Overlap of neighbouring segments, samples; less than the length.
    pub overlap: usize,
    /// Trend removed from each segment.
    pub detrend: Detrend,
    /// The window.
    pub taper: Taper,
    /// Scaling of the values.
    pub scaling: Scaling,
}

impl Segments {
    /// The defaults of `scipy.signal`: Hann, half overlap, mean removed, density.
    #[must_use]
    pub fn new(rate: f64, length: usize) -> Self {
        Self {
            rate,
            length,
            overlap: length / 2,
            detrend: Detrend::Constant,
            taper: Taper::Hann,
            scaling: Scaling::Density,
        }
    }
}

/// A record without a valid spectrum.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SpectrumError {
    /// Too few samples.
    #[error(
        "spectrum: the record has {samples} samples, expected at least 2; give a longer record"
    )]
    TooShort {
        /// Samples in the record.
        samples: usize,
    },
    /// Two corresponding records differ in length.
    #[error(
        "spectrum: records of {first} and {second} samples, expected equal lengths; cut them alike"
    )]
    Unequal {
        /// Samples of the first.
        first: usize,
        /// Samples of the second.
        second: usize,
    },
    /// Invalid rate, length or overlap.
    #[error(
        "spectrum: rate {rate}, segments of {length} samples, overlap {overlap}; expected a rate above 0, \
         2 samples or more, and an overlap below the length"
    )]
    Segments {
        /// Samples per unit.
        rate: f64,
        /// Samples per segment.
        length: usize,
        /// Overlap, samples.
        overlap: usize,
    },
}

/// One-sided power over frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// Frequencies, cycles per unit.
    pub frequency: Vec<f64>,
    /// Power (density) at each.
    pub power: Vec<f64>,
    /// Segments averaged.
    pub averages: usize,
}

/// One-sided cross power over frequency: the mean of conj(X) Y.
#[derive(Clone, Debug, PartialEq)]
pub struct CrossSpectrum {
    /// Frequencies, cycles per unit.
    pub frequency: Vec<f64>,
    /// Cross power (density) at each.
    pub value: Vec<Complex<f64>>,
    /// Segments averaged.
    pub averages: usize,
}

/// Removes the mean or the least-squares line of a record.
#[must_use]
pub fn detrended(samples: &[f64], detrend: Detrend) -> Vec<f64> {
    let (mean, slope) = match detrend {
        Detrend::None => return samples.to_vec(),
        Detrend::Constant => (line_through(samples).0, 0.0),
        Detrend::Linear => line_through(samples),
    };
    let middle = 0.5 * (samples.len() as f64 - 1.0);
    samples.iter().enumerate().map(|(i, x)| x - mean - slope * (i as f64 - middle)).collect()
}

/// The complex spectra of all segments of a record.
struct SegmentSpectra {
    spectra: Vec<Vec<Complex<f64>>>,
    plan: SegmentPlan,
}

fn segment_spectra(samples: &[f64], segments: &Segments) -> Result<SegmentSpectra, SpectrumError> {
    let plan = SegmentPlan::new(samples.len(), segments)?;
    let mut buffers = plan.buffers();
    let spectrum = |segment: &[f64]| {
        plan.transform(segment, &mut buffers);
        buffers.output.clone()
    };
    let spectra = samples.windows(plan.length).step_by(plan.step).map(spectrum).collect();
    Ok(SegmentSpectra { spectra, plan })
}

impl SegmentSpectra {
    /// The mean of conj(X) Y over all segments, one-sided.
    fn mean_product(&self, other: &Self) -> Vec<Complex<f64>> {
        let n = self.spectra.len() as f64;
        let bins = self.plan.length / 2 + 1;
        (0..bins)
            .map(|bin| {
                let pairs = self.spectra.iter().zip(&other.spectra);
                let sum: Complex<f64> = pairs.map(|(x, y)| x[bin].conj() * y[bin]).sum();
                sum * (self.plan.scale * if self.plan.is_single(bin) { 0.5 } else { 1.0 } / n)
            })
            .collect()
    }

    fn frequencies(&self, rate: f64) -> Vec<f64> {
        let length = self.plan.length as f64;
        (0..=self.plan.length / 2).map(|bin| bin as f64 * rate / length).collect()
    }
}

/// One-sided cross spectrum of two records.
///
/// # Errors
/// Records too short or of unequal length, segments that cannot be.
pub fn csd(x: &[f64], y: &[f64], segments: &Segments) -> Result<CrossSpectrum, SpectrumError> {
    if x.len() != y.len() {
        return Err(SpectrumError::Unequal { first: x.len(), second: y.len() });
    }
    let (cut_x, cut_y) = (segment_spectra(x, segments)?, segment_spectra(y, segments)?);
    Ok(CrossSpectrum {
        frequency: cut_x.frequencies(segments.rate),
        value: cut_x.mean_product(&cut_y),
        averages: cut_x.spectra.len(),
    })
}

/// One-sided power spectrum of a record.
///
/// # Errors
/// A record too short, segments that cannot be.
pub fn welch(x: &[f64], segments: &Segments) -> Result<Spectrum, SpectrumError> {
    let cut = segment_spectra(x, segments)?;
    Ok(Spectrum {
        frequency: cut.frequencies(segments.rate),
        power: cut.mean_product(&cut).iter().map(|value| value.re).collect(),
        averages: cut.spectra.len(),
    })
}

/// Coherence of two records at each frequency, 0 to 1, and the frequencies.
///
/// Meaningful only with several segments: with one it is 1 by construction.
///
/// # Errors
/// Records too short or of unequal length, segments that cannot be.
pub fn coherence(x: &[f64], y: &[f64], segments: &Segments) -> Result<Spectrum, SpectrumError> {
    if x.len() != y.len() {
        return Err(SpectrumError::Unequal { first: x.len(), second: y.len() });
    }
    let (cut_x, cut_y) = (segment_spectra(x, segments)?, segment_spectra(y, segments)?);
    let (xx, yy) = (cut_x.mean_product(&cut_x), cut_y.mean_product(&cut_y));
    let xy = cut_x.mean_product(&cut_y);
    let power = xy.iter().zip(xx.iter().zip(&yy)).map(|(xy, (xx, yy))| {
        let product = xx.re * yy.re;
        if product > 0.0 { xy.norm_sqr() / product } else { 0.0 }
    });
    Ok(Spectrum {
        power: power.collect(),
        frequency: cut_x.frequencies(segments.rate),
        averages: cut_x.spectra.len(),
    })
}

/// Waterfall: time (or position) of the centre of each segment, and its power spectrum.
///
/// # Errors
/// A record too short, segments that cannot be.
pub fn waterfall(x: &[f64], segments: &Segments) -> Result<Vec<(f64, Vec<f64>)>, SpectrumError> {
    let mut all = Vec::new();
    SegmentPower::new(x.len(), segments)?.push(x, |index, power| all.push((index, power.to_vec())));
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_tones_power_is_half_its_amplitude_squared() {
        let x: Vec<f64> =
            (0..60_000).map(|i| 5.0 * (TAU * 72.0 * f64::from(i) / 1e4).sin()).collect();
        let s = welch(&x, &Segments::new(10_000.0, 4096)).expect("a spectrum");
        let power: f64 = s.power.iter().sum::<f64>() * s.frequency[1];
        assert!((power - 12.501).abs() < 0.002, "{power}");
    }

    #[test]
    fn impossible_input_is_refused_with_a_reason() {
        let segments = Segments::new(1.0, 8);
        assert!(matches!(welch(&[1.0], &segments), Err(SpectrumError::TooShort { .. })));
        assert!(matches!(csd(&[1.0; 9], &[1.0; 8], &segments), Err(SpectrumError::Unequal { .. })));
        let bad = Segments { overlap: 8, ..segments };
        assert!(matches!(welch(&[1.0; 9], &bad), Err(SpectrumError::Segments { .. })));
        assert!(welch(&[1.0; 9], &Segments { rate: f64::NAN, ..segments }).is_err());
    }

    proptest! {
        #[test]
        fn parseval_holds_for_even_and_odd_lengths(
            x in proptest::collection::vec(-3.0..3.0_f64, 2..200)
        ) {
            let whole = Segments {
                detrend: Detrend::None,
                taper: Taper::Boxcar,
                ..Segments::new(2.0, x.len().max(2))
            };
            let s = welch(&x, &whole).expect("a spectrum");
            let mean_square = x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64;
            let power = s.power.iter().sum::<f64>() * 2.0 / x.len() as f64;
            prop_assert!((power - mean_square).abs() < 1e-12 * (1.0 + mean_square));
        }

        #[test]
        fn coherence_of_a_signal_with_its_filtered_self_is_one(k in 0.1..5.0_f64) {
            let x: Vec<f64> = (0..512).map(|i| (f64::from(i * i) * 0.013).sin()).collect();
            let y: Vec<f64> = x.iter().map(|x| k * x).collect();
            let c = coherence(&x, &y, &Segments::new(1.0, 64)).expect("a coherence");
            prop_assert!(c.power.iter().skip(1).all(|c| (c - 1.0).abs() < 1e-9));
        }
    }
}
