//! Natural frequencies and damping from a receptance.
//!
//! A mode is where three signs meet: the imaginary part peaks, the real part changes sign beside it,
//! and the coherence (where there is one) exceeds 0.75 (thesis 4.8 to 4.19). Frequency and damping are
//! then fitted: `H(ω)(ω_n² − ω² + 2jζω_nω)` = polynomial, by linear least squares over the mode's band,
//! reweighted twice (Levy 1959; Sanathanan and Koerner 1963). The quadratic polynomial takes up what
//! the neighbours leave. Holds for viscous damping up to about 0.2 and modes further apart than their
//! bandwidth; closer ones give one fit with a large residual.

use crate::config::Mode;
use realfft::num_complex::Complex;

/// Least coherence at a mode.
pub const LEAST_COHERENCE: f64 = 0.75;
/// Unknowns of the fit: two of the denominator, three complex ones of the polynomial.
const UNKNOWNS: usize = 8;
/// Beyond this the band's half width, as a part of the frequency, is not widened.
const WIDEST: f64 = 0.15;

/// A fitted mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedMode {
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio.
    pub damping: f64,
    /// Receptance at resonance, m/N.
    pub peak: Complex<f64>,
    /// Root mean square of what the fit leaves, over that of the receptance in its band.
    pub residual: f64,
}

impl FittedMode {
    /// As an entry of the model's modal list, moving along `direction`.
    #[must_use]
    pub fn as_mode(&self, direction: [f64; 3]) -> Mode {
        Mode { frequency_hz: self.frequency_hz, damping: self.damping, direction }
    }
}

/// Finds and fits the modes of a receptance within a band, lowest first. `prominence` is how many
/// times a peak of the imaginary part must exceed its middle over the band, 3 or so.
///
/// `frequency_hz`, `receptance` and, where given, `coherence` belong together; the shortest counts.
#[must_use]
pub fn modes(
    frequency_hz: &[f64],
    receptance: &[Complex<f64>],
    coherence: Option<&[f64]>,
    band_hz: [f64; 2],
    prominence: f64,
) -> Vec<FittedMode> {
    let n = frequency_hz.len().min(receptance.len());
    let within = |i: &usize| (band_hz[0]..=band_hz[1]).contains(&frequency_hz[*i]);
    let bins: Vec<usize> = (1..n.saturating_sub(1)).filter(within).collect();
    let mut sizes: Vec<f64> = bins.iter().map(|&i| receptance[i].im.abs()).collect();
    let middle = crate::floor::middle(&mut sizes);
    let seen =
        |i: &usize| coherence.is_none_or(|c| c.get(*i).is_some_and(|c| *c > LEAST_COHERENCE));
    let mut found: Vec<FittedMode> = Vec::new();
    for i in bins.into_iter().filter(seen) {
        let im = |k: usize| receptance[k].im.abs();
        let is_peak = im(i) > im(i - 1) && im(i) >= im(i + 1) && im(i) > prominence * middle;
        if !is_peak || !changes_sign(&receptance[..n], i) {
            continue;
        }
        let Some(mode) = fit(&frequency_hz[..n], &receptance[..n], i) else { continue };
        let is_new = found.last().is_none_or(|last| {
            (mode.frequency_hz - last.frequency_hz).abs() > last.damping * last.frequency_hz
        });
        if is_new && mode.residual < 0.3 {
            found.push(mode);
        }
    }
    found
}

/// The half width at half of the squared peak, in bins to either side.
fn half_width(receptance: &[Complex<f64>], peak: usize) -> usize {
    let half = 0.5 * receptance[peak].norm_sqr();
    let up = receptance[peak..].iter().take_while(|h| h.norm_sqr() > half).count();
    let down = receptance[..peak].iter().rev().take_while(|h| h.norm_sqr() > half).count();
    up.min(down + 1).max(2)
}

/// Whether the real part changes sign within the peak's width.
fn changes_sign(receptance: &[Complex<f64>], peak: usize) -> bool {
    let width = half_width(receptance, peak);
    let run = &receptance[peak.saturating_sub(width)..(peak + width + 1).min(receptance.len())];
    run.windows(2).any(|pair| pair[0].re * pair[1].re <= 0.0)
}

fn fit(frequency_hz: &[f64], receptance: &[Complex<f64>], peak: usize) -> Option<FittedMode> {
    let widest = frequency_hz.partition_point(|f| *f < (1.0 + WIDEST) * frequency_hz[peak]) - peak;
    let reach = (2 * half_width(receptance, peak)).clamp(6, widest.max(6));
    let band = peak.saturating_sub(reach)..(peak + reach + 1).min(receptance.len());
    if band.len() < UNKNOWNS {
        return None;
    }
    let centre = frequency_hz[peak];
    let size = receptance[peak].norm();
    // Frequencies in units of the peak's, receptance in units of its size: well scaled.
    let points: Vec<(f64, Complex<f64>)> =
        band.map(|i| (frequency_hz[i] / centre, receptance[i] / size)).collect();
    let mut weights = vec![1.0; points.len()];
    let mut unknowns = [0.0; UNKNOWNS];
    for _ in 0..3 {
        unknowns = least_squares(&points, &weights)?;
        for (weight, (u, _)) in weights.iter_mut().zip(&points) {
            *weight = 1.0 / denominator(&unknowns, *u).norm().max(1e-9);
        }
    }
    let [a, b, ..] = unknowns;
    if !(a > 0.0 && b > 0.0) {
        return None;
    }
    let left: f64 = points.iter().map(|(u, h)| (model(&unknowns, *u) - h).norm_sqr()).sum();
    let whole: f64 = points.iter().map(|(_, h)| h.norm_sqr()).sum();
    Some(FittedMode {
        frequency_hz: centre * a.sqrt(),
        damping: 0.5 * b / a.sqrt(),
        peak: receptance[peak],
        residual: (left / whole).sqrt(),
    })
}

fn denominator(unknowns: &[f64; UNKNOWNS], u: f64) -> Complex<f64> {
    Complex::new(unknowns[0] - u * u, unknowns[1] * u)
}

fn model(unknowns: &[f64; UNKNOWNS], u: f64) -> Complex<f64> {
    let v = u - 1.0;
    let part = |k: usize| unknowns[k] + unknowns[k + 1] * v + unknowns[k + 2] * v * v;
    Complex::new(part(2), part(5)) / denominator(unknowns, u)
}

/// H (a − u² + j b u) = p(u): linear in a, b and the polynomial's six real coefficients.
fn least_squares(points: &[(f64, Complex<f64>)], weights: &[f64]) -> Option<[f64; UNKNOWNS]> {
    let mut normal = [[0.0; UNKNOWNS + 1]; UNKNOWNS];
    for ((u, h), weight) in points.iter().zip(weights) {
        let v = u - 1.0;
        let turned = Complex::new(0.0, *u) * h;
        let real = [h.re, turned.re, -1.0, -v, -v * v, 0.0, 0.0, 0.0];
        let imaginary = [h.im, turned.im, 0.0, 0.0, 0.0, -1.0, -v, -v * v];
        for (row, right) in [(real, u * u * h.re), (imaginary, u * u * h.im)] {
            for (i, x) in row.iter().enumerate() {
                for (j, y) in row.iter().enumerate() {
                    normal[i][j] += weight * weight * x * y;
                }
                normal[i][UNKNOWNS] += weight * weight * x * right;
            }
        }
    }
    solve(&mut normal)
}

/// Gauss elimination with pivoting, rows scaled first.
fn solve(m: &mut [[f64; UNKNOWNS + 1]; UNKNOWNS]) -> Option<[f64; UNKNOWNS]> {
    for row in m.iter_mut() {
        let largest = row[..UNKNOWNS].iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        for x in row.iter_mut() {
            *x /= largest.max(f64::MIN_POSITIVE);
        }
    }
    for k in 0..UNKNOWNS {
        let pivot = (k..UNKNOWNS).max_by(|&i, &j| m[i][k].abs().total_cmp(&m[j][k].abs()))?;
        m.swap(k, pivot);
        let top = m[k];
        if top[k].is_nan() || top[k].abs() <= 1e-13 {
            return None;
        }
        for row in m.iter_mut().skip(k + 1) {
            let part = row[k] / top[k];
            for (x, y) in row.iter_mut().zip(&top) {
                *x -= part * y;
            }
        }
    }
    let mut x = [0.0; UNKNOWNS];
    for k in (0..UNKNOWNS).rev() {
        let known: f64 = (k + 1..UNKNOWNS).map(|j| m[k][j] * x[j]).sum();
        x[k] = (m[k][UNKNOWNS] - known) / m[k][k];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn receptance(frequency_hz: &[f64], modes: &[(f64, f64, f64)]) -> Vec<Complex<f64>> {
        let one = |f: &f64, m: &(f64, f64, f64)| {
            let (f_n, damping, gain) = *m;
            gain / Complex::new(f_n * f_n - f * f, 2.0 * damping * f_n * f)
        };
        frequency_hz.iter().map(|f| modes.iter().map(|m| one(f, m)).sum()).collect()
    }

    #[test]
    fn two_modes_are_found_between_the_bins() {
        let f: Vec<f64> = (0..4000).map(|i| 0.5 * f64::from(i)).collect();
        let h = receptance(&f, &[(293.3, 0.02, 1.0), (1071.7, 0.033, -3.0), (1610.2, 0.01, 2.0)]);
        let found = modes(&f, &h, None, [50.0, 1900.0], 3.0);
        assert_eq!(found.len(), 3, "{found:?}");
        for (mode, (f_n, damping)) in
            found.iter().zip([(293.3, 0.02), (1071.7, 0.033), (1610.2, 0.01)])
        {
            assert!((mode.frequency_hz / f_n - 1.0).abs() < 1e-4, "{mode:?}");
            assert!((mode.damping / damping - 1.0).abs() < 1e-2, "{mode:?}");
        }
    }

    #[test]
    fn a_peak_without_coherence_is_no_mode() {
        let f: Vec<f64> = (0..2000).map(|i| 0.5 * f64::from(i)).collect();
        let h = receptance(&f, &[(300.0, 0.02, 1.0)]);
        assert!(modes(&f, &h, Some(&[0.5; 2000]), [50.0, 900.0], 3.0).is_empty());
        assert_eq!(modes(&f, &h, Some(&[0.9; 2000]), [50.0, 900.0], 3.0).len(), 1);
    }

    proptest! {
        #[test]
        fn one_mode_is_fitted_whatever_its_damping(f_n in 60.0..400.0_f64, damping in 0.005..0.1_f64) {
            let f: Vec<f64> = (0..2000).map(|i| 0.5 * f64::from(i)).collect();
            let h = receptance(&f, &[(f_n, damping, 1.0)]);
            let found = modes(&f, &h, None, [20.0, 900.0], 3.0);
            prop_assert_eq!(found.len(), 1);
            prop_assert!((found[0].frequency_hz / f_n - 1.0).abs() < 1e-4);
            prop_assert!((found[0].damping / damping - 1.0).abs() < 1e-2);
        }
    }
}
