//! `trued correct`: corrects a whole path without a daemon.
//!
//! The crate `correction-report` does the work, with the daemon's own code; `trued replay` on the same input gives the
//! same bits. If the input has an error, nothing is written.

use std::path::{Path, PathBuf};

use clap::Args;
use correction_report::path::{CorrectedPath, CorrectionRequest};
use recording::cell::CellConfig;

use crate::dynamic_options::{IN_TIME, InTime};
use crate::exit::{Answer, Failure, Outcome};
use crate::input::{Input, Reading, unusable};
use crate::options::tolerance_mm;
use crate::output::Console;
use crate::{progress, wrap};

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

impl Correct {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let out = self.out.clone().unwrap_or_else(|| default_output(&self.path));
        let mut outputs = console.outputs().file(&out);
        outputs.check([&self.path].into_iter().chain(self.reading.files()).chain(&self.config))?;
        let spinner = progress::stages(console, "reading the path");
        let cell = self.config.as_deref().map(cell).transpose()?;
        let fallback = cell.as_ref().map(|(_, cell)| cell.model.as_path());
        let Input { model, recording, .. } = self.reading.read(&self.path, fallback)?;
        let dynamic = self.dynamic.then(|| self.in_time.settings()).transpose()?;
        let request = CorrectionRequest { cell, dynamic };
        let corrected = CorrectedPath::compute(&model, recording, request, &|done| {
            progress::show_rows(&spinner, done);
        })?;
        let tolerance =
            self.tolerance_mm.map(|allowed_mm| corrected.compare_with_tolerance(allowed_mm));
        spinner.finish_and_clear();
        outputs.put(&out, corrected.csv.as_slice());
        console.write(outputs, "trued.correct/1", &corrected.report(&out, tolerance))?;
        for line in corrected.text(&out, tolerance, wrap::columns_of_stdout()) {
            console.say(line)?;
        }
        let is_done = match tolerance {
            Some(tolerance) => tolerance.met,
            None => corrected.is_exact() || self.accept_limited,
        };
        Ok(if is_done { Answer::Done } else { Answer::No })
    }
}

/// The cell in a file, with the file's name.
pub(super) fn cell(path: &Path) -> Result<(String, CellConfig), Failure> {
    Ok((path.display().to_string(), CellConfig::read(path).map_err(unusable)?))
}

fn default_output(path: &Path) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(".corrected.csv");
    PathBuf::from(name)
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<correction_report::path::Report<'_>>(
        "correct",
        "trued.correct/1",
    )
}
