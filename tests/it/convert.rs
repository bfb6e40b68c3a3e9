//! `trued convert`: an MCAP recording becomes a table, bit for bit.

use crate::program::Place;
use physics::JointKind;
use recording::mcap_recording::{
    Clocks, CycleRecord, ForceRecord, Header, InlineVec, LogRecord, McapWriter, StatusRecord,
};
use recording::model::presets::preset;
use recording::series::{Channel, RequiredData, read};
use std::path::Path;
use std::process::Command;
use tests::clients::{root, skipped};
use tests::python::environment;

const CYCLES: u64 = 50;

fn boxed(place: &Place, name: &str) -> McapWriter {
    let header = Header {
        cell: "demo".to_owned(),
        version: "0.1.0".to_owned(),
        model: preset("irb1600-6-145").expect("preset").text.to_owned(),
        joints: vec![JointKind::Revolute; 6],
        status_words: vec!["corrected".to_owned()],
        reason_words: vec!["none".to_owned()],
        ..Header::default()
    };
    let mut black_box =
        McapWriter::create(&place.path(name), &header, Clocks::default()).expect("a file");
    for seq in 0..CYCLES {
        black_box.write_cycle(&cycle(seq)).expect("room");
    }
    black_box
}

fn cycle(seq: u64) -> CycleRecord {
    let q = joint(seq);
    CycleRecord {
        t_ns: 1_000_000_000 + 4_000_000 * seq,
        seq,
        q_command: InlineVec::from_slice(&[q; 6]),
        q_corrected: InlineVec::from_slice(&[q + 1e-4; 6]),
        ..CycleRecord::default()
    }
}

fn joint(seq: u64) -> f64 {
    seq as f64 * 1e-3 + 1.0 / 3.0
}

#[test]
fn a_black_box_becomes_a_recording_that_every_command_reads() {
    let place = Place::new();
    let mut black_box = boxed(&place, "run.mcap");
    let data = vec![1.5; 12];
    let block =
        ForceRecord { seq: 1, rate_hz: 1000.0, channels: 3, data, ..ForceRecord::default() };
    black_box.write_force(&block).expect("room");
    black_box.finish().expect("room");
    let done = place.succeed(&["convert", "--out", "made", "--json", "said.json", "run.mcap"]);
    assert!(done.out.contains("50 cycles, 4 force samples"), "{}", done.out);
    let files = ["made-forces.csv", "made-forces.toml", "made-model.toml", "made.csv", "made.toml"];
    assert_eq!(place.names(), [&files[..], &["run.mcap", "said.json"]].concat());
    assert_eq!(place.json("said.json")["rows"], CYCLES);
    let made = read(&place.path("made.csv"), None, RequiredData::Path).expect("a recording");
    for row in 0..CYCLES {
        let q = made.column(Channel::Command(2)).expect("there")[row as usize];
        assert_eq!(q.to_bits(), joint(row).to_bits(), "row {row}");
    }
    assert_eq!(made.metadata.model.as_deref(), Some("made-model.toml"));
    place.succeed(&["correct", "--model", "made-model.toml", "--out", "again.csv", "made.csv"]);
}

#[test]
fn a_box_that_was_cut_off_is_read_as_far_as_it_goes_and_one_that_is_none_is_refused() {
    let place = Place::new();
    let mut black_box = boxed(&place, "run.mcap");
    black_box.flush().expect("room");
    let whole = black_box.bytes();
    black_box.write_cycle(&cycle(CYCLES)).expect("room");
    black_box.finish().expect("room");
    let file = std::fs::OpenOptions::new().write(true).open(place.path("run.mcap")).expect("there");
    file.set_len(whole + 20).expect("shorter");
    let done = place.succeed(&["convert", "--out", "made", "run.mcap"]);
    assert!(done.err.contains("is truncated"), "{}", done.err);
    assert!(done.out.contains("50 cycles"), "{}", done.out);
    place.file("no.mcap", "t_s,q1_deg\n0,1\n");
    let done = place.run(&["convert", "--out", "other", "no.mcap"]);
    assert_eq!(done.code, Some(2), "{done:?}");
    assert!(!place.path("other.csv").exists());
}

#[test]
fn a_box_through_parquet_is_the_same_table_as_the_box_itself() {
    let place = Place::new();
    boxed(&place, "run.mcap").finish().expect("room");
    place.succeed(&["convert", "--out", "direct.csv", "run.mcap"]);
    place.succeed(&["convert", "--out", "made.parquet", "run.mcap"]);
    assert!(place.path("made-model.toml").exists() && place.path("made.toml").exists());
    place.succeed(&["correct", "--model", "made-model.toml", "--out", "again.csv", "made.parquet"]);
    place.succeed(&["convert", "--out", "back.csv", "made.parquet"]);
    let [direct, back] = ["direct.csv", "back.csv"].map(|name| place.read(name));
    assert_eq!(back, direct);
    assert!(place.read("back.toml").contains("made-model.toml"), "the model is named on");
    let same = place.run(&["convert", "--out", "made.parquet", "made.parquet"]);
    assert_eq!(same.code, Some(2), "over its input: {same:?}");
}

#[test]
fn another_programs_table_becomes_a_recording_by_its_mapping() {
    let place = Place::new();
    place.file("log.csv", "stamp,a1,note\n0,90,warm\n10,-45.5,\n");
    place.file(
        "log.mapping.toml",
        "schema = \"trued.mapping/1\"\njoints = 1\n[columns]\nt_s = { from = \"stamp\", unit = \"ms\" }\n\"q*_deg\" = { from = \"a*\" }\n",
    );
    std::fs::create_dir(place.path("new")).expect("a folder");
    place.succeed(&["convert", "--out", "new/log.csv", "log.csv"]);
    let made = read(&place.path("new/log.csv"), None, RequiredData::Path).expect("a recording");
    assert_eq!(made.t_s, [0.0, 0.01]);
    assert_eq!(made.column(Channel::Command(0)).expect("there")[1], (-45.5_f64).to_radians());
}

#[test]
fn an_infinite_sample_becomes_a_missing_value_of_a_table_that_every_command_reads() {
    let place = Place::new();
    let mut black_box = boxed(&place, "run.mcap");
    let wrench = [f64::INFINITY, 1.0, 2.0, f64::NEG_INFINITY, 0.0, 0.0];
    let spoilt = CycleRecord { wrench_used: InlineVec::from_slice(&wrench), ..cycle(CYCLES) };
    black_box.write_cycle(&spoilt).expect("room");
    let data = vec![f64::INFINITY, 1.0, 2.0];
    let block = ForceRecord { rate_hz: 1000.0, channels: 1, data, ..ForceRecord::default() };
    black_box.write_force(&block).expect("room");
    black_box.finish().expect("room");
    let done = place.succeed(&["convert", "--out", "made", "run.mcap"]);
    assert!(done.err.contains("3 values") && done.err.contains("not finite"), "{}", done.err);
    place.succeed(&["check", "made.csv", "made-forces.csv"]);
    let made = read(&place.path("made.csv"), None, RequiredData::Path).expect("a recording");
    let fx = made.column(Channel::Wrench(0)).map_or(f64::NAN, |fx| fx[CYCLES as usize]);
    let fy = made.column(Channel::Wrench(1)).expect("there")[CYCLES as usize];
    assert!(fx.is_nan() && fy == 1.0, "{fx} {fy}");
}

#[test]
fn what_cannot_be_converted_or_named_is_refused_with_its_reason_and_leaves_no_file() {
    let place = Place::new();
    boxed(&place, "run.mcap").finish().expect("room");
    let bytes = std::fs::read(place.path("run.mcap")).expect("there");
    // Within the first chunk of records: there are only the metadata before it.
    let opening = bytes.len() - 12_000;
    for length in [2_000, opening / 2] {
        std::fs::write(place.path("cut.mcap"), &bytes[..length.min(bytes.len())]).expect("room");
        let done = place.run(&["convert", "--out", "made", "cut.mcap"]);
        assert_eq!(done.code, Some(2), "{length}: {done:?}");
        assert!(!done.err.contains("whether the daemon received any commands"), "{}", done.err);
    }
    for name in [".", "/", "/dev/null", ".."] {
        let done = place.run(&["convert", "--out", name, "run.mcap"]);
        assert_eq!(done.code, Some(2), "{name}: {done:?}");
    }
    assert_eq!(place.names(), ["cut.mcap", "run.mcap"]);
}

/// The messages of a file as the public package mcap-ros2-support decodes them; none, loudly, where it cannot be had.
fn decoded(place: &Place, name: &str) -> Option<Vec<serde_json::Value>> {
    let scratch = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let python = match environment(&scratch.join("mcap-ros2"), &["mcap-ros2-support>=0.5,<1"]) {
        Ok(python) => python,
        Err(why) => {
            skipped(scratch, "ROS 2 messages in the Python package mcap-ros2-support", &why);
            return None;
        }
    };
    let mut command = Command::new(python);
    command.arg(root().join("recording/tests/ros2/read.py")).arg(place.path(name));
    let done = command.output().expect("an interpreter");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let lines = String::from_utf8(done.stdout).expect("text").replace("NaN", "null");
    Some(lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect())
}

#[test]
fn a_box_becomes_standard_ros_2_messages_that_the_public_decoder_reads() {
    let place = Place::new();
    let mut black_box = boxed(&place, "run.mcap");
    let measured = CycleRecord {
        received_ns: 2_000_000_000,
        q_measured: InlineVec::from_slice(&[0.5; 6]),
        tau: InlineVec::from_slice(&[10.0; 6]),
        temperature_c: InlineVec::from_slice(&[21.0, 30.0]),
        wrench_used: InlineVec::from_slice(&[1.0, 2.0, 3.0, 0.1, 0.2, 0.3]),
        wrench_in_base: 1,
        measured_m: InlineVec::from_slice(&[1.0, 0.2, 0.7]),
        measured_ns: 1_990_000_000,
        ..cycle(CYCLES)
    };
    black_box.write_cycle(&measured).expect("room");
    let data = vec![1.5, 2.5, 7.0, 8.0, 9.0, 10.0];
    let block = ForceRecord { rate_hz: 1000.0, channels: 3, data, ..ForceRecord::default() };
    black_box.write_force(&block).expect("room");
    let status = StatusRecord { health: "degraded".to_owned(), ..StatusRecord::default() };
    black_box.write_status(&StatusRecord { says: "no forces".to_owned(), ..status }).expect("room");
    let line = LogRecord { level: "mark".to_owned(), says: "part 7".to_owned(), t_ns: 0 };
    black_box.write_log(&line).expect("room");
    black_box.finish().expect("room");
    let done = place.succeed(&["convert", "--out", "bag.mcap", "--json", "said.json", "run.mcap"]);
    assert!(done.out.contains("/trued/joint_corrected"), "{}", done.out);
    assert_eq!(place.json("said.json")["topics"]["/trued/joint_command"], CYCLES + 1);
    let Some(messages) = decoded(&place, "bag.mcap") else { return };
    let of = |topic: &str| {
        let found = messages.iter().filter(|message| message["topic"] == topic);
        found.map(|found| &found["message"]).collect::<Vec<_>>()
    };
    let commands = of("/trued/joint_command");
    assert_eq!(commands.len() as u64, CYCLES + 1);
    assert_eq!(commands[3]["position"][5].as_f64(), Some(joint(3)));
    assert_eq!(commands[3]["name"][5], "joint_6");
    let state = of("/joint_states")[0];
    assert_eq!((&state["effort"][1], &state["velocity"]), (&10.0.into(), &serde_json::json!([])));
    assert_eq!(state["header"]["stamp"], serde_json::json!({ "sec": 2, "nanosec": 0 }));
    let wrench = of("/trued/wrench")[0];
    assert_eq!(
        (&wrench["wrench"]["torque"]["z"], &wrench["header"]["frame_id"]),
        (&0.3.into(), &"base".into())
    );
    let forces = of("/trued/force");
    assert_eq!((forces.len(), &forces[1]["wrench"]["force"]["x"]), (2, &2.5.into()));
    assert!(forces[1]["wrench"]["torque"]["x"].is_null(), "not measured: NaN");
    assert_eq!(of("/trued/temperature/joint_1")[0]["temperature"], 30.0);
    assert_eq!(of("/trued/measured_point")[0]["point"]["y"], 0.2);
    let diagnostic = &of("/diagnostics")[0]["status"][0];
    assert_eq!(
        (&diagnostic["message"], &diagnostic["hardware_id"]),
        (&"no forces".into(), &"demo".into())
    );
    assert_eq!(of("/rosout")[0]["msg"], "mark: part 7");
}

#[test]
fn a_table_becomes_standard_ros_2_messages_and_columns_without_one_are_named() {
    let place = Place::new();
    place.file("log.csv", "t_s,q1_deg,q2_deg,x_mm,y_mm,z_mm,ow,ox,oy,oz,spindle_rpm\n5,90,0,1000,0,0,1,0,0,0,600\n6,90,0,,,,,,,,600\n");
    let done = place.succeed(&["convert", "--out", "bag.mcap", "log.csv"]);
    assert!(done.err.contains("spindle_rpm"), "{}", done.err);
    let Some(messages) = decoded(&place, "bag.mcap") else { return };
    let types: Vec<_> = messages.iter().map(|message| message["type"].as_str().unwrap()).collect();
    let joints = "sensor_msgs/msg/JointState";
    assert_eq!(types, [joints, "geometry_msgs/msg/PoseStamped", joints]);
    assert_eq!(messages[1]["message"]["pose"]["orientation"]["w"], 1.0);
    assert_eq!(messages[2]["log_time_ns"], 6_000_000_000_i64, "its t_s");
    place.file("spectrum.csv", "t_s,spindle_rpm\n0,600\n1,600\n");
    let refused = place.run(&["convert", "--out", "none.mcap", "spectrum.csv"]);
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(!place.path("none.mcap").exists());
}
