//! A running cell, monitored and controlled from the shell.

use crate::TRUED;
use crate::program::Place as Folder;
use std::process::{Command, Stdio};
use std::time::Duration;
use tests::cell_loop::CellLoop;
use tests::clients::root;
use tests::place::{CELL, TestDirectory};
use tests::process::Process;
use tests::rng::TestRng;
use trued_client::{Mode, monotonic_ns};

const LIMIT: Duration = Duration::from_secs(10);
/// A share of the envelope's 20 mrad that limited mode leaves, rad.
const LIMITED_RAD: f64 = 2e-3;

/// How a command ended.
pub(crate) struct Done {
    pub(crate) code: Option<i32>,
    pub(crate) output: String,
    pid: u32,
}

pub(crate) fn trued(place: &TestDirectory, arguments: &[&str]) -> Done {
    let mut command = Command::new(TRUED);
    command.args(arguments).env(shm_schema::RUNTIME_DIR_ENV, place.root());
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let pid = child.id();
    let done = child.wait_with_output().unwrap();
    let output = String::from_utf8_lossy(&[done.stdout, done.stderr].concat()).into_owned();
    Done { code: done.status.code(), output, pid }
}

#[test]
fn a_bypass_that_a_program_left_behind_is_shown_with_who_asked_and_undone_from_the_shell() {
    let place = TestDirectory::new("full", "");
    let daemon = Process::ready_daemon(TRUED, &place);
    let mut cell = CellLoop::join(&place.cell(), LIMIT).unwrap();
    assert!(cell.tick_until(LIMIT, |_, tick| tick.largest() > 1e-4));
    let left = trued(&place, &["bypass", "on"]);
    assert_eq!(left.code, Some(0), "{}", left.output);
    assert!(left.output.contains("until `trued bypass off`"), "{}", left.output);
    assert!(cell.tick_until(LIMIT, |_, tick| tick.largest() == 0.0), "out");
    let shown = trued(&place, &["status", CELL]);
    let by = format!("process {}, user ", left.pid);
    let flat = shown.output.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in ["bypass ON", "`trued bypass off` ends the bypass", "bypassed since 2", by.as_str()]
    {
        assert!(flat.contains(part), "{part}: {}", shown.output);
    }
    let config = place.file("cell.toml");
    let ended = trued(&place, &["bypass", "off", config.to_str().unwrap()]);
    assert_eq!(ended.code, Some(0), "{}", ended.output);
    assert!(cell.tick_until(LIMIT, |_, tick| tick.largest() > 1e-4), "in again");
    let shown = trued(&place, &["status"]);
    assert!(shown.output.contains("bypass    off"), "{}", shown.output);
    assert_eq!(cell.broken, Vec::<String>::new());
    for done in [&left, &ended] {
        let by = format!("process {}, user ", done.pid);
        let is_logged = |line: &String| line.contains("request: bypass") && line.contains(&by);
        assert!(daemon.lines().iter().any(is_logged), "{by}: {:#?}", daemon.lines());
    }
}

#[test]
fn modes_change_without_a_restart_and_the_robot_never_steps() {
    let place = TestDirectory::new("full", "");
    let mut daemon = Process::ready_daemon(TRUED, &place);
    let mut cell = CellLoop::join(&place.cell(), LIMIT).unwrap();
    let seed = monotonic_ns();
    println!("seed {seed}");
    let mut chance = TestRng::new(seed);
    let root = place.root().to_owned();
    for round in 0..12 {
        let mode = ["limited", "full", "shadow"][chance.below(3) as usize];
        let asking = {
            let root = root.clone();
            std::thread::spawn(move || {
                let mut command = Command::new(TRUED);
                command.args(["mode", mode, CELL]).env(shm_schema::RUNTIME_DIR_ENV, root);
                command.output().unwrap().status.code()
            })
        };
        // Mostly in the middle of the ramp before.
        let time = Duration::from_millis(20 + chance.below(400));
        cell.tick_until(time, |_, _| false);
        assert_eq!(asking.join().unwrap(), Some(0), "round {round}, {mode}");
    }
    for (name, mode) in [("limited", Mode::Limited), ("full", Mode::Full)] {
        assert_eq!(trued(&place, &["mode", name]).code, Some(0));
        let is_reported = cell.tick_until(LIMIT, |cell, _| {
            cell.client.status().is_some_and(|status| status.mode() == Ok(mode))
        });
        assert!(is_reported, "{name}");
        cell.tick_until(Duration::from_millis(1500), |_, _| false);
        let largest = cell.tick().largest();
        assert!(largest > 1e-4, "{name}: {largest} rad");
        assert!(mode == Mode::Full || largest <= LIMITED_RAD, "{name}: {largest} rad");
    }
    // Short: the loop assumes shadow mode until a status says otherwise.
    assert_eq!(trued(&place, &["mode", "shadow"]).code, Some(0));
    assert!(cell.tick_until(LIMIT, |_, tick| tick.largest() == 0.0), "shadow");
    assert_eq!(trued(&place, &["arm"]).code, Some(0));
    assert!(cell.tick_until(LIMIT, |_, tick| tick.largest() > 1e-4), "back in the configured mode");
    assert_eq!(cell.broken, Vec::<String>::new());
    assert!(daemon.is_running(), "the same daemon all along");
}

#[test]
fn a_mode_beyond_what_the_configuration_allows_is_refused_and_one_within_is_not() {
    let place = TestDirectory::new("limited", "");
    let daemon = Process::ready_daemon(TRUED, &place);
    let refused = trued(&place, &["mode", "full"]);
    assert_eq!(refused.code, Some(1), "{}", refused.output);
    for part in ["allows at most `limited`", "mode_max = \"full\""] {
        assert!(refused.output.contains(part), "{part}: {}", refused.output);
    }
    assert_eq!(trued(&place, &["mode", "shadow"]).code, Some(0));
    drop(daemon);
    // A cell that starts in shadow mode and may go further.
    let place = TestDirectory::new("shadow\"\nmode_max = \"full", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    assert_eq!(trued(&place, &["arm"]).code, Some(1), "the configured mode is shadow");
    assert_eq!(trued(&place, &["mode", "full"]).code, Some(0));
    let is_shown = || trued(&place, &["status"]).output.contains("mode      full");
    assert!(super::faults::wait_for(LIMIT, is_shown));
    let mut cell = CellLoop::join(&place.cell(), LIMIT).unwrap();
    assert!(cell.tick_until(LIMIT, |_, tick| tick.largest() > 1e-4));
    assert_eq!(cell.broken, Vec::<String>::new());
}

#[test]
fn a_cell_needs_no_name_where_it_is_the_only_one() {
    let place = TestDirectory::new("shadow", "");
    let none = trued(&place, &["status"]);
    assert_eq!(none.code, Some(3), "{}", none.output);
    assert!(none.output.contains("no running cell found"), "{}", none.output);
    let _daemon = Process::ready_daemon(TRUED, &place);
    assert_eq!(trued(&place, &["status"]).code, Some(0));
    assert_eq!(trued(&place, &["status", "other"]).code, Some(3));
    let text = std::fs::read_to_string(place.file("cell.toml")).unwrap();
    place.write("second.toml", &text.replace(&format!("\"{CELL}\""), "\"second\""));
    let config = place.file("second.toml");
    let mut second = Process::start(TRUED, &["run", "--config", config.to_str().unwrap()], &place);
    assert!(second.wait_for_output("ready", LIMIT), "{:?}", second.lines());
    let several = trued(&place, &["bypass", "on"]);
    assert_eq!(several.code, Some(2), "{}", several.output);
    assert!(several.output.contains(&format!("{CELL}, second")), "{}", several.output);
    assert_eq!(trued(&place, &["status", "second"]).code, Some(0));
    // After a kill nothing of the place's own cell is left.
    assert!(second.end().success(), "{:?}", second.lines());
}

/// Every key of an object, those within too.
fn keys(value: &serde_json::Value) -> Vec<String> {
    let within = |(key, value): (&String, &serde_json::Value)| {
        let mut found = keys(value);
        found.push(key.clone());
        found
    };
    value.as_object().into_iter().flatten().flat_map(within).collect()
}

#[test]
fn a_status_fits_a_terminal_and_its_keys_stand_in_the_reference() {
    let place =
        TestDirectory::new("full", "[force]\nrate_Hz = 10000.0\n[vibration]\nenabled = true\n");
    let mut daemon = Process::ready_daemon(TRUED, &place);
    let shown = trued(&place, &["status"]);
    assert!(shown.output.lines().all(|line| line.chars().count() <= 80), "{}", shown.output);
    let done = trued(&place, &["status", "--quiet", "--json", "-"]);
    let json = done.output.split_once("\n}\n").map(|(json, _)| format!("{json}\n}}"));
    let json: serde_json::Value = serde_json::from_str(&json.unwrap()).unwrap();
    assert_eq!(json["schema"], "trued.status/1");
    assert_eq!(json["pid"], daemon.id());
    let page = std::fs::read_to_string(root().join("docs/reference/status.md")).unwrap();
    for key in keys(&json).iter().filter(|key| *key != "schema") {
        let named = [format!("`{key}`"), format!("`{key}[]`")];
        assert!(named.iter().any(|named| page.contains(named.as_str())), "{key}");
    }
    // A monitor watches while the daemon ends.
    let watch = Process::start(TRUED, &["status", "--watch", CELL], &place);
    assert!(watch.wait_for_output("health    idle", LIMIT), "{:?}", watch.lines());
    daemon.kill();
    assert!(watch.wait_for_output("NOT RUNNING", LIMIT), "{:?}", watch.lines());
    watch.signal(rustix::process::Signal::INT);
    let mut watch = watch;
    assert_eq!(watch.wait().code(), Some(0));
}

#[test]
fn the_help_of_bypass_says_that_it_stays_and_how_it_ends() {
    let done = Folder::new().succeed(&["bypass", "--help"]);
    let flat = done.out.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in ["The bypass remains after this command", "`off`: the correction ramps in again"] {
        assert!(flat.contains(part), "{part}: {flat}");
    }
}
