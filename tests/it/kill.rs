//! After a `kill -9` the other processes continue and reconnect, and nothing is left behind: with
//! the real program.
//!
//! `TRUED_SOAK_ROUNDS` sets the number of rounds. A round has to be over within ten seconds, as the
//! machine may be busy; the number of those over within one is printed.

use crate::{PROGRAMS, TRUED};
use std::time::{Duration, Instant};
use tests::cell_loop::CellLoop;
use tests::place::TestDirectory;
use tests::process::Process;
use tests::rng::TestRng;
use tests::served_cell::{AWAIT_LIMIT, CellProcess, ServedCell};
use trued_client::{Connection, ConnectionEvent, Health, Monitor, Source, monotonic_ns};

const ROUNDS: u64 = 20;

/// One round: a victim falls in steady state, then up to three times in its first 30 ms.
fn round(pair: &mut ServedCell<'_>, number: u64, rng: &mut TestRng) -> Duration {
    let orders: [&[CellProcess]; 4] = [
        &[CellProcess::Cell],
        &[CellProcess::Daemon],
        &[CellProcess::Cell, CellProcess::Daemon],
        &[CellProcess::Daemon, CellProcess::Cell],
    ];
    let order = orders[rng.below(4) as usize];
    pair.kill_and_restart(order, rng);
    for _ in 0..(number % 4) {
        std::thread::sleep(Duration::from_micros(rng.below(30_000)));
        pair.kill_and_restart(order, rng);
    }
    let time = pair.wait_answered();
    let joined = format!("Connected {{ pid: {}", pair.daemon.id());
    assert!(
        pair.cell.wait_for_output(&joined, AWAIT_LIMIT),
        "the cell says who it joined: {:#?}",
        pair.cell.lines()
    );
    time
}

#[test]
fn the_others_continue_after_kill_9_at_any_time() {
    let rounds = std::env::var("TRUED_SOAK_ROUNDS").ok().and_then(|n| n.parse().ok());
    let seed = std::env::var("TRUED_SEED").ok().and_then(|n| n.parse().ok());
    let seed = seed.unwrap_or_else(monotonic_ns);
    println!("TRUED_SEED={seed}");
    let mut chance = TestRng::new(seed);
    let mut pair = ServedCell::start(PROGRAMS);
    pair.wait_answered();
    let mut times = Vec::new();
    for number in 0..rounds.unwrap_or(ROUNDS) {
        times.push(round(&mut pair, number, &mut chance));
        std::thread::sleep(Duration::from_micros(chance.below(60_000)));
    }
    print_times(&mut times);
    pair.end();
}

fn print_times(times: &mut [Duration]) {
    times.sort();
    let quantile = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    println!(
        "{} rounds: back after {:?} (middle), {:?} (90 %), {:?} (worst); {} within 1 s",
        times.len(),
        quantile(0.5),
        quantile(0.9),
        quantile(1.0),
        times.iter().filter(|time| **time <= Duration::from_secs(1)).count(),
    );
}

#[test]
fn the_client_ramps_the_correction_out_while_the_daemon_is_gone_and_reports_it() {
    let place = TestDirectory::new("full", "");
    let mut daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", AWAIT_LIMIT), "{:?}", daemon.lines());
    let mut cell = CellLoop::join(&place.cell(), Duration::from_millis(5)).unwrap();
    let corrects = |_: &mut CellLoop, tick: &tests::cell_loop::Tick| {
        tick.source == Source::Corrected && tick.largest() > 1e-4
    };
    assert!(cell.tick_until(AWAIT_LIMIT, corrects));
    // Until the correction has ramped in completely.
    assert!(!cell.tick_until(Duration::from_secs(1), |_, _| false));
    while cell.client.next_event().is_some() {}

    daemon.kill();
    let mut ramping = 0;
    let plain = cell.tick_until(AWAIT_LIMIT, |_, tick| {
        ramping += u32::from(tick.source == Source::Ramping);
        tick.source == Source::Plain
    });
    assert!(plain && ramping > 10, "{ramping} ticks of a ramp");
    assert!(matches!(cell.client.next_event(), Some(ConnectionEvent::Lost { .. })));
    assert_eq!(cell.client.connection(), Connection::Lost);

    let daemon = Process::daemon(TRUED, &place);
    let start = Instant::now();
    assert!(cell.tick_until(AWAIT_LIMIT, corrects));
    println!("corrected again {:?} after the daemon's restart", start.elapsed());
    // Beside why there was none for a while.
    let event = std::iter::from_fn(|| cell.client.next_event()).last();
    let Some(ConnectionEvent::Connected { pid, .. }) = event else { panic!("{event:?}") };
    assert_eq!(pid, daemon.id());
    assert_eq!(cell.broken, Vec::<String>::new());
}

#[test]
fn the_daemon_ramps_out_counts_and_serves_the_next_when_its_client_is_killed() {
    let mut pair = ServedCell::start(PROGRAMS);
    pair.wait_answered();
    std::thread::sleep(Duration::from_millis(300));
    let mut monitor = Monitor::connect_to(&pair.place.cell(), AWAIT_LIMIT).unwrap();
    pair.cell.kill();
    let mut last = None;
    let idle = wait_for(AWAIT_LIMIT, || {
        last = monitor.status();
        last.is_some_and(|status| status.health() == Ok(Health::Idle) && status.stale > 0)
    });
    assert!(idle, "{last:?}");
    assert!(pair.daemon.wait_for_output("cleaned up after terminated clients", AWAIT_LIMIT));

    pair.restart(CellProcess::Cell);
    pair.wait_answered();
    let before = last.unwrap();
    assert!(wait_for(AWAIT_LIMIT, || monitor
        .status()
        .is_some_and(|s| s.commands > before.commands)));
    assert_eq!(monitor.status().unwrap().pid, pair.daemon.id());
}

#[test]
fn remains_of_two_killed_processes_are_removed_by_the_next_daemon() {
    let mut pair = ServedCell::start(PROGRAMS);
    pair.wait_answered();
    pair.daemon.kill();
    pair.cell.kill();
    assert!(!pair.place.remaining_names().is_empty());
    pair.restart(CellProcess::Daemon);
    assert!(pair.daemon.wait_for_output("ready", AWAIT_LIMIT), "{:?}", pair.daemon.lines());
    assert!(pair.daemon.end().success());
    assert_eq!(pair.place.remaining_names(), Vec::<String>::new());
}

fn wait_for(limit: Duration, mut holds: impl FnMut() -> bool) -> bool {
    let start = Instant::now();
    while !holds() {
        if start.elapsed() > limit {
            return false;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    true
}
