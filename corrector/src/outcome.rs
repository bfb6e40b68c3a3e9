//! Result of a cycle: a correction with its status and reason.
//!
//! The words are those of docs/reference/status.md; the transport has the same codes as numbers.

use physics::{JOINTS_MAX, Joints};

/// How a correction was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Status {
    /// By the model, for this command.
    #[default]
    Corrected,
    /// The last correction is held.
    Held,
    /// The correction is on its way to another state, or to zero.
    Ramping,
    /// By order, nothing is corrected.
    Bypassed,
    /// The command was refused; the correction is held for a while, then ramps out.
    Rejected,
    /// No correction is sent; `wanted` holds what it would be.
    Shadow,
    /// The best correction within bounds: something is left, see the residual and the reason.
    Limited,
}

/// What the trim by measurements does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TrimState {
    /// The cell has no instrument, or it is switched off.
    #[default]
    Off,
    /// No measurement is believed yet, or none comes any more: nothing is trimmed.
    Waiting,
    /// The model's error is estimated and reported; nothing is trimmed.
    Observing,
    /// The tool is trimmed.
    Trimming,
    /// Measurements are missing; the trim is held.
    Holding,
    /// The trim is on its way to zero.
    Ramping,
}

/// Why the trim is so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TrimReason {
    /// Nothing to say.
    #[default]
    None,
    /// No measurement comes.
    NoMeasurement,
    /// The measurement holds a number that is none, or is further away than any robot.
    NotFinite,
    /// It is not later than its forerunner.
    OutOfOrder,
    /// It is older than twice what is stated.
    Late,
    /// Its stamp lies ahead of the clock.
    Ahead,
    /// The model does not say where the tool was then: no command, a refused one, or an effect beyond its law.
    NotPredicted,
    /// The instrument has jumped: its registration is to be looked after.
    Jumped,
    /// The trim is at its bound.
    Bounded,
}

/// What the feed override does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FeedState {
    /// The cell has no limit for its feed, or it is switched off.
    #[default]
    Off,
    /// No force is known: the override is at the one that the cell has set for that, or on its way there.
    Lost,
    /// The override is computed and reported; the programmed feed is used.
    Observing,
    /// The tool is in the air.
    Air,
    /// The override keeps the limit.
    Adapting,
    /// The force is missing; the override is held.
    Holding,
}

/// Why the feed override is so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FeedReason {
    /// Nothing to say.
    #[default]
    None,
    /// No wrench has come.
    NoWrench,
    /// The wrench is older than the cell allows.
    Stale,
    /// The force stream or one of its channels has a fault.
    SensorFault,
    /// The wrench holds a number that is none, or is larger than any robot's.
    NotFinite,
    /// The model does not tell how far the tool gives way.
    NoDeflection,
    /// The robot is at rest: the force does not depend on the feed.
    AtRest,
    /// The floor of the override does not keep the limit.
    AtFloor,
}

/// Why it was made so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reason {
    /// Nothing to say.
    #[default]
    None,
    /// The command holds a number that is none.
    NotFinite,
    /// The command is outside the joint limits.
    OutOfLimits,
    /// The command is older than its forerunner.
    OutOfOrder,
    /// The command is too old, or none comes.
    Stale,
    /// The same command again.
    Duplicate,
    /// The command has another number of joints than the model.
    WrongJointCount,
    /// The solve failed: an effect is beyond what its law holds for, or a value is not finite.
    NotConverged,
    /// The envelope bounds the correction.
    Envelope,
    /// Bypass was asked for.
    Bypass,
    /// The model was swapped; its change is ramped.
    ModelChanged,
    /// The correction comes in from zero.
    Starting,
    /// The commands' time jumped; memory of the path is reset.
    TimeJump,
    /// Shadow mode.
    ShadowMode,
    /// The joint limits cut the correction.
    JointLimit,
    /// The command moved faster than the joints' stated speeds allow; memory of the path is reset.
    CommandJump,
    /// A singular pose: the joints cannot move the tool the way that is needed.
    Singular,
}

/// Whether the wrench takes part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Gate {
    /// No wrench has come.
    #[default]
    Absent,
    /// It takes part in full.
    Open,
    /// It takes part with a share: it is fading, or its loop gain is not known.
    Partly,
    /// Its loop gain is too high: taken as zero until the contact is over.
    GainTooHigh,
    /// It is stale: fading out.
    Stale,
    /// It is switched off.
    Off,
    /// Its sensor has a fault: fading out.
    SensorFault,
}

/// How far the tool is from where it should be, by the model, at the solution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residual {
    /// Position, m.
    pub m: f64,
    /// Orientation, rad.
    pub rad: f64,
}

/// What one cycle makes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// What is to be added to the command, rad or m.
    pub correction: Joints,
    /// Rate of the correction, rad/s or m/s, from which another process can continue.
    pub correction_rate: Joints,
    /// How fast that changes, rad/s² or m/s².
    pub correction_acceleration: Joints,
    /// The correction required by the model, before the envelope, rad or m.
    pub wanted: Joints,
    /// How it was made.
    pub status: Status,
    /// Why so.
    pub reason: Reason,
    /// What the solution leaves over.
    pub residual: Residual,
    /// Newton steps spent.
    pub steps: u32,
    /// Whether the wrench took part.
    pub gate: Gate,
    /// Process stiffness times the robot's compliance, dimensionless; NaN where unknown.
    pub loop_gain: f64,
}

impl Outcome {
    /// The command with the correction added, rad or m.
    #[must_use]
    pub fn added_to(&self, q_cmd: &[f64]) -> Joints {
        let mut q = [0.0; JOINTS_MAX];
        q.iter_mut().zip(q_cmd).for_each(|(q, q_cmd)| *q = *q_cmd);
        q.iter_mut().zip(self.correction).for_each(|(q, correction)| *q += correction);
        q
    }
}

impl Default for Outcome {
    fn default() -> Self {
        Self {
            correction: [0.0; JOINTS_MAX],
            correction_rate: [0.0; JOINTS_MAX],
            correction_acceleration: [0.0; JOINTS_MAX],
            wanted: [0.0; JOINTS_MAX],
            status: Status::Rejected,
            reason: Reason::None,
            residual: Residual::default(),
            steps: 0,
            gate: Gate::Absent,
            loop_gain: f64::NAN,
        }
    }
}
