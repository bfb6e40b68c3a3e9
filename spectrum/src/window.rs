//! The Hann window and its scale factors.
//!
//! Periodic windows, as required for spectra, not symmetric ones.

use std::f64::consts::TAU;

/// Periodic Hann window of `n` points: `0.5 − 0.5 cos(2πi/n)`.
#[must_use]
pub fn hann(n: usize) -> Vec<f64> {
    (0..n).map(|i| 0.5 - 0.5 * (TAU * i as f64 / n as f64).cos()).collect()
}

/// Factor from `|X|` to the amplitude of a tone in the middle of its bin: `2 / Σw`.
#[must_use]
pub fn amplitude_scale(window: &[f64]) -> f64 {
    2.0 / window.iter().sum::<f64>()
}

/// Factor from `|X|²` to one-sided power density, unit²/Hz: `2 / (f_s Σw²)`. The first bin, and
/// for even length the last, take half of it: they have no mirror image.
#[must_use]
pub fn density_scale(window: &[f64], rate_hz: f64) -> f64 {
    2.0 / (rate_hz * window.iter().map(|w| w * w).sum::<f64>())
}

/// Gain of a Hann window for a tone `cells` away from the centre of the bin (1 at 0): `sinc(δ) / (1
/// − δ²)`. One cell is the rate divided by the number of samples of the window.
#[must_use]
pub(crate) fn hann_response(cells: f64) -> f64 {
    let delta = cells.abs();
    if delta < 1e-6 {
        1.0
    } else if (delta - 1.0).abs() < 1e-6 {
        0.5
    } else {
        let x = std::f64::consts::PI * delta;
        x.sin() / x / (1.0 - delta * delta)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_is_periodic_and_its_sums_are_known() {
        let w = hann(64);
        assert!(w[0].abs() < 1e-15 && (w[32] - 1.0).abs() < 1e-15);
        assert!((amplitude_scale(&w) - 2.0 / 32.0).abs() < 1e-15);
        assert!((density_scale(&w, 10.0) - 2.0 / (10.0 * 24.0)).abs() < 1e-15);
    }

    #[test]
    fn a_tone_between_two_bins_loses_1_42_db() {
        let db = 20.0 * hann_response(0.5).log10();
        assert!((db + 1.4236).abs() < 1e-3, "{db}");
    }
}
