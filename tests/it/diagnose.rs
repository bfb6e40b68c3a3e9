//! `trued diagnose`: what is concealed from a model is named, what is not there is not, and what cannot be judged is not judged.

use std::fmt::Write as _;

use recording::model::presets::preset;
use serde_json::Value;

use crate::program::Place;

pub(crate) const BASE: &str = "irb1600-6-145";
const ROWS: u32 = 900;

/// All joints swing, each at a pace of its own.
pub(crate) fn path() -> String {
    let mut text = String::from("t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n");
    for k in 0..ROWS {
        let t = 0.02 * f64::from(k);
        let q =
            [(60.0, 0.61), (35.0, 0.97), (35.0, 0.79), (90.0, 1.63), (70.0, 1.31), (120.0, 1.9)];
        let q = q.map(|(span, pace)| span * (pace * t + span).sin());
        let q = q.map(|q| q.to_string()).join(",");
        writeln!(text, "{t},{q},1,2,3").unwrap();
    }
    text
}

/// A recording of the preset with `effects`, noise 0.03 mm, seen from an unknown place.
pub(crate) fn recorded(effects: &str) -> Place {
    let place = Place::new();
    place.file("path.csv", &path());
    place.file("path.toml", "schema = \"trued.recording/1\"\nmeasuring_frame = \"base\"\n");
    place.file("truth.toml", &format!("{}\n{effects}", preset(BASE).expect("preset").text));
    let simulate = ["simulate", "--model", "truth.toml", "--out", "seen", "--seed", "4"];
    place.succeed(&[&simulate[..], &["--noise", "0.03", "path.csv"]].concat());
    let about =
        "schema = \"trued.recording/1\"\nsigma = { x_mm = 0.03, y_mm = 0.03, z_mm = 0.03 }\n";
    place.file("seen.toml", about);
    place
}

fn diagnosed(place: &Place, recording: &str) -> Value {
    place.succeed(&["diagnose", "--model", BASE, "--out", "said", "--seed", "1", recording]);
    place.json("said/diagnosis.json")
}

#[test]
fn a_concealed_backlash_is_named_with_its_joint_and_width_and_the_gain_is_proven() {
    let place = recorded("[[effect]]\nkind = \"backlash\"\njoint = 3\nwidth_mrad = 0.42\n");
    let said = diagnosed(&place, "seen.csv");
    assert_eq!(said["schema"], "trued.diagnosis/1");
    assert_eq!(said["verdict"], "missing_physics", "{said:#}");
    let finding = &said["findings"][0];
    assert_eq!((&finding["effect"], &finding["joint"]), (&"backlash".into(), &3.into()));
    assert_eq!(finding["change"], "new");
    let width = &finding["parameters"]["width_mrad"];
    let number = |value: &Value| value.as_f64().expect("a number");
    let (low, high) = (number(&width["ci95"][0]), number(&width["ci95"][1]));
    assert!(low < 0.42 && 0.42 < high && high - low < 0.05, "{width}");
    let (before, after) = (&said["heldout_rms_before"], &said["heldout_rms_after"]);
    assert!(number(before) > 2.0 * number(after), "{before} {after}");
    assert!((number(after) / 0.03 - 1.0).abs() < 0.1, "down to the noise: {after}");
    assert_eq!(said["findings"].as_array().map(Vec::len), Some(1), "{said:#}");
    assert!(place.read("said/report.html").contains("backlash"));
    place.succeed(&["check", "said/model.toml"]);
    // With what was found the same recording holds nothing more.
    let again =
        ["diagnose", "--model", "said/model.toml", "--out", "again", "--seed", "1", "seen.csv"];
    place.succeed(&again);
    let again = place.json("again/diagnosis.json");
    assert_eq!(again["verdict"], "consistent", "{again:#}");
}

#[test]
fn where_nothing_is_missing_nothing_is_found_and_the_same_seed_gives_the_same_bytes() {
    let place = recorded("");
    let said = diagnosed(&place, "seen.csv");
    assert_eq!(said["verdict"], "consistent", "{said:#}");
    assert_eq!(said["findings"].as_array().map(Vec::len), Some(0));
    assert!(said["not_tested"].as_array().is_some_and(|list| !list.is_empty()));
    let (first, page) = (place.read("said/diagnosis.json"), place.read("said/report.html"));
    diagnosed(&place, "seen.csv");
    assert_eq!(place.read("said/diagnosis.json"), first);
    assert_eq!(place.read("said/report.html"), page);
}

#[test]
fn swapped_columns_and_an_arm_that_stands_still_are_not_judged() {
    let place = recorded("");
    let swapped = place.read("seen.csv").replacen("q2_deg,q3_deg", "q3_deg,q2_deg", 1);
    place.file("swapped.csv", &swapped);
    let header = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n";
    let still: String = (0..50).map(|k| format!("{k},1,2,3,4,5,6,{k},0,0\n")).collect();
    place.file("still.csv", &format!("{header}{still}"));
    for name in ["swapped.csv", "still.csv"] {
        let said = diagnosed(&place, name);
        assert_eq!(said["verdict"], "undetermined", "{name}: {said:#}");
        assert_eq!(said["findings"].as_array().map(Vec::len), Some(0), "{name}");
    }
}

#[test]
fn a_recording_without_values_is_refused_and_nothing_is_written() {
    let place = recorded("");
    let header = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n";
    let empty: String = (0..50).map(|k| format!("{k},{k},2,3,4,5,6,nan,nan,nan\n")).collect();
    place.file("nothing.csv", &format!("{header}{empty}"));
    place.file("headless.csv", header);
    for name in ["nothing.csv", "headless.csv", "absent.csv"] {
        let done = place.run(&["diagnose", "--model", BASE, "--out", "said", name]);
        assert_eq!(done.code, Some(2), "{name}");
    }
    assert!(!place.names().contains(&"said".to_owned()));
}
