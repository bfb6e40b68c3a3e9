//! `trued convert`: a black box becomes a recording, to the bit.

use crate::program::Place;
use physics::JointKind;
use recording::blackbox::{BlackBox, Clocks, CycleRecord, Few, ForceRecord, Header};
use recording::model::presets::preset;
use recording::series::{Channel, Need, read};

const CYCLES: u64 = 50;

fn boxed(place: &Place, name: &str) -> BlackBox {
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
        BlackBox::create(&place.path(name), &header, Clocks::default()).expect("a file");
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
        q_command: Few::of(&[q; 6]),
        q_corrected: Few::of(&[q + 1e-4; 6]),
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
    let made = read(&place.path("made.csv"), None, Need::Path).expect("a recording");
    for row in 0..CYCLES {
        let q = made.column(Channel::Command(2)).expect("there")[row as usize];
        assert_eq!(q.to_bits(), joint(row).to_bits(), "row {row}");
    }
    assert_eq!(made.about.model.as_deref(), Some("made-model.toml"));
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
    assert!(done.err.contains("ends early"), "{}", done.err);
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
    let made = read(&place.path("new/log.csv"), None, Need::Path).expect("a recording");
    assert_eq!(made.t_s, [0.0, 0.01]);
    assert_eq!(made.column(Channel::Command(0)).expect("there")[1], (-45.5_f64).to_radians());
}
