//! Adaptation of the feed to the force: part of [`crate::Status`].

use iceoryx2::prelude::ZeroCopySend;

use crate::codes::codes;
use crate::layout::plain_struct;

plain_struct! {
    /// Bounds of the feed override, and its value without a daemon; 1 is the programmed feed. The client library applies the same rule when the daemon has terminated.
    pub struct FeedBounds = "trued.FeedBounds/1" {
        /// The lowest override; 0 if the cell does not adapt its feed.
        pub floor: f64,
        /// The override without a daemon.
        pub lost: f64,
        /// Largest rate of fall, per s.
        pub down_per_s: f64,
        /// Largest rate of rise, per s.
        pub up_per_s: f64,
        /// Time for which it is held without a daemon before that, s.
        pub hold_s: f64,
    }
}

codes! {
    /// State of the feed override.
    pub enum FeedState {
        /// The cell has no limit for its feed, or it is switched off.
        Off = 0 "off",
        /// No force is known: the override is at the value that the cell sets for this case, or on its way there.
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
    /// Why the feed override is in this state.
    pub enum FeedReason {
        /// No particular reason.
        None = 0 "none",
        /// No wrench was received.
        NoWrench = 1 "no_wrench",
        /// The wrench is older than the cell allows.
        Stale = 2 "stale",
        /// The force stream or one of its channels has a fault.
        SensorFault = 3 "sensor_fault",
        /// The wrench contains a value that is not finite or implausibly large.
        NotFinite = 4 "not_finite",
        /// The model has no compliance at the tool.
        NoDeflection = 5 "no_deflection",
        /// The robot is at rest: the force does not depend on the feed.
        AtRest = 6 "at_rest",
        /// Even the lowest override exceeds the limit.
        AtFloor = 7 "at_floor",
    }
}
