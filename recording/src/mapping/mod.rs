//! Mappings: how the table of another program becomes a recording.
//!
//! Contract: docs/reference/mapping.md (`trued.mapping/1`). A mapping that was read names only existing recording
//! columns, with matching units; whether the source columns exist is checked with the file.

mod apply;
mod orientation;
mod read;
#[cfg(test)]
mod tests;

use orientation::Orientation;
use std::path::{Path, PathBuf};

use crate::faults::Faults;
use crate::files::{FileError, read_text};
use crate::series::{About, Clock, Dialect};
use crate::unit::Unit;

/// Name of the format.
pub(crate) const SCHEMA: &str = "trued.mapping/1";

/// How a foreign table is to be read.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapping {
    pub(crate) dialect: Dialect,
    pub(crate) about: Option<About>,
    /// None: the names in the header are ours.
    columns: Option<Columns>,
    keep: Vec<(String, Vec<String>)>,
    drop_repeated: bool,
}

/// What becomes columns of ours.
#[derive(Debug, Clone, Default, PartialEq)]
struct Columns {
    named: Vec<MappedColumn>,
    orientation: Option<Orientation>,
}

/// One column of ours and where it comes from.
#[derive(Debug, Clone, PartialEq)]
struct MappedColumn {
    /// Our name, with our unit.
    name: String,
    from: Source,
    /// Their unit, where it differs from that of our name.
    unit: Option<Unit>,
    /// Ours = `scale` · theirs + `offset`, in the unit of our name; the sign is in the scale.
    scale: f64,
    offset: f64,
}

/// Where the values of a column come from.
#[derive(Debug, Clone, PartialEq)]
enum Source {
    /// A column of theirs, by name, or by its number where there is no header.
    Column(String),
    /// Columns of theirs that hold a time, side by side: numbers or ISO 8601 unless stated.
    Times(Vec<String>, Option<Clock>),
    /// Columns of theirs whose different texts, or combinations of them, are numbered in the order in which they appear.
    Labels(Vec<String>),
    /// A column of theirs whose texts stand for these numbers.
    Numbers(String, Vec<(String, f64)>),
    /// Columns of theirs that are added.
    Sum(Vec<String>),
    /// The same value in each row.
    Constant(f64),
    /// The row's number times this.
    Row(f64),
}

impl Mapping {
    /// Reads a mapping.
    ///
    /// # Errors
    /// The file cannot be read, or all its faults.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Ok(Self::parse(&path.display().to_string(), &read_text(path)?)?)
    }

    /// Reads a mapping from a text.
    ///
    /// # Errors
    /// All faults of the text.
    pub fn parse(name: &str, text: &str) -> Result<Self, Faults> {
        read::parse(name, text)
    }
}

/// The mapping that belongs to a recording: `NAME.mapping.toml` beside it.
#[must_use]
pub fn mapping_path(recording: &Path) -> PathBuf {
    recording.with_extension("mapping.toml")
}
