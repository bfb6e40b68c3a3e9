//! The enumerations in C: the same numbers as in the shared-memory messages, held by a test.
//!
//! Promise: a number keeps its meaning; a later daemon may send numbers that are not here.

/// How a correction was computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_correction_status {
    /// Computed by the model for this command.
    Corrected = 0,
    /// The last correction is held.
    Held = 1,
    /// The correction is being ramped to another value, or to zero.
    Ramping = 2,
    /// Bypass: nothing is corrected.
    Bypassed = 3,
    /// The command was rejected; the correction is held briefly, then ramped to zero.
    Rejected = 4,
    /// The command is sent unchanged; `wanted` holds the correction that would be applied.
    Shadow = 5,
    /// The best correction within the limits; a tool error remains, see residual and reason.
    Limited = 6,
}

/// Why the status of a correction is not simply `corrected`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_reason {
    /// Nothing to say.
    None = 0,
    /// The command contains a value that is not finite.
    NotFinite = 1,
    /// The command is outside the joint limits.
    OutOfLimits = 2,
    /// The command is older than the previous one.
    OutOfOrder = 3,
    /// No fresh command.
    Stale = 4,
    /// The same command again.
    Duplicate = 5,
    /// The command has another number of joints than the model.
    WrongJointCount = 6,
    /// The solve failed: an effect is outside its range of validity, or a value is not finite.
    NotConverged = 7,
    /// The correction is restricted by the correction limits.
    Envelope = 8,
    /// Bypass was requested.
    Bypass = 9,
    /// The model was replaced; the change of the correction is ramped.
    ModelChanged = 10,
    /// The daemon starts.
    Starting = 11,
    /// No command has come yet.
    NoCommand = 12,
    /// The time stamps of the commands jumped.
    TimeJump = 13,
    /// The message cannot be read: layout, counts, flags.
    Malformed = 14,
    /// The command jumped further than a robot can move.
    CommandJump = 15,
    /// The daemon is in shadow mode.
    ShadowMode = 16,
    /// The correction is restricted by a joint limit.
    JointLimit = 17,
    /// The wrench is not used (stale, or its loop gain is too high).
    WrenchGated = 18,
    /// Singular pose: the joints cannot move the tool in the required direction.
    Singular = 19,
}

/// State of the force-compensation gate: whether the measured wrench is used in the correction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_wrench_gate {
    /// No wrench received.
    Absent = 0,
    /// The wrench is used.
    Open = 1,
    /// It is being faded in or out.
    Ramping = 2,
    /// Its loop gain is too high, so it is taken as zero.
    GainTooHigh = 3,
    /// It is stale, so it is taken as zero.
    Stale = 4,
    /// It is switched off in the configuration.
    Off = 5,
    /// The force stream or one of its channels has a fault, so it is taken as zero.
    SensorFault = 6,
}

/// State of the daemon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_health {
    /// It starts.
    Starting = 0,
    /// Ready; no commands arrive.
    Idle = 1,
    /// It corrects.
    Running = 2,
    /// It works with restrictions; `message` states them.
    Degraded = 3,
    /// It corrects nothing; `message` says why.
    Fault = 4,
    /// It ends.
    Stopping = 5,
}

/// How much the daemon may correct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_mode {
    /// It computes and reports, and corrects nothing.
    Shadow = 0,
    /// It corrects within a narrow envelope.
    Limited = 1,
    /// It corrects within the whole envelope.
    Full = 2,
}

/// State of the vibration monitor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_watch_state {
    /// The cell has no vibration monitor.
    Off = 0,
    /// It learns the noise floor: no line is reported yet.
    Learning = 1,
    /// Monitoring.
    Watching = 2,
}

/// State of the recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_recorder_state {
    /// It is switched off.
    Off = 0,
    /// It writes.
    Recording = 1,
    /// It drops records: the disk is too slow or full.
    Dropping = 2,
    /// It cannot write.
    Failed = 3,
    /// It writes nothing because it was asked to stop, or is configured to wait for a start.
    Stopped = 4,
}

/// State of the trim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_trim_state {
    /// The cell has no instrument, or it is switched off.
    Off = 0,
    /// No valid measurement yet, or none any more; the trim is zero.
    Waiting = 1,
    /// The model's error is estimated and reported; the trim is zero.
    Observing = 2,
    /// The tool is trimmed.
    Trimming = 3,
    /// Measurements are missing; the trim is held.
    Holding = 4,
    /// The trim is being ramped to zero.
    Ramping = 5,
}

/// Reason for the state of the trim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_trim_reason {
    /// Nothing to say.
    None = 0,
    /// No measurement arrives.
    NoMeasurement = 1,
    /// A coordinate is not finite, or the point is implausibly far away.
    NotFinite = 2,
    /// Its time stamp is not later than the previous one.
    OutOfOrder = 3,
    /// It is older than twice the configured latency and interval.
    Late = 4,
    /// Its time stamp is ahead of the daemon's clock.
    Ahead = 5,
    /// The model gives no tool position for that time: no command, a rejected one, or an effect outside its range of validity.
    NotPredicted = 6,
    /// The instrument has jumped: its registration must be checked.
    Jumped = 7,
    /// The trim is at its bound.
    Bounded = 8,
}

/// What the feed override does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_feed_state {
    /// The cell has no limit for its feed, or it is switched off.
    Off = 0,
    /// No force is known: the override is at the one that the cell has set for that, or on its way there.
    Lost = 1,
    /// The override is computed and reported; the programmed feed is used.
    Observing = 2,
    /// The tool is in the air.
    Air = 3,
    /// The override keeps the limit.
    Adapting = 4,
    /// The force is missing; the override is held.
    Holding = 5,
}

/// What the compensation of delay, lags and modes is computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_lead_state {
    /// The cell has no `dynamic` in its configuration, or it is switched off.
    Off = 0,
    /// The model has no delay, lag or mode of a joint.
    NothingInTime = 1,
    /// Fewer setpoints are known ahead than delay plus lags take: lags alone are compensated, if no joint has a mode.
    NoHorizon = 2,
    /// Fewer setpoints are known than the lead uses; after the last one the path is assumed to continue at its speed.
    ShortHorizon = 3,
    /// All setpoints that the lead uses are known.
    Horizon = 4,
}

/// Why the feed override is so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_feed_reason {
    /// Nothing to say.
    None = 0,
    /// No wrench has come.
    NoWrench = 1,
    /// The wrench is older than the cell allows.
    Stale = 2,
    /// The force stream or one of its channels has a fault.
    SensorFault = 3,
    /// The wrench holds a number that is none, or is larger than any robot's.
    NotFinite = 4,
    /// The model does not tell how far the tool gives way.
    NoDeflection = 5,
    /// The robot is at rest: the force does not depend on the feed.
    AtRest = 6,
    /// The floor of the override does not keep the limit.
    AtFloor = 7,
}

/// Action of the recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_recorder_action {
    /// Close the recording and stop until the next start.
    Stop = 0,
    /// Begin a recording.
    Start = 1,
    /// Mark the present recording to be kept: it is exempt from the removal of old files.
    Keep = 2,
}

/// State of a vibration event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_vibration_state {
    /// Ended, or none detected.
    Over = 0,
    /// A spectral line rises above the noise floor.
    Warn = 1,
    /// It persists or grows.
    Alarm = 2,
    /// It persists or grows, and its class is known.
    Confirmed = 3,
}

/// Class of a vibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_vibration_class {
    /// Not classified.
    Unknown = 0,
    /// Forced vibration at a spindle or tooth-passing harmonic.
    Forced = 1,
    /// Regenerative chatter.
    Chatter = 2,
    /// Mode-coupling chatter.
    ModeCoupling = 3,
    /// Gear meshing.
    Gear = 4,
    /// A structural mode, excited from outside.
    Structural = 5,
    /// Electrical: mains or inverter.
    Electrical = 6,
}

/// Recommended action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_advice {
    /// No recommendation.
    None = 0,
    /// Forced: go to `advice_rpm`, which moves the tooth harmonics off the mode.
    MoveOffMode = 1,
    /// Regenerative chatter: go to `advice_rpm`, a pocket between stability lobes.
    StabilityPocket = 2,
    /// A change of speed does not help: change the direction of cut, the feed or the depth.
    ChangeCut = 3,
    /// Reduce the depth of cut.
    ReduceDepth = 4,
    /// Sample faster, or filter before sampling: the line may be an alias.
    SampleFaster = 5,
    /// Check the gear trains: the line follows the feed.
    CheckGear = 6,
    /// Check cables, shielding and grounding: the line is at a mains frequency.
    CheckWiring = 7,
}

/// Fault of the force signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_sensor_fault {
    /// Nothing.
    None = 0,
    /// A channel is at the end of its range.
    Saturated = 1,
    /// A channel's value is frozen.
    Stuck = 2,
    /// A channel contains values that are not finite.
    NotFinite = 3,
    /// Blocks or samples are missing, or time jumped.
    Gaps = 4,
    /// The sampling rate differs from the configured one, by the rate stated in the blocks or by their time stamps.
    WrongRate = 5,
    /// A channel reads only zero, or has no noise while other channels have some.
    Dead = 6,
    /// The number of channels differs from the configuration, or the blocks cannot be read.
    WrongShape = 7,
    /// Blocks arrive twice or out of order.
    OutOfOrder = 8,
    /// No block arrives.
    Silent = 9,
    /// Block time stamps lie in the future: another clock, or a clock that was set.
    InFuture = 10,
    /// Block time stamps are much older than their arrival: another clock, or a delay in transit.
    Late = 11,
}

/// Whether the tool is in the cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_in_cut {
    /// Not stated: the vibration monitor decides by the forces.
    Unknown = 0,
    /// Not cutting.
    Air = 1,
    /// Cutting.
    Cut = 2,
}

/// Result of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_answer_code {
    /// Done.
    Done = 0,
    /// Refused; the message says why.
    Refused = 1,
    /// The request cannot be read.
    Malformed = 2,
    /// The daemon failed while executing it; the message says where.
    Failed = 3,
}

/// Origin of the correction in a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_source {
    /// The daemon's correction for this command.
    Corrected = 0,
    /// The daemon's newest correction, computed for an earlier command.
    LastCorrection = 1,
    /// Being ramped to the daemon's correction, or to zero because the daemon does not respond.
    Ramping = 2,
    /// No correction, and no daemon that requests one: the target is the command.
    Plain = 3,
}

impl From<::trued_client::Source> for trued_source {
    fn from(source: ::trued_client::Source) -> Self {
        match source {
            ::trued_client::Source::Corrected => Self::Corrected,
            ::trued_client::Source::LastCorrection => Self::LastCorrection,
            ::trued_client::Source::Ramping => Self::Ramping,
            ::trued_client::Source::Plain => Self::Plain,
        }
    }
}
