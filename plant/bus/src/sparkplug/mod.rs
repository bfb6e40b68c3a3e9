//! MQTT Sparkplug B for historians: a second reader of the spool, beside Zenoh.
//!
//! Read in this order: [`payload`] (the bytes), [`metrics`] (how a kept message becomes metrics), [`session`] (births, delivery, rebirth). Promises: a message counts as delivered when the broker has answered a packet that was sent after it,
//! so that what a broken connection swallowed is sent again, in order; what was made before the node's birth is flagged as historical. Never: a wait that holds up the bridge or the daemon, a command other than rebirth.

mod cursor;
pub mod metrics;
pub mod payload;
pub mod session;

pub use session::Sparkplug;
