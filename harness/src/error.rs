//! Errors of a bench: place, cause, expectation, remedy.

use std::io;
use std::path::PathBuf;

use daemon::realtime::RealtimeRefused;
use trued_client::ConnectError;

/// Why a bench was not run, or not to its end.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// Too few cores.
    #[error(
        "{what}: the benchmark needs two cores, this process may use {allowed:?}; allow two, or set them with --cores"
    )]
    Cores {
        /// The option.
        what: String,
        /// Cores that this process may run on.
        allowed: Vec<usize>,
    },
    /// Scheduling, pinning or memory locking was refused: nothing is measured without.
    #[error("the requested policy was denied, so nothing is measured: {0}; or use --policy other")]
    Refused(#[from] RealtimeRefused),
    /// The daemon of a running cell does not have the requested policy.
    #[error(
        "the daemon of cell `{cell}` (process {pid}) does not run its cycle under SCHED_FIFO, so nothing is measured; start it with \
         `[realtime] policy = \"fifo\"`, or use --policy other"
    )]
    OfCell {
        /// The cell.
        cell: String,
        /// Its daemon.
        pid: u32,
    },
    /// The daemon of the bench did not start.
    #[error("the daemon did not start ({status}); its log: {said}")]
    Daemon {
        /// How it ended.
        status: String,
        /// Its output.
        said: String,
    },
    /// No connection to the daemon.
    #[error(transparent)]
    Connect(#[from] ConnectError),
    /// A helper process ended, or does not answer.
    #[error("the benchmark process `{part}` failed: {why}; see its output above")]
    Part {
        /// Its name.
        part: &'static str,
        /// Why.
        why: String,
    },
    /// The daemon does not answer.
    #[error(
        "no answer from the daemon within {limit_ms} ms in part `{stage}`; check whether it is stopped or another real-time thread uses its core"
    )]
    Silent {
        /// The part of the bench.
        stage: &'static str,
        /// Time limit, ms.
        limit_ms: u64,
    },
    /// A reference transport could not be set up.
    #[error("plain iceoryx2: {0}; check whether shared memory is full")]
    Transport(String),
    /// A measuring thread ended.
    #[error("a measuring thread of part `{0}` ended early; this is a bug of the benchmark")]
    Thread(&'static str),
    /// An error of the system.
    #[error("could not {step} {}: {source}", path.display())]
    Io {
        /// The operation.
        step: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Interrupted on request.
    #[error("interrupted")]
    Interrupted,
}

impl BenchError {
    pub(crate) fn io(step: &'static str, path: impl Into<PathBuf>, source: io::Error) -> Self {
        Self::Io { step, path: path.into(), source }
    }

    pub(crate) fn part(part: &'static str, why: impl Into<String>) -> Self {
        Self::Part { part, why: why.into() }
    }
}
