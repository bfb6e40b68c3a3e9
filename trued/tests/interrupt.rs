//! Ctrl-C as a real process gets it: once to end in order, twice to end at once.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::Ordering;
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};

const ROLE: &str = "TRUED_TEST_HANGS";

/// The child process: reports that it is ready, reports the interruption, and hangs.
#[test]
fn hangs_when_asked_to_by_its_parent() {
    if std::env::var_os(ROLE).is_none() {
        return;
    }
    let flag = trued::interrupt::flag().expect("handlers");
    println!("\nlistening");
    while !flag.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(2));
    }
    println!("asked to stop");
    std::thread::sleep(Duration::from_secs(30));
}

#[test]
fn one_interrupt_is_a_request_and_the_second_ends_a_command_that_hangs() {
    let mut child = Command::new(std::env::current_exe().expect("this test"))
        .args(["--exact", "hangs_when_asked_to_by_its_parent", "--nocapture"])
        .env(ROLE, "1")
        .stdout(Stdio::piped())
        .spawn()
        .expect("runs");
    let mut lines = BufReader::new(child.stdout.take().expect("piped")).lines();
    let mut wait_for = |expected: &str| lines.any(|line| line.expect("text") == expected);
    assert!(wait_for("listening"));
    interrupt(&child);
    assert!(wait_for("asked to stop"), "the first interrupt only sets the flag");
    interrupt(&child);
    let status = child.wait().expect("ends");
    assert_eq!(status.code(), Some(i32::from(trued::interrupt::EXIT_CODE)));
}

#[track_caller]
fn interrupt(child: &Child) {
    let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
    assert!(pid.is_some_and(|pid| kill_process(pid, Signal::INT).is_ok()));
}
