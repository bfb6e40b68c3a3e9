//! The shared-memory messages, their versions, their service names, and the life cycle of a domain.
//!
//! Invariants: data is read exactly as it was written, or refused with a
//! message that names both versions. A process that terminates, at any moment, does not stop the other
//! side for more than a second. The transport (iceoryx2) is not visible outside this crate.
//! No physics, no blocking send, no wait without a time limit, no logging.
//!
//! | service | payload | from, to | buffered |
//! | --- | --- | --- | --- |
//! | `/command` | [`Command`] | cell to daemon | the newest |
//! | `/corrected` | [`Corrected`] | daemon to cell | the newest |
//! | `/force` | [`ForceBlock`] | force source to daemon | 64 blocks, then the sender discards and counts |
//! | `/state` | [`RobotState`] | cell to daemon | the newest |
//! | `/horizon` | [`Horizon`] | cell to daemon | the newest |
//! | `/measured` | [`MeasuredPoint`] | instrument to daemon | the newest 64 points |
//! | `/vibration` | [`Verdict`] | daemon to all | the last 8, also for late joiners |
//! | `/spectrum` | [`Spectrum`] | daemon to all, while it is read | the newest 4 |
//! | `/status` | [`Status`] | daemon to all | the last one, also for late joiners |
//! | `/control` | [`Request`], [`Response`] | all to daemon and back | one at a time per client |

mod clock;
mod codes;
mod control;
mod domain;
mod feed;
mod force;
mod horizon;
mod layout;
mod measured;
mod motion;
mod port;
mod robot;
mod sensor;
mod services;
mod spectrum;
mod status;
mod text;
mod verdict_text;
mod vibration;

pub use clock::{monotonic_ns, new_session};
pub use codes::UnknownCode;
pub use control::{Answer, InCut, Operation, PATH_BYTES_MAX, RecorderAction, Request, Response};
pub use domain::{
    Announcement, Cell, Contract, DaemonPorts, DaemonSide, DomainError, JoinError, JoinedEpoch,
    PeerControl, PeerPublisher, PeerSubscriber, RUNTIME_DIR_ENV, Role, RoleClaim, Supervision,
    remove_leftovers,
};
pub use feed::{FeedBounds, FeedReason, FeedState};
pub use force::{FORCE_CHANNELS_MAX, FORCE_SAMPLES_MAX, ForceBlock};
pub use horizon::{Horizon, LeadState};
pub use layout::{Malformed, Payload};
pub use measured::{MeasuredPoint, TrimReason, TrimState};
pub use motion::{Command, Corrected, CorrectionStatus, Reason, WrenchGate};
pub use port::{
    ControlClient, ControlServer, PendingResponse, PortError, Publisher, SendOutcome, Subscriber,
};
pub use robot::RobotState;
pub use sensor::{CHANNEL_NAMES, ForceFault, SensorFault, channel_name};
pub use services::{CONTRACT_HASH, CONTRACT_VERSION, Topic};
pub use spectrum::{SPECTRUM_BINS_MAX, Spectrum};
pub use status::{
    Health, JointBounds, LATENCY_BUCKETS, Mode, ROBOT_BYTES_MAX, RecorderState, Status, WatchState,
    latency_below_ns,
};
pub use text::Text;
pub use vibration::{Advice, Verdict, VibrationClass, VibrationState};

/// Largest number of joints of one robot.
pub const JOINTS_MAX: usize = 16;
