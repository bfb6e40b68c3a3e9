//! The closed lists, as C knows them: the numbers of the messages on shared memory, and a test that they are.
//!
//! Promise: a number keeps its meaning; a later daemon may send numbers that are not here.

/// How a correction was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_correction_status {
    /// By the model, for this command.
    Corrected = 0,
    /// The last correction stands.
    Held = 1,
    /// The correction is on its way to another state, or to zero.
    Ramping = 2,
    /// By order, nothing is corrected.
    Bypassed = 3,
    /// The command was refused; the correction is held for a while, then ramps out.
    Rejected = 4,
    /// The command itself; `wanted` tells what would have been.
    Shadow = 5,
    /// The best correction within bounds: something is left, see the residual and the reason.
    Limited = 6,
}

/// Why a correction was made as it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_reason {
    /// Nothing to say.
    None = 0,
    /// The command holds a number that is none.
    NotFinite = 1,
    /// The command is outside the joint limits.
    OutOfLimits = 2,
    /// The command is older than its forerunner.
    OutOfOrder = 3,
    /// No fresh command.
    Stale = 4,
    /// The same command again.
    Duplicate = 5,
    /// The command has another number of joints than the model.
    WrongJointCount = 6,
    /// The solve failed: an effect is beyond what its law holds for, or a value is not finite.
    NotConverged = 7,
    /// The envelope bounds the correction.
    Envelope = 8,
    /// Bypass was asked for.
    Bypass = 9,
    /// The model was swapped; its change is ramped.
    ModelChanged = 10,
    /// The daemon starts.
    Starting = 11,
    /// No command has come yet.
    NoCommand = 12,
    /// Time of the commands jumped.
    TimeJump = 13,
    /// The message cannot be read: layout, counts, flags.
    Malformed = 14,
    /// The command jumped further than a robot can move.
    CommandJump = 15,
    /// The daemon stands in shadow mode.
    ShadowMode = 16,
    /// The joint limits cut the correction.
    JointLimit = 17,
    /// The wrench is not used (stale, or its loop gain is too high).
    WrenchGated = 18,
    /// A singular pose: the joints cannot move the tool the way that is needed.
    Singular = 19,
}

/// Whether the measured wrench takes part in the correction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_wrench_gate {
    /// No wrench has come.
    Absent = 0,
    /// It takes part.
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

/// How the daemon is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_health {
    /// It starts.
    Starting = 0,
    /// It stands ready; no command comes.
    Idle = 1,
    /// It corrects.
    Running = 2,
    /// It goes on, with something missing; `message` says what.
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

/// What the vibration watch does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_watch_state {
    /// The cell has none.
    Off = 0,
    /// It learns the noise floor: no line is reported yet.
    Learning = 1,
    /// It watches.
    Watching = 2,
}

/// How the black box is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_recorder_state {
    /// It is switched off.
    Off = 0,
    /// It writes.
    Recording = 1,
    /// It drops: the disk is too slow or full.
    Dropping = 2,
    /// It cannot write.
    Failed = 3,
    /// It writes nothing because it was asked to stop, or is configured to wait for a start.
    Stopped = 4,
}

/// What the trim by measurements does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_trim_state {
    /// The cell has no instrument, or it is switched off.
    Off = 0,
    /// No measurement is believed yet, or none comes any more: nothing is trimmed.
    Waiting = 1,
    /// The model's error is found and told; nothing is trimmed.
    Observing = 2,
    /// The tool is trimmed.
    Trimming = 3,
    /// Measurements are missing; the trim stands.
    Holding = 4,
    /// The trim is on its way to zero.
    Ramping = 5,
}

/// Why the trim is so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_trim_reason {
    /// Nothing to say.
    None = 0,
    /// No measurement comes.
    NoMeasurement = 1,
    /// A measurement holds a number that is none, or is further away than any robot.
    NotFinite = 2,
    /// It is not later than its forerunner.
    OutOfOrder = 3,
    /// It is older than twice what the cell states.
    Late = 4,
    /// Its stamp lies ahead of the clock.
    Ahead = 5,
    /// The model does not say where the tool was then: no command, a refused one, or an effect beyond its law.
    NotPredicted = 6,
    /// The instrument has jumped: its registration is to be looked after.
    Jumped = 7,
    /// The trim is at its bound.
    Bounded = 8,
}

/// What a recorder is asked to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_recorder_action {
    /// Close the recording; write nothing until the next start.
    Stop = 0,
    /// Begin a recording.
    Start = 1,
    /// Keep the present recording: the removal of old ones leaves it alone.
    Keep = 2,
}

/// How far a ringing has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_vibration_state {
    /// It has ended, or there is none.
    Over = 0,
    /// A line stands above the floor.
    Warn = 1,
    /// It lasts or grows.
    Alarm = 2,
    /// Its class is known too.
    Confirmed = 3,
}

/// What kind of ringing it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_vibration_class {
    /// Not decided.
    Unknown = 0,
    /// Driven by the spindle or its teeth.
    Forced = 1,
    /// Regenerative chatter.
    Chatter = 2,
    /// Mode-coupling chatter.
    ModeCoupling = 3,
    /// A gear's meshing.
    Gear = 4,
    /// A structural mode, excited from outside.
    Structural = 5,
    /// Mains or inverter.
    Electrical = 6,
}

/// What would help.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_advice {
    /// Nothing to advise.
    None = 0,
    /// Forced: go to `advice_rpm`, which moves the tooth harmonics off the mode.
    MoveOffMode = 1,
    /// Regenerative chatter: go to `advice_rpm`, a pocket between stability lobes.
    StabilityPocket = 2,
    /// Speed does not help: change direction of cut, feed or depth.
    ChangeCut = 3,
    /// Take less depth.
    ReduceDepth = 4,
    /// Sample faster, or filter before sampling: the line may be an alias.
    SampleFaster = 5,
    /// Look at the gear trains: the line follows the feed.
    CheckGear = 6,
    /// Look at cables, shields and grounding: a mains line.
    CheckWiring = 7,
}

/// What is wrong with the force signal itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_sensor_fault {
    /// Nothing.
    None = 0,
    /// A channel stands at its end of range.
    Saturated = 1,
    /// A channel does not move at all.
    Stuck = 2,
    /// A channel holds numbers that are none.
    NotFinite = 3,
    /// Blocks or samples are missing, or time jumped.
    Gaps = 4,
    /// The rate is not the configured one, by the blocks' own word or by their times.
    WrongRate = 5,
    /// A channel holds nothing but zero, or has no noise beside channels that have some.
    Dead = 6,
    /// The blocks have another number of channels than the configuration, or cannot be read.
    WrongShape = 7,
    /// Blocks come twice, or after later ones.
    OutOfOrder = 8,
    /// No block comes at all.
    Silent = 9,
    /// Blocks are stamped in the future: by another clock, or one that was set.
    InFuture = 10,
    /// Blocks are stamped long before they come: by another clock, or held up on the way.
    Late = 11,
}

/// Where the tool is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_in_cut {
    /// Not told: the watch judges by the forces.
    Unknown = 0,
    /// It cuts nothing.
    Air = 1,
    /// It cuts.
    Cut = 2,
}

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_answer_code {
    /// Done.
    Done = 0,
    /// Refused; the message says why.
    Refused = 1,
    /// The request cannot be read.
    Malformed = 2,
    /// The daemon failed in doing it; the message says where.
    Failed = 3,
}

/// What the correction in a target is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum trued_source {
    /// The daemon's, for this very command.
    Corrected = 0,
    /// The daemon's newest, which it made for an earlier command.
    LastCorrection = 1,
    /// On its way to what the daemon asks for, or to zero as the daemon is silent.
    Ramping = 2,
    /// None, and no daemon that asks for any: the target is the command.
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
