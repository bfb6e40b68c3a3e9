//! `trued diagnose` on forces without a robot: what is told apart, what is found of the sensor, what is never claimed.

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
fn air_and_cut_are_told_apart_and_the_sensors_bias_goes_into_the_model() {
    let place = Place::new();
    place.file("cut.csv", &recording(400.0, 0.0));
    place.succeed(&["diagnose", "cut.csv"]);
    let json = place.json("diagnosis/diagnosis.json");
    assert_eq!((json["domain"].as_str(), json["unit"].as_str()), (Some("force"), Some("N")));
    assert_eq!(effects(&json), ["wrench_bias"]);
    // The edge of the cut falls into a block of 20 ms, which may count as an entry or exit of its own.
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
