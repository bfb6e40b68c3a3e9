//! The rule by which a correction follows what is wanted.
//!
//! Three ways to make the next output, the first that may be taken is:
//! 1. `wanted`, plus an offset from it that dies out along a plan. The offset is zero while all is
//!    well; a jump of `wanted` becomes an offset (this is known as inertialisation).
//! 2. One step of a plan from the motion now to rest at `wanted`, while `wanted` jumps or shakes too
//!    much to say how it moves. Plans use half the jerk; the other half belongs to `wanted`.
//! 3. One step of the fastest stop, at full jerk.
//!
//! Promises: from the output there is always a stop that keeps all limits (see `motion`); a way is
//! taken only if that stays so, hence the third is always open. Never reads a clock, allocates or
//! panics.

use crate::Limits;
use crate::motion::Motion;
use crate::plan::{Plan, Ramp};
use crate::track::Track;

/// Plans leave this share of the rate, and half of the jerk, to `wanted` itself.
const PLANNED_RATE: f64 = 0.9;
const PLANNED_JERK: f64 = 0.5;
/// A plan relative to a moving `wanted` keeps at least this share of the rate, to get on at all.
const LEAST_RATE: f64 = 0.05;
/// Rounding that a motion on the edge of its limits is forgiven, as a share of the angle.
const ROUNDING: f64 = 1e-9;

/// Bounds one joint's correction in angle, rate and jerk. Joint units: rad, or m when prismatic.
#[derive(Clone, Copy, Debug)]
pub struct Limiter {
    /// What was put out.
    output: Track,
    /// The motion in continuous time that the outputs are samples of.
    motion: Motion,
    /// What was wanted, clamped to the angle.
    wanted: Track,
    /// The offset of the output from `wanted`, as it dies out; none while it is unknown.
    offset: Option<Plan>,
    following: bool,
}

impl Limiter {
    /// No correction, at rest.
    #[must_use]
    pub const fn at_rest() -> Self {
        Self::from_motion(0.0, 0.0, 0.0)
    }

    /// Takes over a correction that another limiter left: its value, rate and acceleration.
    ///
    /// Numbers that are not finite are the caller's to sort out; they count as zero in
    /// [`Limiter::step`].
    #[must_use]
    pub const fn from_motion(value: f64, rate: f64, acceleration: f64) -> Self {
        let motion = Motion {
            value: finite(value),
            rate: finite(rate),
            acceleration: finite(acceleration),
        };
        Self {
            output: Track::from_motion(motion),
            motion,
            wanted: Track::from_motion(motion),
            offset: None,
            following: false,
        }
    }

    /// Stands at `value` at once, without bounds: for settled poses, that no motion connects.
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

    /// Whether the last output was exactly what was wanted.
    #[must_use]
    pub fn is_following(&self) -> bool {
        self.following
    }

    /// The output `dt_s` after the last one.
    ///
    /// It equals `wanted` bit for bit while `wanted` keeps the limits and could at each sample still
    /// stop inside them (a signal that runs into the bound of the angle at full rate could not).
    /// Beyond the angle `wanted` counts as the bound; not finite, as zero: the correction ramps out.
    /// No time passes where `dt_s` is not above zero: the last output stands.
    ///
    /// Where `limits` shrink below the motion they bind again as soon as the jerk allows.
    pub fn step(&mut self, wanted: f64, limits: &Limits, dt_s: f64) -> f64 {
        if dt_s > 0.0 && dt_s.is_finite() {
            let target = finite(wanted).clamp(-limits.angle(), limits.angle());
            let (track, jerk) = self.wanted.with(target, dt_s);
            let steady = jerk.abs() <= limits.jerk() && track.rate().abs() <= limits.rate();
            self.wanted = track;
            if !self.follow(limits, dt_s) {
                self.chase(limits, dt_s);
                self.offset = steady.then(|| self.plan_offset(limits));
            }
        }
        self.following = self.output.value() == wanted;
        self.output.value()
    }

    /// Puts out `wanted` and its offset, if both are known and that is allowed.
    fn follow(&mut self, limits: &Limits, dt_s: f64) -> bool {
        let mut offset = self.offset;
        let ahead = offset.as_mut().map_or(0.0, |plan| plan.advance(dt_s).value);
        let (output, jerk) = self.output.with(self.wanted.value() + ahead, dt_s);
        let motion = output.motion();
        let allowed = jerk.abs() <= limits.jerk()
            && output.rate().abs() <= limits.rate()
            && motion.stops_inside(limits);
        if allowed {
            (self.output, self.motion, self.offset) = (output, motion, offset);
        }
        allowed
    }

    /// Moves towards rest at `wanted`, or to a stop where that would leave the limits.
    fn chase(&mut self, limits: &Limits, dt_s: f64) {
        let motion = self.towards_wanted(limits, dt_s);
        let (output, _) = self.output.with(motion.value, dt_s);
        (self.output, self.motion) = (output, motion);
    }

    fn towards_wanted(&self, limits: &Limits, dt_s: f64) -> Motion {
        let target = Motion::at_rest(self.wanted.value());
        let rate = PLANNED_RATE * limits.rate();
        let start = self.motion.minus(target);
        let mut next =
            Plan::to_zero(start, (-rate, rate), PLANNED_JERK * limits.jerk()).advance(dt_s);
        next.value += target.value;
        // Half the jerk may let the rate pass its bound within a long step, though not at its ends.
        let mean_rate = (next.value - self.motion.value) / dt_s;
        let allowed = next.stops_inside(limits) && mean_rate.abs() <= limits.rate();
        if allowed || !self.is_inside(limits) {
            return next;
        }
        let stop = Ramp::to_rate(self.motion, 0.0, limits.jerk()).after(self.motion, dt_s);
        Motion { value: stop.value.clamp(-limits.angle(), limits.angle()), ..stop }
    }

    /// Whether the motion now keeps the limits, to rounding.
    fn is_inside(&self, limits: &Limits) -> bool {
        let slack = 1.0 + ROUNDING;
        Limits::new(limits.angle() * slack, limits.rate() * slack, limits.jerk())
            .is_ok_and(|wide| self.motion.stops_inside(&wide))
    }

    /// How the present offset dies out while `wanted` goes on as it does.
    fn plan_offset(&self, limits: &Limits) -> Plan {
        let wanted = self.wanted.motion();
        let (rate, least) = (PLANNED_RATE * limits.rate(), LEAST_RATE * limits.rate());
        let rates = ((-rate - wanted.rate).min(-least), (rate - wanted.rate).max(least));
        Plan::to_zero(self.motion.minus(wanted), rates, PLANNED_JERK * limits.jerk())
    }
}

const fn finite(number: f64) -> f64 {
    if number.is_finite() { number } else { 0.0 }
}

#[cfg(test)]
mod tests;
