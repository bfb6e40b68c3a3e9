//! Errors of a bench: where, what, what was expected, what to do.

use std::io;
use std::path::PathBuf;

use daemon::realtime::Refused;
use trued_client::ConnectError;

/// A bench that was not run, or not to its end.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// Too few cores.
    #[error(
        "{what}: the bench wants two cores of its own, this process may use {allowed:?}; give it two, or name them with --cores"
    )]
    Cores {
        /// What was asked.
        what: String,
        /// Cores that this process may run on.
        allowed: Vec<usize>,
    },
    /// Scheduling, pinning or memory that was asked for and refused: nothing is measured without.
    #[error(
        "what was asked for was refused, so nothing is measured: {0}; or ask for --policy other"
    )]
    Refused(#[from] Refused),
    /// A running cell is not served as was asked.
    #[error(
        "the daemon of cell `{cell}` (process {pid}) does not run its cycle under SCHED_FIFO, so nothing is measured; start it with \
         `[realtime] policy = \"fifo\"`, or ask for --policy other"
    )]
    OfCell {
        /// The cell.
        cell: String,
        /// Its daemon.
        pid: u32,
    },
    /// The daemon of the bench did not start.
    #[error("the daemon did not start ({status}); it said: {said}")]
    Daemon {
        /// How it ended.
        status: String,
        /// Its words.
        said: String,
    },
    /// No connection to the daemon.
    #[error(transparent)]
    Connect(#[from] ConnectError),
    /// A process beside the bench ended, or does not answer.
    #[error("the bench's own process `{part}` failed: {why}; what it said is above")]
    Part {
        /// Which.
        part: &'static str,
        /// Why.
        why: String,
    },
    /// The daemon answers nothing.
    #[error(
        "no answer from the daemon within {limit_ms} ms in part `{stage}`; is it stopped, or its core taken by another real-time thread?"
    )]
    Silent {
        /// Where.
        stage: &'static str,
        /// How long was waited, ms.
        limit_ms: u64,
    },
    /// The transport that is compared with could not be set up.
    #[error("plain iceoryx2: {0}; is shared memory full?")]
    Transport(String),
    /// A thread that measures ended.
    #[error("a measuring thread of part `{0}` ended early; this is a fault of the bench")]
    Thread(&'static str),
    /// The system.
    #[error("could not {step} {}: {source}", path.display())]
    Io {
        /// What was tried.
        step: &'static str,
        /// On what.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// Someone asked to stop.
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
