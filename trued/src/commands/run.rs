//! `trued run`: the daemon for one cell.

use std::path::PathBuf;

use clap::Args;
use daemon::{DaemonError, Options};
use recording::cell::CellConfig;
use recording::files::{FileError, read_text};
use rustix::process::{Signal, set_parent_process_death_signal};

use crate::exit::{Answer, Failure, Outcome};
use crate::interrupt;
use crate::output::Console;

/// Run the daemon for one cell until it is told to end
#[derive(Debug, Args)]
pub(crate) struct Run {
    /// The cell's configuration
    #[arg(long, value_name = "CELL.toml")]
    config: PathBuf,
    /// Commands pace the cycle and carry the time, as in a replay: nothing is stale, poses may be settled
    #[arg(long)]
    lockstep: bool,
    /// End with the process that started this one, however it ends
    #[arg(long, hide = true)]
    with_parent: bool,
}

impl Run {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        if self.with_parent {
            // A refusal leaves a daemon that a killed parent does not end: not worth a failure.
            let _ = set_parent_process_death_signal(Some(Signal::TERM));
        }
        let config = CellConfig::read(&self.config).map_err(unusable)?;
        let options = Options {
            config_text: read_text(&self.config).map_err(unusable)?,
            config_name: self.config.display().to_string(),
            lockstep: self.lockstep,
            stop: interrupt::flag()?,
            config,
        };
        let mut told = Ok(());
        daemon::run(options, || told = console.say("ready")).map_err(failure)?;
        told?;
        Ok(Answer::Done)
    }
}

fn failure(error: DaemonError) -> Failure {
    match error {
        DaemonError::File(fault) => unusable(fault),
        DaemonError::Envelope(_) | DaemonError::Vibration(_) => Failure::input(error),
        _ => Failure::system(error),
    }
}

/// A file that cannot be used is bad input, whatever the reason.
pub(crate) fn unusable(error: FileError) -> Failure {
    Failure::input(error)
}
