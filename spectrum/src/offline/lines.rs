//! The lines of an averaged spectrum: narrow peaks that stand over their surroundings.
//!
//! A peak counts where its power is over the medians beside it by more than noise of as many averages would
//! reach once in a million bins (chi-squared, Wilson and Hilferty's approximation). Frequency: parabola through the
//! logarithms; amplitude: power within the window's main lobe. Holds for Hann-windowed spectra of signals that last.

use crate::welch::{Segments, Spectrum, SpectrumError, waterfall};

/// Bins on each side whose medians make the floor.
const AROUND: usize = 24;
/// Bins on each side that hold a tone's power under a Hann window.
const LOBE: usize = 3;
/// However many averages there are, a peak below twice its surroundings is no line.
const LEAST_RATIO: f64 = 2.0;
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

/// A spectrum averaged over the segments of one run of samples or several, and the segments.
#[derive(Clone, Debug, PartialEq)]
pub struct Averaged {
    /// The mean of the segments.
    pub mean: Spectrum,
    segments: Vec<Vec<f64>>,
}

impl Averaged {
    /// Averages all segments of all runs; runs that are shorter than a segment are left out.
    ///
    /// # Errors
    /// Segments that cannot be, or no run as long as one.
    pub fn of<'a>(
        runs: impl IntoIterator<Item = &'a [f64]>,
        plan: &Segments,
    ) -> Result<Self, SpectrumError> {
        let mut segments = Vec::new();
        let mut longest = 0;
        for run in runs {
            longest = longest.max(run.len());
            if run.len() >= plan.length {
                segments.extend(waterfall(run, plan)?.into_iter().map(|(_, power)| power));
            }
        }
        if segments.is_empty() {
            return Err(SpectrumError::TooShort { samples: longest });
        }
        let count = segments.len() as f64;
        let bins = segments.iter().map(Vec::len).min().unwrap_or(0);
        let power = (0..bins).map(|bin| segments.iter().map(|s| s[bin]).sum::<f64>() / count);
        let step = plan.rate / plan.length as f64;
        let mean = Spectrum {
            power: power.collect(),
            frequency: (0..bins).map(|bin| bin as f64 * step).collect(),
            averages: segments.len(),
        };
        Ok(Self { mean, segments })
    }

    /// The lines of a power density under a Hann window, strongest first.
    #[must_use]
    pub fn lines(&self) -> Vec<Line> {
        let power = &self.mean.power;
        let step = self.mean.frequency.get(1).copied().unwrap_or(0.0);
        let mut found: Vec<(usize, Line)> = Vec::new();
        for at in FIRST_BIN + LOBE + 2..power.len().saturating_sub(LOBE + 2) {
            let is_peak = power[at - 2..at + 3].iter().all(|p| *p <= power[at]) && power[at] > 0.0;
            if !is_peak {
                continue;
            }
            let line = measured(power, at, step, floor(power, at));
            if line.ratio >= LEAST_RATIO && line.ratio >= least_ratio(self.averages_at(at)) {
                found.push((at, line));
            }
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

    /// How many of the segments the noise beside a bin comes from: where a part of the recording is louder, few count.
    fn averages_at(&self, at: usize) -> f64 {
        let reach = reach(self.mean.power.len(), at);
        let beside = |segment: &Vec<f64>| -> f64 {
            let left = &segment[at - reach..at - LOBE];
            left.iter().chain(&segment[at + LOBE + 1..at + reach + 1]).sum()
        };
        let (sum, squares) = self
            .segments
            .iter()
            .map(beside)
            .fold((0.0, 0.0), |(sum, squares), p| (sum + p, squares + p * p));
        if squares > 0.0 { sum * sum / squares } else { 1.0 }
    }
}

/// The strongest peak within `reach` of a frequency, whether or not it stands over its surroundings; `None` outside the
/// spectrum.
#[must_use]
pub fn line_near(spectrum: &Spectrum, frequency: f64, reach: f64) -> Option<Line> {
    let power = &spectrum.power;
    let step = *spectrum.frequency.get(1)?;
    let inside = |at: &usize| (*at as f64 * step - frequency).abs() <= reach + 0.5 * step;
    let at = (1 + LOBE..power.len().saturating_sub(LOBE + 1))
        .filter(inside)
        .max_by(|a, b| power[*a].total_cmp(&power[*b]))?;
    let floor = if at >= FIRST_BIN + LOBE + 2 && at + LOBE + 2 < power.len() {
        floor(power, at)
    } else {
        0.0
    };
    Some(measured(power, at, step, floor))
}

/// The line whose peak stands at a bin.
fn measured(power: &[f64], at: usize, step: f64, floor: f64) -> Line {
    let lobe = &power[at - LOBE..at + LOBE + 1];
    let over = lobe.iter().map(|p| (p - floor).max(0.0)).sum::<f64>() * step;
    Line {
        frequency: (at as f64 + offset(power, at)) * step,
        amplitude: (2.0 * over).sqrt(),
        ratio: power[at] / floor.max(1e-300),
    }
}

/// The floor at a bin: the geometric mean of the medians on both sides, equally wide, so that a slope does not count;
/// the larger of them where they rest on few bins.
fn floor(power: &[f64], at: usize) -> f64 {
    let reach = reach(power.len(), at);
    let [left, right] =
        [&power[at - reach..at - LOBE], &power[at + LOBE + 1..at + reach + 1]].map(|side| {
            let mut side = side.to_vec();
            let middle = side.len() / 2;
            *side.select_nth_unstable_by(middle, f64::total_cmp).1
        });
    if reach < AROUND / 2 { left.max(right) } else { (left * right).sqrt() }
}

/// Bins on each side that tell of the noise beside a bin.
fn reach(bins: usize, at: usize) -> usize {
    AROUND.min(at - FIRST_BIN).min(bins - 1 - at)
}

/// Power over median that noise reaches once in a million bins, for so many averages.
///
/// Half-overlapping Hann segments are worth 0.9 of as many that share nothing beyond the first.
fn least_ratio(averages: f64) -> f64 {
    let freedom = 2.0 * (1.0 + 0.9 * (averages.max(1.0) - 1.0));
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
