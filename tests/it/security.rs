//! The threat model (docs/threat-model.md): one user, no network, nothing that others can read or
//! fill.

use crate::{PROGRAMS, TRUED};
use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::{PermissionsExt, chown};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use tests::clients::{run, skipped};
use tests::place::{CELL, TestDirectory};
use tests::process::Process;
use trued_client::Client;

const LIMIT: Duration = Duration::from_secs(20);
/// The user `nobody` of every Linux.
const NOBODY: u32 = 65_534;

/// Whether this test may become another user.
fn may_become_others(claim: &str) -> bool {
    let root = rustix::process::geteuid().is_root() && tests::clients::has("setpriv");
    if !root {
        skipped(Path::new(env!("CARGO_TARGET_TMPDIR")), claim, "not root, or no `setpriv`");
    }
    root
}

/// Prefix of a command to run as that user.
fn as_nobody() -> Command {
    let id = NOBODY.to_string();
    let mut command = Command::new("setpriv");
    command.args(["--reuid", &id, "--regid", &id, "--clear-groups"]);
    command
}

/// A copy of a program that every user may start: the tree's own folders may be closed to others,
/// and execution from `/dev/shm` may be forbidden.
fn program_for_all(program: &str) -> PathBuf {
    let copy = Path::new("/var/tmp").join(format!("trued-it-{:016x}", shm_schema::new_session()));
    fs::copy(program, &copy).unwrap();
    fs::set_permissions(&copy, fs::Permissions::from_mode(0o755)).unwrap();
    copy
}

/// Parts of a cell in shared folders: its directory, which protects its contents, and its blocks.
fn in_memory(place: &TestDirectory) -> Vec<PathBuf> {
    let mut found = vec![place.cell().dir().to_path_buf()];
    let prefix = place.cell().shared_memory_prefix();
    let blocks = fs::read_dir("/dev/shm").unwrap().flatten();
    let ours = blocks.filter(|block| block.file_name().to_string_lossy().starts_with(&prefix));
    found.extend(ours.map(|block| block.path()));
    found
}

#[test]
fn the_daemon_opens_no_network_socket() {
    let place =
        TestDirectory::new("full", "[force]\nrate_Hz = 1000.0\n[vibration]\nband_Hz = [5, 400]\n");
    let daemon = Process::ready_daemon(TRUED, &place);
    let process = PathBuf::from(format!("/proc/{}", daemon.id()));
    let links = fs::read_dir(process.join("fd")).unwrap().flatten();
    let sockets: BTreeSet<String> = links
        .filter_map(|link| fs::read_link(link.path()).ok())
        .filter_map(|to| {
            let to = to.to_string_lossy().into_owned();
            Some(to.strip_prefix("socket:[")?.trim_end_matches(']').to_owned())
        })
        .collect();
    for table in ["tcp", "tcp6", "udp", "udp6", "raw", "raw6", "packet", "icmp"] {
        let table = fs::read_to_string(process.join("net").join(table)).unwrap_or_default();
        for line in table.lines().skip(1) {
            let open = line.split_whitespace().find(|field| sockets.contains(*field));
            assert_eq!(open, None, "a network socket: {line}");
        }
    }
}

#[test]
fn the_shared_memory_of_a_cell_is_closed_to_other_users() {
    let place = TestDirectory::new("full", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    // A later client creates further memory.
    let _client = Client::connect_to(&place.cell(), LIMIT).unwrap();
    let found = in_memory(&place);
    assert!(found.len() > 10, "{found:?}");
    for path in found {
        let mode = fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o077, 0, "{}: mode {mode:o}", path.display());
    }
}

#[test]
fn another_user_is_refused_with_the_reason_and_can_open_nothing() {
    if !may_become_others("a cell is closed to other users") {
        return;
    }
    let place = TestDirectory::new("full", "");
    let mut daemon = Process::ready_daemon(TRUED, &place);
    let program = program_for_all(PROGRAMS.rig);
    let refused = Process::spawn(as_nobody().arg(&program), &place);
    let named = refused.wait_for_output("user 0", LIMIT)
        && refused.wait_for_output(&NOBODY.to_string(), LIMIT);
    fs::remove_file(&program).unwrap();
    assert!(named, "{:?}", refused.lines());
    let may = |operator, path: &Path| {
        as_nobody().args(["test", operator]).arg(path).status().unwrap().success()
    };
    assert!(may("-r", Path::new("/dev/shm")), "the question itself is answered");
    for path in in_memory(&place) {
        for operator in ["-r", "-w"] {
            assert!(!may(operator, &path), "{operator} {}", path.display());
        }
    }
    assert!(daemon.is_running());
}

#[test]
fn a_directory_that_another_user_made_first_is_refused_and_the_user_is_named() {
    if !may_become_others("a squatted directory is refused") {
        return;
    }
    let place = TestDirectory::new("full", "");
    let squatted = place.cell().dir().to_path_buf();
    fs::create_dir(&squatted).unwrap();
    fs::set_permissions(&squatted, fs::Permissions::from_mode(0o700)).unwrap();
    chown(&squatted, Some(NOBODY), Some(NOBODY)).unwrap();
    let mut daemon = Process::daemon(TRUED, &place);
    assert_eq!(daemon.wait().code(), Some(3));
    let output = daemon.lines().join("\n");
    assert!(output.contains(&format!("user {NOBODY}")) && output.contains(CELL), "{output}");
    run(Command::new("rm").arg("-r").arg(&squatted));
}
