//! Decimation from the sensor's rate to about 1.25 kHz: average over one revolution, and anti-alias
//! filter.
//!
//! Both are convolved into one FIR filter, evaluated at the output samples only. The average covers
//! exactly one spindle revolution (including a fraction of a sample, by linear interpolation), so
//! that runout, tooth passing and all their harmonics vanish. The filter passes the low band and
//! attenuates everything that would alias into it. A change of the speed takes one pass over the
//! coefficients and no allocation.
//!
//! Source: Kaiser 1974 for the window; attenuation 70 dB. Valid for speeds constant over a
//! revolution.

use std::f64::consts::PI;

const STOP_DB: f64 = 70.0;

/// The decimating filter ahead of the low branch.
#[derive(Debug)]
pub(crate) struct FrontEnd {
    factor: usize,
    rate_hz: f64,
    pass_hz: f64,
    low_pass: Vec<f64>,
    cumulative: Vec<f64>,
    taps: Vec<f64>,
    used: usize,
    revolution: f64,
}

impl FrontEnd {
    /// Plans the filter for a sensor rate and the upper limit of the low branch; the factor brings
    /// the rate to about 1.25 kHz.
    pub(crate) fn new(rate_hz: f64, pass_hz: f64) -> Self {
        let factor = decimation_factor(rate_hz);
        let low_pass = if factor == 1 {
            vec![1.0]
        } else {
            kaiser_low_pass(rate_hz, pass_hz, rate_hz / factor as f64 - pass_hz)
        };
        let cumulative = low_pass
            .iter()
            .scan(0.0, |sum, tap| {
                *sum += tap;
                Some(*sum)
            })
            .collect();
        let longest = low_pass.len() + (rate_hz / slowest_comb_hz(pass_hz)) as usize + 4;
        let mut planned = Self {
            factor,
            rate_hz,
            pass_hz,
            low_pass,
            cumulative,
            taps: vec![0.0; longest],
            used: 0,
            revolution: 0.0,
        };
        planned.set_spindle(0.0);
        planned
    }

    /// Input samples per output sample.
    pub(crate) fn factor(&self) -> usize {
        self.factor
    }

    /// Largest possible length of the filter, in samples.
    pub(crate) fn longest(&self) -> usize {
        self.taps.len()
    }

    /// Present length of the filter, in samples.
    pub(crate) fn taps(&self) -> usize {
        self.used
    }

    /// Sets the spindle speed, rev/s. For zero, or a speed whose average would attenuate the low
    /// band, only the anti-alias filter is used. Returns whether the filter changed.
    pub(crate) fn set_spindle(&mut self, spindle_hz: f64) -> bool {
        let usable = spindle_hz >= slowest_comb_hz(self.pass_hz) && spindle_hz < 0.5 * self.rate_hz;
        let revolution = if usable { self.rate_hz / spindle_hz } else { 0.0 };
        if self.used > 0 && (revolution - self.revolution).abs() <= 1e-4 * revolution {
            return false;
        }
        self.revolution = revolution;
        if revolution > 0.0 {
            self.convolve_average(revolution);
        } else {
            self.use_low_pass_only();
        }
        true
    }

    fn use_low_pass_only(&mut self) {
        self.used = self.low_pass.len();
        self.taps[..self.used].copy_from_slice(&self.low_pass);
    }

    /// Average of the interpolated signal over `revolution` samples, convolved with the filter. The
    /// average's weights are ½, 1, …, 1, ½+f−f²/2, f²/2 over the revolution: ones with four
    /// corrections, so that the convolution takes one pass with cumulative sums.
    fn convolve_average(&mut self, revolution: f64) {
        let whole = revolution.floor() as usize;
        let f = revolution - revolution.floor();
        self.used = (self.low_pass.len() + whole + 1).min(self.taps.len());
        let filter = &self.low_pass;
        let tap = |n: usize, lag: usize| {
            n.checked_sub(lag).and_then(|i| filter.get(i)).copied().unwrap_or(0.0)
        };
        let sum_to = |n: usize, lag: usize| {
            n.checked_sub(lag).map_or(0.0, |i| self.cumulative[i.min(filter.len() - 1)])
        };
        for n in 0..self.used {
            let ones = sum_to(n, 0) - sum_to(n, whole + 1);
            let ends = -0.5 * tap(n, 0)
                + (f - 0.5 - 0.5 * f * f) * tap(n, whole)
                + 0.5 * f * f * tap(n, whole + 1);
            self.taps[n] = (ones + ends) / revolution;
        }
    }

    /// One output sample from the newest [`Self::taps`] samples, oldest first.
    #[inline]
    pub(crate) fn output(&self, samples: &[f64]) -> f64 {
        // The taps are ordered from newest to oldest; this matters for the average only, the low
        // pass is symmetric.
        let mut lanes = [0.0_f64; 4];
        let taps = &self.taps[..self.used];
        let quads = taps.len() / 4 * 4;
        for (t, x) in taps[..quads].chunks_exact(4).zip(samples.rchunks_exact(4)) {
            for lane in 0..4 {
                lanes[lane] += t[lane] * x[3 - lane];
            }
        }
        let rest: f64 =
            taps[quads..].iter().zip(samples.iter().rev().skip(quads)).map(|(t, x)| t * x).sum();
        (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]) + rest
    }

    /// Gain of the average at a frequency, 0 to 1; the ripple of the low pass is below 0.1 %.
    pub(crate) fn gain(&self, frequency_hz: f64) -> f64 {
        let x = PI * frequency_hz * self.revolution / self.rate_hz;
        if x < 1e-9 { 1.0 } else { (x.sin() / x).abs() }
    }
}

/// Lowest speed at which the average is used, rev/s; below, it would attenuate the low band, and
/// the classification alone separates the harmonics.
fn slowest_comb_hz(pass_hz: f64) -> f64 {
    1.5 * pass_hz
}

fn decimation_factor(rate_hz: f64) -> usize {
    ((rate_hz / 1250.0).round() as usize).max(1)
}

/// Linear-phase low pass of unit gain at 0 Hz, by the window method.
fn kaiser_low_pass(rate_hz: f64, pass_hz: f64, stop_hz: f64) -> Vec<f64> {
    let transition = 2.0 * PI * (stop_hz - pass_hz) / rate_hz;
    let order = ((STOP_DB - 7.95) / (2.285 * transition)).ceil() + 2.0;
    let beta = 0.1102 * (STOP_DB - 8.7);
    let cut = (stop_hz + pass_hz) / rate_hz;
    let taps: Vec<f64> = (0..=order as usize)
        .map(|i| {
            let t = i as f64 - 0.5 * order;
            let r = 2.0 * t / order;
            let sinc = if t.abs() < 1e-12 { 1.0 } else { (PI * cut * t).sin() / (PI * cut * t) };
            sinc * bessel_i0(beta * (1.0 - r * r).max(0.0).sqrt())
        })
        .collect();
    let sum: f64 = taps.iter().sum();
    taps.iter().map(|tap| tap / sum).collect()
}

/// Modified Bessel function of order zero, by its series.
fn bessel_i0(x: f64) -> f64 {
    let mut term = 1.0;
    let mut sum = 1.0;
    for k in 1..40 {
        term *= (x / (2.0 * f64::from(k))).powi(2);
        sum += term;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    fn response(front: &FrontEnd, frequency_hz: f64, rate_hz: f64) -> f64 {
        let amplitude = |phase: f64| {
            let samples: Vec<f64> = (0..front.taps())
                .map(|i| (TAU * frequency_hz * i as f64 / rate_hz + phase).cos())
                .collect();
            front.output(&samples)
        };
        amplitude(0.0).hypot(amplitude(-PI / 2.0))
    }

    #[test]
    fn frequencies_that_alias_into_the_low_band_are_attenuated_by_70_db() {
        for rate_hz in [2500.0, 10_000.0, 51_200.0] {
            let front = FrontEnd::new(rate_hz, 160.0);
            let low_rate_hz = rate_hz / front.factor() as f64;
            let mut f = low_rate_hz - 160.0;
            while f < rate_hz / 2.0 {
                assert!(response(&front, f, rate_hz) < 4.5e-4, "{f} Hz at {rate_hz} Hz");
                f += 7.0;
            }
            for f in [10.0, 72.0, 160.0] {
                assert!(
                    (response(&front, f, rate_hz) - 1.0).abs() < 1.5e-3,
                    "{f} Hz at {rate_hz} Hz"
                );
            }
        }
    }

    #[test]
    fn tooth_passing_vanishes_and_72_hz_is_kept_as_told() {
        let mut front = FrontEnd::new(10_000.0, 160.0);
        assert!(front.set_spindle(28_000.0 / 60.0));
        for k in 1..6 {
            let left = response(&front, f64::from(k) * 28_000.0 / 60.0, 10_000.0);
            assert!(left < 2e-3, "harmonic {k}: {left}");
        }
        let kept = response(&front, 72.0, 10_000.0);
        assert!((kept - front.gain(72.0)).abs() < 1e-3, "{kept}");
        assert!((20.0 * front.gain(120.0).log10() + 0.96).abs() < 0.05);
    }

    #[test]
    fn a_spindle_inside_the_low_band_is_not_averaged() {
        let mut front = FrontEnd::new(10_000.0, 160.0);
        assert!(!front.set_spindle(83.3));
        assert!((front.gain(83.3) - 1.0).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn a_constant_passes_at_any_speed(rpm in 0.0..60_000.0_f64, rate_hz in 2000.0..60_000.0_f64) {
            let mut front = FrontEnd::new(rate_hz, 160.0);
            front.set_spindle(rpm / 60.0);
            let samples = vec![3.0; front.taps()];
            prop_assert!((front.output(&samples) - 3.0).abs() < 1e-9);
        }
    }
}
