//! Rate limit of repeated log messages.
//!
//! A message is logged immediately the first time, at increasing intervals while it continues, and
//! immediately again after a pause. Time is an argument.

/// Least interval between two messages on a count, ns.
const FIRST_NS: u64 = 10_000_000_000;
/// Largest interval, ns: without a pause each interval is twice the previous one.
const LONGEST_NS: u64 = 600_000_000_000;

/// A count that is logged.
#[derive(Clone, Copy, Debug)]
pub struct CountThrottle {
    logged: u64,
    last_ns: Option<u64>,
    every_ns: u64,
}

impl Default for CountThrottle {
    fn default() -> Self {
        Self { logged: 0, last_ns: None, every_ns: FIRST_NS }
    }
}

impl CountThrottle {
    /// Growth of a count since its last message, if another one is due.
    pub fn due(&mut self, total: u64, now_ns: u64) -> Option<u64> {
        let grown = total.saturating_sub(self.logged);
        let since_ns = self.last_ns.map(|last_ns| now_ns.saturating_sub(last_ns));
        if grown == 0 || since_ns.is_some_and(|since_ns| since_ns < self.every_ns) {
            return None;
        }
        // If nothing was counted for a further interval, the growth had stopped.
        let goes_on = since_ns.is_some_and(|since_ns| since_ns < 2 * self.every_ns);
        self.every_ns = if goes_on { (2 * self.every_ns).min(LONGEST_NS) } else { FIRST_NS };
        (self.logged, self.last_ns) = (total, Some(now_ns));
        Some(grown)
    }
}

/// Rate limit of messages: a burst, then one per interval.
#[derive(Clone, Copy, Debug)]
pub struct MessageBudget {
    capacity: u32,
    every_ns: u64,
    left: u32,
    refilled_ns: u64,
}

impl MessageBudget {
    /// `capacity` messages at once, and one more per `every_ns`.
    #[must_use]
    pub fn new(capacity: u32, every_ns: u64) -> Self {
        Self { capacity, every_ns, left: capacity, refilled_ns: 0 }
    }

    /// Takes one message from the budget, if available.
    pub fn take(&mut self, now_ns: u64) -> bool {
        let refill = now_ns.saturating_sub(self.refilled_ns) / self.every_ns.max(1);
        if refill > 0 {
            let room = u64::from(self.capacity - self.left);
            self.left += refill.min(room) as u32;
            self.refilled_ns = now_ns;
        }
        let has_one = self.left > 0;
        self.left -= u32::from(has_one);
        has_one
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    #[test]
    fn a_count_is_logged_at_once_then_as_a_sum_and_less_and_less_often() {
        let mut tally = CountThrottle::default();
        let lines: Vec<(u64, u64)> =
            (0..200_u64).filter_map(|s| Some((s, tally.due(s * 1000 + 1, s * S)?))).collect();
        assert_eq!(lines, [(0, 1), (10, 10_000), (30, 20_000), (70, 40_000), (150, 80_000)]);
        assert_eq!(lines.iter().map(|(_, count)| count).sum::<u64>(), 150_001, "none is lost");
    }

    #[test]
    fn after_a_pause_the_next_one_is_logged_at_once_again() {
        let mut tally = CountThrottle::default();
        assert_eq!(tally.due(5, 0), Some(5));
        assert_eq!(tally.due(6, 9 * S), None);
        assert_eq!(tally.due(6, 10 * S), Some(1));
        assert_eq!(tally.due(6, 1000 * S), None);
        assert_eq!(tally.due(7, 1000 * S), Some(1));
        assert_eq!(tally.due(8, 1010 * S), Some(1), "every 10 s again");
    }

    #[test]
    fn a_budget_gives_a_burst_and_then_one_each_so_often() {
        let mut budget = MessageBudget::new(3, 2 * S);
        let given =
            |budget: &mut MessageBudget, s: u64| (0..10).filter(|_| budget.take(s * S)).count();
        assert_eq!([0, 1, 2, 3, 4, 20].map(|s| given(&mut budget, s)), [3, 0, 1, 0, 1, 3]);
    }
}
