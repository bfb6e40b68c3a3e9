//! `trued check`: reports every error of configurations, models, mappings, manifests and recordings.
//!
//! Files without errors here are accepted by `trued run`, `correct` and `replay`.

mod cell;
mod rows;

use std::path::{Path, PathBuf};

use clap::Args;
use daemon::setup;
use recording::bridge::{self, EgmConfig, RsiConfig};
use recording::cut::{self, CutFile};
use recording::faults::{Fault, Faults};
use recording::files::{FileError, read_text};
use recording::manifest::{self, Manifest};
use recording::mapping::Mapping;
use recording::model::RobotModel;
use recording::series::{self, About, Channel, Kind, Need, Recording};
use report::count;
use serde::Serialize;

use crate::exit::{Answer, Failure, Outcome};
use crate::fleet;
use crate::input::{Reading, model};
use crate::output::{Console, Paint};

/// Validate files and report every error: cells, models, recordings, mappings
///
/// What a TOML is, its `schema` says; other files are recordings. A cell is checked with its model, a mapping `NAME.mapping.toml` with the recording
/// NAME beside it, a manifest with the models, mappings and recordings that it names. The first rows of a recording are shown as they are understood. Exit 1 where there are faults, 2 where a file cannot be read.
#[derive(Debug, Args)]
pub(crate) struct Check {
    #[command(flatten)]
    reading: Reading,
    /// cell.toml, model.toml, a recording, …
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
}

/// Results on one file and on the files that it names.
#[derive(Debug, Default)]
struct Found {
    what: &'static str,
    /// Short summary, if there are no errors.
    summary: String,
    notes: Vec<String>,
    /// Of a recording.
    columns: Vec<rows::Column>,
    faults: Vec<Faults>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report {
    ok: bool,
    files: Vec<FileReport>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct FileReport {
    file: String,
    what: &'static str,
    ok: bool,
    summary: String,
    notes: Vec<String>,
    /// The columns of a recording with their first values, as they are understood.
    columns: Vec<rows::Column>,
    faults: Vec<FaultReport>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct FaultReport {
    file: String,
    line: Option<usize>,
    column: Option<usize>,
    key: String,
    message: String,
    expected: String,
    help: String,
}

impl Check {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let known = self.reading.model.as_deref().map(model).transpose()?;
        let mut files = Vec::new();
        let mut unread = None;
        for path in &self.files {
            match self.look(path, known.as_ref()) {
                Ok(found) => {
                    say(console, path, &found)?;
                    files.push(FileReport::of(path, found));
                }
                // The other files are still checked; a read error is reported last.
                Err(error) => unread = unread.or(Some(error)),
            }
        }
        if let Some(error) = unread {
            return Err(Failure::input(error));
        }
        let ok = files.iter().all(|file| file.ok);
        console.json_of(&self.files, "trued.check/1", &Report { ok, files })?;
        Ok(if ok { Answer::Done } else { Answer::No })
    }

    fn look(&self, path: &Path, known: Option<&RobotModel>) -> Result<Found, FileError> {
        let toml = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"));
        let mut found = Found::default();
        if !toml {
            found.what = "recording";
            let recording = self.recording(path, self.reading.mapping.as_deref(), known);
            found.of(recording, |found, recording| tell_recording(found, &recording))?;
            return Ok(found);
        }
        let text = read_text(path)?;
        let name = path.display().to_string();
        match schema(&text) {
            Some("trued.cell/1") => cell::check(path, &text, &mut found)?,
            Some("trued.model/1") => {
                found.what = "model";
                let model = RobotModel::read(path);
                found.of(model, |found, model| tell_model(found, &model))?;
            }
            Some("trued.mapping/1") => {
                found.what = "mapping";
                found.of(Mapping::read(path), |_, _| {})?;
                if let Some(beside) = rows::recording_of(path).filter(|_| found.faults.is_empty()) {
                    let recording = self.recording(&beside, Some(path), known);
                    found.of(recording, |found, recording| tell_recording(found, &recording))?;
                }
            }
            Some(bridge::EGM_SCHEMA) => {
                found.what = "bridge";
                found.of(EgmConfig::read(path), |found, config| {
                    found.summary = format!("EGM, {:?}", config.guidance).to_lowercase();
                })?;
            }
            Some(bridge::RSI_SCHEMA) => {
                found.what = "bridge";
                found.of(RsiConfig::read(path), |found, config| {
                    found.summary = format!("RSI, {:?}", config.sums).to_lowercase();
                })?;
            }
            Some(cut::SCHEMA) => {
                found.what = "cut";
                found.of(CutFile::read(path), |_, _| {})?;
            }
            Some(manifest::SCHEMA) => {
                found.what = "manifest";
                found.of(Manifest::read(path), |found, manifest| {
                    let base = path.parent().unwrap_or(Path::new(""));
                    found.faults.extend(fleet::unusable_robots(&manifest, base, &name));
                    found.faults.extend(fleet::missing_recordings(&manifest, base, &name));
                    let recordings = count(manifest.recordings.len(), "recording");
                    let robots = count(manifest.robots.len(), "robot");
                    found.summary = format!("{recordings} of {robots}");
                })?;
            }
            Some("trued.recording/1") => {
                found.what = "recording's description";
                found.of(About::parse(&name, &text).map_err(FileError::from), |_, _| {})?;
            }
            other => {
                found.what = "file";
                found.faults.push(unknown(&name, other));
            }
        }
        Ok(found)
    }

    fn recording(
        &self,
        path: &Path,
        mapping: Option<&Path>,
        known: Option<&RobotModel>,
    ) -> Result<Recording, FileError> {
        let recording = match series::read(path, mapping, Need::Path) {
            // A recording of forces alone is valid too, except for a replay.
            Err(FileError::Content(faults)) if known.is_none() => {
                series::read(path, mapping, Need::Measurement).map_err(|_| faults)?
            }
            recording => recording?,
        };
        if let Some(model) = known {
            recording.check_joints(&setup::joint_kinds(&model.physics.arm))?;
        }
        Ok(recording)
    }
}

impl Found {
    /// Returns the content of a file or its errors.
    ///
    /// # Errors
    /// The file cannot be read.
    fn of<T>(
        &mut self,
        read: Result<T, FileError>,
        tell: impl FnOnce(&mut Self, T),
    ) -> Result<(), FileError> {
        match read {
            Ok(value) => tell(self, value),
            Err(FileError::Content(faults)) => self.faults.push(faults),
            Err(error) => return Err(error),
        }
        Ok(())
    }
}

impl FileReport {
    fn of(path: &Path, found: Found) -> Self {
        let fault = |file: &str, fault: &Fault| FaultReport {
            file: file.to_owned(),
            line: fault.place.as_ref().map(|place| place.line),
            column: fault.place.as_ref().map(|place| place.column),
            key: fault.key.clone(),
            message: fault.message.clone(),
            expected: fault.expected.clone(),
            help: fault.help.clone(),
        };
        let of_file = |faults: &Faults| {
            faults.list().iter().map(|one| fault(faults.file(), one)).collect::<Vec<_>>()
        };
        Self {
            file: path.display().to_string(),
            what: found.what,
            ok: found.faults.is_empty(),
            summary: found.summary,
            notes: found.notes,
            columns: found.columns,
            faults: found.faults.iter().flat_map(of_file).collect(),
        }
    }
}

fn say(console: &mut Console, path: &Path, found: &Found) -> Result<(), Failure> {
    // Colour is in use if painting an empty text adds something.
    let coloured = !console.paint(Paint::Bad, "").is_empty();
    for faults in &found.faults {
        console.say(if coloured { faults.styled() } else { faults.plain() })?;
        console.say("")?;
    }
    let name = path.display();
    if found.faults.is_empty() {
        let ok = console.paint(Paint::Good, "ok:");
        console.say(format!(
            "{ok} {name}: {}{}{}",
            found.what,
            gap(&found.summary),
            found.summary
        ))?;
    } else {
        let number = found.faults.iter().map(Faults::len).sum();
        console.say(format!("{name}: {}, {}", found.what, count(number, "fault")))?;
    }
    for note in &found.notes {
        console.say(format!("  note: {note}"))?;
    }
    if !found.columns.is_empty() {
        for line in rows::table(&found.columns).lines() {
            console.say(format!("  {line}"))?;
        }
    }
    Ok(())
}

fn gap(summary: &str) -> &'static str {
    if summary.is_empty() { "" } else { ", " }
}

fn tell_model(found: &mut Found, model: &RobotModel) {
    let (joints, effects) = (model.file.joints.len(), model.file.effects.len());
    let (joints, effects) = (count(joints, "joint"), count(effects, "effect"));
    found.summary = format!("`{}`, {joints}, {effects}", model.file.name);
    let names = model.not_compensated_names();
    found.notes.extend(names.iter().map(|name| format!("{name} is not compensated")));
}

fn tell_recording(found: &mut Found, recording: &Recording) {
    let kind = if recording.about.kind == Kind::Poses { "poses" } else { "path" };
    let mut segments = recording.segment.clone();
    segments.sort_unstable();
    segments.dedup();
    let columns: Vec<String> = recording.channels().map(Channel::base).collect();
    found.summary = format!(
        "{kind}, {}, {}, columns {}",
        count(recording.len(), "row"),
        count(segments.len(), "segment"),
        columns.join(" ")
    );
    found.notes.clone_from(&recording.notes);
    found.columns = rows::columns(recording);
}

/// The type that the TOML states: its root key `schema`.
fn schema(text: &str) -> Option<&str> {
    let root = text.lines().map(str::trim).take_while(|line| !line.starts_with('['));
    let value = |line: &'_ str| -> Option<std::ops::Range<usize>> {
        let rest = line.strip_prefix("schema")?.trim_start().strip_prefix('=')?.trim_start();
        let quote = rest.chars().next().filter(|c| matches!(c, '"' | '\''))?;
        let start = line.len() - rest.len() + 1;
        let length = rest[1..].find(quote)?;
        Some(start..start + length)
    };
    root.filter_map(|line| value(line).and_then(|span| line.get(span))).next()
}

fn unknown(name: &str, schema: Option<&str>) -> Faults {
    let mut faults = Faults::of(name);
    let message = match schema {
        Some(schema) => format!("is \"{schema}\""),
        None => "is missing".to_owned(),
    };
    faults.push(Fault::new("schema", message).expected(
        "\"trued.cell/1\", \"trued.model/1\", \"trued.recording/1\", \"trued.mapping/1\", \"trued.cut/1\" or \"trued.manifest/1\"",
    ));
    faults
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report>("check", "trued.check/1")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_schema_is_found_however_it_is_written_and_only_at_the_root() {
        assert_eq!(schema("# a\nschema = \"trued.cell/1\"\n"), Some("trued.cell/1"));
        assert_eq!(schema("name = \"x\"\n  schema='trued.model/1' # y"), Some("trued.model/1"));
        assert_eq!(schema("[meta]\nschema = \"trued.cell/1\"\n"), None);
        assert_eq!(schema("schema = \"cut"), None);
        assert_eq!(schema("schema = 3"), None);
    }
}
