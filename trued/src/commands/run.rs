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

/// Run the daemon for one or several cells, until it is interrupted or terminated
#[derive(Debug, Args)]
pub(crate) struct Run {
    /// Configuration of the cell; repeat it for several cells, which start and stop together
    #[arg(long, value_name = "CELL.toml", required = true, num_args = 1)]
    config: Vec<PathBuf>,
    /// Take the time from the commands, as in a replay: inputs do not become stale, and poses may be corrected in steady state
    #[arg(long)]
    lockstep: bool,
    /// End when the parent process ends: term (clean shutdown) or kill (at once, even while stopped)
    #[arg(long, hide = true, value_name = "HOW", num_args = 0..=1, require_equals = true, default_missing_value = "term")]
    with_parent: Option<ParentOption>,
}

/// How a daemon ends with its parent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ParentOption {
    Term,
    Kill,
}

impl Run {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        if let Some(how) = self.with_parent {
            let signal = if how == ParentOption::Kill { Signal::KILL } else { Signal::TERM };
            // If this fails, the daemon survives a killed parent, which is acceptable.
            let _ = set_parent_process_death_signal(Some(signal));
        }
        let cells = self.config.iter().map(|path| self.options(path));
        let cells = cells.collect::<Result<Vec<_>, _>>()?;
        let mut names: Vec<&str> = cells.iter().map(|cell| cell.config.cell.as_str()).collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|two| two[0] == two[1]) {
            let name = twice[0];
            let why = format!(
                "--config: two files configure the cell `{name}`, expected one for each cell"
            );
            return Err(Failure::input(why));
        }
        logs::never_wait()?;
        let mut printed = Ok(());
        let stop = interrupt::flag_of_service()?;
        daemon::run(cells, &stop, || printed = console.say("ready")).map_err(failure)?;
        printed?;
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
