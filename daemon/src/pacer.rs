//! Waits for the next command: the only place where the cycle waits.
//!
//! A wait ends at its deadline at the latest; between two polls it either spins or sleeps
//! until absolute times, and never allocates, locks or logs.
//!
//! Spinning is for an isolated core: a spinning `SCHED_FIFO` thread that shares its core is stalled for 50 ms each second
//! by the kernel's fair server. Sleeping wakes shortly before the next command is due and polls every
//! `LOOK_EVERY_NS` until it arrives, and less often if no commands arrive; however short the period, it sleeps for a part of it. The due time follows from
//! the preceding commands, so that commands delayed by a stall are found immediately.

use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec};
use shm_schema::monotonic_ns;

/// Polling interval of a sleeping wait, ns.
const POLL_EVERY_NS: u64 = 50_000;
/// Polling interval if no command has arrived for [`LATE_PERIODS_MAX`], ns: faster polling would
/// occupy a fifth of a core without benefit.
const IDLE_POLL_EVERY_NS: u64 = 1_000_000;
/// A sleeping wait starts to spin this long before the next command is due, ns: allowance for a
/// late wake-up.
const SPIN_BEFORE_NS: u64 = 300_000;
/// Largest share of a period for spinning; the rest is left to other threads, however short the
/// period.
const SPIN_SHARE: f64 = 0.7;
/// It spins for this long when the command is late, ns.
const SPIN_AFTER_NS: u64 = 200_000;
/// The due time follows a command's lateness by one part in this number: enough for a sender whose
/// clock drifts.
const FOLLOW_SHARE: u64 = 256;
/// After this many consecutive commands that arrive after it has gone back to sleep, the sender is
/// taken to have restarted at another phase of its period.
const LATE_IN_A_ROW: u32 = 16;
/// Number of periods after which a late command counts as the first of a new sequence.
const LATE_PERIODS_MAX: u64 = 100;
/// Polls between two readings of the clock while spinning: a poll takes less time.
const POLLS_PER_CLOCK: u32 = 8;

/// How the cycle waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitMode {
    /// Without sleeping.
    Spin,
    /// With sleeps.
    Sleep,
}

/// Waits for commands that arrive about every `period_ns`.
#[derive(Debug)]
pub struct Pacer {
    wait: WaitMode,
    period_ns: u64,
    /// When the next command is due; zero before the first.
    due_ns: u64,
    /// When the last one arrived.
    last_ns: u64,
    /// Number of consecutive late commands, and their least lateness.
    late: (u32, u64),
}

impl Pacer {
    /// Before the first command.
    pub fn new(wait: WaitMode, period_ns: u64) -> Self {
        Self { wait, period_ns, due_ns: 0, last_ns: 0, late: (0, u64::MAX) }
    }

    /// Polls until there is something and returns the time at which it was found; `None` once the
    /// deadline (`CLOCK_MONOTONIC`, ns) has passed.
    pub fn wait_for<T>(
        &mut self,
        deadline_ns: u64,
        mut poll: impl FnMut() -> Option<T>,
    ) -> Option<(T, u64)> {
        let mut looks = 1;
        loop {
            for _ in 0..looks {
                if let Some(found) = poll() {
                    self.last_ns = monotonic_ns();
                    self.due_ns = self.next_due_ns(self.last_ns);
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
                    POLLS_PER_CLOCK
                }
            };
        }
    }

    /// When the next command is due, after one that arrived at `now_ns`.
    fn next_due_ns(&mut self, now_ns: u64) -> u64 {
        match now_ns.checked_sub(self.due_ns) {
            Some(late_ns) if late_ns < LATE_PERIODS_MAX * self.period_ns => {
                self.due_ns + self.period_ns + self.lateness_share_ns(late_ns)
            }
            _ => now_ns + self.period_ns,
        }
    }

    /// The part of a command's lateness that is expected of the next ones too: a small share, or
    /// all that a sequence of them had.
    fn lateness_share_ns(&mut self, late_ns: u64) -> u64 {
        let (row, least_ns) = self.late;
        self.late = match late_ns > SPIN_AFTER_NS {
            true => (row + 1, least_ns.min(late_ns)),
            false => (0, u64::MAX),
        };
        if self.late.0 < LATE_IN_A_ROW {
            return late_ns / FOLLOW_SHARE;
        }
        std::mem::replace(&mut self.late, (0, u64::MAX)).1
    }

    /// When to wake next; `None`: poll again at once.
    fn sleep_until_ns(&self, now_ns: u64) -> Option<u64> {
        if self.wait == WaitMode::Spin {
            return None;
        }
        let due_ns = self.due_ns;
        let share_ns = (SPIN_SHARE * self.period_ns as f64) as u64;
        let spin_from_ns = due_ns.saturating_sub(SPIN_BEFORE_NS.min(share_ns));
        if now_ns < spin_from_ns {
            return Some(spin_from_ns);
        }
        // Further commands may be queued behind a late one.
        let spin_to_ns = due_ns.max(self.last_ns) + SPIN_AFTER_NS;
        let idles = now_ns > spin_to_ns + LATE_PERIODS_MAX * self.period_ns;
        let every_ns = if idles { IDLE_POLL_EVERY_NS } else { POLL_EVERY_NS };
        (now_ns > spin_to_ns).then_some(now_ns + every_ns)
    }
}

/// Sleeps to an absolute time of `CLOCK_MONOTONIC`, ns. A signal may end the sleep early: the
/// caller polls again.
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
        for wait in [WaitMode::Spin, WaitMode::Sleep] {
            let deadline_ns = monotonic_ns() + 2_000_000;
            let found: Option<((), u64)> =
                Pacer::new(wait, 1_000_000).wait_for(deadline_ns, || None);
            assert!(found.is_none() && monotonic_ns() >= deadline_ns);
        }
    }

    #[test]
    fn a_sleeping_wait_sleeps_through_a_part_of_the_shortest_period() {
        let pacer = Pacer {
            wait: WaitMode::Sleep,
            period_ns: 100_000,
            due_ns: 10_100_000,
            last_ns: 10_000_000,
            late: (0, u64::MAX),
        };
        assert_eq!(pacer.sleep_until_ns(10_010_000), Some(10_030_000), "just answered: sleep");
        assert_eq!(pacer.sleep_until_ns(10_090_000), None, "about due: look");
    }

    #[test]
    fn commands_after_a_stall_are_found_without_sleep_and_a_drifting_sender_is_followed() {
        let pacer_due_at = |due_ns| Pacer { due_ns, ..Pacer::new(WaitMode::Sleep, 1_000_000) };
        let mut pacer = pacer_due_at(100_000_000);
        // Ten periods late, then all at once.
        for k in 0..9 {
            let now_ns = 110_000_000 + 5_000 * k;
            pacer.due_ns = pacer.next_due_ns(now_ns);
            pacer.last_ns = now_ns;
            assert_eq!(pacer.sleep_until_ns(now_ns + 5_000), None, "behind number {k}");
        }
        let (mut now_ns, mut pacer) = (100_000_000, pacer_due_at(100_000_000));
        for _ in 0..100_000 {
            pacer.due_ns = pacer.next_due_ns(now_ns);
            now_ns += 1_000_100;
        }
        assert!(now_ns - pacer.due_ns < SPIN_AFTER_NS, "100 ppm: {}", now_ns - pacer.due_ns);
        assert_eq!(
            pacer_due_at(1_000_000).next_due_ns(900_000_000),
            901_000_000,
            "the first of others"
        );
        assert_eq!(pacer_due_at(10_000_000).next_due_ns(9_500_000), 10_500_000, "earlier than due");
    }

    #[test]
    fn a_sender_that_restarts_amid_the_period_is_expected_there_soon() {
        // At 25 Hz, 13 ms after the old phase: until then found by the polls in between, at each of
        // which a sleeping cycle wakes.
        let mut pacer = Pacer { due_ns: 1_000_000_000, ..Pacer::new(WaitMode::Sleep, 40_000_000) };
        let came_ns = |k: u64| 1_013_000_000 + 40_000_000 * k;
        for k in 0..u64::from(LATE_IN_A_ROW) {
            assert!(pacer.due_ns < came_ns(k) - SPIN_AFTER_NS, "one that is late moves it little");
            pacer.due_ns = pacer.next_due_ns(came_ns(k));
        }
        let late_ns = came_ns(u64::from(LATE_IN_A_ROW)) - pacer.due_ns;
        assert!(late_ns < SPIN_AFTER_NS, "{late_ns}");
    }

    #[test]
    fn a_result_has_a_time_between_call_and_return() {
        for wait in [WaitMode::Spin, WaitMode::Sleep] {
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
        let pacer = Pacer {
            wait: WaitMode::Sleep,
            period_ns: 1_000_000,
            due_ns: 11_000_000,
            last_ns: 10_000_000,
            late: (0, u64::MAX),
        };
        assert_eq!(pacer.sleep_until_ns(10_100_000), Some(10_700_000), "long before: sleep");
        assert_eq!(pacer.sleep_until_ns(10_950_000), None, "shortly before: look");
        assert_eq!(pacer.sleep_until_ns(11_100_000), None, "a little late: look");
        assert_eq!(pacer.sleep_until_ns(11_300_000), Some(11_350_000), "late: sleep in between");
        assert_eq!(pacer.sleep_until_ns(112_000_000), Some(113_000_000), "nobody: sleep longer");
    }
}
