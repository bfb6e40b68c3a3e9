//! The feed override returned to the caller, with or without a daemon.
//!
//! It follows the daemon's override while an answer is fresh; without one it is held for the cell's `hold_ms`, then goes to the cell's `lost_percent`. Its rate is limited by the cell's
//! rates whatever the daemon sends. Before the limits are known it is 1, the programmed feed.
//! It reads no clock, and never returns a value outside floor to 1.

use envelope::OverrideLimits;
use shm_schema::FeedBounds;

/// The last override returned, and the limits of its rate.
#[derive(Debug)]
pub(crate) struct FeedOutput {
    /// `None` before the daemon has sent them: the override is then 1.
    limits: Option<OverrideLimits>,
    lost: f64,
    hold_s: f64,
    /// `None` before the first one is returned.
    value: Option<f64>,
    /// When the daemon last sent one, ns.
    asked_ns: u64,
}

impl FeedOutput {
    pub(crate) const fn new() -> Self {
        Self { limits: None, lost: 1.0, hold_s: 0.0, value: None, asked_ns: 0 }
    }

    /// Adopts the daemon's bounds. A cell that does not adapt its feed has none: the override then returns to 1 within the last ones.
    pub(crate) fn set_bounds(&mut self, bounds: &FeedBounds) {
        let FeedBounds { floor, lost, down_per_s, up_per_s, hold_s } = *bounds;
        let new = OverrideLimits::new(floor, down_per_s, up_per_s);
        self.limits = new.or(self.limits);
        let is_good = new.is_some() && (floor..=1.0).contains(&lost) && hold_s >= 0.0;
        (self.lost, self.hold_s) = if is_good { (lost, hold_s) } else { (1.0, 0.0) };
    }

    /// Continues from this value; an invalid one is ignored.
    pub(crate) fn start(&mut self, value: f64) {
        if value > 0.0 && value <= 1.0 {
            self.value = Some(value);
        }
    }

    /// The last one returned.
    pub(crate) fn value(&self) -> f64 {
        self.value.unwrap_or(self.lost)
    }

    /// The override at `now_ns`, `dt_s` after the last; `requested`: that of a fresh answer of the daemon.
    pub(crate) fn step(&mut self, requested: Option<f64>, now_ns: u64, dt_s: f64) -> f64 {
        let value = self.value();
        let Some(limits) = self.limits else {
            self.value = Some(value);
            return value;
        };
        // The value was written by another process.
        let goal = match requested.filter(|requested| *requested > 0.0 && *requested <= 1.0) {
            Some(requested) => {
                self.asked_ns = now_ns;
                requested
            }
            None if now_ns.saturating_sub(self.asked_ns) as f64 * 1e-9 <= self.hold_s => value,
            None => self.lost,
        };
        let value = limits.step(value, goal, dt_s);
        self.value = Some(value);
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MS: u64 = 1_000_000;
    const BOUNDS: FeedBounds =
        FeedBounds { floor: 0.1, lost: 0.3, down_per_s: 2.0, up_per_s: 0.2, hold_s: 0.2 };
    const NONE: FeedBounds =
        FeedBounds { floor: 0.0, lost: 1.0, down_per_s: 0.0, up_per_s: 0.0, hold_s: 0.0 };

    /// So many milliseconds; the last override.
    fn run(output: &mut FeedOutput, now_ns: &mut u64, ms: u64, requested: Option<f64>) -> f64 {
        let mut value = output.value();
        for _ in 0..ms {
            *now_ns += MS;
            let next = output.step(requested, *now_ns, 1e-3);
            assert!((0.1..=1.0).contains(&next) && next - value < 2.1e-4 && value - next < 2.1e-3);
            value = next;
        }
        value
    }

    #[test]
    fn without_a_daemon_that_adapts_the_feed_it_is_the_programmed_one() {
        let (mut output, mut now_ns) = (FeedOutput::new(), 1 << 40);
        assert_eq!(run(&mut output, &mut now_ns, 10, None), 1.0);
        output.set_bounds(&NONE);
        assert_eq!(run(&mut output, &mut now_ns, 10, Some(0.5)), 1.0);
    }

    #[test]
    fn it_begins_where_no_force_is_known_and_follows_the_daemon() {
        let (mut output, mut now_ns) = (FeedOutput::new(), 1 << 40);
        output.set_bounds(&BOUNDS);
        assert_eq!(run(&mut output, &mut now_ns, 1, None), 0.3);
        assert_eq!(run(&mut output, &mut now_ns, 2000, Some(0.45)), 0.45);
        assert_eq!(run(&mut output, &mut now_ns, 200, Some(f64::NAN)), 0.45, "it holds");
        assert_eq!(run(&mut output, &mut now_ns, 200, Some(-1.0)), 0.3, "and lets go");
    }

    #[test]
    fn another_daemon_makes_no_step_whatever_it_has_set() {
        let (mut output, mut now_ns) = (FeedOutput::new(), 1 << 40);
        assert_eq!(run(&mut output, &mut now_ns, 10, None), 1.0);
        output.set_bounds(&BOUNDS);
        assert!((run(&mut output, &mut now_ns, 100, Some(0.2)) - 0.8).abs() < 1e-9);
        run(&mut output, &mut now_ns, 1000, Some(0.2));
        output.set_bounds(&NONE);
        assert!((run(&mut output, &mut now_ns, 1000, Some(1.0)) - 0.4).abs() < 1e-9);
        output.set_bounds(&FeedBounds { floor: f64::NAN, ..BOUNDS });
        assert_eq!(run(&mut output, &mut now_ns, 10_000, None), 1.0);
    }

    #[test]
    fn a_daemon_with_a_higher_floor_makes_no_step() {
        let (mut output, mut now_ns) = (FeedOutput::new(), 1 << 40);
        output.set_bounds(&BOUNDS);
        assert_eq!(run(&mut output, &mut now_ns, 10_000, Some(0.1)), 0.1);
        output.set_bounds(&FeedBounds { floor: 0.5, lost: 0.5, ..BOUNDS });
        assert!((run(&mut output, &mut now_ns, 1000, Some(0.5)) - 0.3).abs() < 1e-9);
        assert_eq!(run(&mut output, &mut now_ns, 1001, Some(0.5)), 0.5);
    }

    proptest! {
        #[test]
        fn whatever_daemons_say_it_is_a_number_within_floor_and_rates(
            steps in prop::collection::vec(
                (prop_oneof![Just(f64::NAN), -1.0..2.0_f64, 0.1..=1.0_f64], 0_u64..400, any::<bool>()),
                1..200,
            )
        ) {
            let (mut output, mut now_ns) = (FeedOutput::new(), 1 << 40);
            output.set_bounds(&BOUNDS);
            for (requested, ms, has) in steps {
                run(&mut output, &mut now_ns, ms, Some(requested).filter(|_| has));
            }
        }
    }
}
