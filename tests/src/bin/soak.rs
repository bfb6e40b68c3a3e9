//! Faults at random over real processes, for as long as asked: `cargo xtask soak`.
//!
//! Arguments: minutes, seed. After each fault the robot's loop must be answered within a second, with no bound broken; the daemon's
//! memory is told as it goes, and must be flat. In the last two thirds nobody ends the daemon, so that one life is long.
//! Exit code 1 where something was late, or memory grew.
#![expect(clippy::print_stdout, reason = "its account is what it is for")]
#![expect(clippy::expect_used, clippy::panic, reason = "a soak that cannot go on ends loudly")]

use rustix::process::Signal;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};
use tests::chance::Chance;
use tests::pair::{JAM, Pair, Programs, Who};
use trued_client::Monitor;

/// Within this the service must be back.
const BAR: Duration = Duration::from_secs(1);
/// What memory may grow by over a long life and still count as flat: freed pages come back late.
const FLAT: f64 = 1.05;

const FAULTS: [&str; 14] = [
    "kill the daemon",
    "kill daemon and cell",
    "kill the cell",
    "kill whoever looks on",
    "kill the force source",
    "stop one for a while",
    "remove the folder",
    "remove the lock",
    "spoil the announcement",
    "remove the memory",
    "leave half-made memory",
    "swap the model",
    "offer broken models",
    "a crowd looks on",
];
/// The first of them end the daemon.
const DEADLY: u64 = 2;

/// What was seen of one kind of fault.
#[derive(Default)]
struct Seen {
    times: u32,
    worst: Duration,
    late: u32,
}

fn main() {
    let number = |at: usize| std::env::args().nth(at).and_then(|word| word.parse::<f64>().ok());
    let minutes = number(1).unwrap_or(60.0);
    let seed = number(2).map_or_else(trued_client::monotonic_ns, |seed| seed as u64);
    println!("{minutes} minutes of faults, seed {seed}");
    let programs = std::env::current_exe().expect("a path");
    let beside = |name: &str| programs.with_file_name(name).display().to_string();
    let (trued, rig) = (beside("trued-under-test"), beside("rig-cell"));
    let sound = soak(Programs { trued: &trued, rig: &rig }, minutes * 60.0, seed);
    std::process::exit(i32::from(!sound));
}

fn soak(programs: Programs<'_>, seconds: f64, seed: u64) -> bool {
    let mut chance = Chance::new(seed);
    // Its black boxes lie in memory here.
    let mut pair = Pair::start_with(programs, "max_file_MB = 8\nkeep_files = 2\n");
    pair.complete();
    pair.back();
    let (start, mut seen) = (Instant::now(), BTreeMap::<&str, Seen>::new());
    let mut resident = Vec::new();
    while start.elapsed().as_secs_f64() < seconds {
        let spares = start.elapsed().as_secs_f64() > seconds / 3.0;
        let least = if spares { DEADLY } else { 0 };
        let kind = FAULTS[(least + chance.below(FAULTS.len() as u64 - least)) as usize];
        println!("{:.2} s: {kind}", start.elapsed().as_secs_f64());
        strike(kind, &mut pair, &mut chance);
        let time = pair.back();
        let seen = seen.entry(kind).or_default();
        seen.times += 1;
        seen.worst = seen.worst.max(time);
        seen.late += u32::from(time > BAR);
        assert!(pair.daemon.is_running(), "the daemon ended by itself: {:#?}", pair.daemon.lines());
        if spares {
            resident.extend(pair.daemon.resident_kb());
        }
        std::thread::sleep(Duration::from_micros(chance.below(300_000)));
    }
    let recorded_ns = pair.end();
    println!(
        "black boxes read up to {recorded_ns} ns; nothing left in shared memory; no bound broken"
    );
    told(&seen) & flat(&resident)
}

fn strike(kind: &str, pair: &mut Pair<'_>, chance: &mut Chance) {
    let dir = pair.place.cell().dir().to_path_buf();
    match kind {
        "kill the daemon" => again(pair, chance, &[Who::Daemon]),
        "kill daemon and cell" => again(pair, chance, &[Who::Daemon, Who::Cell]),
        "kill the cell" => again(pair, chance, &[Who::Cell]),
        "kill whoever looks on" => again(pair, chance, &[Who::Monitor]),
        "kill the force source" => again(pair, chance, &[Who::Force]),
        "stop one for a while" => {
            let who = Who::ALL[chance.below(4) as usize];
            pair.of(who).signal(Signal::STOP);
            std::thread::sleep(Duration::from_micros(chance.below(500_000)));
            pair.of(who).signal(Signal::CONT);
        }
        // What the daemon has just mended may be half there: what cannot be removed is not.
        "remove the folder" => drop(fs::remove_dir_all(&dir)),
        "remove the lock" => drop(fs::remove_file(dir.join("daemon.lock"))),
        "spoil the announcement" => drop(fs::write(dir.join("current"), "trued.cur")),
        "remove the memory" => memory(pair, |path| drop(fs::remove_file(path))),
        "leave half-made memory" => {
            let prefix = pair.place.cell().shared_memory_prefix();
            let name = format!("/dev/shm/{prefix}{:016x}.half", chance.bits());
            fs::write(name, "").expect("a file in /dev/shm");
        }
        "swap the model" | "offer broken models" => offer(kind == "swap the model", pair, chance),
        "a crowd looks on" => {
            let join = || Monitor::connect_to(&pair.place.cell(), Duration::from_millis(300));
            drop((0..20).map(|_| join()).collect::<Vec<_>>());
        }
        other => panic!("no such fault: {other}"),
    }
}

/// Kills them, and up to twice in their first 30 ms.
fn again(pair: &mut Pair<'_>, chance: &mut Chance, order: &[Who]) {
    pair.strike(order, chance);
    for _ in 0..chance.below(3) {
        std::thread::sleep(Duration::from_micros(chance.below(30_000)));
        pair.strike(order, chance);
    }
}

fn memory(pair: &Pair<'_>, what: impl Fn(&Path)) {
    let prefix = pair.place.cell().shared_memory_prefix();
    for entry in fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(&prefix) {
            what(&entry.path());
        }
    }
}

/// Asks the daemon to load models; what it answers is its own affair, as it may be busy with another fault.
fn offer(good: bool, pair: &Pair<'_>, chance: &mut Chance) {
    let Ok(mut monitor) = Monitor::connect_to(&pair.place.cell(), JAM) else { return };
    let whole = fs::read_to_string(pair.place.file("model.toml")).expect("the model");
    for _ in 0..5 {
        let end = if good { whole.len() } else { chance.below(whole.len() as u64) as usize };
        // A cut may fall between two tables: then it is a model, and what follows is a swap all the same.
        pair.place.write("offered.toml", whole.get(..end).unwrap_or_default());
        let _ = monitor.reload(Some(&pair.place.file("offered.toml")), BAR);
    }
    let _ = monitor.reload(Some(&pair.place.file("model.toml")), BAR);
}

/// The account; whether nothing was late.
fn told(seen: &BTreeMap<&str, Seen>) -> bool {
    println!("{:<24} {:>6} {:>12} {:>6}", "fault", "times", "worst, ms", "late");
    for (kind, Seen { times, worst, late }) in seen {
        println!("{kind:<24} {times:>6} {:>12.1} {late:>6}", worst.as_secs_f64() * 1e3);
    }
    let late: u32 = seen.values().map(|seen| seen.late).sum();
    println!("{late} late by the bar of {BAR:?}");
    late == 0
}

/// Whether the daemon's memory stayed as it was.
fn flat(resident_kb: &[u64]) -> bool {
    let [Some(first), Some(middle), Some(last)] =
        [1, resident_kb.len() / 2, resident_kb.len().saturating_sub(1)]
            .map(|at| resident_kb.get(at))
    else {
        println!("too short to tell of memory");
        return true;
    };
    println!("the daemon's memory in its long life, kB: {first} first, {middle} amid, {last} last");
    *last as f64 <= FLAT * *first.max(middle) as f64
}
