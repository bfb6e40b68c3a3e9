//! `trued convert`: the daemon's black box becomes a recording that every other command reads.
//!
//! Promises: nothing of a cycle is lost; a box that was cut off is read as far as it goes, and that is said. Never: a file over the box.

use std::path::{Path, PathBuf};

use clap::Args;
use recording::blackbox::{self, Contents};
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
/// Force samples go to NAME-forces.csv, the model that was loaded at the start to NAME-model.toml, which NAME.toml names.
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
struct Report {
    cell: String,
    version: String,
    rows: usize,
    force_samples: usize,
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
        if made.cycles.is_empty() && made.forces.is_none() {
            let what = format!("{}: holds no cycle and no force sample", self.input.display());
            return Err(Failure::input(format!("{what}; was the daemon sent any command?")));
        }
        let mut outputs = console.outputs();
        let mut written = Vec::new();
        if !contents.header.model.is_empty() {
            let model = beside(&self.out, "-model.toml");
            outputs.put(&model, contents.header.model.as_str());
            written.push(model.clone());
            let name = model.file_name().unwrap_or_default();
            made.cycles.about.model = Some(name.to_string_lossy().into_owned());
        }
        let force_samples = made.forces.as_ref().map_or(0, Recording::len);
        if let Some(forces) = &made.forces {
            written.extend(put(&mut outputs, &beside(&self.out, "-forces"), forces));
        }
        written.extend(put(&mut outputs, &self.out, &made.cycles));
        outputs.check([&self.input])?;
        let written = written.iter().map(|path| path.display().to_string()).collect();
        let Contents { header, cut, unknown, .. } = contents;
        let (cell, version) = (header.cell, header.version);
        let rows = made.cycles.len();
        let report = Report { cell, version, rows, force_samples, cut, unknown, files: written };
        console.write(outputs, "trued.convert/1", &report)?;
        say(console, &report)
    }
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
    for file in &report.files {
        console.say(format!("written             {file}"))?;
    }
    Ok(Answer::Done)
}
