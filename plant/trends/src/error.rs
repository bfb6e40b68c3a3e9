//! What can be wrong with the results that are given: where, what, what was expected, what to do.

use std::path::PathBuf;

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum TrendsError {
    /// A folder cannot be read.
    #[error("{}: {why}; expected a folder of results of `trued diagnose --batch`", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What the system said.
        why: std::io::Error,
    },
    /// A folder holds no result.
    #[error("{}: no file `*.parquet`; write results with `trued diagnose --batch MANIFEST --out {}`", folder.display(), folder.display())]
    Empty {
        /// The folder.
        folder: PathBuf,
    },
    /// A table without a column that is needed.
    #[error(
        "{file}: column `{column}` {what}; expected results of the format trued.batch-result/1: keep other Parquet files in another folder"
    )]
    Column {
        /// Where.
        file: String,
        /// The column.
        column: &'static str,
        /// What is wrong with it.
        what: String,
    },
    /// A file that is no Parquet, or torn.
    #[error(
        "{file}: cannot be read as Parquet: {why}; remove the file and run `trued diagnose --batch … --resume`, which writes it again"
    )]
    Torn {
        /// The file.
        file: String,
        /// What the library said.
        why: String,
    },
    /// A query failed.
    #[error("the query `{query}` failed: {why}; please report it")]
    Query {
        /// Which.
        query: &'static str,
        /// What the library said.
        why: String,
    },
    /// A recording has two results.
    #[error(
        "robot {robot}: {files} of {recorded_at} was diagnosed twice (results {first} and {second}); the model or the version of trued differs: keep the results \
         of one model and version in a folder, and give that"
    )]
    Twice {
        /// Robot.
        robot: String,
        /// Files of the recording.
        files: String,
        /// When it was recorded.
        recorded_at: String,
        /// Key of one result.
        first: String,
        /// Key of the other.
        second: String,
    },
    /// No recording with a time.
    #[error(
        "none of {recordings} recordings has a time; state `recorded_at` in the manifest and diagnose again"
    )]
    NoTime {
        /// How many were read.
        recordings: usize,
    },
}
