//! Commands and corrections.
//!
//! SI: joints in rad (m where prismatic), forces N, moments N·m, temperatures °C, times ns.
//! Only the first `joints` entries of a joint array are used; the rest is zero.

use iceoryx2::prelude::ZeroCopySend;

use crate::JOINTS_MAX;
use crate::codes::{UnknownCode, codes};
use crate::layout::{check_range, payload, plain_struct};

plain_struct! {
    /// One commanded joint target, from the robot's side to the daemon (`/command`).
    pub struct Command = "trued.Command/2" {
        /// From 1, plus 1 with each message of this sender.
        pub seq: u64,
        /// Identifies this run of the sender: `seq` restarts when it changes.
        pub session: u64,
        /// Time for which the target is valid: `CLOCK_MONOTONIC` live, the recording's time in a replay.
        pub t_ns: u64,
        /// When it was sent, `CLOCK_MONOTONIC`.
        pub sent_ns: u64,
        /// Layout version.
        pub layout: u32,
        /// How many joints, 1 to 16.
        pub joints: u32,
        /// Which fields are set: the constants of [`Command`].
        pub flags: u32,
        /// Directions of approach, −1, 0 or 1 each, where `HAS_DIRECTION` is set.
        pub direction: [i8; JOINTS_MAX],
        /// Zero.
        pub reserved: u32,
        /// Commanded joint angles or lengths.
        pub q: [f64; JOINTS_MAX],
        /// Force, then moment, acting on the robot at the TCP, where `HAS_WRENCH` is set.
        pub wrench: [f64; 6],
        /// Ambient, then one per joint, °C, where `HAS_TEMPERATURE` is set; NaN where unknown.
        pub temperature_c: [f64; JOINTS_MAX + 1],
        /// The feed override that the client returned to the cell last, where `HAS_FEED_OVERRIDE` is set; 1 is the programmed feed.
        pub feed_override: f64,
    }
}
payload!(Command = "trued.Command/2", layout 2, check |c| {
    check_range::<Command>("joints", u64::from(c.joints), 1..=JOINTS_MAX as u64, "1 to 16 joints")
});

impl Command {
    /// `wrench` is set; in tool axes unless `WRENCH_IN_BASE` is set too.
    pub const HAS_WRENCH: u32 = 1;
    /// `wrench` is in base axes, at the TCP.
    pub const WRENCH_IN_BASE: u32 = 1 << 1;
    /// A pose at rest: without rate or jerk bound. Honoured only in a lockstep replay.
    pub const SETTLED: u32 = 1 << 2;
    /// `direction` holds.
    pub const HAS_DIRECTION: u32 = 1 << 3;
    /// `temperature_c` holds.
    pub const HAS_TEMPERATURE: u32 = 1 << 4;
    /// `feed_override` holds.
    pub const HAS_FEED_OVERRIDE: u32 = 1 << 5;

    /// Whether all bits of `flag` are set.
    #[must_use]
    pub const fn has(&self, flag: u32) -> bool {
        self.flags & flag == flag
    }

    /// The commanded joints, at most [`JOINTS_MAX`] whatever count the message states.
    #[must_use]
    pub fn joints(&self) -> &[f64] {
        &self.q[..(self.joints as usize).min(JOINTS_MAX)]
    }
}

plain_struct! {
    /// The correction that the daemon proposes for one command (`/corrected`).
    ///
    /// It is not the target itself: the robot receives the command of the present cycle plus a correction that the client limits relative to the one
    /// it sent last. The client library does this.
    pub struct Corrected = "trued.Corrected/3" {
        /// From 1, plus 1 with each message of this daemon's epoch.
        pub seq: u64,
        /// The `seq` of the answered command; 0 before the first.
        pub command_seq: u64,
        /// The `session` of that command.
        pub command_session: u64,
        /// The `t_ns` of that command.
        pub t_ns: u64,
        /// When the daemon received that command, `CLOCK_MONOTONIC`.
        pub received_ns: u64,
        /// Time of this answer, `CLOCK_MONOTONIC`.
        pub made_ns: u64,
        /// Epoch of the model that computed it: plus 1 with each change of the model.
        pub model_epoch: u64,
        /// Layout version.
        pub layout: u32,
        /// How many joints the model has, 1 to 16.
        pub joints: u32,
        /// A [`CorrectionStatus`].
        pub status: u32,
        /// A [`Reason`].
        pub reason: u32,
        /// A [`WrenchGate`].
        pub wrench_gate: u32,
        /// Newton iterations.
        pub iterations: u32,
        /// Correction of the commanded joints, within the correction limits.
        pub correction: [f64; JOINTS_MAX],
        /// Rate of `correction`, per s.
        pub correction_rate: [f64; JOINTS_MAX],
        /// Its acceleration, per s².
        pub correction_acceleration: [f64; JOINTS_MAX],
        /// The correction requested by the model, before limiting; not zero in shadow mode, unlike `correction`.
        pub wanted: [f64; JOINTS_MAX],
        /// Undamped residual of the solution, position, m.
        pub residual_m: f64,
        /// Undamped residual of the solution, orientation, rad.
        pub residual_rad: f64,
        /// Feed override that keeps the force under its limit, above 0 to 1; 1 if the cell does not adapt its feed.
        pub feed_override: f64,
    }
}
payload!(Corrected = "trued.Corrected/3", layout 3, check |c| {
    check_range::<Corrected>("joints", u64::from(c.joints), 1..=JOINTS_MAX as u64, "1 to 16 joints")
});

impl Corrected {
    /// How the correction was computed.
    ///
    /// # Errors
    /// [`UnknownCode`] where the daemon is of a later version.
    pub fn status(&self) -> Result<CorrectionStatus, UnknownCode> {
        self.status.try_into()
    }

    /// Why it has this status.
    ///
    /// # Errors
    /// [`UnknownCode`] where the daemon is of a later version.
    pub fn reason(&self) -> Result<Reason, UnknownCode> {
        self.reason.try_into()
    }

    /// The commanded joints with the correction added; joints beyond the model's are unchanged.
    #[must_use]
    pub fn added_to(&self, q_cmd: &[f64]) -> [f64; JOINTS_MAX] {
        let mut q = [0.0; JOINTS_MAX];
        let count = q_cmd.len().min(JOINTS_MAX);
        q[..count].copy_from_slice(&q_cmd[..count]);
        q[..count].iter_mut().zip(self.correction()).for_each(|(q, correction)| *q += correction);
        q
    }

    /// The correction of the model's joints, at most [`JOINTS_MAX`] whatever count the message states.
    #[must_use]
    pub fn correction(&self) -> &[f64] {
        &self.correction[..(self.joints as usize).min(JOINTS_MAX)]
    }
}

codes! {
    /// How a correction was computed.
    pub enum CorrectionStatus {
        /// Computed by the model for this command.
        Corrected = 0 "corrected",
        /// The last correction is held.
        Held = 1 "held",
        /// The correction is being ramped to another value, or to zero.
        Ramping = 2 "ramping",
        /// Bypass: nothing is corrected.
        Bypassed = 3 "bypassed",
        /// The command was rejected; the correction is held briefly, then ramped to zero.
        Rejected = 4 "rejected",
        /// No correction is sent; `wanted` holds the one that would be applied.
        Shadow = 5 "shadow",
        /// The best correction within the limits; a tool error remains, see residual and reason.
        Limited = 6 "limited",
    }
}

codes! {
    /// Why the status of a correction is not simply `corrected`.
    pub enum Reason {
        /// No particular reason.
        None = 0 "none",
        /// The command contains a value that is not finite.
        NotFinite = 1 "not_finite",
        /// The command is outside the model's joint limits; it is sent unchanged.
        OutOfLimits = 2 "out_of_limits",
        /// The command is older than the previous one.
        OutOfOrder = 3 "out_of_order",
        /// No fresh command.
        Stale = 4 "stale",
        /// The same command again.
        Duplicate = 5 "duplicate",
        /// The command has another number of joints than the model.
        WrongJointCount = 6 "wrong_joint_count",
        /// The solve failed: an effect is outside its range of validity, or a value is not finite.
        NotConverged = 7 "not_converged",
        /// The correction is restricted by the correction limits.
        Envelope = 8 "envelope",
        /// Bypass was requested.
        Bypass = 9 "bypass",
        /// The model was replaced; the change of the correction is ramped.
        ModelChanged = 10 "model_changed",
        /// The daemon starts.
        Starting = 11 "starting",
        /// No command has been received yet.
        NoCommand = 12 "no_command",
        /// The time stamps of the commands jumped.
        TimeJump = 13 "time_jump",
        /// The message is unreadable: layout, counts, flags.
        Malformed = 14 "malformed",
        /// The command moved a joint faster than its stated speed allows; it is accepted, and the path history is reset.
        CommandJump = 15 "command_jump",
        /// The daemon is in shadow mode.
        ShadowMode = 16 "shadow_mode",
        /// The correction is restricted by a joint limit.
        JointLimit = 17 "joint_limit",
        /// The wrench is not used (stale, or its loop gain is too high).
        WrenchGated = 18 "wrench_gated",
        /// Singular pose: the joints cannot move the tool in the required direction.
        Singular = 19 "singular",
    }
}

codes! {
    /// State of the force-compensation gate: whether the measured wrench is used in the correction.
    pub enum WrenchGate {
        /// No wrench received.
        Absent = 0 "absent",
        /// The wrench is used.
        Open = 1 "open",
        /// It is being faded in or out.
        Ramping = 2 "ramping",
        /// Its loop gain is too high, so it is taken as zero.
        GainTooHigh = 3 "gain_too_high",
        /// It is stale, so it is taken as zero.
        Stale = 4 "stale",
        /// It is switched off in the configuration.
        Off = 5 "off",
        /// The force stream or one of its channels has a fault, so it is taken as zero.
        SensorFault = 6 "sensor_fault",
    }
}
