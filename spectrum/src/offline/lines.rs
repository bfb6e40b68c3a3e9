//! The lines of an averaged spectrum: narrow peaks above the noise floor around them.
//!
//! A peak is a line if the ratio of its power to the medians around it exceeds the value that noise
//! with as many averages reaches once in a million bins (chi-squared, Wilson and Hilferty's
//! approximation). Frequency: parabola through the logarithms; amplitude: power within the window's
//! main lobe. Valid for Hann-windowed spectra of stationary signals.

use crate::welch::{SegmentPower, Segments, Spectrum, SpectrumError};

/// Number of bins on each side for the median of the floor.
const MEDIAN_BINS: usize = 24;
/// Number of bins on each side that contain the power of a tone under a Hann window.
const LOBE_BINS: usize = 3;
/// Least ratio of a line's power to the floor, for any number of averages.
const LEAST_RATIO: f64 = 2.0;
/// Normal quantile of one in a million.
const ONE_IN_A_MILLION: f64 = 4.753;
/// First bin used; lower ones contain the remainder of a trend.
const FIRST_BIN: usize = 2;
/// A peak with less than this share of the power of a stronger one, divided by the square of their
/// distance in bins, is leakage, from a tone that does not last the whole segment.
const LEAKAGE_PART: f64 = 0.05;

/// A line of a spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Frequency, cycles per unit of the spectrum.
    pub frequency: f64,
    /// Amplitude (not rms) of a tone with this power; smaller than the actual one if the tone lasts
    /// only for a part of the record.
    pub amplitude: f64,
    /// Power over floor.
    pub ratio: f64,
}

/// A spectrum averaged over the segments of one or several runs of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct AveragedSpectrum {
    /// The mean of the segments.
    pub mean: Spectrum,
    /// For each bin, sum and sum of squares over the segments of the power of its neighbours.
    neighbour_power: Vec<[f64; 2]>,
}

/// Accumulates an [`AveragedSpectrum`] from runs of samples that arrive in parts.
pub struct SpectrumAverager {
    plan: Segments,
    run: Option<SegmentPower>,
    longest: usize,
    count: usize,
    power: Vec<f64>,
    neighbour_power: Vec<[f64; 2]>,
    sums: NeighbourSums,
}

impl SpectrumAverager {
    /// An average of no segments yet.
    #[must_use]
    pub fn new(plan: Segments) -> Self {
        let bins = plan.length / 2 + 1;
        Self {
            plan,
            run: None,
            longest: 0,
            count: 0,
            power: vec![0.0; bins],
            neighbour_power: vec![[0.0; 2]; bins],
            sums: NeighbourSums::default(),
        }
    }

    /// Begins a run of `samples` samples. A run shorter than a segment is ignored.
    ///
    /// # Errors
    /// Invalid segments.
    pub fn begin(&mut self, samples: usize) -> Result<(), SpectrumError> {
        self.longest = self.longest.max(samples);
        let is_long = samples >= self.plan.length;
        self.run = is_long.then(|| SegmentPower::new(samples, &self.plan)).transpose()?;
        Ok(())
    }

    /// Adds the next samples of the run.
    pub fn push(&mut self, samples: &[f64]) {
        let Self { run: Some(run), count, power, neighbour_power, sums, .. } = self else {
            return;
        };
        run.push(samples, |_, of_segment| {
            *count += 1;
            power.iter_mut().zip(of_segment).for_each(|(sum, power)| *sum += power);
            sums.add_neighbour_power(of_segment, neighbour_power);
        });
    }

    /// The mean of all segments.
    ///
    /// # Errors
    /// No run was as long as a segment.
    pub fn finish(self) -> Result<AveragedSpectrum, SpectrumError> {
        if self.count == 0 {
            return Err(SpectrumError::TooShort { samples: self.longest });
        }
        let step = self.plan.rate / self.plan.length as f64;
        let mean = Spectrum {
            frequency: (0..self.power.len()).map(|bin| bin as f64 * step).collect(),
            power: self.power.into_iter().map(|sum| sum / self.count as f64).collect(),
            averages: self.count,
        };
        Ok(AveragedSpectrum { mean, neighbour_power: self.neighbour_power })
    }
}

/// Sums of the power over neighbouring bins.
#[derive(Default)]
struct NeighbourSums {
    /// Sums over 1, 2, 4, 8 and 16 bins, starting at each bin.
    sums_by_length: [Vec<f64>; 5],
    /// Sums over the 21 bins between [`LOBE_BINS`] and [`MEDIAN_BINS`] on one side, starting at each bin.
    side: Vec<f64>,
}

impl NeighbourSums {
    /// Adds the power of the neighbours of each bin, and its square.
    fn add_neighbour_power(&mut self, power: &[f64], to: &mut [[f64; 2]]) {
        self.sum_sides(power);
        let add = |[sum, squares]: &mut [f64; 2], value: f64| {
            *sum += value;
            *squares += value * value;
        };
        // The bins with all neighbours on both sides.
        let inner = FIRST_BIN + MEDIAN_BINS..power.len().saturating_sub(MEDIAN_BINS);
        let left = self.side.get(FIRST_BIN..).unwrap_or_default();
        let right = left.get(MEDIAN_BINS + LOBE_BINS + 1..).unwrap_or_default();
        let sums = to.get_mut(inner.clone()).unwrap_or_default();
        for (sums, (left, right)) in sums.iter_mut().zip(left.iter().zip(right)) {
            add(sums, left + right);
        }
        for bin in candidates(power.len()).filter(|bin| !inner.contains(bin)) {
            let reach = neighbour_bins(power.len(), bin);
            let left = &power[bin - reach..bin - LOBE_BINS];
            let right = &power[bin + LOBE_BINS + 1..bin + reach + 1];
            add(&mut to[bin], left.iter().chain(right).sum());
        }
    }

    /// Computes [`Self::side`]. Sums of 21 bins are composed of sums of 16, 4 and 1, because differences of running sums lose digits near a strong
    /// line.
    fn sum_sides(&mut self, power: &[f64]) {
        self.sums_by_length[0].clear();
        self.sums_by_length[0].extend_from_slice(power);
        for k in 1..self.sums_by_length.len() {
            let (done, rest) = self.sums_by_length.split_at_mut(k);
            let (half, shift) = (&done[k - 1], 1 << (k - 1));
            let shifted = half.get(shift..).unwrap_or_default();
            rest[0].clear();
            rest[0].extend(half.iter().zip(shifted).map(|(a, b)| a + b));
        }
        let [ones, _, fours, _, sixteens] = &self.sums_by_length;
        let fours = fours.get(16..).unwrap_or_default();
        let ones = ones.get(20..).unwrap_or_default();
        self.side.clear();
        let parts = sixteens.iter().zip(fours).zip(ones);
        self.side.extend(parts.map(|((sixteen, four), one)| sixteen + four + one));
    }
}

/// The bins in which a line may be found.
fn candidates(bins: usize) -> std::ops::Range<usize> {
    FIRST_BIN + LOBE_BINS + 2..bins.saturating_sub(LOBE_BINS + 2)
}

impl AveragedSpectrum {
    /// Averages all segments of all runs; runs that are shorter than a segment are ignored.
    ///
    /// # Errors
    /// Invalid segments, or no run as long as one.
    pub fn from_runs<'a>(
        runs: impl IntoIterator<Item = &'a [f64]>,
        plan: &Segments,
    ) -> Result<Self, SpectrumError> {
        let mut averaging = SpectrumAverager::new(*plan);
        for run in runs {
            averaging.begin(run.len())?;
            averaging.push(run);
        }
        averaging.finish()
    }

    /// The lines of a power density under a Hann window, strongest first.
    #[must_use]
    pub fn lines(&self) -> Vec<Line> {
        let power = &self.mean.power;
        let step = self.mean.frequency.get(1).copied().unwrap_or(0.0);
        let mut found: Vec<(usize, Line)> = Vec::new();
        for bin in candidates(power.len()) {
            let is_peak =
                power[bin - 2..bin + 3].iter().all(|p| *p <= power[bin]) && power[bin] > 0.0;
            if !is_peak {
                continue;
            }
            let line = line_at_bin(power, bin, step, floor(power, bin));
            if line.ratio >= LEAST_RATIO && line.ratio >= least_ratio(self.effective_averages(bin))
            {
                found.push((bin, line));
            }
        }
        let spilt = |bin: usize, by: usize| {
            let bins = bin.abs_diff(by) as f64;
            power[by] > power[bin] && power[bin] * bins * bins < LEAKAGE_PART * power[by]
        };
        let is_genuine = |bin: usize| !found.iter().any(|(by, _)| spilt(bin, *by));
        let mut lines: Vec<Line> =
            found.iter().filter(|(bin, _)| is_genuine(*bin)).map(|(_, line)| *line).collect();
        lines.sort_by(|a, b| b.amplitude.total_cmp(&a.amplitude));
        lines
    }

    /// Effective number of segments for the noise around a bin: low if part of the recording is
    /// louder.
    fn effective_averages(&self, bin: usize) -> f64 {
        let [sum, squares] = self.neighbour_power[bin];
        if squares > 0.0 { sum * sum / squares } else { 1.0 }
    }
}

/// The strongest peak within `reach` of a frequency, whether or not it exceeds the floor; `None`
/// outside the spectrum.
#[must_use]
pub fn line_near(spectrum: &Spectrum, frequency: f64, reach: f64) -> Option<Line> {
    let power = &spectrum.power;
    let step = *spectrum.frequency.get(1)?;
    let inside = |bin: &usize| (*bin as f64 * step - frequency).abs() <= reach + 0.5 * step;
    let bin = (1 + LOBE_BINS..power.len().saturating_sub(LOBE_BINS + 1))
        .filter(inside)
        .max_by(|a, b| power[*a].total_cmp(&power[*b]))?;
    let floor = if bin >= FIRST_BIN + LOBE_BINS + 2 && bin + LOBE_BINS + 2 < power.len() {
        floor(power, bin)
    } else {
        0.0
    };
    Some(line_at_bin(power, bin, step, floor))
}

/// The line whose peak is at a bin.
fn line_at_bin(power: &[f64], bin: usize, step: f64, floor: f64) -> Line {
    let lobe = &power[bin - LOBE_BINS..bin + LOBE_BINS + 1];
    let over = lobe.iter().map(|p| (p - floor).max(0.0)).sum::<f64>() * step;
    Line {
        frequency: (bin as f64 + peak_offset(power, bin)) * step,
        amplitude: (2.0 * over).sqrt(),
        ratio: power[bin] / floor.max(1e-300),
    }
}

/// The noise floor at a bin: the geometric mean of the medians on both sides, equally wide, so that
/// a slope of the spectrum has no effect; the larger median if they are based on few bins.
fn floor(power: &[f64], bin: usize) -> f64 {
    let reach = neighbour_bins(power.len(), bin);
    let [left, right] =
        [&power[bin - reach..bin - LOBE_BINS], &power[bin + LOBE_BINS + 1..bin + reach + 1]].map(
            |side| {
                let mut side = side.to_vec();
                let median_index = side.len() / 2;
                *side.select_nth_unstable_by(median_index, f64::total_cmp).1
            },
        );
    if reach < MEDIAN_BINS / 2 { left.max(right) } else { (left * right).sqrt() }
}

/// Number of bins on each side for the noise around a bin.
fn neighbour_bins(bins: usize, bin: usize) -> usize {
    MEDIAN_BINS.min(bin - FIRST_BIN).min(bins - 1 - bin)
}

/// Ratio of power to median that noise reaches once in a million bins, for a number of averages.
///
/// Each half-overlapping Hann segment beyond the first counts as 0.9 independent segments.
fn least_ratio(averages: f64) -> f64 {
    let freedom = 2.0 * (1.0 + 0.9 * (averages.max(1.0) - 1.0));
    let spread = 2.0 / (9.0 * freedom);
    let quantile = |z: f64| (1.0 - spread + z * spread.sqrt()).powi(3);
    quantile(ONE_IN_A_MILLION) / quantile(0.0)
}

/// Position of the peak between the bins, in bins.
fn peak_offset(power: &[f64], bin: usize) -> f64 {
    let log = |i: usize| power.get(i).map_or(f64::MIN_POSITIVE, |p| p.max(1e-300)).ln();
    let (left, mid, right) = (log(bin - 1), log(bin), log(bin + 1));
    let bend = left - 2.0 * mid + right;
    if bend < 0.0 { (0.5 * (left - right) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}
