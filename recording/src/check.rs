//! Validation of a file: every error in it, a summary, and the first rows of a recording as they are understood (`trued.check/1`).
//!
//! [`validate_file`] knows models, mappings, recordings with their descriptions, bridges and cuts. Files
//! whose checks need other crates (a cell with the limits of the daemon, a manifest with its
//! models) get their [`Findings`] there.

mod columns;
mod other;

use std::path::{Path, PathBuf};

use serde::Serialize;

pub use self::columns::Column;
use crate::bridge::{self, EgmConfig, RsiConfig};
use crate::cut::{self, CutFile};
use crate::faults::{Fault, Faults};
use crate::files::{FileError, read_text};
use crate::mapping::{Mapping, mapping_path};
use crate::model::RobotModel;
use crate::series::{self, Channel, Recording, RecordingKind, RecordingMetadata, RequiredData};

/// What is found in a file and in the files that it names.
#[derive(Debug, Default)]
pub struct Findings {
    /// The kind of file.
    pub kind: &'static str,
    /// Short summary; empty where there are faults.
    pub summary: String,
    /// Remarks.
    pub notes: Vec<String>,
    /// The first rows of a recording.
    pub columns: Vec<Column>,
    /// Errors, a list per file.
    pub faults: Vec<Faults>,
}

/// Results on all files: `trued.check/1` (docs/reference/results.md).
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// Whether no file has a fault.
    pub ok: bool,
    files: Vec<FileReport>,
}

/// Result on one file.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FileReport {
    file: String,
    what: &'static str,
    ok: bool,
    summary: String,
    notes: Vec<String>,
    /// The columns of a recording with their first values, as they are understood.
    columns: Vec<Column>,
    faults: Vec<FaultReport>,
}

#[derive(Debug, Serialize)]
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

/// Checks a file of this crate's formats: a TOML by its `schema`, a table as recording, a URDF and waveforms of
/// instruments by their readers.
///
/// `mapping`: mapping of a recording, if not the one in its folder; `model`: the robot with which
/// recordings must be compatible.
///
/// ```
/// use std::path::Path;
///
/// let error = recording::check::validate_file(Path::new("missing.toml"), None, None).unwrap_err();
/// assert!(error.to_string().starts_with("cannot read missing.toml"));
/// ```
///
/// # Errors
/// The file cannot be read. Faults in it are among the findings.
pub fn validate_file(
    path: &Path,
    mapping: Option<&Path>,
    model: Option<&RobotModel>,
) -> Result<Findings, FileError> {
    if !is_toml(path) {
        // A mapping is for tables: a URDF and waveforms of instruments are what they are. With one, any other text is a table.
        let is_mapped = mapping.is_some() || mapping_path(path).is_file();
        let of_other_format =
            if is_mapped { other::of_own_format(path)? } else { other::file(path)? };
        if let Some(findings) = of_other_format {
            return Ok(findings);
        }
        let mut findings = Findings { kind: "recording", ..Findings::default() };
        findings.take(read_recording(path, mapping, model), Findings::describe_recording)?;
        return Ok(findings);
    }
    let text = read_text(path)?;
    let name = path.display().to_string();
    let mut findings = Findings::default();
    match schema(&text) {
        Some("trued.model/1") => {
            findings.kind = "model";
            findings.take(RobotModel::read(path), |findings, model| {
                findings.describe_model(&model);
            })?;
        }
        Some("trued.mapping/1") => {
            findings.kind = "mapping";
            findings.take(Mapping::read(path), |_, _| {})?;
            if let Some(beside) = recording_of(path).filter(|_| findings.faults.is_empty()) {
                let recording = read_recording(&beside, Some(path), model);
                findings.take(recording, Findings::describe_recording)?;
            }
        }
        Some(bridge::EGM_SCHEMA) => {
            findings.kind = "bridge";
            findings.take(EgmConfig::read(path), |findings, config| {
                findings.summary = format!("EGM, {:?}", config.guidance).to_lowercase();
            })?;
        }
        Some(bridge::RSI_SCHEMA) => {
            findings.kind = "bridge";
            findings.take(RsiConfig::read(path), |findings, config| {
                findings.summary = format!("RSI, {:?}", config.sums).to_lowercase();
            })?;
        }
        Some(cut::SCHEMA) => {
            findings.kind = "cut";
            findings.take(CutFile::read(path), |_, _| {})?;
        }
        Some("trued.recording/1") => {
            findings.kind = "recording's description";
            findings
                .take(RecordingMetadata::parse(&name, &text).map_err(FileError::from), |_, _| {})?;
        }
        other => {
            findings.kind = "file";
            findings.faults.push(unknown_schema(&name, other));
        }
    }
    Ok(findings)
}

/// The root key `schema` of a TOML; `None` for other files, or without the key.
///
/// # Errors
/// The file cannot be read.
pub fn schema_of(path: &Path) -> Result<Option<String>, FileError> {
    if !is_toml(path) {
        return Ok(None);
    }
    Ok(schema(&read_text(path)?).map(str::to_owned))
}

impl Findings {
    /// Describes the content of a file, or collects its faults.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn take<T>(
        &mut self,
        read: Result<T, FileError>,
        describe: impl FnOnce(&mut Self, T),
    ) -> Result<(), FileError> {
        match read {
            Ok(value) => describe(self, value),
            Err(FileError::Content(faults)) => self.faults.push(faults),
            Err(error) => return Err(error),
        }
        Ok(())
    }

    fn describe_model(&mut self, model: &RobotModel) {
        let (joints, effects) = (model.file.joints.len(), model.file.effects.len());
        let (joints, effects) = (pluralise(joints, "joint"), pluralise(effects, "effect"));
        self.summary = format!("`{}`, {joints}, {effects}", model.file.name);
        let names = model.not_compensated_names();
        self.notes.extend(names.iter().map(|name| format!("{name} is not compensated")));
    }

    fn describe_recording(&mut self, recording: Recording) {
        let kind = if recording.metadata.kind == RecordingKind::Poses { "poses" } else { "path" };
        let mut segments = recording.segment.clone();
        segments.sort_unstable();
        segments.dedup();
        let columns: Vec<String> = recording.channels().map(Channel::base).collect();
        self.summary = format!(
            "{kind}, {}, {}, columns {}",
            pluralise(recording.len(), "row"),
            pluralise(segments.len(), "segment"),
            columns.join(" ")
        );
        self.columns = columns::of(&recording);
        self.notes = recording.notes;
    }
}

impl Report {
    /// The results on these files.
    #[must_use]
    pub fn of(files: Vec<FileReport>) -> Self {
        Self { ok: files.iter().all(|file| file.ok), files }
    }
}

impl FileReport {
    /// The kind of file.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        self.what
    }

    /// The findings in the file `path`.
    #[must_use]
    pub fn of(path: &Path, findings: Findings) -> Self {
        let fault = |file: &str, fault: &Fault| FaultReport {
            file: file.to_owned(),
            line: fault.location.as_ref().map(|place| place.line),
            column: fault.location.as_ref().map(|place| place.column),
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
            what: findings.kind,
            ok: findings.faults.is_empty(),
            faults: findings.faults.iter().flat_map(of_file).collect(),
            summary: findings.summary,
            notes: findings.notes,
            columns: findings.columns,
        }
    }
}

fn is_toml(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

fn read_recording(
    path: &Path,
    mapping: Option<&Path>,
    model: Option<&RobotModel>,
) -> Result<Recording, FileError> {
    let recording = match series::read(path, mapping, RequiredData::Path) {
        // A recording of forces alone is valid too, except for a replay.
        Err(FileError::Content(faults)) if model.is_none() && path.is_file() => {
            series::read(path, mapping, RequiredData::Measurement).map_err(|_| faults)?
        }
        recording => recording?,
    };
    if let Some(model) = model {
        let kinds: Vec<_> = model.physics.arm.joints().iter().map(|joint| joint.kind).collect();
        recording.check_joints(&kinds)?;
    }
    Ok(recording)
}

/// The recording that belongs to a mapping: `NAME.csv` or `NAME.parquet` for `NAME.mapping.toml`.
fn recording_of(mapping: &Path) -> Option<PathBuf> {
    let name = mapping.file_name()?.to_str()?.strip_suffix(".mapping.toml")?;
    let beside =
        ["csv", "parquet"].map(|ending| mapping.with_file_name(format!("{name}.{ending}")));
    beside.into_iter().find(|path| path.is_file())
}

/// A number with its noun: `1 row`, `2 rows`.
#[must_use]
pub fn pluralise(number: usize, what: &str) -> String {
    let ending = if number == 1 { "" } else { "s" };
    format!("{number} {what}{ending}")
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

fn unknown_schema(name: &str, schema: Option<&str>) -> Faults {
    let mut faults = Faults::new(name);
    let message = match schema {
        Some(schema) => format!("is \"{schema}\""),
        None => "is missing".to_owned(),
    };
    faults.push(Fault::new("schema", message).expected(
        "\"trued.cell/1\", \"trued.model/1\", \"trued.recording/1\", \"trued.mapping/1\", \"trued.cut/1\", \"trued.manifest/1\", \"trued.bridge-egm/1\" or \"trued.bridge-rsi/1\"",
    ));
    faults
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
