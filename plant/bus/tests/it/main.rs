//! Behaviour of the bus: the spool on disk, sessions of Zenoh on this machine, real daemons, and a subscriber in Python that is not written with this library.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::panic,
    reason = "tests end where something fails, and say what they skip"
)]

mod command;
mod daemon;
mod documents;
mod follower;
mod models;
mod offer;
mod peers;
mod place;
mod sparkplug;
mod spool;
