//! The noise floor of one channel in one window: power of each bin without vibration.
//!
//! There are two sets, for air and for the cut. A set is first learned as an arithmetic mean; at
//! the end of learning, steady lines (bins of nearly constant power far above their neighbours) are
//! removed from it, so that a line present from the start is still detected. Afterwards it is
//! updated by exponential averaging of clipped powers. Bins near a live line are frozen by the
//! caller. Execution does not allocate.

use crate::cut_detection::CutState;
use std::ops::Range;

/// Powers are clipped at this multiple of the floor before averaging.
const CLIP: f64 = 3.0;
/// Mean of exponentially distributed noise power after this clipping, over its true mean: 1 − e⁻³.
const CLIPPED_MEAN: f64 = 0.950_213;
/// Largest relative variance of a steady line's power (variance over squared mean; 1 for noise).
/// For noise filtered by a mode of 67 Hz and 3 % damping, in windows of 128 ms learned for 0.77 s,
/// 2 of 100 000 bins are below, with a limit of 0.15 1 of 1000: the level then lacks that noise,
/// which is tracked as a line and prevents the level from being learned again.
const STEADY: f64 = 0.1;
/// Least ratio of a steady line's power to the median of its neighbours.
const CONTRAST: f64 = 6.0;

/// The learned mean power per bin.
#[derive(Debug)]
pub(crate) struct Floor {
    level: [Vec<f64>; 2],
    sum: Vec<f64>,
    sum_of_squares: Vec<f64>,
    sorted: Vec<f64>,
    /// Mean powers of the set that was learned first, including steady lines.
    learned_mean: Vec<f64>,
    learned: [bool; 2],
    frames: u32,
    learning_frames: u32,
    update_rate: f64,
    lobe_half_width: usize,
    active_set: usize,
}

impl Floor {
    /// A floor of `bins` bins, learned over `warm_frames` frames and then updated with a time
    /// constant of `follow_frames`; `lobe_half_width` is the half width of a line's main lobe in bins.
    pub(crate) fn new(
        bins: usize,
        warm_frames: u32,
        follow_frames: f64,
        lobe_half_width: usize,
    ) -> Self {
        Self {
            level: [vec![0.0; bins], vec![0.0; bins]],
            sum: vec![0.0; bins],
            sum_of_squares: vec![0.0; bins],
            sorted: vec![0.0; bins],
            learned_mean: vec![0.0; bins],
            learned: [false; 2],
            frames: 0,
            learning_frames: warm_frames.max(4),
            update_rate: 1.0 / follow_frames.max(2.0),
            lobe_half_width,
            active_set: 0,
        }
    }

    /// Mean noise power of each bin.
    pub(crate) fn level(&self) -> &[f64] {
        &self.level[self.active_set]
    }

    /// Whether at least one of the sets is learned.
    pub(crate) fn is_known(&self) -> bool {
        self.learned[0] || self.learned[1]
    }

    /// Whether the set of the present state (air or cut) is learned; otherwise that of the other
    /// state is used.
    pub(crate) fn is_learned_in_state(&self) -> bool {
        self.learned[self.active_set]
    }

    /// The largest mean power around a bin during the first learning, including steady lines, which
    /// the level excludes.
    pub(crate) fn learned_mean_near(&self, bin: usize) -> f64 {
        let end = (bin + self.lobe_half_width + 1).min(self.learned_mean.len());
        let lobe =
            self.learned_mean.get(bin.saturating_sub(self.lobe_half_width)..end).unwrap_or(&[]);
        lobe.iter().copied().fold(0.0, f64::max)
    }

    /// Selects the set for air or cut. A set not yet learned starts from the other one.
    pub(crate) fn set_cut_state(&mut self, surroundings: CutState) {
        let set = surroundings as usize;
        if set == self.active_set {
            return;
        }
        if !self.learned[set] {
            let [air, cut] = &mut self.level;
            let (to, from) = if set == 1 { (cut, air) } else { (air, cut) };
            to.copy_from_slice(from);
            self.discard_unfinished();
        }
        self.active_set = set;
    }

    /// Discards an unfinished mean, as after a gap; learned sets are kept.
    pub(crate) fn discard_unfinished(&mut self) {
        self.frames = 0;
        self.sum.fill(0.0);
        self.sum_of_squares.fill(0.0);
    }

    /// Clears both sets, so that they are learned again.
    pub(crate) fn clear(&mut self) {
        self.learned = [false; 2];
        self.discard_unfinished();
    }

    /// Updates the floor with one frame of powers; `frozen`: ranges of bins of live lines, `gain`:
    /// ratio of the whole frame to the floor.
    pub(crate) fn update(&mut self, power: &[f64], gain: f64, frozen: &[Range<usize>]) {
        if !self.learned[self.active_set] {
            let is_frozen = |bin: usize| frozen.iter().any(|run| run.contains(&bin));
            return self.accumulate(power, gain, is_frozen);
        }
        let level = &mut self.level[self.active_set];
        let bins = level.len();
        for run in frozen {
            let run = run.start.min(bins)..run.end.min(bins);
            self.sorted[run.clone()].copy_from_slice(&level[run]);
        }
        let (follow, scale) = (self.update_rate, 1.0 / CLIPPED_MEAN);
        for (level, &p) in level.iter_mut().zip(power.iter()) {
            let top = CLIP * gain * *level;
            *level += follow * (scale * if p < top { p } else { top } - *level);
        }
        for run in frozen {
            let run = run.start.min(bins)..run.end.min(bins);
            level[run.clone()].copy_from_slice(&self.sorted[run]);
        }
    }

    fn accumulate(&mut self, power: &[f64], gain: f64, is_frozen: impl Fn(usize) -> bool) {
        let known = self.is_known();
        for (bin, &p) in power.iter().enumerate() {
            let kept = gain * self.level[self.active_set][bin];
            // Noise of mean m has mean square 2 m²: a frozen bin counts as noise at its old level.
            let (p, square) =
                if known && is_frozen(bin) { (kept, 2.0 * kept * kept) } else { (p, p * p) };
            self.sum[bin] += p;
            self.sum_of_squares[bin] += square;
        }
        self.frames += 1;
        if self.frames >= self.learning_frames {
            self.finish_learning();
        }
    }

    fn finish_learning(&mut self) {
        let n = f64::from(self.frames);
        for (level, sum) in self.level[self.active_set].iter_mut().zip(&self.sum) {
            *level = sum / n;
        }
        if !self.is_known() {
            self.learned_mean.copy_from_slice(&self.level[self.active_set]);
        }
        self.remove_steady_lines(n);
        self.learned[self.active_set] = true;
        self.discard_unfinished();
    }

    fn remove_steady_lines(&mut self, n: f64) {
        let bins = self.sum.len();
        for bin in 0..bins {
            let mean = self.sum[bin] / n;
            let variance = self.sum_of_squares[bin] / n - mean * mean;
            if variance > STEADY * mean * mean {
                continue;
            }
            let median = self.median_around(bin, n);
            if mean > CONTRAST * median {
                let lobe = bin.saturating_sub(self.lobe_half_width)
                    ..(bin + self.lobe_half_width + 1).min(bins);
                for level in &mut self.level[self.active_set][lobe] {
                    *level = level.min(median);
                }
            }
        }
    }

    /// Median power of the neighbouring bins, without the main lobe of the line itself.
    fn median_around(&mut self, bin: usize, n: f64) -> f64 {
        let span = 6 * self.lobe_half_width;
        let mut count = 0;
        for other in bin.saturating_sub(span)..(bin + span + 1).min(self.sum.len()) {
            if other.abs_diff(bin) > self.lobe_half_width {
                self.sorted[count] = self.sum[other] / n;
                count += 1;
            }
        }
        median(&mut self.sorted[..count])
    }
}

/// The median (the upper one of the two for an even count); 0 for an empty slice. Reorders the
/// values.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let half = values.len() / 2;
    *values.select_nth_unstable_by(half, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An exponentially distributed number with mean 1, by a linear congruential generator.
    fn exponential(state: &mut u64) -> f64 {
        *state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let unit = ((*state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
        -unit.ln()
    }

    /// Powers of exponential noise.
    fn noise(frames: usize, bins: usize) -> Vec<Vec<f64>> {
        let mut state = 9_u64;
        (0..frames).map(|_| (0..bins).map(|_| exponential(&mut state)).collect()).collect()
    }

    #[test]
    fn noise_is_learned_as_its_mean() {
        let mut floor = Floor::new(40, 50, 400.0, 2);
        for frame in noise(3000, 40) {
            floor.update(&frame, 1.0, &[]);
        }
        let mean = floor.level().iter().sum::<f64>() / 40.0;
        assert!((mean - 1.0).abs() < 0.03, "{mean}");
    }

    #[test]
    fn a_line_that_was_there_from_the_start_is_not_taken_for_noise() {
        let mut floor = Floor::new(40, 50, 400.0, 2);
        for mut frame in noise(50, 40) {
            frame[20] += 100.0;
            floor.update(&frame, 1.0, &[]);
        }
        assert!(floor.is_known() && floor.level()[20] < 3.0, "{}", floor.level()[20]);
    }

    #[test]
    fn the_power_of_a_line_that_was_there_is_remembered_although_the_level_leaves_it_out() {
        let mut floor = Floor::new(40, 50, 400.0, 2);
        for mut frame in noise(50, 40) {
            frame[20] += 100.0;
            floor.update(&frame, 1.0, &[]);
        }
        assert!(floor.level()[20] < 3.0 && floor.learned_mean_near(21) > 90.0);
        assert!(floor.learned_mean_near(30) < 3.0, "{}", floor.learned_mean_near(30));
    }

    /// Powers at 67 Hz of white noise through a mode of 67 Hz and 3 % damping: the mode's envelope, sampled at 1 kHz, in Hann
    /// windows of 128 samples, 16 samples apart.
    fn mode_powers(frames: usize, draw: &mut impl FnMut() -> f64) -> Vec<f64> {
        let kept = (-0.03 * std::f64::consts::TAU * 67.0 / 1000.0).exp();
        let mut normal = || (0..4).map(|_| draw()).sum::<f64>() - 4.0;
        let (mut re, mut im) = (0.0, 0.0);
        let mut signal = Vec::new();
        for index in 0..200 + 16 * frames + 128 {
            re = kept * re + normal();
            im = kept * im + normal();
            if index >= 200 {
                signal.push((re, im));
            }
        }
        let hann = |i: usize| 1.0 - (std::f64::consts::TAU * i as f64 / 128.0).cos();
        let power = |frame: usize| {
            let window = signal[16 * frame..16 * frame + 128].iter().enumerate();
            let (re, im) = window
                .fold((0.0, 0.0), |(re, im), (i, (x, y))| (re + hann(i) * x, im + hann(i) * y));
            re * re + im * im
        };
        (0..frames).map(power).collect()
    }

    #[test]
    fn the_noise_of_a_mode_is_not_taken_for_a_steady_line() {
        let mut state = 9_u64;
        let mut draw = || exponential(&mut state);
        let mut taken_out = 0;
        for _ in 0..4000 {
            let mut floor = Floor::new(40, 48, 400.0, 2);
            let powers = mode_powers(48, &mut draw);
            let mean = powers.iter().sum::<f64>() / 48.0;
            for power in powers {
                let mut frame: Vec<f64> = (0..40).map(|_| draw()).collect();
                frame[20] = 100.0 * power / mean;
                floor.update(&frame, 1.0, &[]);
            }
            taken_out += usize::from(floor.level()[20] < 50.0);
        }
        assert_eq!(taken_out, 0, "of 4000");
    }

    #[test]
    fn air_and_cut_are_learned_apart_and_kept() {
        let mut floor = Floor::new(10, 20, 100.0, 2);
        for frame in noise(40, 10) {
            floor.update(&frame, 1.0, &[]);
        }
        let air = floor.level().to_vec();
        floor.set_cut_state(CutState::Cut);
        assert!(floor.is_known() && !floor.is_learned_in_state());
        for frame in noise(400, 10) {
            let loud: Vec<f64> = frame.iter().map(|p| 50.0 * p).collect();
            floor.update(&loud, 50.0, &[]);
        }
        assert!(floor.is_learned_in_state() && floor.level()[3] > 20.0);
        floor.set_cut_state(CutState::Air);
        assert_eq!(floor.level(), &air[..]);
    }

    #[test]
    fn a_frozen_bin_does_not_learn() {
        let mut floor = Floor::new(10, 20, 100.0, 2);
        for frame in noise(40, 10) {
            floor.update(&frame, 1.0, &[]);
        }
        let before = floor.level()[4];
        for _ in 0..1000 {
            floor.update(&[4.0; 10], 1.0, &[4..5, 9..40]);
        }
        assert!((floor.level()[4] - before).abs() < 1e-12 && floor.level()[5] > 3.5);
    }
}
