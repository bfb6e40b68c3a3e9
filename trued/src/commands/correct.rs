//! `trued correct`: corrects a whole path without a daemon.
//!
//! Rows are checked, solved and limited by the daemon's own code, in lockstep with the recording's
//! time; `trued replay` on the same input gives the same bits. If the input has an error, nothing
//! is written.

mod dynamic;

use std::path::{Path, PathBuf};

use clap::Args;
use daemon::sensor_inputs::SensorInputs;
use daemon::setup;
use feedforward::result::PreviewReport;
use recording::cell::{CellConfig, Mode, WrenchSource};
use recording::files::FileError;
use serde::Serialize;
use shm_schema::UnknownCode;

use crate::corrections::{Corrections, Figures, Tolerance};
use crate::exit::{Answer, Failure, Outcome};
use crate::in_time::{IN_TIME, InTime};
use crate::input::{Input, Reading, unusable};
use crate::lockstep::{self, Cycle};
use crate::options::tolerance_mm;
use crate::output::Console;
use crate::setpoints::{Setpoints, has_wrench};
use dynamic::Dynamic;

/// Correct a path file without a daemon: joint targets as CSV
///
/// Processes the commanded joints (and temperatures, wrench, directions) of a recording row by row with the corrector of
/// the daemon. With kind = "poses" in the accompanying TOML, each row gets its steady-state correction; on a path, the correction is limited in
/// rate and jerk. The output has the columns of the recording, the corrected joints `c1_deg` … (`c1_mm`), the status, the remaining tool error (`left_mm`, `left_mrad`)
/// and what limited the correction. Exit 1 if an error remains, unless --accept-limited is given; with --tolerance-mm, if it exceeds the tolerance.
///
/// With --dynamic, delay, lags and flexible modes of the joints are compensated too: commands are advanced in time and do not excite the modes. The path is resampled
/// to even time steps and gets rows at standstill at both ends.
#[derive(Debug, Args)]
#[command(mut_args(|arg| if IN_TIME.contains(&arg.get_id().as_str()) { arg.requires("dynamic") } else { arg }))]
pub(crate) struct Correct {
    #[command(flatten)]
    reading: Reading,
    /// Cell configuration for model, correction limits, task and wrench; its `mode` is ignored: the full correction is applied
    #[arg(long, value_name = "CELL.toml")]
    config: Option<PathBuf>,
    /// Output file for the corrected path; if not given, `NAME.corrected.csv` in the current folder
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
    /// Exit 0 even if rows are limited, held or rejected, so that a tool error remains
    #[arg(long)]
    accept_limited: bool,
    /// Allowed remaining tool error, mm, above 0: exit 1 if a row exceeds it or its error is unknown; limited rows within it are accepted
    #[arg(long, value_name = "MM", value_parser = tolerance_mm, allow_negative_numbers = true, conflicts_with = "accept_limited")]
    tolerance_mm: Option<f64>,
    /// Compensate delays, lags and flexible modes of the model too, with preview of the whole path
    #[arg(long)]
    dynamic: bool,
    #[command(flatten)]
    in_time: InTime,
    /// The path: a recording with commanded joint positions
    #[arg(value_name = "PATH.csv")]
    path: PathBuf,
}

/// What helps an arm that cannot serve all six freedoms.
const FEWER_JOINTS: &str = "an arm with fewer than six joints cannot correct the complete position and orientation; if the tool may rotate about its own axis, \
    set `task.free_tool_axis = true` in the cell's configuration";

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report<'a> {
    #[serde(flatten)]
    figures: &'a Figures,
    corrections: String,
    /// The error that is left compared with the tolerance; `None` without --tolerance-mm.
    tolerance: Option<Tolerance>,
    /// What was compensated in time; none without --dynamic.
    dynamic: Option<PreviewReport>,
}

impl Correct {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let out = self.out.clone().unwrap_or_else(|| beside(&self.path));
        let mut outputs = console.outputs().file(&out);
        outputs.check([&self.path].into_iter().chain(self.reading.files()).chain(&self.config))?;
        let cell = self.config.as_deref().map(CellConfig::read).transpose().map_err(unusable)?;
        let fallback = cell.as_ref().map(|cell| cell.model.as_path());
        let mut input = self.reading.read(&self.path, fallback)?;
        let dynamic = if self.dynamic {
            Some(Dynamic::extend(&mut input, self.in_time.settings()?)?)
        } else {
            None
        };
        let cycle = cycle(self.config.as_deref(), cell, &input)?;
        let free_tool_axis = cycle.frees_tool_axis();
        let mut corrections = correct(&input, cycle)?;
        let preview = dynamic.as_ref().map(|dynamic| dynamic.compensate(&input, &mut corrections));
        let preview = preview.transpose()?;
        let few_joints = input.model.physics.arm.count() < 6 && !free_tool_axis;
        let csv = corrections.csv(input.recording);
        let figures = corrections.figures(&csv);
        let corrections_file = out.display().to_string();
        outputs.put(&out, csv.as_slice());
        let deviation_mm = preview.as_ref().map_or(0.0, PreviewReport::path_deviation_mm);
        let tolerance =
            self.tolerance_mm.map(|allowed_mm| corrections.within(allowed_mm).and(deviation_mm));
        let report = Report {
            figures: &figures,
            corrections: corrections_file,
            tolerance,
            dynamic: preview,
        };
        console.write(outputs, "trued.correct/1", &report)?;
        console.say(match &dynamic {
            Some(dynamic) => figures.told(dynamic.rest_rows(), |row| dynamic.row_in_file(row)),
            None => figures.told(0, |row| row),
        })?;
        if let Some(dynamic) = &report.dynamic {
            console.say(dynamic.text())?;
        }
        console.say(format!("corrected path      {}", out.display()))?;
        if let Some(tolerance) = &report.tolerance {
            console.say(tolerance.told())?;
        }
        let left = corrections.not_exact_rows();
        if left > 0 {
            console.say(format!(
                "not fully corrected: {left} rows; see in the corrected path the columns `left_mm`, `left_mrad`, `limited_by`"
            ))?;
        }
        let limited = report.dynamic.as_ref().map_or(0, PreviewReport::limited_rows);
        if few_joints && left + limited > 0 {
            console.say(FEWER_JOINTS)?;
        }
        let is_done = match &report.tolerance {
            Some(tolerance) => tolerance.met && limited == 0,
            None => left + limited == 0 || self.accept_limited,
        };
        Ok(if is_done { Answer::Done } else { Answer::No })
    }
}

/// The daemon's cycle in the given cell, or in that of [`lockstep::cell_toml`].
pub(super) fn cycle<'m>(
    config: Option<&Path>,
    cell: Option<CellConfig>,
    input: &'m Input,
) -> Result<Cycle<'m>, Failure> {
    let (name, mut config) = match (config, cell) {
        (Some(path), Some(cell)) => (path.display().to_string(), cell),
        _ => {
            let text = lockstep::cell_toml(Path::new("model.toml"), &input.recording);
            let cell = CellConfig::parse(lockstep::CELL, &text).map_err(Failure::system)?;
            (lockstep::CELL.to_owned(), cell)
        }
    };
    config
        .check_against(&name, &input.joint_kinds)
        .map_err(|faults| unusable(FileError::Content(faults)))?;
    config.mode = Mode::Full;
    if has_wrench(&input.recording) && config.wrench.source == WrenchSource::Force {
        config.wrench.source = WrenchSource::Command;
    }
    let arm = &input.model.physics.arm;
    let settings = setup::settings(&config, arm, true).map_err(Failure::input)?;
    Ok(Cycle::new(&input.model, settings, SensorInputs::new(setup::wrench_source(&config))))
}

/// The answers to all rows of a recording.
pub(super) fn correct(input: &Input, mut cycle: Cycle<'_>) -> Result<Corrections, Failure> {
    let mut corrections = Corrections::of(&input.model);
    for row in Setpoints::of(&input.recording, input.model.physics.arm.count()) {
        let answer = cycle.answer(&row)?;
        let left = cycle.left_with(&answer);
        corrections.take(row.setpoint.joints(), &answer, left).map_err(unknown)?;
    }
    Ok(corrections)
}

/// The error for a code that this build does not know.
pub(crate) fn unknown(code: UnknownCode) -> Failure {
    Failure::system(code)
}

fn beside(path: &Path) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(".corrected.csv");
    PathBuf::from(name)
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report<'_>>("correct", "trued.correct/1")
}
