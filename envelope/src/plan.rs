//! The fastest motion to rest at zero under a jerk and a rate bound, in continuous time.
//!
//! Full jerk towards zero for some time, then the fastest stop: the longer the first phase, the further away the
//! stop ends, so that the duration for which it ends at zero is found by safeguarded Newton iteration. If the rate limit
//! would be exceeded: a ramp to that rate, a constant rate, a stop. Source: time-optimal control of the triple
//! integrator; cf. Haschke, Weitnauer, Ritter, "On-line planning of time-optimal, jerk-limited
//! trajectories", IROS 2008.
//!
//! Invariants: a plan ends exactly at zero and never exceeds its jerk.

use crate::motion::Motion;

/// Limit on iterations for the duration of the first phase, as if each were a bisection: from its
/// longest value to its last bit.
const ITERATIONS_MAX: u32 = 60;
/// After a Newton step smaller than this share the iteration ends: the next one would be of the
/// order of its square.
const RELATIVE_TOLERANCE: f64 = 1e-8;

/// A change of rate that ends without acceleration: one jerk, then its opposite.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ramp {
    jerk: f64,
    first_s: f64,
    second_s: f64,
}

impl Ramp {
    pub(crate) fn to_rate(from: Motion, rate: f64, jerk: f64) -> Self {
        let sign = if rate >= from.coasting_rate(jerk) { 1.0 } else { -1.0 };
        let acceleration = sign * from.acceleration;
        let square = jerk * sign * (rate - from.rate) + acceleration * acceleration / 2.0;
        let peak = libm::sqrt(square.max(0.0));
        Self {
            jerk: sign * jerk,
            first_s: ((peak - acceleration) / jerk).max(0.0),
            second_s: peak / jerk,
        }
    }

    /// To zero acceleration as fast as possible, for any rate at its end.
    fn coasting(from: Motion, jerk: f64) -> Self {
        let first_s = from.acceleration.abs() / jerk;
        Self { jerk: -jerk.copysign(from.acceleration), first_s, second_s: 0.0 }
    }

    pub(crate) fn first_jerk(&self) -> f64 {
        self.jerk
    }

    pub(crate) fn end_of(&self, from: Motion) -> Motion {
        from.after(self.first_s, self.jerk).after(self.second_s, -self.jerk)
    }

    /// The motion `dt_s` into the ramp; beyond its end the rate is constant.
    pub(crate) fn after(&self, from: Motion, dt_s: f64) -> Motion {
        let first_s = dt_s.min(self.first_s);
        let second_s = (dt_s - first_s).min(self.second_s);
        let rest_s = dt_s - first_s - second_s;
        let end = from.after(first_s, self.jerk).after(second_s, -self.jerk);
        if rest_s > 0.0 { Motion { acceleration: 0.0, ..end }.after(rest_s, 0.0) } else { end }
    }

    fn segments(&self) -> [(f64, f64); 2] {
        [(self.first_s, self.jerk), (self.second_s, -self.jerk)]
    }
}

/// A motion in five segments of constant jerk that ends at rest at zero.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plan {
    start: Motion,
    /// Duration in s, jerk.
    segments: [(f64, f64); 5],
    /// Total duration.
    lasts_s: f64,
    elapsed_s: f64,
}

impl Plan {
    /// The plan at its end: at rest at zero.
    pub(crate) const FINISHED: Self = Self {
        start: Motion::at_rest(0.0),
        segments: [(0.0, 0.0); 5],
        lasts_s: 0.0,
        elapsed_s: 0.0,
    };

    /// The fastest motion from `start` to rest at zero; cruises within `rates` (lowest below 0,
    /// highest above 0), or at the initial rate if that is faster.
    pub(crate) fn to_zero(start: Motion, rates: (f64, f64), jerk: f64) -> Self {
        let direct = Ramp::to_rate(start, 0.0, jerk).end_of(start).value;
        let (push, bound) = if direct > 0.0 { (-jerk, rates.0) } else { (jerk, rates.1) };
        let speed_up = if (bound - start.coasting_rate(jerk)) * push > 0.0 {
            Ramp::to_rate(start, bound, jerk)
        } else {
            Ramp::coasting(start, jerk)
        };
        let cruise = Motion { acceleration: 0.0, ..speed_up.end_of(start) };
        let slow_down = Ramp::to_rate(cruise, 0.0, jerk);
        let short_by = -slow_down.end_of(cruise).value;
        let segments = if short_by * push >= 0.0 {
            let ([a, b], [d, e]) = (speed_up.segments(), slow_down.segments());
            [a, b, (short_by / cruise.rate, 0.0), d, e]
        } else {
            let longest_s = if speed_up.jerk * push > 0.0 { speed_up.first_s } else { 0.0 };
            let pushed_s = full_jerk_time(start, push, longest_s);
            let [b, c] = Ramp::to_rate(start.after(pushed_s, push), 0.0, jerk).segments();
            [(pushed_s, push), b, c, (0.0, 0.0), (0.0, 0.0)]
        };
        let lasts_s = segments.iter().map(|(duration_s, _)| duration_s).sum();
        Self { start, segments, lasts_s, elapsed_s: 0.0 }
    }

    /// Duration from its start, s.
    #[cfg(test)]
    pub(crate) fn remaining_s(&self) -> f64 {
        self.lasts_s
    }

    /// Whether the plan has ended.
    pub(crate) fn is_finished(&self) -> bool {
        self.elapsed_s >= self.lasts_s
    }

    /// Advances by `dt_s`.
    pub(crate) fn advance(&mut self, dt_s: f64) {
        self.elapsed_s += dt_s;
    }

    /// The motion `dt_s` ahead; at rest at zero once the plan has ended.
    pub(crate) fn ahead(&self, dt_s: f64) -> Motion {
        let mut left_s = self.elapsed_s + dt_s;
        if left_s >= self.lasts_s {
            return Motion::default();
        }
        let mut motion = self.start;
        for (duration_s, jerk) in self.segments {
            if left_s < duration_s {
                return motion.after(left_s, jerk);
            }
            motion = motion.after(duration_s, jerk);
            left_s -= duration_s;
        }
        Motion::default()
    }
}

/// Duration of the first phase for which the stop after it ends at zero; the longest one ends
/// beyond zero.
///
/// With the stop's peak rate `p` and the acceleration `a` along the jerk, the end moves by `(2p +
/// a)(p + a) / j` per s of the phase while the motion goes in that direction, and not at all
/// before: the phase is then the first part of the stop itself.
fn full_jerk_time(start: Motion, push: f64, longest_s: f64) -> f64 {
    let (jerk, sign) = (push.abs(), push.signum());
    let end = |pushed_s: f64| {
        let pushed = start.after(pushed_s, push);
        let stop = Ramp::to_rate(pushed, 0.0, jerk);
        let (peak, along) = (stop.second_s * jerk, pushed.acceleration * sign);
        let goes_along = stop.first_jerk() * push < 0.0;
        let slope = if goes_along { (2.0 * peak + along) * (peak + along) / jerk } else { 0.0 };
        (stop.end_of(pushed).value * sign, slope)
    };
    let (mut low_s, mut high_s) = (0.0, longest_s);
    // Exact for a start at rest.
    let mut at_s = libm::cbrt(-end(0.0).0 / (2.0 * jerk)).max(low_s).min(high_s);
    for _ in 0..ITERATIONS_MAX {
        let (value, slope) = end(at_s);
        if value > 0.0 {
            high_s = at_s;
        } else {
            low_s = at_s;
        }
        let by_slope_s = at_s - value / slope;
        if !(by_slope_s >= low_s && by_slope_s <= high_s) {
            at_s = (low_s + high_s) / 2.0;
        } else if (by_slope_s - at_s).abs() <= RELATIVE_TOLERANCE * at_s {
            return by_slope_s;
        } else {
            at_s = by_slope_s;
        }
    }
    at_s
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn motion() -> impl Strategy<Value = Motion> {
        (-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64)
            .prop_map(|(value, rate, acceleration)| Motion { value, rate, acceleration })
    }

    #[test]
    fn a_jump_from_rest_takes_the_time_that_the_triple_integrator_allows() {
        let (distance, jerk) = (1e-3, 25.0);
        let plan = Plan::to_zero(Motion::at_rest(distance), (-1.0, 1.0), jerk);
        let total_s: f64 = plan.segments.iter().map(|(duration_s, _)| duration_s).sum();
        let optimal_s = libm::cbrt(32.0 * distance / jerk);
        assert!((total_s - optimal_s).abs() < 1e-9, "{total_s} against {optimal_s}");
    }

    proptest! {
        #[test]
        fn a_plan_is_continuous_and_ends_at_rest_at_zero(start in motion(), jerk in 0.1..10.0_f64) {
            let plan = Plan::to_zero(start, (-0.7, 0.4), jerk);
            let end = plan.segments.iter().fold(start, |m, (s, j)| m.after(*s, *j));
            prop_assert!(end.value.abs() < 1e-9, "{end:?}");
            prop_assert!(end.rate.abs() < 1e-9 && end.acceleration.abs() < 1e-9, "{end:?}");
            prop_assert!(plan.segments.iter().all(|(s, _)| *s >= 0.0));
        }

        #[test]
        fn following_a_plan_and_planning_anew_on_the_way_agree(
            start in motion(), jerk in 0.5..5.0_f64, at_s in 0.0..2.0_f64,
        ) {
            let mut whole = Plan::to_zero(start, (-3.0, 3.0), jerk);
            let middle = whole.ahead(at_s);
            whole.advance(at_s);
            let again = Plan::to_zero(middle, (-3.0, 3.0), jerk);
            let (a, b) = (whole.ahead(0.3), again.ahead(0.3));
            prop_assert!((a.value - b.value).abs() < 1e-7, "{a:?} {b:?}");
            prop_assert!((a.rate - b.rate).abs() < 1e-6, "{a:?} {b:?}");
        }
    }
}
