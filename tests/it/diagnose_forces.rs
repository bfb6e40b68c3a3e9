//! `trued diagnose` on forces without a robot: segments, findings of the sensor, and claims that
//! must not be made.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use crate::program::Place;

const RATE_HZ: f64 = 2000.0;

/// Air for a second, a cut of two with a tone, air for a second; the sensor is off by (4, -6, 2) N.
fn recording(tone_hz: f64, size: f64) -> String {
    let mut text = "t_s,spindle_rpm,fx_N,fy_N,fz_N\n".to_owned();
    for row in 0..(4.0 * RATE_HZ) as u32 {
        let t = f64::from(row) / RATE_HZ;
        let inside = if (1.0..3.0).contains(&t) { 1.0 } else { 0.0 };
        let hiss = |k: f64| (f64::from(row) * (12.9898 + k)).sin() * 43_758.545;
        let hiss = |k: f64| hiss(k) - hiss(k).floor() - 0.5;
        let swing = size * (TAU * tone_hz * t).sin();
        let force = |bias: f64, mean: f64, k: f64| {
            bias + hiss(k) + inside * (mean + 4.0 * hiss(k + 0.1) + swing)
        };
        writeln!(
            text,
            "{t},3000,{},{},{}",
            force(4.0, -60.0, 0.0),
            force(-6.0, 150.0, 1.0),
            force(2.0, 30.0, 2.0)
        )
        .unwrap();
    }
    text
}

fn effects(json: &serde_json::Value) -> Vec<String> {
    let findings = json["findings"].as_array().unwrap();
    findings.iter().map(|one| one["effect"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn air_and_cut_are_distinguished_and_the_sensors_bias_goes_into_the_model() {
    let place = Place::new();
    place.file("cut.csv", &recording(400.0, 0.0));
    place.succeed(&["diagnose", "cut.csv"]);
    let json = place.json("diagnosis/diagnosis.json");
    assert_eq!((json["domain"].as_str(), json["unit"].as_str()), (Some("force"), Some("N")));
    assert_eq!(effects(&json), ["wrench_bias"]);
    // The edge of the cut is inside a block of 20 ms, which may count as a separate entry or exit.
    let lasts = |one: &&serde_json::Value| {
        one["to_s"].as_f64().unwrap() - one["from_s"].as_f64().unwrap() > 0.03
    };
    let phases = json["phases"].as_array().unwrap().iter().filter(lasts);
    let states: Vec<&str> = phases.map(|one| one["state"].as_str().unwrap()).collect();
    assert_eq!(states, ["air", "cut", "air"]);
    let bias = &json["findings"][0]["parameters"]["bias_N"]["value"];
    for (axis, wanted) in [4.0, -6.0, 2.0].into_iter().enumerate() {
        assert!((bias[axis].as_f64().unwrap() - wanted).abs() < 0.2, "{bias}");
    }
    place.succeed(&["check", "diagnosis/model.toml"]);
    assert!(place.read("diagnosis/model.toml").contains("wrench_bias"));
    assert!(
        place.read("diagnosis/report.html").contains("Tones of the cut") || json["tones"].is_null()
    );
}

#[test]
fn a_tone_beside_the_spindles_multiples_is_chatter_and_one_of_them_is_not() {
    let place = Place::new();
    place.file("rings.csv", &recording(423.0, 20.0));
    place.file("forced.csv", &recording(400.0, 20.0));
    place.succeed(&["diagnose", "--out", "rings", "rings.csv"]);
    place.succeed(&["diagnose", "--out", "forced", "forced.csv"]);
    let rings = place.json("rings/diagnosis.json");
    assert!(effects(&rings).contains(&"chatter".to_owned()), "{rings}");
    let found = &rings["findings"][0]["where"]["frequency_Hz"];
    assert!((found.as_f64().unwrap() - 423.0).abs() < 1.0, "{found}");
    assert_eq!(effects(&place.json("forced/diagnosis.json")), ["wrench_bias"]);
}

#[test]
fn what_is_constant_empty_or_short_is_never_a_finding() {
    let place = Place::new();
    let head = "t_s,fx_N,fy_N\n";
    let rows = |value: &str, count: u32| {
        let row = |k: u32| format!("{},{value},{value}\n", f64::from(k) / RATE_HZ);
        format!("{head}{}", (0..count).map(row).collect::<String>())
    };
    for (name, text) in
        [("constant", rows("3.5", 4000)), ("empty", rows("", 4000)), ("short", rows("1", 20))]
    {
        place.file(&format!("{name}.csv"), &text);
        let done = place.run(&["diagnose", "--out", name, &format!("{name}.csv")]);
        if done.code == Some(0) {
            let json = place.json(&format!("{name}/diagnosis.json"));
            assert_eq!(json["verdict"], "undetermined", "{name}");
            assert!(effects(&json).is_empty(), "{name}");
        } else {
            assert_eq!(done.code, Some(2), "{name}: {}", done.err);
            assert!(!done.err.is_empty());
        }
    }
}

/// A milled cut with four feeds, with air before it, run forward by `trued simulate` with effects
/// that the model lacks.
fn milled(effects: &str) -> Place {
    let place = Place::new();
    let mut text = "t_s,spindle_rpm,feed_mm_s,fx_N,fy_N,fz_N\n".to_owned();
    for row in 0..8000_u32 {
        let feed = [0.0, 4.0, 8.0, 16.0][row as usize / 2000];
        writeln!(text, "{},4020,{feed},1,1,1", f64::from(row) / 4000.0).unwrap();
    }
    place.file("cut.csv", &text);
    let cut = "[cut]\nteeth = 4\ndiameter_mm = 10.0\nhelix_deg = 30.0\naxial_depth_mm = 2.0\nentry_deg = 0.0\nexit_deg = 90.0\n\
               coefficients_N_per_mm2 = [800.0, 300.0, 150.0]\ncoefficients_N_per_mm = [8.0, 10.0, 2.0]\n";
    place.file("cut.toml", &format!("schema = \"trued.recording/1\"\n{cut}"));
    let model = include_str!("../../trued/src/no_arm.toml");
    place.file("bare.toml", model);
    place.file("truth.toml", &format!("{model}\n{effects}"));
    let simulate = ["simulate", "--out", "made", "--model", "truth.toml", "--force-noise", "2"];
    place.succeed(&[&simulate[..], &["--seed", "5", "cut.csv"]].concat());
    place
}

/// The force of one channel, row by row.
fn force(place: &Place, name: &str, column: usize) -> Vec<f64> {
    let text = place.read(name);
    let rows = text.lines().skip(1);
    rows.map(|row| row.split(',').nth(column).unwrap().parse().unwrap()).collect()
}

#[test]
fn what_a_stated_cut_lacks_is_named_and_the_model_with_it_reads_the_same_forces() {
    let place = milled(
        "[[effect]]\nkind = \"runout\"\nradial_um = 4.0\nphase_rad = 0.7\n\
         [[effect]]\nkind = \"edge_force\"\ncoefficient_N_per_mm = [4.0, 3.0, 1.0]\n",
    );
    place.succeed(&["diagnose", "--model", "bare.toml", "made.csv"]);
    let json = place.json("diagnosis/diagnosis.json");
    assert_eq!(
        (json["verdict"].as_str(), json["domain"].as_str()),
        (Some("missing_physics"), Some("force"))
    );
    let mut found = effects(&json);
    found.sort_unstable();
    assert_eq!(found, ["edge_force", "runout"]);
    let page = place.read("diagnosis/report.html");
    assert!(page.contains("One spindle revolution"));
    // With the complete model nothing is missing any more.
    place.succeed(&["diagnose", "--model", "truth.toml", "--out", "told", "made.csv"]);
    assert_eq!(place.json("told/diagnosis.json")["verdict"], "consistent");
    let simulate = ["simulate", "--model"];
    place
        .succeed(&[&simulate[..], &["diagnosis/model.toml", "--out", "again", "cut.csv"]].concat());
    place.succeed(&[&simulate[..], &["truth.toml", "--out", "exact", "cut.csv"]].concat());
    let header = place.read("exact.csv").lines().next().unwrap().to_owned();
    for (column, _) in header.split(',').enumerate().filter(|(_, name)| name.ends_with("_N")) {
        let [a, b] = ["again.csv", "exact.csv"].map(|name| force(&place, name, column));
        let squares: f64 = a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b)).sum();
        let rms = (squares / a.len() as f64).sqrt();
        assert!(rms < 0.3, "column {column}: {rms} N of 2 N noise");
    }
}

#[test]
fn a_broken_recording_of_a_stated_cut_is_an_error_or_undetermined() {
    let place = milled("");
    let whole = place.read("made.csv");
    let about = place.read("made.toml");
    let lines: Vec<&str> = whole.lines().collect();
    let without_speed: String = lines
        .iter()
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let header: Vec<&str> = lines[0].split(',').collect();
            let kept = cells.iter().zip(&header).filter(|(_, name)| **name != "spindle_rpm");
            format!("{}\n", kept.map(|(cell, _)| *cell).collect::<Vec<&str>>().join(","))
        })
        .collect();
    for (name, text) in [
        ("truncated", lines[..60].join("\n")),
        ("header", lines[0].to_owned()),
        ("speedless", without_speed),
    ] {
        place.file(&format!("{name}.csv"), &text);
        place.file(&format!("{name}.toml"), &about);
        let done =
            place.run(&["diagnose", "--out", name, "--model", "bare.toml", &format!("{name}.csv")]);
        if done.code == Some(0) {
            let json = place.json(&format!("{name}/diagnosis.json"));
            assert_eq!(json["verdict"], "undetermined", "{name}");
            assert!(effects(&json).is_empty(), "{name}");
        } else {
            assert_eq!(done.code, Some(2), "{name}: {}", done.err);
            assert!(!done.err.is_empty());
        }
    }
}
