//! Surface profiles: detrend, the Gaussian filter, waviness and roughness, their parameters.
//!
//! Filter by ISO 16610-21: `s(x) = exp(−π (x/(α λ_c))²) / (α λ_c)`, `α = sqrt(ln 2 / π)`, 50 % at the
//! cut-off; the kernel is cut at ±`λ_c`, where 7e-7 of its weight is left. At the ends the kernel is
//! renormalised over what there is (as ISO 16610-28 allows), so that the profile keeps its length;
//! values within `λ_c` of an end rest on half a kernel. Parameters are about the mean line.
//! `R_q` follows from the one-sided power spectrum too (Parseval), which is how thesis 4.6 has it.

use crate::welch::{Detrend, Scaling, Segments, Spectrum, SpectrumError, Taper, detrended, welch};

/// The Gaussian filter's α = sqrt(ln 2 / π).
pub const GAUSS_ALPHA: f64 = 0.469_718_639_349_825_66;

/// A profile that cannot be analysed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// A spacing, cut-off or segment length that cannot be.
    #[error(
        "surface: {what} is {value_mm} mm, expected a finite length above 0, and the cut-off above the spacing"
    )]
    Length {
        /// Which length.
        what: &'static str,
        /// Its value, mm.
        value_mm: f64,
    },
    /// Too few points.
    #[error(
        "surface: the profile has {points} points, expected at least {expected}; give a longer profile or shorter segments"
    )]
    TooShort {
        /// Points given.
        points: usize,
        /// Points needed.
        expected: usize,
    },
    /// A height that is not a number.
    #[error("surface: height {index} is not finite; repair or cut the profile there")]
    NotFinite {
        /// Place in the profile, from 0.
        index: usize,
    },
}

/// Parameters of a profile about its mean, in the profile's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Arithmetic mean deviation (Pa, Ra, Wa).
    pub mean_deviation: f64,
    /// Root mean square (Pq, Rq, Wq).
    pub rms: f64,
    /// Highest peak to deepest valley (Pt, Rt, Wt).
    pub total_height: f64,
}

/// A profile taken apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Distance between points, mm.
    pub spacing_mm: f64,
    /// What the filter passes: longer than the cut-off.
    pub waviness: Vec<f64>,
    /// What is left: shorter than the cut-off.
    pub roughness: Vec<f64>,
}

/// Parameters of one profile.
#[must_use]
pub fn parameters(heights: &[f64]) -> Parameters {
    let n = heights.len().max(1) as f64;
    let mean = heights.iter().sum::<f64>() / n;
    let (low, high) = heights
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(*z), high.max(*z)));
    Parameters {
        mean_deviation: heights.iter().map(|z| (z - mean).abs()).sum::<f64>() / n,
        rms: (heights.iter().map(|z| (z - mean) * (z - mean)).sum::<f64>() / n).sqrt(),
        total_height: if heights.is_empty() { 0.0 } else { high - low },
    }
}

/// The part of a wavelength's amplitude that the Gaussian low pass keeps: `exp(−π (α λ_c/λ)²)`.
#[must_use]
pub fn gaussian_transmission(wavelength_mm: f64, cut_off_mm: f64) -> f64 {
    let x = GAUSS_ALPHA * cut_off_mm / wavelength_mm;
    (-std::f64::consts::PI * x * x).exp()
}

/// The profile behind the Gaussian low pass, of the same length.
///
/// # Errors
/// Lengths that cannot be, heights that are not finite.
pub fn gaussian(
    heights: &[f64],
    spacing_mm: f64,
    cut_off_mm: f64,
) -> Result<Vec<f64>, SurfaceError> {
    check(heights, spacing_mm)?;
    if !(cut_off_mm > spacing_mm && cut_off_mm.is_finite()) {
        return Err(SurfaceError::Length { what: "cut-off", value_mm: cut_off_mm });
    }
    let reach = ((cut_off_mm / spacing_mm).floor() as usize).min(heights.len());
    let weight = |k: usize| {
        let x = k as f64 * spacing_mm / (GAUSS_ALPHA * cut_off_mm);
        (-std::f64::consts::PI * x * x).exp()
    };
    let half: Vec<f64> = (0..=reach).map(weight).collect();
    let smooth = |i: usize| {
        let (mut sum, mut weights) = (half[0] * heights[i], half[0]);
        for (k, w) in half.iter().enumerate().skip(1) {
            if let Some(left) = i.checked_sub(k) {
                sum += w * heights[left];
                weights += w;
            }
            if let Some(right) = heights.get(i + k) {
                sum += w * right;
                weights += w;
            }
        }
        sum / weights
    };
    Ok((0..heights.len()).map(smooth).collect())
}

/// Takes the line of least squares out and parts waviness from roughness at the cut-off.
///
/// # Errors
/// Lengths that cannot be, heights that are not finite.
pub fn part(heights: &[f64], spacing_mm: f64, cut_off_mm: f64) -> Result<Surface, SurfaceError> {
    check(heights, spacing_mm)?;
    let level = detrended(heights, Detrend::Linear);
    let waviness = gaussian(&level, spacing_mm, cut_off_mm)?;
    let roughness = level.iter().zip(&waviness).map(|(z, w)| z - w).collect();
    Ok(Surface { spacing_mm, waviness, roughness })
}

/// Parameters of each whole segment of a profile, as the thesis' tables 4.1 (2.5 mm, waviness) and
/// 4.2 (0.25 mm, roughness) have them.
///
/// # Errors
/// A segment length that cannot be, or longer than the profile.
pub fn by_segments(
    heights: &[f64],
    spacing_mm: f64,
    segment_mm: f64,
) -> Result<Vec<Parameters>, SurfaceError> {
    check(heights, spacing_mm)?;
    if !(segment_mm > spacing_mm && segment_mm.is_finite()) {
        return Err(SurfaceError::Length { what: "segment", value_mm: segment_mm });
    }
    let points = (segment_mm / spacing_mm).round() as usize;
    if points > heights.len() {
        return Err(SurfaceError::TooShort { points: heights.len(), expected: points });
    }
    Ok(heights.chunks_exact(points).map(parameters).collect())
}

/// One-sided power over cycles per mm of a whole profile, without window: its sum is `R_q²` (mean taken
/// out).
///
/// # Errors
/// A profile too short.
pub fn power_spectrum(heights: &[f64], spacing_mm: f64) -> Result<Spectrum, SpectrumError> {
    let whole = Segments {
        detrend: Detrend::Constant,
        taper: Taper::Boxcar,
        scaling: Scaling::Spectrum,
        ..Segments::new(1.0 / spacing_mm, heights.len().max(2))
    };
    welch(heights, &whole)
}

fn check(heights: &[f64], spacing_mm: f64) -> Result<(), SurfaceError> {
    if !(spacing_mm > 0.0 && spacing_mm.is_finite()) {
        return Err(SurfaceError::Length { what: "spacing", value_mm: spacing_mm });
    }
    if heights.len() < 8 {
        return Err(SurfaceError::TooShort { points: heights.len(), expected: 8 });
    }
    heights
        .iter()
        .position(|z| !z.is_finite())
        .map_or(Ok(()), |index| Err(SurfaceError::NotFinite { index }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn the_filter_passes_each_wavelength_as_the_standard_says() {
        for (wavelength_mm, kept) in
            [(0.25, 0.000_827), (0.8, 0.5), (2.5, 0.931_482), (8.0, 0.993_093)]
        {
            let z: Vec<f64> =
                (0..8000).map(|i| (TAU * f64::from(i) * 0.005 / wavelength_mm).sin()).collect();
            let w = gaussian(&z, 0.005, 0.8).expect("a filter");
            let inner = 1600..6400;
            let dot = |a: &[f64]| inner.clone().map(|i| a[i] * z[i]).sum::<f64>();
            let passed = dot(&w) / dot(&z);
            assert!((passed - kept).abs() < 3e-5, "{wavelength_mm} mm: {passed}");
            assert!((gaussian_transmission(wavelength_mm, 0.8) - kept).abs() < 2e-6);
        }
    }

    #[test]
    fn the_filter_keeps_a_constant_to_the_ends() {
        let w = gaussian(&[2.5; 100], 0.01, 0.2).expect("a filter");
        assert!(w.iter().all(|w| (w - 2.5).abs() < 1e-12));
    }

    #[test]
    fn waviness_and_roughness_are_parted_and_add_up() {
        let z: Vec<f64> = (0..10_000)
            .map(|i| {
                let x = 0.001 * f64::from(i);
                4.0 * (TAU * x / 2.5).cos() + 0.5 * (TAU * x / 0.05).sin() + 0.7 * x
            })
            .collect();
        let surface = part(&z, 0.001, 0.25).expect("a surface");
        let inner = |v: &[f64]| parameters(&v[1000..9000]);
        assert!((inner(&surface.roughness).rms - 0.5 / 2.0_f64.sqrt()).abs() < 0.05);
        assert!((inner(&surface.waviness).total_height - 8.0).abs() < 0.6);
        let line = detrended(&z, Detrend::Linear);
        for ((w, r), z) in surface.waviness.iter().zip(&surface.roughness).zip(&line) {
            assert!((w + r - z).abs() < 1e-12);
        }
    }

    #[test]
    fn parseval_gives_the_same_rms() {
        for n in [500, 501] {
            let z: Vec<f64> = (0..n).map(|i| (f64::from(i * i) * 0.01).sin() + 0.3).collect();
            let power: f64 = power_spectrum(&z, 0.01).expect("a spectrum").power.iter().sum();
            assert!((power.sqrt() - parameters(&z).rms).abs() < 1e-12);
        }
    }

    #[test]
    fn impossible_profiles_are_refused_with_a_reason() {
        assert!(matches!(part(&[0.0; 4], 0.1, 1.0), Err(SurfaceError::TooShort { .. })));
        assert!(matches!(
            part(&[f64::NAN; 9], 0.1, 1.0),
            Err(SurfaceError::NotFinite { index: 0 })
        ));
        assert!(part(&[0.0; 9], 0.0, 1.0).is_err());
        assert!(part(&[0.0; 9], 0.1, 0.05).is_err());
        assert!(by_segments(&[0.0; 9], 0.1, 5.0).is_err());
    }
}
