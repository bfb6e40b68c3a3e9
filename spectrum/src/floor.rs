//! The noise floor of one channel in one window: power of each bin without vibration.
//!
//! Two sets, air and cut. A set is first learned as a mean; at the end of learning, steady lines
//! (powers that hardly vary, far above their neighbours) are removed from it, so that a line that
//! was present from the start is still a line. Then it follows slowly, with single powers clipped.
//! Bins near a live line are frozen by the caller. Execution does not allocate.

use crate::surroundings::Surroundings;
use std::ops::Range;

/// Powers above this many floors do not pull the floor up any further.
const CLIP: f64 = 3.0;
/// Mean of exponential noise clipped so, over its true mean: 1 − e⁻³.
const CLIPPED_MEAN: f64 = 0.950_213;
/// A steady line's power varies by less than this (variance over squared mean; noise has 1). Noise
/// through a mode of 67 Hz and 3 % damping, in windows of 128 ms learned for 0.77 s, varies less in
/// 2 of 100 000 bins, with 0.15 in 1 of 1000: the level then lacks that noise, which is tracked as
/// a line and prevents the level from being learned again.
const STEADY: f64 = 0.1;
/// A steady line exceeds the median of its neighbours by this factor.
const CONTRAST: f64 = 6.0;

/// Mean power per bin, learned.
#[derive(Debug)]
pub(crate) struct Floor {
    level: [Vec<f64>; 2],
    sum: Vec<f64>,
    sum_of_squares: Vec<f64>,
    sorted: Vec<f64>,
    /// Mean powers of the set that was learned first, steady lines included.
    heard: Vec<f64>,
    learned: [bool; 2],
    frames: u32,
    warm_frames: u32,
    follow: f64,
    reach: usize,
    set: usize,
}

impl Floor {
    /// A floor of `bins` bins, learned over `warm_frames` frames and then updated with a time
    /// constant of `follow_frames`; `reach` is the half width of a line's main lobe in bins.
    pub(crate) fn new(bins: usize, warm_frames: u32, follow_frames: f64, reach: usize) -> Self {
        Self {
            level: [vec![0.0; bins], vec![0.0; bins]],
            sum: vec![0.0; bins],
            sum_of_squares: vec![0.0; bins],
            sorted: vec![0.0; bins],
            heard: vec![0.0; bins],
            learned: [false; 2],
            frames: 0,
            warm_frames: warm_frames.max(4),
            follow: 1.0 / follow_frames.max(2.0),
            reach,
            set: 0,
        }
    }

    /// Mean noise power of each bin.
    pub(crate) fn level(&self) -> &[f64] {
        &self.level[self.set]
    }

    /// Whether there is a floor to compare with at all.
    pub(crate) fn is_known(&self) -> bool {
        self.learned[0] || self.learned[1]
    }

    /// Whether the floor was learned in the present surroundings, not in the other ones.
    pub(crate) fn is_own(&self) -> bool {
        self.learned[self.set]
    }

    /// The largest mean power around a bin while the first set was learned: for a line that was
    /// present from the start, its own power, although the level excludes it.
    pub(crate) fn heard_near(&self, bin: usize) -> f64 {
        let end = (bin + self.reach + 1).min(self.heard.len());
        let lobe = self.heard.get(bin.saturating_sub(self.reach)..end).unwrap_or(&[]);
        lobe.iter().copied().fold(0.0, f64::max)
    }

    /// Changes the surroundings. A set not yet learned starts from the other one.
    pub(crate) fn switch(&mut self, surroundings: Surroundings) {
        let set = surroundings as usize;
        if set == self.set {
            return;
        }
        if !self.learned[set] {
            let [air, cut] = &mut self.level;
            let (to, from) = if set == 1 { (cut, air) } else { (air, cut) };
            to.copy_from_slice(from);
            self.restart();
        }
        self.set = set;
    }

    /// Discards an unfinished mean (after a gap); learned floors are kept.
    pub(crate) fn restart(&mut self) {
        self.frames = 0;
        self.sum.fill(0.0);
        self.sum_of_squares.fill(0.0);
    }

    /// Clears everything, to be learned again.
    pub(crate) fn forget(&mut self) {
        self.learned = [false; 2];
        self.restart();
    }

    /// Updates with one frame of powers; `frozen` are the runs of bins that belong to live lines,
    /// and `gain` the ratio of the whole frame to the floor.
    pub(crate) fn learn(&mut self, power: &[f64], gain: f64, frozen: &[Range<usize>]) {
        if !self.learned[self.set] {
            let is_frozen = |bin: usize| frozen.iter().any(|run| run.contains(&bin));
            return self.warm_up(power, gain, is_frozen);
        }
        let level = &mut self.level[self.set];
        let bins = level.len();
        for run in frozen {
            let run = run.start.min(bins)..run.end.min(bins);
            self.sorted[run.clone()].copy_from_slice(&level[run]);
        }
        let (follow, scale) = (self.follow, 1.0 / CLIPPED_MEAN);
        for (level, &p) in level.iter_mut().zip(power.iter()) {
            let top = CLIP * gain * *level;
            *level += follow * (scale * if p < top { p } else { top } - *level);
        }
        for run in frozen {
            let run = run.start.min(bins)..run.end.min(bins);
            level[run.clone()].copy_from_slice(&self.sorted[run]);
        }
    }

    fn warm_up(&mut self, power: &[f64], gain: f64, is_frozen: impl Fn(usize) -> bool) {
        let known = self.is_known();
        for (bin, &p) in power.iter().enumerate() {
            let kept = gain * self.level[self.set][bin];
            // Noise of mean m has mean square 2 m²: a frozen bin counts as noise at its old level.
            let (p, square) =
                if known && is_frozen(bin) { (kept, 2.0 * kept * kept) } else { (p, p * p) };
            self.sum[bin] += p;
            self.sum_of_squares[bin] += square;
        }
        self.frames += 1;
        if self.frames >= self.warm_frames {
            self.finish();
        }
    }

    fn finish(&mut self) {
        let n = f64::from(self.frames);
        for (level, sum) in self.level[self.set].iter_mut().zip(&self.sum) {
            *level = sum / n;
        }
        if !self.is_known() {
            self.heard.copy_from_slice(&self.level[self.set]);
        }
        self.take_steady_lines_out(n);
        self.learned[self.set] = true;
        self.restart();
    }

    fn take_steady_lines_out(&mut self, n: f64) {
        let bins = self.sum.len();
        for bin in 0..bins {
            let mean = self.sum[bin] / n;
            let variance = self.sum_of_squares[bin] / n - mean * mean;
            if variance > STEADY * mean * mean {
                continue;
            }
            let middle = self.middle_around(bin, n);
            if mean > CONTRAST * middle {
                let lobe = bin.saturating_sub(self.reach)..(bin + self.reach + 1).min(bins);
                for level in &mut self.level[self.set][lobe] {
                    *level = level.min(middle);
                }
            }
        }
    }

    /// Median power of the neighbours, without the line's own lobe.
    fn middle_around(&mut self, bin: usize, n: f64) -> f64 {
        let span = 6 * self.reach;
        let mut count = 0;
        for other in bin.saturating_sub(span)..(bin + span + 1).min(self.sum.len()) {
            if other.abs_diff(bin) > self.reach {
                self.sorted[count] = self.sum[other] / n;
                count += 1;
            }
        }
        middle(&mut self.sorted[..count])
    }
}

/// The middle value (upper middle for an even count); 0 for none. Reorders.
pub(crate) fn middle(values: &mut [f64]) -> f64 {
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
            floor.learn(&frame, 1.0, &[]);
        }
        let mean = floor.level().iter().sum::<f64>() / 40.0;
        assert!((mean - 1.0).abs() < 0.03, "{mean}");
    }

    #[test]
    fn a_line_that_was_there_from_the_start_is_not_taken_for_noise() {
        let mut floor = Floor::new(40, 50, 400.0, 2);
        for mut frame in noise(50, 40) {
            frame[20] += 100.0;
            floor.learn(&frame, 1.0, &[]);
        }
        assert!(floor.is_known() && floor.level()[20] < 3.0, "{}", floor.level()[20]);
    }

    #[test]
    fn the_power_of_a_line_that_was_there_is_remembered_although_the_level_leaves_it_out() {
        let mut floor = Floor::new(40, 50, 400.0, 2);
        for mut frame in noise(50, 40) {
            frame[20] += 100.0;
            floor.learn(&frame, 1.0, &[]);
        }
        assert!(floor.level()[20] < 3.0 && floor.heard_near(21) > 90.0);
        assert!(floor.heard_near(30) < 3.0, "{}", floor.heard_near(30));
    }

    /// Powers at 67 Hz of white noise through a mode of 67 Hz and 3 % damping: the mode's envelope, sampled at 1 kHz, in Hann
    /// windows of 128 samples, 16 samples apart.
    fn mode_powers(frames: usize, draw: &mut impl FnMut() -> f64) -> Vec<f64> {
        let kept = (-0.03 * std::f64::consts::TAU * 67.0 / 1000.0).exp();
        let mut normal = || (0..4).map(|_| draw()).sum::<f64>() - 4.0;
        let (mut re, mut im) = (0.0, 0.0);
        let mut signal = Vec::new();
        for at in 0..200 + 16 * frames + 128 {
            re = kept * re + normal();
            im = kept * im + normal();
            if at >= 200 {
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
                floor.learn(&frame, 1.0, &[]);
            }
            taken_out += usize::from(floor.level()[20] < 50.0);
        }
        assert_eq!(taken_out, 0, "of 4000");
    }

    #[test]
    fn air_and_cut_are_learned_apart_and_kept() {
        let mut floor = Floor::new(10, 20, 100.0, 2);
        for frame in noise(40, 10) {
            floor.learn(&frame, 1.0, &[]);
        }
        let air = floor.level().to_vec();
        floor.switch(Surroundings::Cut);
        assert!(floor.is_known() && !floor.is_own());
        for frame in noise(400, 10) {
            let loud: Vec<f64> = frame.iter().map(|p| 50.0 * p).collect();
            floor.learn(&loud, 50.0, &[]);
        }
        assert!(floor.is_own() && floor.level()[3] > 20.0);
        floor.switch(Surroundings::Air);
        assert_eq!(floor.level(), &air[..]);
    }

    #[test]
    fn a_frozen_bin_does_not_learn() {
        let mut floor = Floor::new(10, 20, 100.0, 2);
        for frame in noise(40, 10) {
            floor.learn(&frame, 1.0, &[]);
        }
        let before = floor.level()[4];
        for _ in 0..1000 {
            floor.learn(&[4.0; 10], 1.0, &[4..5, 9..40]);
        }
        assert!((floor.level()[4] - before).abs() < 1e-12 && floor.level()[5] > 3.5);
    }
}
