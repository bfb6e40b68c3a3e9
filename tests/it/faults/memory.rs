//! Files in shared memory that are removed, changed, left behind or owned by another user.

use super::{at_work, wait_for};
use crate::{PROGRAMS, TRUED};
use rustix::fs::chown;
use rustix::process::{Gid, Signal, Uid, geteuid};
use std::fs;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use tests::clients::skipped;
use tests::place::TestDirectory;
use tests::process::Process;
use tests::served_cell::{AWAIT_LIMIT, CellProcess, ServedCell};

const SYSTEM_FAILED: Option<i32> = Some(3);
/// Another user.
const SOMEBODY: u32 = 65_534;

/// The cell's memory.
fn memory(place: &TestDirectory) -> Vec<PathBuf> {
    let prefix = place.cell().shared_memory_prefix();
    let entries = fs::read_dir("/dev/shm").unwrap().flatten().map(|entry| entry.path());
    let ours = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().starts_with(&prefix);
    entries.filter(ours).collect()
}

fn mode(mode: u32) -> fs::Permissions {
    std::os::unix::fs::PermissionsExt::from_mode(mode)
}

fn is_root(what: &str) -> bool {
    let root = geteuid().is_root();
    if !root {
        let scratch = Path::new(env!("CARGO_TARGET_TMPDIR"));
        skipped(scratch, what, "only root may act as another user");
    }
    root
}

#[test]
fn files_removed_or_changed_under_a_running_daemon_are_created_again() {
    let mut pair = at_work();
    let dir = pair.place.cell().dir().to_path_buf();
    let tears: [(&str, &dyn Fn()); 6] = [
        ("its mode", &|| fs::set_permissions(&dir, mode(0o755)).unwrap()),
        ("the folder", &|| fs::remove_dir_all(&dir).unwrap()),
        ("the announcement", &|| fs::remove_file(dir.join("current")).unwrap()),
        ("its words", &|| fs::write(dir.join("current"), "trued.current/1\ncontr").unwrap()),
        ("the lock", &|| fs::remove_file(dir.join("daemon.lock")).unwrap()),
        ("the cell's lock", &|| fs::remove_file(dir.join("cell.lock")).unwrap()),
    ];
    for (what, tear) in tears {
        tear();
        std::thread::sleep(std::time::Duration::from_millis(100));
        println!("{what}: answered after {:?}", pair.wait_answered());
        pair.restart(CellProcess::Monitor);
        let joined = pair.monitor.as_ref().unwrap().wait_answered(&pair.daemon, AWAIT_LIMIT);
        assert!(joined.is_some(), "{what}: a late reader gets in: {:#?}", pair.daemon.lines());
    }
    let mut second = Process::daemon(TRUED, &pair.place);
    assert_eq!(second.wait().code(), SYSTEM_FAILED, "one daemon as before");
    pair.end();
}

#[test]
fn memory_removed_under_a_running_cell_costs_it_nothing_and_a_late_reader_gets_in() {
    let mut pair = at_work();
    memory(&pair.place).iter().for_each(|path| fs::remove_file(path).unwrap());
    pair.wait_answered();
    let lost = pair.cell.lines().iter().any(|line| line.starts_with("Lost"));
    assert!(!lost, "{:#?}", pair.cell.lines());
    pair.restart(CellProcess::Monitor);
    let joined = pair.monitor.as_ref().unwrap().wait_answered(&pair.daemon, AWAIT_LIMIT);
    println!("a late reader is in after {joined:?}");
    assert!(joined.is_some(), "{:#?}", pair.daemon.lines());
    pair.wait_answered();
    pair.end();
}

#[test]
fn memory_removed_while_a_new_epoch_is_joined_leaves_no_cell_unanswered() {
    let mut pair = at_work();
    for round in 0..8 {
        fs::remove_file(pair.place.cell().dir().join("current")).unwrap();
        // While ports are created at both ends: each then has separate memory under one name.
        let torn = Instant::now();
        while torn.elapsed() < Duration::from_millis(60 + 10 * round) {
            memory(&pair.place).iter().for_each(|path| drop(fs::remove_file(path)));
        }
        pair.wait_answered();
        std::thread::sleep(Duration::from_millis(400));
    }
    pair.end();
}

#[test]
fn a_daemon_whose_cell_another_one_took_ends_and_leaves_it_alone() {
    let mut pair = at_work();
    pair.daemon.signal(Signal::STOP);
    fs::remove_dir_all(pair.place.cell().dir()).unwrap();
    let second = Process::daemon(TRUED, &pair.place);
    assert!(second.wait_for_output("ready", AWAIT_LIMIT), "{:#?}", second.lines());
    pair.daemon.signal(Signal::CONT);
    let mut first = std::mem::replace(&mut pair.daemon, second);
    assert_eq!(first.wait().code(), SYSTEM_FAILED, "{:#?}", first.lines());
    let output = first.lines().join("\n");
    assert!(output.contains(&format!("process {}", pair.daemon.id())), "{output}");
    pair.wait_answered();
    pair.end();
}

#[test]
fn incomplete_remains_of_a_crash_do_not_delay_the_next_start() {
    let mut pair = at_work();
    pair.daemon.kill();
    pair.cell.kill();
    let epoch = fs::read_dir(pair.place.cell().dir()).unwrap().flatten();
    let epoch = epoch.map(|entry| entry.path()).find(|path| path.is_dir()).unwrap();
    // As a kill in the middle leaves them: a service cut short, memory without a size, an announcement half written.
    for service in fs::read_dir(epoch.join("services")).unwrap().flatten() {
        fs::remove_file(service.path()).unwrap();
        fs::write(service.path(), "").unwrap();
    }
    for path in memory(&pair.place) {
        fs::write(path, "").unwrap();
    }
    fs::write(pair.place.cell().dir().join("current.new"), "trued.cur").unwrap();
    pair.restart(CellProcess::Daemon);
    pair.restart(CellProcess::Cell);
    println!("answered after {:?}", pair.wait_answered());
    pair.end();
}

#[test]
fn a_cell_of_another_user_is_refused_and_reported() {
    let place = TestDirectory::new("full", "");
    let dir = place.cell().dir().to_path_buf();
    fs::create_dir(&dir).unwrap();
    fs::set_permissions(&dir, mode(0o777)).unwrap();
    let mut open = Process::daemon(TRUED, &place);
    assert_eq!(open.wait().code(), SYSTEM_FAILED);
    assert!(open.lines().join("\n").contains("expected user"), "{:#?}", open.lines());
    if !is_root("a cell's folder that another user owns") {
        return;
    }
    fs::set_permissions(&dir, mode(0o700)).unwrap();
    chown(&dir, Some(Uid::from_raw(SOMEBODY)), Some(Gid::from_raw(SOMEBODY))).unwrap();
    let mut daemon = Process::daemon(TRUED, &place);
    assert_eq!(daemon.wait().code(), SYSTEM_FAILED);
    let output = daemon.lines().join("\n");
    assert!(output.contains(&format!("belongs to user {SOMEBODY}")), "{output}");
    fs::remove_dir(&dir).unwrap();
}

#[test]
fn memory_that_somebody_else_left_is_no_obstacle() {
    if !is_root("memory that another user left behind") {
        return;
    }
    let place = TestDirectory::new("full", "");
    for path in [place.root().to_path_buf(), place.file("")] {
        chown(path, Some(Uid::from_raw(SOMEBODY)), Some(Gid::from_raw(SOMEBODY))).unwrap();
    }
    // In a folder whose sticky bit prevents others from removing it.
    let left = format!("/dev/shm/{}0000000000000001.left", place.cell().shared_memory_prefix());
    fs::write(&left, "").unwrap();
    let run_as = |program: &str, args: &[&str]| {
        Process::spawn(Command::new(program).args(args).uid(SOMEBODY).gid(SOMEBODY), &place)
    };
    let config = place.file("cell.toml").display().to_string();
    let mut daemon = run_as(TRUED, &["run", "--config", &config]);
    let mut cell = run_as(PROGRAMS.rig, &[]);
    let answered = wait_for(AWAIT_LIMIT, || cell.answered_since(0, daemon.id()));
    assert!(answered, "{:#?} {:#?}", daemon.lines(), cell.lines());
    assert!(Path::new(&left).exists(), "the test's own premise");
    assert!(cell.close_input().success() && daemon.end().success());
    fs::remove_file(&left).unwrap();
    assert_eq!(place.remaining_names(), Vec::<String>::new());
}

#[test]
fn two_daemons_that_start_at_once_are_one_that_serves_and_one_that_is_refused() {
    for _ in 0..4 {
        let place = TestDirectory::new("full", &tests::served_cell::recorder("box"));
        let mut both = [0, 1].map(|_| Process::daemon(TRUED, &place));
        assert!(wait_for(AWAIT_LIMIT, || both.iter_mut().any(|daemon| !daemon.is_running())));
        let refused = usize::from(both[0].is_running());
        assert_eq!(both[refused].wait().code(), SYSTEM_FAILED, "{:#?}", both[refused].lines());
        let [first, second] = both;
        let serves = if refused == 0 { second } else { first };
        let mut pair = ServedCell::with(PROGRAMS, place, serves);
        pair.wait_answered();
        pair.end();
    }
}
