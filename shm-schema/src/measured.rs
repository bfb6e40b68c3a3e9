//! Where an instrument sees a point of the tool (`/measured`): a laser tracker, cameras.

use iceoryx2::prelude::ZeroCopySend;

use crate::codes::codes;
use crate::layout::{payload, plain_struct};

plain_struct! {
    /// One measurement, in the instrument's own coordinates.
    pub struct MeasuredPoint = "trued.MeasuredPoint/1" {
        /// From 1, plus 1 with each message of this sender.
        pub seq: u64,
        /// Names this run of the sender: another number means that `seq` starts anew.
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
    /// `t_ns` holds; else the daemon takes the latency that its cell states.
    pub const HAS_TIME: u32 = 1;

    /// Whether all bits of `flag` are set.
    #[must_use]
    pub const fn has(&self, flag: u32) -> bool {
        self.flags & flag == flag
    }
}

codes! {
    /// What the trim by measurements does.
    pub enum TrimState {
        /// The cell has no instrument, or it is switched off.
        Off = 0 "off",
        /// No measurement is believed yet, or none comes any more: nothing is trimmed.
        Waiting = 1 "waiting",
        /// The model's error is found and told; nothing is trimmed.
        Observing = 2 "observing",
        /// The tool is trimmed.
        Trimming = 3 "trimming",
        /// Measurements are missing; the trim stands.
        Holding = 4 "holding",
        /// The trim is on its way to zero.
        Ramping = 5 "ramping",
    }
}

codes! {
    /// Why the trim is so.
    pub enum TrimReason {
        /// Nothing to say.
        None = 0 "none",
        /// No measurement comes.
        NoMeasurement = 1 "no_measurement",
        /// A measurement holds a number that is none, or is further away than any robot.
        NotFinite = 2 "not_finite",
        /// It is not later than its forerunner.
        OutOfOrder = 3 "out_of_order",
        /// It is older than twice what the cell states.
        Late = 4 "late",
        /// Its stamp lies ahead of the clock.
        Ahead = 5 "ahead",
        /// The model does not say where the tool was then: no command, a refused one, or an effect beyond its law.
        NotPredicted = 6 "not_predicted",
        /// The instrument has jumped: its registration is to be looked after.
        Jumped = 7 "jumped",
        /// The trim is at its bound.
        Bounded = 8 "bounded",
    }
}
