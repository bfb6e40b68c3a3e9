//! The inverse of a joint as taps of a finite impulse response: from the path around an instant to the lead at that instant.
//!
//! `c(t) = Σ_k w_k (q(t + k Δ) − q(t))`, with `w` the inverse Fourier transform of [`Design::gains`] of a path (Wiener's inverse, scaled to be robust), faded out by a
//! raised cosine towards both ends of the window (window method of filter design; Oppenheim, Schafer, *Discrete-Time Signal Processing*, section 7.5).
//! Differences to the present point leave a joint at rest uncorrected. The taps are adjusted by a term that is odd in `k`, such that at constant speed the lead corresponds to exactly
//! the sum of delay and lags.
//!
//! The response outlasts the window: the more, the less damped a mode is and the larger the share by which parameters may deviate. With a mode of 2 % damping the window of
//! 0.5 s leaves out about a hundredth of the sum of all taps.

use crate::inverse::{Design, Source};
use crate::plant::{Plant, Plants, Uncertain};
use physics::{JOINTS_MAX, Joints};
use realfft::RealFftPlanner;
use std::f64::consts::PI;

/// Settings of the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TapsSettings {
    /// Where the weight of the correction's third derivative equals that of the path's error, Hz, 1 to 100. Default 40, as for whole paths.
    pub bandwidth_hz: f64,
    /// No plant whose parameters deviate by up to this share makes the RMS error of a path that is known ahead larger, 0 to 0.5. Default 0.3, as for whole paths.
    pub robust_to: f64,
    /// Standard uncertainty of parameters whose model states none, as a share of each, 0 to 1. Default 0.1, as for whole paths.
    pub unstated: f64,
    /// How far the filter reaches into the past and into the future, s, 0.05 to 1. Default 0.5: four periods of a mode of 8 Hz; for delay and lags
    /// alone a fifth is enough.
    pub reach_s: f64,
    /// Spacing of the taps, s, 1e-4 to 0.02; rounded up to a multiple of the commands' period. Default 0.004: a sixth of the period of the default bandwidth.
    pub spacing_s: f64,
}

impl Default for TapsSettings {
    fn default() -> Self {
        Self { bandwidth_hz: 40.0, robust_to: 0.3, unstated: 0.1, reach_s: 0.5, spacing_s: 0.004 }
    }
}

/// Why there are no taps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TapsError {
    /// No joint of the model has a delay, a lag or a mode.
    NothingInTime,
    /// Commands come too slowly for the bandwidth: their period and the longest that it allows, s.
    Sampling {
        /// Between two commands, s.
        period_s: f64,
        /// The longest that the bandwidth allows, s.
        longest_s: f64,
    },
}

/// Samples per period of the bandwidth that a filter needs.
const SAMPLES_PER_PERIOD: f64 = 4.0;
/// Relative rounding of a period.
const ROUNDING: f64 = 1e-6;
/// The response is computed over so many windows, so that what lies outside of one does not alias into it.
const WINDOWS: usize = 16;
/// The outer share of each side over which taps fade.
const FADED: f64 = 0.4;

/// Taps of all joints of an arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Taps {
    /// Commands from one tap to the next.
    stride: usize,
    /// Between two commands, s.
    period_s: f64,
    /// How many joints the arm has.
    joints: usize,
    /// Of all joints, from the farthest past to the farthest future; zero for a joint without dynamics.
    rows: Vec<Joints>,
    /// Of each number of known steps, see [`Taps::after`].
    rest: Vec<[Joints; 2]>,
    /// Sum of the lags of each joint, s; zero where a joint has a mode.
    lags_s: Joints,
    /// Delay plus lags of the slowest joint, s.
    lead_s: f64,
}

impl Taps {
    /// Taps for commands every `period_s` of a robot whose joints are `plants`.
    ///
    /// # Errors
    /// [`TapsError`].
    pub fn new(plants: &Plants, period_s: f64, settings: &TapsSettings) -> Result<Self, TapsError> {
        if plants.is_empty() {
            return Err(TapsError::NothingInTime);
        }
        let longest_s = 1.0 / (SAMPLES_PER_PERIOD * settings.bandwidth_hz);
        // A rate that is exactly four times the bandwidth is enough, whatever its period is rounded to.
        if period_s > longest_s * (1.0 + ROUNDING) {
            return Err(TapsError::Sampling { period_s, longest_s });
        }
        let spacing_s = settings.spacing_s.clamp(period_s, longest_s.max(period_s));
        // Rounded up to whole periods, where the bandwidth allows.
        let up = (spacing_s / period_s - ROUNDING).ceil();
        let fits = up * period_s <= longest_s * (1.0 + ROUNDING);
        let stride = if fits { up as usize } else { (spacing_s / period_s + ROUNDING) as usize };
        let step_s = stride as f64 * period_s;
        let half = (settings.reach_s / step_s).ceil() as usize;
        let mut rows = vec![[0.0; JOINTS_MAX]; 2 * half + 1];
        let mut lags_s = [0.0; JOINTS_MAX];
        // A lag attenuates the excitation of a mode.
        let rings = plants.joints.iter().any(|plant| !plant.modes.is_empty());
        for (joint, plant) in plants.joints.iter().enumerate().take(JOINTS_MAX) {
            if plant.is_identity() {
                continue;
            }
            let of_joint = taps(plant, half, step_s, settings);
            rows.iter_mut().zip(of_joint).for_each(|(row, tap)| row[joint] = tap);
            lags_s[joint] = if rings { 0.0 } else { sum(&plant.lags_s) };
        }
        let rest = rest(&rows[half + 1..]);
        let lead_s = plants.joints.iter().map(lead_s).fold(0.0, f64::max);
        let joints = plants.joints.len();
        Ok(Self { stride, period_s, joints, rows, rest, lags_s, lead_s })
    }

    /// Commands from one tap to the next.
    #[must_use]
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// How many joints the arm has.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// Between two commands, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Taps on each side of the present one.
    #[must_use]
    pub fn half(&self) -> usize {
        self.rows.len() / 2
    }

    /// Setpoints ahead of a command without which the delay cannot be compensated: those of delay plus lags of the slowest joint.
    #[must_use]
    pub fn commands_needed(&self) -> usize {
        ((self.lead_s / self.period_s - 1e-6).ceil() as usize).min(self.commands_ahead())
    }

    /// Sum of the lags of each joint, s, as far as they can be compensated without a horizon: zero if any joint has a mode.
    #[must_use]
    pub fn lags_s(&self) -> &Joints {
        &self.lags_s
    }

    /// Setpoints ahead of a command that the filter makes use of.
    #[must_use]
    pub fn commands_ahead(&self) -> usize {
        self.half() * self.stride
    }

    /// Those of the past, from the nearest on.
    pub fn past(&self) -> impl Iterator<Item = &Joints> {
        self.rows[..self.half()].iter().rev()
    }

    /// Those of the future, from the nearest on.
    pub fn future(&self) -> impl Iterator<Item = &Joints> {
        self.rows[self.half() + 1..].iter()
    }

    /// What a path that goes on at constant speed after `known` steps contributes from there on: the sum of the taps, and that of the steps since times the taps.
    #[must_use]
    pub fn after(&self, known: usize) -> &[Joints; 2] {
        &self.rest[known.min(self.half())]
    }
}

/// Of each number of known steps, the sums of [`Taps::after`].
fn rest(future: &[Joints]) -> Vec<[Joints; 2]> {
    let mut sums = vec![[[0.0; JOINTS_MAX]; 2]];
    for row in future.iter().rev() {
        let [taps, steps] = sums[sums.len() - 1];
        let taps: Joints = std::array::from_fn(|i| taps[i] + row[i]);
        sums.push([taps, std::array::from_fn(|i| steps[i] + taps[i])]);
    }
    sums.reverse();
    sums
}

/// Taps of one joint, from `-half` (past) to `half` (future).
fn taps(plant: &Plant, half: usize, step_s: f64, settings: &TapsSettings) -> Vec<f64> {
    let TapsSettings { bandwidth_hz, robust_to, .. } = *settings;
    let length = (WINDOWS * 2 * half).next_power_of_two();
    let bins_hz: Vec<f64> = (0..=length / 2).map(|k| k as f64 / (length as f64 * step_s)).collect();
    let design = Design { plant, bandwidth_hz, robust_to, source: Source::Path };
    let mut gains = design.gains(&bins_hz).gains;
    // Of a real signal both are real.
    let last = gains.len() - 1;
    (gains[0].im, gains[last].im) = (0.0, 0.0);
    let mut response = vec![0.0; length];
    let done = RealFftPlanner::new().plan_fft_inverse(length).process(&mut gains, &mut response);
    debug_assert!(done.is_ok(), "the lengths are the plan's own");
    let at = |k: isize| {
        // A tap of the future answers to the response before its cause.
        let place = (-k).rem_euclid(length as isize) as usize;
        response[place] / length as f64 * faded(k.unsigned_abs(), half)
    };
    let half = half as isize;
    let mut taps: Vec<f64> = (-half..=half).map(at).collect();
    lead_exactly(&mut taps, step_s, lead_s(plant));
    taps
}

/// Delay of a path at constant speed, s.
fn lead_s(plant: &Plant) -> f64 {
    sum(&plant.delays_s) + sum(&plant.lags_s)
}

fn sum(numbers: &[Uncertain]) -> f64 {
    numbers.iter().map(|number| number.value).sum()
}

/// 1 in the middle, 0 beyond the ends of the window.
fn faded(k: usize, half: usize) -> f64 {
    let place = k as f64 / (half + 1) as f64;
    let share = ((place - (1.0 - FADED)) / FADED).max(0.0);
    0.5 + 0.5 * (PI * share).cos()
}

/// Adds a term to the taps that is odd in `k` and fades with them, so that the lead at constant speed is that of `lead_s`.
fn lead_exactly(taps: &mut [f64], step_s: f64, lead_s: f64) {
    let half = (taps.len() / 2) as isize;
    let place = |at: usize| at as isize - half;
    let slope = |taps: &[f64]| -> f64 {
        taps.iter().enumerate().map(|(at, tap)| tap * place(at) as f64 * step_s).sum()
    };
    let odd: Vec<f64> = (0..taps.len())
        .map(|at| place(at) as f64 * faded(place(at).unsigned_abs(), half as usize))
        .collect();
    let share = (lead_s - slope(taps)) / slope(&odd);
    if share.is_finite() {
        taps.iter_mut().zip(&odd).for_each(|(tap, odd)| *tap += share * odd);
    }
}

#[cfg(test)]
mod tests;
