//! Round trips at a given rate, as in a robot controller.
//!
//! Every cycle of the schedule is counted, from its due time as well as from its actual sending:
//! commands delayed by a stall count as late as the robot would have experienced them (no
//! coordinated omission).

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::ScopedJoinHandle;
use std::time::Duration;

use daemon::pacer::sleep_until;
use shm_schema::monotonic_ns;
use trued_client::Corrected;

use crate::empty_cycle::{EmptyCycle, Missed, Schedule, missed_by_any, push_if, unexcused_misses};
use crate::error::BenchError;
use crate::latencies::Latencies;
use crate::measured_daemon::MeasuredDaemon;
use crate::peers::trued::{Answers, Trued};
use crate::plan::Stage;
use crate::thread_settings::ThreadSettings;

/// Time before a command is due at which the client starts to spin, ns; at most this share of a
/// period.
const SPIN_BEFORE_NS: u64 = 120_000;
const SPIN_SHARE: f64 = 0.3;
/// Time limit of an answer; lost ones count as late by this time.
const ANSWER_LIMIT: Duration = Duration::from_millis(200);
/// Time from the set-up to the first command.
const HEAD_START_NS: u64 = 120_000_000;
/// Limit on missed cycles stored with their stages.
const BEYOND_SHOWN: usize = 200;
/// Warm-up before counting starts, so that the start does not count as late.
const WARM_UP_S: f64 = 0.1;

/// Results.
#[derive(Debug, Clone, Default)]
pub struct Paced {
    /// From the scheduled time to the answer.
    pub scheduled: Latencies,
    /// From the actual sending to the answer.
    pub actual: Latencies,
    /// Delays of the empty cycle's wake-ups, on both cores.
    pub empty: Latencies,
    /// Cycles of the schedule.
    pub cycles: u64,
    /// Cycles answered after the next command was due, including lost ones.
    pub missed: u64,
    /// Cycles without an answer.
    pub unanswered: u64,
    /// Empty cycles missed, on either core.
    pub empty_missed: u64,
    /// Missed cycles during which no empty cycle was delayed.
    pub missed_beyond_empty: u64,
    /// Stages of the first of these.
    pub beyond: Vec<Missed>,
    /// Time in the daemon.
    pub correction: Latencies,
}

/// Context of the measurement.
pub(crate) struct PacedMeasurement<'a> {
    pub(crate) subject: &'a MeasuredDaemon,
    pub(crate) thread_settings: [ThreadSettings; 2],
    pub(crate) rate_hz: u32,
    pub(crate) seconds: f64,
    pub(crate) stop: &'a AtomicBool,
}

impl PacedMeasurement<'_> {
    /// Measures, and passes each answer to `watch`.
    pub(crate) fn run(
        &self,
        mut watch: impl FnMut(&Corrected) + Send,
    ) -> Result<Paced, BenchError> {
        let mut trued = Trued::new(self.subject.client()?);
        let period_ns = 1_000_000_000 / u64::from(self.rate_hz.max(1));
        let cycles = ((self.seconds * f64::from(self.rate_hz)).round() as u64).max(1);
        let schedule = Schedule { start_ns: monotonic_ns() + HEAD_START_NS, period_ns, cycles };
        let over = AtomicBool::new(false);
        let ended = BenchError::Thread(Stage::Paced.name());
        let (measured, empties) = std::thread::scope(|scope| {
            let empties = self.thread_settings.map(|thread_settings| {
                let over = &over;
                scope.spawn(move || {
                    EmptyCycle::run(thread_settings.with_higher_priority(), schedule, over)
                })
            });
            let measuring = scope.spawn(|| {
                self.thread_settings[0].apply()?;
                self.measure(&mut trued, schedule, &mut watch)
            });
            let measured = measuring.join();
            over.store(true, Relaxed);
            (measured, empties.map(ScopedJoinHandle::join))
        });
        let Ok(measured) = measured else { return Err(ended) };
        let (mut paced, missed) = measured?;
        let mut beside = Vec::new();
        for empty in empties {
            let Ok(empty) = empty else { return Err(ended) };
            beside.push(empty?);
        }
        paced.beyond = unexcused_misses(&missed, &beside);
        paced.missed_beyond_empty = paced.beyond.len() as u64;
        paced.beyond.truncate(BEYOND_SHOWN);
        paced.empty_missed = missed_by_any(&beside);
        beside.iter().for_each(|empty| paced.empty.add(&empty.late));
        paced.correction = trued.answers.correction;
        Ok(paced)
    }

    fn measure(
        &self,
        trued: &mut Trued,
        schedule: Schedule,
        watch: &mut dyn FnMut(&Corrected),
    ) -> Result<(Paced, Vec<Missed>), BenchError> {
        let spin_ns = ((schedule.period_ns as f64 * SPIN_SHARE) as u64).min(SPIN_BEFORE_NS);
        let mut paced = Paced::default();
        let mut missed: Vec<Missed> = Vec::with_capacity(1024);
        self.warm_up(trued, schedule)?;
        for cycle in 0..schedule.cycles {
            let due_ns = schedule.due_ns(cycle);
            wait_until(due_ns, spin_ns);
            let (sent_ns, here_ns) = trued.command(ANSWER_LIMIT);
            let end_ns = here_ns.unwrap_or_else(monotonic_ns);
            paced.unanswered += u64::from(here_ns.is_none());
            paced.actual.record(end_ns - sent_ns);
            paced.scheduled.record(end_ns - due_ns);
            let is_missed = here_ns.is_none() || end_ns - due_ns > schedule.period_ns;
            paced.missed += u64::from(is_missed);
            let answer = trued.newest.as_ref().filter(|_| here_ns.is_some());
            push_if(&mut missed, cycle_stages(cycle, due_ns, sent_ns, answer, end_ns), is_missed);
            if let Some(answer) = answer {
                watch(answer);
            }
            if cycle % 64 == 0 && self.stop.load(Relaxed) {
                return Err(BenchError::Interrupted);
            }
        }
        paced.cycles = schedule.cycles;
        if paced.unanswered == paced.cycles {
            let limit_ms = ANSWER_LIMIT.as_millis() as u64;
            return Err(BenchError::Silent { stage: Stage::Paced.name(), limit_ms });
        }
        Ok((paced, missed))
    }

    /// Sends commands until the schedule begins, without counting.
    fn warm_up(&self, trued: &mut Trued, schedule: Schedule) -> Result<(), BenchError> {
        let first_ns = schedule.start_ns.saturating_sub((WARM_UP_S * 1e9) as u64);
        let mut due_ns = first_ns.max(monotonic_ns());
        while due_ns + 2 * schedule.period_ns < schedule.start_ns {
            wait_until(due_ns, SPIN_BEFORE_NS);
            trued.command(ANSWER_LIMIT);
            due_ns = monotonic_ns() + schedule.period_ns;
        }
        trued.answers = Answers::default();
        Ok(())
    }
}

/// Stages of a cycle.
fn cycle_stages(
    cycle: u64,
    due_ns: u64,
    sent_ns: u64,
    answer: Option<&Corrected>,
    end_ns: u64,
) -> Missed {
    let late_ns = sent_ns.saturating_sub(due_ns);
    let Some(answer) = answer else { return Missed { cycle, late_ns, ..Missed::default() } };
    Missed {
        cycle,
        late_ns,
        there_ns: answer.received_ns.saturating_sub(sent_ns),
        correction_ns: answer.made_ns.saturating_sub(answer.received_ns),
        back_ns: end_ns.saturating_sub(answer.made_ns),
    }
}

/// Sleeps, and spins for the last `spin_ns`.
fn wait_until(due_ns: u64, spin_ns: u64) {
    let wake_ns = due_ns.saturating_sub(spin_ns);
    if monotonic_ns() < wake_ns {
        sleep_until(wake_ns);
    }
    while monotonic_ns() < due_ns {
        std::hint::spin_loop();
    }
}
