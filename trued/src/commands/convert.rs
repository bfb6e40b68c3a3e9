//! `trued convert`: converts a recording of the daemon (MCAP), or a table, to a table (CSV or Parquet) or to ROS 2 messages (MCAP).
//!
//! No data of a row is lost; a truncated MCAP file is read as far as possible, damaged chunks are
//! skipped, and this is reported. The input is never overwritten.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap::Args;
use recording::mcap_recording::{self, Contents, Damage, OTHER_CLOCK_S, Record, Run, Topic};
use recording::ros2;
use recording::series::{self, Recording, RequiredData};
use report::pluralise;
use serde::Serialize;
use tracing::warn;

use super::info::DamagedPart;
use crate::exit::{Answer, Failure, Outcome};
use crate::output::Console;
use crate::pages::Outputs;
use crate::progress;

/// Convert a recording (MCAP, CSV, Parquet) to a table (CSV, Parquet) or to ROS 2 messages (MCAP)
///
/// The table of an MCAP file has one row per cycle: commands, measured joints, wrench, temperatures, process state, and the outcome of each command (`c1_rad` …,
/// `status`, `reason`). Force samples are written to NAME-forces, the model of the rows to NAME-model.toml, to which NAME.toml refers. If another model was
/// loaded during the recording, its rows become a separate recording, NAME-2 with NAME-2-model.toml, and so on. The columns of another program's table are renamed
/// by its mapping to those of `trued.recording/1`. With `--out NAME.mcap`, standard ROS 2 messages are written instead: `sensor_msgs/JointState`,
/// `geometry_msgs/WrenchStamped`, `diagnostic_msgs/DiagnosticArray` and others, for `ros2 bag`, Foxglove and plotting tools. The times of all tables of one recording
/// count from its first cycle. Damaged chunks are skipped and named; the exit code is 1 then.
#[derive(Debug, Args)]
pub(crate) struct Convert {
    /// Output files: NAME.csv and NAME.toml. If NAME ends in `.parquet`: NAME.parquet and NAME.toml; if it ends in `.mcap`: ROS 2 messages
    #[arg(long, value_name = "NAME")]
    out: PathBuf,
    /// Mapping from another program's table to a recording; if not given, `NAME.mapping.toml` in the same folder
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
    /// The version of the daemon that recorded; none where the input is a table.
    recorded_by: Option<String>,
    rows: usize,
    force_samples: usize,
    /// Recordings that the rows are in: one for each model in turn.
    recordings: usize,
    /// Why the MCAP file is truncated; `None` if it is complete.
    cut: Option<String>,
    /// Parts of the MCAP file that cannot be read; what follows them was read.
    damaged: Vec<DamagedPart>,
    /// Number of messages unknown to this version.
    unknown: usize,
    /// ROS 2 messages that were written, by topic; none where the output is a table.
    topics: BTreeMap<String, usize>,
    /// Columns of a table that no standard ROS 2 message carries; topics of an MCAP file that a table does not hold.
    left_out: Vec<String>,
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
        let target = Target::of(&self.out)?;
        let mut outputs = console.outputs();
        let mut written = Vec::new();
        let is_of_daemon = has_ending(&self.input, "mcap");
        if is_of_daemon && self.mapping.is_some() {
            return Err(Failure::input("an MCAP file of the daemon needs no --mapping"));
        }
        let spinner = progress::stages(console, "converting");
        let report = if has_ending(&self.out, "mcap") {
            self.to_ros2(is_of_daemon, &mut outputs, &mut written)?
        } else if is_of_daemon {
            self.convert_daemon_recording(&target, &mut outputs, &mut written)?
        } else {
            self.convert_table(&target, &mut outputs, &mut written)?
        };
        outputs.check([&self.input].into_iter().chain(&self.mapping))?;
        let files = written.iter().map(|path| path.display().to_string()).collect();
        let report = Report { files, ..report };
        spinner.finish_and_clear();
        console.write(outputs, "trued.convert/1", &report)?;
        print_report(console, &report)
    }

    fn convert_daemon_recording(
        &self,
        target: &Target,
        outputs: &mut Outputs,
        written: &mut Vec<PathBuf>,
    ) -> Result<Report, Failure> {
        let mut contents = mcap_recording::read(&self.input).map_err(Failure::input)?;
        let mut made = mcap_recording::convert(&contents);
        let left_out = topics_without_table(&contents.records);
        // In a long run the records are most of the memory.
        contents.records = Vec::new();
        if made.runs.is_empty() && made.forces.is_none() {
            let damage = contents.damage.first().map(ToString::to_string);
            let cut = damage.or(contents.cut);
            return Err(Failure::input(empty_file_message(&self.input, cut.as_deref())));
        }
        if made.not_finite > 0 {
            let values = pluralise(made.not_finite, "value");
            warn!(
                "{values} of forces, joints or temperatures are not finite and are written as missing"
            );
        }
        if made.forces_by_own_clock {
            warn!(
                "cycles and forces are more than {OTHER_CLOCK_S:.0} s apart, by different clocks: the times of the forces count from the first sample"
            );
        }
        for (place, run) in made.runs.iter_mut().enumerate() {
            let more = if place == 0 { String::new() } else { format!("-{}", place + 1) };
            target.add_run(outputs, &more, run, written)?;
        }
        if let Some(forces) = &made.forces {
            target.add_recording(outputs, "-forces", forces, written)?;
        }
        let Contents { header, cut, unknown, damage, .. } = contents;
        Ok(Report {
            damaged: self.damaged(&damage),
            left_out,
            cell: Some(header.cell),
            recorded_by: Some(header.version),
            rows: made.runs.iter().map(|run| run.cycles.len()).sum(),
            force_samples: made.forces.as_ref().map_or(0, Recording::len),
            recordings: made.runs.len(),
            cut,
            unknown,
            ..Report::default()
        })
    }

    /// Warns of parts of the input that cannot be read, and returns them for the report.
    fn damaged(&self, damage: &[Damage]) -> Vec<DamagedPart> {
        for part in damage {
            warn!("{}: {part}; what follows was read", self.input.display());
        }
        damage.iter().map(DamagedPart::from).collect()
    }

    fn table(&self) -> Result<Recording, Failure> {
        let read = series::read(&self.input, self.mapping.as_deref(), RequiredData::Samples);
        let recording = read.map_err(Failure::input)?;
        for note in &recording.notes {
            warn!("{}: {note}", self.input.display());
        }
        Ok(recording)
    }

    fn to_ros2(
        &self,
        is_of_daemon: bool,
        outputs: &mut Outputs,
        written: &mut Vec<PathBuf>,
    ) -> Result<Report, Failure> {
        let (bag, report) = if is_of_daemon {
            let contents = mcap_recording::read(&self.input).map_err(Failure::input)?;
            let bag = ros2::from_daemon_recording(&contents).map_err(Failure::system)?;
            let Contents { header, cut, unknown, records, damage, .. } = contents;
            let damaged = self.damaged(&damage);
            let rows = records.iter().filter(|record| matches!(record, Record::Cycle(_))).count();
            let (cell, recorded_by) = (Some(header.cell), Some(header.version));
            (bag, Report { cell, recorded_by, rows, cut, unknown, damaged, ..Report::default() })
        } else {
            let recording = self.table()?;
            let bag = ros2::from_table(&recording).map_err(Failure::system)?;
            (bag, Report { rows: recording.len(), ..Report::default() })
        };
        if bag.topics.is_empty() {
            let what = format!(
                "{}: contains no data for which there is a standard ROS 2 message",
                self.input.display()
            );
            return Err(Failure::input(format!("{what}; write a table instead (--out NAME.csv)")));
        }
        if bag.shifted_s > 0.0 {
            warn!(
                "the table begins before 0 s, which ROS 2 times cannot: its first row is at 0, {} s were added",
                bag.shifted_s
            );
        }
        outputs.put(&self.out, bag.bytes);
        written.push(self.out.clone());
        let force_samples = bag.topics.get(ros2::FORCE_TOPIC).copied().unwrap_or(0);
        let (topics, left_out) = (bag.topics, bag.left_out);
        Ok(Report { recordings: 1, force_samples, topics, left_out, ..report })
    }

    fn convert_table(
        &self,
        target: &Target,
        outputs: &mut Outputs,
        written: &mut Vec<PathBuf>,
    ) -> Result<Report, Failure> {
        let mut recording = self.table()?;
        recording.metadata.model = recording
            .metadata
            .model
            .take()
            .map(|name| relative_model_path(target, &self.input, name));
        target.add_recording(outputs, "", &recording, written)?;
        Ok(Report { rows: recording.len(), recordings: 1, ..Report::default() })
    }
}

/// Topics of these records that no table holds.
fn topics_without_table(records: &[Record]) -> Vec<String> {
    let topic = |record: &Record| match record {
        Record::Cycle(_) | Record::Force(_) => None,
        Record::Verdict(_) => Some(Topic::verdict().name),
        Record::Status(_) => Some(Topic::status().name),
        Record::Log(_) => Some(Topic::log().name),
    };
    let topics: BTreeSet<&str> = records.iter().filter_map(topic).collect();
    topics.into_iter().map(str::to_owned).collect()
}

/// Message for a file of the daemon that contains nothing to convert.
fn empty_file_message(input: &Path, cut: Option<&str>) -> String {
    let what = format!("{}: contains no cycle and no force sample", input.display());
    match cut {
        Some(why) => {
            format!("{what}; the file is truncated or damaged before its first data: {why}")
        }
        None => format!("{what}; check whether the daemon received any commands"),
    }
}

/// The path of the recording's model as seen from the target's directory; a preset keeps its name.
fn relative_model_path(target: &Target, input: &Path, name: String) -> String {
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
    fn of(out: &Path) -> Result<Self, Failure> {
        // `.`, `/`, a device: the files' names begin with NAME.
        let is_folder = out.is_dir();
        if out.file_name().is_none() || (out.exists() && !out.is_file()) {
            let found = if is_folder { "is a folder" } else { "not a valid file name" };
            let what = format!("--out {}: {found}", out.display());
            return Err(Failure::input(format!("{what}; give one such as --out run.csv")));
        }
        let format = if has_ending(out, "parquet") { Format::Parquet } else { Format::Csv };
        let is_known = ["csv", "toml", "parquet"].iter().any(|ending| has_ending(out, ending));
        let stem = if is_known { out.with_extension("") } else { out.to_owned() };
        Ok(Self { stem, format })
    }

    /// The path with more behind it.
    fn with_suffix(&self, more: impl AsRef<OsStr>) -> PathBuf {
        let mut name = self.stem.clone().into_os_string();
        name.push(more);
        PathBuf::from(name)
    }

    /// Adds the rows made with one model, and that model, to the outputs.
    fn add_run(
        &self,
        outputs: &mut Outputs,
        more: &str,
        run: &mut Run,
        written: &mut Vec<PathBuf>,
    ) -> Result<(), Failure> {
        match run.header.as_ref().map(|header| header.model.as_str()) {
            Some("") => {}
            Some(text) => {
                let model = self.with_suffix(format!("{more}-model.toml"));
                outputs.put(&model, text);
                let name = model.file_name().unwrap_or_default();
                run.cycles.metadata.model = Some(name.to_string_lossy().into_owned());
                written.push(model);
            }
            None => {
                let name = self.with_suffix(more);
                warn!("{}: the MCAP file does not hold the model of these rows", name.display());
            }
        }
        self.add_recording(outputs, more, &run.cycles, written)
    }

    /// Puts a recording as its two files.
    fn add_recording(
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
        let (toml, path) = (
            self.with_suffix(format!("{more}.toml")),
            self.with_suffix(format!("{more}.{ending}")),
        );
        outputs.put(&toml, recording.about_toml());
        outputs.put(&path, table);
        written.extend([toml, path]);
        Ok(())
    }
}

fn print_report(console: &mut Console, report: &Report) -> Outcome {
    if let Some(why) = &report.cut {
        warn!("the MCAP file is truncated; everything before that point was read: {why}");
    }
    if report.unknown > 0 {
        warn!("skipped {} of types unknown to this version", pluralise(report.unknown, "message"));
    }
    match report.cell.as_ref().zip(report.recorded_by.as_ref()) {
        Some((cell, version)) => {
            let rows = pluralise(report.rows, "cycle");
            let forces = pluralise(report.force_samples, "force sample");
            console.say(format!("cell {cell}, trued {version}: {rows}, {forces}"))?;
        }
        None => console.say(pluralise(report.rows, "row"))?,
    }
    if report.recordings > 1 {
        let models = pluralise(report.recordings, "time");
        console.say(format!("a model was in use {models}: each has a recording of its own"))?;
    }
    for (topic, messages) in &report.topics {
        console.say(format!("{topic:<28}{messages:>10} messages"))?;
    }
    let left_out = report.left_out.join(", ");
    match (report.topics.is_empty(), left_out.as_str()) {
        (_, "") => {}
        (true, topics) => console.say(format!("not in a table      {topics}"))?,
        (false, columns) => warn!("columns without a standard ROS 2 message, left out: {columns}"),
    }
    for file in &report.files {
        console.say(format!("written             {file}"))?;
    }
    Ok(if report.damaged.is_empty() { Answer::Done } else { Answer::No })
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report>("convert", "trued.convert/1")
}
