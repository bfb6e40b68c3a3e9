//! Processes that are stopped, or killed while the robot's loop runs.

use super::{at_work, chance};
use crate::PROGRAMS;
use rustix::process::Signal;
use std::io::{PipeReader, Read, Write};
use std::process::Command;
use std::thread::JoinHandle;
use std::time::Duration;
use tests::place::TestDirectory;
use tests::process::Process;
use tests::served_cell::{AWAIT_LIMIT, CellProcess, ServedCell, recorder};

const ROUNDS: u64 = 16;

/// Whoever has a sign of life has one again.
fn all_back(pair: &mut ServedCell<'_>) -> Duration {
    let time = pair.wait_answered();
    for other in [CellProcess::Monitor, CellProcess::Force] {
        let daemon = pair.daemon.id();
        let process = pair.process(other);
        let since = trued_client::monotonic_ns();
        let answered = super::wait_for(AWAIT_LIMIT, || process.answered_since(since, daemon));
        assert!(answered, "{other:?}: {:#?}", process.lines());
    }
    time
}

#[test]
fn a_process_that_is_stopped_and_continued_is_served_again_without_a_step() {
    let mut chance = chance();
    let mut pair = at_work();
    pair.start_observers();
    all_back(&mut pair);
    let mut worst = Duration::ZERO;
    for round in 0..ROUNDS {
        let who = CellProcess::ALL[(round % 4) as usize];
        std::thread::sleep(Duration::from_micros(chance.below(30_000)));
        pair.process(who).signal(Signal::STOP);
        std::thread::sleep(Duration::from_millis(1 + chance.below(400)));
        pair.process(who).signal(Signal::CONT);
        worst = worst.max(all_back(&mut pair));
    }
    println!("{ROUNDS} stops: answered again after {worst:?} at worst");
    pair.end();
}

#[test]
fn a_reader_that_stops_reading_blocks_nothing() {
    let mut pair = at_work();
    pair.start_observers();
    all_back(&mut pair);
    pair.process(CellProcess::Monitor).signal(Signal::STOP);
    // More statuses and verdicts than any buffer holds.
    for _ in 0..10 {
        std::thread::sleep(Duration::from_millis(100));
        pair.wait_answered();
    }
    pair.process(CellProcess::Monitor).signal(Signal::CONT);
    all_back(&mut pair);
    let lost = pair.cell.lines().iter().any(|line| line.starts_with("Lost"));
    assert!(!lost, "{:#?}", pair.cell.lines());
    pair.end();
}

#[test]
fn killed_readers_and_force_sources_cost_the_robot_nothing_and_come_back() {
    let mut chance = chance();
    let mut pair = at_work();
    pair.start_observers();
    all_back(&mut pair);
    for round in 0..8 {
        let who = [CellProcess::Monitor, CellProcess::Force][round % 2];
        pair.process(who).kill();
        std::thread::sleep(Duration::from_micros(chance.below(3_000)));
        pair.restart(who);
        // And in the middle of joining.
        std::thread::sleep(Duration::from_micros(chance.below(30_000)));
        pair.process(who).kill();
        pair.restart(who);
        all_back(&mut pair);
    }
    pair.end();
}

/// What the page promises.
const UNRECORDED: Duration = Duration::from_millis(500);

#[test]
fn a_killed_daemon_leaves_a_recording_up_to_its_last_half_second() {
    let mut chance = chance();
    let mut pair = at_work();
    for _ in 0..6 {
        // At any time between two flushes.
        std::thread::sleep(Duration::from_micros(1_000_000 + chance.below(500_000)));
        let waited = pair.daemon.waited("recorder");
        pair.daemon.kill();
        let unrecorded = pair.unrecorded();
        println!("the last {unrecorded:?} are missing; the recorder waited {waited:?} for a core");
        assert!(unrecorded < UNRECORDED + waited, "{unrecorded:?}, {waited:?} for a core");
        pair.restart(CellProcess::Daemon);
        pair.wait_answered();
    }
    pair.end();
}

/// A pair whose daemon has a full log pipe, its reader, and the thread that fills it.
fn with_a_full_log() -> (ServedCell<'static>, PipeReader, JoinHandle<std::io::Result<()>>) {
    let place = TestDirectory::new("full", &recorder("box"));
    let (reader, mut writer) = std::io::pipe().unwrap();
    let log = writer.try_clone().unwrap();
    // More than any pipe holds: the excess waits in a separate thread.
    let filling = std::thread::spawn(move || writer.write_all(&[b'.'; 1 << 22]));
    std::thread::sleep(Duration::from_millis(100));
    let mut command = Command::new(PROGRAMS.trued);
    command.arg("run").arg("--config").arg(place.file("cell.toml"));
    let daemon = Process::with_log(&mut command, &place, log.into());
    (ServedCell::with(PROGRAMS, place, daemon), reader, filling)
}

#[test]
fn a_log_whose_reader_stalls_blocks_nothing_and_is_read_when_it_is_back() {
    let (mut pair, mut reader, filling) = with_a_full_log();
    pair.wait_answered();
    let mut monitor = trued_client::Monitor::connect_to(&pair.place.cell(), AWAIT_LIMIT).unwrap();
    for k in 0..20 {
        // Each is logged, by the thread that answers.
        monitor.bypass(k % 2 == 0, AWAIT_LIMIT).unwrap();
    }
    drop(monitor);
    pair.wait_answered();
    let reading = std::thread::spawn(move || {
        let mut text = String::new();
        reader.read_to_string(&mut text).map(|_| text)
    });
    filling.join().unwrap().unwrap();
    pair.end();
    let text = reading.join().unwrap().unwrap();
    assert!(text.contains("ready"), "what was said before anybody read");
    assert_eq!(text.matches("request: bypass").count(), 20, "nothing was lost");
}

#[test]
fn a_daemon_whose_log_is_never_read_ends_all_the_same() {
    let (mut pair, reader, _filling) = with_a_full_log();
    pair.wait_answered();
    pair.end();
    drop(reader);
}

#[test]
fn a_daemon_whose_log_nobody_reads_any_more_continues() {
    let mut pair = at_work();
    pair.daemon.stop_reading();
    let mut monitor = trued_client::Monitor::connect_to(&pair.place.cell(), AWAIT_LIMIT).unwrap();
    for k in 0..20 {
        // Each is logged.
        monitor.bypass(k % 2 == 0, AWAIT_LIMIT).unwrap();
    }
    drop(monitor);
    pair.wait_answered();
    pair.end();
}
