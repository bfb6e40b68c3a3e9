//! Inverse joint dynamics as taps of a finite impulse response filter: from the path around an instant to the lead at that instant.
//!
//! `c(t) = Σ_k w_k (q(t + k Δ) − q(t))`, with `w` the inverse Fourier transform of [`Design::gains`] of a path (Wiener's inverse, scaled to be robust), faded out by a
//! raised cosine towards both ends of the window (window method of filter design; Oppenheim, Schafer, *Discrete-Time Signal Processing*, section 7.5).
//! Differences to the present point leave a joint at rest uncorrected. The taps are adjusted by a term that is odd in `k`, such that at constant speed the lead corresponds to exactly
//! the sum of delay and lags.
//!
//! The response is longer than the window, the more so the less damped a mode is and the larger the assumed parameter deviation. For a mode with 2 % damping the window of
//! 0.5 s truncates about a hundredth of the sum of all taps.

use crate::inverse::{Design, Source};
use crate::plant::{Plant, Plants, UncertainValue};
use physics::{JOINTS_MAX, Joints};
use realfft::RealFftPlanner;
use std::f64::consts::PI;

/// Settings of the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TapsSettings {
    /// Frequency at which the weight of the correction's third derivative equals that of the path error, Hz, 1 to 100. Default 40, as for whole paths.
    pub bandwidth_hz: f64,
    /// Relative parameter deviation for which the RMS error of a path that is known ahead does not increase, 0 to 0.5. Default 0.3, as for whole paths.
    pub robust_to: f64,
    /// Relative standard uncertainty of parameters without a stated one, 0 to 1. Default 0.1, as for whole paths.
    pub unstated: f64,
    /// Half length of the filter (past and future), s, 0.05 to 1. Default 0.5: four periods of a mode of 8 Hz; for delay and lags alone a fifth of it
    /// suffices.
    pub reach_s: f64,
    /// Spacing of the taps, s, 1e-4 to 0.02; rounded up to a multiple of the commands' period. Default 0.004: a sixth of the period of the default bandwidth.
    pub spacing_s: f64,
}

impl Default for TapsSettings {
    fn default() -> Self {
        Self { bandwidth_hz: 40.0, robust_to: 0.3, unstated: 0.1, reach_s: 0.5, spacing_s: 0.004 }
    }
}

/// Reason why the filter cannot be designed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TapsError {
    /// No joint of the model has a delay, a lag or a mode.
    NothingInTime,
    /// The command period is too long for the bandwidth.
    Sampling {
        /// Command period, s.
        period_s: f64,
        /// Longest period allowed by the bandwidth, s.
        longest_s: f64,
    },
}

/// Required samples per period of the bandwidth frequency.
const SAMPLES_PER_PERIOD: f64 = 4.0;
/// Relative rounding tolerance of a period.
const ROUNDING: f64 = 1e-6;
/// Length over which the response is computed, in windows, to avoid time aliasing.
const WINDOWS: usize = 16;
/// Outer fraction of each side over which the taps fade out.
const FADE_FRACTION: f64 = 0.4;

/// Taps of all joints of an arm.
#[derive(Clone, Debug, PartialEq)]
pub struct FilterTaps {
    /// Command periods between two taps.
    stride: usize,
    /// Command period, s.
    period_s: f64,
    /// Number of joints of the arm.
    joints: usize,
    /// Taps of all joints, oldest first; zero for a joint without dynamics.
    rows: Vec<Joints>,
    /// By number of known steps, see [`FilterTaps::extrapolation_taps`].
    rest: Vec<[Joints; 2]>,
    /// Sum of the lags of each joint, s; zero if any joint has a mode.
    lags_s: Joints,
    /// Delay plus lags of the slowest joint, s.
    lead_s: f64,
}

impl FilterTaps {
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
        let rest = extrapolation_sums(&rows[half + 1..]);
        let lead_s = plants.joints.iter().map(lead_s).fold(0.0, f64::max);
        let joints = plants.joints.len();
        Ok(Self { stride, period_s, joints, rows, rest, lags_s, lead_s })
    }

    /// Command periods between two taps.
    #[must_use]
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Number of joints of the arm.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// Command period, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Taps on each side of the present one.
    #[must_use]
    pub fn side_count(&self) -> usize {
        self.rows.len() / 2
    }

    /// Number of setpoints after a command required to compensate the delay: delay plus lags of the slowest joint.
    #[must_use]
    pub fn commands_needed(&self) -> usize {
        ((self.lead_s / self.period_s - 1e-6).ceil() as usize).min(self.commands_ahead())
    }

    /// Sum of the lags of each joint that is compensated without a horizon, s: zero if any joint has a mode.
    #[must_use]
    pub fn lags_s(&self) -> &Joints {
        &self.lags_s
    }

    /// Number of setpoints after a command that the filter uses.
    #[must_use]
    pub fn commands_ahead(&self) -> usize {
        self.side_count() * self.stride
    }

    /// Taps of the past, newest first.
    pub fn past(&self) -> impl Iterator<Item = &Joints> {
        self.rows[..self.side_count()].iter().rev()
    }

    /// Taps of the future, nearest first.
    pub fn future(&self) -> impl Iterator<Item = &Joints> {
        self.rows[self.side_count() + 1..].iter()
    }

    /// Contribution of a path extrapolated at constant speed after `known` steps: sum of the remaining taps, and sum of step number times tap.
    #[must_use]
    pub fn extrapolation_taps(&self, known: usize) -> &[Joints; 2] {
        &self.rest[known.min(self.side_count())]
    }
}

/// By number of known steps, the sums of [`FilterTaps::extrapolation_taps`].
fn extrapolation_sums(future: &[Joints]) -> Vec<[Joints; 2]> {
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
    // For a real signal the first and the last bin are real.
    let last = gains.len() - 1;
    (gains[0].im, gains[last].im) = (0.0, 0.0);
    let mut response = vec![0.0; length];
    let done = RealFftPlanner::new().plan_fft_inverse(length).process(&mut gains, &mut response);
    debug_assert!(done.is_ok(), "the lengths are the plan's own");
    let tap = |k: isize| {
        // A tap of the future multiplies the acausal part of the response.
        let place = (-k).rem_euclid(length as isize) as usize;
        response[place] / length as f64 * fade_window(k.unsigned_abs(), half)
    };
    let half = half as isize;
    let mut taps: Vec<f64> = (-half..=half).map(tap).collect();
    correct_lead(&mut taps, step_s, lead_s(plant));
    taps
}

/// Lead required at constant speed, s: delay plus lags.
fn lead_s(plant: &Plant) -> f64 {
    sum(&plant.delays_s) + sum(&plant.lags_s)
}

fn sum(numbers: &[UncertainValue]) -> f64 {
    numbers.iter().map(|number| number.value).sum()
}

/// Window: 1 in the middle, 0 beyond its ends.
fn fade_window(k: usize, half: usize) -> f64 {
    let place = k as f64 / (half + 1) as f64;
    let share = ((place - (1.0 - FADE_FRACTION)) / FADE_FRACTION).max(0.0);
    0.5 + 0.5 * (PI * share).cos()
}

/// Adds a windowed term that is odd in `k` to the taps, so that the lead at constant speed equals `lead_s`.
fn correct_lead(taps: &mut [f64], step_s: f64, lead_s: f64) {
    let half = (taps.len() / 2) as isize;
    let place = |index: usize| index as isize - half;
    let slope = |taps: &[f64]| -> f64 {
        taps.iter().enumerate().map(|(index, tap)| tap * place(index) as f64 * step_s).sum()
    };
    let odd: Vec<f64> = (0..taps.len())
        .map(|index| place(index) as f64 * fade_window(place(index).unsigned_abs(), half as usize))
        .collect();
    let share = (lead_s - slope(taps)) / slope(&odd);
    if share.is_finite() {
        taps.iter_mut().zip(&odd).for_each(|(tap, odd)| *tap += share * odd);
    }
}

#[cfg(test)]
mod tests;
