//! Trims the tool by measurements during operation: a disturbance observer in addition to the model.
//!
//! The measured point is compared with the model's prediction for the time of the measurement and the correction sent then. The difference is the model's
//! error, independent of the trim: the observer's estimate `d` follows it through two equal first-order low passes, and the tool's target is displaced by `-d`, within a bound.
//!
//! ```text
//! y(t) = measured(t) − model(command, correction sent)(t − reaction)     d = y / (1 + s T/2)²     trim = −share · d
//! ```
//!
//! With the stated delay the trim cancels out of `y`: no loop is closed, at any gain. A deviation from the stated delay closes one, `F (e^(−sτ) − e^(−sτ'))`, the internal model control of a
//! static plant (Morari and Zafiriou, *Robust Process Control*, 1989, ch. 3). Two stated delays of time constant `T` keep a gain margin of 2 at every delay up to twice the stated one;
//! the default [`TRIM_TIME_CONSTANT_DELAYS`] one of 3.7, with about 5 % overshoot there. The stated delay is latency, interval of the measurements and reaction of the robot together.
//!
//! The estimate is of an error and not an integral, so it does not wind up while the correction is bounded, in shadow mode, or while a joint ramps.
//! Noise of standard deviation `s` at an interval `h` leaves about `s √(h / 2T)` in the trim.
//!
//! Invariants: finite; `‖trim‖ ≤ limit`; it is ramped in and out within a second, with minimum
//! jerk; the same sequence of inputs gives the same bits. A change of model resets it at once: the
//! joints' limiters ramp it to zero.

mod outlier_gate;
#[cfg(test)]
mod tests;

use crate::history::History;
use crate::outcome::{TrimReason, TrimState};
use outlier_gate::{MeasurementVerdict, OutlierGate};

use glam::DVec3;
use libm::{expm1, sqrt};
pub use outlier_gate::OutlierRules;
use physics::Frame;

/// Time constant unless set, in stated delays.
pub const TRIM_TIME_CONSTANT_DELAYS: f64 = 5.0;
/// Rules for ramping and for accepting measurements; constants that a cell does not set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrimRules {
    /// Time of the share from zero to one and back, s; 0.1 to 10. Default 1: so slow that a delay
    /// of 80 ms instead of 40 makes it overshoot by 5 % (`cargo test -p corrector trim::`).
    pub fade_s: f64,
    /// A longer time between two cycles counts as a pause, s; above the longest cycle of a cell with an instrument. Default 0.05.
    pub pause_s: f64,
    /// How far a stamp may lie ahead of the clock, s; 0 to 1. Default 0.005, as for force samples: clocks that are synchronised by PTP or NTP on one network differ by less.
    pub ahead_s: f64,
    /// The largest distance of a measured point, m; above 0. Default 1000: beyond the range of any
    /// tracker.
    pub distance_max_m: f64,
    /// Deviations beyond this many standard deviations are not noise; no unit, above 0. Default 5:
    /// probability 1.5e-5 in three dimensions (chi distribution).
    pub noise_sigmas: f64,
    /// After this many intervals without a measurement the estimate is held, and the reason is that none is received, no longer that the last one was refused;
    /// no unit, 1 or more. Default 2.5: a single dropout does not interrupt it.
    pub fresh_intervals: f64,
    /// When measurements agree.
    pub gate: OutlierRules,
}

impl Default for TrimRules {
    fn default() -> Self {
        Self {
            fade_s: 1.0,
            pause_s: 0.05,
            ahead_s: 0.005,
            distance_max_m: 1e3,
            noise_sigmas: 5.0,
            fresh_intervals: 2.5,
            gate: OutlierRules::default(),
        }
    }
}

/// Settings of a cell for its instrument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrimSettings {
    /// Whether the trim is sent; otherwise it is estimated and reported.
    pub is_sent: bool,
    /// From the instrument's coordinates to the robot's base.
    pub base_from_instrument: Frame,
    /// The measured point, in tool coordinates, m.
    pub point_in_tool_m: DVec3,
    /// Time from a measurement to its arrival, s.
    pub latency_s: f64,
    /// Interval of the measurements, s: 0.001 to 0.1.
    pub interval_s: f64,
    /// Time from a command to the motion of the tool, s.
    pub reaction_s: f64,
    /// Time constant of the estimate, s; at least twice [`TrimSettings::delay_s`].
    pub time_constant_s: f64,
    /// Standard deviation of a measurement, of each axis, m.
    pub noise_m: f64,
    /// Largest change of the model's error from one measurement to the next, m: a larger one is a
    /// jump of the instrument.
    pub jump_m: f64,
    /// Without measurements the trim is held for this long, s, then it ramps to zero.
    pub hold_s: f64,
    /// The largest trim, m.
    pub limit_m: f64,
    /// Constants that a cell does not set.
    pub rules: TrimRules,
}

impl TrimSettings {
    /// The total delay for which the time constant is chosen, s.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        self.latency_s + self.interval_s + self.reaction_s
    }

    /// Noise in the trim, standard deviation of each axis, m.
    #[must_use]
    pub fn trim_noise_m(&self) -> f64 {
        self.noise_m * sqrt(self.interval_s / (2.0 * self.time_constant_s))
    }
}

/// A measured point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointSample {
    /// In the instrument's coordinates, m.
    pub point_m: DVec3,
    /// When it was measured, in the clock of the cycle, ns.
    pub t_ns: u64,
}

/// State of the trim.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrimReport {
    /// Its state.
    pub state: TrimState,
    /// Why.
    pub reason: TrimReason,
    /// Displacement of the tool's target, base frame, m.
    pub trim_m: DVec3,
    /// Estimate of the model's error, base frame, m: real minus predicted.
    pub model_error_m: DVec3,
    /// Measurements received.
    pub measurements: u64,
    /// Measurements refused.
    pub refused: u64,
}

/// The trim of one tool.
#[derive(Clone, Debug)]
pub struct Trim {
    settings: TrimSettings,
    history: History<DVec3>,
    gate: OutlierGate,
    /// The newest accepted deviation, and when it was received.
    deviation_m: DVec3,
    accepted_ns: Option<u64>,
    /// When the newest measurement was received, accepted or not.
    received_ns: Option<u64>,
    /// Both low-passes; the second is the estimate.
    low_passes_m: [DVec3; 2],
    /// Whether the estimate has started.
    has_begun: bool,
    share: f64,
    stepped_ns: u64,
    stamp_ns: u64,
    last_refusal: TrimReason,
    report: TrimReport,
}

impl Trim {
    /// Without measurements yet.
    #[must_use]
    pub fn new(settings: TrimSettings) -> Self {
        Self {
            settings,
            history: History::new(),
            gate: OutlierGate::new(settings.rules.gate),
            deviation_m: DVec3::ZERO,
            accepted_ns: None,
            received_ns: None,
            low_passes_m: [DVec3::ZERO; 2],
            has_begun: false,
            share: 0.0,
            stepped_ns: 0,
            stamp_ns: 0,
            last_refusal: TrimReason::None,
            report: TrimReport::empty(TrimState::Waiting),
        }
    }

    /// For a new model: the estimate does not apply to it.
    pub fn model_changed(&mut self) {
        self.history.clear();
        self.gate = OutlierGate::new(self.settings.rules.gate);
        (self.low_passes_m, self.has_begun, self.share) = ([DVec3::ZERO; 2], false, 0.0);
        self.accepted_ns = None;
    }

    /// Accepts the instrument again after a jump: its registration was checked. The trim continues
    /// from its present value.
    pub fn rearm(&mut self) {
        self.gate = OutlierGate::new(self.settings.rules.gate);
    }

    /// Adds a measurement received by `now_ns`.
    pub fn add_measurement(&mut self, sample: &PointSample, now_ns: u64) {
        self.report.measurements += 1;
        self.received_ns = Some(now_ns);
        match self.deviation(sample, now_ns) {
            Ok(deviation_m) => match self.gate.judge(deviation_m, self.deviation_max_m()) {
                MeasurementVerdict::Accepted => self.accept(deviation_m, now_ns),
                MeasurementVerdict::Starting => self.last_refusal = TrimReason::None,
                MeasurementVerdict::Refused => self.refuse(TrimReason::Jumped),
            },
            Err(reason) => self.refuse(reason),
        }
    }

    fn accept(&mut self, deviation_m: DVec3, now_ns: u64) {
        self.deviation_m = deviation_m;
        self.accepted_ns = Some(now_ns);
        self.last_refusal = TrimReason::None;
        if !self.has_begun {
            (self.low_passes_m, self.has_begun) = ([deviation_m; 2], true);
        }
    }

    /// Displacement of the tool's target in the cycle at `now_ns`, base frame, m; `corrects`:
    /// whether corrections are sent.
    pub fn step(&mut self, now_ns: u64, corrects: bool) -> DVec3 {
        let dt_s = seconds(now_ns.saturating_sub(self.stepped_ns));
        let dt_s = if dt_s <= self.settings.rules.pause_s { dt_s } else { 0.0 };
        self.stepped_ns = now_ns;
        let TrimSettings { is_sent, interval_s, time_constant_s, hold_s, rules, .. } =
            self.settings;
        let since_s = |at_ns: Option<u64>| {
            at_ns.map_or(f64::INFINITY, |at_ns| seconds(now_ns.saturating_sub(at_ns)))
        };
        let age_s = since_s(self.accepted_ns);
        let fresh_s = rules.fresh_intervals * interval_s + dt_s;
        let is_fresh = self.gate.is_steady() && age_s <= fresh_s;
        if since_s(self.received_ns) > fresh_s {
            self.last_refusal = TrimReason::None;
        }
        if is_fresh {
            let part = -expm1(-2.0 * dt_s / time_constant_s);
            self.low_passes_m[0] += part * (self.deviation_m - self.low_passes_m[0]);
            self.low_passes_m[1] += part * (self.low_passes_m[0] - self.low_passes_m[1]);
        }
        let is_sent = is_sent && corrects;
        let holds = is_fresh || age_s <= hold_s;
        let by = dt_s / rules.fade_s;
        let by = if is_sent && holds { by } else { -by };
        self.share = (self.share + by).clamp(0.0, 1.0);
        let asked_m = -minimum_jerk(self.share) * self.low_passes_m[1];
        self.report.trim_m = asked_m.clamp_length_max(self.settings.limit_m);
        self.report.model_error_m = self.low_passes_m[1];
        let is_bounded = self.report.trim_m != asked_m;
        self.set_state(is_sent, is_fresh, holds, is_bounded);
        self.report.trim_m
    }

    /// Stores the tool pose that the model predicts for what is sent at `now_ns`; `None` if it
    /// cannot be predicted.
    pub fn store_prediction(&mut self, now_ns: u64, base_from_tool: Option<&Frame>) {
        if let Some(tool) = base_from_tool {
            self.history.push(now_ns, tool.point(self.settings.point_in_tool_m));
        }
    }

    /// The measured point by the registration, base frame, m.
    #[must_use]
    pub fn in_base(&self, sample: &PointSample) -> DVec3 {
        self.settings.base_from_instrument.point(sample.point_m)
    }

    /// State after the last step.
    #[must_use]
    pub fn report(&self) -> &TrimReport {
        &self.report
    }

    /// From the predicted point at the time of the measurement to the measured one.
    fn deviation(&mut self, sample: &PointSample, now_ns: u64) -> Result<DVec3, TrimReason> {
        let TrimSettings { latency_s, interval_s, reaction_s, rules, .. } = self.settings;
        let PointSample { point_m, t_ns } = *sample;
        if !point_m.is_finite() || point_m.length() > rules.distance_max_m {
            return Err(TrimReason::NotFinite);
        }
        if t_ns > now_ns.saturating_add((rules.ahead_s * 1e9) as u64) {
            return Err(TrimReason::Ahead);
        }
        if t_ns <= self.stamp_ns {
            return Err(TrimReason::OutOfOrder);
        }
        self.stamp_ns = t_ns;
        if seconds(now_ns.saturating_sub(t_ns)) > 2.0 * (latency_s + interval_s) {
            return Err(TrimReason::Late);
        }
        let in_force_ns = t_ns.saturating_sub((reaction_s * 1e9) as u64);
        let expected_m = self.history.at(in_force_ns).ok_or(TrimReason::NotPredicted)?;
        Ok(self.in_base(sample) - expected_m)
    }

    fn refuse(&mut self, reason: TrimReason) {
        self.report.refused += 1;
        self.last_refusal = reason;
    }

    /// Largest accepted distance of a measurement from the previous ones, m.
    fn deviation_max_m(&self) -> f64 {
        self.settings.jump_m + self.settings.rules.noise_sigmas * self.settings.noise_m
    }

    fn set_state(&mut self, is_sent: bool, is_fresh: bool, holds: bool, is_bounded: bool) {
        let missing = match self.last_refusal {
            _ if self.gate.has_jumped() => TrimReason::Jumped,
            TrimReason::None => TrimReason::NoMeasurement,
            refusal => refusal,
        };
        let bounded = if is_bounded { TrimReason::Bounded } else { TrimReason::None };
        let (state, reason) = match (is_fresh, is_sent) {
            (true, true) => (TrimState::Trimming, bounded),
            (true, false) if self.share > 0.0 => (TrimState::Ramping, TrimReason::None),
            (true, false) => (TrimState::Observing, TrimReason::None),
            (false, true) if holds => (TrimState::Holding, missing),
            (false, _) if self.share > 0.0 => (TrimState::Ramping, missing),
            (false, _) => (TrimState::Waiting, missing),
        };
        (self.report.state, self.report.reason) = (state, reason);
    }
}

impl TrimReport {
    /// No measurement, no estimate.
    #[must_use]
    pub fn empty(state: TrimState) -> Self {
        let zero = DVec3::ZERO;
        let reason = TrimReason::None;
        Self { state, reason, trim_m: zero, model_error_m: zero, measurements: 0, refused: 0 }
    }
}

/// Fades the share without a step of acceleration at its ends (minimum jerk: Flash and Hogan, J.
/// Neurosci. 5, 1985), so that joints follow it within their jerk.
fn minimum_jerk(x: f64) -> f64 {
    x * x * x * (10.0 + x * (6.0 * x - 15.0))
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}
