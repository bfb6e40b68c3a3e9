//! Whoever is left after a `kill -9` goes on, or is joined again, and nothing stays behind.
//!
//! Real processes: this test starts itself again as daemon and as cell. `TRUED_SOAK_ROUNDS` asks for
//! more rounds, and then holds each to one second; without it the limit only catches a jam, as the
//! machine may be busy with other tests. `TRUED_SOAK_STRIKE` (0 to 3) holds to one order of killing.

use std::time::{Duration, Instant};

use crate::mini::{Process, Runtime, Who};
use shm_schema::{monotonic_ns, remove_leftovers};

const ROUNDS: u64 = 20;
const JAM: Duration = Duration::from_secs(10);

/// A row of numbers that differs from run to run; the seed is said.
struct Chance(u64);

impl Chance {
    fn below(&mut self, n: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) % n
    }
}

struct Pair {
    daemon: Process,
    cell: Process,
    /// New epochs that daemons made as a client could not get in.
    renewals: usize,
}

impl Pair {
    fn start(runtime: &Runtime) -> Self {
        Self {
            daemon: Process::start(Who::Daemon, runtime),
            cell: Process::start(Who::Cell, runtime),
            renewals: 0,
        }
    }

    /// Kills and restarts: 0 the cell, 1 the daemon, 2 the cell then the daemon, 3 the other way.
    fn strike(&mut self, runtime: &Runtime, what: u64, chance: &mut Chance) {
        let order: &[Who] = match what {
            0 => &[Who::Cell],
            1 => &[Who::Daemon],
            2 => &[Who::Cell, Who::Daemon],
            _ => &[Who::Daemon, Who::Cell],
        };
        for who in order {
            let victim = if *who == Who::Cell { &mut self.cell } else { &mut self.daemon };
            assert!(victim.is_running(), "a survivor ended by itself: {who:?}");
            victim.kill();
            self.renewals += victim.renewals();
            std::thread::sleep(Duration::from_micros(chance.below(3_000)));
        }
        for who in order {
            let fresh = Process::start(*who, runtime);
            if *who == Who::Cell { self.cell = fresh } else { self.daemon = fresh }
        }
    }

    /// How long until the cell's process has a fresh answer by the daemon's process.
    fn wait_until_it_corrects(&self, limit: Duration) -> Option<Duration> {
        let (start, start_ns) = (Instant::now(), monotonic_ns());
        while start.elapsed() < limit {
            if self.cell.answered_since(start_ns, self.daemon.id()) {
                return Some(start.elapsed());
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        None
    }
}

#[test]
fn the_others_continue_after_kill_9_at_any_time() {
    let rounds = std::env::var("TRUED_SOAK_ROUNDS").ok().and_then(|n| n.parse().ok());
    let limit = if rounds.is_some() { Duration::from_secs(1) } else { JAM };
    let strike = std::env::var("TRUED_SOAK_STRIKE").ok().and_then(|n| n.parse().ok());
    let seed = monotonic_ns() | 1;
    println!("seed {seed}");
    let mut chance = Chance(seed);
    let runtime = Runtime::new("kill");
    let mut pair = Pair::start(&runtime);
    pair.wait_until_it_corrects(JAM).expect("the pair never came to correct");
    let mut times = Vec::new();
    for round in 0..rounds.unwrap_or(ROUNDS) {
        // A victim falls in steady state, then up to three times in its first 30 ms.
        let what = strike.unwrap_or_else(|| chance.below(4));
        pair.strike(&runtime, what, &mut chance);
        for _ in 0..(round % 4) {
            std::thread::sleep(Duration::from_micros(chance.below(30_000)));
            pair.strike(&runtime, what, &mut chance);
        }
        let time = pair.wait_until_it_corrects(limit);
        let time = time.unwrap_or_else(|| {
            let again = pair.wait_until_it_corrects(JAM);
            panic!(
                "round {round}, strike {what}: not back within {limit:?} (then {again:?}); seed {seed}; \
                 cell: {}; daemon: {}, {} renewals",
                pair.cell.last_words(),
                pair.daemon.last_words(),
                pair.daemon.renewals()
            )
        });
        times.push(time);
        std::thread::sleep(Duration::from_micros(chance.below(40_000)));
    }
    times.sort();
    let quantile = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    println!(
        "{} rounds: back after {:?} (middle), {:?} (90 %), {:?} (worst); {} new epochs on demand",
        times.len(),
        quantile(0.5),
        quantile(0.9),
        quantile(1.0),
        pair.renewals + pair.daemon.renewals()
    );

    pair.cell.end();
    pair.daemon.end();
    assert_eq!(runtime.left(), Vec::<String>::new(), "after a clean end");
}

#[test]
fn what_two_killed_processes_leave_is_swept() {
    let runtime = Runtime::new("sweep");
    let mut pair = Pair::start(&runtime);
    pair.wait_until_it_corrects(JAM).expect("the pair never came to correct");
    pair.daemon.kill();
    pair.cell.kill();
    assert!(!runtime.left().is_empty());
    remove_leftovers(&runtime.cell()).unwrap();
    assert_eq!(runtime.left(), Vec::<String>::new());
}
