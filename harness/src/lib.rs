//! `trued bench` and `trued doctor`: latency and suitability of a machine.
//!
//! If a requested setting (policy, pinning, locked memory) is refused, the bench ends; everything
//! that is compared is measured in the same run, alternately, on the same two cores; parts that
//! could not be measured are reported and counted.
//!
//! Reading order: [`plan`] (the request); `back_to_back.rs`, `paced.rs`, `force.rs`, `start.rs`,
//! `model_swap.rs`, [`cost`] (measurements); [`limit_checks`] (acceptance limits); [`findings`],
//! [`tables`], [`page`] (results).

mod artificial_robots;
mod back_to_back;
mod bench_directory;
pub mod child;
mod chunks;
pub mod cost;
mod cyclictest;
pub mod doctor;
mod empty_cycle;
mod error;
pub mod findings;
mod force;
mod latencies;
pub mod limit_checks;
mod load;
mod machine;
mod measured_daemon;
mod model_swap;
mod paced;
pub mod page;
mod peers;
mod placement;
pub mod plan;
mod start;
pub mod tables;
mod thread_settings;

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

pub use chunks::{BackToBack, TripLatencies};
pub use empty_cycle::Missed;
pub use error::BenchError;
pub use force::Force;
pub use latencies::{Latencies, Quantiles};
pub use machine::Machine;
pub use measured_daemon::runs_fifo;
pub use model_swap::ModelSwap;
pub use paced::Paced;
pub use peers::Transport;
pub use placement::{Placement, PlacementClassifier};
pub use thread_settings::fifo_is_granted;

use crate::back_to_back::BackToBackMeasurement;
use crate::bench_directory::BenchDirectory;
use crate::cost::CostMeasurement;
use crate::doctor::KernelInfo;
use crate::findings::{Findings, PacedAtRate, Setting, SkippedPart};
use crate::force::ForceMeasurement;
use crate::measured_daemon::{MeasuredDaemon, Setup};
use crate::paced::PacedMeasurement;
use crate::peers::WakeMode;
use crate::plan::{Load, Plan, Policy, Programs, Stage, Wait};
use crate::thread_settings::ThreadSettings;

/// Period of a daemon that is measured back-to-back, s: the shortest possible.
const FLAT_PERIOD_S: f64 = 1e-4;
/// The rate at which models are swapped and starts are measured, Hz.
const SWAP_RATE_HZ: u32 = 1000;
/// Separator of the arguments of a part: paths may contain spaces.
pub(crate) const ARGUMENT_SEPARATOR: &str = "\t";

/// Runs a part of the bench in a separate process, with the arguments of [`Programs::part`].
///
/// # Errors
/// An error of the part.
pub fn part(text: &str) -> Result<(), BenchError> {
    let arguments: Vec<&str> = text.split(ARGUMENT_SEPARATOR).collect();
    match arguments.split_first() {
        Some((&"echo", arguments)) => peers::echo::run_echo(arguments),
        Some((&"load", arguments)) => load::run_loads(arguments),
        _ => Err(BenchError::part("unknown", "unknown part")),
    }
}

/// Runs a bench; reports each step to `say`.
///
/// # Errors
/// See [`BenchError`]; nothing is left behind then.
pub fn run(
    plan: &Plan,
    programs: &dyn Programs,
    stop: &AtomicBool,
    say: &mut dyn FnMut(&str),
) -> Result<Findings, BenchError> {
    // A signal from the terminal also reaches the bench's other processes: their end is then not an
    // error.
    let interrupted = |e| if stop.load(Relaxed) { BenchError::Interrupted } else { e };
    all(plan, programs, stop, say).map_err(interrupted)
}

fn all(
    plan: &Plan,
    programs: &dyn Programs,
    stop: &AtomicBool,
    say: &mut dyn FnMut(&str),
) -> Result<Findings, BenchError> {
    let texts = KernelInfo::read(std::path::Path::new("/"));
    let cores = thread_settings::choose_cores(plan.cores, &machine::isolated(&texts))?;
    let strictest =
        if plan.policies.contains(&Policy::Fifo) { Policy::Fifo } else { Policy::Other };
    if strictest == Policy::Fifo {
        daemon::realtime::lock_memory()?;
        thread_settings::try_fifo(plan.priority)?;
        if let Some(cell) = &plan.cell {
            measured_daemon::require_fifo(cell, measured_daemon::JOIN_WITHIN)?;
        }
    }
    let mut bench = Bench {
        plan,
        programs,
        stop,
        place: BenchDirectory::new()?,
        cores,
        findings: Findings::new(Machine::of(&texts, strictest, cores), plan),
    };
    let stolen_before = machine::stolen_ticks();
    for policy in &plan.policies {
        for load in &plan.loads {
            bench.setting(*policy, load, say)?;
        }
    }
    bench.once(strictest, say)?;
    bench.findings.machine.stolen_ticks = machine::stolen_ticks().saturating_sub(stolen_before);
    bench.findings.judged = limit_checks::check_limits(&bench.findings);
    Ok(bench.findings)
}

struct Bench<'a> {
    plan: &'a Plan,
    programs: &'a dyn Programs,
    stop: &'a AtomicBool,
    place: BenchDirectory,
    cores: [usize; 2],
    findings: Findings,
}

impl Bench<'_> {
    /// All parts that depend on policy and load.
    fn setting(
        &mut self,
        policy: Policy,
        load: &[Load],
        say: &mut dyn FnMut(&str),
    ) -> Result<(), BenchError> {
        let mut made = load::start(self.plan, self.programs, load)?;
        let mut setting = Setting::new(policy, load);
        let under = setting.name();
        for (stage, way) in [(Stage::Flat, WakeMode::Poll), (Stage::Woken, WakeMode::Wake)] {
            if self.plan.has(stage) && way == WakeMode::Wake && self.plan.cell.is_some() {
                self.skip(stage.name(), "not available for a running cell on another core");
            } else if self.plan.has(stage) {
                say(&format!("{}, {under}", stage.name()));
                let flat = self.flat(policy, way)?;
                load::check_running(&mut made)?;
                if way == WakeMode::Poll && self.plan.cell.is_some() {
                    let why = "not available for a running cell on another core";
                    self.skip("reference transports", why);
                }
                if !flat.is_of_corrections() {
                    let why = "more than 10 % of the daemon's answers have no solved correction; see `answers` of --json and the daemon's log";
                    self.skip("trued's round trips and their limits", why);
                }
                *(if way == WakeMode::Poll { &mut setting.flat } else { &mut setting.woken }) =
                    Some(flat);
            }
        }
        if self.plan.has(Stage::Paced) {
            for wait in &self.plan.waits {
                for rate_hz in &self.plan.rates_hz {
                    say(&format!("paced at {rate_hz} Hz, daemon by {}, {under}", wait.name()));
                    let paced = self.paced(policy, *wait, *rate_hz)?;
                    load::check_running(&mut made)?;
                    setting.paced.push(PacedAtRate { wait: *wait, rate_hz: *rate_hz, paced });
                }
            }
        }
        if self.plan.has(Stage::Force) {
            say(&format!("force blocks, {under}"));
            setting.force = self.force(policy)?;
            load::check_running(&mut made)?;
        }
        self.findings.settings.push(setting);
        Ok(())
    }

    /// The parts that are measured once.
    fn once(&mut self, policy: Policy, say: &mut dyn FnMut(&str)) -> Result<(), BenchError> {
        if self.plan.cell.is_some() {
            for stage in [Stage::Start, Stage::Swap, Stage::Cost] {
                self.skip(stage.name(), "not available for a running cell");
            }
            return Ok(());
        }
        let setup = Setup {
            thread_settings: self.thread_settings(policy)[1],
            wait: Wait::Sleep,
            period_s: 1.0 / f64::from(SWAP_RATE_HZ),
            listens: false,
        };
        if self.plan.has(Stage::Start) {
            say("starts of a daemon");
            let starts = start::run(self.plan, self.programs, &self.place, setup, self.stop)?;
            self.findings.starts = Some(starts);
        }
        if self.plan.has(Stage::Swap) {
            say("models swapped");
            let subject = MeasuredDaemon::new(self.plan, self.programs, &self.place, setup)?;
            let pacing = PacedMeasurement {
                subject: &subject,
                thread_settings: self.thread_settings(policy),
                rate_hz: SWAP_RATE_HZ,
                seconds: self.plan.seconds,
                stop: self.stop,
            };
            self.findings.swap = Some(model_swap::run(self.plan, &self.place, &pacing)?);
        }
        if self.plan.has(Stage::Cost) {
            say("cost of joints, effects, cells");
            let Self { plan, programs, stop, .. } = *self;
            let thread_settings = self.thread_settings(policy);
            let costing =
                CostMeasurement { plan, programs, place: &self.place, thread_settings, stop };
            self.findings.cost = Some(costing.run()?);
        }
        Ok(())
    }

    fn flat(&mut self, policy: Policy, way: WakeMode) -> Result<BackToBack, BenchError> {
        let may = if way == WakeMode::Wake {
            cyclictest::runs(self.thread_settings(policy)[1])
        } else {
            Ok(())
        };
        let has_cyclictest = may.map_err(|why| self.skip("cyclictest", &why)).is_ok();
        let subject = self.subject(policy, Wait::Spin, FLAT_PERIOD_S, false)?;
        let flats = BackToBackMeasurement {
            subject: &subject,
            programs: self.programs,
            place: &self.place,
            thread_settings: self.thread_settings(policy),
            way,
            has_cyclictest,
            seconds: self.plan.seconds,
            stop: self.stop,
        };
        flats.run()
    }

    fn paced(&self, policy: Policy, wait: Wait, rate_hz: u32) -> Result<Paced, BenchError> {
        let subject = self.subject(policy, wait, 1.0 / f64::from(rate_hz), false)?;
        let pacing = PacedMeasurement {
            subject: &subject,
            thread_settings: self.thread_settings(policy),
            rate_hz,
            seconds: self.plan.seconds,
            stop: self.stop,
        };
        pacing.run(|_| {})
    }

    fn force(&mut self, policy: Policy) -> Result<Option<Force>, BenchError> {
        if self.plan.cell.is_some() {
            self.skip(Stage::Force.name(), "a running cell has its own sensor");
            return Ok(None);
        }
        let subject = self.subject(policy, Wait::Sleep, 1e-3, true)?;
        let thread_settings = self.thread_settings(policy)[0];
        let forces = ForceMeasurement {
            subject: &subject,
            thread_settings,
            seconds: self.plan.seconds,
            stop: self.stop,
        };
        Ok(Some(forces.run()?))
    }

    fn subject(
        &self,
        policy: Policy,
        wait: Wait,
        period_s: f64,
        listens: bool,
    ) -> Result<MeasuredDaemon, BenchError> {
        if self.stop.load(Relaxed) {
            return Err(BenchError::Interrupted);
        }
        let setup =
            Setup { thread_settings: self.thread_settings(policy)[1], wait, period_s, listens };
        MeasuredDaemon::new(self.plan, self.programs, &self.place, setup)
    }

    /// Settings of the client's thread, and of the daemon's cycle or a reference in its place.
    fn thread_settings(&self, policy: Policy) -> [ThreadSettings; 2] {
        let priority = self.plan.priority;
        self.cores.map(|core| ThreadSettings { core, policy, priority })
    }

    fn skip(&mut self, what: &str, why: &str) {
        let skipped = SkippedPart { what: what.to_owned(), why: why.to_owned() };
        if !self.findings.skipped.contains(&skipped) {
            self.findings.skipped.push(skipped);
        }
    }
}
