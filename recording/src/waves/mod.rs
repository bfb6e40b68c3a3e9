//! Waveforms of instruments: samples at one rate, from tables, `LabVIEW`, UFF 58 and WAV files.
//!
//! The format is determined by the content (by the name only if the content is ambiguous). A valid
//! [`Waves`] has a record or a response function; a record's channels are equally long and free of
//! infinities, NaN marks a missing sample, and its grid is finite with a step above 0. No input
//! makes a reader panic, and memory stays within a few times the file's size.

mod columns;
mod lvm;
mod names;
mod pick;
mod preamble;
mod quantity;
mod recorded;
mod spacing;
mod stored;
mod table;
#[cfg(test)]
mod table_tests;
#[cfg(test)]
mod tests;
mod uff;
mod uff58;
mod uff_channels;
mod uff_head;
mod uff_names;
mod uff_numbers;
#[cfg(test)]
mod uff_tests;
mod wav;
mod wav_chunks;
#[cfg(test)]
mod wav_tests;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::faults::{Fault, Faults, Setting};
use crate::files::{FileError, utf16_as_utf8};
use crate::mapping::mapping_path;
use crate::series::{self, Channel, RecordingMetadata, RequiredData};
use crate::unit::Quantity;

pub use self::stored::Stored;

/// Larger files are refused: they would not fit into memory together with the result.
const FILE_BYTES_MAX: u64 = 4 << 30;

/// Options of a reader besides the file name.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Options {
    /// Samples per second; takes precedence over the file.
    pub rate_hz: Option<f64>,
    /// Sample spacing of profiles, mm; takes precedence over the file.
    pub step_mm: Option<f64>,
    /// Columns to take, by name or by number from 1; empty: all that are waveforms.
    pub columns: Vec<String>,
    /// Mapping for a table of another program.
    pub mapping: Option<PathBuf>,
    /// The value of a WAV file's full scale; 1 if not given.
    pub full_scale: Option<f64>,
}

/// The waveforms of one file.
#[derive(Debug, Clone, PartialEq)]
pub struct Waves {
    /// The source file.
    pub file: PathBuf,
    /// Runs of samples without a gap, in the file's order. A gap in time, a new segment, a time
    /// that restarts or a repeated channel starts another.
    pub records: Vec<Record>,
    /// Measured response functions, if the file has any.
    pub responses: Vec<ResponseFunction>,
    /// The metadata of a `trued.recording/1`.
    pub about: Option<RecordingMetadata>,
    /// Remarks on the file that are not faults, one sentence each.
    pub notes: Vec<String>,
}

/// Samples of several channels, taken simultaneously at even steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Positions of the samples.
    pub grid: Grid,
    /// The channels, all of one length.
    pub channels: Vec<Wave>,
    /// Other columns recorded with them and known by name: spindle, feed, tacho, positions, joints.
    /// SI.
    pub auxiliary: BTreeMap<Channel, Vec<f64>>,
}

/// The even spacing of a record's samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Grid {
    /// Over time.
    Time {
        /// Time of the first sample, s.
        start_s: f64,
        /// Samples per second.
        rate_hz: f64,
    },
    /// Over a length, as a stylus moves.
    Length {
        /// Position of the first sample, mm.
        start_mm: f64,
        /// From one sample to the next, mm.
        step_mm: f64,
    },
}

/// One channel of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Wave {
    /// Its name in the file, or its number.
    pub name: String,
    /// The unit of its values in the file; `1` if the file states none.
    pub unit: String,
    /// 0 to 2: along x, y, z; 3 to 5: moment about them; if the name states it.
    pub axis: Option<usize>,
    /// The samples, in that unit; NaN for missing ones.
    pub values: Vec<f64>,
}

/// A frequency response function: response over reference, complex, at growing frequencies.
#[derive(Debug, Clone, PartialEq)]
pub struct ResponseFunction {
    /// Point and direction of the response (`2+x`).
    pub response: String,
    /// Point and direction of the reference (`1+z`).
    pub reference: String,
    /// Unit of the response.
    pub response_unit: String,
    /// Unit of the reference.
    pub reference_unit: String,
    /// Frequencies, Hz.
    pub frequency_hz: Vec<f64>,
    /// Real and imaginary part at each.
    pub values: Vec<[f64; 2]>,
}

impl Record {
    /// Number of samples of each channel.
    #[must_use]
    pub fn len(&self) -> usize {
        self.channels.first().map_or(0, |wave| wave.values.len())
    }

    /// Whether it has none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Wave {
    /// A channel; its axis is determined from its name.
    #[must_use]
    pub fn new(name: impl Into<String>, unit: impl Into<String>, values: Vec<f64>) -> Self {
        let name = name.into();
        Self { axis: names::axis(&name), unit: unit.into(), name, values }
    }

    /// The channel's quantity and the SI value of its unit, if the unit is known.
    #[must_use]
    pub fn quantity(&self) -> Option<(Quantity, f64)> {
        quantity::of(&self.unit)
    }
}

impl ResponseFunction {
    /// Quantities of response and reference, and their units' SI values, if known.
    #[must_use]
    pub fn quantities(&self) -> [Option<(Quantity, f64)>; 2] {
        [quantity::of(&self.response_unit), quantity::of(&self.reference_unit)]
    }
}

/// Reads the waveforms of a file; for a `trued.recording/1` also its TOML and mapping.
///
/// # Errors
/// The file cannot be read, or every fault of it.
pub fn read(path: &Path, options: &Options) -> Result<Waves, FileError> {
    let size = std::fs::metadata(path).map_err(FileError::io("read", path))?.len();
    let name = path.display().to_string();
    if size > FILE_BYTES_MAX {
        let mut faults = Faults::new(&name);
        let fault = Fault::new("", format!("has {} GiB", size.div_ceil(1 << 30)));
        faults.push(fault.expected("at most 4 GiB").help("cut it into several files"));
        return Err(faults.into());
    }
    let bytes = std::fs::read(path).map_err(FileError::io("read", path))?;
    let bytes = utf16_as_utf8(&bytes).map_or(bytes, String::into_bytes);
    let mapped = is_mapped(path, &bytes, options)?;
    if options.full_scale.is_some() && (mapped || !matches!(Form::of(path, &bytes), Form::Wav)) {
        let mut faults = Faults::new(&name);
        let fault = Fault::new("", "is no WAV file, so that its values have no full scale");
        let help = "leave the full scale out; state a factor in a mapping (`scale`)";
        faults.push(fault.help(help).by(&[Setting::FullScale]));
        return Err(faults.into());
    }
    if mapped || recorded::is_recording(&bytes) {
        // Rows of a file are read one by one; a pipe can be read only once.
        let bytes = (!path.is_file()).then_some(bytes);
        let mapping = options.mapping.as_deref();
        let recording = series::read_content(path, bytes, mapping, RequiredData::Samples)?;
        return Ok(recorded::waves(recording, options)?);
    }
    Ok(parse(path, bytes, options)?)
}

/// Whether the file is a table that a mapping describes: one that is given, or in the file's folder. A mapping of that name beside a file of another
/// format belongs to another file.
fn is_mapped(path: &Path, bytes: &[u8], options: &Options) -> Result<bool, Faults> {
    match instrument_format(path, bytes).filter(|format| *format != LABVIEW) {
        None => Ok(options.mapping.is_some() || mapping_path(path).is_file()),
        Some(_) if options.mapping.is_none() => Ok(false),
        Some(format) => Err(unmapped(path, format)),
    }
}

/// The fault of a mapping that is given for a file of a format of its own.
pub(crate) fn unmapped(path: &Path, format: &str) -> Faults {
    let mut faults = Faults::new(path.display().to_string());
    let fault = Fault::new("", format!("is {format}, which no mapping describes"));
    faults.push(
        fault
            .expected("a text table or a Parquet file with a mapping")
            .help("leave out the mapping")
            .by(&[Setting::Mapping]),
    );
    faults
}

/// The name of `LabVIEW`'s text format.
pub(crate) const LABVIEW: &str = "LabVIEW measurement";

/// The name of an instrument's format, detected from the first bytes of a file; `None` for tables
/// and recordings.
pub(crate) fn instrument_format(path: &Path, head: &[u8]) -> Option<&'static str> {
    match Form::of(path, head) {
        Form::Wav => Some("WAV"),
        Form::Uff => Some("universal file (UFF)"),
        Form::LabView => Some(LABVIEW),
        Form::Foreign(_) if !series::is_recording_name(path) => Some("waveforms"),
        Form::Foreign(_) | Form::Table => None,
    }
}

/// Reads the waveforms of a file's content, except `trued.recording/1`. The path is not opened.
///
/// # Errors
/// Every fault of the content.
pub fn parse(path: &Path, bytes: Vec<u8>, options: &Options) -> Result<Waves, Faults> {
    let name = path.display().to_string();
    let mut waves = match Form::of(path, &bytes) {
        Form::Wav => wav::waves(&name, &bytes, options),
        Form::Uff => uff::waves(&name, &bytes, options),
        Form::LabView => lvm::waves(&name, bytes, options),
        Form::Table => table::waves(&name, bytes, options),
        Form::Foreign(what) => {
            let mut faults = Faults::new(&name);
            let fault = Fault::new("", format!("is {what}, which is not supported"));
            faults.push(
                fault
                    .expected("a table (CSV, text, LabVIEW .lvm), UFF 58 or WAV")
                    .help("export it as CSV, or as UFF 58"),
            );
            Err(faults)
        }
    }?;
    waves.file = path.to_owned();
    Ok(waves)
}

/// Format of a file.
enum Form {
    Wav,
    Uff,
    LabView,
    Table,
    Foreign(&'static str),
}

impl Form {
    fn of(path: &Path, bytes: &[u8]) -> Self {
        let starts = |mark: &[u8]| bytes.starts_with(mark);
        let named = |names: &[&str]| {
            let extension = path.extension().unwrap_or_default();
            names.iter().any(|name| extension.eq_ignore_ascii_case(name))
        };
        match () {
            () if starts(b"RIFF") || starts(b"RF64") || starts(b"RIFX") => Self::Wav,
            () if starts(b"LabVIEW Measurement") => Self::LabView,
            () if uff::is_uff(bytes) || named(&["uff", "unv", "u58", "58"]) => Self::Uff,
            () if starts(b"TDSm") => Self::Foreign("a LabVIEW TDMS file"),
            () if starts(b"MATLAB 5.0") || starts(b"\x89HDF") => {
                Self::Foreign("a MATLAB or HDF5 file")
            }
            () if starts(b"PK\x03\x04") => Self::Foreign("an archive or a spreadsheet (zip)"),
            () if named(&["mcap"]) => Self::Foreign("a black box (`trued convert` makes a table)"),
            () if named(&["parquet"]) => Self::Foreign("a Parquet file"),
            () if named(&["wav", "wave"]) => Self::Wav,
            () => Self::Table,
        }
    }
}

/// A file's text: UTF-8, or otherwise Latin-1, which older instruments write; noted if so.
fn text(bytes: Vec<u8>, notes: &mut Vec<String>) -> String {
    let text = String::from_utf8(bytes).unwrap_or_else(|error| {
        notes.push("is not UTF-8: read as Latin-1".to_owned());
        error.as_bytes().iter().map(|byte| char::from(*byte)).collect()
    });
    text.strip_prefix('\u{feff}').map_or_else(|| text.clone(), str::to_owned)
}
