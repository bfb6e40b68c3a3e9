//! Limits how fast a feed override changes: between a floor and the programmed feed, at bounded
//! rates down and up.
//!
//! The daemon steps its override with it; the client library steps the override that it returns to
//! the cell, starting from the last returned one. Invariants: the output changes by no more than
//! its rate times the time, to rounding, for any goal, and stays between the floor and 1; below a
//! floor that was raised it rises to the floor at the bounded rate. An invalid goal leaves it
//! unchanged.

/// Bounds of a feed override; 1 is the programmed feed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OverrideLimits {
    floor: f64,
    down_per_s: f64,
    up_per_s: f64,
}

impl OverrideLimits {
    /// `floor`: the lowest override, above 0 and at most 1; rates of fall and rise, per s, above 0.
    /// `None` if one of them is out of range.
    #[must_use]
    pub fn new(floor: f64, down_per_s: f64, up_per_s: f64) -> Option<Self> {
        let is_rate = |rate: f64| rate.is_finite() && rate > 0.0;
        let is_good = floor > 0.0 && floor <= 1.0 && is_rate(down_per_s) && is_rate(up_per_s);
        is_good.then_some(Self { floor, down_per_s, up_per_s })
    }

    /// The lowest override.
    #[must_use]
    pub fn floor(&self) -> f64 {
        self.floor
    }

    /// The largest rate of fall, per s.
    #[must_use]
    pub fn down_per_s(&self) -> f64 {
        self.down_per_s
    }

    /// The largest rate of rise, per s.
    #[must_use]
    pub fn up_per_s(&self) -> f64 {
        self.up_per_s
    }

    /// The override after `dt_s`, from `from` towards `goal`.
    #[must_use]
    pub fn step(&self, from: f64, goal: f64, dt_s: f64) -> f64 {
        let from = if from.is_nan() { self.floor } else { from.clamp(0.0, 1.0) };
        if goal.is_nan() || dt_s.is_nan() || dt_s <= 0.0 {
            return from;
        }
        let (lowest, highest) = (from - self.down_per_s * dt_s, from + self.up_per_s * dt_s);
        goal.clamp(self.floor, 1.0).clamp(lowest, highest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_that_bound_nothing_are_refused() {
        for (floor, down, up) in [
            (0.0, 1.0, 1.0),
            (1.1, 1.0, 1.0),
            (f64::NAN, 1.0, 1.0),
            (0.1, 0.0, 1.0),
            (0.1, 1.0, f64::INFINITY),
            (0.1, f64::NAN, 1.0),
        ] {
            assert_eq!(OverrideLimits::new(floor, down, up), None, "{floor} {down} {up}");
        }
    }

    #[test]
    fn whatever_the_goal_is_the_override_stays_within_its_bounds_and_its_rates() {
        let limits = OverrideLimits::new(0.1, 2.0, 0.2).expect("good ones");
        let mut from = 1.0;
        for (goal, dt_s, to) in [
            (0.0, 0.1, 0.8),
            (0.0, 10.0, 0.1),
            (7.0, 1.0, 0.3),
            (f64::NAN, 1.0, 0.3),
            (f64::INFINITY, 1.0, 0.5),
            (0.55, 1.0, 0.55),
            (1.0, f64::NAN, 0.55),
            (1.0, -1.0, 0.55),
            (f64::NEG_INFINITY, 0.1, 0.35),
            (1.0, 1e9, 1.0),
        ] {
            from = limits.step(from, goal, dt_s);
            assert!((from - to).abs() < 1e-12, "{goal} {dt_s}: {from}");
        }
        assert_eq!(limits.step(f64::NAN, 1.0, 0.0), 0.1);
    }

    #[test]
    fn below_a_floor_that_was_raised_it_rises_at_the_bounded_rate() {
        let limits = OverrideLimits::new(0.5, 2.0, 0.2).expect("good ones");
        for goal in [0.0, 0.5, 1.0] {
            assert!((limits.step(0.1, goal, 0.1) - 0.12).abs() < 1e-12, "{goal}");
        }
        assert_eq!(limits.step(0.1, f64::NAN, 0.1), 0.1);
        assert_eq!(limits.step(0.1, 0.0, 10.0), 0.5);
    }

    #[test]
    fn nothing_is_above_the_programmed_feed() {
        let limits = OverrideLimits::new(0.1, 2.0, 0.2).expect("good ones");
        assert_eq!(limits.step(9.0, 1.0, 0.0), 1.0);
    }
}
