//! Measured state of the robot (`/state`), if available: positions, torques, temperatures.

use iceoryx2::prelude::ZeroCopySend;

use crate::JOINTS_MAX;
use crate::layout::{check_range, payload, plain_struct};

plain_struct! {
    /// The newest measurement; it replaces earlier ones.
    pub struct RobotState = "trued.RobotState/1" {
        /// From 1, plus 1 with each message of this sender.
        pub seq: u64,
        /// Names this run of the sender: another number means that `seq` starts again.
        pub session: u64,
        /// Time of measurement, `CLOCK_MONOTONIC` live, the recording's time in a replay.
        pub t_ns: u64,
        /// When it was sent, `CLOCK_MONOTONIC`.
        pub sent_ns: u64,
        /// Layout version.
        pub layout: u32,
        /// Number of joints, 1 to 16.
        pub joints: u32,
        /// The constants of [`RobotState`].
        pub flags: u32,
        /// Zero.
        pub reserved: u32,
        /// Measured joint positions, rad or m, where `HAS_Q` is set.
        pub q_measured: [f64; JOINTS_MAX],
        /// Measured joint torques or forces, N·m or N, where `HAS_TAU` is set.
        pub tau: [f64; JOINTS_MAX],
        /// Ambient, then one per joint, °C, where `HAS_TEMPERATURE` is set; NaN where unknown.
        pub temperature_c: [f64; JOINTS_MAX + 1],
    }
}
payload!(RobotState = "trued.RobotState/1", layout 1, check |s| {
    check_range::<RobotState>("joints", u64::from(s.joints), 1..=JOINTS_MAX as u64, "1 to 16 joints")
});

impl RobotState {
    /// `q_measured` holds.
    pub const HAS_Q: u32 = 1;
    /// `tau` holds.
    pub const HAS_TAU: u32 = 1 << 1;
    /// `temperature_c` holds.
    pub const HAS_TEMPERATURE: u32 = 1 << 2;

    /// Whether all bits of `flag` are set.
    #[must_use]
    pub const fn has(&self, flag: u32) -> bool {
        self.flags & flag == flag
    }
}
