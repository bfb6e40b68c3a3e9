//! Messages of a cell as JSON: one numbered series of summaries, events and states of health.
//!
//! Codes are written as words, units are part of the keys. Unknown numbers are `null`. Keys may be added; readers must ignore unknown ones.

use live::report::Report;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use crate::acceptance::Reason;

/// Name of the format of [`Message`].
pub const SCHEMA: &str = "trued.plant/1";

/// A message of a cell.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Message {
    /// `trued.plant/1`.
    pub schema: &'static str,
    /// Names the series of numbers; another one begins where the folder of the spool was lost, or its newest file was damaged.
    pub stream: u64,
    /// Number of the message in its series, from 1. A gap is a message that was missed.
    pub number: u64,
    /// When it was made: time since 1970-01-01 UTC by the clock of the cell's machine, ms.
    pub unix_ms: u64,
    /// Group of cells, for example the line.
    pub group: String,
    /// The cell.
    pub cell: String,
    /// Kind and content.
    #[serde(flatten)]
    pub content: Content,
}

/// Content of a message.
#[derive(Debug, Clone, Serialize, JsonSchema)]
#[serde(tag = "kind", content = "body", rename_all = "snake_case")]
pub enum Content {
    /// The cell over a period.
    Summary(Box<Summary>),
    /// Something happened.
    Event(Event),
    /// The daemon's health changed.
    Health(CellHealth),
}

impl Content {
    /// The word that ends the key.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Summary(_) => Kind::Summary,
            Self::Event(_) => Kind::Event,
            Self::Health(_) => Kind::Health,
        }
    }
}

/// Kinds of messages; each has a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// [`Summary`].
    Summary,
    /// [`Event`].
    Event,
    /// [`CellHealth`].
    Health,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Summary, Self::Event, Self::Health];

    /// As it is written in keys.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Summary => "summary",
            Self::Event => "event",
            Self::Health => "health",
        }
    }
}

/// The cell over a period.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Summary {
    /// Length of the period, s.
    pub period_s: f64,
    /// Version of trued-plant.
    pub bridge_version: String,
    /// Version of the daemon; `null` where none has announced itself.
    pub daemon_version: Option<String>,
    /// Why the daemon does not respond; `null` if it does.
    pub away: Option<String>,
    /// Present alarms.
    pub alarms: Vec<Alarm>,
    /// When this bridge first saw the present model (its hash) in this cell, ms since 1970-01-01 UTC; `null` before the first status.
    pub model_since_unix_ms: Option<u64>,
    /// Statistics of the correction.
    pub correction: CorrectionStatistics,
    /// Messages kept for subscribers that missed them.
    pub spool: SpoolState,
    /// The last status, as of `trued status --json -` (`trued.status/1`); `null` before the first.
    pub status: Option<Report>,
}

/// Statistics of the allowed correction over a period, from the daemon's statuses (25 per second).
#[derive(Debug, Clone, PartialEq, Default, Serialize, JsonSchema)]
pub struct CorrectionStatistics {
    /// Statuses that they are of.
    pub statuses: u64,
    /// Root mean square for each joint, rad or m.
    pub rms: Vec<f64>,
    /// Largest magnitude for each joint, rad or m.
    pub largest: Vec<f64>,
    /// Largest magnitude of any joint over its limit, 0 to 1.
    pub largest_share: f64,
}

/// What the spool holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub struct SpoolState {
    /// Number of the oldest message that can be requested; older ones were removed to keep the budget.
    pub first: u64,
    /// Size on disk, bytes.
    pub bytes: u64,
    /// Largest size, bytes.
    pub budget_bytes: u64,
}

/// The daemon's health.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct CellHealth {
    /// Health (`running`, `degraded`, …); `null` before the first status.
    pub health: Option<&'static str>,
    /// Mode (`shadow`, `limited`, `full`); `null` before the first status.
    pub mode: Option<&'static str>,
    /// Whether the cell is bypassed.
    pub bypassed: bool,
    /// Why the daemon does not respond; `null` if it does.
    pub away: Option<String>,
    /// The daemon's message for the operator, or why it does not respond.
    pub message: String,
}

/// A condition that needs attention.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Alarm {
    /// The daemon does not respond.
    DaemonAway,
    /// Health `fault`: nothing is corrected.
    Fault,
    /// Health `degraded`; the message names the restriction.
    Degraded,
    /// A vibration is in state `alarm` or `confirmed`.
    Vibration,
    /// Measurements of the tool contradict the model.
    ModelContradicted,
    /// The force stream or a channel has a fault.
    ForceFault,
    /// The recorder drops records or cannot write.
    Recorder,
}

impl Alarm {
    /// As it is written.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::DaemonAway => "daemon_away",
            Self::Fault => "fault",
            Self::Degraded => "degraded",
            Self::Vibration => "vibration",
            Self::ModelContradicted => "model_contradicted",
            Self::ForceFault => "force_fault",
            Self::Recorder => "recorder",
        }
    }
}

/// A change in the cell.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// The bridge started.
    BridgeStarted {
        /// Its version.
        version: String,
        /// Bytes of the spool that were not written whole and were removed.
        torn_bytes: u64,
    },
    /// The daemon responds.
    DaemonConnected {
        /// Its process.
        pid: u32,
    },
    /// The daemon no longer responds.
    DaemonLost {
        /// Reason and remedy.
        why: String,
    },
    /// Another model is in use.
    ModelChanged {
        /// Hash of the model before.
        from: String,
        /// Hash of the model now.
        to: String,
    },
    /// An offered model was written into the folder of the cell's owner; the daemon was not asked.
    ModelStaged {
        /// SHA-256 of the model file.
        sha256: String,
        /// Counter of the offer.
        counter: u64,
        /// The file.
        path: String,
    },
    /// An offered model was written, and the daemon loaded it.
    ModelLoaded {
        /// SHA-256 of the model file.
        sha256: String,
        /// Counter of the offer.
        counter: u64,
        /// The file.
        path: String,
        /// The daemon's answer.
        message: String,
    },
    /// An offered model was refused; nothing changed.
    ModelRefused {
        /// SHA-256 of the bytes that came.
        sha256: String,
        /// Why.
        reason: Reason,
        /// In words, with what to do.
        message: String,
    },
    /// An alarm began.
    AlarmRaised {
        /// Which.
        alarm: Alarm,
    },
    /// An alarm ended.
    AlarmCleared {
        /// Which.
        alarm: Alarm,
    },
    /// A vibration changed its state or class.
    Vibration {
        /// Number of the vibration, from its first warning to its end.
        vibration: u64,
        /// State: `warn`, `alarm`, `confirmed`, `over`.
        state: &'static str,
        /// Class.
        class: &'static str,
        /// Its frequency, Hz.
        #[serde(rename = "frequency_Hz")]
        frequency_hz: f64,
        /// Its amplitude, N or Nm by the axis.
        amplitude: f64,
        /// Channel of the force sensor.
        axis: &'static str,
        /// Description with the advice.
        sentence: String,
    },
}

/// Kept messages from one number on, as an answer to a query.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub struct History {
    /// Names the series of numbers that the messages below belong to.
    pub stream: u64,
    /// Number of the oldest message that is kept.
    pub first: u64,
    /// Number of the first message below.
    pub from: u64,
    /// Number of the next message that will be made: the series is complete when `from` plus the messages reaches it.
    pub next: u64,
    /// The messages, in order, without gaps, of one stream.
    #[schemars(with = "Vec<Message>")]
    pub messages: Vec<Box<RawValue>>,
}
