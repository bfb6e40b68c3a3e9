//! Request of a bench, as command-line options.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use harness::plan::{Load, Plan, Policy, Stage, Wait};
use harness::{fifo_is_granted, runs_fifo};
use recording::model::presets::preset;
use shm_schema::Cell;

use super::twenty_effects;
use crate::exit::Failure;

/// The robot without effects, and with those of the thesis.
const PLAIN_PRESET: &str = "irb1600-6-145";
const THESIS_PRESET: &str = "irb1600-6-145-thesis";
/// Shortest and longest part, s.
const SECONDS: std::ops::RangeInclusive<f64> = 0.05..=86_400.0;
/// Duration of a part where none is given, s.
const USUAL_SECONDS: f64 = 5.0;
/// Command rates where none is given, Hz.
const USUAL_RATES_HZ: [u32; 3] = [1000, 4000, 10_000];
/// Starts of a daemon where no number is given.
const USUAL_STARTS: u32 = 20;
/// Loads where none is given.
const USUAL_LOADS: [&str; 2] = ["idle", "all"];
/// Ways of waiting where none is given.
const USUAL_WAITS: [Wait; 2] = [Wait::Sleep, Wait::Spin];
/// Priority under `SCHED_FIFO` where none is given.
const USUAL_PRIORITY: u8 = 80;
/// A quick bench: parts so short that all of it takes less than 30 s.
const QUICK_SECONDS: f64 = 1.5;

/// Which policies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Policies {
    /// `SCHED_FIFO` if permitted, otherwise `SCHED_OTHER`
    Auto,
    /// `SCHED_FIFO`; if it is not permitted, nothing is measured
    Fifo,
    /// `SCHED_OTHER`, the default scheduler
    Other,
    /// Both, one after the other
    Both,
}

/// What the daemon corrects; the same robot without effects is what it swaps with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Model {
    /// The 44 effects of the thesis
    Thesis,
    /// The 20 effects of the comparison of one correction with other programs
    Twenty,
}

/// Options of the measurement.
#[derive(Debug, Clone, Args)]
pub(super) struct BenchOptions {
    /// Short form: every part once without load, at most 30 s in all
    #[arg(long, conflicts_with_all = ["rates", "loads", "waits", "stages", "seconds", "starts"])]
    quick: bool,
    /// Measure this running cell instead of a separate daemon; no other client may command it meanwhile
    #[arg(long, value_name = "NAME")]
    cell: Option<String>,
    /// Model of the daemon under test: thesis (44 effects), twenty (20 effects, those of the comparison with other programs)
    #[arg(
        long,
        value_enum,
        conflicts_with = "cell",
        default_value = "thesis",
        hide_possible_values = true
    )]
    model: Model,
    /// Scheduling of the measuring threads and of the daemon's cycle: auto (fifo if permitted), fifo, other, both (one after the other)
    #[arg(long, value_enum, default_value = "auto", hide_possible_values = true)]
    policy: Policies,
    #[arg(long, value_name = "N", help = format!("Priority under `SCHED_FIFO`, 2 to 98 [default: {USUAL_PRIORITY}]"))]
    #[arg(value_parser = clap::value_parser!(u8).range(2..=98))]
    priority: Option<u8>,
    /// Core of the client and core of the daemon; if not given, the last isolated cores
    #[arg(long, value_name = "A,B", value_delimiter = ',', num_args = 1)]
    cores: Vec<usize>,
    #[arg(help = format!("Command rates to measure in the part paced, Hz [default: {}]", USUAL_RATES_HZ.map(|hz| hz.to_string()).join(",")))]
    #[arg(long = "rate", value_name = "HZ,…", value_delimiter = ',',
          value_parser = clap::value_parser!(u32).range(10..=10_000))]
    rates: Vec<u32>,
    #[arg(help = format!("Loads to measure: idle, all, or kinds joined by + (memory, cache, disk, network). Parts start, swap and cost are measured without load [default: {}]", USUAL_LOADS.join(",")))]
    #[arg(long = "load", value_name = "LOAD,…", value_delimiter = ',')]
    loads: Vec<String>,
    #[arg(help = format!("How the daemon waits for commands in the part paced: sleep, spin. Not for a running cell, which waits as configured [default: {}]", USUAL_WAITS.map(Wait::name).join(",")))]
    #[arg(long = "wait", conflicts_with = "cell", value_name = "WAIT,…", value_delimiter = ',')]
    waits: Vec<String>,
    /// Parts to run: flat, woken, paced, force, start, swap, cost
    #[arg(long = "only", value_name = "PART,…", value_delimiter = ',')]
    stages: Vec<String>,
    #[arg(help = format!("Duration of each part, for each combination of policy, load, rate and wait: 10 (seconds), 90s, 10m, 2h [default: {USUAL_SECONDS}]"))]
    #[arg(long, value_name = "TIME", value_parser = seconds)]
    seconds: Option<f64>,
    #[arg(help = format!("Number of daemon starts to measure in the part start, 1 to 10000 [default: {USUAL_STARTS}]"))]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    starts: Option<u32>,
}

impl BenchOptions {
    pub(super) fn plan(&self) -> Result<Plan, Failure> {
        let cores = match self.cores.as_slice() {
            [] => None,
            [a, b] => Some([*a, *b]),
            _ => return Err(Failure::input("--cores: expected two core numbers, for example 2,3")),
        };
        if let Some(cell) = &self.cell {
            Cell::new(cell).map_err(|fault| Failure::input(format!("--cell: {fault}")))?;
        }
        let stages = self.stages()?;
        self.check_used(&stages)?;
        let text = |name: &str| {
            let known = preset(name).ok_or("the bench's preset is missing from this build");
            known.map(|known| known.text.to_owned()).map_err(Failure::system)
        };
        let robot = text(PLAIN_PRESET)?;
        let models = match self.model {
            Model::Thesis => [text(THESIS_PRESET)?, robot],
            Model::Twenty => [twenty_effects::model_text(&robot), robot],
        };
        let plan = Plan {
            cell: self.cell.clone(),
            models,
            model: match self.model {
                Model::Thesis => "thesis, 44 effects",
                Model::Twenty => "twenty, 20 effects",
            },
            cores,
            policies: self.policies(),
            priority: self.priority(),
            loads: self.loads()?,
            waits: self.waits()?,
            rates_hz: given_or(&self.rates, &USUAL_RATES_HZ),
            stages,
            seconds: self.seconds.unwrap_or(USUAL_SECONDS),
            repeats: self.starts.unwrap_or(USUAL_STARTS),
            scratch: std::env::current_dir().unwrap_or_else(|_| PathBuf::from(".")),
        };
        Ok(if self.quick { quick(plan) } else { plan })
    }

    /// Options of parts that are not run would do nothing.
    fn check_used(&self, stages: &[Stage]) -> Result<(), Failure> {
        if self.priority.is_some() && self.policy == Policies::Other {
            return Err(Failure::input(
                "--priority has no effect with --policy other, which has no priorities: leave it out, or give --policy fifo",
            ));
        }
        // A running cell is not started anew, its models are not swapped, and it has its own sensor.
        let of_cells = [Stage::Flat, Stage::Paced];
        let runs = |stage: &Stage| {
            stages.contains(stage) && (self.cell.is_none() || of_cells.contains(stage))
        };
        let under_load = [Stage::Flat, Stage::Woken, Stage::Paced, Stage::Force];
        let timed = Stage::ALL.into_iter().filter(|stage| *stage != Stage::Start);
        let given = [
            ("--rate", !self.rates.is_empty(), vec![Stage::Paced]),
            ("--wait", !self.waits.is_empty(), vec![Stage::Paced]),
            ("--load", !self.loads.is_empty(), under_load.to_vec()),
            ("--starts", self.starts.is_some(), vec![Stage::Start]),
            ("--seconds", self.seconds.is_some(), timed.collect()),
        ];
        for (option, is_given, used_by) in given {
            if is_given && !used_by.iter().any(runs) {
                let names: Vec<&str> = used_by.iter().map(|stage| stage.name()).collect();
                let names = names.join(", ");
                let cell = if self.cell.is_some() { " on a running cell" } else { "" };
                return Err(Failure::input(format!(
                    "{option} has no effect: none of the parts that it is for ({names}) is measured{cell}; leave it out, or change --only"
                )));
            }
        }
        Ok(())
    }

    fn priority(&self) -> u8 {
        self.priority.unwrap_or(USUAL_PRIORITY)
    }

    fn loads(&self) -> Result<Vec<Vec<Load>>, Failure> {
        let usual = USUAL_LOADS.map(str::to_owned);
        parse_all(&given_or(&self.loads, &usual), "--load", load)
    }

    fn waits(&self) -> Result<Vec<Wait>, Failure> {
        if self.cell.is_some() {
            return Ok(vec![Wait::Own]);
        }
        if self.waits.is_empty() {
            return Ok(USUAL_WAITS.to_vec());
        }
        parse_all(&self.waits, "--wait", wait)
    }

    fn policies(&self) -> Vec<Policy> {
        match self.policy {
            Policies::Auto if fifo_is_granted(self.priority()) && self.cell_runs_fifo() => {
                vec![Policy::Fifo]
            }
            Policies::Fifo => vec![Policy::Fifo],
            Policies::Auto | Policies::Other => vec![Policy::Other],
            Policies::Both => vec![Policy::Fifo, Policy::Other],
        }
    }

    /// A running cell has its own scheduling policy.
    fn cell_runs_fifo(&self) -> bool {
        self.cell.as_deref().is_none_or(runs_fifo)
    }

    fn stages(&self) -> Result<Vec<Stage>, Failure> {
        if self.stages.is_empty() {
            return Ok(Stage::ALL.to_vec());
        }
        parse_all(&self.stages, "--only", |name| {
            Stage::from_name(name).ok_or("flat, woken, paced, force, start, swap, cost")
        })
    }
}

/// The short form: every part once, idle.
fn quick(plan: Plan) -> Plan {
    Plan {
        loads: vec![vec![]],
        waits: plan.waits.into_iter().take(1).collect(),
        rates_hz: vec![1000],
        seconds: QUICK_SECONDS,
        repeats: 5,
        policies: plan.policies.into_iter().take(1).collect(),
        ..plan
    }
}

fn given_or<T: Clone>(given: &[T], usual: &[T]) -> Vec<T> {
    if given.is_empty() { usual.to_vec() } else { given.to_vec() }
}

fn parse_all<T>(
    values: &[String],
    option: &str,
    read: impl Fn(&str) -> Result<T, &'static str>,
) -> Result<Vec<T>, Failure> {
    let one = |value: &String| {
        read(value).map_err(|known| {
            Failure::input(format!("{option}: unknown value `{value}`, expected one of: {known}"))
        })
    };
    values.iter().map(one).collect()
}

fn load(name: &str) -> Result<Vec<Load>, &'static str> {
    match name {
        "idle" => Ok(vec![]),
        "all" => Ok(Load::ALL.to_vec()),
        kinds => kinds
            .split('+')
            .map(|kind| Load::from_name(kind).ok_or("idle, all, memory, cache, disk, network"))
            .collect(),
    }
}

fn wait(name: &str) -> Result<Wait, &'static str> {
    let known = [Wait::Sleep, Wait::Spin];
    known.into_iter().find(|wait| wait.name() == name).ok_or("sleep, spin")
}

/// A time like `10`, `90s`, `10m`, `2h`, s.
fn seconds(text: &str) -> Result<f64, String> {
    let (number, factor) = match text.char_indices().next_back() {
        Some((index, 's')) => (&text[..index], 1.0),
        Some((index, 'm')) => (&text[..index], 60.0),
        Some((index, 'h')) => (&text[..index], 3600.0),
        _ => (text, 1.0),
    };
    let seconds = number.parse::<f64>().map_err(|_| "expected a time like 10, 90s, 10m or 2h")?;
    let seconds = seconds * factor;
    if SECONDS.contains(&seconds) {
        Ok(seconds)
    } else {
        Err(format!("expected {} s to {} s", SECONDS.start(), SECONDS.end()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_in_seconds_minutes_and_hours() {
        assert_eq!(["10", "90s", "10m", "2h"].map(seconds), [10.0, 90.0, 600.0, 7200.0].map(Ok));
        for nonsense in ["", "s", "-1", "nan", "1e9", "0", "3d", "ſ"] {
            assert!(seconds(nonsense).is_err(), "{nonsense}");
        }
    }

    #[test]
    fn loads_are_kinds_and_sums_of_kinds() {
        assert_eq!(load("idle"), Ok(vec![]));
        assert_eq!(load("all"), Ok(Load::ALL.to_vec()));
        assert_eq!(load("memory+disk"), Ok(vec![Load::Memory, Load::Disk]));
        assert!(load("memory+tea").is_err());
    }
}
