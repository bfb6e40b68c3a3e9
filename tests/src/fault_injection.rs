//! Faults injected into a running cell, one at a time: used by the soak test.
//!
//! Each is over when its function returns; recoveries (a recording, a refusal) were waited for, and
//! the time is returned. Nothing outside the cell is affected.
#![expect(clippy::print_stdout, reason = "what could not be struck is said")]

use crate::clients::has;
use crate::hang::BlockedWrites;
use crate::message_corruptor::MessageCorruptor;
use crate::process::Process;
use crate::rng::TestRng;
use crate::served_cell::{AWAIT_LIMIT, CellProcess, ServedCell};
use rustix::process::Signal;
use shm_schema::RecorderState;
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::{Duration, Instant};
use trued_client::Monitor;

/// All kinds.
pub const KINDS: [&str; 20] = [
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
    "a second daemon comes",
    "scribble into messages",
    "set the clock",
    "nobody reads the log",
    "the recorder hangs",
    FULL_DISK,
];
/// The first of them end the daemon.
pub const DEADLY: usize = 2;
/// Needs a separate disk for the cell.
pub const FULL_DISK: &str = "fill the disk";
/// Time limit of an answer to a request.
const REQUEST: Duration = Duration::from_secs(1);
/// Time limit of the daemon's repairs, at most four per second.
const MENDED: Duration = Duration::from_millis(400);
/// Largest offset of the commands' clock, ns; it is set in these steps.
const CLOCKS_NS: [i64; 5] = [0, 300_000_000, 600_000_000, 2_000_000_000, 3_600_000_000_000];

/// Injects a fault; returns the time until everything besides the robot's loop had recovered.
pub fn strike(kind: &str, pair: &mut ServedCell<'_>, rng: &mut TestRng) -> Duration {
    let dir = pair.place.cell().dir().to_path_buf();
    match kind {
        "kill the daemon" => again(pair, rng, &[CellProcess::Daemon]),
        "kill daemon and cell" => again(pair, rng, &[CellProcess::Daemon, CellProcess::Cell]),
        "kill the cell" => again(pair, rng, &[CellProcess::Cell]),
        "kill whoever looks on" => again(pair, rng, &[CellProcess::Monitor]),
        "kill the force source" => again(pair, rng, &[CellProcess::Force]),
        "stop one for a while" => {
            let who = CellProcess::ALL[rng.below(4) as usize];
            pair.process(who).signal(Signal::STOP);
            for_a_while(rng, 500);
            pair.process(who).signal(Signal::CONT);
        }
        // Files that the daemon has just repaired may be incomplete: what cannot be removed stays.
        "remove the folder" => drop(fs::remove_dir_all(&dir)),
        "remove the lock" => drop(fs::remove_file(dir.join("daemon.lock"))),
        "spoil the announcement" => drop(fs::write(dir.join("current"), "trued.cur")),
        "remove the memory" => memory(pair, |path| drop(fs::remove_file(path))),
        "leave half-made memory" => {
            let prefix = pair.place.cell().shared_memory_prefix();
            let name = format!("/dev/shm/{prefix}{:016x}.half", rng.next_u64());
            fs::write(name, "").expect("a file in /dev/shm");
        }
        "swap the model" | "offer broken models" => offer(kind == "swap the model", pair, rng),
        "a crowd looks on" => {
            let join = || Monitor::connect_to(&pair.place.cell(), Duration::from_millis(300));
            drop((0..20).map(|_| join()).collect::<Vec<_>>());
        }
        "a second daemon comes" => return second(pair),
        "scribble into messages" => scribble(pair, rng),
        "set the clock" => return clocks(pair, rng),
        "nobody reads the log" => unread(pair, rng),
        "the recorder hangs" => return hung(pair, rng),
        FULL_DISK => return full(pair, rng),
        other => panic!("no such fault: {other}"),
    }
    Duration::ZERO
}

fn for_a_while(rng: &mut TestRng, most_ms: u64) {
    std::thread::sleep(Duration::from_micros(rng.below(1000 * most_ms)));
}

/// Kills them, and up to twice in their first 30 ms.
fn again(pair: &mut ServedCell<'_>, rng: &mut TestRng, order: &[CellProcess]) {
    pair.kill_and_restart(order, rng);
    for _ in 0..rng.below(3) {
        for_a_while(rng, 30);
        pair.kill_and_restart(order, rng);
    }
}

fn memory(pair: &ServedCell<'_>, what: impl Fn(&Path)) {
    let prefix = pair.place.cell().shared_memory_prefix();
    for entry in fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(&prefix) {
            what(&entry.path());
        }
    }
}

/// Requests models from the daemon; its answer is ignored, as it may be busy with another fault.
fn offer(good: bool, pair: &ServedCell<'_>, rng: &mut TestRng) {
    let Ok(mut monitor) = Monitor::connect_to(&pair.place.cell(), AWAIT_LIMIT) else { return };
    let whole = fs::read_to_string(pair.place.file("model.toml")).expect("the model");
    for _ in 0..5 {
        let end = if good { whole.len() } else { rng.below(whole.len() as u64) as usize };
        // Truncation between two tables gives a valid model, which is then activated as usual.
        pair.place.write("offered.toml", whole.get(..end).unwrap_or_default());
        let _ = monitor.reload(Some(&pair.place.file("offered.toml")), REQUEST);
    }
    let _ = monitor.reload(Some(&pair.place.file("model.toml")), REQUEST);
}

/// Another daemon for the same cell, which must be refused by the first one's process id.
fn second(pair: &ServedCell<'_>) -> Duration {
    // A cell without files may be taken over.
    std::thread::sleep(MENDED);
    let start = Instant::now();
    let mut second = Process::daemon(pair.programs().trued, &pair.place);
    let refused = format!("process {}", pair.daemon.id());
    assert!(second.wait_for_output(&refused, AWAIT_LIMIT), "not refused: {:#?}", second.lines());
    let time = start.elapsed();
    assert_eq!(second.wait().code(), Some(3), "{:#?}", second.lines());
    time
}

/// Another client takes the places of robot and force source, and writes into its sent messages.
fn scribble(pair: &mut ServedCell<'_>, rng: &mut TestRng) {
    std::thread::sleep(MENDED);
    for who in [CellProcess::Cell, CellProcess::Force] {
        pair.process(who).kill();
    }
    let mut client = MessageCorruptor::join(&pair.place, &pair.daemon, rng.next_u64());
    let (messages, writes) = (100 + rng.below(1000), TestRng::new(rng.next_u64()));
    client.corrupt_messages(&pair.daemon, messages, writes);
    drop(client);
    for who in [CellProcess::Cell, CellProcess::Force] {
        pair.restart(who);
    }
}

/// Sets the clock of the commands twice; returns the slower recovery.
fn clocks(pair: &mut ServedCell<'_>, rng: &mut TestRng) -> Duration {
    let mut set = |_| {
        let set_ns = CLOCKS_NS[rng.below(CLOCKS_NS.len() as u64) as usize];
        pair.cell.write_line(&format!("clock {set_ns}"));
        // Until it has heard.
        std::thread::sleep(Duration::from_millis(10));
        pair.wait_answered()
    };
    [(); 2].map(&mut set).into_iter().max().unwrap_or_default()
}

/// Fills the pipe of the daemon's log without a reader.
fn unread(pair: &mut ServedCell<'_>, rng: &mut TestRng) {
    pair.daemon.listen(false);
    let log = format!("/proc/{}/fd/2", pair.daemon.id());
    let log = OpenOptions::new().write(true).custom_flags(NONBLOCKING).open(log);
    let mut log = log.expect("the daemon's log");
    while log.write(&b"....\n".repeat(100)).is_ok() {}
    // Each request is logged.
    if let Ok(mut monitor) = Monitor::connect_to(&pair.place.cell(), AWAIT_LIMIT) {
        (0..10).for_each(|k| drop(monitor.bypass(k % 2 == 0, REQUEST)));
    }
    for_a_while(rng, 500);
    pair.wait_answered();
    pair.daemon.listen(true);
}

const NONBLOCKING: i32 = rustix::fs::OFlags::NONBLOCK.bits() as i32;

/// The disk of the recording does not respond for a while.
fn hung(pair: &ServedCell<'_>, rng: &mut TestRng) -> Duration {
    let hang = Some(()).filter(|()| has("strace"));
    let each = Duration::from_millis(250);
    let Some(hang) = hang.and_then(|()| BlockedWrites::start(&pair.daemon, "recorder", each))
    else {
        println!("SKIPPED: a recorder that hangs: no `strace` that may trace");
        return Duration::ZERO;
    };
    for_a_while(rng, 1500);
    hang.end();
    records(pair, true)
}

/// The disk of the black box is full for a while.
fn full(pair: &mut ServedCell<'_>, rng: &mut TestRng) -> Duration {
    let filler = pair.place.file("box").join("filler");
    let mut file = fs::File::create(&filler).expect("a file on the cell's disk");
    while file.write(&[1; 1 << 16]).is_ok() {}
    drop(file);
    records(pair, false);
    for_a_while(rng, 500);
    pair.wait_answered();
    fs::remove_file(&filler).expect("our own file");
    records(pair, true)
}

/// Waits until the daemon records, or has reported that it cannot; returns the time.
fn records(pair: &ServedCell<'_>, well: bool) -> Duration {
    let mut monitor = Monitor::connect_to(&pair.place.cell(), AWAIT_LIMIT).expect("a place");
    let start = Instant::now();
    let wanted = if well { RecorderState::Recording } else { RecorderState::Failed };
    let is = |monitor: &mut Monitor| monitor.status().is_some_and(|s| s.recorder == wanted.code());
    while !is(&mut monitor) {
        assert!(start.elapsed() < AWAIT_LIMIT, "not {wanted:?}: {:?}", monitor.status());
        std::thread::sleep(Duration::from_millis(2));
    }
    start.elapsed()
}
