//! An empty cycle in parallel with the measured one: a thread that wakes half a period after each command is due, and does nothing.
//!
//! It has the same core, the same schedule and a priority that nothing of the measurement can
//! preempt, so that its delays are those of the machine. No allocation while it runs.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use daemon::pacer::sleep_until;
use daemon::realtime::RealtimeRefused;
use serde::Serialize;
use shm_schema::monotonic_ns;

use crate::latencies::Latencies;
use crate::thread_settings::ThreadSettings;

/// Limit on missed cycles that are stored by number; further ones are only counted.
const STORED_MAX: usize = 1 << 20;
/// A stall that makes a command a period late delays the empty cycle in its middle by at least this
/// share of the period.
const EXCUSE_SHARE: f64 = 0.45;

/// When cycles are due.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Schedule {
    pub(crate) start_ns: u64,
    pub(crate) period_ns: u64,
    pub(crate) cycles: u64,
}

impl Schedule {
    pub(crate) fn due_ns(&self, cycle: u64) -> u64 {
        self.start_ns + cycle * self.period_ns
    }
}

/// Delays of an empty cycle.
#[derive(Debug, Clone, Default)]
pub(crate) struct EmptyCycle {
    /// Delay of each wake-up.
    pub(crate) late: Latencies,
    /// Numbers of the cycles that were a period late.
    pub(crate) missed: Vec<u64>,
    /// Numbers of the cycles so late that a measured one at the same time may have been missed for
    /// the same reason.
    pub(crate) hindered: Vec<u64>,
}

impl EmptyCycle {
    /// Runs through the schedule, half a period after each cycle.
    pub(crate) fn run(
        thread_settings: ThreadSettings,
        schedule: Schedule,
        stop: &AtomicBool,
    ) -> Result<Self, RealtimeRefused> {
        thread_settings.apply()?;
        let mut empty = Self {
            late: Latencies::default(),
            missed: Vec::with_capacity(1024),
            hindered: Vec::with_capacity(1024),
        };
        let excuses_ns = (schedule.period_ns as f64 * EXCUSE_SHARE) as u64;
        for cycle in 0..schedule.cycles {
            let due_ns = schedule.due_ns(cycle) + schedule.period_ns / 2;
            while monotonic_ns() < due_ns {
                sleep_until(due_ns);
            }
            let late_ns = monotonic_ns() - due_ns;
            empty.late.record(late_ns);
            push_if(&mut empty.missed, cycle, late_ns > schedule.period_ns);
            push_if(&mut empty.hindered, cycle, late_ns > excuses_ns);
            if stop.load(Relaxed) {
                break;
            }
        }
        Ok(empty)
    }
}

pub(crate) fn push_if<T>(cycles: &mut Vec<T>, cycle: T, is_so: bool) {
    if is_so && cycles.len() < STORED_MAX {
        cycles.push(cycle);
    }
}

/// The cycles of `missed` during which no empty cycle was delayed: on either core, in the same
/// cycle or the previous one.
pub(crate) fn unexcused_misses(missed: &[Missed], empties: &[EmptyCycle]) -> Vec<Missed> {
    let hindered =
        |cycle: u64| empties.iter().any(|empty| empty.hindered.binary_search(&cycle).is_ok());
    let excused = |cycle: u64| hindered(cycle) || cycle.checked_sub(1).is_some_and(hindered);
    missed.iter().filter(|missed| !excused(missed.cycle)).copied().collect()
}

/// A missed cycle, and its time by stages; zeros without an answer.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Missed {
    /// Its number.
    pub cycle: u64,
    /// From its due time to its sending: the client was late, or still busy with previous ones.
    pub late_ns: u64,
    /// From its sending to its reception.
    pub there_ns: u64,
    /// From its reception to the completion of the answer.
    pub correction_ns: u64,
    /// From there to the client.
    pub back_ns: u64,
}

/// Number of cycles missed on either core.
pub(crate) fn missed_by_any(empties: &[EmptyCycle]) -> u64 {
    let mut all: Vec<u64> = empties.iter().flat_map(|empty| &empty.missed).copied().collect();
    all.sort_unstable();
    all.dedup();
    all.len() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hindered(cycles: &[u64]) -> EmptyCycle {
        EmptyCycle { hindered: cycles.to_vec(), missed: cycles.to_vec(), ..EmptyCycle::default() }
    }

    #[test]
    fn a_miss_is_excused_only_where_an_empty_cycle_was_hindered_beside_it() {
        let empties = [hindered(&[10, 11]), hindered(&[50])];
        let beyond = |cycles: &[u64]| {
            let missed: Vec<Missed> =
                cycles.iter().map(|cycle| Missed { cycle: *cycle, ..Missed::default() }).collect();
            unexcused_misses(&missed, &empties).len()
        };
        assert_eq!(beyond(&[10, 11, 12, 50, 51]), 0);
        assert_eq!(beyond(&[0, 9, 13, 52]), 4);
        assert_eq!(missed_by_any(&[hindered(&[1, 2]), hindered(&[2, 3])]), 3);
    }

    #[test]
    fn an_empty_cycle_counts_each_wake_up_once_and_none_before_it_is_due() {
        let start_ns = monotonic_ns() + 1_000_000;
        let schedule = Schedule { start_ns, period_ns: 200_000, cycles: 50 };
        let core = crate::thread_settings::allowed_cores()[0];
        let thread_settings =
            ThreadSettings { core, policy: crate::plan::Policy::Other, priority: 1 };
        let empty =
            EmptyCycle::run(thread_settings, schedule, &AtomicBool::new(false)).expect("pinned");
        assert_eq!(empty.late.count(), 50);
        assert!(monotonic_ns() >= schedule.due_ns(49) + 100_000);
    }
}
