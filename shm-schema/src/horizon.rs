//! Upcoming setpoints (`/horizon`), from the robot's side to the daemon.

use iceoryx2::prelude::ZeroCopySend;

use crate::JOINTS_MAX;
use crate::codes::codes;
use crate::layout::{check_range, payload, plain_struct};

plain_struct! {
    /// The setpoints that will follow a command, one command period apart; the newest message replaces the earlier ones.
    pub struct Horizon = "trued.Horizon/1" {
        /// From 1, plus 1 with each message of this sender.
        pub seq: u64,
        /// The `session` of the commands that it belongs to.
        pub session: u64,
        /// The `seq` of the command before the horizon: `points[0]` is the setpoint of command `command_seq + 1`.
        pub command_seq: u64,
        /// When it was sent, `CLOCK_MONOTONIC`.
        pub sent_ns: u64,
        /// Layout version.
        pub layout: u32,
        /// Number of points, 0 to 128; 0: no setpoint is known ahead.
        pub count: u32,
        /// Commanded joint angles or lengths, rad or m.
        pub points: [[f64; JOINTS_MAX]; Horizon::POINTS_MAX],
    }
}
payload!(Horizon = "trued.Horizon/1", layout 1, check |h| {
    check_range::<Horizon>("count", u64::from(h.count), 0..=Horizon::POINTS_MAX as u64, "0 to 128 points")?;
    let not_finite = h.points().iter().flatten().filter(|q| !q.is_finite()).count();
    check_range::<Horizon>("points: numbers that are not finite", not_finite as u64, 0..=0, "0")
});

impl Horizon {
    /// Largest number of points in one message.
    pub const POINTS_MAX: usize = 128;

    /// The points that are set, at most [`POINTS_MAX`](Self::POINTS_MAX) whatever the message claims.
    #[must_use]
    pub fn points(&self) -> &[[f64; JOINTS_MAX]] {
        &self.points[..(self.count as usize).min(Self::POINTS_MAX)]
    }

    /// Copies the message except unused points; those of `into` stay unchanged.
    pub fn copy_into(&self, into: &mut Self) {
        let Self { seq, session, command_seq, sent_ns, layout, count, points: _ } = *self;
        let points = self.points();
        (into.seq, into.session, into.command_seq) = (seq, session, command_seq);
        (into.sent_ns, into.layout, into.count) = (sent_ns, layout, count);
        into.points[..points.len()].copy_from_slice(points);
    }
}

codes! {
    /// State of the lead compensation of delay, lags and modes.
    pub enum LeadState {
        /// The cell has no `[dynamic]`, or it is switched off.
        Off = 0 "off",
        /// The model has no delay, lag or mode of a joint.
        NothingInTime = 1 "nothing_in_time",
        /// Fewer setpoints are known ahead than delay plus lags take: lags alone are compensated, if no joint has a mode.
        NoHorizon = 2 "no_horizon",
        /// Fewer setpoints are known than the lead uses; after the last one the path is assumed to continue at its speed.
        ShortHorizon = 3 "short_horizon",
        /// All setpoints that the lead uses are known.
        Horizon = 4 "horizon",
    }
}
