//! Form removal by a least-squares polynomial, and the Gaussian low pass of ISO 16610-21.
//!
//! The kernel is `s(x) = exp(−π (x/(α λ_c))²) / (α λ_c)`, `α = sqrt(ln 2 / π)`, 50 % at the
//! cut-off, truncated at ±`λ_c`, beyond which 7e-7 of its weight is lost. At the ends it is
//! renormalised over the available points (as ISO 16610-28 allows), so that the profile keeps its
//! length; values within half a cut-off of an end are based on little more than half a kernel.
//! Convolution by FFT.

use super::{FORM_MAX, SurfaceError, check};
use realfft::RealFftPlanner;

/// The Gaussian filter's α = sqrt(ln 2 / π).
pub const GAUSS_ALPHA: f64 = 0.469_718_639_349_825_66;

/// Amplitude transmission of the Gaussian low pass at a wavelength: `exp(−π (α λ_c/λ)²)`.
#[must_use]
pub fn gaussian_transmission(wavelength_mm: f64, cut_off_mm: f64) -> f64 {
    let x = GAUSS_ALPHA * cut_off_mm / wavelength_mm;
    (-std::f64::consts::PI * x * x).exp()
}

/// The profile filtered by the Gaussian low pass, of the same length.
///
/// # Errors
/// Invalid lengths, heights that are not finite.
pub fn gaussian(
    heights: &[f64],
    spacing_mm: f64,
    cut_off_mm: f64,
) -> Result<Vec<f64>, SurfaceError> {
    check(heights, spacing_mm)?;
    if !(cut_off_mm > spacing_mm && cut_off_mm.is_finite()) {
        return Err(SurfaceError::Length { what: "cut-off", value_mm: cut_off_mm });
    }
    let n = heights.len();
    let reach = ((cut_off_mm / spacing_mm).floor() as usize).min(n - 1);
    let weight = |k: usize| {
        let x = k as f64 * spacing_mm / (GAUSS_ALPHA * cut_off_mm);
        (-std::f64::consts::PI * x * x).exp()
    };
    let half: Vec<f64> = (0..=reach).map(weight).collect();
    // Cumulative weight of one side of the kernel, without its centre.
    let arm: Vec<f64> = half
        .iter()
        .enumerate()
        .scan(0.0, |sum, (k, w)| {
            *sum += if k == 0 { 0.0 } else { *w };
            Some(*sum)
        })
        .collect();
    // Relative to the mean, so that an offset does not increase the rounding error.
    let mean = heights.iter().sum::<f64>() / n as f64;
    let sums = convolve(heights.iter().map(|z| z - mean), n, &half);
    let whole = |i: usize| half[0] + arm[i.min(reach)] + arm[(n - 1 - i).min(reach)];
    Ok(sums.iter().enumerate().map(|(i, sum)| mean + sum / whole(i)).collect())
}

/// Convolution with a symmetric kernel, zero beyond the ends; `half` contains the kernel from its
/// centre.
fn convolve(values: impl Iterator<Item = f64>, n: usize, half: &[f64]) -> Vec<f64> {
    let padded = (n + half.len()).next_power_of_two();
    let mut planner = RealFftPlanner::new();
    let (forward, back) = (planner.plan_fft_forward(padded), planner.plan_fft_inverse(padded));
    let (mut signal, mut kernel) = (forward.make_input_vec(), forward.make_input_vec());
    signal.iter_mut().zip(values).for_each(|(to, z)| *to = z);
    for (k, w) in half.iter().enumerate() {
        kernel[k] = *w;
        kernel[(padded - k) % padded] = *w;
    }
    let (mut a, mut b) = (forward.make_output_vec(), forward.make_output_vec());
    // The lengths are those of the plans, so that no error is possible; the first and last bins of
    // a real signal remain real in the product.
    let _ = forward.process(&mut signal, &mut a);
    let _ = forward.process(&mut kernel, &mut b);
    a.iter_mut().zip(&b).for_each(|(a, b)| *a *= b);
    let _ = back.process(&mut a, &mut signal);
    signal.truncate(n);
    signal.iter_mut().for_each(|z| *z /= padded as f64);
    signal
}

/// The profile minus its least-squares polynomial: degree 0 removes the mean, 1 a line.
///
/// By polynomials orthogonal over the points (Forsythe 1957), which stay well conditioned.
///
/// # Errors
/// A degree above [`FORM_MAX`].
pub fn remove_form(heights: &[f64], degree: usize) -> Result<Vec<f64>, SurfaceError> {
    if degree > FORM_MAX {
        return Err(SurfaceError::Form { degree });
    }
    let n = heights.len();
    let place = |i: usize| (2.0 * i as f64 - (n as f64 - 1.0)) / n as f64;
    let mut residual = heights.to_vec();
    let (mut before, mut now) = (vec![0.0; n], vec![1.0; n]);
    let mut norm_before = f64::INFINITY;
    for _ in 0..=degree.min(n.saturating_sub(1)) {
        let norm: f64 = now.iter().map(|p| p * p).sum();
        let part = residual.iter().zip(&now).map(|(z, p)| z * p).sum::<f64>() / norm;
        residual.iter_mut().zip(&now).for_each(|(z, p)| *z -= part * p);
        // The points are symmetric about 0, so that the recurrence has no middle term.
        let back = norm / norm_before;
        let next = (0..n).map(|i| place(i) * now[i] - back * before[i]).collect();
        (before, now, norm_before) = (now, next, norm);
    }
    Ok(residual)
}
