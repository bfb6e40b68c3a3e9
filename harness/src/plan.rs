//! Request of a bench. Never how it is measured.

use std::path::PathBuf;
use std::process::Command;

use serde::Serialize;

/// How the measuring threads and the daemon's cycle are scheduled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Policy {
    /// `SCHED_FIFO`, pinned, memory locked.
    Fifo,
    /// The ordinary scheduler, pinned.
    Other,
}

impl Policy {
    /// The word for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Fifo => "fifo",
            Self::Other => "other",
        }
    }
}

/// How the daemon waits for the next command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Wait {
    /// It looks without sleeping.
    Spin,
    /// It sleeps to absolute times and looks around the time a command is due.
    Sleep,
    /// As its own configuration says: a running cell's, which is not told.
    Own,
}

impl Wait {
    /// The word for it; of those that can be asked for, as in a cell's configuration.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Spin => "spin",
            Self::Sleep => "sleep",
            Self::Own => "its own way",
        }
    }
}

/// A kind of load that the bench makes itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Load {
    /// Copies over more memory than any cache holds.
    Memory,
    /// Writes all over a buffer of the size of the last cache.
    Cache,
    /// Writes a file and forces it to the disk.
    Disk,
    /// Streams over TCP on the loopback.
    Network,
}

impl Load {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Memory, Self::Cache, Self::Disk, Self::Network];

    /// The word for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Memory => "memory",
            Self::Cache => "cache",
            Self::Disk => "disk",
            Self::Network => "network",
        }
    }

    /// The kind of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|load| load.name() == name)
    }
}

/// One part of a bench.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Round trips one after the other, beside all that it is compared with, in chunks.
    Flat,
    /// The same woken by the kernel instead of polled.
    Woken,
    /// Round trips at given rates, beside an empty cycle.
    Paced,
    /// Force blocks in, verdicts out.
    Force,
    /// From the start of a daemon to its first corrected target.
    Start,
    /// Models swapped under a running path.
    Swap,
    /// What a correction costs by joints, effects and cells.
    Cost,
}

impl Stage {
    /// All, in the order of running.
    pub const ALL: [Self; 7] =
        [Self::Flat, Self::Woken, Self::Paced, Self::Force, Self::Start, Self::Swap, Self::Cost];

    /// The word for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Flat => "flat",
            Self::Woken => "woken",
            Self::Paced => "paced",
            Self::Force => "force",
            Self::Start => "start",
            Self::Swap => "swap",
            Self::Cost => "cost",
        }
    }

    /// The part of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|stage| stage.name() == name)
    }
}

/// How other processes of this very program are started: the harness knows no command line but what stands here.
pub trait Programs: Sync {
    /// The daemon for these configurations, one a cell; it ends with its parent and says `ready` on standard output.
    ///
    /// # Errors
    /// Where this program cannot be found.
    fn daemon(&self, configs: &[PathBuf]) -> std::io::Result<Command>;

    /// A part of the bench in a process of its own: what [`crate::part`] is given.
    ///
    /// # Errors
    /// Where this program cannot be found.
    fn part(&self, words: &str) -> std::io::Result<Command>;
}

/// What is asked.
#[derive(Debug, Clone)]
pub struct Plan {
    /// A running cell instead of a daemon of the bench's own.
    pub cell: Option<String>,
    /// Two texts of models of one robot: the one measured with, and one to swap with.
    pub models: [String; 2],
    /// What the model measured with is called.
    pub model: &'static str,
    /// The client's core and the daemon's; chosen where not told.
    pub cores: Option<[usize; 2]>,
    /// Policies, one after the other.
    pub policies: Vec<Policy>,
    /// Priority of the daemon's cycle and of what it is compared with.
    pub priority: u8,
    /// Loads, one after the other; an empty one is idle.
    pub loads: Vec<Vec<Load>>,
    /// How the daemon waits in the paced part, one after the other.
    pub waits: Vec<Wait>,
    /// Commands per second in the paced part, one after the other.
    pub rates_hz: Vec<u32>,
    /// The parts to run.
    pub stages: Vec<Stage>,
    /// How long each part takes, for each policy, load, wait and rate, s.
    pub seconds: f64,
    /// Starts of a daemon, and swaps of a model, that are measured.
    pub repeats: u32,
    /// Where the load on the disk writes.
    pub scratch: PathBuf,
}

impl Plan {
    /// Whether a part is asked for.
    #[must_use]
    pub fn has(&self, stage: Stage) -> bool {
        self.stages.contains(&stage)
    }
}
