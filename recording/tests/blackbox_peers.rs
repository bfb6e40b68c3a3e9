//! MCAP recordings read by the public Python package `mcap`, which opens, seeks and counts by the
//! index.
//!
//! Needs `python3` with `venv` and the package registry; where that cannot be had, it is SKIPPED.
#![expect(clippy::expect_used, clippy::print_stderr, reason = "a test says what failed")]

mod python;

use std::path::{Path, PathBuf};

use recording::mcap_recording::{
    Clocks, CycleRecord, Header, InlineVec, LogRecord, McapWriter, Repair, StatusRecord, repair,
};
use serde_json::{Value, json};

use python::{answer, environment, scratch};

/// Noon of 2026-01-02.
const NOW: Clocks = Clocks { monotonic_ns: 1_000_000_000, wall_ns: 1_767_355_200_000_000_000 };

/// Results of the Python package for these files; `None`, with a message, if it is not available.
fn peer(files: &[PathBuf]) -> Option<Vec<Value>> {
    let python = match environment("mcap", &["mcap>=1.2,<2"]) {
        Ok(python) => python,
        Err(why) => {
            eprintln!("SKIPPED: black boxes beside the Python package mcap: {why}");
            return None;
        }
    };
    let jobs = files.iter().map(|file| json!({ "file": file }).to_string() + "\n").collect();
    let answers = answer(&python, "blackbox/read.py", jobs);
    Some(answers.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect())
}

fn folder(name: &str) -> PathBuf {
    let folder = scratch().join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

fn header(model_epoch: u64) -> Header {
    Header {
        cell: "cell".to_owned(),
        robot_maker: "ABB".to_owned(),
        robot_serial: "1600-00001".to_owned(),
        model: format!("name = \"model {model_epoch}\"\n"),
        model_epoch,
        ..Header::default()
    }
}

fn cycle(seq: u64, model_epoch: u64) -> CycleRecord {
    let received_ns = NOW.monotonic_ns + seq * 1_000_000;
    let q = InlineVec::from_slice(&[seq as f64 * 1e-3; 6]);
    CycleRecord { seq, received_ns, q_command: q, model_epoch, ..CycleRecord::default() }
}

/// 3000 cycles over two models, with status and log.
fn write(path: &Path) -> McapWriter {
    let mut black_box = McapWriter::create(path, &header(1), NOW).expect("a file");
    for seq in 0..3000 {
        let t_ns = NOW.monotonic_ns + seq * 1_000_000;
        if seq % 1000 == 0 {
            black_box
                .write_status(&StatusRecord { t_ns, ..StatusRecord::default() })
                .expect("room");
        }
        if seq == 1500 {
            let says = "loaded".to_owned();
            black_box.write_model_change(&header(2), t_ns).expect("room");
            black_box.write_log(&LogRecord { t_ns, says, ..LogRecord::default() }).expect("room");
        }
        black_box.write_cycle(&cycle(seq, 1 + u64::from(seq >= 1500))).expect("room");
        if seq % 400 == 0 {
            black_box.flush().expect("room");
        }
    }
    black_box
}

fn holds(found: &Value, cycles: u64, what: &str) {
    let counts = json!({ "/trued/cycle": cycles, "/trued/status": 3, "/trued/log": 1 });
    assert_eq!(found["seen"], counts, "{what}: by reading");
    assert_eq!(found["counts"], counts, "{what}: by the statistics");
    assert_eq!(found["cycles_alone"], cycles, "{what}: one topic, backwards");
    assert_eq!(found["late"], found["late_expected"], "{what}: from the middle on");
    assert_eq!((&found["in_order"], &found["profile"]), (&json!(true), &json!("ros2")), "{what}");
    assert_eq!(found["first_ns"], NOW.wall_ns, "{what}: wall-clock times");
    assert!(found["chunks"].as_u64() > Some(2), "{what}: {}", found["chunks"]);
    let attached =
        json!(
            [["model-1.toml", "name = \"model 1\"\n"], ["model-2.toml", "name = \"model 2\"\n"],]
        );
    assert_eq!(found["attachments"], attached, "{what}: a model at each change");
    let metadata = found["metadata"].as_array().expect("a list");
    let named = |name: &str| metadata.iter().find(|entry| entry[0] == name).map(|entry| &entry[1]);
    let header = named("trued").expect("a header");
    let identity = (&header["robot_maker"], &header["robot_serial"]);
    assert_eq!(identity, (&json!("ABB"), &json!("1600-00001")), "{what}");
    assert_eq!(named("trued.model_change").expect("a change")["model_epoch"], "2", "{what}");
}

#[test]
fn a_closed_black_box_opens_seeks_and_counts_right_in_the_python_reader() {
    let file = folder("mcap-closed").join("cell.mcap");
    write(&file).finish().expect("room");
    if let Some(found) = peer(&[file]) {
        holds(&found[0], 3000, "closed");
    }
}

#[test]
fn a_black_box_that_was_killed_anywhere_is_repaired_to_what_the_python_reader_opens() {
    let folder = folder("mcap-killed");
    let whole = folder.join("whole.mcap");
    let black_box = write(&whole);
    let flushed = std::fs::read(&whole).expect("there");
    drop(black_box);
    let bytes = std::fs::read(&whole).expect("there");
    let mut files = Vec::new();
    // Anywhere behind the opening; the last one just lacks the last byte.
    for end in
        (flushed.len() / 9..flushed.len()).step_by(flushed.len() / 9).chain([bytes.len() - 1])
    {
        let file = folder.join(format!("cut-{end}.mcap"));
        std::fs::write(&file, &bytes[..end]).expect("room");
        assert!(matches!(repair(&file), Ok(Repair::Done { .. })), "{end}");
        files.push(file);
    }
    let Some(found) = peer(&files) else { return };
    holds(found.last().expect("files"), 3000, "all but the last byte");
    let mut before = 0;
    for (found, file) in found.iter().zip(&files) {
        let cycles = found["seen"]["/trued/cycle"].as_u64().unwrap_or(0);
        assert_eq!(
            found["counts"].get("/trued/cycle").and_then(Value::as_u64).unwrap_or(0),
            cycles
        );
        assert_eq!(found["late"], found["late_expected"], "{}", file.display());
        assert!(cycles >= before, "{}: {cycles} after {before}", file.display());
        before = cycles;
    }
    eprintln!("{} files that were cut are read by the Python package mcap", files.len());
}
