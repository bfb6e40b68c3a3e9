//! Peaks that look like modes and that no fit explains, with the record length that would resolve them.
//!
//! A fit needs [`BINS_LEAST`](super::BINS_LEAST) bins to either side of a mode. With that many bins
//! between two peaks each can be fitted by itself, which requires a record length of that number
//! over their distance; a peak without a neighbour may contain two modes, for which twice the
//! record length is stated. Only peaks with all three signs are reported, outside the bands of
//! fitted modes: within them [`FittedMode::residual`] gives the misfit.

use super::{BINS_LEAST, FittedMode, Measured, REACH, peaks};
use realfft::num_complex::Complex;

/// Peaks of noise rarely exceed their surroundings by this factor (white noise of one hit: four in
/// a thousand bins).
const PROMINENCE: f64 = 6.0;
/// Peaks below this share of the strongest, as accelerance, are not reported: noise, and vibration
/// left by previous hits, cause ripples of a receptance near its modes, where the accelerance of
/// two modes of 2 % damping is 0.05 of their peaks.
const SIZE: f64 = 0.2;

/// A peak that is not a fitted mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unresolved {
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// The nearest other peak within its band, Hz.
    pub beside_hz: Option<f64>,
    /// Length of a record that would resolve it, s.
    pub record_s: f64,
}

/// The coherent peaks of a band that were not fitted as modes, lowest first.
#[must_use]
pub fn unresolved(
    measured: &Measured<'_>,
    band_hz: [f64; 2],
    least_coherence: f64,
    modes: &[FittedMode],
) -> Vec<Unresolved> {
    let measured = measured.trimmed();
    let all = peaks::coherent(&measured, band_hz, least_coherence);
    let bin_hz = measured.bin_hz();
    let explained = |peak: &peaks::Peak| {
        let near = |mode: &FittedMode| {
            let half_width_hz = mode.damping * mode.frequency_hz;
            let pole_hz = Complex::new(mode.frequency_hz, half_width_hz);
            (mode.frequency_hz - peak.frequency_hz).abs() <= measured.reach_hz(pole_hz, REACH)
        };
        modes.iter().any(near)
    };
    let strongest = all.iter().map(|peak| peak.accelerance).fold(0.0, f64::max);
    let told = |peak: &peaks::Peak| {
        let distance = |hz: f64| (hz - peak.frequency_hz).abs();
        let others = all.iter().map(|other| other.frequency_hz).filter(|hz| distance(*hz) > 0.0);
        let beside_hz = others
            .min_by(|a, b| distance(*a).total_cmp(&distance(*b)))
            .filter(|hz| distance(*hz) < BINS_LEAST * bin_hz);
        let record_s = beside_hz.map_or(2.0 / bin_hz, |hz| BINS_LEAST / distance(hz));
        Unresolved { frequency_hz: peak.frequency_hz, beside_hz, record_s }
    };
    let mut left: Vec<Unresolved> = all
        .iter()
        .filter(|peak| peak.changes_sign && peak.prominence >= PROMINENCE)
        .filter(|peak| peak.accelerance >= SIZE * strongest && !explained(peak))
        .map(told)
        .collect();
    left.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    left
}
