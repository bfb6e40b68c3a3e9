//! Value, rate and acceleration at an instant, and the stop from there.
//!
//! Invariant: [`Motion::stops_inside`] is true exactly if the fastest stop at full jerk keeps angle
//! and rate at all times. That set is invariant under the stop, at any sampling interval: this
//! module works in continuous time.

use crate::Limits;
use crate::plan::Ramp;

/// Value and derivatives of a joint's correction, in continuous time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Motion {
    pub(crate) value: f64,
    pub(crate) rate: f64,
    pub(crate) acceleration: f64,
}

impl Motion {
    pub(crate) const fn at_rest(value: f64) -> Self {
        Self { value, rate: 0.0, acceleration: 0.0 }
    }

    /// After `dt_s` at constant `jerk`.
    pub(crate) fn after(self, dt_s: f64, jerk: f64) -> Self {
        let Self { value, rate, acceleration } = self;
        Self {
            value: value + dt_s * (rate + dt_s * (acceleration / 2.0 + dt_s * jerk / 6.0)),
            rate: rate + dt_s * (acceleration + dt_s * jerk / 2.0),
            acceleration: acceleration + dt_s * jerk,
        }
    }

    pub(crate) fn minus(self, other: Self) -> Self {
        Self {
            value: self.value - other.value,
            rate: self.rate - other.rate,
            acceleration: self.acceleration - other.acceleration,
        }
    }

    pub(crate) fn plus(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            rate: self.rate + other.rate,
            acceleration: self.acceleration + other.acceleration,
        }
    }

    /// The largest of the value and of the distances that rate and acceleration cover in `time_s`.
    pub(crate) fn largest_distance(self, time_s: f64) -> f64 {
        let Self { value, rate, acceleration } = self;
        value.abs().max(rate.abs() * time_s).max(acceleration.abs() * time_s * time_s)
    }

    /// The rate that remains once the acceleration is removed at `jerk`.
    pub(crate) fn coasting_rate(self, jerk: f64) -> f64 {
        self.rate + self.acceleration * self.acceleration.abs() / (2.0 * jerk)
    }

    /// Whether the fastest stop from here, at full jerk, stays within angle and rate.
    ///
    /// The stop's rate is extreme now or where its acceleration first vanishes; its value where the
    /// rate changes sign (at most once, in the first segment) or at its end.
    #[inline]
    pub(crate) fn stops_inside(self, limits: &Limits) -> bool {
        self.stops_inside_by_bound(limits) || self.stops_inside_exactly(limits)
    }

    /// A sufficient condition without a square root: the stop would end inside even at its highest
    /// rate over its whole duration.
    #[inline]
    fn stops_inside_by_bound(self, limits: &Limits) -> bool {
        let Self { value, rate, acceleration } = self;
        // Upper bound of the rate; the stop lasts at most `brake_s` plus twice the root of `fastest
        // / jerk`.
        let brake_s = acceleration.abs() / limits.jerk();
        let fastest = rate.abs() + acceleration.abs() * brake_s / 2.0;
        let room = limits.angle() - value.abs() - fastest * brake_s;
        fastest <= limits.rate()
            && room >= 0.0
            && 4.0 * fastest * fastest * fastest <= limits.jerk() * room * room
    }

    fn stops_inside_exactly(self, limits: &Limits) -> bool {
        let stop = Ramp::to_rate(self, 0.0, limits.jerk());
        let turn = self.turning_point(stop.first_jerk());
        let end = stop.end_of(self);
        self.value.abs() <= limits.angle()
            && end.value.abs() <= limits.angle()
            && turn.abs() <= limits.angle()
            && self.rate.abs() <= limits.rate()
            && self.coasting_rate(limits.jerk()).abs() <= limits.rate()
    }

    /// The largest angle and rate during the fastest stop at `jerk`.
    pub(crate) fn stopping_extremes(self, jerk: f64) -> (f64, f64) {
        let stop = Ramp::to_rate(self, 0.0, jerk);
        let turn = self.turning_point(stop.first_jerk());
        let end = stop.end_of(self).value;
        let rate = self.rate.abs().max(self.coasting_rate(jerk).abs());
        (self.value.abs().max(turn.abs()).max(end.abs()), rate)
    }

    /// The value where the rate vanishes under the stop's first jerk; the present value if it does
    /// not.
    fn turning_point(self, jerk: f64) -> f64 {
        let towards = self.rate * self.acceleration < 0.0 && self.acceleration * jerk < 0.0;
        let square = self.acceleration * self.acceleration - 2.0 * jerk * self.rate;
        if !(towards && square >= 0.0) {
            return self.value;
        }
        let reach = self.acceleration.abs() + libm::sqrt(square);
        self.after(2.0 * self.rate.abs() / reach, jerk).value
    }
}
