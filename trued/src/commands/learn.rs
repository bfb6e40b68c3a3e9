//! `trued learn`: commands of the next run from measurements of the last one.
//!
//! The path is corrected as by `trued correct --dynamic`, and the learned correction is added
//! within the same limits; the resulting table is the input of the next `trued learn`. If an input
//! has an error, nothing is written.

use std::path::{Path, PathBuf};

use clap::Args;
use correction_report::dynamic::{joint_plants, static_commands};
use correction_report::path::static_corrections;
use feedforward::learning::{CommandedPath, Commands, Learned, Learning};
use feedforward::measured::Clock;
use recording::series::{self, Epoch, RequiredData};
use tracing::warn;

use super::correct::cell;
use crate::dynamic_options::InTime;
use crate::exit::{Answer, Failure, Outcome};
use crate::input::{Reading, in_file, unusable};
use crate::output::Console;
use crate::progress;

/// Improve the commands of a repeated path from measured runs (iterative learning control)
///
/// PATH is the output of `trued correct --dynamic` or of the previous `trued learn`, with desired (q) and commanded (c) positions; a path without corrected joints was
/// commanded as it is. MEASURED are measurements of its runs: link-side or motor-side joint positions, or points of the tool. Several files are several runs of the
/// same commands and separate repeatable from random errors. Run the output table, measure it, and learn again: two to four times.
#[derive(Debug, Args)]
pub(crate) struct Learn {
    #[command(flatten)]
    reading: Reading,
    /// Cell configuration with which PATH was corrected, if one was given to `trued correct`
    #[arg(long, value_name = "CELL.toml")]
    config: Option<PathBuf>,
    /// Output file for the next commands; if not given, `NAME.next.csv` in the current folder
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
    /// Time to add to the timestamps of MEASURED, ms, or `unknown`: estimated from the motion
    #[arg(long, value_name = "MS|unknown", default_value = "0", value_parser = clock, allow_hyphen_values = true)]
    clock_offset_ms: Clock,
    #[command(flatten)]
    in_time: InTime,
    /// Desired and commanded joint positions
    #[arg(value_name = "PATH.csv")]
    path: PathBuf,
    /// Measurements, one file for each run
    #[arg(value_name = "MEASURED", required = true)]
    measured: Vec<PathBuf>,
}

impl Learn {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let out = self.out.clone().unwrap_or_else(|| next_to(&self.path));
        let mut outputs = console.outputs().file(&out);
        let inputs = [&self.path].into_iter().chain(&self.measured);
        outputs.check(inputs.chain(self.reading.files()).chain(&self.config))?;
        self.check_distinct()?;
        let settings = self.in_time.settings()?;
        let spinner = progress::stages(console, "reading the path");
        // The path is trued's own table; the mapping belongs to the measurements.
        let ours = Reading { mapping: None, ..self.reading.clone() };
        let cell = self.config.as_deref().map(cell).transpose()?;
        let fallback = cell.as_ref().map(|(_, cell)| cell.model.as_path());
        let mut input = ours.read(&self.path, fallback)?;
        let epoch = input.recording.epoch();
        let plants = joint_plants(&input.model, &settings)?;
        let path = CommandedPath::of(&input.recording, &input.joint_kinds, &plants, &settings);
        let CommandedPath { recording, commanded, history, source } =
            path.map_err(in_file(&self.path))?;
        input.recording = recording;
        let (mut corrections, _) =
            static_corrections(&input.model, &input.recording, cell, &|done| {
                progress::show_rows(&spinner, done);
            })?;
        let wanted = static_commands(&corrections, &input.recording, &source)?;
        let commanded = commanded.unwrap_or_else(|| wanted.clone());
        let commands = Commands { commanded, wanted, history };
        let learning = Learning::of(&input.model, &plants, &input.recording, commands, &settings);
        let mut learning = learning.map_err(Failure::input)?;
        spinner.set_message("learning from the measured runs");
        for path in &self.measured {
            self.add(&mut learning, path, epoch)?;
        }
        let learned = learning.next(out.display().to_string(), &source);
        let Learned { next, rows, history, report } = learned.map_err(in_file(&self.path))?;
        corrections.compensate(next.commanded, &rows);
        history.put(&mut input.recording, &input.joint_kinds);
        outputs.put(&out, corrections.csv(input.recording).as_slice());
        spinner.finish_and_clear();
        console.write(outputs, "trued.learn/1", &report)?;
        console.say(report.text())?;
        console.say(format!("next commands       {}", out.display()))?;
        report.warnings().iter().for_each(|warning| warn!("{warning}"));
        Ok(if report.is_limited() || report.is_back() { Answer::No } else { Answer::Done })
    }

    /// Checks that no file is given twice: the path is no measurement of itself, and a run counts once.
    fn check_distinct(&self) -> Result<(), Failure> {
        let place = |path: &PathBuf| path.canonicalize().unwrap_or_else(|_| path.clone());
        let files: Vec<&PathBuf> = [&self.path].into_iter().chain(&self.measured).collect();
        for (index, file) in files.iter().enumerate() {
            let shown = file.display();
            match files.iter().position(|other| place(other) == place(file)) {
                Some(first) if first < index && first == 0 => {
                    return Err(Failure::input(format!(
                        "{shown} is given as path and as measurement of it, expected two files: the commanded path, and the recording of a run"
                    )));
                }
                Some(first) if first < index => {
                    return Err(Failure::input(format!(
                        "{shown} is given twice, expected a file for each run: one run counted twice would look free of random errors"
                    )));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Adds a measured run.
    fn add(
        &self,
        learning: &mut Learning<'_>,
        path: &Path,
        epoch: Option<Epoch>,
    ) -> Result<(), Failure> {
        let mapping = self.reading.mapping.as_deref();
        let mut recording = series::read(path, mapping, RequiredData::Samples).map_err(unusable)?;
        recording.notes.iter().for_each(|note| warn!("{}: {note}", path.display()));
        // The clocks of path and measurement are compared.
        recording.count_from(epoch);
        let added = learning.add(&recording, self.clock_offset_ms);
        added.map_err(in_file(path))
    }
}

fn clock(text: &str) -> Result<Clock, String> {
    if text == "unknown" {
        return Ok(Clock::Unknown);
    }
    let offset = text.parse().ok().filter(|ms: &f64| ms.is_finite());
    let expected = "expected a number of milliseconds, or `unknown`";
    offset.map(|ms| Clock::Offset(ms * 1e-3)).ok_or_else(|| expected.to_owned())
}

fn next_to(path: &Path) -> PathBuf {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let stem = name.trim_end_matches(".corrected").trim_end_matches(".next");
    PathBuf::from(format!("{stem}.next.csv"))
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<feedforward::result::LearnReport>("learn", "trued.learn/1")
}
