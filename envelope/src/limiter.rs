//! Limits one joint's correction in position, rate and jerk.
//!
//! The next output is the first of these that the limits allow:
//! 1. `requested`, plus an offset that decays to zero along a plan. The offset is zero in normal
//!    operation; a jump of `requested` becomes an offset (this is known as inertialisation).
//! 2. One step of a plan from the present motion onto the trend of `requested`, while `requested` jumps or
//!    fluctuates too much to be followed. Plans use half the jerk limit; the other half is left for `requested`.
//! 3. One step of the fastest stop, at full jerk.
//!
//! Limits may change at any time. A motion that cannot stop within the new ones keeps the larger of
//! the old and the new ones, each separately, while it brakes at the larger jerk; the new ones apply
//! from the first output that can stop within them.
//!
//! Invariant: from every output the motion can stop within the present limits (see `motion`). An option
//! is used only if this remains true, hence the third is always possible.

use crate::Limits;
use crate::elapsed::Elapsed;
use crate::motion::Motion;
use crate::plan::{Plan, Ramp};
use crate::track::{SampleTimes, Track};

/// Shares of rate and jerk that plans may use; the rest is left for `requested` itself.
const PLANNED_RATE: f64 = 0.9;
const PLANNED_JERK: f64 = 0.5;
/// Least share of the rate for a plan relative to a moving `requested`, so that it makes progress.
const PLANNED_RATE_MIN: f64 = 0.05;
/// A swing below this share of the rate is neglected.
const SWING_NEGLECTED: f64 = 0.05;
/// Smoothing time of the trend of a fluctuating `requested`.
const TREND_SMOOTHING_S: f64 = 0.03;
/// Time constant with which earlier values of `requested` are forgotten.
const RANGE_FADING_S: f64 = 0.1;
/// Number of consecutive steady samples before `requested` is followed again; noise near the jerk
/// limit has a few by chance.
const STEADY_SAMPLES_MIN: u8 = 8;
/// Samples may deviate from the filtered motion as long as a plan that starts there shows at most
/// this multiple of the jerk of jitter: four samples with the largest error of a single one give 1;
/// an error taken for jitter several times in a row gives more.
const DEPARTURE_JERK_MAX: f64 = 2.0;
/// Rounding allowed for a motion at its limits, as a share of the position limit.
const ROUNDING: f64 = 1e-9;

/// Limits one joint's correction in position, rate and jerk. Joint units: rad, or m when prismatic.
#[derive(Clone, Copy, Debug)]
pub struct Limiter {
    /// Times of the samples of all following tracks.
    times: SampleTimes,
    /// The outputs.
    output: Track,
    /// The motion in continuous time that the outputs are samples of.
    motion: Motion,
    /// The requested values, clamped to the position limit.
    requested: Track,
    /// The motion of `requested`: exact while it is steady, otherwise smoothed (without lag on a
    /// ramp).
    trend: Motion,
    /// The lowest and the highest recent value of `requested`, fading.
    recent_range: (f64, f64),
    /// Steady samples in a row, up to [`STEADY_SAMPLES_MIN`].
    steady_samples: u8,
    /// The decaying offset of the output from `requested`; `None` while `requested` is not followed.
    offset: Option<Plan>,
    /// The last requested value, before clamping.
    last_request: f64,
    /// The limits in force; `None` before the first step.
    in_force: Option<Limits>,
}

/// Shares of the limits of rate and jerk for a joint's plans; 1 for a joint that moves alone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LimitShares {
    pub(crate) rate: f64,
    pub(crate) jerk: f64,
}

impl LimitShares {
    pub(crate) const FULL: Self = Self { rate: 1.0, jerk: 1.0 };
}

impl Limiter {
    /// No correction, at rest.
    #[must_use]
    pub const fn at_rest() -> Self {
        Self::from_motion(0.0, 0.0, 0.0)
    }

    /// Continues a correction from another limiter: its value, rate and acceleration.
    ///
    /// The caller checks that the numbers are finite; others count as zero in [`Limiter::step`].
    #[must_use]
    pub const fn from_motion(value: f64, rate: f64, acceleration: f64) -> Self {
        let motion = Motion {
            value: finite_or_zero(value),
            rate: finite_or_zero(rate),
            acceleration: finite_or_zero(acceleration),
        };
        Self {
            times: SampleTimes::START,
            output: Track::from_motion(motion),
            motion,
            requested: Track::from_motion(motion),
            trend: motion,
            recent_range: (motion.value, motion.value),
            steady_samples: STEADY_SAMPLES_MIN,
            offset: Some(Plan::FINISHED),
            last_request: f64::NAN,
            in_force: None,
        }
    }

    /// Stops at the present value: after a pause so long that the receiver has stopped.
    pub(crate) fn rest(&mut self) {
        let in_force = self.in_force;
        *self = Self { in_force, ..Self::from_motion(self.value(), 0.0, 0.0) };
    }

    /// Sets `value` at once, without limits: for settled poses, which are not connected by motion.
    pub const fn jump(&mut self, value: f64) {
        *self = Self::from_motion(value, 0.0, 0.0);
    }

    /// The last output.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.output.value()
    }

    /// The rate at the last output, per s.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.motion.rate
    }

    /// The acceleration at the last output, per s².
    #[must_use]
    pub fn acceleration(&self) -> f64 {
        self.motion.acceleration
    }

    /// Whether the last output was exactly the requested value.
    #[must_use]
    pub fn is_following(&self) -> bool {
        self.output.value() == self.last_request
    }

    /// The output `dt_s` after the last one.
    ///
    /// It equals `requested` bit for bit while `requested` keeps the limits and could at each sample
    /// still stop within them (a signal that reaches the position limit at full rate could not).
    /// Beyond the position limit `requested` counts as the limit; if not finite, as zero: the
    /// correction ramps to zero. If `dt_s` is not above zero, no time passes: the last output is
    /// repeated.
    pub fn step(&mut self, wanted: f64, limits: &Limits, dt_s: f64) -> f64 {
        let elapsed = Elapsed::exact(dt_s);
        if !self.try_follow(wanted, limits, elapsed) {
            self.step_on_plan(limits, LimitShares::FULL, elapsed);
        }
        self.value()
    }

    /// The next output, if it may be `requested` and its offset; otherwise [`Limiter::step_on_plan`] has
    /// to compute it.
    pub(crate) fn try_follow(&mut self, wanted: f64, limits: &Limits, elapsed: Elapsed) -> bool {
        self.last_request = wanted;
        let Elapsed { dt_s, jitter_s } = elapsed;
        if !(dt_s > 0.0 && dt_s.is_finite()) {
            return true;
        }
        self.times.advance(dt_s, jitter_s);
        let in_force = self.update_limits(limits);
        self.observe(finite_or_zero(wanted), limits, dt_s);
        in_force == *limits && self.follow(limits, dt_s)
    }

    /// The next output, on a plan at this pace.
    pub(crate) fn step_on_plan(&mut self, limits: &Limits, pace: LimitShares, elapsed: Elapsed) {
        let dt_s = elapsed.dt_s;
        if self.offset.is_some() {
            self.steady_samples = 0;
        }
        if let Some(in_force) = self.in_force.filter(|in_force| in_force != limits) {
            let braked = self.braking_step(limits, &in_force, dt_s);
            self.set_output(braked);
            self.offset = None;
            return;
        }
        let on_plan = self.approach(limits, pace, dt_s);
        // A stop leaves more acceleration than a slow plan could remove without a swing.
        let pace = if on_plan { pace } else { LimitShares::FULL };
        let plan = || plan_to_target(self.motion.minus(self.trend), self.trend.rate, limits, pace);
        self.offset = (self.steady_samples >= STEADY_SAMPLES_MIN).then(plan);
    }

    /// Whether the output has not yet reached `requested`.
    pub(crate) fn is_ramping(&self) -> bool {
        self.offset.is_none_or(|offset| !offset.is_finished())
    }

    /// Whether former limits still apply because the motion cannot yet stop within the new ones.
    pub(crate) fn is_braking_into(&self, limits: &Limits) -> bool {
        self.in_force.is_some_and(|in_force| in_force != *limits)
    }

    /// Drops the plan: the next output is on a new one, which may be faster.
    pub(crate) fn drop_plan(&mut self) {
        self.offset = None;
    }

    /// Takes over new limits, or the larger of both where the motion cannot stop within the new ones.
    fn update_limits(&mut self, limits: &Limits) -> Limits {
        let in_force = match self.in_force {
            Some(in_force) if in_force == *limits => *limits,
            _ if self.motion.stops_inside(limits) => *limits,
            Some(before) => {
                let larger = before.union(limits);
                // A stop at a larger jerk may end further away than one that swings back.
                let stops = self.motion.stops_inside(&larger);
                self.with_room_to_stop(if stops { larger } else { larger.with_jerk_of(&before) })
            }
            None => self.with_room_to_stop(*limits),
        };
        self.in_force = Some(in_force);
        in_force
    }

    /// `limits`, widened as far as the motion needs for a stop: only by rounding, unless the motion
    /// came from another limiter.
    fn with_room_to_stop(&self, limits: Limits) -> Limits {
        let (angle, rate) = self.motion.stopping_extremes(limits.jerk());
        limits.widened_to(angle, rate)
    }

    /// One step of braking into `limits` from a motion that keeps `in_force`.
    ///
    /// Inside the new angle that is the fastest stop. Outside, it is the fastest way to what is
    /// wanted, or to the bound of the angle where that lies outside too.
    fn braking_step(&self, limits: &Limits, in_force: &Limits, dt_s: f64) -> Motion {
        let stop = self.stopping_step(in_force, dt_s);
        if self.motion.value.abs() <= limits.angle() {
            return stop;
        }
        let goal = Motion::at_rest(
            finite_or_zero(self.last_request).clamp(-limits.angle(), limits.angle()),
        );
        let rates = (-in_force.rate(), in_force.rate());
        let plan = Plan::to_zero(self.motion.minus(goal), rates, in_force.jerk());
        let next = plan.ahead(dt_s).plus(goal);
        let allowed = next.stops_inside(in_force) && self.keeps_rate(next, in_force, dt_s);
        if allowed { next } else { stop }
    }

    /// Offset of the output from the trend of `requested` and its rate, in a step that already
    /// includes the new `requested`.
    pub(crate) fn offset(&self, dt_s: f64) -> Motion {
        self.motion.minus(self.trend.after(-dt_s, 0.0))
    }

    /// Distance of the output from `requested`, in a step that already includes the new `requested`.
    pub(crate) fn distance(&self) -> f64 {
        (self.output.value() - self.requested.value()).abs()
    }

    /// Updates the trend of `requested`, and whether its last samples are steady.
    fn observe(&mut self, wanted: f64, limits: &Limits, dt_s: f64) {
        let wanted = wanted.clamp(-limits.angle(), limits.angle());
        let (track, jerk) = self.requested.with(wanted, &self.times, limits.jerk());
        let spare_jerk = (1.0 - PLANNED_JERK) * limits.jerk();
        let most_jerk = spare_jerk + self.times.jitter_jerk(self.requested.fastest(&self.times));
        let most_rate = limits.rate() * (1.0 + self.times.rate_error());
        if jerk.abs() <= most_jerk && track.rate().abs() <= most_rate {
            self.steady_samples = (self.steady_samples + 1).min(STEADY_SAMPLES_MIN);
            self.trend = track.motion();
            self.requested = track;
        } else {
            self.steady_samples = 0;
            self.requested = track.after_jump(&self.requested, &self.times);
            self.trend = smoothed(self.trend, wanted, dt_s);
        }
        let keep = RANGE_FADING_S / (RANGE_FADING_S + dt_s);
        let (lowest, highest) = self.recent_range;
        self.recent_range = (
            (wanted + keep * (lowest - wanted)).min(wanted),
            (wanted + keep * (highest - wanted)).max(wanted),
        );
    }

    /// Puts out `requested` and its offset, if both are known and the limits allow it.
    fn follow(&mut self, limits: &Limits, dt_s: f64) -> bool {
        let Some(offset) = &self.offset else { return false };
        let wanted = self.requested.value() + offset.ahead(dt_s).value;
        let (output, jerk) = self.output.with(wanted, &self.times, limits.jerk());
        let motion = output.motion();
        let excused = self.times.jitter_jerk(self.output.fastest(&self.times));
        let allowed = jerk.abs() <= limits.jerk() + excused
            && output.rate().abs() <= limits.rate()
            && self.keeps_rate(motion, limits, dt_s)
            && motion.stops_inside(limits)
            && !(self.times.are_uncertain()
                && output.departure_jerk(&self.times) > DEPARTURE_JERK_MAX * excused);
        if allowed {
            self.offset.iter_mut().for_each(|offset| offset.advance(dt_s));
            (self.output, self.motion) = (output, motion);
        }
        allowed
    }

    /// Moves onto the trend, or to a stop if that would exceed the limits. Returns whether it was
    /// onto the trend.
    fn approach(&mut self, limits: &Limits, pace: LimitShares, dt_s: f64) -> bool {
        let planned = self.step_towards_trend(limits, pace, dt_s);
        self.set_output(planned.unwrap_or_else(|| self.stopping_step(limits, dt_s)));
        planned.is_some()
    }

    fn set_output(&mut self, motion: Motion) {
        let (output, _) = self.output.with(motion.value, &self.times, f64::INFINITY);
        (self.output, self.motion) = (output.with_motion(motion), motion);
    }

    /// `None` if the limits do not allow it.
    fn step_towards_trend(&self, limits: &Limits, pace: LimitShares, dt_s: f64) -> Option<Motion> {
        let Motion { value, rate, .. } = self.trend;
        let trend = Motion { value: value - rate * dt_s, rate, acceleration: 0.0 };
        let ahead = plan_to_target(self.motion.minus(trend), rate, limits, pace).ahead(dt_s);
        let next = Motion { value, ..trend }.plus(ahead);
        let allowed = next.stops_inside(limits)
            && self.stops_within_recent_range(next, limits)
            && self.keeps_rate(next, limits, dt_s);
        allowed.then_some(next)
    }

    /// Whether the mean rate of the step keeps its limit, apart from rounding of both values:
    /// within a long step a plan may be faster than at its ends.
    fn keeps_rate(&self, next: Motion, limits: &Limits, dt_s: f64) -> bool {
        let rounding = f64::EPSILON * (next.value.abs() + self.motion.value.abs());
        (next.value - self.motion.value).abs() <= limits.rate() * dt_s + rounding
    }

    fn stopping_step(&self, limits: &Limits, dt_s: f64) -> Motion {
        let stop = Ramp::to_rate(self.motion, 0.0, limits.jerk()).after(self.motion, dt_s);
        Motion { value: stop.value.clamp(-limits.angle(), limits.angle()), ..stop }
    }

    /// Whether a stop from there ends between the present value and recent values of `requested`:
    /// moving back and forth then builds up no swing.
    fn stops_within_recent_range(&self, next: Motion, limits: &Limits) -> bool {
        let stop = |motion, jerk| Ramp::to_rate(motion, 0.0, jerk).end_of(motion).value;
        let ends = [self.motion.value, stop(self.trend, PLANNED_JERK * limits.jerk())];
        let lowest = ends.iter().fold(self.recent_range.0, |lowest, end| lowest.min(*end));
        let highest = ends.iter().fold(self.recent_range.1, |highest, end| highest.max(*end));
        let slack = ROUNDING * limits.angle();
        (lowest - slack..=highest + slack).contains(&stop(next, limits.jerk()))
    }
}

/// Plan for the decay of an offset from a target that moves at `target_rate`.
fn plan_to_target(offset: Motion, target_rate: f64, limits: &Limits, pace: LimitShares) -> Plan {
    let (rate, rate_min) = (PLANNED_RATE * limits.rate(), PLANNED_RATE_MIN * limits.rate());
    let most = pace.rate * rate;
    let lowest = (-rate - target_rate).min(-rate_min).max(-most);
    let highest = (rate - target_rate).max(rate_min).min(most);
    let (planned, most) = (pace.jerk * PLANNED_JERK * limits.jerk(), limits.jerk());
    // A stop at full jerk may leave more acceleration than a plan could remove without swinging
    // back.
    let swings = overshoot_rate(offset, planned)
        > overshoot_rate(offset, most) + SWING_NEGLECTED * limits.rate();
    Plan::to_zero(offset, (lowest, highest), if swings { most } else { planned })
}

/// The rate away from zero that is left where the fastest stop at `jerk` has removed the
/// acceleration; zero if the stop first needs more of it.
fn overshoot_rate(offset: Motion, jerk: f64) -> f64 {
    if offset.coasting_rate(jerk) * offset.acceleration <= 0.0 {
        return 0.0;
    }
    let coasting =
        offset.after(offset.acceleration.abs() / jerk, -jerk.copysign(offset.acceleration));
    (coasting.rate * coasting.value.signum()).max(0.0)
}

/// The trend with another sample: critically damped double exponential smoothing.
fn smoothed(trend: Motion, sample: f64, dt_s: f64) -> Motion {
    let keep = libm::exp(-dt_s / TREND_SMOOTHING_S);
    let expected = trend.value + trend.rate * dt_s;
    let miss = sample - expected;
    Motion {
        value: expected + (1.0 - keep * keep) * miss,
        rate: trend.rate + (1.0 - keep) * (1.0 - keep) * miss / dt_s,
        acceleration: 0.0,
    }
}

const fn finite_or_zero(number: f64) -> f64 {
    if number.is_finite() { number } else { 0.0 }
}

#[cfg(test)]
mod tests;
