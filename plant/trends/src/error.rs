//! Errors in the given results: where, what, what is expected, what to do.

use std::path::PathBuf;

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum TrendsError {
    /// A folder cannot be read.
    #[error("{}: {why}; expected a folder of results of `trued diagnose --batch`", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Message of the system.
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
    /// A file is not Parquet, or incomplete.
    #[error(
        "{file}: cannot be read as Parquet: {why}; remove the file and run `trued diagnose --batch … --resume`, which writes it again"
    )]
    NotParquet {
        /// The file.
        file: String,
        /// Message of the library.
        why: String,
    },
    /// A name without a file that can be read.
    #[error("{}: {what}; expected a result of `trued diagnose --batch`: remove it, or give it another name", file.display())]
    NoFile {
        /// Where.
        file: PathBuf,
        /// What is there.
        what: String,
    },
    /// A query failed.
    #[error("the query `{query}` failed: {why}; please report it")]
    Query {
        /// Which.
        query: &'static str,
        /// Message of the library.
        why: String,
    },
    /// A recording has two results.
    #[error(
        "robot {robot}: {files} of {recorded_at} was diagnosed twice (results {first} and {second}); the files' content, the model, an option or the version of trued differs: keep the \
         results of one state in a folder, and give that"
    )]
    DiagnosedTwice {
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
    /// All recordings have one time.
    #[error(
        "all {recordings} recordings have one and the same time ({day}): nothing can be said about growth; state the time of each as `recorded_at` in the manifest and \
         diagnose again"
    )]
    OneTime {
        /// How many.
        recordings: usize,
        /// Their day.
        day: String,
    },
}
