//! Behaviour of `trued-trends` over folders of results: those that tests write, and those of a fleet that another generator made.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests end where something fails, and say what they skip"
)]

mod command;
mod documents;
mod fleets;
mod peer;
#[path = "../../examples/false_alarms/fleet.rs"]
mod still;
mod written;
