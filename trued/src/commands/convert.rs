//! `trued convert`: the daemon's black box becomes a recording that every other command reads.
//!
//! Promises: nothing of a cycle is lost; a box that was cut off is read as far as it goes, and that is said. Never: a file over the box.

use std::path::{Path, PathBuf};

use clap::Args;
use recording::blackbox::{self, Contents, Run};
use recording::series::Recording;
use serde::Serialize;
use tracing::warn;

use super::simulate::files;
use crate::atomic::Outputs;
use crate::exit::{Answer, Failure, Outcome};
use crate::input::count;
use crate::output::Console;

/// Make a recording of the daemon's black box
///
/// One row per cycle: commands, measured joints, wrench, temperatures, process state, and what became of each command (`c1_rad` …, `status`, `reason`).
/// Force samples go to NAME-forces.csv, the model that made the rows to NAME-model.toml, which NAME.toml names. Where another model was
/// loaded meanwhile its rows are a recording of their own, NAME-2 with NAME-2-model.toml, and so on.
#[derive(Debug, Args)]
pub(crate) struct Convert {
    /// Where the recording goes: NAME.csv and NAME.toml
    #[arg(long, value_name = "NAME")]
    out: PathBuf,
    /// The black box
    #[arg(value_name = "BOX.mcap")]
    input: PathBuf,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report {
    cell: String,
    version: String,
    rows: usize,
    force_samples: usize,
    /// Recordings that the rows are in: one for each model in turn.
    recordings: usize,
    /// Why the box ends early; none where it is whole.
    cut: Option<String>,
    /// Messages that this version does not know.
    unknown: usize,
    files: Vec<String>,
}

impl Convert {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let mut contents = blackbox::read(&self.input).map_err(Failure::input)?;
        let mut made = blackbox::convert(&contents);
        // Of a long run the records are most of what is held.
        contents.records = Vec::new();
        if made.runs.is_empty() && made.forces.is_none() {
            let what = format!("{}: holds no cycle and no force sample", self.input.display());
            return Err(Failure::input(format!("{what}; was the daemon sent any command?")));
        }
        let mut outputs = console.outputs();
        let mut written = Vec::new();
        for (place, run) in made.runs.iter_mut().enumerate() {
            let name = if place == 0 {
                self.out.clone()
            } else {
                beside(&self.out, &format!("-{}", place + 1))
            };
            written.extend(put_run(&mut outputs, &name, run));
        }
        let force_samples = made.forces.as_ref().map_or(0, Recording::len);
        if let Some(forces) = &made.forces {
            written.extend(put(&mut outputs, &beside(&self.out, "-forces"), forces));
        }
        outputs.check([&self.input])?;
        let files = written.iter().map(|path| path.display().to_string()).collect();
        let Contents { header, cut, unknown, .. } = contents;
        let (cell, version) = (header.cell, header.version);
        let rows = made.runs.iter().map(|run| run.cycles.len()).sum();
        let recordings = made.runs.len();
        let report = Report { cell, version, rows, force_samples, recordings, cut, unknown, files };
        console.write(outputs, "trued.convert/1", &report)?;
        say(console, &report)
    }
}

/// What one model made, and that model.
fn put_run(outputs: &mut Outputs, out: &Path, run: &mut Run) -> Vec<PathBuf> {
    let mut written = Vec::new();
    match run.header.as_ref().map(|header| header.model.as_str()) {
        Some("") => {}
        Some(text) => {
            let model = beside(out, "-model.toml");
            outputs.put(&model, text);
            let name = model.file_name().unwrap_or_default();
            run.cycles.about.model = Some(name.to_string_lossy().into_owned());
            written.push(model);
        }
        None => warn!("{}: the box does not hold the model of these rows", out.display()),
    }
    written.extend(put(outputs, out, &run.cycles));
    written
}

/// A recording as its two files.
fn put(outputs: &mut Outputs, out: &Path, recording: &Recording) -> [PathBuf; 2] {
    let (csv, toml) = files(out);
    outputs.put(&toml, recording.about_toml());
    outputs.put(&csv, recording.to_csv());
    [toml, csv]
}

/// `NAME` with more behind it, whatever ending was given.
fn beside(out: &Path, more: &str) -> PathBuf {
    let mut name = files(out).0.with_extension("").into_os_string();
    name.push(more);
    PathBuf::from(name)
}

fn say(console: &mut Console, report: &Report) -> Outcome {
    if let Some(why) = &report.cut {
        warn!("the black box ends early, and is read up to there: {why}");
    }
    if report.unknown > 0 {
        warn!("{} that this version does not know left out", count(report.unknown, "message"));
    }
    let (rows, forces) = (count(report.rows, "cycle"), count(report.force_samples, "force sample"));
    console.say(format!("cell {}, trued {}: {rows}, {forces}", report.cell, report.version))?;
    if report.recordings > 1 {
        let models = count(report.recordings, "time");
        console.say(format!("a model was in use {models}: each has a recording of its own"))?;
    }
    for file in &report.files {
        console.say(format!("written             {file}"))?;
    }
    Ok(Answer::Done)
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report>("convert", "trued.convert/1")
}
