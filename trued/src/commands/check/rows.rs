//! The first rows of a recording as understood: names with units, source columns, values in degrees and millimetres.

use std::path::{Path, PathBuf};

use recording::series::{Channel, Recording};
use report::TextTable;
use serde::Serialize;

use crate::table::on_stdout;

/// So many rows are shown.
const ROWS: usize = 3;
/// Significant digits of a value that is shown.
const DIGITS: usize = 9;

/// A column as trued understands it.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Column {
    /// Its name, with the unit.
    name: String,
    /// The column's name in the file; `None` if no column is its source.
    from: Option<String>,
    /// Its first values, rounded for display; `None` for a missing sample.
    first: Vec<Option<f64>>,
}

/// The columns of a recording, time first.
pub(super) fn columns(recording: &Recording) -> Vec<Column> {
    let number = |value: f64| (!value.is_nan()).then(|| rounded(value));
    // Times that count from 1970 need all their digits.
    let first = recording.t_s.iter().take(ROWS).copied().map(Some).collect();
    let mut columns = vec![Column { name: "t_s".to_owned(), from: None, first }];
    columns.extend(recording.channels().map(|channel: Channel| {
        let (name, values) = recording.first_values(channel, ROWS);
        let from = recording.name_in_file(channel).map(str::to_owned);
        Column { name, from, first: values.into_iter().map(number).collect() }
    }));
    columns
}

/// A table of the columns, one line each.
pub(super) fn table(columns: &[Column]) -> String {
    let rows = columns.iter().map(|column| column.first.len()).max().unwrap_or(0);
    let heads = ["column", "from"].map(str::to_owned).into_iter();
    let mut table = TextTable::new(heads.chain((1..=rows).map(|row| format!("row {row}"))));
    for column in columns {
        let from = column.from.clone().unwrap_or_default();
        let shown = |value: &Option<f64>| value.map_or(String::new(), |value| value.to_string());
        let values = column.first.iter().map(shown);
        table = table.row([column.name.clone(), from].into_iter().chain(values));
    }
    on_stdout(&table)
}

fn rounded(value: f64) -> f64 {
    format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value)
}

/// The recording that belongs to a mapping: `NAME.csv` or `NAME.parquet` for `NAME.mapping.toml`.
pub(super) fn recording_of(mapping: &Path) -> Option<PathBuf> {
    let name = mapping.file_name()?.to_str()?.strip_suffix(".mapping.toml")?;
    let beside =
        ["csv", "parquet"].map(|ending| mapping.with_file_name(format!("{name}.{ending}")));
    beside.into_iter().find(|path| path.is_file())
}
