//! A client that cannot get in although the role is its own, or is never answered where it got in, asks for a new epoch, and gets it.

use std::time::{Duration, Instant};

use crate::mini::{Process, Runtime, Who};
use shm_schema::{Command, Role, RoleClaim, monotonic_ns};
use trued_client::Client;

#[test]
fn a_place_that_stays_taken_costs_a_new_epoch_and_less_than_a_second() {
    let runtime = Runtime::new("jam");
    let daemon = Process::start(Who::Daemon, &runtime);
    let mut thief = RoleClaim::new(&runtime.cell(), Role::Monitor);
    let joined = loop {
        match thief.join() {
            Ok(joined) => break joined,
            Err(_) => std::thread::sleep(Duration::from_millis(5)),
        }
    };
    let _place = joined.publisher::<Command>().unwrap();
    let client = Client::connect_to(&runtime.cell(), Duration::from_secs(5));
    assert!(client.is_ok(), "{:?}", client.err());
    assert_eq!(daemon.renewals(), 1);
    drop(client);
}

#[test]
fn a_cell_that_is_never_answered_in_an_epoch_gets_another() {
    let runtime = Runtime::new("deaf");
    let daemon = Process::start(Who::DeafDaemon, &runtime);
    let (cell, since_ns) = (Process::start(Who::Cell, &runtime), monotonic_ns());
    let start = Instant::now();
    while !cell.answered_since(since_ns, daemon.id()) {
        assert!(start.elapsed() < Duration::from_secs(5), "no answer: {}", cell.last_words());
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(daemon.renewals(), 1);
}
