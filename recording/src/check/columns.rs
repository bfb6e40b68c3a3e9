//! The first rows of a recording as understood: names with units, source columns, values in degrees and millimetres.

use serde::Serialize;

use crate::series::{Channel, Recording};

/// Number of rows shown.
const ROWS: usize = 3;
/// Significant digits of the values shown.
const DIGITS: usize = 9;

/// A column as trued understands it.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Column {
    /// Its name, with the unit.
    pub name: String,
    /// The column's name in the file; `None` if no column is its source.
    pub from: Option<String>,
    /// Its first values, rounded for display; `None` for a missing sample.
    pub first: Vec<Option<f64>>,
}

/// The columns of a recording, time first.
pub(super) fn of(recording: &Recording) -> Vec<Column> {
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

fn rounded(value: f64) -> f64 {
    format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value)
}
