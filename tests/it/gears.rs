//! `trued gears`: cuts whose joint speeds follow from geometry, lines of known meshes, and no
//! result where there is none.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use serde_json::Value;
use tests::rng::TestRng;

use crate::program::Place;
use crate::spectrum::geared_cut;

const MODEL: &str = "irb1600-6-145-thesis";
/// Whole ratios by table A III-1.
const RATIO: [f64; 3] = [131.0 * 129.0 / 130.0, 131.0 * 129.0 / 130.0, 134.0 * 120.0 / 154.0];
/// The tool points down; the wrist is this far from axis 1, and as high over joint 2 as the upper
/// arm is long.
const POSE: &str = "0,0,0,0,90,0";
const WRIST_MM: f64 = 750.0;
const UPPER_ARM_MM: f64 = 700.0;

fn gears(place: &Place, arguments: &[&str]) -> Value {
    place.succeed(&[&["gears", "--model", MODEL, "--json", "g.json"], arguments].concat());
    place.json("g.json")
}

fn list<'v>(found: &'v Value, key: &str) -> &'v [Value] {
    found[key].as_array().expect(key).as_slice()
}

fn mean(wheel: &Value) -> f64 {
    wheel["cycles_per_mm"]["mean"].as_f64().unwrap()
}

fn wheel<'v>(found: &'v Value, joint: u8, shaft: u8, what: &str) -> Option<&'v Value> {
    list(found, "wheels").iter().find(|w| {
        (&w["joint"], &w["shaft"], &w["what"]) == (&joint.into(), &shaft.into(), &what.into())
    })
}

fn is_near(value: f64, known: f64, part: f64) -> bool {
    (value / known - 1.0).abs() < part
}

#[test]
fn across_the_arm_joint_one_turns_by_one_over_its_lever_and_the_teeth_carry_on() {
    let place = Place::new();
    let found = gears(&place, &["--from", POSE, "--cut", "0,2,0"]);
    let motor = wheel(&found, 1, 1, "turn").unwrap();
    let turns = RATIO[0] / (TAU * WRIST_MM);
    assert!(is_near(mean(motor), turns, 1e-5), "{motor:#}");
    assert!(is_near(motor["degrees_per_mm"].as_f64().unwrap(), 360.0 * turns, 1e-5));
    assert!(is_near(mean(wheel(&found, 1, 1, "mesh").unwrap()), 10.0 * turns, 1e-5));
    assert!(is_near(motor["cycles_per_rev"].as_f64().unwrap(), RATIO[0], 1e-9), "{motor:#}");
    let second = wheel(&found, 1, 2, "turn").unwrap();
    assert!(is_near(mean(second), turns * 10.0 / 131.0, 1e-5), "{second:#}");
    assert!(is_near(mean(wheel(&found, 1, 2, "mesh").unwrap()), turns * 130.0 / 131.0, 1e-5));
    // The tool keeps its orientation: joint 6, whose axis points down, rotates equally.
    assert!(is_near(mean(wheel(&found, 6, 1, "turn").unwrap()), 44.0 / (TAU * WRIST_MM), 1e-5));
    let alone = gears(&place, &["--from", POSE, "--cut", "0,2,0", "--wheels-of", "6"]);
    assert!(list(&alone, "wheels").iter().all(|wheel| wheel["joint"] == 6));
}

#[test]
fn towards_the_base_both_links_move_and_joint_one_is_at_rest() {
    let place = Place::new();
    let found = gears(&place, &["--from", POSE, "--cut=-1,0,0"]);
    assert!(wheel(&found, 1, 1, "turn").is_none() && wheel(&found, 6, 1, "turn").is_none());
    // Vertical upper arm, horizontal forearm: joint 2 alone moves the wrist horizontally, joint 3
    // rotates back to keep its height.
    for joint in [2, 3] {
        let motor = wheel(&found, joint, 1, "turn").unwrap();
        let known = RATIO[usize::from(joint) - 1] / (TAU * UPPER_ARM_MM);
        assert!(is_near(mean(motor), known, 2e-3), "{motor:#}");
    }
}

/// A cut of 100 mm across the arm: the teeth of joint 1's motor, and noise, µm over µm.
fn profile(amplitude_um: f64) -> String {
    let mut chance = TestRng::new(11);
    let mut text = String::from("x_um,z_um\n");
    for i in 0..10_000 {
        let y_mm = 0.01 * f64::from(i);
        let q1_rad = (y_mm / WRIST_MM).atan();
        let z_um = amplitude_um * (10.0 * RATIO[0] * q1_rad).sin() + 0.2 * (chance.uniform() - 0.5);
        writeln!(text, "{},{z_um:.6}", 10 * i).unwrap();
    }
    text
}

#[test]
fn a_profile_that_a_mesh_has_written_is_matched_with_it_and_one_of_noise_with_nothing() {
    let place = Place::new();
    place.file("mesh.csv", &profile(1.0));
    place.file("noise.csv", &profile(0.0));
    let cut = ["--from", POSE, "--cut", "0,100,0", "--report", "g.html"];
    let found = gears(&place, &[&cut[..], &["--profile", "mesh.csv"]].concat());
    let line = &list(&found, "lines")[0];
    let best = &line["match"];
    assert_eq!(
        (&best["joint"], &best["shaft"], &best["what"], &best["teeth"], &best["multiple"]),
        (&1.into(), &1.into(), &"mesh".into(), &10.into(), &1.into()),
        "{line:#}"
    );
    assert!(best["distance_percent"].as_f64().unwrap().abs() < 1.0, "{line:#}");
    assert!(place.read("g.html").contains("10 teeth of shaft 1"));
    let none = gears(&place, &[&cut[..], &["--profile", "noise.csv"]].concat());
    assert!(list(&none, "lines").iter().all(|line| line["match"].is_null()), "{none:#}");
}

#[test]
fn a_line_between_the_wheels_fits_nothing_and_rivals_are_named() {
    let place = Place::new();
    let cut = ["--from", POSE, "--cut", "0,20,0"];
    // The next gear lines are at 0.089 (3 × the third mesh of joint 6) and 0.13 (its second mesh).
    let found = gears(&place, &[&cut[..], &["--lines", "0.11,0.0827"]].concat());
    let [unmatched, shared] = list(&found, "lines") else { panic!("{found:#}") };
    assert!(
        unmatched["match"].is_null() && unmatched["rivals"] == serde_json::json!([]),
        "{unmatched:#}"
    );
    assert!(unmatched["by_chance"].as_f64().unwrap() < 0.3, "{unmatched:#}");
    // Three times the motor's rotation, and three times the teeth of the second shaft, 130 and 131:
    // indistinguishable.
    let places =
        |fit: &Value| (fit["joint"].clone(), fit["shaft"].clone(), fit["multiple"].clone());
    let fits: Vec<_> =
        [&shared["match"]].into_iter().chain(list(shared, "rivals")).map(places).collect();
    for shaft in [1, 2] {
        assert!(fits.contains(&(1.into(), shaft.into(), 3.into())), "{shared:#}");
    }
}

#[test]
fn a_joint_that_speeds_up_along_the_cut_is_reported_as_drifting_and_not_matched() {
    let place = Place::new();
    let line = format!("{}", 10.0 * RATIO[0] * (500.0_f64 / WRIST_MM).atan() / TAU / 500.0);
    let cut = ["--from", POSE, "--cut", "0,500,0", "--lines", &line];
    let done = place.succeed(&[&["gears", "--model", MODEL], &cut[..]].concat());
    let output = &done.out;
    assert!(
        output.contains("joint 1 drifts by") && output.contains("375.0 to 500.0 mm"),
        "{output}"
    );
    let found = gears(&place, &cut);
    let motor = wheel(&found, 1, 1, "mesh").unwrap();
    assert!(is_near(mean(motor), line.parse().unwrap(), 1e-6) && motor["smeared"] == true);
    // 1/r times the cosine of the angle to the cut: cos² falls to 750² / (750² + 500²).
    let range = &motor["cycles_per_mm"];
    let fell = range["least"].as_f64().unwrap() / range["most"].as_f64().unwrap();
    assert!(is_near(fell, 750.0 * 750.0 / (750.0 * 750.0 + 500.0 * 500.0), 0.02), "{fell}");
    let best = &list(&found, "lines")[0]["match"];
    assert!(best.is_null() || best["joint"] != 1, "{best:#}");
}

#[test]
fn forces_over_a_recorded_path_are_matched_as_trued_spectrum_matches_them() {
    let place = Place::new();
    place.file("cut.csv", &geared_cut().csv());
    let found = gears(&place, &["--force", "cut.csv", "--signal", "fx_N"]);
    let motor = wheel(&found, 1, 1, "mesh").unwrap();
    assert!(motor["drift_percent"].as_f64().unwrap() < 1.0, "{motor:#}");
    let line = &list(&found, "lines")[0];
    let best = &line["match"];
    assert_eq!(
        (&best["joint"], &best["shaft"], &best["teeth"]),
        (&1.into(), &1.into(), &10.into())
    );
    assert!(is_near(line["cycles_per_mm"].as_f64().unwrap(), mean(motor), 0.01), "{line:#}");
}

#[test]
fn what_cannot_be_a_path_a_joint_or_a_line_is_refused_with_a_remedy() {
    let place = Place::new();
    let refused = |arguments: &[&str], part: &str| {
        let done = place.run(&[&["gears", "--model", MODEL], arguments].concat());
        assert_eq!(done.code, Some(2), "{done:#?}");
        assert!(done.err.contains(part), "{part:?} in\n{}", done.err);
    };
    let cut = |more: &[&'static str]| [&["--from", POSE, "--cut", "0,9,0"], more].concat();
    refused(&[], "--from");
    refused(&["--from", POSE], "--cut");
    refused(&["--from", "0,0,0", "--cut", "0,9,0"], "has 3 positions, the robot has 6 joints");
    refused(&["--from", POSE, "--cut", "0,9"], "DX,DY,DZ");
    refused(&["--from", POSE, "--cut", "5000,0,0"], "out of reach");
    refused(&cut(&["--wheels-of", "9"]), "--wheels-of 9");
    refused(&cut(&["--lines=-0.3"]), "cycles per mm above 0");
    refused(&cut(&["--tolerance", "0"]), "--tolerance");
    refused(&cut(&["--profile", "absent.csv"]), "absent.csv");
    let done = place.run(&["gears", "--model", "ur10e", "--from", POSE, "--cut", "0,9,0"]);
    assert!(done.code == Some(2) && done.err.contains("gear_teeth = [["), "{done:#?}");
}
