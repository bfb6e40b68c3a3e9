//! Bridges between controllers' protocols and the daemon: ABB EGM ([`egm`]), KUKA RSI ([`rsi`]).
//!
//! The daemon is accessed only through the client library ([`corrections`]); a bridge computes no
//! correction of its own. No datagram makes a bridge panic or wait; a bridge without a daemon
//! forwards targets unchanged. Nothing in a bridge's loop allocates (except the transport's one
//! block per command), locks or logs; events are counted ([`counts`]) and reported by another
//! thread.
//!
//! Read in this order: [`corrections`], [`egm::forwarder`], [`rsi::answer`]; `docs/bridge.md` describes the handling of every datagram.

pub mod corrections;
pub mod counts;
pub mod daemon_link;
mod displacement;
pub mod egm;
mod error;
pub mod link;
mod reporter;
pub mod rsi;
pub mod sequence;
pub mod settings;
mod socket;
mod start;

pub use counts::{Count, Counts};
pub use error::BridgeError;
pub use start::Options;
