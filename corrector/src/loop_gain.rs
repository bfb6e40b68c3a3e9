//! Online estimation of the loop gain of force compensation.
//!
//! In contact with stiffness k a robot of compliance C, corrected by a share g of the filtered force y along d, obeys
//! `y = y₀ + γ w`, `w = g y` low-passed as y is, `γ = Ĉ k/(1 + k C)`. γ, the drift of y₀ and their standard errors are estimated from the
//! one change of g that is needed anyway: from zero to one half. w depends on y, so that least squares would be biased by changes of the
//! force itself; g does not, and serves as instrumental variable. Source: Söderström and Stoica, Instrumental variable methods, 1983.
//!
//! Not valid if the contact changes within the window; the residual then widens the standard error.
//! Invariant: γ counts as known only if it differs significantly from one half. The gate decides on
//! the share.

use crate::low_pass::{LowPass, StepCoefficients};
use glam::DVec3;
use nalgebra::{Matrix3, Vector3};

/// A contact begins or ends as the filtered force crosses this, N.
pub(crate) const CONTACT_N: f64 = 1.0;
/// Loop gain from which on the wrench is taken as zero.
pub(crate) const GAIN_MAX: f64 = 0.5;
/// The force must have been steady for this long, s; the filter's own transient is over by then.
const SETTLING_S: f64 = 0.5;
/// Steady: changed by less than this share, or by less than [`CONTACT_N`].
const STEADY_SHARE: f64 = 0.05;
/// A force that has not become steady after this time is used as it is, s.
const SETTLING_MAX_S: f64 = 3.0;
/// Baseline before the share rises, s.
const BASELINE_S: f64 = 0.8;
/// Interval between samples, s: closer ones are correlated by the filter.
const SPACING_S: f64 = 0.1;
const SAMPLES: usize = 25;
/// Required distance between γ and its bound, in standard errors. Half of it allows for samples
/// that are still correlated.
const SIGNIFICANCE: f64 = 6.0;
/// Added to the standard error, for the robot's lag and the model's nonlinearity, which the
/// equation neglects.
const ERROR_FLOOR: f64 = 0.005;

/// State of the estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum LoopGainVerdict {
    /// No contact, or the baseline is being measured before the share rises.
    #[default]
    Waiting,
    /// The share rises, or γ is not significantly different from its bound: one half is safe.
    Unknown,
    /// Below its bound.
    Low,
    /// Above its bound.
    High,
}

/// Estimates γ once per contact.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LoopGainEstimator {
    verdict: LoopGainVerdict,
    /// Unit vector of the observed force, base axes.
    direction: DVec3,
    /// Since the contact began, and since the force last changed by more than is steady, s.
    contact_s: f64,
    steady_s: f64,
    steady_at: DVec3,
    /// Time since the baseline began, s; `None` before.
    observed_s: Option<f64>,
    share: LowPass,
    taken: LowPass,
    samples: [Sample; SAMPLES],
    count: usize,
    gain: Option<f64>,
    /// The force at which γ was found, N.
    force_at_estimate: DVec3,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sample {
    time_s: f64,
    share: f64,
    taken: f64,
    force: f64,
}

impl LoopGainEstimator {
    pub(crate) fn verdict(&self) -> LoopGainVerdict {
        self.verdict
    }

    /// The direction along which γ was estimated, base axes.
    pub(crate) fn direction(&self) -> DVec3 {
        self.direction
    }

    /// γ of this contact, once estimated.
    pub(crate) fn gain(&self) -> Option<f64> {
        self.gain
    }

    /// Discards the estimate of this contact.
    pub(crate) fn rearm(&mut self) {
        *self = Self { direction: self.direction, ..Self::default() };
    }

    /// Adds the filtered force (base axes, N) and the present share.
    pub(crate) fn update(&mut self, force: DVec3, share: f64, corner_hz: f64, dt_s: f64) {
        if force.length_squared() < CONTACT_N * CONTACT_N {
            return self.rearm();
        }
        if let Some(watched_s) = &mut self.observed_s {
            *watched_s += dt_s;
        } else {
            self.track_settling(force, dt_s);
            // A share left over from before would spoil the baseline.
            let ready = self.steady_s >= SETTLING_S || self.contact_s >= SETTLING_MAX_S;
            if !ready || share != 0.0 {
                return;
            }
            self.observed_s = Some(0.0);
            self.direction = force / libm::sqrt(force.length_squared());
        }
        self.sample(self.direction.dot(force), share, corner_hz, dt_s);
        self.decide(force);
    }

    fn track_settling(&mut self, force: DVec3, dt_s: f64) {
        self.contact_s += dt_s;
        self.steady_s += dt_s;
        let most = CONTACT_N.max(STEADY_SHARE * libm::sqrt(force.length_squared()));
        if (force - self.steady_at).length_squared() > most * most {
            (self.steady_at, self.steady_s) = (force, 0.0);
        }
    }

    fn sample(&mut self, force: f64, share: f64, corner_hz: f64, dt_s: f64) {
        let coefficients = StepCoefficients::new(corner_hz, dt_s);
        let taken = self.taken.step(share * force, &coefficients);
        let share = self.share.step(share, &coefficients);
        let time_s = self.observed_s.unwrap_or_default();
        if self.count < SAMPLES && time_s >= self.count as f64 * SPACING_S {
            self.samples[self.count] = Sample { time_s, share, taken, force };
            self.count += 1;
        }
    }

    fn decide(&mut self, force: DVec3) {
        match self.verdict {
            LoopGainVerdict::Waiting if self.observed_s >= Some(BASELINE_S) => {
                self.verdict = LoopGainVerdict::Unknown;
            }
            LoopGainVerdict::Unknown if self.count == SAMPLES && self.gain.is_none() => {
                let Some((gain, error)) = instrumental_variable_fit(&self.samples) else { return };
                (self.gain, self.force_at_estimate) = (Some(gain), force);
                let clear = SIGNIFICANCE * (error + ERROR_FLOOR);
                if gain + clear < GAIN_MAX {
                    self.verdict = LoopGainVerdict::Low;
                } else if gain - clear > GAIN_MAX {
                    self.verdict = LoopGainVerdict::High;
                }
            }
            // The force has doubled or reversed: not the contact for which γ was estimated.
            LoopGainVerdict::Low if has_changed(force, self.force_at_estimate) => {
                self.verdict = LoopGainVerdict::Unknown;
            }
            _ => {}
        }
    }
}

fn has_changed(force: DVec3, before: DVec3) -> bool {
    let most = libm::sqrt(before.length_squared()) + 5.0 * CONTACT_N;
    (force - before).length_squared() > most * most
}

/// γ and its standard error: instrumental variables with `[1, t, share]` for `[1, t, taken]`.
fn instrumental_variable_fit(samples: &[Sample; SAMPLES]) -> Option<(f64, f64)> {
    let regressors = |s: &Sample| Vector3::new(1.0, s.time_s, s.taken);
    let instruments = |s: &Sample| Vector3::new(1.0, s.time_s, s.share);
    let (mut zx, mut zz, mut zy) = (Matrix3::zeros(), Matrix3::zeros(), Vector3::zeros());
    for s in samples {
        let (x, z) = (regressors(s), instruments(s));
        zx += z * x.transpose();
        zz += z * z.transpose();
        zy += z * s.force;
    }
    let inverse = zx.try_inverse()?;
    let fit = inverse * zy;
    let residual = |s: &Sample| s.force - regressors(s).dot(&fit);
    let squares: f64 = samples.iter().map(|s| residual(s) * residual(s)).sum();
    let covariance = inverse * zz * inverse.transpose() * (squares / (SAMPLES - 3) as f64);
    let error = libm::sqrt(covariance[(2, 2)]);
    (fit[2].is_finite() && error.is_finite()).then_some((fit[2], error))
}
