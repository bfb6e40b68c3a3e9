//! A table in a Parquet file: flat columns of numbers, texts or booleans; null marks a missing sample.
//!
//! Format: docs/reference/recording.md. It becomes the same kind of table as a text, with the same
//! checks; numbers are not converted. Compression: none, Snappy or Zstandard. No input causes a
//! panic: what the library cannot read is an error.

use std::fs::File;
use std::path::Path;

use parquet::basic::{ConvertedType, LogicalType, Type};
use parquet::column::reader::get_typed_column_reader;
use parquet::data_type::{
    BoolType, ByteArrayType, DataType, DoubleType, FixedLenByteArrayType, FloatType, Int32Type,
    Int64Type,
};
use parquet::errors::ParquetError;
use parquet::file::metadata::FileMetaData;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::cells::{Cells, Texts};
use super::table::RawTable;
use crate::faults::{Fault, Faults};
use crate::files::FileError;
use crate::quiet_panic::caught;

/// The table of a file.
///
/// # Errors
/// The file cannot be opened, is damaged, or has columns that are no plain values.
pub(super) fn table(path: &Path) -> Result<RawTable<'static>, FileError> {
    let file = File::open(path).map_err(FileError::io("read", path))?;
    let name = path.display().to_string();
    let damaged = |why: String| {
        let mut faults = Faults::new(&name);
        let fault = Fault::new("", format!("cannot be read as Parquet: {why}"));
        faults.push(fault.expected(
            "a complete Parquet file, uncompressed or compressed by Snappy or Zstandard",
        ));
        FileError::from(faults)
    };
    // The library panics on some invalid input.
    match caught(|| cut(file, &name)) {
        Some(Ok(read)) => Ok(read?),
        Some(Err(error)) => Err(damaged(error.to_string())),
        None => Err(damaged("its data are inconsistent".to_owned())),
    }
}

fn cut(file: File, name: &str) -> Result<Result<RawTable<'static>, Faults>, ParquetError> {
    let reader = SerializedFileReader::new(file)?;
    let schema = reader.metadata().file_metadata().schema_descr();
    let columns: Vec<_> = schema.columns().to_vec();
    let mut faults = Faults::new(name);
    let header: Vec<String> = columns.iter().map(|column| column.path().string()).collect();
    let durations = durations(reader.metadata().file_metadata());
    for (column, name) in columns.iter().zip(&header) {
        let found = if durations.contains(name) {
            Some("is a duration; a recording has times in seconds, as numbers")
        } else {
            strange(column)
        };
        if let Some(found) = found {
            faults.push(Fault::new(name, found).expected("one number, string or Boolean per row"));
        }
    }
    if !faults.is_empty() {
        return Ok(Err(faults));
    }
    let whole = |place: usize| cells(&reader, place, &columns[place]);
    let cells: Vec<Cells> = (0..columns.len()).map(whole).collect::<Result<_, _>>()?;
    Ok(Ok(RawTable::made(header, cells)))
}

/// Why a column is not supported; `None` if it is.
fn strange(column: &ColumnDescriptor) -> Option<&'static str> {
    let logical = column.logical_type_ref();
    if column.max_rep_level() > 0 {
        return Some("contains lists");
    }
    match logical {
        Some(LogicalType::Timestamp(_) | LogicalType::Time(_) | LogicalType::Date) => {
            Some("is a date or time of day; a recording has times in seconds")
        }
        Some(LogicalType::Decimal(_)) => Some("contains decimals"),
        Some(LogicalType::Float16) => Some("contains floats of 16 bits"),
        _ => None,
    }
}

/// Names of the columns that pandas wrote as durations: Parquet stores them as integers without a logical type.
fn durations(metadata: &FileMetaData) -> Vec<String> {
    let written = metadata.key_value_metadata().into_iter().flatten();
    let pandas = written
        .filter(|entry| entry.key == "pandas")
        .find_map(|entry| serde_json::from_str::<serde_json::Value>(entry.value.as_deref()?).ok());
    let columns = pandas.as_ref().and_then(|pandas| pandas["columns"].as_array());
    let is_duration = |column: &&serde_json::Value| {
        column["numpy_type"].as_str().is_some_and(|name| name.starts_with("timedelta"))
    };
    let durations = columns.into_iter().flatten().filter(is_duration);
    durations.filter_map(|column| column["field_name"].as_str().map(str::to_owned)).collect()
}

/// Whether a column has integers without a sign.
fn is_unsigned(column: &ColumnDescriptor) -> bool {
    match column.logical_type_ref() {
        Some(LogicalType::Integer(integer)) => !integer.is_signed,
        _ => matches!(
            column.converted_type(),
            ConvertedType::UINT_8
                | ConvertedType::UINT_16
                | ConvertedType::UINT_32
                | ConvertedType::UINT_64
        ),
    }
}

/// A column over all row groups; the last argument converts its values.
fn all<T: DataType, V>(
    file: &SerializedFileReader<File>,
    column: usize,
    ours: impl Fn(T::T) -> V,
) -> Result<Vec<Option<V>>, ParquetError> {
    let mut all = Vec::new();
    for group in 0..file.num_row_groups() {
        let group = file.get_row_group(group)?;
        let count = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
        // The definition level of an existing value; 0 for a required column.
        let nullable = group.metadata().column(column).column_descr().max_def_level();
        let mut reader = get_typed_column_reader::<T>(group.get_column_reader(column)?);
        let (mut levels, mut found): (Vec<i16>, Vec<T::T>) = (Vec::new(), Vec::new());
        let mut read = 0;
        while read < count {
            let wanted = (nullable > 0).then_some(&mut levels);
            let (records, ..) = reader.read_records(count - read, wanted, None, &mut found)?;
            if records == 0 {
                return Err(ParquetError::EOF("a column has too few rows".to_owned()));
            }
            read += records;
        }
        let whole = all.len() + count;
        let mut found = found.into_iter().map(&ours);
        if nullable == 0 {
            all.extend(found.map(Some));
        } else {
            let value_at = |level| if level == nullable { found.next() } else { None };
            all.extend(levels.into_iter().map(value_at));
        }
        all.resize_with(whole, || None);
    }
    Ok(all)
}

/// A column as stored in memory.
fn cells(
    file: &SerializedFileReader<File>,
    column: usize,
    described: &ColumnDescriptor,
) -> Result<Cells, ParquetError> {
    let or_nan = |all: Vec<Option<f64>>| all.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let texts = |all: Vec<Option<String>>| -> Texts {
        all.iter().map(|text| text.as_deref().unwrap_or_default()).collect()
    };
    let is_unsigned = is_unsigned(described);
    Ok(match described.physical_type() {
        Type::DOUBLE => Cells::Numbers(or_nan(all::<DoubleType, _>(file, column, |v| v)?)),
        Type::FLOAT => Cells::Numbers(or_nan(all::<FloatType, _>(file, column, f64::from)?)),
        Type::INT64 if is_unsigned => {
            let all = all::<Int64Type, _>(file, column, |v| v)?;
            if all.iter().flatten().all(|v| *v >= 0) {
                Cells::Whole(all)
            } else {
                // Numbers above 2^63 lose digits, as in other columns of floats.
                let float = |v: i64| v.cast_unsigned() as f64;
                Cells::Numbers(or_nan(all.into_iter().map(|v| v.map(float)).collect()))
            }
        }
        Type::INT32 if is_unsigned => {
            Cells::Whole(all::<Int32Type, _>(file, column, |v| i64::from(v.cast_unsigned()))?)
        }
        Type::INT64 => Cells::Whole(all::<Int64Type, _>(file, column, |v| v)?),
        Type::INT32 => Cells::Whole(all::<Int32Type, _>(file, column, i64::from)?),
        Type::BOOLEAN => Cells::Whole(all::<BoolType, _>(file, column, i64::from)?),
        Type::BYTE_ARRAY => {
            Cells::Texts(texts(all::<ByteArrayType, _>(file, column, |v| text(v.data()))?))
        }
        Type::FIXED_LEN_BYTE_ARRAY => {
            Cells::Texts(texts(all::<FixedLenByteArrayType, _>(file, column, |v| text(v.data()))?))
        }
        Type::INT96 => return Err(ParquetError::NYI("96-bit columns".to_owned())),
    })
}

mod write;

#[cfg(test)]
mod tests;
