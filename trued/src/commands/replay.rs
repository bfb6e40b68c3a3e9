//! `trued replay`: runs the daemon on a recording over shared memory, row by row.
//!
//! No command is lost (each row waits for its answer), and the same input gives the same bits,
//! whatever the load of the machine; a running cell is not affected; nothing is left behind.

mod daemon;

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use clap::Args;
use hdrhistogram::Histogram;
use report::TextTable;
use serde::Serialize;
use shm_schema::Corrected;

use self::daemon::OwnDaemon;
use crate::corrections::{Corrections, Figures};
use crate::exit::{Answer, Failure, Outcome};
use crate::input::{Input, Reading};
use crate::lockstep::Cycle;
use crate::output::Console;
use crate::pages::Outputs;
use crate::setpoints::{Setpoints, Timed};
use crate::table::on_stdout;
use crate::{interrupt, progress};

/// Maximum sleep between checks for an interruption.
const NAP: Duration = Duration::from_millis(50);
/// Upper bound of the time for one row, ns.
const LATENCY_NS_MAX: u64 = 60_000_000_000;
/// Answers that are judged together, so that the round trips between are timed with warm caches; it takes about a millisecond.
const JUDGED_AT_ONCE: usize = 128;
/// Significant digits of the latency histogram.
const DIGITS: u8 = 3;

/// Replay a recording through the daemon over shared memory
///
/// Starts a separate daemon and sends it the recording row by row, each row as soon as the previous one
/// was answered. With kind = "poses" in the accompanying TOML, each row gets its steady-state correction.
#[derive(Debug, Args)]
pub(crate) struct Replay {
    #[command(flatten)]
    reading: Reading,
    /// Write the corrections: the columns of the recording, `c1_deg` … (`c1_mm`), `status`
    #[arg(long, value_name = "FILE.csv")]
    corrections: Option<PathBuf>,
    /// Replay in real time; without it, as fast as possible
    #[arg(long)]
    pace: bool,
    /// The recording
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report<'a> {
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

/// What driving gave.
struct Driven {
    corrections: Corrections,
    latency: Latency,
    seconds: f64,
}

impl Replay {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let mut outputs = console.outputs();
        if let Some(out) = &self.corrections {
            outputs = outputs.file(out);
        }
        outputs.check([&self.recording].into_iter().chain(self.reading.files()))?;
        let input = self.reading.read(&self.recording, None)?;
        let stop = interrupt::flag()?;
        let mut daemon = OwnDaemon::start(&input, &stop)?;
        let driven = self.drive(console, &input, &mut daemon, &stop)?;
        drop(daemon);
        let csv = driven.corrections.csv(input.recording);
        if let Some(out) = &self.corrections {
            outputs.put(out, csv.as_slice());
        }
        self.say(console, outputs, &driven.corrections.figures(&csv), &driven)
    }

    fn drive(
        &self,
        console: &Console,
        input: &Input,
        daemon: &mut OwnDaemon,
        stop: &AtomicBool,
    ) -> Result<Driven, Failure> {
        let mut judge = Judge::of(input)?;
        let mut latency =
            Histogram::new_with_max(LATENCY_NS_MAX, DIGITS).map_err(Failure::system)?;
        let bar = progress::bar(console, input.recording.len() as u64, "replaying");
        let start = Instant::now();
        let mut first_ns = None;
        for row in Setpoints::of(&input.recording, input.joint_kinds.len()) {
            let due_ns = row.t_ns - *first_ns.get_or_insert(row.t_ns);
            if self.pace {
                wait(start, Duration::from_nanos(due_ns), stop)?;
            }
            interrupt::check(stop)?;
            let sent = Instant::now();
            let answer = daemon.ask(&row, stop)?;
            latency.saturating_record(u64::try_from(sent.elapsed().as_nanos()).unwrap_or(u64::MAX));
            judge.take(row, answer)?;
            bar.inc(1);
        }
        let seconds = start.elapsed().saturating_sub(judge.spent).as_secs_f64();
        let corrections = judge.end()?;
        Ok(Driven { corrections, latency: Latency::of(&latency), seconds })
    }

    fn say(
        &self,
        console: &mut Console,
        outputs: Outputs,
        figures: &Figures,
        driven: &Driven,
    ) -> Outcome {
        let Driven { latency, seconds, corrections } = driven;
        let rows_per_s = corrections.rows() as f64 / seconds;
        console.write(
            outputs,
            "trued.replay/1",
            &Report {
                figures,
                corrections: self.corrections.as_ref(),
                at_own_pace: self.pace,
                seconds: *seconds,
                rows_per_s,
                latency_ns: *latency,
            },
        )?;
        console.say(figures.told(0, |row| row))?;
        let us = |ns: u64| format!("{:.1}", ns as f64 * 1e-3);
        let table = TextTable::new(["command to answer, µs", "median", "99 %", "99.9 %", "worst"])
            .row([
                "round trip".to_owned(),
                us(latency.p50),
                us(latency.p99),
                us(latency.p999),
                us(latency.max),
            ]);
        console.say(format!("\n{}", on_stdout(&table)))?;
        console.say(format!("{seconds:.2} s, {rows_per_s:.0} rows per second"))?;
        if let Some(out) = &self.corrections {
            console.say(format!("corrections         {}", out.display()))?;
        }
        Ok(Answer::Done)
    }
}

impl Latency {
    fn of(all: &Histogram<u64>) -> Self {
        let at = |share| all.value_at_quantile(share);
        Self { p50: at(0.5), p99: at(0.99), p999: at(0.999), max: all.max() }
    }
}

/// Sleeps until `due` after `start`.
fn wait(start: Instant, due: Duration, stop: &AtomicBool) -> Result<(), Failure> {
    loop {
        let left = due.saturating_sub(start.elapsed());
        if left.is_zero() {
            return Ok(());
        }
        interrupt::check(stop)?;
        std::thread::sleep(left.min(NAP));
    }
}

/// The answers with the remaining tool error. The daemon states the error at the correction it
/// solved for; the same cycle here gives the error at the one it published.
struct Judge<'m> {
    corrections: Corrections,
    cycle: Cycle<'m>,
    /// Rows and answers that are not evaluated yet: an answer is four times the size of what is
    /// kept of it.
    waiting: Vec<(Timed, Corrected)>,
    /// What judging took: no time of the daemon's.
    spent: Duration,
}

impl<'m> Judge<'m> {
    fn of(input: &'m Input) -> Result<Self, Failure> {
        Ok(Self {
            corrections: Corrections::of(&input.model),
            cycle: Cycle::of_cell(&input.model, &input.recording)?,
            waiting: Vec::with_capacity(JUDGED_AT_ONCE),
            spent: Duration::ZERO,
        })
    }

    fn take(&mut self, row: Timed, answer: Corrected) -> Result<(), Failure> {
        self.waiting.push((row, answer));
        if self.waiting.len() == JUDGED_AT_ONCE { self.judge() } else { Ok(()) }
    }

    fn judge(&mut self) -> Result<(), Failure> {
        let start = Instant::now();
        for (row, answer) in self.waiting.drain(..) {
            self.cycle.answer(&row)?;
            let left = self.cycle.left_with(&answer);
            let taken = self.corrections.take(row.setpoint.joints(), &answer, left);
            taken.map_err(Failure::system)?;
        }
        self.spent += start.elapsed();
        Ok(())
    }

    fn end(mut self) -> Result<Corrections, Failure> {
        self.judge()?;
        Ok(self.corrections)
    }
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report<'_>>("replay", "trued.replay/1")
}
