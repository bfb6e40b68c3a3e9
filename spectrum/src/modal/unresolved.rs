//! Peaks that meet the criteria of a mode but are not explained by a fit, with the record length
//! that would resolve them.
//!
//! A fit needs [`BINS_MIN`](super::BINS_MIN) bins on either side of a mode. With that many bins
//! between two peaks each can be fitted by itself, which requires a record length of that number
//! over their distance; a peak without a neighbour may contain two modes, for which twice the
//! record length is stated. Only peaks that meet all three criteria are reported, outside the bands
//! of fitted modes: within them [`FittedMode::residual`] gives the misfit.

use super::{BAND_HALF_WIDTHS, BINS_MIN, FittedMode, MeasuredReceptance, peaks};
use realfft::num_complex::Complex;

/// Least prominence; peaks of noise rarely exceed it (white noise, one hit: 4 of 1000 bins).
const PROMINENCE_MIN: f64 = 6.0;
/// Least accelerance relative to the strongest peak: noise, and vibration left by previous hits,
/// cause ripples of a receptance near its modes, where the accelerance of two modes of 2 % damping
/// is 0.05 of their peaks.
const RELATIVE_SIZE_MIN: f64 = 0.2;

/// A peak that is not a fitted mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnresolvedPeak {
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// The nearest other peak within its band, Hz.
    pub neighbour_hz: Option<f64>,
    /// Length of a record that would resolve it, s.
    pub record_s: f64,
}

/// The coherent peaks of a band that were not fitted as modes, lowest first.
#[must_use]
pub fn unresolved_peaks(
    measured: &MeasuredReceptance<'_>,
    band_hz: [f64; 2],
    least_coherence: f64,
    modes: &[FittedMode],
) -> Vec<UnresolvedPeak> {
    let measured = measured.trimmed();
    let all = peaks::find_coherent_peaks(&measured, band_hz, least_coherence);
    let bin_hz = measured.bin_hz();
    let explained = |peak: &peaks::Peak| {
        let is_near = |mode: &FittedMode| {
            let half_width_hz = mode.damping * mode.frequency_hz;
            let pole_hz = Complex::new(mode.frequency_hz, half_width_hz);
            (mode.frequency_hz - peak.frequency_hz).abs()
                <= measured.reach_hz(pole_hz, BAND_HALF_WIDTHS)
        };
        modes.iter().any(is_near)
    };
    let strongest = all.iter().map(|peak| peak.accelerance).fold(0.0, f64::max);
    let unresolved_peak = |peak: &peaks::Peak| {
        let distance = |hz: f64| (hz - peak.frequency_hz).abs();
        let others = all.iter().map(|other| other.frequency_hz).filter(|hz| distance(*hz) > 0.0);
        let neighbour_hz = others
            .min_by(|a, b| distance(*a).total_cmp(&distance(*b)))
            .filter(|hz| distance(*hz) < BINS_MIN * bin_hz);
        let record_s = neighbour_hz.map_or(2.0 / bin_hz, |hz| BINS_MIN / distance(hz));
        UnresolvedPeak { frequency_hz: peak.frequency_hz, neighbour_hz, record_s }
    };
    let mut unresolved: Vec<UnresolvedPeak> = all
        .iter()
        .filter(|peak| peak.changes_sign && peak.prominence >= PROMINENCE_MIN)
        .filter(|peak| peak.accelerance >= RELATIVE_SIZE_MIN * strongest && !explained(peak))
        .map(unresolved_peak)
        .collect();
    unresolved.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    unresolved
}
