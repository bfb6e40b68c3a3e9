//! Random faults over real processes, for a given time: `cargo xtask soak`.
//!
//! Arguments: minutes, seed. After each fault the robot's loop must be answered within a second,
//! with no limit broken; the daemon's memory is printed, and must not grow. In the last two thirds
//! the daemon is not ended, so that one process runs for long. Exit code 1 if something was late,
//! or memory grew.
#![expect(clippy::print_stdout, reason = "its account is what it is for")]
#![expect(clippy::expect_used, reason = "a soak that cannot go on ends loudly")]

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tests::fault_injection::{DEADLY, FULL_DISK, KINDS, strike};
use tests::memory::{FLAT, is_flat, thirds};
use tests::place::TestDirectory;
use tests::process::Process;
use tests::rng::TestRng;
use tests::served_cell::{Programs, ServedCell, recorder};

/// Time limit for the recovery of the service.
const BAR: Duration = Duration::from_secs(1);
/// Environment variable that marks the separate mount namespace.
const WITH_DISK: &str = "with-disk";
/// Size of the recordings' disk, MB: two files and a margin for closing one.
const DISK_MB: u32 = 32;

/// Statistics of one kind of fault.
#[derive(Default)]
struct FaultStatistics {
    times: u32,
    worst: Duration,
    late: u32,
}

fn main() {
    let number = |index: usize| {
        std::env::args().nth(index).and_then(|argument| argument.parse::<f64>().ok())
    };
    let minutes = number(1).unwrap_or(60.0);
    let seed = number(2).map_or_else(trued_client::monotonic_ns, |seed| seed as u64);
    let has_disk = std::env::args().nth(3).as_deref() == Some(WITH_DISK);
    if !has_disk {
        let why = with_a_disk(&[&minutes.to_string(), &seed.to_string(), WITH_DISK]);
        println!("SKIPPED: a full disk: {why}");
    }
    println!("{minutes} minutes of faults, seed {seed}");
    let programs = std::env::current_exe().expect("a path");
    let beside = |name: &str| programs.with_file_name(name).display().to_string();
    let (trued, rig) = (beside("trued-under-test"), beside("rig-cell"));
    let sound = soak(Programs { trued: &trued, rig: &rig }, minutes * 60.0, seed, has_disk);
    std::process::exit(i32::from(!sound));
}

/// Continues in a separate mount namespace, where recordings may have a small disk; returns only if
/// that is impossible, with the reason.
fn with_a_disk(arguments: &[&str]) -> String {
    let mut unshare = vec!["unshare", "--mount"];
    if !rustix::process::geteuid().is_root() {
        unshare.extend(["--user", "--map-root-user"]);
    }
    let command = |program: &Path| {
        let mut command = Command::new(unshare[0]);
        command.args(&unshare[1..]).arg(program);
        command
    };
    let may = command(Path::new("true")).stderr(Stdio::null()).status();
    if !may.is_ok_and(|status| status.success()) {
        return "no mount namespace of its own may be made".to_owned();
    }
    let myself = std::env::current_exe().expect("a path");
    command(&myself).args(arguments).exec().to_string()
}

/// The small disk of a place, removed with it.
struct Disk(PathBuf);

impl Disk {
    fn mount(place: &TestDirectory) -> Self {
        let folder = place.file("box");
        fs::create_dir(&folder).expect("a folder in /dev/shm");
        let size = format!("size={DISK_MB}m");
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(folder);
        assert!(mount.status().is_ok_and(|status| status.success()), "a disk for the black boxes");
        Self(place.root().to_path_buf())
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.0.join("files/box")).status();
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn soak(programs: Programs<'_>, seconds: f64, seed: u64, has_disk: bool) -> bool {
    let mut chance = TestRng::new(seed);
    let place = TestDirectory::new(
        "full",
        &format!("{}max_file_MB = 8\nkeep_files = 2\n", recorder("box")),
    );
    let _disk = has_disk.then(|| Disk::mount(&place));
    let kinds: Vec<&str> = KINDS.into_iter().filter(|k| has_disk || *k != FULL_DISK).collect();
    let daemon = Process::daemon(programs.trued, &place);
    let mut pair = ServedCell::with(programs, place, daemon);
    pair.start_observers();
    pair.wait_answered();
    let (start, mut statistics) = (Instant::now(), BTreeMap::<&str, FaultStatistics>::new());
    let mut resident = Vec::new();
    while start.elapsed().as_secs_f64() < seconds {
        let spares = start.elapsed().as_secs_f64() > seconds / 3.0;
        let first_kind = if spares { DEADLY } else { 0 };
        let kind = kinds[first_kind + chance.below((kinds.len() - first_kind) as u64) as usize];
        let before_kb = pair.daemon.resident_kb().unwrap_or(0);
        println!("{:.2} s, {before_kb} kB: {kind}", start.elapsed().as_secs_f64());
        let time = strike(kind, &mut pair, &mut chance).max(pair.wait_answered());
        let statistics = statistics.entry(kind).or_default();
        statistics.times += 1;
        statistics.worst = statistics.worst.max(time);
        statistics.late += u32::from(time > BAR);
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
    print_results(&statistics) & flat(&resident)
}

/// Prints the results; returns whether nothing was late.
fn print_results(statistics: &BTreeMap<&str, FaultStatistics>) -> bool {
    println!("{:<24} {:>6} {:>12} {:>6}", "fault", "times", "worst, ms", "late");
    for (kind, FaultStatistics { times, worst, late }) in statistics {
        println!("{kind:<24} {times:>6} {:>12.1} {late:>6}", worst.as_secs_f64() * 1e3);
    }
    let late: u32 = statistics.values().map(|statistics| statistics.late).sum();
    println!("{late} late by the bar of {BAR:?}");
    late == 0
}

/// Whether the daemon's memory did not grow.
fn flat(resident_kb: &[u64]) -> bool {
    let Some(thirds) = thirds(resident_kb) else {
        println!("too short to tell of memory: {} looks at it", resident_kb.len());
        return true;
    };
    let [first, second, last] = thirds;
    println!(
        "the daemon's memory in its long life, kB, medians of thirds: {first}, {second}, {last}: {:+.2} % at the end, at most {:+.2} % is flat",
        100.0 * (last as f64 / second as f64 - 1.0),
        100.0 * (FLAT - 1.0),
    );
    is_flat(thirds)
}
