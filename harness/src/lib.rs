//! `trued bench` and `trued doctor`: latency and suitability of a machine.
//!
//! If a requested setting (policy, pinning, locked memory) is refused, the bench ends; everything
//! that is compared is measured in the same run, alternately, on the same two cores; parts that
//! could not be measured are reported and counted.
//!
//! Reading order: [`plan`] (the request); `flat.rs`, `paced.rs`, `force.rs`, `start.rs`, `swap.rs`,
//! [`cost`] (measurements); [`judged`] (acceptance limits); [`findings`], [`tables`], [`page`]
//! (results).

mod arms;
pub mod child;
mod chunks;
pub mod cost;
mod cyclictest;
pub mod doctor;
mod empty;
mod error;
pub mod findings;
mod flat;
mod force;
pub mod judged;
mod latencies;
mod load;
mod machine;
mod paced;
pub mod page;
mod peers;
mod place;
mod placement;
pub mod plan;
mod start;
mod subject;
mod swap;
pub mod tables;
mod thread_settings;

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

pub use chunks::{Counted, Flat};
pub use empty::Missed;
pub use error::BenchError;
pub use force::Force;
pub use latencies::{Latencies, Quantiles};
pub use machine::Machine;
pub use paced::Paced;
pub use peers::Kind;
pub use placement::{Placement, Sorter};
pub use subject::runs_fifo;
pub use swap::Swap;
pub use thread_settings::fifo_is_granted;

use crate::cost::Costing;
use crate::doctor::Texts;
use crate::findings::{AtRate, Findings, Setting, Skipped};
use crate::flat::Flats;
use crate::force::Forces;
use crate::paced::Pacing;
use crate::peers::Way;
use crate::place::Place;
use crate::plan::{Load, Plan, Policy, Programs, Stage, Wait};
use crate::subject::{Setup, Subject};
use crate::thread_settings::ThreadSettings;

/// Period of a daemon that is measured back-to-back, s: the shortest possible.
const FLAT_PERIOD_S: f64 = 1e-4;
/// The rate at which models are swapped and starts are measured, Hz.
const SWAP_RATE_HZ: u32 = 1000;
/// Separator of the arguments of a part: paths may contain spaces.
pub(crate) const BETWEEN_WORDS: &str = "\t";

/// Runs a part of the bench in a separate process, with the arguments of [`Programs::part`].
///
/// # Errors
/// An error of the part.
pub fn part(words: &str) -> Result<(), BenchError> {
    let words: Vec<&str> = words.split(BETWEEN_WORDS).collect();
    match words.split_first() {
        Some((&"echo", arguments)) => peers::echo::answer(arguments),
        Some((&"load", arguments)) => load::make(arguments),
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
    let texts = Texts::read(std::path::Path::new("/"));
    let cores = thread_settings::two_cores(plan.cores, &machine::isolated(&texts))?;
    let strictest =
        if plan.policies.contains(&Policy::Fifo) { Policy::Fifo } else { Policy::Other };
    if strictest == Policy::Fifo {
        daemon::realtime::lock_memory()?;
        thread_settings::ask_fifo(plan.priority)?;
        if let Some(cell) = &plan.cell {
            subject::wants_fifo(cell, subject::JOIN_WITHIN)?;
        }
    }
    let mut bench = Bench {
        plan,
        programs,
        stop,
        place: Place::new()?,
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
    bench.findings.judged = judged::judge(&bench.findings);
    Ok(bench.findings)
}

struct Bench<'a> {
    plan: &'a Plan,
    programs: &'a dyn Programs,
    stop: &'a AtomicBool,
    place: Place,
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
        for (stage, way) in [(Stage::Flat, Way::Poll), (Stage::Woken, Way::Wake)] {
            if self.plan.has(stage) && way == Way::Wake && self.plan.cell.is_some() {
                self.skip(stage.name(), "not available for a running cell on another core");
            } else if self.plan.has(stage) {
                say(&format!("{}, {under}", stage.name()));
                let flat = self.flat(policy, way)?;
                load::still_made(&mut made)?;
                if way == Way::Poll && self.plan.cell.is_some() {
                    let why = "not available for a running cell on another core";
                    self.skip("reference transports", why);
                }
                if !flat.is_of_corrections() {
                    let why = "more than 10 % of the daemon's answers have no solved correction; see `answers` of --json and the daemon's log";
                    self.skip("trued's round trips and their limits", why);
                }
                *(if way == Way::Poll { &mut setting.flat } else { &mut setting.woken }) =
                    Some(flat);
            }
        }
        if self.plan.has(Stage::Paced) {
            for wait in &self.plan.waits {
                for rate_hz in &self.plan.rates_hz {
                    say(&format!("paced at {rate_hz} Hz, daemon by {}, {under}", wait.name()));
                    let paced = self.paced(policy, *wait, *rate_hz)?;
                    load::still_made(&mut made)?;
                    setting.paced.push(AtRate { wait: *wait, rate_hz: *rate_hz, paced });
                }
            }
        }
        if self.plan.has(Stage::Force) {
            say(&format!("force blocks, {under}"));
            setting.force = self.force(policy)?;
            load::still_made(&mut made)?;
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
            let subject = Subject::new(self.plan, self.programs, &self.place, setup)?;
            let pacing = Pacing {
                subject: &subject,
                thread_settings: self.thread_settings(policy),
                rate_hz: SWAP_RATE_HZ,
                seconds: self.plan.seconds,
                stop: self.stop,
            };
            self.findings.swap = Some(swap::run(self.plan, &self.place, &pacing)?);
        }
        if self.plan.has(Stage::Cost) {
            say("cost of joints, effects, cells");
            let Self { plan, programs, stop, .. } = *self;
            let thread_settings = self.thread_settings(policy);
            let costing = Costing { plan, programs, place: &self.place, thread_settings, stop };
            self.findings.cost = Some(costing.run()?);
        }
        Ok(())
    }

    fn flat(&mut self, policy: Policy, way: Way) -> Result<Flat, BenchError> {
        let may = if way == Way::Wake {
            cyclictest::runs(self.thread_settings(policy)[1])
        } else {
            Ok(())
        };
        let has_cyclictest = may.map_err(|why| self.skip("cyclictest", &why)).is_ok();
        let subject = self.subject(policy, Wait::Spin, FLAT_PERIOD_S, false)?;
        let flats = Flats {
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
        let pacing = Pacing {
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
        let forces = Forces {
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
    ) -> Result<Subject, BenchError> {
        if self.stop.load(Relaxed) {
            return Err(BenchError::Interrupted);
        }
        let setup =
            Setup { thread_settings: self.thread_settings(policy)[1], wait, period_s, listens };
        Subject::new(self.plan, self.programs, &self.place, setup)
    }

    /// Settings of the client's thread, and of the daemon's cycle or a reference in its place.
    fn thread_settings(&self, policy: Policy) -> [ThreadSettings; 2] {
        let priority = self.plan.priority;
        self.cores.map(|core| ThreadSettings { core, policy, priority })
    }

    fn skip(&mut self, what: &str, why: &str) {
        let skipped = Skipped { what: what.to_owned(), why: why.to_owned() };
        if !self.findings.skipped.contains(&skipped) {
            self.findings.skipped.push(skipped);
        }
    }
}
