//! Cells on the plant's bus: summaries, events and health of a cell over Zenoh, and the cells of a plant as one table.
//!
//! Read in this order: [`message`] (what is sent), [`summary`] (how it is made of a daemon's statuses), [`spool`] (messages kept for subscribers that missed them), [`zenoh_bus`] (how it is sent
//! and answered), [`bridge`] (the loop of one cell), [`fleet`] and [`text`] (all cells), then [`offer`], [`acceptance`] and [`offering`] (models that are offered and taken), last [`sparkplug`] (MQTT for historians). Promises: a separate process; a message is on disk before it is
//! sent, numbered without gaps, and can be requested until the byte budget displaces it. Never: a request to a daemon, save to load a signed model where a file of the cell's owner says so; an equation; a message that
//! waits for the network.

pub mod acceptance;
pub mod bridge;
pub mod fleet;
pub mod keys;
pub mod message;
mod model_age;
pub mod offer;
pub mod offering;
pub mod settings;
pub mod sparkplug;
pub mod spool;
pub mod summary;
pub mod text;
pub mod zenoh_bus;

pub use acceptance::Acceptance;
pub use bridge::{Bridge, BridgeError};
pub use fleet::{Fleet, FleetError};
pub use keys::Keys;
pub use settings::Settings;
pub use sparkplug::Sparkplug;
pub use zenoh_bus::Endpoints;
