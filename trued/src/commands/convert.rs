//! `trued convert`: converts a recording of the daemon (MCAP), or a table, to a table (CSV or Parquet).
//!
//! Promises: nothing of a row is lost; an MCAP file that was cut off is read as far as it goes, and that is said. Never: a file over the input.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap::Args;
use recording::blackbox::{self, Contents, Run};
use recording::series::{self, Need, Recording};
use serde::Serialize;
use tracing::warn;

use crate::atomic::Outputs;
use crate::exit::{Answer, Failure, Outcome};
use crate::input::count;
use crate::output::Console;

/// Convert a recording: the daemon's MCAP file or a table (CSV, Parquet) into a table (CSV, Parquet)
///
/// Of an MCAP file, one row per cycle: commands, measured joints, wrench, temperatures, process state, and what became of each command (`c1_rad` …,
/// `status`, `reason`). Force samples go to NAME-forces, the model that made the rows to NAME-model.toml, which NAME.toml names. Where another model was
/// loaded meanwhile its rows are a recording of their own, NAME-2 with NAME-2-model.toml, and so on. Of another program's table, by its mapping, the columns
/// get the names of `trued.recording/1`.
#[derive(Debug, Args)]
pub(crate) struct Convert {
    /// Where the recording goes: NAME.csv and NAME.toml; NAME.parquet and NAME.toml where NAME ends so
    #[arg(long, value_name = "NAME")]
    out: PathBuf,
    /// How another program's table becomes a recording; if not given, `NAME.mapping.toml` beside it
    #[arg(long, value_name = "FILE")]
    mapping: Option<PathBuf>,
    /// A recording: MCAP, CSV or Parquet
    #[arg(value_name = "RECORDING")]
    input: PathBuf,
}

#[derive(Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report {
    /// The daemon's cell; none where the input is a table.
    cell: Option<String>,
    /// The daemon's version; none where the input is a table.
    version: Option<String>,
    rows: usize,
    force_samples: usize,
    /// Recordings that the rows are in: one for each model in turn.
    recordings: usize,
    /// Why the MCAP file ends early; none where it is whole.
    cut: Option<String>,
    /// Messages that this version does not know.
    unknown: usize,
    files: Vec<String>,
}

/// The format of a table.
#[derive(Clone, Copy)]
enum Format {
    Csv,
    Parquet,
}

/// Tables that are to be written.
struct Target {
    /// Path without an ending.
    stem: PathBuf,
    format: Format,
}

impl Convert {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let target = Target::of(&self.out);
        let mut outputs = console.outputs();
        let mut written = Vec::new();
        let report = if has_ending(&self.input, "mcap") {
            if self.mapping.is_some() {
                return Err(Failure::input("an MCAP file of the daemon needs no --mapping"));
            }
            self.of_daemon(&target, &mut outputs, &mut written)?
        } else {
            self.of_table(&target, &mut outputs, &mut written)?
        };
        outputs.check([&self.input].into_iter().chain(&self.mapping))?;
        let files = written.iter().map(|path| path.display().to_string()).collect();
        let report = Report { files, ..report };
        console.write(outputs, "trued.convert/1", &report)?;
        say(console, &report)
    }

    fn of_daemon(
        &self,
        target: &Target,
        outputs: &mut Outputs,
        written: &mut Vec<PathBuf>,
    ) -> Result<Report, Failure> {
        let mut contents = blackbox::read(&self.input).map_err(Failure::input)?;
        let mut made = blackbox::convert(&contents);
        // Of a long run the records are most of what is held.
        contents.records = Vec::new();
        if made.runs.is_empty() && made.forces.is_none() {
            let what = format!("{}: holds no cycle and no force sample", self.input.display());
            return Err(Failure::input(format!("{what}; was the daemon sent any command?")));
        }
        for (place, run) in made.runs.iter_mut().enumerate() {
            let more = if place == 0 { String::new() } else { format!("-{}", place + 1) };
            target.put_run(outputs, &more, run, written)?;
        }
        if let Some(forces) = &made.forces {
            target.put(outputs, "-forces", forces, written)?;
        }
        let Contents { header, cut, unknown, .. } = contents;
        Ok(Report {
            cell: Some(header.cell),
            version: Some(header.version),
            rows: made.runs.iter().map(|run| run.cycles.len()).sum(),
            force_samples: made.forces.as_ref().map_or(0, Recording::len),
            recordings: made.runs.len(),
            cut,
            unknown,
            files: Vec::new(),
        })
    }

    fn of_table(
        &self,
        target: &Target,
        outputs: &mut Outputs,
        written: &mut Vec<PathBuf>,
    ) -> Result<Report, Failure> {
        let read = series::read(&self.input, self.mapping.as_deref(), Need::Samples);
        let mut recording = read.map_err(Failure::input)?;
        for note in &recording.notes {
            warn!("{}: {note}", self.input.display());
        }
        recording.about.model =
            recording.about.model.take().map(|name| seen_from(target, &self.input, name));
        target.put(outputs, "", &recording, written)?;
        Ok(Report { rows: recording.len(), recordings: 1, ..Report::default() })
    }
}

/// The model's file that a recording names, as a recording in the target's folder has to name it; a preset keeps its name.
fn seen_from(target: &Target, input: &Path, name: String) -> String {
    let folder = |path: &Path| {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        folder.unwrap_or(Path::new(".")).canonicalize().ok()
    };
    let (from, to) = (folder(input), folder(&target.stem));
    match from.filter(|from| Some(from) != to.as_ref()).map(|from| from.join(&name)) {
        Some(model) if model.is_file() => model.display().to_string(),
        _ => name,
    }
}

fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending))
}

impl Target {
    fn of(out: &Path) -> Self {
        let format = if has_ending(out, "parquet") { Format::Parquet } else { Format::Csv };
        let is_known = ["csv", "toml", "parquet"].iter().any(|ending| has_ending(out, ending));
        let stem = if is_known { out.with_extension("") } else { out.to_owned() };
        Self { stem, format }
    }

    /// The path with more behind it.
    fn with(&self, more: impl AsRef<OsStr>) -> PathBuf {
        let mut name = self.stem.clone().into_os_string();
        name.push(more);
        PathBuf::from(name)
    }

    /// Puts what one model made, and that model.
    fn put_run(
        &self,
        outputs: &mut Outputs,
        more: &str,
        run: &mut Run,
        written: &mut Vec<PathBuf>,
    ) -> Result<(), Failure> {
        match run.header.as_ref().map(|header| header.model.as_str()) {
            Some("") => {}
            Some(text) => {
                let model = self.with(format!("{more}-model.toml"));
                outputs.put(&model, text);
                let name = model.file_name().unwrap_or_default();
                run.cycles.about.model = Some(name.to_string_lossy().into_owned());
                written.push(model);
            }
            None => {
                let name = self.with(more);
                warn!("{}: the MCAP file does not hold the model of these rows", name.display());
            }
        }
        self.put(outputs, more, &run.cycles, written)
    }

    /// Puts a recording as its two files.
    fn put(
        &self,
        outputs: &mut Outputs,
        more: &str,
        recording: &Recording,
        written: &mut Vec<PathBuf>,
    ) -> Result<(), Failure> {
        let (ending, table) = match self.format {
            Format::Csv => ("csv", recording.to_csv()),
            Format::Parquet => ("parquet", recording.to_parquet().map_err(Failure::input)?),
        };
        let (toml, path) =
            (self.with(format!("{more}.toml")), self.with(format!("{more}.{ending}")));
        outputs.put(&toml, recording.about_toml());
        outputs.put(&path, table);
        written.extend([toml, path]);
        Ok(())
    }
}

fn say(console: &mut Console, report: &Report) -> Outcome {
    if let Some(why) = &report.cut {
        warn!("the MCAP file ends early, and is read up to there: {why}");
    }
    if report.unknown > 0 {
        warn!("{} that this version does not know left out", count(report.unknown, "message"));
    }
    match report.cell.as_ref().zip(report.version.as_ref()) {
        Some((cell, version)) => {
            let rows = count(report.rows, "cycle");
            let forces = count(report.force_samples, "force sample");
            console.say(format!("cell {cell}, trued {version}: {rows}, {forces}"))?;
        }
        None => console.say(count(report.rows, "row"))?,
    }
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
