//! The bridges as processes, with the real daemon, against independent peers (`ABBRobotEGM`, RSIPI)
//! and a virtual cell.

mod egm;
mod retrofit;
mod rsi;
mod rsi_kinds;

use crate::TRUED;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;
use tests::clients::{root, skipped};
use tests::place::{CELL, TestDirectory};
use tests::process::Process;
use tests::python::environment;

const LIMIT: Duration = Duration::from_secs(20);
/// The peers, as tested.
const PEERS: [&str; 2] = ["ABBRobotEGM==1.0.7", "RSIPI==0.3.0"];

/// Limits so wide that the requested correction is applied at once: the model is tested, not the
/// ramp.
const WIDE: &str = "[envelope]\nangle_mrad = 200.0\nrate_mrad_s = 5000.0\njerk_mrad_s3 = 1e7\n";

fn scratch() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
}

/// A Python that has the peers; none where this machine cannot have them.
fn peers(what: &str) -> Option<&'static Path> {
    static MADE: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    match MADE.get_or_init(|| environment(&scratch().join("peers"), &PEERS)) {
        Ok(python) => Some(python),
        Err(why) => {
            skipped(scratch(), what, why);
            None
        }
    }
}

fn peer(name: &str) -> PathBuf {
    root().join("tests/peers").join(name)
}

/// A place whose cell has these tables only.
fn place(tables: &str) -> TestDirectory {
    let place = TestDirectory::new("full", "");
    let model = place.file("model.toml");
    let cell = format!(
        "schema = \"trued.cell/1\"\ncell = \"{CELL}\"\nmodel = \"{}\"\nmode = \"full\"\n{tables}",
        model.display()
    );
    place.write("cell.toml", &cell);
    place
}

fn daemon(place: &TestDirectory) -> Process {
    let daemon = Process::daemon(TRUED, place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:#?}", daemon.lines());
    daemon
}

/// Ends a bridge and waits for its last output.
fn ended(bridge: &mut Process) -> Vec<String> {
    assert!(bridge.end().success(), "{:#?}", bridge.lines());
    assert!(bridge.wait_for_output("answers to the robot: ", LIMIT), "{:#?}", bridge.lines());
    // The output arrives at once, its last line last.
    std::thread::sleep(Duration::from_millis(200));
    bridge.lines()
}

/// A count of a bridge, printed at its end.
fn count(lines: &[String], what: &str) -> u64 {
    let number =
        lines.iter().find_map(|line| line.strip_prefix(what)?.strip_prefix(": ")?.parse().ok());
    number.unwrap_or(0)
}

/// Result of `trued correct` for these joints, degrees, 4 ms apart.
fn corrected(place: &TestDirectory, path: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let joints = path[0].len();
    let names: Vec<String> = (1..=joints).map(|i| format!("q{i}_deg")).collect();
    let mut csv = format!("t_s,{}\n", names.join(","));
    for (k, q) in path.iter().enumerate() {
        let q: Vec<String> = q.iter().map(|q| format!("{q:?}")).collect();
        csv += &format!("{},{}\n", k as f64 * 0.004, q.join(","));
    }
    place.write("path.csv", &csv);
    let (config, out) = (place.file("cell.toml"), place.file("out.csv"));
    let mut command = std::process::Command::new(TRUED);
    command.arg("correct").arg("--config").arg(&config).arg("--out").arg(&out);
    tests::clients::run(command.arg(place.file("path.csv")));
    let text = std::fs::read_to_string(out).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let first = head.iter().position(|name| *name == "c1_deg").expect("corrected joints");
    let row = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        fields[first..first + joints].iter().map(|field| field.parse().unwrap()).collect()
    };
    lines.map(row).collect()
}
