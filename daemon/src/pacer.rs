//! Waits for the next command: the only place where the cycle spends time.
//!
//! Promises: a wait ends at its deadline at the latest; between the calls of `look` it either spins or sleeps to
//! absolute times, and never allocates, locks or logs.
//! Never: a look at a message.
//!
//! Spinning is for an isolated core: a spinning `SCHED_FIFO` thread that shares its core is stalled for 50 ms each second
//! by the kernel's fair server. Sleeping wakes shortly before the next command is due and looks again every
//! `LOOK_EVERY_NS` until it is there; however short the period, it sleeps through a part of it.

use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec};
use shm_schema::monotonic_ns;

/// How often a sleeping wait looks, ns.
const LOOK_EVERY_NS: u64 = 50_000;
/// How long before the next command is due a sleeping wait begins to look without sleeping, ns: what a wake-up may be late.
const SPIN_BEFORE_NS: u64 = 300_000;
/// How long it goes on looking without sleeping when the command is late, ns.
const SPIN_AFTER_NS: u64 = 200_000;
/// Neither may be a larger part of the period.
const SPIN_SHARE: f64 = 0.3;
/// Looks between two looks at the clock, while not sleeping: a look takes less.
const LOOKS_PER_CLOCK: u32 = 8;

/// How the cycle waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wait {
    /// Without sleeping.
    Spin,
    /// With sleeps.
    Sleep,
}

/// Waits for commands that come every `period_ns`, more or less.
#[derive(Debug)]
pub struct Pacer {
    wait: Wait,
    period_ns: u64,
    last_ns: u64,
}

impl Pacer {
    /// A pacer that has seen no command yet.
    pub fn new(wait: Wait, period_ns: u64) -> Self {
        Self { wait, period_ns, last_ns: 0 }
    }

    /// Looks until there is something, and tells when it was found; none once the deadline (`CLOCK_MONOTONIC`, ns) has passed.
    pub fn wait_for<T>(
        &mut self,
        deadline_ns: u64,
        mut look: impl FnMut() -> Option<T>,
    ) -> Option<(T, u64)> {
        let mut looks = 1;
        loop {
            for _ in 0..looks {
                if let Some(found) = look() {
                    self.last_ns = monotonic_ns();
                    return Some((found, self.last_ns));
                }
            }
            let now_ns = monotonic_ns();
            if now_ns >= deadline_ns {
                return None;
            }
            looks = match self.sleep_until_ns(now_ns) {
                Some(wake_ns) => {
                    sleep_until(wake_ns.min(deadline_ns));
                    1
                }
                None => {
                    std::hint::spin_loop();
                    LOOKS_PER_CLOCK
                }
            };
        }
    }

    /// When to wake next; none: look again at once.
    fn sleep_until_ns(&self, now_ns: u64) -> Option<u64> {
        if self.wait == Wait::Spin {
            return None;
        }
        let due_ns = self.last_ns + self.period_ns;
        let share_ns = (SPIN_SHARE * self.period_ns as f64) as u64;
        let spin_from_ns = due_ns.saturating_sub(SPIN_BEFORE_NS.min(share_ns));
        if now_ns < spin_from_ns {
            return Some(spin_from_ns);
        }
        (now_ns > due_ns + SPIN_AFTER_NS.min(share_ns)).then_some(now_ns + LOOK_EVERY_NS)
    }
}

/// Sleeps to an absolute time of `CLOCK_MONOTONIC`, ns. A signal may end the sleep early: whoever sleeps looks again.
pub fn sleep_until(wake_ns: u64) {
    let request = Timespec {
        tv_sec: (wake_ns / 1_000_000_000) as i64,
        tv_nsec: (wake_ns % 1_000_000_000) as i64,
    };
    let _ = clock_nanosleep_absolute(ClockId::Monotonic, &request);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_without_a_command_ends_at_its_deadline() {
        for wait in [Wait::Spin, Wait::Sleep] {
            let deadline_ns = monotonic_ns() + 2_000_000;
            let found: Option<((), u64)> =
                Pacer::new(wait, 1_000_000).wait_for(deadline_ns, || None);
            assert!(found.is_none() && monotonic_ns() >= deadline_ns);
        }
    }

    #[test]
    fn a_sleeping_wait_sleeps_through_a_part_of_the_shortest_period() {
        let pacer = Pacer { wait: Wait::Sleep, period_ns: 100_000, last_ns: 10_000_000 };
        assert_eq!(pacer.sleep_until_ns(10_010_000), Some(10_070_000), "just answered: sleep");
        assert_eq!(pacer.sleep_until_ns(10_090_000), None, "about due: look");
        assert_eq!(pacer.sleep_until_ns(10_140_000), Some(10_190_000), "late: sleep in between");
    }

    #[test]
    fn what_is_found_is_told_with_a_time_between_asking_and_answering() {
        for wait in [Wait::Spin, Wait::Sleep] {
            let (before_ns, mut looks) = (monotonic_ns(), 0);
            let found = Pacer::new(wait, 1_000_000).wait_for(u64::MAX, || {
                looks += 1;
                (looks == 30).then_some(looks)
            });
            let (found, at_ns) = found.expect("no deadline");
            assert!(found == 30 && (before_ns..=monotonic_ns()).contains(&at_ns));
        }
    }

    #[test]
    fn a_sleeping_wait_spins_only_around_the_time_a_command_is_due() {
        let pacer = Pacer { wait: Wait::Sleep, period_ns: 1_000_000, last_ns: 10_000_000 };
        assert_eq!(pacer.sleep_until_ns(10_100_000), Some(10_700_000), "long before: sleep");
        assert_eq!(pacer.sleep_until_ns(10_950_000), None, "shortly before: look");
        assert_eq!(pacer.sleep_until_ns(11_100_000), None, "a little late: look");
        assert_eq!(pacer.sleep_until_ns(11_300_000), Some(11_350_000), "late: sleep in between");
    }
}
