//! Writes a recording as a Parquet file: the columns of its CSV, as numbers if the CSV has numbers;
//! missing samples are null.
//!
//! Reading it back gives the same recording, to the bit for SI units. Compression: Snappy. The same recording gives the same bytes.

use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;

use crate::series::Recording;

/// The values of a column; `None` for missing ones.
enum Values {
    Number(Vec<Option<f64>>),
    Whole(Vec<Option<i64>>),
    Text(Vec<Option<ByteArray>>),
}

struct Column {
    name: String,
    values: Values,
}

impl Recording {
    /// The recording as Parquet, in the units of [`Recording::units`].
    ///
    /// # Errors
    /// Two columns have one name, or the library refuses the table.
    pub fn to_parquet(&self) -> Result<Vec<u8>, ParquetError> {
        let columns = columns(self);
        let fields: Result<Vec<_>, _> =
            columns.iter().map(|one| field(one).map(Arc::new)).collect();
        let schema = Type::group_type_builder("recording").with_fields(fields?).build()?;
        let how = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
        let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(how))?;
        let mut rows = writer.next_row_group()?;
        for column in columns {
            match column.values {
                Values::Number(all) => put::<DoubleType>(&mut rows, all)?,
                Values::Whole(all) => put::<Int64Type>(&mut rows, all)?,
                Values::Text(all) => put::<ByteArrayType>(&mut rows, all)?,
            }
        }
        rows.close()?;
        writer.into_inner()
    }
}

fn columns(recording: &Recording) -> Vec<Column> {
    let number = |value: f64| (!value.is_nan()).then_some(value);
    let times = recording.t_s.iter().copied().map(number).collect();
    let mut columns = vec![Column { name: "t_s".to_owned(), values: Values::Number(times) }];
    if recording.has_segments() {
        let values = Values::Whole(recording.segment.iter().copied().map(Some).collect());
        columns.push(Column { name: "segment".to_owned(), values });
    }
    for column in recording.file_columns() {
        let all = (0..recording.len()).map(|row| number(column.value(row))).collect();
        columns.push(Column { name: column.name, values: Values::Number(all) });
    }
    for (name, cells) in &recording.other {
        columns.push(Column { name: name.clone(), values: typed(cells, recording.len()) });
    }
    columns
}

/// Cells of a foreign column as numbers, if each is the text of its number; otherwise as texts.
fn typed(cells: &[String], rows: usize) -> Values {
    let cell = |row: usize| cells.get(row).map_or("", String::as_str);
    let cells = || (0..rows).map(cell);
    whole(cells()).or_else(|| numbers(cells())).unwrap_or_else(|| {
        let text = |cell: &str| (!cell.is_empty()).then(|| ByteArray::from(cell));
        Values::Text(cells().map(text).collect())
    })
}

fn whole<'t>(mut cells: impl Iterator<Item = &'t str>) -> Option<Values> {
    let value = |cell: &str| match cell {
        "" => Some(None),
        _ => cell.parse::<i64>().ok().filter(|value| value.to_string() == cell).map(Some),
    };
    let mut all = Vec::new();
    cells.try_for_each(|cell| value(cell).map(|value| all.push(value)))?;
    Some(Values::Whole(all))
}

fn numbers<'t>(mut cells: impl Iterator<Item = &'t str>) -> Option<Values> {
    let value = |cell: &str| match cell {
        "" => Some(None),
        _ => cell.parse::<f64>().ok().filter(|value| format!("{value:?}") == cell).map(Some),
    };
    let mut all = Vec::new();
    cells.try_for_each(|cell| value(cell).map(|value| all.push(value)))?;
    let is_taken = |value: &Option<f64>| value.is_none_or(|value| !value.is_nan());
    all.iter().all(is_taken).then_some(Values::Number(all))
}

fn field(column: &Column) -> Result<Type, ParquetError> {
    let (physical, logical) = match column.values {
        Values::Number(_) => (Physical::DOUBLE, None),
        Values::Whole(_) => (Physical::INT64, None),
        Values::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
    };
    Type::primitive_type_builder(&column.name, physical)
        .with_repetition(Repetition::OPTIONAL)
        .with_logical_type(logical)
        .build()
}

/// Writes the next column of a group.
fn put<T: DataType>(
    rows: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    values: Vec<Option<T::T>>,
) -> Result<(), ParquetError> {
    let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
    let taken: Vec<T::T> = values.into_iter().flatten().collect();
    let next = rows.next_column()?;
    let mut column = next.ok_or_else(|| ParquetError::General("no such column".to_owned()))?;
    column.typed::<T>().write_batch(&taken, Some(&levels), None)?;
    column.close()
}
