//! Recordings of a running daemon: read by the public Python package `mcap`, also after kills, with
//! the model of each cycle.
//!
//! `TRUED_SOAK_ROUNDS` sets the number of kills.

use crate::TRUED;
use recording::mcap_recording::{self, Contents, FileState, Record};
use recording::series::{RequiredData, read};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tests::cell_loop::CellLoop;
use tests::clients::{root, skipped};
use tests::place::TestDirectory;
use tests::process::Process;
use tests::python::environment;
use tests::rng::TestRng;
use trued_client::{Answer, Monitor, monotonic_ns};

const LIMIT: Duration = Duration::from_secs(10);
const RECORDER: &str = "[recorder]\ndir = \"recordings\"\nkeep_files = 1000\n";
/// Default number of kills.
const KILLS: u64 = 12;
/// Largest part of the answers that may be missing after a kill.
const LOST_MAX: Duration = Duration::from_secs(1);

/// The files of that place, oldest first.
fn files(place: &TestDirectory) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(place.file("recordings")).unwrap();
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

fn trued(place: &TestDirectory, arguments: &[&str], files: &[&Path]) -> Output {
    let mut command = Command::new(TRUED);
    command.args(arguments).args(files).env(shm_schema::RUNTIME_DIR_ENV, place.root());
    command.output().unwrap()
}

fn output_text(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}

/// When the last cycle was received, ns.
fn last_ns(contents: &Contents) -> u64 {
    let cycles = contents.records.iter().filter_map(|record| match record {
        Record::Cycle(cycle) => Some(cycle.received_ns),
        _ => None,
    });
    cycles.max().unwrap_or(0)
}

/// What the public Python package counts in each file; none, loudly, where it cannot be had.
fn counted_by_python(files: &[PathBuf]) -> Option<Vec<serde_json::Value>> {
    let scratch = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let python = match environment(&scratch.join("mcap"), &["mcap>=1.2,<2"]) {
        Ok(python) => python,
        Err(why) => {
            skipped(scratch, "recordings in the Python package mcap", &why);
            return None;
        }
    };
    let jobs = scratch.join(format!("jobs-{}.json", std::process::id()));
    let lines = files.iter().map(|file| serde_json::json!({ "file": file }).to_string() + "\n");
    std::fs::write(&jobs, lines.collect::<String>()).unwrap();
    let mut command = Command::new(python);
    command.arg(root().join("recording/tests/blackbox/read.py"));
    let done = command.stdin(std::fs::File::open(&jobs).unwrap()).output().unwrap();
    std::fs::remove_file(&jobs).unwrap();
    assert!(done.status.success(), "{}", output_text(&done));
    let lines = String::from_utf8(done.stdout).unwrap();
    Some(lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect())
}

#[test]
fn recordings_that_kills_left_are_whole_again_and_lack_less_than_a_second() {
    let given = std::env::var("TRUED_SOAK_ROUNDS").ok().and_then(|n| n.parse().ok());
    let mut chance = TestRng::new(monotonic_ns());
    let place = TestDirectory::new("full", RECORDER);
    let mut worst = Duration::ZERO;
    let kills = given.unwrap_or(KILLS);
    for _ in 0..kills {
        let mut daemon = Process::ready_daemon(TRUED, &place);
        let mut cell = CellLoop::join(&place.cell(), Duration::from_millis(5)).unwrap();
        let mut answered_ns = 0;
        let until = Duration::from_micros(50_000 + chance.below(1_200_000));
        cell.tick_until(until, |_, tick| {
            answered_ns = if tick.answered { monotonic_ns() } else { answered_ns };
            false
        });
        daemon.kill();
        let newest = files(&place).pop().unwrap();
        // A file that was killed before anything was written is empty.
        let recorded_ns = mcap_recording::read(&newest).map_or(0, |contents| last_ns(&contents));
        let lost = Duration::from_nanos(answered_ns.saturating_sub(recorded_ns)).min(until);
        assert!(lost < LOST_MAX, "{lost:?} are missing");
        worst = worst.max(lost);
    }
    // The last one by the command, the others by later daemons.
    let newest = files(&place).pop().unwrap();
    let done = trued(&place, &["info", "--repair"], &[&newest]);
    assert!(
        done.status.success() && output_text(&done).contains("repaired"),
        "{}",
        output_text(&done)
    );
    let files = files(&place);
    for file in &files {
        let info = mcap_recording::info(file).unwrap();
        assert_eq!(info.end, FileState::Closed, "{}", file.display());
    }
    println!("{kills} kills, {} files, at most {worst:?} missing", files.len());
    let Some(found) = counted_by_python(&files) else { return };
    for (file, found) in files.iter().zip(found) {
        let ours = mcap_recording::read(file).unwrap().records.len() as u64;
        let sum = |key: &str| {
            found[key].as_object().unwrap().values().filter_map(serde_json::Value::as_u64).sum()
        };
        let (sent, counted): (u64, u64) = (sum("seen"), sum("counts"));
        assert_eq!([sent, counted], [ours; 2], "{}", file.display());
        assert_eq!(found["late"], found["late_expected"], "{}", file.display());
    }
}

#[test]
fn a_damaged_chunk_is_named_by_info_and_convert_with_exit_code_1_and_a_repair_keeps_the_original() {
    let place = TestDirectory::new("full", RECORDER);
    let mut daemon = Process::ready_daemon(TRUED, &place);
    let mut cell = CellLoop::join(&place.cell(), Duration::from_millis(5)).unwrap();
    cell.tick_until(Duration::from_secs(3), |_, _| false);
    assert!(daemon.end().success());
    let file = files(&place).pop().unwrap();
    let whole = mcap_recording::read(&file).unwrap().records.len() as u64;
    let mut bytes = std::fs::read(&file).unwrap();
    // In the data of a chunk in the middle: the chunks are most of the file, indexes the rest.
    let mut place_of_bit = bytes.len() / 2;
    let info = loop {
        bytes[place_of_bit] ^= 1;
        std::fs::write(&file, &bytes).unwrap();
        let info = mcap_recording::info(&file).unwrap();
        if !info.damage.is_empty() {
            break info;
        }
        bytes[place_of_bit] ^= 1;
        place_of_bit += 1000;
    };
    let [damage] = info.damage.as_slice() else { panic!("{:?}", info.damage) };
    let lost = damage.messages.expect("a message index");
    assert!(lost > 0 && lost < whole / 2, "{lost} of {whole}");
    let out = place.file("made.csv");
    let out = out.to_str().unwrap();
    for arguments in [&["info"][..], &["convert", "--out", out]] {
        let done = trued(&place, arguments, &[&file]);
        let text = output_text(&done);
        assert_eq!(done.status.code(), Some(1), "{text}");
        assert!(text.contains(&format!("{lost} messages lost")), "{text}");
        assert_eq!(std::fs::read(&file).unwrap(), bytes, "it was only read");
    }
    let done = trued(&place, &["info", "--repair"], &[&file]);
    assert_eq!(done.status.code(), Some(1), "{}", output_text(&done));
    let original = mcap_recording::original_path(&file, 1);
    assert_eq!(std::fs::read(original).unwrap(), bytes);
    assert_eq!(mcap_recording::read(&file).unwrap().records.len() as u64, whole - lost);
    assert!(trued(&place, &["info"], &[&file]).status.success(), "whole again");
}

#[test]
fn a_recording_holds_wall_clock_times_states_and_the_log() {
    let place = TestDirectory::new("full", RECORDER);
    let mut daemon = Process::ready_daemon(TRUED, &place);
    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).unwrap();
    for on in [true, false] {
        assert_eq!(monitor.bypass(on, LIMIT).unwrap().answer(), Ok(Answer::Done));
        std::thread::sleep(Duration::from_millis(100));
    }
    let marked = trued(&place, &["mark", "spindle on"], &[]);
    assert!(marked.status.success(), "{}", output_text(&marked));
    std::thread::sleep(Duration::from_millis(1100));
    assert!(daemon.end().success());
    let file = files(&place).pop().unwrap();
    let info = mcap_recording::info(&file).unwrap();
    let now_ns = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
    let of = |topic: &str| info.channels.iter().find(|channel| channel.topic == topic).unwrap();
    for topic in ["/trued/status", "/trued/log"] {
        let channel = of(topic);
        assert!(channel.messages >= 4, "{channel:?}");
        assert!(channel.first_ns <= channel.last_ns && channel.last_ns <= now_ns, "{channel:?}");
        assert!(now_ns - channel.first_ns < 60_000_000_000, "{channel:?}");
    }
    let contents = mcap_recording::read(&file).unwrap();
    let states = contents.records.iter().filter_map(|record| match record {
        Record::Status(status) => Some(status.bypassed),
        _ => None,
    });
    let mut states: Vec<u8> = states.collect();
    states.dedup();
    assert_eq!(states, [0, 1, 0]);
    let log: Vec<_> = contents
        .records
        .iter()
        .filter_map(|record| match record {
            Record::Log(line) => Some(format!("{} {}", line.level, line.says)),
            _ => None,
        })
        .collect();
    for part in [
        "info loaded model=",
        "info ready",
        "info request: bypass",
        "hash=",
        "mark spindle on (by ",
    ] {
        assert!(log.iter().any(|line| line.contains(part)), "{part}: {log:#?}");
    }
    let shown = trued(&place, &["info"], &[&file]);
    let text = output_text(&shown);
    for part in ["closed    yes", "robot     ABB IRB 1600-6/1.45", "/trued/status", " epoch "] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

/// The message of the answer to a request, which ends with this exit code.
fn asks(place: &TestDirectory, arguments: &[&str], code: i32) -> String {
    let done = trued(place, arguments, &[]);
    assert_eq!(done.status.code(), Some(code), "{arguments:?}: {}", output_text(&done));
    output_text(&done)
}

#[test]
fn recording_starts_and_stops_when_it_is_asked_to_and_what_is_kept_is_not_removed() {
    let recorder =
        "[recorder]\ndir = \"recordings\"\nstart = false\nkeep_files = 1\nkept_files_max = 1\n";
    let place = TestDirectory::new("full", recorder);
    let mut daemon = Process::ready_daemon(TRUED, &place);
    assert!(!place.file("recordings").exists(), "nothing is recorded yet");
    assert!(asks(&place, &["status"], 0).contains("stopped"));
    assert!(asks(&place, &["mark", "nobody writes"], 1).contains("nothing is being recorded"));
    assert!(asks(&place, &["record", "keep"], 1).contains("nothing is being recorded"));
    assert!(asks(&place, &["record", "stop"], 0).contains("nothing is being recorded"));

    assert!(asks(&place, &["record", "start"], 0).contains("recording to"));
    asks(&place, &["mark", "part 7"], 0);
    let kept = asks(&place, &["record", "keep"], 0);
    assert!(kept.contains(".kept.mcap is kept"), "{kept}");
    let stopped = asks(&place, &["record", "stop"], 0);
    assert!(stopped.contains(".kept.mcap is closed"), "{stopped}");
    let first = files(&place).pop().unwrap();
    let info = mcap_recording::info(&first).unwrap();
    assert_eq!(info.end, FileState::Closed, "closed when the command returns");
    let marks = mcap_recording::read(&first).unwrap();
    let is_mark = |record: &&Record| matches!(record, Record::Log(line) if line.level == "mark");
    assert_eq!(marks.records.iter().filter(is_mark).count(), 1);

    for _ in 0..3 {
        asks(&place, &["record", "start"], 0);
        asks(&place, &["record", "stop"], 0);
    }
    let left = files(&place);
    assert_eq!(left.len(), 2, "the kept one and one more: {left:?}");
    assert!(left.contains(&first), "{left:?}");
    asks(&place, &["record", "start"], 0);
    let refused = asks(&place, &["record", "keep"], 1);
    assert!(refused.contains("kept_files_max"), "{refused}");
    assert!(daemon.end().success());
}

#[test]
fn a_cell_without_a_recorder_states_the_remedy() {
    let place = TestDirectory::new("full", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    assert!(asks(&place, &["record", "start"], 1).contains("[recorder]"));
}

/// The last row's value in a further column.
fn last(recording: &recording::series::Recording, name: &str) -> f64 {
    let column = recording.other.iter().find(|(other, _)| other == name);
    column.and_then(|(_, cells)| cells.last()).unwrap().parse().unwrap()
}

#[test]
fn after_a_reload_each_cycle_is_replayed_with_the_model_that_made_it() {
    let place = TestDirectory::new("full", RECORDER);
    let mut daemon = Process::ready_daemon(TRUED, &place);
    let mut cell = CellLoop::join(&place.cell(), LIMIT).unwrap();
    let settle = Duration::from_millis(1500);
    assert!(!cell.tick_until(settle, |_, _| false));
    let changed = place.model("next.toml", "irb1600-6-145");
    let answer = cell.client.reload(Some(&changed), LIMIT).unwrap();
    assert_eq!(answer.answer(), Ok(Answer::Done), "{}", answer.message);
    assert!(!cell.tick_until(settle, |_, _| false));
    drop(cell);
    assert!(daemon.end().success());
    let file = files(&place).pop().unwrap();
    let made = place.file("made");
    let done = trued(&place, &["convert", "--out", made.to_str().unwrap()], &[&file]);
    assert!(done.status.success(), "{}", output_text(&done));
    for (name, model) in [("made", "made-model.toml"), ("made-2", "made-2-model.toml")] {
        let csv = place.file(&format!("{name}.csv"));
        let recorded = read(&csv, None, RequiredData::Path).unwrap();
        assert_eq!(recorded.metadata.model.as_deref(), Some(model));
        let again = place.file(&format!("{name}-again.csv"));
        let arguments = ["replay", "--corrections", again.to_str().unwrap()];
        let done = trued(&place, &arguments, &[&csv]);
        assert!(done.status.success(), "{}", output_text(&done));
        let replayed = read(&again, None, RequiredData::Path).unwrap();
        for joint in 1..=3 {
            let live = last(&recorded, &format!("c{joint}_rad"));
            let again = last(&replayed, &format!("c{joint}_deg")).to_radians();
            assert!((live - again).abs() < 1e-9, "{name}, joint {joint}: {live} and {again} rad");
        }
    }
    let models = ["made-model.toml", "made-2-model.toml"]
        .map(|name| std::fs::read_to_string(place.file(name)).unwrap());
    assert_ne!(models[0], models[1]);
}

#[test]
fn a_folder_that_is_removed_is_created_again_and_written_on() {
    let place = TestDirectory::new("full", RECORDER);
    let mut daemon = Process::ready_daemon(TRUED, &place);
    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).unwrap();
    let has_file = || {
        let entries = std::fs::read_dir(place.file("recordings")).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).any(|path| path.extension().is_some())
    };
    assert!(super::faults::wait_for(LIMIT, has_file));
    std::fs::remove_dir_all(place.file("recordings")).unwrap();
    assert!(daemon.wait_for_output("the recording was removed", LIMIT), "{:#?}", daemon.lines());
    assert!(super::faults::wait_for(Duration::from_secs(2), has_file), "{:#?}", daemon.lines());
    assert_eq!(monitor.ping(LIMIT).unwrap().answer(), Ok(Answer::Done));
    assert!(daemon.end().success());
    let [file] = &files(&place)[..] else { panic!("one file") };
    let info = mcap_recording::info(file).unwrap();
    assert_eq!(info.end, FileState::Closed);
    let contents = mcap_recording::read(file).unwrap();
    let is_logged = contents.records.iter().any(|record| {
        matches!(record, Record::Log(line) if line.says.contains("the recording was removed"))
    });
    assert!(is_logged, "the new file says what became of the old one");
}
