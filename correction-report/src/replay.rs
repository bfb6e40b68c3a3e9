//! A recording replayed through a daemon of its own over shared memory, with the keys of `trued.replay/1`.
//!
//! No command is lost (each row waits for its answer), and the same input gives the same bits, whatever the load of the machine.

use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use recording::model::RobotModel;
use recording::series::Recording;
use report::TextTable;
use serde::Serialize;
use shm_schema::Corrected;

use crate::corrections::{Corrections, Figures};
use crate::error::Error;
use crate::lockstep::LockstepCycle;
use crate::private_daemon::PrivateDaemon;
use crate::setpoints::{Setpoints, TimedSetpoint};

/// Maximum sleep between checks for an interruption.
const SLEEP_MAX: Duration = Duration::from_millis(50);
/// Upper bound of the time for one row, ns.
const LATENCY_NS_MAX: u64 = 60_000_000_000;
/// Answers that are judged together, so that the round trips between are timed with warm caches; it takes about a millisecond.
const EVALUATION_BATCH: usize = 128;
/// Significant digits of the latency histogram.
const DIGITS: u8 = 3;

/// Starts a daemon in lockstep (`trued run --with-parent --lockstep --config`) for a configuration; it must end with its parent.
pub type DaemonCommand<'s> = dyn Fn(&Path) -> io::Result<Command> + 's;

/// A replay.
#[derive(Debug)]
pub struct Replay {
    /// The columns of the recording and the corrected joints, as CSV.
    pub csv: Vec<u8>,
    /// Figures of the corrections.
    pub figures: Figures,
    latency: Latency,
    seconds: f64,
    in_real_time: bool,
}

/// The result as `trued.replay/1`.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report<'a> {
    #[serde(flatten)]
    figures: &'a Figures,
    corrections: Option<&'a PathBuf>,
    at_own_pace: bool,
    seconds: f64,
    rows_per_s: f64,
    latency_ns: Latency,
}

/// From sending a command to having its answer.
#[derive(Debug, Clone, Copy, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Latency {
    p50: u64,
    p99: u64,
    p999: u64,
    max: u64,
}

impl Replay {
    /// Sends every row of `recording` to a daemon that `program` starts, each row as soon as the previous one was answered, or at its time with `in_real_time`.
    /// Calls `row_done` after each.
    ///
    /// # Errors
    /// The daemon fails; a setpoint that cannot be sent; `stop` was set.
    pub fn run(
        model: &RobotModel,
        recording: Recording,
        in_real_time: bool,
        program: &DaemonCommand<'_>,
        stop: &AtomicBool,
        row_done: &mut dyn FnMut(),
    ) -> Result<Self, Error> {
        let mut daemon = PrivateDaemon::start(model, &recording, program, stop)?;
        let mut judge = AnswerEvaluator::of(model, &recording)?;
        let mut latency = Histogram::new_with_max(LATENCY_NS_MAX, DIGITS).map_err(Error::system)?;
        let start = Instant::now();
        let mut first_ns = None;
        for (place, row) in Setpoints::new(&recording, model.physics.arm.count()).enumerate() {
            let due_ns = row.t_ns - *first_ns.get_or_insert(row.t_ns);
            if in_real_time {
                wait(start, Duration::from_nanos(due_ns), stop)?;
            }
            check(stop)?;
            let sent = Instant::now();
            let answer = daemon.request(&row, stop).map_err(|why| why.in_row(&recording, place))?;
            latency.saturating_record(u64::try_from(sent.elapsed().as_nanos()).unwrap_or(u64::MAX));
            judge.take(row, answer)?;
            row_done();
        }
        let seconds = start.elapsed().saturating_sub(judge.spent).as_secs_f64();
        let corrections = judge.end()?;
        drop(daemon);
        let csv = corrections.csv(recording);
        let figures = corrections.figures(&csv);
        Ok(Self { csv, figures, latency: Latency::of(&latency), seconds, in_real_time })
    }

    /// As JSON; the table is written to `corrections`, if anywhere.
    #[must_use]
    pub fn report<'a>(&'a self, corrections: Option<&'a PathBuf>) -> Report<'a> {
        Report {
            figures: &self.figures,
            corrections,
            at_own_pace: self.in_real_time,
            seconds: self.seconds,
            rows_per_s: self.rows_per_s(),
            latency_ns: self.latency,
        }
    }

    /// As text.
    #[must_use]
    pub fn text(&self, width: Option<usize>) -> [String; 3] {
        let Self { latency, seconds, .. } = self;
        let us = |ns: u64| format!("{:.1}", ns as f64 * 1e-3);
        let table = TextTable::new(["command to answer, µs", "median", "99 %", "99.9 %", "worst"])
            .row([
                "round trip".to_owned(),
                us(latency.p50),
                us(latency.p99),
                us(latency.p999),
                us(latency.max),
            ]);
        [
            self.figures.text(width),
            format!("\n{}", table.render(width)),
            format!("{seconds:.2} s, {:.0} rows per second", self.rows_per_s()),
        ]
    }

    fn rows_per_s(&self) -> f64 {
        self.figures.rows as f64 / self.seconds
    }
}

impl Latency {
    fn of(all: &Histogram<u64>) -> Self {
        let quantile = |share| all.value_at_quantile(share);
        Self { p50: quantile(0.5), p99: quantile(0.99), p999: quantile(0.999), max: all.max() }
    }
}

/// Sleeps until `due` after `start`.
fn wait(start: Instant, due: Duration, stop: &AtomicBool) -> Result<(), Error> {
    loop {
        let left = due.saturating_sub(start.elapsed());
        if left.is_zero() {
            return Ok(());
        }
        check(stop)?;
        std::thread::sleep(left.min(SLEEP_MAX));
    }
}

/// An error once `stop` is set.
pub(crate) fn check(stop: &AtomicBool) -> Result<(), Error> {
    if stop.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
}

/// The answers with the remaining tool error. The daemon states the error at the correction it
/// solved for; the same cycle here gives the error at the one it published.
struct AnswerEvaluator<'m> {
    corrections: Corrections,
    cycle: LockstepCycle<'m>,
    /// Rows and answers that are not evaluated yet: an answer is four times the size of what is
    /// kept of it.
    waiting: Vec<(TimedSetpoint, Corrected)>,
    /// Time taken by the evaluation; it is not the daemon's.
    spent: Duration,
}

impl<'m> AnswerEvaluator<'m> {
    fn of(model: &'m RobotModel, recording: &Recording) -> Result<Self, Error> {
        Ok(Self {
            corrections: Corrections::new(model),
            cycle: LockstepCycle::in_default_cell(model, recording)?,
            waiting: Vec::with_capacity(EVALUATION_BATCH),
            spent: Duration::ZERO,
        })
    }

    fn take(&mut self, row: TimedSetpoint, answer: Corrected) -> Result<(), Error> {
        self.waiting.push((row, answer));
        if self.waiting.len() == EVALUATION_BATCH { self.evaluate_waiting() } else { Ok(()) }
    }

    fn evaluate_waiting(&mut self) -> Result<(), Error> {
        let start = Instant::now();
        for (row, answer) in self.waiting.drain(..) {
            self.cycle.answer(&row)?;
            let left = self.cycle.remaining_error(&answer);
            let taken = self.corrections.add(row.setpoint.joints(), &answer, left);
            taken.map_err(Error::system)?;
        }
        self.spent += start.elapsed();
        Ok(())
    }

    fn end(mut self) -> Result<Corrections, Error> {
        self.evaluate_waiting()?;
        Ok(self.corrections)
    }
}
