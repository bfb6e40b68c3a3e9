//! Mappings: conversion of tables of other programs to recordings.
//!
//! Format: docs/reference/mapping.md (`trued.mapping/1`). A valid mapping names only existing
//! recording columns, with matching units; whether the source columns exist is checked with the
//! file.

mod apply;
mod orientation;
mod read;
#[cfg(test)]
mod tests;

use orientation::Orientation;
use std::path::{Path, PathBuf};

use crate::faults::Faults;
use crate::files::{FileError, read_text};
use crate::series::{Dialect, RecordingMetadata, TimeFormat};
use crate::unit::Unit;

/// Name of the format.
pub(crate) const SCHEMA: &str = "trued.mapping/1";

/// How a foreign table is to be read.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapping {
    pub(crate) dialect: Dialect,
    pub(crate) about: Option<RecordingMetadata>,
    /// `None`: the header has the column names of a recording.
    columns: Option<Columns>,
    keep: Vec<(String, Vec<String>)>,
    drop_repeated: bool,
}

/// The mapped columns.
#[derive(Debug, Clone, Default, PartialEq)]
struct Columns {
    named: Vec<MappedColumn>,
    orientation: Option<Orientation>,
}

/// One column of the recording and its source.
#[derive(Debug, Clone, PartialEq)]
struct MappedColumn {
    /// Name in the recording, with its unit.
    name: String,
    from: Source,
    /// Unit of the source, where it differs from that of the name.
    unit: Option<Unit>,
    /// Value = `scale` · source + `offset`, in the unit of the name; the scale includes the sign.
    scale: f64,
    offset: f64,
}

/// Source of a column's values.
#[derive(Debug, Clone, PartialEq)]
enum Source {
    /// A source column, by name, or by its number without a header.
    Column(String),
    /// Source columns that together hold a time: numbers or ISO 8601 unless stated.
    Times(Vec<String>, Option<TimeFormat>),
    /// Source columns whose different texts, or combinations of them, are numbered in order of
    /// appearance.
    Labels(Vec<String>),
    /// A source column whose texts are replaced by these numbers.
    Numbers(String, Vec<(String, f64)>),
    /// Source columns that are added.
    Sum(Vec<String>),
    /// The same value in each row.
    Constant(f64),
    /// The row's number times this factor.
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

/// Path of a recording's mapping: `NAME.mapping.toml` in the same folder.
#[must_use]
pub fn mapping_path(recording: &Path) -> PathBuf {
    recording.with_extension("mapping.toml")
}
