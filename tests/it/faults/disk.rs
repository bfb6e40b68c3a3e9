//! A disk that is full, or does not respond: it affects the recording, not the robot.

use super::wait_for;
use crate::{PROGRAMS, TRUED};
use rustix::process::Signal;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use tests::clients::skipped;
use tests::hang::BlockedWrites;
use tests::place::TestDirectory;
use tests::process::Process;
use tests::served_cell::{AWAIT_LIMIT, ServedCell, recorder};
use trued_client::{Health, Monitor, Status};

/// `RecorderState`, as the status carries it.
const RECORDING: u32 = 1;
const DROPPING: u32 = 2;
const FAILED: u32 = 3;

fn scratch() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
}

fn until(monitor: &mut Monitor, what: &str, holds: impl Fn(&Status) -> bool) -> Duration {
    let start = Instant::now();
    let is_reached =
        wait_for(AWAIT_LIMIT, || monitor.status().is_some_and(|status| holds(&status)));
    assert!(is_reached, "{what}: {:?}", monitor.status());
    start.elapsed()
}

/// A daemon in a separate mount namespace, whose recordings are written to a disk of that size;
/// `None` if the system refuses one.
fn on_a_small_disk(place: &TestDirectory, kilobytes: u32) -> Option<Process> {
    on_a_disk(place, &format!("size={kilobytes}k"))
}

/// The same with any options of its mount.
fn on_a_disk(place: &TestDirectory, options: &str) -> Option<Process> {
    let disk = place.file("box");
    fs::create_dir(&disk).unwrap();
    let script =
        format!("mount -t tmpfs -o {options} tmpfs \"$1\" && exec \"$2\" run --config \"$3\"");
    let mut command = Command::new("unshare");
    if !rustix::process::geteuid().is_root() {
        command.args(["--user", "--map-root-user"]);
    }
    command.args(["--mount", "sh", "-c", &script, "sh"]);
    command.arg(&disk).arg(TRUED).arg(place.file("cell.toml"));
    let mut daemon = Process::spawn(&mut command, place);
    wait_for(AWAIT_LIMIT, || {
        !daemon.is_running() || daemon.lines().iter().any(|line| line == "ready")
    });
    daemon.is_running().then_some(daemon)
}

/// Black boxes on that disk, as the daemon sees it.
fn boxes(disk: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(disk).unwrap().flatten().map(|entry| entry.path());
    let mut boxes: Vec<_> =
        entries.filter(|p| p.extension().is_some_and(|e| e == "mcap")).collect();
    boxes.sort();
    boxes
}

#[test]
fn a_full_disk_costs_records_that_are_counted_and_is_written_again_when_there_is_room() {
    let place = TestDirectory::new("full", &recorder("box"));
    // A repair copies: besides the truncated megabyte and its copy there is space for the file that
    // is being written.
    let Some(daemon) = on_a_small_disk(&place, 4096) else {
        let why = "no mount namespace of its own may be made";
        return skipped(scratch(), "a full disk", why);
    };
    // The disk as seen by the daemon.
    let disk = format!("/proc/{}/root{}", daemon.id(), place.file("box").display());
    let disk = PathBuf::from(disk);
    let mut pair = ServedCell::with(PROGRAMS, place, daemon);
    pair.wait_answered();
    let mut monitor = Monitor::connect_to(&pair.place.cell(), AWAIT_LIMIT).unwrap();
    until(&mut monitor, "it records", |status| status.recorder == RECORDING);
    fs::write(disk.join("filler"), vec![1; 3 << 20]).unwrap();
    until(&mut monitor, "the disk is full", |status| status.recorder == FAILED);
    let begun = boxes(&disk).len();
    until(&mut monitor, "the loss is counted and said", |status| {
        status.recorder_dropped > 1000
            && status.health() == Ok(Health::Degraded)
            && status.message.as_str().contains("nothing is recorded")
    });
    pair.wait_answered();
    assert_eq!(boxes(&disk).len(), begun, "tries that fail leave nothing behind");
    for kept in boxes(&disk) {
        assert!(recording::mcap_recording::read(&kept).is_ok(), "{}", kept.display());
    }
    fs::remove_file(disk.join("filler")).unwrap();
    let time = until(&mut monitor, "it records again", |status| status.recorder == RECORDING);
    println!("recording again {time:?} after there was room");
    // Files truncated by the full disk are repaired by the running daemon.
    let current = boxes(&disk).pop().unwrap();
    let is_whole =
        |path: &PathBuf| *path == current || recording::mcap_recording::is_closed(path).unwrap();
    assert!(wait_for(AWAIT_LIMIT, || boxes(&disk).iter().all(is_whole)), "{:?}", boxes(&disk));
    let newest = boxes(&disk).pop().unwrap();
    assert!(wait_for(AWAIT_LIMIT, || tests::served_cell::last_recorded_ns(
        newest.parent().unwrap()
    ) > 0));
    drop(monitor);
    pair.end();
}

#[test]
fn a_read_only_folder_costs_records_that_are_counted_and_is_written_when_it_may_be() {
    let place = TestDirectory::new("full", &recorder("box"));
    let Some(daemon) = on_a_disk(&place, "ro,size=8m") else {
        let why = "no mount namespace of its own may be made";
        return skipped(scratch(), "a read-only folder", why);
    };
    let disk = PathBuf::from(format!("/proc/{}/root{}", daemon.id(), place.file("box").display()));
    let mut pair = ServedCell::with(PROGRAMS, place, daemon);
    pair.wait_answered();
    let mut monitor = Monitor::connect_to(&pair.place.cell(), AWAIT_LIMIT).unwrap();
    until(&mut monitor, "that nothing is recorded is counted and said", |status| {
        status.recorder == FAILED
            && status.recorder_dropped > 100
            && status.health() == Ok(Health::Degraded)
    });
    pair.wait_answered();
    assert_eq!(boxes(&disk), Vec::<PathBuf>::new());
    let pid = pair.daemon.id().to_string();
    let mut enter = Command::new("nsenter");
    enter.args(["--target", &pid, "--mount"]);
    if !rustix::process::geteuid().is_root() {
        enter.args(["--user", "--preserve-credentials"]);
    }
    enter.args(["mount", "-o", "remount,rw"]).arg(pair.place.file("box"));
    assert!(enter.status().unwrap().success());
    let time = until(&mut monitor, "it records", |status| status.recorder == RECORDING);
    println!("recording {time:?} after the folder may be written");
    drop(monitor);
    pair.wait_answered();
    pair.end();
}

/// Its writes block; `None` if tracing is not permitted.
fn hung(daemon: &Process, seconds: u64) -> Option<BlockedWrites> {
    BlockedWrites::start(daemon, "recorder", Duration::from_secs(seconds))
}

#[test]
fn a_recorder_that_hangs_is_reported_and_blocks_nothing() {
    let mut pair = super::at_work();
    let Some(hang) = hung(&pair.daemon, 4) else {
        return skipped(scratch(), "a recorder that hangs", "no `strace` that may trace");
    };
    let mut monitor = Monitor::connect_to(&pair.place.cell(), AWAIT_LIMIT).unwrap();
    until(&mut monitor, "that it does not respond is told", |status| {
        status.recorder == DROPPING && status.health() == Ok(Health::Degraded)
    });
    pair.wait_answered();
    hang.end();
    let time = until(&mut monitor, "it records again", |status| status.recorder == RECORDING);
    println!("recording again after {time:?}");
    drop(monitor);
    pair.wait_answered();
    pair.end();
}

#[test]
fn a_daemon_whose_recorder_hangs_ends_all_the_same_and_reports_it() {
    let mut pair = super::at_work();
    let Some(hang) = hung(&pair.daemon, 60) else {
        return skipped(scratch(), "an end while the disk hangs", "no `strace` that may trace");
    };
    assert!(pair.cell.close_input().success());
    let start = Instant::now();
    pair.daemon.signal(Signal::TERM);
    assert!(
        pair.daemon.wait_for_output("it does not respond", 3 * AWAIT_LIMIT),
        "{:#?}",
        pair.daemon.lines()
    );
    println!("gave up after {:?}", start.elapsed());
    hang.kill();
    assert_eq!(pair.daemon.wait().code(), Some(3));
    assert_eq!(pair.place.remaining_names(), Vec::<String>::new());
    pair.unbroken();
}

/// In a mount namespace with 20 MB of shared memory: a daemon, then a cell once that memory is
/// full, then free memory again.
const FILLED: &str = "mount -t tmpfs -o size=20m tmpfs /dev/shm || exit 9
export TRUED_RUNTIME_DIR=/dev/shm
\"$1\" run --config \"$3\" &
daemon=$!
while [ ! -e /dev/shm/trued-cell/current ]; do sleep 0.05; done
head -c 30000000 /dev/zero > /dev/shm/filler
sleep 20 | \"$2\" &
cell=$!
sleep 1.5
echo room again
rm /dev/shm/filler
read end
kill $daemon
wait $daemon; echo daemon $?
kill -9 $cell";

#[test]
fn full_shared_memory_refuses_new_clients_and_ends_no_process() {
    let place = TestDirectory::new("full", "");
    // Seen from within, the place is hidden by the small memory.
    let config = scratch().join(format!("full-{}.toml", std::process::id()));
    let model = tests::place::MODEL;
    fs::write(
        &config,
        format!("schema = \"trued.cell/1\"\ncell = \"cell\"\nmodel = \"{model}\"\n"),
    )
    .unwrap();
    let mut command = Command::new("unshare");
    if !rustix::process::geteuid().is_root() {
        command.args(["--user", "--map-root-user"]);
    }
    command.args(["--mount", "sh", "-c", FILLED, "sh", TRUED, PROGRAMS.rig]).arg(&config);
    let mut shell = Process::spawn(&mut command, &place);
    let begun = || shell.wait_for_output("room again", AWAIT_LIMIT);
    if !begun() {
        assert!(!shell.is_running(), "{:#?}", shell.lines());
        return skipped(
            scratch(),
            "full shared memory",
            "no mount namespace of its own may be made",
        );
    }
    assert!(shell.wait_for_output("Connected", AWAIT_LIMIT), "{:#?}", shell.lines());
    let lines = shell.lines();
    let place_of = |start: &str| lines.iter().position(|line| line.starts_with(start));
    assert!(
        place_of("Connected") > place_of("room again"),
        "not before there was room: {lines:#?}"
    );
    std::thread::sleep(Duration::from_millis(300));
    shell.close_input();
    let lines = shell.lines();
    assert!(lines.iter().any(|line| line == "daemon 0"), "{lines:#?}");
    assert!(
        !lines.iter().any(|line| line.contains("Bus error") || line.starts_with("broken")),
        "{lines:#?}"
    );
    fs::remove_file(&config).unwrap();
}
