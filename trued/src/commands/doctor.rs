//! `trued doctor`: checks whether this machine is suitable for a robot's cycle, one line per check.

use clap::Args;
use harness::doctor::{Check, Diagnosis, State, TimerlatSettings, diagnose};

use crate::exit::{Answer, Failure, Outcome};
use crate::output::{Console, Paint};

/// Check this machine: kernel, governor, idle states, isolation, limits, memory, clock; each with the fix
///
/// With `--measure` also how late the kernel wakes a real-time thread, and what the worst delay was made of, by `rtla timerlat` (needs root).
#[derive(Debug, Args)]
pub(crate) struct Doctor {
    /// Measure wake-up latency for so long, s
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(1..=86_400))]
    measure: Option<u32>,
    /// The delay at which the measurement stops and is analysed, µs
    #[arg(long, value_name = "US", requires = "measure", default_value_t = TimerlatSettings::LIMIT_US,
        value_parser = clap::value_parser!(u32).range(5..=1000))]
    limit_us: u32,
}

impl Doctor {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let settings = |duration_s| TimerlatSettings { duration_s, limit_us: self.limit_us };
        let diagnosis = diagnose(self.measure.map(settings));
        diagnosis.checks.iter().try_for_each(|check| say(console, check))?;
        console.say(verdict(&diagnosis))?;
        console.json("trued.doctor/1", &diagnosis)?;
        Ok(if diagnosis.ok { Answer::Done } else { Answer::No })
    }
}

/// Summary of all checks.
fn verdict(diagnosis: &Diagnosis) -> String {
    let names = |state| -> Vec<&str> {
        let of_state = diagnosis.checks.iter().filter(|check| check.state == state);
        of_state.map(|check| check.name).collect()
    };
    let (fix, unknown) = (names(State::Fix), names(State::Unknown));
    let open = if unknown.is_empty() {
        String::new()
    } else {
        format!("; not known: {}", unknown.join(", "))
    };
    if fix.is_empty() {
        format!("\nnothing needs a fix{open}")
    } else {
        format!("\nfix before a robot runs on this machine: {}{open}", fix.join(", "))
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
