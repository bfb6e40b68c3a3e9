//! Contents of the package: units for a service manager with the documented restrictions, and a
//! cell that starts in shadow mode.

use crate::TRUED;
use recording::cell::{CellConfig, Mode};
use recording::model::RobotModel;
use shm_schema::RUNTIME_DIR_ENV;
use std::fs;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tests::clients::{has, root, run, skipped};
use tests::place::TestDirectory;

const LIMIT: Duration = Duration::from_secs(20);
/// The largest exposure of a service, by `systemd-analyze security`, times ten.
const EXPOSURE_MAX: &str = "25";
const UNITS: [&str; 3] = ["trued@.service", "trued-bridge@.service", "trued-plant@.service"];

fn deploy(name: &str) -> PathBuf {
    root().join("deploy").join(name)
}

/// Whether a tool is available; otherwise this is reported and counted.
fn can(tool: &str, claim: &str) -> bool {
    let is_installed = has(tool);
    if !is_installed {
        let why = format!("no `{tool}` (Debian: apt-get install systemd)");
        skipped(Path::new(env!("CARGO_TARGET_TMPDIR")), claim, &why);
    }
    is_installed
}

#[test]
fn the_daemon_tells_its_service_manager_that_it_is_ready_alive_and_ending() {
    let place = TestDirectory::new("shadow", "");
    // Without a single command: the cycle lives all the same.
    attended(&place, &["run", "--config"], "cell.toml");
}

#[test]
fn a_bridge_tells_its_service_manager_that_it_is_ready_alive_and_ending() {
    let place = TestDirectory::new("shadow", "[cycle]\nperiod_ms = 4.0\nstale_ms = 100.0\n");
    // Without a controller, an application, a daemon: its loop turns all the same.
    let application = tests::egm::socket().local_addr().ok();
    place.write("bridge.toml", &tests::egm::config("off", "joints", application, ""));
    attended(&place, &["bridge", "egm", "--config"], "bridge.toml");
}

/// A process notifies a simulated service manager that it is ready, alive, and ending.
fn attended(place: &TestDirectory, arguments: &[&str], config: &str) {
    let path = place.file("notify");
    let manager = UnixDatagram::bind(&path).unwrap();
    manager.set_read_timeout(Some(LIMIT)).unwrap();
    let mut process = Command::new(TRUED)
        .args(arguments)
        .arg(place.file(config))
        .env(RUNTIME_DIR_ENV, place.root())
        .env("NOTIFY_SOCKET", &path)
        .env("WATCHDOG_USEC", "300000")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let received = || {
        let mut bytes = [0; 1024];
        let length = manager.recv(&mut bytes).expect("a word within the limit");
        String::from_utf8_lossy(&bytes[..length]).into_owned()
    };
    assert!(received().starts_with("READY=1\nSTATUS="), "ready first");
    for _ in 0..3 {
        assert!(received().starts_with("WATCHDOG=1\nSTATUS="));
    }
    let pid = rustix::process::Pid::from_child(&process);
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
    let since = Instant::now();
    while received() != "STOPPING=1" {
        assert!(since.elapsed() < LIMIT);
    }
    assert!(process.wait().unwrap().success());
}

#[test]
fn the_units_are_closed_as_far_as_promised() {
    if !can("systemd-analyze", "units: exposure") {
        return;
    }
    for unit in UNITS {
        let threshold = format!("--threshold={EXPOSURE_MAX}");
        let mut analyze = Command::new("systemd-analyze");
        analyze.args(["security", "--offline=true", "--no-pager", &threshold]);
        let output = run(analyze.arg(deploy("systemd").join(unit)));
        println!("{}", String::from_utf8_lossy(&output.stdout).lines().last().unwrap_or_default());
    }
}

#[test]
fn the_units_have_no_key_that_the_service_manager_does_not_know() {
    if !can("systemd-analyze", "units: keys") {
        return;
    }
    for unit in UNITS {
        let mut analyze = Command::new("systemd-analyze");
        let output = analyze.arg("verify").arg(deploy("systemd").join(unit)).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        // The program and its page are not installed where this test runs.
        let is_absence = |line: &str| {
            let is_program = line.contains("/usr/bin/trued") && line.contains("is not executable");
            is_program || line.contains("'man trued")
        };
        let fault = stderr.lines().find(|line| !is_absence(line));
        assert_eq!(fault, None, "{stderr}");
    }
}

#[test]
fn user_and_folders_are_made_as_the_unit_needs_them() {
    if !can("systemd-sysusers", "the user `trued`") || !can("systemd-tmpfiles", "its folders") {
        return;
    }
    let scratch = TestDirectory::new("shadow", "");
    let root_option = format!("--root={}", scratch.root().display());
    fs::create_dir(scratch.root().join("etc")).unwrap();
    run(Command::new("systemd-sysusers").arg(&root_option).arg(deploy("systemd/trued.sysusers")));
    let users = fs::read_to_string(scratch.root().join("etc/passwd")).unwrap();
    let user = users.lines().find(|line| line.starts_with("trued:")).unwrap();
    assert!(user.ends_with("/nologin") && user.contains(":/var/lib/trued:"), "{user}");
    let unit = fs::read_to_string(deploy("systemd/trued@.service")).unwrap();
    assert!(unit.contains("User=trued\n") && unit.contains("TRUED_RUNTIME_DIR=/run/trued\n"));
    let folders = fs::read_to_string(deploy("systemd/trued.tmpfiles")).unwrap();
    assert!(folders.contains("d /run/trued 0700 trued trued"), "{folders}");
    if rustix::process::geteuid().is_root() {
        run(Command::new("systemd-tmpfiles")
            .args(["--create", &root_option])
            .arg(deploy("systemd/trued.tmpfiles")));
        assert!(scratch.root().join("var/lib/trued/recordings").is_dir());
    }
}

#[test]
fn the_cell_that_is_installed_starts_as_it_is_and_changes_nothing() {
    let config = CellConfig::read(&deploy("etc/cell.toml")).unwrap();
    assert_eq!(config.mode, Mode::Shadow);
    let model = RobotModel::read(&config.model).unwrap();
    assert!(
        config.check_against("cell.toml", &daemon::setup::joint_kinds(&model.physics.arm)).is_ok()
    );
    let recorder = config.recorder.unwrap();
    assert!(recorder.dir.starts_with("/var/lib/trued"), "where the unit may write");
    // Commented settings are valid too.
    let text = fs::read_to_string(deploy("etc/cell.toml")).unwrap();
    let all = text.replace("\n#[", "\n[").lines().map(uncommented).collect::<Vec<_>>().join("\n");
    let whole = CellConfig::parse("cell.toml", &all).unwrap();
    assert!(whole.force.is_some() && whole.vibration.is_some() && whole.realtime.core.is_some());
}

/// A key after a comment sign without a space can be enabled.
fn uncommented(line: &str) -> &str {
    let key = line.strip_prefix('#').filter(|rest| rest.starts_with(|c: char| c.is_lowercase()));
    key.filter(|rest| rest.contains(" = ")).unwrap_or(line)
}
