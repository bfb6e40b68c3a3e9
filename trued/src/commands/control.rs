//! `trued bypass`, `trued mode`, `trued arm`, `trued mark`, `trued record`: requests of an operator to a running daemon.
//!
//! The daemon's answer is reported unchanged, with exit 1 if it refuses; the request's author is
//! stated in its log and recording. Every wait is limited.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, ValueEnum};
use recording::cell::CellConfig;
use serde::Serialize;
use shm_schema::Cell;
use trued_client::{Monitor, RecorderAction, Response};

use crate::exit::{Answer, Failure, Outcome};
use crate::input::unusable;
use crate::output::Console;

/// Time limit for finding the daemon, and for its answer.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);
const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);

/// Maximum length of a marker's text in bytes, limited by the request.
const MARK_BYTES_MAX: usize = shm_schema::PATH_BYTES_MAX;

/// Which cell is meant.
#[derive(Debug, Args)]
pub(super) struct CellSelection {
    /// The cell: its name or its configuration file; may be omitted if only one cell runs on this computer
    #[arg(value_name = "CELL")]
    cell: Option<String>,
}

/// No cell was named, and it is not clear which one is meant.
#[derive(Debug, thiserror::Error)]
enum CellSelectionError {
    #[error(
        "no running cell found; start `trued run --config CELL.toml`, or set TRUED_RUNTIME_DIR to the same value as for the daemon"
    )]
    None,
    #[error("several cells are running: {}; specify one of them", .0.join(", "))]
    Several(Vec<String>),
}

impl CellSelection {
    /// Its name.
    ///
    /// # Errors
    /// A configuration that cannot be read; none was named, and none or several are served.
    pub(super) fn name(&self) -> Result<String, Failure> {
        if let Some(cell) = &self.cell {
            let path = Path::new(cell);
            let is_file = path.is_file() || path.extension().is_some_and(|end| end == "toml");
            return if is_file {
                Ok(CellConfig::read(path).map_err(unusable)?.cell)
            } else {
                Ok(cell.clone())
            };
        }
        let served = Cell::served();
        let mut names: Vec<String> = served.iter().map(|cell| cell.name().to_owned()).collect();
        match (names.pop(), names.is_empty()) {
            (Some(name), true) => Ok(name),
            (Some(last), false) => {
                names.push(last);
                Err(Failure::input(CellSelectionError::Several(names)))
            }
            (None, _) => Err(Failure::system(CellSelectionError::None)),
        }
    }

    /// Its model file; none if the cell was given by its name.
    pub(super) fn model(&self) -> Option<PathBuf> {
        let path = self.cell.as_ref().map(Path::new).filter(|path| path.is_file())?;
        Some(CellConfig::read(path).ok()?.model)
    }

    /// Joins the daemon of that cell.
    ///
    /// # Errors
    /// See [`CellSelection::name`]; no daemon.
    pub(super) fn join(&self) -> Result<(String, Monitor), Failure> {
        let name = self.name()?;
        let monitor = Monitor::connect(&name, CONNECT_TIMEOUT).map_err(Failure::system)?;
        Ok((name, monitor))
    }
}

/// Disable the correction of a running cell, or enable it again
///
/// `on`: the correction ramps to zero and stays zero; commands pass unchanged. The bypass remains after this command, or the client that
/// requested it, has ended. `off`: the correction ramps in again, whoever requested the bypass. `trued status` shows when and by whom a cell was bypassed.
/// A restart of the daemon ends a bypass.
#[derive(Debug, Args)]
pub(crate) struct Bypass {
    /// Whether the correction is bypassed
    #[arg(value_name = "on|off", value_enum, hide_possible_values = true)]
    switch: Switch,
    #[command(flatten)]
    which: CellSelection,
}

/// Change the correction mode of a running cell without a restart
///
/// `shadow`: the correction is computed and recorded, commands pass unchanged. `limited`: corrections up to a tenth of the configured limits.
/// `full`: corrections up to the configured limits. The limiter of the correction ramps the change, so the robot does not step. Exit 1 if the cell's configuration
/// does not allow the mode (`mode_max`, by default `mode`). A restart of the daemon restores the configured mode.
#[derive(Debug, Args)]
pub(crate) struct ModeCommand {
    /// The correction mode
    #[arg(value_name = "shadow|limited|full", value_enum, hide_possible_values = true)]
    mode: Mode,
    #[command(flatten)]
    which: CellSelection,
}

/// Return a cell to its configured mode
///
/// Use it after `trued mode`, or after a client requested shadow mode. Force compensation that was switched off may become active again. Exit 1 if the
/// configured mode is `shadow`.
#[derive(Debug, Args)]
pub(crate) struct Arm {
    #[command(flatten)]
    which: CellSelection,
}

/// Write a marker into the recording of a running cell
///
/// Adds a line with level `mark`, the time, the text and the user to the recording's log (`/trued/log`). Exit 1 if nothing is being recorded.
#[derive(Debug, Args)]
pub(crate) struct Mark {
    /// Text of the marker, up to 256 bytes
    #[arg(value_name = "TEXT")]
    text: String,
    #[command(flatten)]
    which: CellSelection,
}

/// Start or stop the recording of a running cell, or protect it from removal
///
/// `start`: begins a file if none is being written. `stop`: the file is closed when this command returns; nothing is recorded until the next start.
/// `keep`: the current recording, the previous one if it ended less than 1 min ago, and the next one if it begins within 30 s are never
/// removed automatically; their names end in `.kept.mcap`. Exit 1 if the cell has no recorder, if there is no recording to keep, or if
/// `recorder.kept_files_max` recordings are kept already. A restart of the daemon restores the configured state.
#[derive(Debug, Args)]
pub(crate) struct Record {
    /// What to do
    #[arg(value_name = "start|stop|keep", value_enum, hide_possible_values = true)]
    action: RecordAction,
    #[command(flatten)]
    which: CellSelection,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum RecordAction {
    Start,
    Stop,
    Keep,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Switch {
    On,
    Off,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Mode {
    Shadow,
    Limited,
    Full,
}

impl Bypass {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let on = self.switch == Switch::On;
        let (cell, mut monitor) = self.which.join()?;
        let response = monitor.bypass(on, ANSWER_TIMEOUT).map_err(Failure::system)?;
        let outcome = report_answer(console, &cell, "bypass", &response)?;
        if on && outcome == Answer::Done {
            console.say("the correction stays disabled until `trued bypass off`")?;
        }
        Ok(outcome)
    }
}

impl ModeCommand {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let mode = match self.mode {
            Mode::Shadow => trued_client::Mode::Shadow,
            Mode::Limited => trued_client::Mode::Limited,
            Mode::Full => trued_client::Mode::Full,
        };
        let (cell, mut monitor) = self.which.join()?;
        let response = monitor.mode(mode, ANSWER_TIMEOUT).map_err(Failure::system)?;
        report_answer(console, &cell, "mode", &response)
    }
}

impl Arm {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let (cell, mut monitor) = self.which.join()?;
        let response = monitor.arm(true, ANSWER_TIMEOUT).map_err(Failure::system)?;
        report_answer(console, &cell, "arm", &response)
    }
}

impl Mark {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        if self.text.trim().is_empty() {
            return Err(Failure::input("TEXT is empty, expected what the marker says"));
        }
        if self.text.len() > MARK_BYTES_MAX {
            let length = self.text.len();
            let message = format!("TEXT: has {length} bytes, expected at most {MARK_BYTES_MAX}");
            return Err(Failure::input(message));
        }
        let (cell, mut monitor) = self.which.join()?;
        let response = monitor.mark(&self.text, ANSWER_TIMEOUT).map_err(Failure::system)?;
        report_answer(console, &cell, "mark", &response)
    }
}

impl Record {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let action = match self.action {
            RecordAction::Start => RecorderAction::Start,
            RecordAction::Stop => RecorderAction::Stop,
            RecordAction::Keep => RecorderAction::Keep,
        };
        let (cell, mut monitor) = self.which.join()?;
        let response = monitor.record(action, ANSWER_TIMEOUT).map_err(Failure::system)?;
        report_answer(console, &cell, "record", &response)
    }
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report<'a> {
    cell: &'a str,
    request: &'a str,
    answer: &'a str,
    message: &'a str,
}

/// Reports the daemon's answer.
fn report_answer(console: &mut Console, cell: &str, request: &str, response: &Response) -> Outcome {
    let answer = response.answer().map_err(Failure::system)?;
    let message = response.message.as_str();
    console.json("trued.request/1", &Report { cell, request, answer: answer.name(), message })?;
    match answer {
        trued_client::Answer::Done => {
            console.say(format!("{cell}: {message}"))?;
            Ok(Answer::Done)
        }
        trued_client::Answer::Refused => {
            console.say(format!("{cell}: rejected: {message}"))?;
            Ok(Answer::No)
        }
        answer => Err(Failure::system(format!("{cell}: {answer}: {message}"))),
    }
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report<'_>>("request", "trued.request/1")
}
