//! `trued diagnose` on torques, through the program: effects left out of the model are found, with
//! files of the documented formats.

use std::fmt::Write as _;

use serde_json::Value;

use crate::program::Place;
use crate::simulate_torques::SLIDE;

/// A slide without a stated mass.
fn slide() -> String {
    SLIDE.lines().filter(|line| !line.starts_with("link")).map(|line| format!("{line}\n")).collect()
}

/// 95 kg with 20 N of dry friction; `positions` adds a measured tool at its nominal position.
fn recording(positions: bool) -> String {
    let mut text = String::from("t_s,qa1_m,tau1_N");
    text += if positions { ",x_mm,y_mm,z_mm\n" } else { "\n" };
    for k in 0..12_000 {
        let t = 2e-3 * f64::from(k);
        let waves = [(0.1, 1.1, 0.0_f64), (0.04, 2.9, 1.0)];
        let sum = |f: &dyn Fn(f64, f64, f64) -> f64| {
            waves.iter().map(|(size, rate, phase)| f(*size, *rate, rate * t + phase)).sum::<f64>()
        };
        let q = sum(&|size, _, x| size * x.sin());
        let v = sum(&|size, rate, x| size * rate * x.cos());
        let a = sum(&|size, rate, x| -size * rate * rate * x.sin());
        let noise = f64::from(k * 7919 % 1000) / 500.0 - 1.0;
        let force = 95.0 * a + 20.0 * v.signum() + noise;
        let _ = write!(text, "{t:.4},{q:.9},{force:.6}");
        if positions {
            let _ = write!(text, ",{:.6},{:.6},100.0", 1e3 * q + 0.02 * noise, -0.02 * noise);
        }
        text.push('\n');
    }
    text
}

#[test]
fn dry_friction_that_was_left_out_is_named_in_the_torque_domain_and_written_into_the_model() {
    let place = Place::new();
    place.file("slide.toml", &slide());
    place.file("force.csv", &recording(false));
    place.succeed(&["diagnose", "--model", "slide.toml", "--out", "out", "force.csv"]);
    let result: Value = serde_json::from_str(&place.read("out/diagnosis.json")).unwrap();
    assert_eq!((&result["domain"], &result["unit"]), (&Value::from("torque"), &Value::from("N")));
    assert_eq!(result["verdict"], "missing_physics");
    let first = &result["findings"][0];
    assert_eq!((&first["effect"], &first["joint"]), (&"coulomb_friction".into(), &1.into()));
    let level = &first["parameters"]["level_N"];
    let bounds = level["ci95"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap());
    let bounds: Vec<f64> = bounds.collect();
    assert!(bounds[0] < 20.0 && 20.0 < bounds[1] && bounds[1] - bounds[0] < 2.0, "{level}");
    let size = [&first["size"]["rms"], &first["size"]["max"]].map(|x| x.as_f64().unwrap());
    assert!(size.iter().all(|newton| (newton / 20.0 - 1.0).abs() < 0.15), "{size:?}");
    assert_eq!(result["candidates"], Value::Array(Vec::new()));
    let model = place.read("out/model.toml");
    assert!(model.contains("coulomb_friction") && model.contains("level_N"), "{model}");
    // With the findings in the model the same recording is consistent.
    place.succeed(&["diagnose", "--model", "out/model.toml", "--out", "again", "force.csv"]);
    let again: Value = serde_json::from_str(&place.read("again/diagnosis.json")).unwrap();
    assert_eq!(again["verdict"], "consistent", "{again}");
}

#[test]
fn positions_and_torques_give_both_domains() {
    let place = Place::new();
    place.file("slide.toml", &slide());
    place.file("both.csv", &recording(true));
    place.succeed(&["diagnose", "--model", "slide.toml", "--out", "out", "both.csv"]);
    let result: Value = serde_json::from_str(&place.read("out/diagnosis.json")).unwrap();
    let domains: Vec<&Value> = result["domains"].as_array().unwrap().iter().collect();
    let names: Vec<&Value> = domains.iter().map(|one| &one["domain"]).collect();
    assert_eq!(names, ["position", "torque"]);
    assert_eq!(result["schema"], "trued.diagnosis/1");
    assert_eq!(domains[1]["findings"][0]["effect"], "coulomb_friction");
}
