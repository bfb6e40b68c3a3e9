//! `trued check`: reports every error of configurations, models, mappings, manifests, recordings, URDF and waveforms.
//!
//! Files without errors here are accepted by `trued run`, `correct` and `replay`.

use std::path::{Path, PathBuf};

use clap::Args;
use recording::check::{self, Column, FileReport, Findings, Report};
use recording::faults::Faults;
use recording::files::FileError;
use recording::manifest;
use recording::model::RobotModel;
use report::{TextTable, pluralise};

use crate::exit::{Answer, Failure, Outcome};
use crate::input::{Reading, model, option};
use crate::output::{Console, Emphasis};
use crate::table::on_stdout;

/// Validate files and report every error: cells, models, recordings, mappings
///
/// What a TOML is, its `schema` says; tables are recordings; a URDF is checked as by `trued model import`, waveforms (WAV, UFF 58, .lvm) as by `trued spectrum`. A cell is checked with its model, a mapping `NAME.mapping.toml` with the recording
/// NAME beside it, a manifest with the models, mappings and recordings that it names. The first rows of a recording are shown as they are understood. Exit 1 where there are faults, 2 where a file cannot be read.
#[derive(Debug, Args)]
pub(crate) struct Check {
    #[command(flatten)]
    reading: Reading,
    /// cell.toml, model.toml, a recording, …
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
}

impl Check {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let known = self.reading.model.as_deref().map(model).transpose()?;
        let mut files = Vec::new();
        let mut unread = None;
        for path in &self.files {
            match self.check(path, known.as_ref()) {
                Ok(mut findings) => {
                    let faults = findings.faults.drain(..);
                    findings.faults = faults.map(|faults| faults.name_settings(option)).collect();
                    print_findings(console, path, &findings)?;
                    files.push(FileReport::of(path, findings));
                }
                // The other files are still checked; a read error is reported last.
                Err(error) => unread = unread.or(Some(error)),
            }
        }
        if let Some(error) = unread {
            return Err(Failure::input(error));
        }
        self.check_reading(&files)?;
        let report = Report::of(files);
        console.json_of(&self.files, "trued.check/1", &report)?;
        Ok(if report.ok { Answer::Done } else { Answer::No })
    }

    /// A model and a mapping say how recordings are read; with other files they would do nothing.
    fn check_reading(&self, files: &[FileReport]) -> Result<(), Failure> {
        let any = |kinds: &[&str]| files.iter().any(|file| kinds.contains(&file.kind()));
        let idle = if self.reading.mapping.is_some() && !any(&["recording"]) {
            "--mapping"
        } else if self.reading.model.is_some() && !any(&["recording", "mapping"]) {
            "--model"
        } else {
            return Ok(());
        };
        Err(Failure::input(format!("{idle} is for recordings, and no file is one: leave it out")))
    }

    /// Cells are checked as by the daemon, manifests as before a batch.
    fn check(&self, path: &Path, known: Option<&RobotModel>) -> Result<Findings, FileError> {
        match check::schema_of(path)?.as_deref() {
            Some("trued.cell/1") => daemon::setup::check::cell(path),
            Some(manifest::SCHEMA) => batch::check::manifest(path),
            _ => check::validate_file(path, self.reading.mapping.as_deref(), known),
        }
    }
}

fn print_findings(console: &mut Console, path: &Path, findings: &Findings) -> Result<(), Failure> {
    // Colour is in use if painting an empty text adds something.
    let coloured = !console.paint(Emphasis::Bad, "").is_empty();
    for faults in &findings.faults {
        console.say(if coloured { faults.styled() } else { faults.plain() })?;
        console.say("")?;
    }
    let (name, Findings { kind, summary, .. }) = (path.display(), findings);
    if findings.faults.is_empty() {
        let ok = console.paint(Emphasis::Good, "ok:");
        let gap = if summary.is_empty() { "" } else { ", " };
        console.say(format!("{ok} {name}: {kind}{gap}{summary}"))?;
    } else {
        let number = findings.faults.iter().map(Faults::len).sum();
        console.say(format!("{name}: {kind}, {}", pluralise(number, "fault")))?;
    }
    for note in &findings.notes {
        console.say(format!("  note: {note}"))?;
    }
    if !findings.columns.is_empty() {
        for line in table(&findings.columns).lines() {
            console.say(format!("  {line}"))?;
        }
    }
    Ok(())
}

/// A table of the columns, one line each.
fn table(columns: &[Column]) -> String {
    let rows = columns.iter().map(|column| column.first.len()).max().unwrap_or(0);
    let heads = ["column", "from"].map(str::to_owned).into_iter();
    let mut table = TextTable::new(heads.chain((1..=rows).map(|row| format!("row {row}"))));
    for column in columns {
        let from = column.from.clone().unwrap_or_default();
        let shown = |value: &Option<f64>| value.map_or(String::new(), |value| value.to_string());
        let values = column.first.iter().map(shown);
        table = table.row([column.name.clone(), from].into_iter().chain(values));
    }
    on_stdout(&table)
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report>("check", "trued.check/1")
}
