//! A table in a Parquet file: flat columns of numbers, texts or truths; what is null was not taken.
//!
//! Contract: contract/recording.md. The same checks as for a text follow, since it becomes the same table. Compression: none, Snappy or Zstandard.
//! No input makes it panic: what the library cannot read is a fault.

use std::fs::File;
use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use csv::StringRecord;
use parquet::basic::LogicalType;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType, FixedLenByteArray};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::table::RawTable;
use crate::faults::{Fault, Faults};
use crate::files::FileError;

/// The values of a column in a group of rows; none for a null.
enum Values {
    Double(Vec<Option<f64>>),
    Float(Vec<Option<f32>>),
    Long(Vec<Option<i64>>),
    Int(Vec<Option<i32>>),
    Truth(Vec<Option<bool>>),
    Bytes(Vec<Option<ByteArray>>),
    Fixed(Vec<Option<FixedLenByteArray>>),
}

/// The table of a file.
///
/// # Errors
/// The file cannot be opened, is damaged, or has columns that are no plain values.
pub(super) fn table(path: &Path) -> Result<RawTable<'static>, FileError> {
    let file = File::open(path).map_err(FileError::io("read", path))?;
    let name = path.display().to_string();
    let damaged = |why: String| {
        let mut faults = Faults::of(&name);
        let fault = Fault::new("", format!("cannot be read as Parquet: {why}"));
        faults
            .push(fault.expected("a whole Parquet file, not compressed or by Snappy or Zstandard"));
        FileError::from(faults)
    };
    // The library asserts here and there on bytes that no writer writes.
    let read = catch_unwind(AssertUnwindSafe(|| cut(file, &name)));
    match read {
        Ok(Ok(read)) => Ok(read?),
        Ok(Err(error)) => Err(damaged(error.to_string())),
        Err(_) => Err(damaged("its bytes contradict each other".to_owned())),
    }
}

fn cut(file: File, name: &str) -> Result<Result<RawTable<'static>, Faults>, ParquetError> {
    let reader = SerializedFileReader::new(file)?;
    let schema = reader.metadata().file_metadata().schema_descr();
    let columns: Vec<_> = schema.columns().to_vec();
    let mut faults = Faults::of(name);
    let header: Vec<String> = columns.iter().map(|column| column.path().string()).collect();
    for (column, name) in columns.iter().zip(&header) {
        if let Some(found) = strange(column) {
            faults
                .push(Fault::new(name, found).expected("one plain number, text or truth per row"));
        }
    }
    if !faults.is_empty() {
        return Ok(Err(faults));
    }
    let mut rows = Vec::new();
    for group in 0..reader.num_row_groups() {
        take(reader.get_row_group(group)?.as_ref(), &mut rows)?;
    }
    Ok(Ok(RawTable::made(header, rows)))
}

/// What a column is that is no plain value.
fn strange(column: &ColumnDescriptor) -> Option<&'static str> {
    let logical = column.logical_type_ref();
    if column.max_rep_level() > 0 {
        return Some("holds lists");
    }
    match logical {
        Some(LogicalType::Timestamp(_) | LogicalType::Time(_) | LogicalType::Date) => {
            Some("is a date or time of the day; a recording counts seconds")
        }
        Some(LogicalType::Decimal(_)) => Some("holds decimals"),
        _ => None,
    }
}

fn take(group: &dyn RowGroupReader, rows: &mut Vec<StringRecord>) -> Result<(), ParquetError> {
    let count = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
    let mut columns = Vec::with_capacity(group.num_columns());
    for column in 0..group.num_columns() {
        let nullable = group.metadata().column(column).column_descr().max_def_level();
        columns.push(match group.get_column_reader(column)? {
            ColumnReader::DoubleColumnReader(r) => Values::Double(values(r, count, nullable)?),
            ColumnReader::FloatColumnReader(r) => Values::Float(values(r, count, nullable)?),
            ColumnReader::Int64ColumnReader(r) => Values::Long(values(r, count, nullable)?),
            ColumnReader::Int32ColumnReader(r) => Values::Int(values(r, count, nullable)?),
            ColumnReader::BoolColumnReader(r) => Values::Truth(values(r, count, nullable)?),
            ColumnReader::ByteArrayColumnReader(r) => Values::Bytes(values(r, count, nullable)?),
            ColumnReader::FixedLenByteArrayColumnReader(r) => {
                Values::Fixed(values(r, count, nullable)?)
            }
            ColumnReader::Int96ColumnReader(_) => {
                return Err(ParquetError::NYI("columns of 96 bits".to_owned()));
            }
        });
    }
    let (mut cell, mut longest) = (Vec::new(), 0);
    for row in 0..count {
        let mut record = StringRecord::with_capacity(longest, columns.len());
        for column in &columns {
            cell.clear();
            column.write(row, &mut cell);
            record.push_field(&String::from_utf8_lossy(&cell));
        }
        longest = longest.max(record.as_slice().len());
        rows.push(record);
    }
    Ok(())
}

/// The values of a column; `nullable`: the level at which a value is there, 0 where it always is.
fn values<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    count: usize,
    nullable: i16,
) -> Result<Vec<Option<T::T>>, ParquetError> {
    let (mut levels, mut found): (Vec<i16>, Vec<T::T>) = (Vec::new(), Vec::new());
    let mut read = 0;
    while read < count {
        let wanted = (nullable > 0).then_some(&mut levels);
        let (records, ..) = reader.read_records(count - read, wanted, None, &mut found)?;
        if records == 0 {
            return Err(ParquetError::EOF("a column ends before its rows do".to_owned()));
        }
        read += records;
    }
    let mut found = found.into_iter();
    if nullable == 0 {
        return Ok(found.map(Some).collect());
    }
    Ok(levels
        .into_iter()
        .map(|level| if level == nullable { found.next() } else { None })
        .collect())
}

impl Values {
    /// The shortest text that reads back to the same number; nothing for a null.
    fn write(&self, row: usize, cell: &mut Vec<u8>) {
        let mut shortest = |value: f64| cell.write_all(ryu::Buffer::new().format(value).as_bytes());
        // Writing into memory cannot fail.
        let _ = match self {
            Self::Double(all) => at(all, row).map_or(Ok(()), |v| shortest(*v)),
            Self::Float(all) => at(all, row).map_or(Ok(()), |v| shortest(f64::from(*v))),
            Self::Long(all) => at(all, row).map_or(Ok(()), |v| write!(cell, "{v}")),
            Self::Int(all) => at(all, row).map_or(Ok(()), |v| write!(cell, "{v}")),
            Self::Truth(all) => at(all, row).map_or(Ok(()), |v| write!(cell, "{}", u8::from(*v))),
            Self::Bytes(all) => at(all, row).map_or(Ok(()), |v| cell.write_all(v.data())),
            Self::Fixed(all) => at(all, row).map_or(Ok(()), |v| cell.write_all(v.data())),
        };
    }
}

fn at<T>(all: &[Option<T>], row: usize) -> Option<&T> {
    all.get(row).and_then(Option::as_ref)
}

#[cfg(test)]
mod tests;
