//! Monitors: too many of them, and those of another user.

use super::at_work;
use crate::PROGRAMS;
use rustix::process::geteuid;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use tests::clients::skipped;
use tests::process::Process;
use tests::served_cell::{AWAIT_LIMIT, CellProcess};
use trued_client::Monitor;

/// Number of monitors.
const MONITORS: usize = 16;

#[test]
fn the_robot_gets_in_however_many_look_on_and_none_of_them_moves_the_others() {
    let mut pair = at_work();
    pair.cell.kill();
    let cell = pair.place.cell();
    let join = |limit| Monitor::connect_to(&cell, limit);
    let inside: Vec<Monitor> = (0..MONITORS).map(|_| join(AWAIT_LIMIT).unwrap()).collect();
    let refused = join(Duration::from_secs(1)).err().expect("no place").to_string();
    assert!(refused.contains("the subscriber is in use"), "{refused}");
    pair.restart(CellProcess::Cell);
    println!("answered among {MONITORS} after {:?}", pair.wait_answered());
    let moved =
        pair.daemon.lines().into_iter().find(|line| line.contains("creating new shared memory"));
    assert_eq!(moved, None, "nobody is moved for one who finds no place");
    drop(inside);
    assert!(join(AWAIT_LIMIT).is_ok(), "there is room again");
    pair.end();
}

#[test]
fn a_reader_of_another_user_is_refused_and_costs_nothing() {
    if !geteuid().is_root() {
        let scratch = Path::new(env!("CARGO_TARGET_TMPDIR"));
        return skipped(scratch, "a reader of another user", "only root may act as another user");
    }
    let mut pair = at_work();
    let mut command = Command::new(PROGRAMS.rig);
    let stranger = Process::spawn(command.arg("monitor").uid(65_534).gid(65_534), &pair.place);
    assert!(
        stranger.wait_for_output("run both as the same user", AWAIT_LIMIT),
        "{:#?}",
        stranger.lines()
    );
    pair.wait_answered();
    drop(stranger);
    let lost = pair.cell.lines().iter().any(|line| line.starts_with("Lost"));
    assert!(!lost, "{:#?}", pair.cell.lines());
    pair.end();
}
