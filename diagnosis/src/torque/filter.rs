//! Zero-phase low-pass, derivatives and delays of sampled signals.
//!
//! Butterworth filter of fourth order, applied forward and backward: zero phase, gain of one half at the band edge. Torque and the quantities derived
//! from motion pass the same filter, so that their equation of motion stays valid (Gautier, Dynamic identification of robots with power model, ICRA
//! 1997).

use std::f64::consts::PI;

/// Quality factors of the two second-order sections of a fourth-order Butterworth filter.
const QUALITY: [f64; 2] = [0.541_196_100_146_197, 1.306_562_964_876_376_5];
/// Padding at each end, in periods of the band edge.
const PADDED: f64 = 6.0;

/// A low-pass filter for one sampling rate.
#[derive(Clone, Copy, Debug)]
pub(super) struct LowPass {
    sections: [Section; 2],
    pad: usize,
}

#[derive(Clone, Copy, Debug)]
struct Section {
    b0: f64,
    a1: f64,
    a2: f64,
}

impl LowPass {
    /// A filter with its edge at `band_hz`, which must be below half of `rate_hz`.
    pub(super) fn new(band_hz: f64, rate_hz: f64) -> Self {
        let k = libm::tan(PI * (band_hz / rate_hz).min(0.45));
        let sections = QUALITY.map(|quality| {
            let norm = 1.0 / (1.0 + k / quality + k * k);
            let [b0, a1, a2] =
                [k * k * norm, 2.0 * (k * k - 1.0) * norm, (1.0 - k / quality + k * k) * norm];
            Section { b0, a1, a2 }
        });
        Self { sections, pad: (PADDED * rate_hz / band_hz).ceil() as usize }
    }

    /// The low-pass filtered samples.
    pub(super) fn filtered(&self, samples: &[f64]) -> Vec<f64> {
        let [passed] = self.pass_each([samples]);
        passed
    }

    /// Filters several lists of equal length at once, which takes little longer than one.
    pub(super) fn pass_each<const N: usize>(&self, lists: [&[f64]; N]) -> [Vec<f64>; N] {
        let count = lists.map(<[f64]>::len).into_iter().min().unwrap_or(0);
        if count == 0 {
            return lists.map(|_| Vec::new());
        }
        let pad = self.pad.min(count - 1);
        let values_at = |k: usize| lists.map(|samples| samples[k]);
        // The ends are padded by point reflection about the end sample, which keeps value and slope continuous.
        let reflected = |end: usize, k: usize| lists.map(|samples| 2.0 * samples[end] - samples[k]);
        let before = (1..=pad).rev().map(|k| reflected(0, k));
        let after = (1..=pad).map(|k| reflected(count - 1, count - 1 - k));
        let mut long: Vec<[f64; N]> =
            before.chain((0..count).map(values_at)).chain(after).collect();
        self.filter_in_place(long.iter_mut());
        self.filter_in_place(long.iter_mut().rev());
        let passed = &long[pad..pad + count];
        std::array::from_fn(|list| passed.iter().map(|values| values[list]).collect())
    }

    /// Filters in place through both sections, starting from the steady state of the first sample.
    fn filter_in_place<'s, const N: usize>(
        &self,
        mut samples: impl Iterator<Item = &'s mut [f64; N]>,
    ) {
        let [first, second] = &self.sections;
        let Some(start) = samples.next() else { return };
        let mut before = [*start; 4];
        let mut between = [first.step(*start, &mut before); 4];
        *start = second.step(between[0], &mut between);
        for x in samples {
            *x = second.step(first.step(*x, &mut before), &mut between);
        }
    }
}

impl Section {
    /// Output for the input `x`; `before`: the inputs and outputs one and two samples earlier.
    fn step<const N: usize>(&self, x: [f64; N], before: &mut [[f64; N]; 4]) -> [f64; N] {
        let [x1, x2, y1, y2] = *before;
        let y = std::array::from_fn(|k| {
            self.b0 * (x[k] + 2.0 * x1[k] + x2[k]) - self.a1 * y1[k] - self.a2 * y2[k]
        });
        *before = [x, x1, y, y1];
        y
    }
}

/// Derivative per second by central differences of sixth order (Fornberg, Generation of finite difference formulas, 1988): a sine at a tenth of the
/// sampling rate has an error below 1e-3. Lower order within three samples of the ends.
pub(super) fn derivative(samples: &[f64], step_s: f64) -> Vec<f64> {
    const WEIGHTS: [&[f64]; 4] =
        [&[], &[0.5], &[8.0 / 12.0, -1.0 / 12.0], &[45.0 / 60.0, -9.0 / 60.0, 1.0 / 60.0]];
    let last = samples.len().saturating_sub(1);
    let slope = |k: usize| {
        let weights = WEIGHTS[k.min(last - k).min(3)];
        if weights.is_empty() {
            let (from, to) = (k.saturating_sub(1), (k + 1).min(last));
            return (samples[to] - samples[from]) / ((to - from).max(1) as f64 * step_s);
        }
        let pairs = weights.iter().zip(1..);
        pairs.map(|(weight, n)| weight * (samples[k + n] - samples[k - n])).sum::<f64>() / step_s
    };
    (0..samples.len()).map(slope).collect()
}

/// Samples delayed by `by` steps, interpolated by the polynomial through the six nearest (Lagrange); the end values are held.
pub(super) fn delayed(samples: &[f64], by: f64) -> Vec<f64> {
    const NEAREST: usize = 6;
    let Some(last) = samples.len().checked_sub(1) else { return Vec::new() };
    let nearest = NEAREST.min(samples.len());
    let value = |k: usize| {
        let position = (k as f64 - by).clamp(0.0, last as f64);
        let from = (position as usize).saturating_sub(NEAREST / 2 - 1).min(samples.len() - nearest);
        let support = from..from + nearest;
        let weight = |i: usize| {
            let others = support.clone().filter(|j| *j != i);
            others.map(|j| (position - j as f64) / (i as f64 - j as f64)).product::<f64>()
        };
        support.clone().map(|i| weight(i) * samples[i]).sum()
    };
    (0..samples.len()).map(value).collect()
}

/// Positions with their velocities and accelerations.
pub(super) fn with_derivatives(q: Vec<f64>, step_s: f64) -> [Vec<f64>; 3] {
    let v = derivative(&q, step_s);
    let a = derivative(&v, step_s);
    [q, v, a]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(frequency_hz: f64, count: usize) -> Vec<f64> {
        (0..count).map(|k| libm::sin(2.0 * PI * frequency_hz * k as f64 / 1000.0)).collect()
    }

    #[test]
    fn a_slow_wave_passes_without_delay_and_a_fast_one_does_not() {
        let filter = LowPass::new(40.0, 1000.0);
        let slow = wave(5.0, 4000);
        let passed = filter.filtered(&slow);
        let worst = slow.iter().zip(&passed).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 0.02, "{worst}");
        let fast = filter.filtered(&wave(200.0, 4000));
        assert!(fast[500..3500].iter().all(|x| x.abs() < 1e-4));
        let edge = filter.filtered(&wave(40.0, 4000));
        let top = edge[1000..3000].iter().copied().fold(0.0, f64::max);
        assert!((top - 0.5).abs() < 0.01, "{top}");
    }

    #[test]
    fn a_pair_passes_as_each_alone_does() {
        let (filter, one, other) = (LowPass::new(40.0, 1000.0), wave(5.0, 700), wave(90.0, 700));
        assert_eq!(
            filter.pass_each([&one, &other]),
            [filter.filtered(&one), filter.filtered(&other)]
        );
    }

    #[test]
    fn what_comes_later_is_what_was() {
        let slow = wave(60.0, 1000);
        let worst = |by: f64| {
            let late = delayed(&slow, by);
            let errors = (20..980).map(|k| {
                let then = libm::sin(2.0 * PI * 0.06 * (k as f64 - by));
                (late[k] - then).abs()
            });
            errors.fold(0.0, f64::max)
        };
        assert!(worst(2.0) < 1e-12);
        assert!(worst(0.37) < 1e-3 && worst(-7.5) < 1e-3, "{} {}", worst(0.37), worst(-7.5));
    }

    #[test]
    fn a_line_passes_whole_and_its_derivative_is_its_slope() {
        let line: Vec<f64> = (0..300).map(|k| 2.0 + 0.5 * f64::from(k)).collect();
        let passed = LowPass::new(10.0, 100.0).filtered(&line);
        assert!(line.iter().zip(&passed).all(|(a, b)| (a - b).abs() < 1e-6));
        let slopes = derivative(&passed, 0.01);
        assert!(slopes.iter().all(|slope| (slope - 50.0).abs() < 1e-3));
        let swing = derivative(&wave(100.0, 400), 1e-3);
        let worst = (10..390).map(|k| {
            let exact = 200.0 * PI * libm::cos(0.2 * PI * k as f64);
            (swing[k] - exact).abs() / (200.0 * PI)
        });
        assert!(worst.fold(0.0, f64::max) < 1e-3);
        assert!(
            derivative(&[1.0], 0.01) == [0.0] && LowPass::new(1.0, 10.0).filtered(&[]).is_empty()
        );
    }
}
