//! How the feed is adapted to the force: part of [`crate::Status`].

use iceoryx2::prelude::ZeroCopySend;

use crate::codes::codes;
use crate::layout::plain_struct;

plain_struct! {
    /// What bounds the feed override, and where it goes without a daemon; 1 is the programmed feed. The client library goes by the same rule when the daemon is gone.
    pub struct FeedBounds = "trued.FeedBounds/1" {
        /// The least override; 0 where the cell adapts no feed.
        pub floor: f64,
        /// Where it goes without a daemon.
        pub lost: f64,
        /// How fast it may fall, per s.
        pub down_per_s: f64,
        /// How fast it may rise, per s.
        pub up_per_s: f64,
        /// How long it holds without a daemon before that, s.
        pub hold_s: f64,
    }
}

codes! {
    /// What the feed override does.
    pub enum FeedState {
        /// The cell has no limit for its feed, or it is switched off.
        Off = 0 "off",
        /// No force is known: the override is at the one that the cell has set for that, or on its way there.
        Lost = 1 "lost",
        /// The override is computed and reported; the programmed feed is used.
        Observing = 2 "observing",
        /// The tool is in the air.
        Air = 3 "air",
        /// The override keeps the limit.
        Adapting = 4 "adapting",
        /// The force is missing; the override is held.
        Holding = 5 "holding",
    }
}

codes! {
    /// Why the feed override is so.
    pub enum FeedReason {
        /// Nothing to say.
        None = 0 "none",
        /// No wrench has come.
        NoWrench = 1 "no_wrench",
        /// The wrench is older than the cell allows.
        Stale = 2 "stale",
        /// The force stream or one of its channels has a fault.
        SensorFault = 3 "sensor_fault",
        /// The wrench holds a number that is none, or is larger than any robot's.
        NotFinite = 4 "not_finite",
        /// The model does not tell how far the tool gives way.
        NoDeflection = 5 "no_deflection",
        /// The robot is at rest: the force does not depend on the feed.
        AtRest = 6 "at_rest",
        /// The floor of the override does not keep the limit.
        AtFloor = 7 "at_floor",
    }
}
