//! Result of a cycle: a correction with its status and reason.
//!
//! The names are those of docs/reference/status.md; the shared memory holds the same codes as
//! numbers.

use physics::{JOINTS_MAX, Joints};

/// How a correction was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Status {
    /// By the model, for this command.
    #[default]
    Corrected,
    /// The last correction is held.
    Held,
    /// The correction is ramping to another state, or to zero.
    Ramping,
    /// Bypassed by request: nothing is corrected.
    Bypassed,
    /// The command was refused; the correction is held for a while, then ramps to zero.
    Rejected,
    /// No correction is sent; `requested` holds what it would be.
    Shadow,
    /// The best correction within bounds; residual and reason say what remains.
    Limited,
}

/// State of the trim by measurements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TrimState {
    /// The cell has no instrument, or it is switched off.
    #[default]
    Off,
    /// No valid measurement yet, or none any more: nothing is trimmed.
    Waiting,
    /// The model's error is estimated and reported; nothing is trimmed.
    Observing,
    /// The trim is applied.
    Trimming,
    /// Measurements are missing; the trim is held.
    Holding,
    /// The trim is ramping to zero.
    Ramping,
}

/// Why the trim is in this state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TrimReason {
    /// No particular reason.
    #[default]
    None,
    /// No measurement comes.
    NoMeasurement,
    /// The measurement holds a value that is not finite, or is further away than any robot reaches.
    NotFinite,
    /// It is not later than the previous one.
    OutOfOrder,
    /// It is older than twice the stated latency.
    Late,
    /// Its stamp is ahead of the clock.
    Ahead,
    /// The model gives no tool position for that time: no command, a refused one, or an effect
    /// outside the range of its law.
    NotPredicted,
    /// The instrument has jumped: check its registration.
    Jumped,
    /// The trim is at its limit.
    Bounded,
}

/// State of the feed override.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FeedState {
    /// The cell has no limit for its feed, or it is switched off.
    #[default]
    Off,
    /// No force is known: the override is at the value that the cell sets for this case, or on its
    /// way there.
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

/// Why the feed override is in this state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FeedReason {
    /// No particular reason.
    #[default]
    None,
    /// No wrench was received.
    NoWrench,
    /// The wrench is older than the cell allows.
    Stale,
    /// The force stream or one of its channels has a fault.
    SensorFault,
    /// The wrench holds a value that is not finite, or is larger than any robot's.
    NotFinite,
    /// The model gives no deflection.
    NoDeflection,
    /// The robot is at rest: the force does not depend on the feed.
    AtRest,
    /// Even the lowest override exceeds the limit.
    AtFloor,
}

/// Why a correction was made in this way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reason {
    /// No particular reason.
    #[default]
    None,
    /// The command holds a value that is not finite.
    NotFinite,
    /// The command is outside the joint limits.
    OutOfLimits,
    /// The command is older than the previous one.
    OutOfOrder,
    /// The command is too old, or none is received.
    Stale,
    /// The command was repeated.
    Duplicate,
    /// The command has another number of joints than the model.
    WrongJointCount,
    /// The solve failed: an effect is outside the range of its law, or a value is not finite.
    NotConverged,
    /// The envelope limits the correction.
    Envelope,
    /// Bypass was requested.
    Bypass,
    /// The model was replaced; the change is ramped.
    ModelChanged,
    /// The correction ramps in from zero.
    Starting,
    /// The commands' time jumped; memory of the path is reset.
    TimeJump,
    /// Shadow mode.
    ShadowMode,
    /// The joint limits reduce the correction.
    JointLimit,
    /// The command moved faster than the joints' stated speeds allow; memory of the path is reset.
    CommandJump,
    /// A singular pose: the joints cannot move the tool in the required direction.
    Singular,
}

/// Use of the measured wrench.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GateState {
    /// No wrench was received.
    #[default]
    Absent,
    /// Used in full.
    Open,
    /// Used in part: it is fading, or its loop gain is not known.
    Partly,
    /// Its loop gain is too high: taken as zero until the contact ends.
    GainTooHigh,
    /// It is stale: fading out.
    Stale,
    /// It is switched off.
    Off,
    /// Its sensor has a fault: fading out.
    SensorFault,
}

/// Remaining error of the tool pose at the solution, by the model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residual {
    /// Position, m.
    pub m: f64,
    /// Orientation, rad.
    pub rad: f64,
}

/// Result of one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Correction to be added to the command, rad or m.
    pub correction: Joints,
    /// Rate of the correction, rad/s or m/s, from which another process can continue.
    pub correction_rate: Joints,
    /// Acceleration of the correction, rad/s² or m/s².
    pub correction_acceleration: Joints,
    /// The correction required by the model, before limiting, rad or m.
    pub requested: Joints,
    /// How it was made.
    pub status: Status,
    /// Why.
    pub reason: Reason,
    /// Remaining tool error of the solution.
    pub residual: Residual,
    /// Newton steps taken.
    pub steps: u32,
    /// State of the force-compensation gate.
    pub gate: GateState,
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
            requested: [0.0; JOINTS_MAX],
            status: Status::Rejected,
            reason: Reason::None,
            residual: Residual::default(),
            steps: 0,
            gate: GateState::Absent,
            loop_gain: f64::NAN,
        }
    }
}
