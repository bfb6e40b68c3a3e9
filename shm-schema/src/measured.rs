//! Measured points of the tool (`/measured`), from a laser tracker or cameras.

use iceoryx2::prelude::ZeroCopySend;

use crate::codes::codes;
use crate::layout::{payload, plain_struct};

plain_struct! {
    /// One measurement, in the instrument's own coordinates.
    pub struct MeasuredPoint = "trued.MeasuredPoint/1" {
        /// From 1, plus 1 with each message of this sender.
        pub seq: u64,
        /// Names this run of the sender: another number means that `seq` starts again.
        pub session: u64,
        /// When it was measured, `CLOCK_MONOTONIC`, where `HAS_TIME` is set.
        pub t_ns: u64,
        /// When it was sent, `CLOCK_MONOTONIC`.
        pub sent_ns: u64,
        /// Layout version.
        pub layout: u32,
        /// The constants of [`MeasuredPoint`].
        pub flags: u32,
        /// The point, m.
        pub point_m: [f64; 3],
    }
}
payload!(MeasuredPoint = "trued.MeasuredPoint/1", layout 1, check |_| Ok(()));

impl MeasuredPoint {
    /// `t_ns` is set; otherwise the daemon assumes the configured latency.
    pub const HAS_TIME: u32 = 1;

    /// Whether all bits of `flag` are set.
    #[must_use]
    pub const fn has(&self, flag: u32) -> bool {
        self.flags & flag == flag
    }
}

codes! {
    /// State of the trim.
    pub enum TrimState {
        /// The cell has no instrument, or it is switched off.
        Off = 0 "off",
        /// No valid measurement yet, or none any more; the trim is zero.
        Waiting = 1 "waiting",
        /// The model's error is estimated and reported; the trim is zero.
        Observing = 2 "observing",
        /// The tool is trimmed.
        Trimming = 3 "trimming",
        /// Measurements are missing; the trim is held.
        Holding = 4 "holding",
        /// The trim is being ramped to zero.
        Ramping = 5 "ramping",
    }
}

codes! {
    /// Reason for the state of the trim.
    pub enum TrimReason {
        /// No particular reason.
        None = 0 "none",
        /// No measurement arrives.
        NoMeasurement = 1 "no_measurement",
        /// A coordinate is not finite, or the point is implausibly far away.
        NotFinite = 2 "not_finite",
        /// Its time stamp is not later than the previous one.
        OutOfOrder = 3 "out_of_order",
        /// It is older than twice the configured latency and interval.
        Late = 4 "late",
        /// Its time stamp is ahead of the daemon's clock.
        Ahead = 5 "ahead",
        /// The model gives no tool position for that time: no command, a rejected one, or an effect outside its range of validity.
        NotPredicted = 6 "not_predicted",
        /// The instrument has jumped: its registration must be checked.
        Jumped = 7 "jumped",
        /// The trim is at its bound.
        Bounded = 8 "bounded",
    }
}
