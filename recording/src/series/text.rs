//! Recordings as CSV: read with all errors reported, written atomically.
//!
//! Format: docs/reference/recording.md. Values written in SI units read back to the same bits;
//! values in degrees and millimetres do if they were read in these units.

use std::borrow::Cow;
use std::path::Path;

use csv::WriterBuilder;

use super::build::Builder;
use super::channel::Channel;
use super::metadata::RecordingMetadata;
use super::table::{Dialect, NumericColumns, RawTable};
use super::{FileUnits, Recording, RequiredData, metadata_path};
use crate::faults::{Fault, Faults};
use crate::files::{FileError, read_text as read_file, text_of, write_atomic};
use crate::mapping::{Mapping, mapping_path};

/// Reads a recording, with its TOML and mapping if they exist.
///
/// The mapping is `mapping` if given, otherwise `NAME.mapping.toml` in the folder of the file, if
/// it exists.
///
/// # Errors
/// A file cannot be read, or every fault of the first file that has any.
pub fn read(
    path: &Path,
    mapping: Option<&Path>,
    need: RequiredData,
) -> Result<Recording, FileError> {
    read_content(path, None, mapping, need)
}

/// The same of a file whose bytes have been read, as of a pipe; `None`: they are read here.
pub(crate) fn read_content(
    path: &Path,
    bytes: Option<Vec<u8>>,
    mapping: Option<&Path>,
    need: RequiredData,
) -> Result<Recording, FileError> {
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    if extension == "mcap" || (extension == "parquet" && !cfg!(feature = "parquet")) {
        return Err(other_format(path, &extension.to_string_lossy()).into());
    }
    let beside = mapping_path(path);
    let mapping = mapping.or_else(|| beside.is_file().then_some(beside.as_path()));
    let mapping = mapping.map(Mapping::read).transpose()?;
    let about = metadata_path(path);
    let about = if about.is_file() {
        Some(RecordingMetadata::parse(&about.display().to_string(), &read_file(&about)?)?)
    } else {
        None
    };
    #[cfg(feature = "parquet")]
    if extension == "parquet" {
        let table = super::parquet::table(path)?;
        let faults = Faults::new(path.display().to_string());
        return Ok(of_table(table, faults, mapping.as_ref(), about, need)?);
    }
    let name = path.display().to_string();
    let source = match bytes {
        Some(bytes) => text_of(&name, bytes)?,
        None => match row_by_row(path, mapping.as_ref(), about.as_ref(), need) {
            Some(recording) => return Ok(recording),
            None => read_file(path)?,
        },
    };
    Ok(read_text(&name, &source, mapping.as_ref(), about, need)?)
}

/// The recording in a file without faults in a simple format; `None` if the whole text is required.
fn row_by_row(
    path: &Path,
    mapping: Option<&Mapping>,
    about: Option<&RecordingMetadata>,
    need: RequiredData,
) -> Option<Recording> {
    let table = super::row_by_row::table(path, &dialect(mapping))?;
    let faults = Faults::new(path.display().to_string());
    of_table(table, faults, mapping, about.cloned(), need).ok()
}

pub(super) fn dialect(mapping: Option<&Mapping>) -> Dialect {
    let known_columns = || Dialect { reads: NumericColumns::Known, ..Dialect::default() };
    mapping.map_or_else(known_columns, |mapping| mapping.dialect.clone())
}

fn other_format(path: &Path, extension: &str) -> Faults {
    let mut faults = Faults::new(path.display().to_string());
    let fault = if extension == "parquet" {
        Fault::new("", "this build does not support Parquet").help("export it as CSV")
    } else {
        Fault::new("", "this is a recording of the daemon (MCAP), not a table")
            .help("convert it first: `trued convert FILE.mcap --out NAME`")
    };
    faults.push(fault.expected("a CSV file"));
    faults
}

/// Reads a recording from a text. `about` takes precedence over the metadata in a mapping.
///
/// # Errors
/// Every fault of the text.
pub fn read_text(
    name: &str,
    source: &str,
    mapping: Option<&Mapping>,
    about: Option<RecordingMetadata>,
    need: RequiredData,
) -> Result<Recording, Faults> {
    let source = with_line_feeds(source.strip_prefix('\u{feff}').unwrap_or(source));
    let mut faults = Faults::new(name);
    let table = RawTable::cut(&source, &dialect(mapping), &mut faults);
    of_table(table, faults, mapping, about, need)
}

/// The text with line feeds for the lone carriage returns that end lines in some programs.
fn with_line_feeds(source: &str) -> Cow<'_, str> {
    let mut pieces = source.split('\r');
    let first = pieces.next().unwrap_or_default();
    if pieces.clone().all(|piece| piece.starts_with('\n')) {
        return Cow::Borrowed(source);
    }
    let ended = |piece: &str| if piece.starts_with('\n') { "\r" } else { "\n" };
    let rest: String = pieces.flat_map(|piece| [ended(piece), piece]).collect();
    Cow::Owned(format!("{first}{rest}"))
}

pub(super) fn of_table(
    table: RawTable<'_>,
    faults: Faults,
    mapping: Option<&Mapping>,
    about: Option<RecordingMetadata>,
    need: RequiredData,
) -> Result<Recording, Faults> {
    match mapping {
        Some(mapping) => mapping.apply(table, faults, about, need),
        None => {
            let mut builder = Builder::new(&table, faults);
            builder.take_own_columns();
            builder.finish(about.unwrap_or_default(), need)
        }
    }
}

impl Recording {
    /// The recording as CSV, in the units of [`Recording::units`].
    #[must_use]
    pub fn to_csv(&self) -> Vec<u8> {
        let segments = self.has_segments();
        let mut header = vec!["t_s".to_owned()];
        header.extend(segments.then(|| "segment".to_owned()));
        let columns = self.file_columns();
        header.extend(columns.iter().map(|column| column.name.clone()));
        header.extend(self.other.iter().map(|(name, _)| name.clone()));
        let mut writer = WriterBuilder::new().from_writer(Vec::new());
        // Writing into memory cannot fail, and `flexible` allows different field counts.
        let _ = writer.write_record(&header);
        for row in 0..self.len() {
            let mut fields = vec![number_text(self.t_s[row])];
            let segment = self.segment.get(row).copied().unwrap_or(0);
            fields.extend(segments.then(|| segment.to_string()));
            fields.extend(columns.iter().map(|column| column.text(row)));
            let other = self.other.iter().map(|(_, cells)| cells.get(row).cloned());
            fields.extend(other.map(Option::unwrap_or_default));
            let _ = writer.write_record(&fields);
        }
        writer.into_inner().unwrap_or_default()
    }

    /// A column in degrees and millimetres, whatever the file has: its name with the unit, and its first values.
    #[must_use]
    pub fn first_values(&self, channel: Channel, rows: usize) -> (String, Vec<f64>) {
        let kind = self.joint_kind(channel.joint().unwrap_or(0));
        let unit = channel.unit_in(FileUnits::WORKSHOP, kind);
        let values = self.column(channel).unwrap_or_default().iter().take(rows);
        let values = values.map(|si| unit.map_or(*si, |unit| unit.from_si(*si)));
        (channel.name(unit), values.collect())
    }

    /// Whether a file needs a column with the segments.
    pub(super) fn has_segments(&self) -> bool {
        self.segment.iter().any(|segment| *segment != 0)
    }

    pub(super) fn file_columns(&self) -> Vec<FileColumn<'_>> {
        self.channels().map(|channel| self.file_column(channel)).collect()
    }

    fn file_column(&self, channel: Channel) -> FileColumn<'_> {
        let kind = self.joint_kind(channel.joint().unwrap_or(0));
        let unit = channel.unit_in(self.units, kind);
        let samples = self.column(channel).unwrap_or_default();
        FileColumn { name: channel.name(unit), unit, samples }
    }
}

/// A column in the unit of a file.
pub(super) struct FileColumn<'r> {
    pub(super) name: String,
    unit: Option<crate::unit::Unit>,
    samples: &'r [f64],
}

impl FileColumn<'_> {
    /// In the file's unit; NaN if missing.
    pub(super) fn value(&self, row: usize) -> f64 {
        let si = self.samples.get(row).copied().unwrap_or(f64::NAN);
        self.unit.map_or(si, |unit| unit.from_si(si))
    }

    fn text(&self, row: usize) -> String {
        number_text(self.value(row))
    }
}

/// The shortest text that reads back to the same bits; empty for NaN.
pub(crate) fn number_text(value: f64) -> String {
    if value.is_nan() { String::new() } else { format!("{value:?}") }
}

/// Writes a recording as CSV and its metadata, if any, as TOML: each file atomically, the CSV last.
///
/// # Errors
/// A file cannot be written; then the CSV is unchanged.
pub fn write(path: &Path, recording: &Recording) -> Result<(), FileError> {
    if recording.metadata != RecordingMetadata::default() {
        write_atomic(&metadata_path(path), recording.about_toml().as_bytes())?;
    }
    write_atomic(path, &recording.to_csv())
}
