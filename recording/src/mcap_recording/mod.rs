//! Recordings of the daemon, as MCAP files for common viewers.
//!
//! Contract: encoding `cdr` with `ros2msg` definitions of our own flat messages; chunks without
//! compression, each written completely: a kill loses at most the last chunk, earlier data
//! remains readable, and [`repair`] adds the index. A damaged chunk is skipped and named ([`Damage`]). Log times are wall-clock times; messages
//! also contain monotonic times. No threads here; called by the daemon's recorder thread. Unlike all other
//! files, a recording is written directly under its final name, because it must survive its writer.

pub(crate) mod cdr;
mod clock;
mod convert;
mod info;
mod read;
mod records;
mod repair;
mod scan;
#[cfg(test)]
mod tests;
mod write;

use std::path::PathBuf;

pub use cdr::InlineVec;
pub use clock::{Clocks, Utc};
pub use convert::{Conversion, OTHER_CLOCK_S, Run, convert};
pub use info::{ChannelInfo, FileState, Info, ModelInfo, info};
pub use read::{Contents, ModelChange, read, read_bytes};
pub use records::{
    CycleRecord, ForceRecord, JOINTS_MAX, LogRecord, Record, StatusRecord, Topic, VerdictRecord,
};
pub use repair::{Loss, Repair, UNFINISHED, is_closed, original_path, repair};
pub use scan::{Damage, messages_lost};
pub use write::McapWriter;

use physics::JointKind;

/// Properties of the run as a whole.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Header {
    /// Name of the cell.
    pub cell: String,
    /// Version of the program that wrote it.
    pub version: String,
    /// Hash of the model, see [`crate::model::RobotModel::hash`].
    pub model_hash: u64,
    /// The manufacturer's designation of the robot, see [`crate::model::RobotEntry`].
    pub robot: String,
    /// The robot's manufacturer; empty if the model does not state it.
    pub robot_maker: String,
    /// The robot's type; empty if the model does not state it.
    pub robot_type: String,
    /// The robot's serial number; empty if the model does not state it.
    pub robot_serial: String,
    /// Number of the model since the daemon's start, stated in each cycle. 0 in files of versions
    /// that did not write it.
    pub model_epoch: u64,
    /// Hash of the nominal geometry, see [`crate::model::Identity::geometry_hash`]; 0 in files of versions that did not write it.
    pub geometry_hash: u64,
    /// The model as TOML.
    pub model: String,
    /// The configuration as TOML.
    pub config: String,
    /// Kind of each joint.
    pub joints: Vec<JointKind>,
    /// Names of the status codes, ordered by code.
    pub status_words: Vec<String>,
    /// Names of the reason codes, ordered by code.
    pub reason_words: Vec<String>,
}

/// Why an MCAP recording could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum McapRecordingError {
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The container could not be written further.
    #[error("cannot write {}: {source}; the black box ends here", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The container's reason.
        source: Box<mcap::McapError>,
    },
    /// Another process writes the file.
    #[error("{}: a process is writing it; stop that cell's daemon first, or wait until a newer file is begun", path.display())]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// The file is not an MCAP recording of the daemon.
    #[error("{name}: {what}, expected an MCAP file that the daemon recorded")]
    NotOurs {
        /// The file.
        name: String,
        /// What was found.
        what: String,
    },
}
