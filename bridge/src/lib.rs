//! Controllers' own protocols as clients like any other: ABB EGM ([`egm`]), KUKA RSI ([`rsi`]).
//!
//! Promises: what the daemon does is known here only through the client library ([`feed`]); no datagram makes a bridge
//! panic or wait; a bridge without a daemon passes on what it is given. Nothing in a bridge's loop allocates (the
//! transport's one block per command aside), locks or logs; what happened is counted ([`counts`]) and told by another thread.
//! Never: a correction of its own, a way around the client library.
//!
//! Read in this order: [`feed`], [`egm::middle`], [`rsi::answer`]; `docs/bridge.md` has every policy.

pub mod counts;
mod displacement;
pub mod egm;
mod error;
pub mod feed;
pub mod joining;
pub mod link;
pub mod rsi;
pub mod sequence;
mod socket;
mod start;
mod teller;

pub use counts::{Count, Counts};
pub use error::BridgeError;
pub use start::Options;
