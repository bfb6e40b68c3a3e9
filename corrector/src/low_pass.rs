//! A second-order Butterworth low-pass for variable time steps.
//!
//! `y'' = ω²(u − y) − √2 ω y'` with `u` linear between samples, solved exactly over each step: the state is the output and its rate per
//! second, and decays at the same rate for any step. (With past outputs as state, the implied rate changes with the step length: a
//! pause between short steps made it diverge.) Source: any text on linear systems, the matrix exponential of a damped oscillator.
//! Invariants: finite output for inputs below 1e100; unit gain at rest; the state never diverges. A
//! step of zero duration changes nothing.

use core::f64::consts::{PI, SQRT_2};

/// Below this the series of [`decay`] is exact to the last bit.
const SERIES_BELOW: f64 = 1.0 / 32.0;

/// Coefficients of one step, for all signals with one corner frequency.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepCoefficients {
    per_s: f64,
    /// Decay rate and angular frequency of the impulse response, rad/s: `ω/√2`.
    rate: f64,
    /// Its inverse, s.
    time_s: f64,
    /// Decay over one step, times cosine and sine.
    cos: f64,
    sin: f64,
}

impl StepCoefficients {
    pub(crate) fn new(corner_hz: f64, dt_s: f64) -> Self {
        let rate = SQRT_2 * PI * corner_hz;
        let (cos, sin) = decay(rate * dt_s);
        let per_s = if dt_s > 0.0 { 1.0 / dt_s } else { 0.0 };
        Self { per_s, rate, time_s: 1.0 / rate, cos, sin }
    }
}

/// `e⁻ˣ cos x` and `e⁻ˣ sin x`: real and imaginary part of `exp((−1 + i) x)`, for small x by its
/// series.
fn decay(x: f64) -> (f64, f64) {
    if x > SERIES_BELOW {
        let (magnitude, (sin, cos)) = (libm::exp(-x), libm::sincos(x));
        return (magnitude * cos, magnitude * sin);
    }
    let (mut real, mut imaginary) = (1.0, 0.0);
    for n in [8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0] {
        let share = x * (1.0 / n);
        (real, imaginary) = (1.0 - share * (real + imaginary), share * (real - imaginary));
    }
    (real, imaginary)
}

/// The filter's state.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LowPass {
    input: f64,
    pub(crate) output: f64,
    /// Rate of change of the output, per s.
    output_rate: f64,
}

impl LowPass {
    /// Filters one sample, one step after the last; returns the output.
    pub(crate) fn step(&mut self, input: f64, coefficients: &StepCoefficients) -> f64 {
        let StepCoefficients { per_s, rate, time_s, cos, sin } = *coefficients;
        if per_s <= 0.0 {
            return self.output;
        }
        // For a ramp as input, the output follows with the same slope and a constant lag; the
        // deviation from that decays.
        let slope = (input - self.input) * per_s;
        let lag = slope * time_s;
        let (value_error, rate_error) =
            (self.output - (self.input - lag), self.output_rate - slope);
        self.output = input - lag + value_error * cos + (rate_error * time_s + value_error) * sin;
        self.output_rate = slope + rate_error * cos - (rate_error + 2.0 * rate * value_error) * sin;
        self.input = input;
        self.output
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    /// Amplitude of the filtered sine of unit amplitude.
    fn gain_at(hz: f64, corner_hz: f64) -> f64 {
        let (mut filter, dt_s) = (LowPass::default(), 1e-3);
        let mut largest = 0.0_f64;
        for k in 0..20_000 {
            let out = filter.step(
                libm::sin(2.0 * PI * hz * k as f64 * dt_s),
                &StepCoefficients::new(corner_hz, dt_s),
            );
            largest = if k > 10_000 { largest.max(out.abs()) } else { 0.0 };
        }
        largest
    }

    #[test]
    fn it_has_the_gain_of_a_second_order_butterworth() {
        for hz in [0.3, 1.0, 3.0, 10.0, 40.0_f64] {
            let expected = 1.0 / libm::sqrt(1.0 + (hz / 3.0).powi(4));
            let between_samples = 0.01 * expected + 1e-4;
            let gain = gain_at(hz, 3.0);
            assert!((gain - expected).abs() < between_samples, "{hz} Hz: {gain}");
        }
    }

    #[test]
    fn the_series_of_a_short_step_is_the_decay_itself() {
        for n in 0..=1000 {
            let x = SERIES_BELOW * f64::from(n) / 1000.0;
            let (magnitude, (sin, cos)) = (libm::exp(-x), libm::sincos(x));
            let (real, imaginary) = decay(x);
            assert!((real - magnitude * cos).abs() < 3e-16, "{x}: {real}");
            assert!(
                (imaginary - magnitude * sin).abs() < 3e-16 * (0.1 + 10.0 * x),
                "{x}: {imaginary}"
            );
        }
    }

    #[test]
    fn a_constant_passes_at_any_pace() {
        let mut filter = LowPass::default();
        for _ in 0..20_000 {
            filter.step(7.0, &StepCoefficients::new(3.0, 1e-3));
        }
        for dt_s in [1e-3, 4e-3, 1e-5, 0.2, 0.0, 1e-3] {
            assert!((filter.step(7.0, &StepCoefficients::new(3.0, dt_s)) - 7.0).abs() < 1e-6);
        }
    }

    #[test]
    fn how_time_is_cut_into_steps_does_not_matter() {
        // A ramp, sampled at an even pace and in short steps with pauses between them.
        let filtered = |steps: &[f64]| {
            let (mut filter, mut t_s) = (LowPass::default(), 0.0);
            let mut last = steps.iter().cycle().map(|dt_s| {
                t_s += dt_s;
                (t_s, filter.step(50.0 * t_s, &StepCoefficients::new(3.0, *dt_s)))
            });
            last.find(|(t_s, _)| *t_s >= 1.0).expect("endless")
        };
        let (t_s, even) = filtered(&[1e-3]);
        assert!(
            (even - 50.0 * (t_s - SQRT_2 / (TAU * 3.0))).abs() < 1e-3,
            "a ramp is followed at a constant lag"
        );
        for steps in [&[1e-5, 1e-5, 1e-5, 2e-2][..], &[2e-2, 1e-6, 1e-6], &[1e-9, 0.1]] {
            let (t_s, output) = filtered(steps);
            let expected = 50.0 * (t_s - SQRT_2 / (TAU * 3.0));
            assert!((output - expected).abs() < 1e-3, "{steps:?}: {output} for {expected}");
        }
    }

    #[test]
    fn nothing_grows_whatever_the_steps() {
        let mut rng = 1_u64;
        let mut filter = LowPass::default();
        for k in 0..200_000 {
            rng =
                rng.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let dt_s = 0.5_f64.powi(((rng >> 40) % 30) as i32);
            let output = filter
                .step(if rng >> 63 == 1 { 1.0 } else { -1.0 }, &StepCoefficients::new(3.0, dt_s));
            // The overshoot for a unit step is 4.3 %; for the worst sequence of steps it is little
            // more.
            assert!(output.abs() < 1.1, "{output} at {k}");
        }
    }
}
