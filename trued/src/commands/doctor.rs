//! `trued doctor`: checks whether this machine is suitable for a robot's cycle, one line per check.

use clap::Args;
use harness::doctor::{Check, Diagnosis, State, TimerlatSettings, diagnose};

use crate::exit::{Answer, Failure, Outcome};
use crate::output::{Console, Emphasis};

/// Check this computer for real-time use: kernel, power management, isolation, limits, memory, clock
///
/// Prints one line per check, with the fix for each problem. With `--measure`, the wake-up latency of a real-time thread and the causes of the largest one are measured too, by `rtla timerlat` (requires root).
#[derive(Debug, Args)]
pub(crate) struct Doctor {
    /// Measure the wake-up latency for this time, s, 1 to 86400
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(1..=86_400))]
    measure: Option<u32>,
    /// Latency at which the measurement stops and is analysed, µs, 5 to 1000
    #[arg(long, value_name = "US", requires = "measure", default_value_t = TimerlatSettings::LIMIT_US,
        value_parser = clap::value_parser!(u32).range(5..=1000))]
    limit_us: u32,
}

impl Doctor {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let settings = |duration_s| TimerlatSettings { duration_s, limit_us: self.limit_us };
        let diagnosis = diagnose(self.measure.map(settings));
        diagnosis.checks.iter().try_for_each(|check| print_check(console, check))?;
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
        format!("; could not be checked: {}", unknown.join(", "))
    };
    if fix.is_empty() {
        format!("\nno problem found{open}")
    } else {
        format!("\nfix before running a robot with this computer: {}{open}", fix.join(", "))
    }
}

fn print_check(console: &mut Console, check: &Check) -> Result<(), Failure> {
    let (paint, label) = match check.state {
        State::Pass => (Emphasis::Good, "pass"),
        State::Fix => (Emphasis::Bad, "fix"),
        State::Unknown => (Emphasis::Caution, "unknown"),
    };
    let label = console.paint(paint, &format!("{label:<7}"));
    let fix = if check.fix.is_empty() { String::new() } else { format!("; {}", check.fix) };
    console.say(format!("{label}  {:<20} {}{fix}", check.name, check.found))
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<harness::doctor::Diagnosis>("doctor", "trued.doctor/1")
}
