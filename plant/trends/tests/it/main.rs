//! Behaviour of `trued-trends` over folders of results: those that tests write, and those of a fleet that another generator made.

mod command;
mod fleets;
mod peer;
mod written;
