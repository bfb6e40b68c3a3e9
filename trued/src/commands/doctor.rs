//! `trued doctor`: checks whether this machine is suitable for a robot's cycle, one line per check.

use clap::Args;
use harness::doctor::{Check, State, diagnose};

use crate::exit::{Answer, Failure, Outcome};
use crate::output::{Console, Paint};

/// Check this machine: kernel, governor, idle states, isolation, limits, memory, clock; each with the fix
#[derive(Debug, Args)]
pub(crate) struct Doctor {}

impl Doctor {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let diagnosis = diagnose();
        diagnosis.checks.iter().try_for_each(|check| say(console, check))?;
        console.json("trued.doctor/1", &diagnosis)?;
        Ok(if diagnosis.ok { Answer::Done } else { Answer::No })
    }
}

fn say(console: &mut Console, check: &Check) -> Result<(), Failure> {
    let (paint, word) = match check.state {
        State::Pass => (Paint::Good, "pass"),
        State::Fix => (Paint::Bad, "fix"),
        State::Unknown => (Paint::Caution, "unknown"),
    };
    let word = console.paint(paint, &format!("{word:<7}"));
    let fix = if check.fix.is_empty() { String::new() } else { format!("; {}", check.fix) };
    console.say(format!("{word}  {:<20} {}{fix}", check.name, check.found))
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<harness::doctor::Diagnosis>("doctor", "trued.doctor/1")
}
