//! `trued status`: state of a running cell.
//!
//! Lines have at most 80 columns; a daemon that does not answer is reported as such, never by its
//! last state alone.

mod text;

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use clap::Args;
use live::report::Report;
use trued_client::Monitor;

use super::control::CellSelection;
use crate::exit::{Answer, Failure, Outcome};
use crate::interrupt;
use crate::output::Console;

/// Refresh interval of `--watch`: faster than a person acts, slower than a slow connection.
const REFRESH_EVERY: Duration = Duration::from_secs(1);
/// A connected daemon sends its status every 40 ms; after this time without one it counts as
/// blocked.
const FIRST_STATUS_TIMEOUT: Duration = Duration::from_secs(2);
/// Interval of attempts to find it.
const POLL_EVERY: Duration = Duration::from_millis(2);
/// Maximum sleep between checks for an interruption.
const SLEEP: Duration = Duration::from_millis(50);
/// Clears a terminal and begins at its top.
const CLEAR: &str = "\u{1b}[H\u{1b}[2J";

/// Show the state of a running cell
///
/// Shows health with its reason, mode, bypass, robot and model, commands, latency, forces, vibration and recorder. With `--json -`, the same as one
/// JSON object. Exit 3 if no daemon runs the cell. `trued bypass off` enables the correction again after a client has bypassed it.
#[derive(Debug, Args)]
pub(crate) struct StatusCommand {
    /// Refresh every second, until interrupted
    #[arg(long)]
    watch: bool,
    #[command(flatten)]
    which: CellSelection,
}

impl StatusCommand {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let (cell, mut monitor) = self.which.join()?;
        if !self.watch {
            return show(console, &cell, &mut monitor);
        }
        let stop = interrupt::flag()?;
        let clears = std::io::stdout().is_terminal();
        while interrupt::check(&stop).is_ok() {
            let begun = Instant::now();
            console.say(if clears { CLEAR } else { "" })?;
            show(console, &cell, &mut monitor)?;
            while begun.elapsed() < REFRESH_EVERY && interrupt::check(&stop).is_ok() {
                std::thread::sleep(SLEEP);
            }
        }
        Ok(Answer::Done)
    }
}

fn show(console: &mut Console, cell: &str, monitor: &mut Monitor) -> Outcome {
    let begun = Instant::now();
    let status = loop {
        if let Some(status) = monitor.status() {
            break status;
        }
        if begun.elapsed() > FIRST_STATUS_TIMEOUT {
            let message = format!(
                "cell `{cell}`: connected to the daemon, but received no status within {FIRST_STATUS_TIMEOUT:?}"
            );
            return Err(Failure::system(format!(
                "{message}; check whether it is stopped or overloaded"
            )));
        }
        std::thread::sleep(POLL_EVERY);
    };
    let away = monitor.disconnect_reason();
    let report = Report::new(cell, &status, away.map(|away| away.to_string()));
    console.json("trued.status/1", &report)?;
    console.say(text::lines(&report).join("\n"))?;
    Ok(Answer::Done)
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<::live::report::Report>("status", "trued.status/1")
}
