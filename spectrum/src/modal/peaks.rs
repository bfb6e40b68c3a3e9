//! Peaks of a receptance, the criteria for modes, and the half-power bandwidth. No fit.

use super::MeasuredReceptance;
use crate::floor::median;
use realfft::num_complex::Complex;

/// Least ratio of a peak of the imaginary part to the median around it.
const PROMINENCE_MIN: f64 = 2.0;
/// Range of the median around a peak on either side: in half widths, and the smallest number of
/// bins.
const BACKGROUND_HALF_WIDTHS: usize = 8;
const BACKGROUND_BINS_MIN: usize = 12;
/// Limit on the number of peaks, the most prominent first.
const PEAKS_MAX: usize = 64;

/// A peak of the imaginary part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peak {
    pub(super) frequency_hz: f64,
    /// Half-power half width, Hz, at least one bin.
    pub(super) half_width_hz: f64,
    /// Whether the real part changes sign at the peak: the third criterion, besides peak and
    /// coherence.
    pub(super) changes_sign: bool,
    /// The imaginary part over the median around it.
    pub(super) prominence: f64,
    /// Acceleration per force at the peak, up to a factor; equal for all modes of equal damping and
    /// mass.
    pub(super) accelerance: f64,
}

impl Peak {
    /// Start value of the pole: frequency and half width, Hz.
    pub(super) fn start_value_hz(&self) -> Complex<f64> {
        Complex::new(self.frequency_hz, self.half_width_hz)
    }

    /// Whether a mode at this frequency is within 1.5 half widths of the peak.
    pub(super) fn is_at(&self, frequency_hz: f64) -> bool {
        (frequency_hz - self.frequency_hz).abs() <= 1.5 * self.half_width_hz
    }
}

/// Peaks of the imaginary part within a band with sufficient coherence: first those with a sign
/// change of the real part, then by descending prominence.
pub(super) fn find_coherent_peaks(
    measured: &MeasuredReceptance<'_>,
    band_hz: [f64; 2],
    least_coherence: f64,
) -> Vec<Peak> {
    let MeasuredReceptance { frequency_hz, receptance, coherence, .. } = *measured;
    let im = |i: usize| receptance[i].im.abs();
    let bin_hz = measured.bin_hz();
    let mut found: Vec<Peak> = Vec::new();
    let inner = receptance.len().saturating_sub(1);
    for (i, f_hz) in frequency_hz.iter().enumerate().take(inner).skip(2) {
        let inside = (band_hz[0]..=band_hz[1]).contains(f_hz);
        let coherent = coherence.is_none_or(|c| c.get(i).is_some_and(|c| *c >= least_coherence));
        if !(inside && coherent && im(i) > im(i - 1) && im(i) >= im(i + 1)) {
            continue;
        }
        let width = half_width(receptance, i);
        let prominence = im(i) / background_level(receptance, i, width);
        if prominence >= PROMINENCE_MIN {
            found.push(Peak {
                frequency_hz: *f_hz,
                half_width_hz: width as f64 * bin_hz,
                changes_sign: changes_sign(receptance, i, width),
                prominence,
                accelerance: receptance[i].norm() * f_hz * f_hz,
            });
        }
    }
    let rank = |a: &Peak, b: &Peak| b.prominence.total_cmp(&a.prominence);
    found.sort_by(|a, b| b.changes_sign.cmp(&a.changes_sign).then(rank(a, b)));
    found.truncate(PEAKS_MAX);
    found
}

/// The median of the absolute imaginary part around a peak.
fn background_level(receptance: &[Complex<f64>], peak: usize, width: usize) -> f64 {
    let reach = (BACKGROUND_HALF_WIDTHS * width).max(BACKGROUND_BINS_MIN);
    let (low, high) = (peak.saturating_sub(reach).max(1), (peak + reach + 1).min(receptance.len()));
    let mut beside: Vec<f64> = (low..high)
        .filter(|i| i.abs_diff(peak) > 2 * width)
        .map(|i| receptance[i].im.abs())
        .collect();
    median(&mut beside).max(f64::MIN_POSITIVE)
}

/// Number of bins from a peak to half of its power, on the nearer side; at least 1.
fn half_width(receptance: &[Complex<f64>], peak: usize) -> usize {
    let half = 0.5 * receptance[peak].norm_sqr();
    let up = receptance[peak..].iter().take_while(|h| h.norm_sqr() > half).count();
    let down = receptance[..peak].iter().rev().take_while(|h| h.norm_sqr() > half).count();
    up.min(down + 1).max(1)
}

/// Whether the real part changes sign within the peak's width.
fn changes_sign(receptance: &[Complex<f64>], peak: usize, width: usize) -> bool {
    let run = &receptance[peak.saturating_sub(width)..(peak + width + 1).min(receptance.len())];
    run.windows(2).any(|pair| pair[0].re * pair[1].re <= 0.0)
}

/// Index of the nearest frequency.
pub(super) fn nearest_bin(frequency_hz: &[f64], wanted_hz: f64) -> usize {
    let above = frequency_hz.partition_point(|f| *f < wanted_hz).min(frequency_hz.len().max(1) - 1);
    let distance = |i: usize| frequency_hz.get(i).map_or(f64::INFINITY, |f| (f - wanted_hz).abs());
    if above > 0 && distance(above - 1) < distance(above) { above - 1 } else { above }
}

/// Half-power bandwidth of the peak near a bin, by linear interpolation between the bins; `None` if
/// the response rises again before it has fallen to half its power.
pub(super) fn half_power_hz(
    frequency_hz: &[f64],
    receptance: &[Complex<f64>],
    index: usize,
) -> Option<f64> {
    let power: Vec<f64> = receptance.iter().map(Complex::norm_sqr).collect();
    let mut top = index.min(power.len().checked_sub(2)?).max(1);
    while top + 1 < power.len() - 1 && power[top + 1] > power[top] {
        top += 1;
    }
    while top > 1 && power[top - 1] > power[top] {
        top -= 1;
    }
    let half = 0.5 * power[top];
    // Noise may cause a small rise; a rise of a tenth of the peak is another mode.
    let crossing = |places: &mut dyn Iterator<Item = usize>| {
        let (mut last, mut minimum) = (top, power[top]);
        for i in places {
            if power[i] <= half {
                let part = (power[last] - half) / (power[last] - power[i]);
                return Some(frequency_hz[last] + part * (frequency_hz[i] - frequency_hz[last]));
            }
            minimum = minimum.min(power[i]);
            if power[i] > minimum + 0.1 * power[top] {
                return None;
            }
            last = i;
        }
        None
    };
    let above = crossing(&mut (top + 1..power.len()))?;
    let below = crossing(&mut (0..top).rev())?;
    Some(above - below)
}
