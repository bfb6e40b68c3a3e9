//! A result as a Parquet file: one row per recorded domain, one per parameter of a finding, or one for a refusal.
//!
//! Columns, units and meaning of the rows: docs/reference/batch.md. The same rows give the same bytes: no compression, no statistics, one group of rows, no
//! time, and the writer's name is fixed.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::record::Field;
use parquet::schema::parser::parse_message_type;
use recording::quiet_panic::caught;

use crate::key::Key;

/// Name of the format.
pub const SCHEMA: &str = "trued.batch-result/1";

/// Data common to all rows of one result.
#[derive(Debug, Clone, PartialEq)]
pub struct ResultHeader {
    /// Key of the result.
    pub key: Key,
    /// Version of the program that computed it.
    pub version: String,
    /// The robot's name.
    pub robot: String,
    /// Its serial number.
    pub serial: Option<String>,
    /// When it was recorded, µs since 1970 in UTC.
    pub recorded_at_us: Option<i64>,
    /// The files as the manifest names them, joined by `, `.
    pub files: String,
    /// Seed of the random number generators.
    pub seed: u64,
}

/// Kind of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    /// A recorded domain: verdict and errors.
    Recording,
    /// A parameter of a finding.
    Finding,
    /// The reason of a refusal.
    Refused,
}

impl Subject {
    fn name(self) -> &'static str {
        match self {
            Self::Recording => "recording",
            Self::Finding => "finding",
            Self::Refused => "refused",
        }
    }
}

/// A row; fields that do not apply are `None`.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Kind of the row.
    pub subject: Subject,
    /// `position`, `torque` or `force`.
    pub domain: Option<String>,
    /// Verdict of the domain.
    pub verdict: Option<String>,
    /// Unit of errors, noise and sizes.
    pub unit: Option<String>,
    /// Measured rows.
    pub samples: Option<i64>,
    /// RMS noise of the residual.
    pub noise_rms: Option<f64>,
    /// RMS error of the given model on the test set.
    pub error_before: Option<f64>,
    /// The same with the findings.
    pub error_after: Option<f64>,
    /// Mean ambient temperature, °C.
    pub ambient_c: Option<f64>,
    /// Mean temperature of the finding's joint, °C.
    pub joint_c: Option<f64>,
    /// The parameter of a finding.
    pub finding: Option<FindingParameter>,
    /// The row as a sentence.
    pub sentence: String,
}

/// A parameter of a finding.
#[derive(Debug, Clone, PartialEq)]
pub struct FindingParameter {
    /// Name of the effect, as in model files.
    pub effect: String,
    /// Joint, from 1; none for effects of the whole robot.
    pub joint: Option<i64>,
    /// `new` or `revised`.
    pub change: String,
    /// Whether it is claimed (probability of 0.5 or more); otherwise a candidate.
    pub is_claimed: bool,
    /// Probability of the finding, where one is computed.
    pub probability: Option<f64>,
    /// Name of the parameter with its unit, as in model files.
    pub parameter: Option<String>,
    /// Position in the list, from 1, if the parameter is a list.
    pub index: Option<i64>,
    /// Estimate.
    pub value: Option<f64>,
    /// Its 95 % interval.
    pub interval: Option<[f64; 2]>,
    /// RMS change of the measured quantity by this effect alone, in the domain's unit.
    pub size_rms: Option<f64>,
    /// The same, largest.
    pub size_max: Option<f64>,
}

impl Row {
    /// A row of a refusal.
    #[must_use]
    pub fn refused(sentence: String) -> Self {
        Self {
            subject: Subject::Refused,
            domain: None,
            verdict: None,
            unit: None,
            samples: None,
            noise_rms: None,
            error_before: None,
            error_after: None,
            ambient_c: None,
            joint_c: None,
            finding: None,
            sentence,
        }
    }
}

/// A row with the common data of the result.
struct RowContext<'a>(&'a ResultHeader, &'a Row);

impl<'a> RowContext<'a> {
    fn fact<T>(&self, read: impl FnOnce(&'a FindingParameter) -> Option<T>) -> Option<T> {
        self.1.finding.as_ref().and_then(read)
    }
}

/// Extracts the value of a column from a row.
enum Values {
    Text(for<'a> fn(&RowContext<'a>) -> Option<String>),
    Number(fn(&RowContext<'_>) -> Option<f64>),
    Whole(fn(&RowContext<'_>) -> Option<i64>),
    Flag(fn(&RowContext<'_>) -> Option<bool>),
    /// µs since 1970 in UTC.
    Time(fn(&RowContext<'_>) -> Option<i64>),
}

use Values::{Flag, Number, Text, Time, Whole};

/// The columns, in the order of the file.
const COLUMNS: &[(&str, Values)] = &[
    ("key", Text(|line| Some(line.0.key.to_string()))),
    ("robot", Text(|line| Some(line.0.robot.clone()))),
    ("serial", Text(|line| line.0.serial.clone())),
    ("recorded_at", Time(|line| line.0.recorded_at_us)),
    ("files", Text(|line| Some(line.0.files.clone()))),
    ("subject", Text(|line| Some(line.1.subject.name().to_owned()))),
    ("domain", Text(|line| line.1.domain.clone())),
    ("verdict", Text(|line| line.1.verdict.clone())),
    ("unit", Text(|line| line.1.unit.clone())),
    ("samples", Whole(|line| line.1.samples)),
    ("noise_rms", Number(|line| line.1.noise_rms)),
    ("error_before", Number(|line| line.1.error_before)),
    ("error_after", Number(|line| line.1.error_after)),
    ("ambient_C", Number(|line| line.1.ambient_c)),
    ("joint_C", Number(|line| line.1.joint_c)),
    ("effect", Text(|line| line.fact(|fact| Some(fact.effect.clone())))),
    ("joint", Whole(|line| line.fact(|fact| fact.joint))),
    ("change", Text(|line| line.fact(|fact| Some(fact.change.clone())))),
    ("claimed", Flag(|line| line.fact(|fact| Some(fact.is_claimed)))),
    ("probability", Number(|line| line.fact(|fact| fact.probability))),
    ("parameter", Text(|line| line.fact(|fact| fact.parameter.clone()))),
    ("index", Whole(|line| line.fact(|fact| fact.index))),
    ("value", Number(|line| line.fact(|fact| fact.value))),
    ("low", Number(|line| line.fact(|fact| fact.interval.map(|[low, _]| low)))),
    ("high", Number(|line| line.fact(|fact| fact.interval.map(|[_, high]| high)))),
    ("size_rms", Number(|line| line.fact(|fact| fact.size_rms))),
    ("size_max", Number(|line| line.fact(|fact| fact.size_max))),
    ("says", Text(|line| Some(line.1.sentence.clone()))),
    ("seed", Whole(|line| i64::try_from(line.0.seed).ok())),
    ("version", Text(|line| Some(line.0.version.clone()))),
];

impl Values {
    fn kind(&self) -> (&'static str, &'static str) {
        match self {
            Text(_) => ("binary", " (UTF8)"),
            Number(_) => ("double", ""),
            Whole(_) => ("int64", ""),
            Flag(_) => ("boolean", ""),
            Time(_) => ("int64", " (TIMESTAMP(MICROS,true))"),
        }
    }
}

/// Names of the columns, in the order of the file.
pub fn column_names() -> impl Iterator<Item = &'static str> {
    COLUMNS.iter().map(|(name, _)| *name)
}

/// The file of a result.
///
/// # Errors
/// Error of the library; does not occur for rows of this type.
pub fn to_parquet(recorded: &ResultHeader, rows: &[Row]) -> Result<Vec<u8>, ParquetError> {
    let columns: String = COLUMNS
        .iter()
        .map(|(name, values)| {
            let (kind, meaning) = values.kind();
            format!("optional {kind} {name}{meaning};")
        })
        .collect();
    let schema = Arc::new(parse_message_type(&format!("message trued {{{columns}}}"))?);
    let entry = |key: &str, value: String| KeyValue::new(key.to_owned(), value);
    let about = vec![
        entry("schema", SCHEMA.to_owned()),
        entry("key", recorded.key.to_string()),
        entry("version", recorded.version.clone()),
    ];
    let how = WriterProperties::builder()
        .set_compression(Compression::UNCOMPRESSED)
        .set_statistics_enabled(EnabledStatistics::None)
        .set_offset_index_disabled(true)
        .set_dictionary_enabled(false)
        .set_created_by("trued".to_owned())
        .set_key_value_metadata(Some(about))
        .build();
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(how))?;
    let mut group = writer.next_row_group()?;
    let lines: Vec<RowContext<'_>> = rows.iter().map(|row| RowContext(recorded, row)).collect();
    for (_, values) in COLUMNS {
        match values {
            Text(value) => column::<ByteArrayType>(&mut group, &lines, |line| {
                value(line).map(|text| ByteArray::from(text.into_bytes()))
            }),
            Number(value) => column::<DoubleType>(&mut group, &lines, value),
            Whole(value) | Time(value) => column::<Int64Type>(&mut group, &lines, value),
            Flag(value) => column::<BoolType>(&mut group, &lines, value),
        }?;
    }
    group.close()?;
    writer.into_inner()
}

fn column<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    lines: &[RowContext<'_>],
    value: impl Fn(&RowContext<'_>) -> Option<T::T>,
) -> Result<(), ParquetError> {
    let cells: Vec<Option<T::T>> = lines.iter().map(value).collect();
    let levels: Vec<i16> = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
    let values: Vec<T::T> = cells.into_iter().flatten().collect();
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::EOF("more columns than the schema has".to_owned()));
    };
    column.typed::<T>().write_batch(&values, Some(&levels), None)?;
    column.close()
}

/// The key in the footer of a complete result; none if the file is missing, truncated or not a result.
#[must_use]
pub fn key_of(path: &Path) -> Option<String> {
    read(path, |reader| {
        let about = reader.metadata().file_metadata().key_value_metadata()?;
        let value_of = |key: &str| about.iter().find(|one| one.key == key)?.value.clone();
        value_of("schema").filter(|schema| schema == SCHEMA)?;
        value_of("key")
    })
}

/// The reason of a refused recording; none for a diagnosed one.
#[must_use]
pub fn refusal(path: &Path) -> Option<String> {
    read(path, |reader| {
        let first = reader.get_row_iter(None).ok()?.next()?.ok()?;
        let text = |wanted: &str| {
            let field = first.get_column_iter().find(|(name, _)| *name == wanted)?.1;
            if let Field::Str(text) = field { Some(text.clone()) } else { None }
        };
        text("subject").filter(|subject| subject == Subject::Refused.name())?;
        text("says")
    })
}

/// Reads a value from a Parquet file; `None` if that fails.
fn read<T>(
    path: &Path,
    extract: impl FnOnce(&SerializedFileReader<File>) -> Option<T>,
) -> Option<T> {
    let file = File::open(path).ok()?;
    // The library panics on some invalid input.
    caught(|| extract(&SerializedFileReader::new(file).ok()?)).flatten()
}

#[cfg(test)]
mod tests;
