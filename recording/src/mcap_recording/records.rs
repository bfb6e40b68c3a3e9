//! Messages of an MCAP recording: flat records, each with its `ros2msg` definition.
//!
//! Contract: SI units, named in the fields. Positions of prismatic joints are m, torques N. An empty
//! list means unknown. Codes of `status` and `reason` are those of the shared-memory messages; their words
//! are listed in the definition. Fields of later versions are at the end of a message: older files lack them.

use super::cdr::{CdrReader, CdrWriter, Field, InlineVec};

/// At most this many joints.
pub const JOINTS_MAX: usize = 16;

/// A record with its topic, its message name and its definition.
pub(crate) trait Message: Sized {
    const TOPIC: &'static str;
    const NAME: &'static str;
    fn definition() -> String;
    fn put(&self, out: &mut CdrWriter);
    fn get(from: &mut CdrReader<'_>) -> Option<Self>;
    /// Time of the event, `CLOCK_MONOTONIC`, ns.
    fn stamp_ns(&self) -> u64;
}

macro_rules! message {
    (
        $(#[$meta:meta])* $name:ident, $topic:literal, $message:literal,
        stamp $stamp:ident,
        { $($(#[$field_meta:meta])* $field:ident: $type:ty,)+ }
        $(later { $($(#[$later_meta:meta])* $later:ident: $later_type:ty,)+ })?
    ) => {
        $(#[$meta])*
        pub struct $name {
            $($(#[$field_meta])* pub $field: $type,)+
            $($($(#[$later_meta])* pub $later: $later_type,)+)?
        }

        impl Message for $name {
            const TOPIC: &'static str = $topic;
            const NAME: &'static str = $message;
            fn definition() -> String {
                let mut text = String::new();
                $(
                    text.push_str(<$type as Field>::TYPE);
                    text.push(' ');
                    text.push_str(stringify!($field));
                    text.push('\n');
                )+
                $($(
                    text.push_str(<$later_type as Field>::TYPE);
                    text.push(' ');
                    text.push_str(stringify!($later));
                    text.push('\n');
                )+)?
                text
            }
            fn put(&self, out: &mut CdrWriter) {
                $(self.$field.put(out);)+
                $($(self.$later.put(out);)+)?
            }
            fn get(from: &mut CdrReader<'_>) -> Option<Self> {
                Some(Self {
                    $($field: Field::get(from)?,)+
                    $($($later: if from.is_at_end() { Default::default() } else { Field::get(from)? },)+)?
                })
            }
            fn stamp_ns(&self) -> u64 { self.$stamp }
        }
    };
}

message! {
    /// One cycle: inputs, outputs, reason, measurements. Without heap allocation, so that it fits
    /// into a ring buffer between threads.
    #[derive(Debug, Clone, Copy, PartialEq, Default)]
    CycleRecord, "/trued/cycle", "trued_msgs/msg/Cycle",
    stamp received_ns,
    {
        /// Time of the command, ns.
        t_ns: u64,
        /// Sequence number of the command.
        seq: u64,
        /// Run of the sender.
        session: u64,
        /// When the daemon received the command, ns.
        received_ns: u64,
        /// When the corrected target was published, ns.
        published_ns: u64,
        /// Status of the target: a code of the shared memory.
        status: u32,
        /// Reason: a code of the shared memory.
        reason: u32,
        /// Segment of a replayed recording; 0 live.
        segment: u32,
        /// Newton steps taken.
        steps: u32,
        /// Commanded joint positions, rad or m.
        q_command: InlineVec<JOINTS_MAX>,
        /// Published joint positions, rad or m.
        q_corrected: InlineVec<JOINTS_MAX>,
        /// Measured joint positions, rad or m.
        q_measured: InlineVec<JOINTS_MAX>,
        /// Measured joint torques (forces), N m or N.
        tau: InlineVec<JOINTS_MAX>,
        /// Wrench as it entered the cycle, before its low pass: Fx Fy Fz in N, Mx My Mz in N m.
        wrench_used: InlineVec<6>,
        /// 1 for base axes, otherwise tool axes.
        wrench_in_base: u8,
        /// Ambient, then one per joint, °C.
        temperature_c: InlineVec<17>,
        /// Remaining position error at the TCP, m.
        residual_m: f64,
        /// Remaining orientation error, rad.
        residual_rad: f64,
        /// Spindle speed, revolutions per minute; NaN where unknown.
        spindle_rpm: f64,
        /// Feed, m/s; NaN where unknown.
        feed_m_s: f64,
    }
    later {
        /// Number of its model, see [`super::Contents::model_of`]; 0 in files of versions that did
        /// not write it.
        model_epoch: u64,
        /// The correction required by the model, before limiting, rad or m.
        q_wanted: InlineVec<JOINTS_MAX>,
        /// Trim: displacement of the tool's target that measurements require, base frame, m; empty
        /// without an instrument.
        trim_m: InlineVec<3>,
        /// Latest point of the tool measured since the previous cycle, in the base frame by the
        /// cell's registration, m.
        measured_m: InlineVec<3>,
        /// When it was measured, ns.
        measured_ns: u64,
        /// Feed override that was sent, as a share of the programmed feed; 1 in a cell that does
        /// not adapt the feed, 0 in files of versions that did not write it.
        feed_override: f64,
    }
}

message! {
    /// A block of force samples.
    #[derive(Debug, Clone, PartialEq, Default)]
    ForceRecord, "/trued/force", "trued_msgs/msg/Force",
    stamp t_ns,
    {
        /// Time of the first sample, ns.
        t_ns: u64,
        /// Sequence number of the block; a gap counts lost blocks.
        seq: u64,
        /// Run of the sender.
        session: u64,
        /// Samples per second.
        rate_hz: f64,
        /// Number of channels: the first of Fx Fy Fz Mx My Mz.
        channels: u32,
        /// Channel by channel, N and N m.
        data: Vec<f64>,
    }
}

message! {
    /// A verdict of the vibration monitor.
    #[derive(Debug, Clone, PartialEq, Default)]
    VerdictRecord, "/trued/vibration", "trued_msgs/msg/Verdict",
    stamp t_ns,
    {
        /// Time, ns.
        t_ns: u64,
        /// `warn`, `alarm`, `confirmed`, `over`.
        state: String,
        /// Classification: `chatter`, `forced`, `structural`, …
        class: String,
        /// Axis: `x`, `y`, `z`.
        axis: String,
        /// Frequency, Hz.
        frequency_hz: f64,
        /// Amplitude, N.
        amplitude_n: f64,
        /// Amplitude of the learned floor there, N.
        floor_n: f64,
        /// 1 if it may be an alias of a spindle harmonic.
        suspect_alias: u8,
    }
}

message! {
    /// State of the daemon.
    #[derive(Debug, Clone, PartialEq, Default)]
    StatusRecord, "/trued/status", "trued_msgs/msg/Status",
    stamp t_ns,
    {
        /// Time, ns.
        t_ns: u64,
        /// Name of the health state.
        health: String,
        /// Reason in one sentence; may be empty.
        says: String,
        /// Cycles since the start.
        cycles: u64,
        /// Late or missing cycles.
        missed: u64,
        /// Commands that were refused.
        rejected: u64,
        /// Records that the recorder has dropped since the start.
        dropped: u64,
    }
    later {
        /// `shadow`, `limited`, `full`.
        mode: String,
        /// 1 if bypassed.
        bypassed: u8,
        /// Number of the model since the start.
        model_epoch: u64,
        /// Median latency from sending a command to its answer, ns.
        latency_p50_ns: u64,
        /// 99th percentile of the latency, ns.
        latency_p99_ns: u64,
        /// 99.9th percentile of the latency, ns.
        latency_p999_ns: u64,
        /// Largest latency, ns.
        latency_max_ns: u64,
        /// The last command, rad or m.
        q_command: Vec<f64>,
        /// The limited correction for it, rad or m.
        correction: Vec<f64>,
    }
}

message! {
    /// A line of the log.
    #[derive(Debug, Clone, PartialEq, Default)]
    LogRecord, "/trued/log", "trued_msgs/msg/Log",
    stamp t_ns,
    {
        /// Time, ns.
        t_ns: u64,
        /// `info`, `warn`, `error`; `mark` for a marker set on request.
        level: String,
        /// Message.
        says: String,
    }
}

/// Any record.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// A cycle.
    Cycle(Box<CycleRecord>),
    /// A force block.
    Force(ForceRecord),
    /// A verdict on vibration.
    Verdict(VerdictRecord),
    /// The daemon's state.
    Status(StatusRecord),
    /// A line of the log.
    Log(LogRecord),
}

/// A topic of recordings and live views: messages in CDR, described by a ROS 2 message definition.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    /// Its name, e.g. `/trued/status`.
    pub name: &'static str,
    /// The message's name, e.g. `trued_msgs/msg/Status`.
    pub message: &'static str,
    /// The message's definition.
    pub definition: String,
}

impl Topic {
    fn of<M: Message>() -> Self {
        Self { name: M::TOPIC, message: M::NAME, definition: M::definition() }
    }

    /// The topic of the daemon's state.
    #[must_use]
    pub fn status() -> Self {
        Self::of::<StatusRecord>()
    }

    /// The topic of the vibration monitor.
    #[must_use]
    pub fn verdict() -> Self {
        Self::of::<VerdictRecord>()
    }

    /// The topic of the daemon's log.
    #[must_use]
    pub fn log() -> Self {
        Self::of::<LogRecord>()
    }
}

impl StatusRecord {
    /// The message in CDR.
    #[must_use]
    pub fn to_cdr(&self) -> Vec<u8> {
        to_cdr(self)
    }
}

impl VerdictRecord {
    /// The message in CDR.
    #[must_use]
    pub fn to_cdr(&self) -> Vec<u8> {
        to_cdr(self)
    }
}

fn to_cdr<M: Message>(message: &M) -> Vec<u8> {
    let mut out = CdrWriter::default();
    out.begin();
    message.put(&mut out);
    out.bytes().to_vec()
}

impl Record {
    /// The record of a topic; `None` if the topic is unknown or the bytes are invalid.
    pub(crate) fn decode(topic: &str, message: &[u8]) -> Option<Self> {
        let mut from = CdrReader::new(message)?;
        let from = &mut from;
        match topic {
            CycleRecord::TOPIC => {
                CycleRecord::get(from).map(|record| Self::Cycle(Box::new(record)))
            }
            ForceRecord::TOPIC => ForceRecord::get(from).map(Self::Force),
            VerdictRecord::TOPIC => VerdictRecord::get(from).map(Self::Verdict),
            StatusRecord::TOPIC => StatusRecord::get(from).map(Self::Status),
            LogRecord::TOPIC => LogRecord::get(from).map(Self::Log),
            _ => None,
        }
    }
}
