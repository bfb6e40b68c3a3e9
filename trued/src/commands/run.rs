//! `trued run`: the daemon for one cell or several.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use daemon::{DaemonError, Options};
use recording::cell::CellConfig;
use recording::files::{FileError, read_text};
use rustix::process::{Signal, set_parent_process_death_signal};

use crate::exit::{Answer, Failure, Outcome};
use crate::output::Console;
use crate::{interrupt, logs};

/// Run the daemon for one cell, or for several, until it is told to end
#[derive(Debug, Args)]
pub(crate) struct Run {
    /// The cell's configuration; given again, a further cell's: they start and end together
    #[arg(long, value_name = "CELL.toml", required = true, num_args = 1)]
    config: Vec<PathBuf>,
    /// Commands pace the cycle and carry the time, as in a replay: nothing is stale, poses may be settled
    #[arg(long)]
    lockstep: bool,
    /// End with the process that started this one, however it ends: in order, or at once, even where this one is stopped then
    #[arg(long, hide = true, value_name = "HOW", num_args = 0..=1, require_equals = true, default_missing_value = "term")]
    with_parent: Option<Ending>,
}

/// How a daemon ends with its parent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Ending {
    Term,
    Kill,
}

impl Run {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        if let Some(how) = self.with_parent {
            let signal = if how == Ending::Kill { Signal::KILL } else { Signal::TERM };
            // If this fails, the daemon survives a killed parent, which is acceptable.
            let _ = set_parent_process_death_signal(Some(signal));
        }
        let cells = self.config.iter().map(|path| self.options(path));
        let cells = cells.collect::<Result<Vec<_>, _>>()?;
        let mut names: Vec<&str> = cells.iter().map(|cell| cell.config.cell.as_str()).collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|two| two[0] == two[1]) {
            let name = twice[0];
            let why =
                format!("--config: two of the files are for cell `{name}`, expected one each");
            return Err(Failure::input(why));
        }
        logs::never_wait()?;
        let mut told = Ok(());
        let stop = interrupt::flag()?;
        daemon::run(cells, &stop, || told = console.say("ready")).map_err(failure)?;
        told?;
        Ok(Answer::Done)
    }

    fn options(&self, path: &Path) -> Result<Options, Failure> {
        Ok(Options {
            config: CellConfig::read(path).map_err(unusable)?,
            config_text: read_text(path).map_err(unusable)?,
            config_name: path.display().to_string(),
            lockstep: self.lockstep,
        })
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
