//! Requests of clients to the daemon (`/control`), and the answers.

use iceoryx2::prelude::ZeroCopySend;

use crate::JOINTS_MAX;
use crate::codes::{UnknownCode, codes};
use crate::layout::{Payload, payload, plain_struct};
use crate::text::Text;

/// Maximum length of a path in a request, bytes.
pub const PATH_BYTES_MAX: usize = 256;

plain_struct! {
    /// One request.
    pub struct Request = "trued.Request/4" {
        /// From 1, plus 1 with each request of this sender.
        pub seq: u64,
        /// Identifies this run of the sender.
        pub session: u64,
        /// When it was sent, `CLOCK_MONOTONIC`.
        pub t_ns: u64,
        /// Spindle speed, 1/min, for [`Operation::ProcessState`]; NaN where unknown.
        pub spindle_rpm: f64,
        /// Feed, mm/s, for [`Operation::ProcessState`]; NaN where unknown.
        pub feed_mm_s: f64,
        /// Standard uncertainty of each number of `point_m`, instrument and model together, m, for [`Operation::Measured`].
        pub sigma_m: f64,
        /// Temperature around the robot, °C, for [`Operation::Measured`]; NaN where unknown.
        pub ambient_c: f64,
        /// Measured position of the tool centre point, base frame, m, for [`Operation::Measured`].
        pub point_m: [f64; 3],
        /// The joint positions that were published there, rad or m, for [`Operation::Measured`].
        pub q: [f64; JOINTS_MAX],
        /// Layout version.
        pub layout: u32,
        /// An [`Operation`].
        pub operation: u32,
        /// 1 on, 0 off, for [`Operation::Bypass`] and [`Operation::Arm`]; a [`crate::Mode`], for [`Operation::Mode`]; a [`RecorderAction`], for
        /// [`Operation::Record`].
        pub on: u32,
        /// Teeth of the cutter for [`Operation::ProcessState`]; 0 where unknown.
        pub teeth: u32,
        /// An [`InCut`], for [`Operation::ProcessState`].
        pub in_cut: u32,
        /// Validity of the process state, ms; 0: until the next one.
        pub holds_ms: u32,
        /// Number of joints in `q`, for [`Operation::Measured`].
        pub joints: u32,
        /// 1 where [`Operation::Reload`] may load a model of another robot, or one whose limits the arm exceeds: allowed in shadow mode only.
        pub other_robot: u32,
        /// Direction of approach of each joint, −1 or 1; 0 where unknown, for [`Operation::Measured`].
        pub direction: [i8; JOINTS_MAX],
        /// The model for [`Operation::Reload`], absolute; empty: the one loaded now, read again. The text, for [`Operation::Mark`].
        pub path: Text<PATH_BYTES_MAX>,
    }
}
payload!(Request = "trued.Request/4", layout 4, check |_| Ok(()));

impl Request {
    /// The requested operation.
    ///
    /// # Errors
    /// [`UnknownCode`] where the client is of a later version.
    pub fn operation(&self) -> Result<Operation, UnknownCode> {
        self.operation.try_into()
    }

    /// Whether the tool is in the cut, for [`Operation::ProcessState`].
    ///
    /// # Errors
    /// [`UnknownCode`] where the client is of a later version.
    pub fn in_cut(&self) -> Result<InCut, UnknownCode> {
        self.in_cut.try_into()
    }
}

plain_struct! {
    /// The answer to one request.
    pub struct Response = "trued.Response/1" {
        /// The request's `seq`.
        pub seq: u64,
        /// The request's `session`.
        pub session: u64,
        /// Time of the answer, `CLOCK_MONOTONIC`.
        pub t_ns: u64,
        /// Layout version.
        pub layout: u32,
        /// An [`Answer`].
        pub answer: u32,
        /// What was done, or why the request failed and what was expected.
        pub message: Text<256>,
    }
}
payload!(Response = "trued.Response/1", layout 1, check |_| Ok(()));

impl Response {
    /// The answer to `request`.
    #[must_use]
    pub fn to(request: &Request, answer: Answer, message: &str) -> Self {
        Self {
            seq: request.seq,
            session: request.session,
            t_ns: crate::clock::monotonic_ns(),
            layout: Self::LAYOUT,
            answer: answer.code(),
            message: Text::new(message),
        }
    }

    /// The result.
    ///
    /// # Errors
    /// [`UnknownCode`] where the daemon is of a later version.
    pub fn answer(&self) -> Result<Answer, UnknownCode> {
        self.answer.try_into()
    }
}

codes! {
    /// The requests.
    pub enum Operation {
        /// Answer only.
        Ping = 0 "ping",
        /// Load a model and activate it between two cycles.
        Reload = 1 "reload",
        /// Ramp the correction to zero, or restore it.
        Bypass = 2 "bypass",
        /// Go to shadow mode, or back to the configured one.
        Arm = 3 "arm",
        /// Report the state of the process: spindle speed, teeth, feed, cut.
        ProcessState = 4 "process_state",
        /// Report a measurement of the tool, to check whether the model still holds.
        Measured = 5 "measured",
        /// Change the mode, at most to the one that the configuration allows.
        Mode = 6 "mode",
        /// Write a marker into the recording.
        Mark = 7 "mark",
        /// Start or stop recording, or keep what is recorded.
        Record = 8 "record",
    }
}

codes! {
    /// Action of the recorder.
    pub enum RecorderAction {
        /// Close the recording and stop until the next start.
        Stop = 0 "stop",
        /// Begin a recording.
        Start = 1 "start",
        /// Mark the present recording to be kept: it is exempt from the removal of old files.
        Keep = 2 "keep",
    }
}

codes! {
    /// Whether the tool is in the cut.
    pub enum InCut {
        /// Not stated: the vibration monitor decides by the forces.
        Unknown = 0 "unknown",
        /// Not cutting.
        Air = 1 "air",
        /// Cutting.
        Cut = 2 "cut",
    }
}

codes! {
    /// Result of a request.
    pub enum Answer {
        /// Done.
        Done = 0 "done",
        /// Refused; the message says why.
        Refused = 1 "refused",
        /// The request cannot be read.
        Malformed = 2 "malformed",
        /// The daemon failed while executing it; the message says where.
        Failed = 3 "failed",
    }
}
