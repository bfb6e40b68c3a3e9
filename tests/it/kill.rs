//! Whoever is left after a `kill -9` goes on, or is joined again, and nothing stays behind: with the real program.
//!
//! `TRUED_SOAK_ROUNDS` asks for another number of rounds. A round must be over within ten seconds, as the machine may be
//! busy; how many were over within one is printed.

use crate::{RIG_CELL, TRUED};
use std::time::{Duration, Instant};
use tests::cell_loop::CellLoop;
use tests::chance::Chance;
use tests::place::Place;
use tests::process::Process;
use trued_client::{Connection, ConnectionEvent, Health, Monitor, Source, monotonic_ns};

const ROUNDS: u64 = 20;
const JAM: Duration = Duration::from_secs(10);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Who {
    Daemon,
    Cell,
}

struct Pair {
    daemon: Process,
    cell: Process,
}

impl Pair {
    fn start(place: &Place) -> Self {
        Self { daemon: start(Who::Daemon, place), cell: start(Who::Cell, place) }
    }

    /// Kills those in that order, and starts them anew in the same order.
    fn strike(&mut self, place: &Place, order: &[Who], chance: &mut Chance) {
        for who in order {
            let victim = self.of(*who);
            assert!(victim.is_running(), "{who:?} ended by itself: {:#?}", victim.lines());
            unbroken(victim);
            victim.kill();
            std::thread::sleep(Duration::from_micros(chance.below(3_000)));
        }
        for who in order {
            *self.of(*who) = start(*who, place);
        }
    }

    fn of(&mut self, who: Who) -> &mut Process {
        if who == Who::Cell { &mut self.cell } else { &mut self.daemon }
    }
}

fn start(who: Who, place: &Place) -> Process {
    match who {
        Who::Daemon => Process::daemon(TRUED, place),
        Who::Cell => Process::start::<&str>(RIG_CELL, &[], place),
    }
}

fn unbroken(process: &Process) {
    let broken = process.lines().into_iter().find(|line| line.starts_with("broken"));
    assert_eq!(broken, None, "no published target breaks a bound");
}

/// One round: a victim falls in steady state, then up to three times in its first 30 ms.
fn round(pair: &mut Pair, place: &Place, number: u64, chance: &mut Chance) -> Option<Duration> {
    let orders: [&[Who]; 4] =
        [&[Who::Cell], &[Who::Daemon], &[Who::Cell, Who::Daemon], &[Who::Daemon, Who::Cell]];
    let order = orders[chance.below(4) as usize];
    pair.strike(place, order, chance);
    for _ in 0..(number % 4) {
        std::thread::sleep(Duration::from_micros(chance.below(30_000)));
        pair.strike(place, order, chance);
    }
    let time = pair.cell.wait_answered(&pair.daemon, JAM)?;
    let joined = format!("Connected {{ pid: {}", pair.daemon.id());
    assert!(pair.cell.says(&joined, JAM), "the cell says who it joined: {:#?}", pair.cell.lines());
    Some(time)
}

#[test]
fn whoever_is_left_goes_on_after_kill_9_at_any_time() {
    let asked = std::env::var("TRUED_SOAK_ROUNDS").ok().and_then(|n| n.parse().ok());
    let seed = std::env::var("TRUED_SEED").ok().and_then(|n| n.parse().ok());
    let seed = seed.unwrap_or_else(monotonic_ns);
    println!("TRUED_SEED={seed}");
    let mut chance = Chance::new(seed);
    let place = Place::new("full", "");
    let mut pair = Pair::start(&place);
    pair.cell.wait_answered(&pair.daemon, JAM).expect("the pair comes to correct");
    let mut times = Vec::new();
    for number in 0..asked.unwrap_or(ROUNDS) {
        let time = round(&mut pair, &place, number, &mut chance).unwrap_or_else(|| {
            let (cell, daemon) = (pair.cell.lines(), pair.daemon.lines());
            panic!("round {number}: not back within {JAM:?}; cell: {cell:#?}; daemon: {daemon:#?}")
        });
        times.push(time);
        std::thread::sleep(Duration::from_micros(chance.below(60_000)));
    }
    told(&mut times);
    unbroken(&pair.cell);
    assert!(pair.cell.let_go().success() && pair.daemon.end().success());
    unbroken(&pair.cell);
    assert_eq!(place.left(), Vec::<String>::new(), "after a clean end");
}

fn told(times: &mut [Duration]) {
    times.sort();
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    println!(
        "{} rounds: back after {:?} (middle), {:?} (90 %), {:?} (worst); {} within 1 s",
        times.len(),
        at(0.5),
        at(0.9),
        at(1.0),
        times.iter().filter(|time| **time <= Duration::from_secs(1)).count(),
    );
}

#[test]
fn the_client_ramps_the_correction_out_while_the_daemon_is_gone_and_says_so() {
    let place = Place::new("full", "");
    let mut daemon = Process::daemon(TRUED, &place);
    assert!(daemon.says("ready", JAM), "{:?}", daemon.lines());
    let mut cell = CellLoop::join(&place.cell(), Duration::from_millis(5)).unwrap();
    let corrects = |_: &mut CellLoop, tick: &tests::cell_loop::Tick| {
        tick.source == Source::Corrected && tick.largest() > 1e-4
    };
    assert!(cell.tick_until(JAM, corrects));
    // Until the correction has come in whole.
    assert!(!cell.tick_until(Duration::from_secs(1), |_, _| false));
    while cell.client.next_event().is_some() {}

    daemon.kill();
    let mut ramping = 0;
    let plain = cell.tick_until(JAM, |_, tick| {
        ramping += u32::from(tick.source == Source::Ramping);
        tick.source == Source::Plain
    });
    assert!(plain && ramping > 10, "{ramping} ticks of a ramp");
    assert!(matches!(cell.client.next_event(), Some(ConnectionEvent::Lost { .. })));
    assert_eq!(cell.client.connection(), Connection::Lost);

    let daemon = Process::daemon(TRUED, &place);
    let start = Instant::now();
    assert!(cell.tick_until(JAM, corrects));
    println!("corrected again {:?} after the daemon's restart", start.elapsed());
    // Beside why there was none for a while.
    let event = std::iter::from_fn(|| cell.client.next_event()).last();
    let Some(ConnectionEvent::Connected { pid, .. }) = event else { panic!("{event:?}") };
    assert_eq!(pid, daemon.id());
    assert_eq!(cell.broken, Vec::<String>::new());
}

#[test]
fn the_daemon_ramps_out_counts_and_serves_the_next_when_its_client_is_killed() {
    let place = Place::new("full", "");
    let mut pair = Pair::start(&place);
    pair.cell.wait_answered(&pair.daemon, JAM).expect("the pair comes to correct");
    std::thread::sleep(Duration::from_millis(300));
    let mut monitor = Monitor::connect_to(&place.cell(), JAM).unwrap();
    pair.cell.kill();
    let mut last = None;
    let idle = wait_for(JAM, || {
        last = monitor.status();
        last.is_some_and(|status| status.health() == Ok(Health::Idle) && status.stale > 0)
    });
    assert!(idle, "{last:?}");
    assert!(pair.daemon.says("cleaned up after clients that died", JAM));

    pair.cell = start(Who::Cell, &place);
    pair.cell.wait_answered(&pair.daemon, JAM).expect("the same daemon serves the next");
    let before = last.unwrap();
    assert!(wait_for(JAM, || monitor.status().is_some_and(|s| s.commands > before.commands)));
    assert_eq!(monitor.status().unwrap().pid, pair.daemon.id());
}

#[test]
fn what_two_killed_processes_leave_is_gone_after_the_next_daemon() {
    let place = Place::new("full", "");
    let mut pair = Pair::start(&place);
    pair.cell.wait_answered(&pair.daemon, JAM).expect("the pair comes to correct");
    pair.daemon.kill();
    pair.cell.kill();
    assert!(!place.left().is_empty());
    let mut next = start(Who::Daemon, &place);
    assert!(next.says("ready", JAM), "{:?}", next.lines());
    assert!(next.end().success());
    assert_eq!(place.left(), Vec::<String>::new());
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
