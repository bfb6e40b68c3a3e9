//! The lines of an averaged spectrum: narrow peaks that stand over their surroundings.
//!
//! A peak counts where its power is over the medians beside it by more than noise of that many averages would
//! reach once in a million bins (chi-squared, Wilson and Hilferty's approximation). Frequency: parabola through the
//! logarithms; amplitude: power within the window's main lobe. Holds for Hann-windowed spectra of signals that last.

use crate::welch::Spectrum;

/// Bins on each side whose medians make the floor.
const AROUND: usize = 24;
/// Bins on each side that hold a tone's power under a Hann window.
const LOBE: usize = 3;
/// Normal quantile of one in a million.
const ONE_IN_A_MILLION: f64 = 4.753;
/// The lowest bins hold what is left of a trend.
const FIRST_BIN: usize = 2;
/// A weaker peak with less than this part of a stronger one's power, over the square of their distance in bins, was
/// spilt by it: a tone that does not last the whole segment leaks so.
const SPILT: f64 = 0.05;

/// A line of a spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Frequency, cycles per unit of the spectrum.
    pub frequency: f64,
    /// Amplitude (not rms) of a tone with this power; over a record that holds it for a part only, less than it had.
    pub amplitude: f64,
    /// Power over floor.
    pub ratio: f64,
}

/// The lines of a power density under a Hann window, strongest first.
#[must_use]
pub fn lines(spectrum: &Spectrum) -> Vec<Line> {
    let power = &spectrum.power;
    let step = spectrum.frequency.get(1).copied().unwrap_or(0.0);
    let least = least_ratio(spectrum.averages);
    let mut found: Vec<(usize, Line)> = Vec::new();
    for at in FIRST_BIN + LOBE + 2..power.len().saturating_sub(LOBE + 2) {
        let around = at - 2..at + 3;
        let is_peak = power[around].iter().all(|p| *p <= power[at]) && power[at] > 0.0;
        if !is_peak {
            continue;
        }
        let floor = floor(power, at);
        let ratio = power[at] / floor.max(1e-300);
        if ratio < least {
            continue;
        }
        let lobe = at - LOBE..at + LOBE + 1;
        let over = power[lobe].iter().map(|p| (p - floor).max(0.0)).sum::<f64>() * step;
        let frequency = (at as f64 + offset(power, at)) * step;
        found.push((at, Line { frequency, amplitude: (2.0 * over).sqrt(), ratio }));
    }
    let spilt = |at: usize, by: usize| {
        let bins = at.abs_diff(by) as f64;
        power[by] > power[at] && power[at] * bins * bins < SPILT * power[by]
    };
    let own = |at: usize| !found.iter().any(|(by, _)| spilt(at, *by));
    let mut lines: Vec<Line> =
        found.iter().filter(|(at, _)| own(*at)).map(|(_, line)| *line).collect();
    lines.sort_by(|a, b| b.amplitude.total_cmp(&a.amplitude));
    lines
}

/// The floor at a bin: the geometric mean of the medians on both sides, equally wide, so that a slope does not count;
/// the larger of them where they rest on few bins.
fn floor(power: &[f64], at: usize) -> f64 {
    let reach = AROUND.min(at - FIRST_BIN).min(power.len() - 1 - at);
    let [left, right] =
        [&power[at - reach..at - LOBE], &power[at + LOBE + 1..at + reach + 1]].map(|side| {
            let mut side = side.to_vec();
            let middle = side.len() / 2;
            *side.select_nth_unstable_by(middle, f64::total_cmp).1
        });
    if reach < AROUND / 2 { left.max(right) } else { (left * right).sqrt() }
}

/// Power over median that noise reaches once in a million bins, for so many averages.
///
/// Half-overlapping Hann segments are worth 0.9 of as many that share nothing beyond the first.
fn least_ratio(averages: usize) -> f64 {
    let freedom = 2.0 * (1.0 + 0.9 * (averages.max(1) - 1) as f64);
    let spread = 2.0 / (9.0 * freedom);
    let quantile = |z: f64| (1.0 - spread + z * spread.sqrt()).powi(3);
    quantile(ONE_IN_A_MILLION) / quantile(0.0)
}

/// Where the peak stands between the bins, in bins.
fn offset(power: &[f64], at: usize) -> f64 {
    let log = |i: usize| power.get(i).map_or(f64::MIN_POSITIVE, |p| p.max(1e-300)).ln();
    let (left, mid, right) = (log(at - 1), log(at), log(at + 1));
    let bend = left - 2.0 * mid + right;
    if bend < 0.0 { (0.5 * (left - right) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}
