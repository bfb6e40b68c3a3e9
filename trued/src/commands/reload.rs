//! `trued reload`: requests a running daemon to load a model and activate it between two cycles.
//!
//! The same function serves `trued reload`, `trued diagnose --apply` and the demo. Every wait is
//! limited.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use recording::cell::CellConfig;
use serde::Serialize;
use trued_client::Monitor;

use crate::exit::{Answer, Failure, Outcome};
use crate::input::unusable;
use crate::output::Console;

/// Time limit for finding the daemon, and for its answer.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);
const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);

/// Load a changed model into the running daemon without missing a cycle
///
/// Exit 1 if the daemon rejects the model; it then keeps its current one. It rejects a model of another robot, and one with joint limits that the
/// arm is outside of. `trued diagnose --apply` does the same with the
/// model that it has written.
#[derive(Debug, Args)]
pub(crate) struct Reload {
    /// The cell's configuration
    #[arg(long, value_name = "CELL.toml")]
    config: PathBuf,
    /// The model: a file or a preset; if not given, the current file is read again
    #[arg(value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Load the model even if it is of another robot or the arm is outside its limits; in shadow mode only
    #[arg(long)]
    other_robot: bool,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report<'a> {
    cell: &'a str,
    answer: &'a str,
    message: &'a str,
}

impl Reload {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let config = CellConfig::read(&self.config).map_err(unusable)?;
        let swap =
            ReloadResult::request_reload_of(&config.cell, self.model.as_deref(), self.other_robot)?;
        let (answer, message) = (swap.answer.name(), swap.message.as_str());
        console.json_of(
            [&self.config].into_iter().chain(&self.model),
            "trued.reload/1",
            &Report { cell: &config.cell, answer, message },
        )?;
        swap.report(console)
    }
}

/// The daemon's answer to a model.
pub(super) struct ReloadResult {
    pub(super) answer: trued_client::Answer,
    pub(super) message: String,
}

impl ReloadResult {
    /// Asks the daemon of `cell` to load `model` (none: the file that it has, again) and to swap it in.
    ///
    /// # Errors
    /// No daemon, or none that answers.
    pub(super) fn request_reload(cell: &str, model: Option<&Path>) -> Result<Self, Failure> {
        Self::request_reload_of(cell, model, false)
    }

    fn request_reload_of(
        cell: &str,
        model: Option<&Path>,
        other_robot: bool,
    ) -> Result<Self, Failure> {
        let model = model.map(absolute).transpose()?;
        let mut monitor = Monitor::connect(cell, CONNECT_TIMEOUT).map_err(Failure::system)?;
        let response = if other_robot {
            monitor.reload_other_robot(model.as_deref(), ANSWER_TIMEOUT)
        } else {
            monitor.reload(model.as_deref(), ANSWER_TIMEOUT)
        };
        let response = response.map_err(Failure::system)?;
        let answer = response.answer().map_err(Failure::system)?;
        Ok(Self { answer, message: response.message.to_string() })
    }

    /// Reports the result.
    ///
    /// # Errors
    /// The daemon failed to load it.
    pub(super) fn report(&self, console: &mut Console) -> Outcome {
        let message = &self.message;
        match self.answer {
            trued_client::Answer::Done => {
                console.say(message)?;
                Ok(Answer::Done)
            }
            trued_client::Answer::Refused => {
                console.say(format!("rejected: {message}"))?;
                console.say(
                    "the daemon keeps its current model; `trued check MODEL` reports every error of a file",
                )?;
                Ok(Answer::No)
            }
            answer => Err(Failure::system(format!("{answer}: {message}"))),
        }
    }
}

/// The daemon has another working directory: files are given by absolute path, presets by name.
fn absolute(model: &Path) -> Result<PathBuf, Failure> {
    if !model.exists() && recording::model::presets::by_path(model).is_some() {
        return Ok(model.to_owned());
    }
    std::path::absolute(model).map_err(Failure::input)
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report<'_>>("reload", "trued.reload/1")
}
