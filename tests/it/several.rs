//! One daemon for several cells: each is served; they start and end together.

use crate::TRUED;
use shm_schema::Cell;
use std::fs;
use std::time::Duration;
use tests::place::{CELL, TestDirectory};
use tests::process::Process;
use trued_client::{Client, CorrectionStatus, Setpoint};

const LIMIT: Duration = Duration::from_secs(10);
const OTHER: &str = "other";
/// Inside the limits of the model's joints, rad.
const POSE: [f64; 6] = [0.1, 0.2, -0.3, 0.2, 0.5, 0.1];

/// The place's own cell, and another one with this error.
fn two(place: &TestDirectory, wrong: (&str, &str)) -> Process {
    let first = place.file("cell.toml");
    let text = fs::read_to_string(&first).unwrap();
    let other = text.replace(&format!("cell = \"{CELL}\""), &format!("cell = \"{OTHER}\""));
    place.write("other.toml", &other.replace(wrong.0, wrong.1));
    let (first, other) = (first.display().to_string(), place.file("other.toml"));
    let other = other.display().to_string();
    Process::start(TRUED, &["run", "--config", &first, "--config", &other], place)
}

/// Commands until the daemon corrects fully.
fn is_served(client: &mut Client) -> bool {
    let start = std::time::Instant::now();
    while start.elapsed() < LIMIT {
        let answer = client.send(&Setpoint::new(&POSE)).ok();
        let answer = answer.and_then(|seq| client.wait_corrected(seq, Duration::from_millis(100)));
        if answer.is_some_and(|answer| answer.status() == Ok(CorrectionStatus::Corrected)) {
            return true;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    false
}

fn client(place: &TestDirectory, cell: &str) -> Client {
    Client::connect_to(&Cell::at(place.root(), cell).unwrap(), LIMIT).unwrap()
}

#[test]
fn one_daemon_serves_two_cells_and_ends_both() {
    let place = TestDirectory::new("full", "");
    let mut daemon = two(&place, ("", ""));
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    let mut clients = [CELL, OTHER].map(|cell| client(&place, cell));
    for _ in 0..2 {
        assert!(clients.iter_mut().all(is_served), "{:?}", daemon.lines());
    }
    // A request to one does not affect the other.
    clients[0].bypass(true, LIMIT).unwrap();
    assert!(is_served(&mut clients[1]));
    drop(clients);
    assert!(daemon.end().success(), "{:?}", daemon.lines());
    let lines = daemon.lines();
    for cell in [CELL, OTHER] {
        let named = format!("cell{{name=\"{cell}\"}}: ");
        let has_line =
            |part: &str| lines.iter().any(|line| line.contains(&named) && line.contains(part));
        assert!(has_line("health starting -> idle") && has_line("ended"), "{cell}: {lines:#?}");
    }
    assert_eq!(place.remaining_names(), Vec::<String>::new());
}

#[test]
fn a_cell_that_cannot_start_is_named_and_none_is_served() {
    let place = TestDirectory::new("full", "");
    let mut daemon = two(&place, ("model.toml", "no-such-model.toml"));
    assert_eq!(daemon.wait().code(), Some(2), "{:?}", daemon.lines());
    let output = daemon.lines().join("\n");
    assert!(output.contains("no-such-model.toml"), "{output}");
    assert_eq!(place.remaining_names(), Vec::<String>::new(), "the first cell was served already");
}

#[test]
fn one_cell_twice_is_bad_input() {
    let place = TestDirectory::new("full", "");
    let mut daemon = two(&place, (OTHER, CELL));
    assert_eq!(daemon.wait().code(), Some(2), "{:?}", daemon.lines());
    let output = daemon.lines().join("\n");
    assert!(output.contains("two files configure the cell `cell`"), "{output}");
}
