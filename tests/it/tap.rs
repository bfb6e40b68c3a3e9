//! `trued tap`: hits with known modes, refused input, the modal list of a model, a real tool and
//! holder.

use crate::program::{Done, Place, real_data};
use spectrum::Complex;
use spectrum_report::tap::{Channels, Settings, analyse, read};
use std::f64::consts::{PI, TAU};
use std::fmt::Write;

const RATE_HZ: f64 = 2048.0;
/// Natural frequency Hz, damping, modal mass kg.
const ROBOT: [(f64, f64, f64); 2] = [(21.4, 0.03, 60.0), (66.2, 0.02, 40.0)];

/// Repeatable noise of unit size.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

/// Force and acceleration under half-sine blows of 4 ms: the exact solution between samples.
fn record(length_s: f64, blows: &[(f64, f64)]) -> (Vec<f64>, Vec<f64>) {
    let n = (length_s * RATE_HZ) as usize;
    let force: Vec<f64> = (0..n)
        .map(|i| {
            let part = |at_s: f64| (i as f64 / RATE_HZ - at_s) / 0.004;
            let one = |(at_s, peak): &(f64, f64)| match part(*at_s) {
                part if (0.0..1.0).contains(&part) => peak * (PI * part).sin(),
                _ => 0.0,
            };
            blows.iter().map(one).sum()
        })
        .collect();
    let mut response = vec![0.0; n];
    for (f_n, zeta, mass) in ROBOT {
        let w_d = TAU * f_n * f64::sqrt(1.0 - zeta * zeta);
        let pole = Complex::new(-zeta * TAU * f_n, w_d);
        let turn = (pole / RATE_HZ).exp();
        let level = (turn - 1.0) / pole;
        let slope = (turn - 1.0 - pole / RATE_HZ) / (pole * pole / RATE_HZ);
        let mut z = Complex::<f64>::default();
        for i in 0..n {
            response[i] += ((pole * pole * z).im / w_d + force[i]) / mass;
            let next = force.get(i + 1).copied().unwrap_or(0.0);
            z = turn * z + level * force[i] + slope * (next - force[i]);
        }
    }
    (force, response)
}

fn csv(blows: &[(f64, f64)], length_s: f64) -> String {
    let (force, response) = record(length_s, blows);
    let mut noise = Noise(3);
    let mut text = String::from("time_s,hammer_N,arm_m_s2\n");
    for (i, (f, a)) in force.iter().zip(&response).enumerate() {
        let (f, a) = (f + 0.3 * noise.next(), a + 0.01 * noise.next());
        writeln!(text, "{:.8},{f:.5},{a:.6}", i as f64 / RATE_HZ).unwrap();
    }
    text
}

pub(crate) fn four_hits() -> String {
    csv(
        &[(0.3, 200.0), (2.8, 260.0), (5.3, 300.0), (5.34, 60.0), (7.8, 240.0), (10.3, 220.0)],
        12.8,
    )
}

fn refused(done: &Done, arguments: &[&str]) {
    assert_eq!(done.code, Some(2), "{done:#?}");
    for part in arguments {
        assert!(done.err.contains(part), "{part:?} in\n{}", done.err);
    }
}

#[test]
fn the_library_gives_the_modes_the_text_and_the_result_that_the_command_writes() {
    let place = Place::new();
    place.file("run.csv", &four_hits());
    let done = place.succeed(&["tap", "run.csv", "--json", "tap.json"]);
    let source = read(&[place.path("run.csv")], &Channels::default()).expect("a record");
    let analysis = analyse(source, &Settings::default()).expect("hits");
    assert_eq!(done.out, analysis.text(None, None));
    let json: serde_json::Value = serde_json::from_str(&analysis.json(None).unwrap()).unwrap();
    assert_eq!(json, place.json("tap.json"));
    assert!(!analysis.modes.is_empty());
    for (mode, (frequency_hz, ..)) in analysis.modes.iter().zip(ROBOT) {
        let off_hz = (mode.frequency_hz - frequency_hz).abs();
        assert!(analysis.is_verified(mode) && off_hz < 0.1, "{frequency_hz} Hz");
    }
    // If more coherence is required than possible, no mode is verified.
    let source = read(&[place.path("run.csv")], &Channels::default()).expect("a record");
    let settings = Settings { coherence_least: 1.1, ..Settings::default() };
    let strict = analyse(source, &settings).expect("hits");
    assert!(strict.modes.iter().all(|mode| !strict.is_verified(mode)));
}

#[test]
fn hits_give_verified_modes_within_their_uncertainty_and_a_double_hit_is_named() {
    let place = Place::new();
    place.file("run.csv", &four_hits());
    let done = place.succeed(&["tap", "run.csv", "--json", "tap.json", "--report", "tap.html"]);
    assert!(done.out.contains("5 hits found, 4 used"), "{}", done.out);
    let double = "rejected: run.csv at 5.300 s, struck twice: again with 20 %";
    assert!(done.out.contains(double), "{}", done.out);
    let result = place.json("tap.json");
    assert_eq!((&result["schema"], &result["hits"]["used"]), (&"trued.tap/1".into(), &4.into()));
    assert_eq!(result["hits"]["all"].as_array().unwrap().len(), 5);
    let modes = result["modes"].as_array().unwrap();
    assert_eq!(modes.len(), 2, "{modes:#?}");
    for (mode, (f_n, zeta, mass)) in modes.iter().zip(ROBOT) {
        let of = |key: &str| mode[key].as_f64().unwrap();
        assert!((of("frequency_Hz") - f_n).abs() < 2.5 * of("sigma_frequency_Hz"), "{mode}");
        assert!((of("damping_ratio") - zeta).abs() < 2.5 * of("sigma_damping_ratio"), "{mode}");
        assert!(of("sigma_frequency_Hz") < 0.01 * f_n && of("sigma_damping_ratio") < 0.2 * zeta);
        assert_eq!((&mode["verified"], &mode["three_signs"]), (&true.into(), &true.into()));
        let found = mode["clearest"]["modal_mass_kg"].as_f64().unwrap();
        assert!((found / mass - 1.0).abs() < 0.15, "{found} for {mass} kg");
    }
    let page = place.read("tap.html");
    roxmltree::Document::parse_with_options(
        &page,
        roxmltree::ParsingOptions { allow_dtd: true, ..roxmltree::ParsingOptions::default() },
    )
    .unwrap();
    assert!(page.contains("struck twice") && page.contains("verified"));
}

#[test]
fn one_hit_gives_its_response_function_and_modes_that_are_unverified() {
    let place = Place::new();
    place.file("one.csv", &csv(&[(0.3, 200.0)], 2.8));
    let done = place.succeed(&["tap", "one.csv", "--json", "tap.json"]);
    assert!(
        done.err.contains("by construction") && done.err.contains("at least 3"),
        "{}",
        done.err
    );
    let result = place.json("tap.json");
    let modes = result["modes"].as_array().unwrap();
    assert!(modes.len() == 2 && modes.iter().all(|mode| mode["verified"] == false), "{modes:#?}");
    assert!(result["response_functions"][0]["coherence"].is_null());
    let bins = result["response_functions"][0]["re"].as_array().unwrap().len();
    assert!(bins > 100 && result["response_functions"][0]["im"].as_array().unwrap().len() == bins);
}

#[test]
fn an_invalid_tap_test_is_refused_with_a_remedy() {
    let place = Place::new();
    place.file("one.csv", &csv(&[(0.3, 200.0)], 2.0));
    refused(
        &place.run(&["tap", "--force", "hamer", "--response", "3", "one.csv"]),
        &["hamer", "not a column", "hammer_N"],
    );
    let quiet = csv(&[], 2.0);
    place.file("quiet.csv", &quiet);
    refused(&place.run(&["tap", "quiet.csv"]), &["quiet.csv", "no hit found", "force channel"]);
    place.file("volts.csv", &quiet.replace("arm_m_s2", "arm (V)"));
    refused(&place.run(&["tap", "volts.csv"]), &["response", "--response"]);
    refused(
        &place.run(&["tap", "--force", "2", "--response", "3", "volts.csv"]),
        &["`V`", "expected m/s²", "--response-scale"],
    );
    refused(
        &place.run(&["tap", "--response-kind", "velocity", "one.csv"]),
        &["contradicts --response-kind"],
    );
    place.file("bare.csv", &quiet.replace("arm_m_s2", "arm"));
    refused(
        &place.run(&["tap", "--force", "2", "--response", "3", "bare.csv"]),
        &["has no unit", "--response-kind"],
    );
    refused(&place.run(&["tap", "--band", "90", "10", "one.csv"]), &["--band", "lower first"]);
    refused(&place.run(&["tap", "--direction", "0,0,0", "one.csv"]), &["not all 0"]);
    refused(&place.run(&["tap", "--model", "ur10e", "one.csv"]), &["--out"]);
    assert!(place.litter().is_empty());
}

#[test]
fn volts_with_sensitivities_are_the_same_test() {
    let place = Place::new();
    place.file("one.csv", &csv(&[(0.3, 200.0)], 2.8));
    let volts =
        csv(&[(0.3, 200.0)], 2.8).replace("hammer_N", "hammer (V)").replace("arm_m_s2", "arm (V)");
    place.file("volts.csv", &volts);
    place.succeed(&["tap", "one.csv", "--json", "si.json"]);
    place.succeed(&[
        "tap",
        "--force",
        "hammer",
        "--response",
        "arm",
        "--response-kind",
        "acceleration",
        "--force-scale",
        "440",
        "--response-scale",
        "98",
        "volts.csv",
        "--json",
        "volts.json",
    ]);
    let mode =
        |file: &str, key: &str| place.json(file)["modes"][1]["clearest"][key].as_f64().unwrap();
    assert!((mode("si.json", "frequency_Hz") - mode("volts.json", "frequency_Hz")).abs() < 1e-6);
    let ratio = mode("volts.json", "modal_mass_kg") / mode("si.json", "modal_mass_kg");
    assert!((ratio - 440.0 / 98.0).abs() < 1e-6, "{ratio}");
}

#[test]
fn measured_modes_go_into_the_model_and_the_rest_stays_bit_for_bit() {
    let place = Place::new();
    let thesis = recording::model::presets::preset("irb1600-6-145-thesis").unwrap().text;
    place.file("robot.toml", thesis);
    place.file("run.csv", &four_hits());
    let tap = |out: &str| {
        place.run(&[
            "tap",
            "run.csv",
            "--model",
            "robot.toml",
            "--direction",
            "0,2,0",
            "--out",
            out,
            "--json",
            "tap.json",
        ])
    };
    let over = tap("robot.toml");
    assert_eq!(over.code, Some(2), "an input is not replaced: {over:#?}");
    assert_eq!(place.read("robot.toml"), thesis);
    let done = tap("measured.toml");
    assert_eq!(done.code, Some(0), "{done:#?}");
    place.succeed(&["check", "measured.toml"]);
    let read =
        |name: &str| recording::model::RobotModel::parse(name, &place.read(name)).unwrap().file;
    let (before, after) = (read("robot.toml"), read("measured.toml"));
    assert_eq!(
        recording::model::ModelFile { modes: before.modes.clone(), ..after.clone() },
        before
    );
    let result = place.json("tap.json");
    for mode in result["modes"].as_array().unwrap() {
        let written = |entry: &&recording::model::ModeEntry| {
            Some(entry.frequency_hz) == mode["frequency_Hz"].as_f64()
        };
        let entry = after.modes.iter().find(written).expect("bit for bit");
        assert_eq!(entry.damping_ratio, mode["damping_ratio"].as_f64());
        assert_eq!(entry.direction, Some([0.0, 1.0, 0.0]));
    }
    let replaced = result["model"]["replaced"].as_array().unwrap();
    let added = result["model"]["added_Hz"].as_array().unwrap();
    assert_eq!(replaced.len() + added.len(), 2);
    assert_eq!(after.modes.len(), before.modes.len() + added.len());
    let preset = place.run(&["tap", "run.csv", "--model", "ur10e", "--out", "own.toml"]);
    assert_eq!(preset.code, Some(0), "{preset:#?}");
    place.succeed(&["check", "own.toml"]);
}

#[test]
fn no_mode_is_the_answer_no() {
    let place = Place::new();
    place.file("run.csv", &four_hits());
    let tap = ["tap", "run.csv", "--band", "100", "180", "--json", "tap.json"];
    let done = place.run(&[&tap[..], &["--model", "ur10e", "--out", "own.toml"]].concat());
    assert_eq!(done.code, Some(1), "{done:#?}");
    assert_eq!(place.names(), ["run.csv", "tap.json"], "no model without a mode");
    assert!(done.out.contains("no mode found"));
    assert_eq!(place.json("tap.json")["modes"], serde_json::json!([]));
}

/// A response function as dataset 58: accelerance of the robot's modes, even steps.
fn uff() -> String {
    let mut text = format!("{:>6}\n{:>6}\n", -1, 58);
    text += &"NONE\n".repeat(5);
    text += "    4         0    0         0       NONE         1   2       NONE         1   2\n";
    text += "         6       400         1  0.00000e+00  5.00000e-01  0.00000e+00\n";
    for (kind, unit) in [(18, "Hz"), (12, "m/s^2"), (13, "N"), (0, "NONE")] {
        let _ = writeln!(text, "{kind:>10}    0    0    0 {:<20} {unit:<20}", "NONE");
    }
    for i in 0..400 {
        let s = Complex::new(0.0, TAU * 0.5 * f64::from(i));
        let one = |(f_n, zeta, mass): (f64, f64, f64)| {
            let w_n = TAU * f_n;
            s * s / (mass * (s * s + 2.0 * zeta * w_n * s + w_n * w_n))
        };
        let h: Complex<f64> = ROBOT.into_iter().map(one).sum();
        let _ = writeln!(text, "{:>20.11e}{:>20.11e}", h.re, h.im);
    }
    text + &format!("{:>6}\n", -1)
}

#[test]
fn response_functions_of_a_universal_file_and_of_a_table_are_taken_as_they_are() {
    let place = Place::new();
    place.file("arm.uff", &uff());
    let done = place.succeed(&["tap", "arm.uff", "--json", "uff.json"]);
    assert!(done.err.contains("coherence of response functions is not read"), "{}", done.err);
    let check_modes = |file: &str| {
        let modes = place.json(file)["modes"].clone();
        for (mode, (f_n, zeta, _)) in modes.as_array().unwrap().iter().zip(ROBOT) {
            assert!((mode["frequency_Hz"].as_f64().unwrap() / f_n - 1.0).abs() < 2e-3, "{mode}");
            assert!((mode["damping_ratio"].as_f64().unwrap() / zeta - 1.0).abs() < 0.05, "{mode}");
        }
        assert_eq!(modes.as_array().unwrap().len(), 2);
    };
    check_modes("uff.json");
    let result = place.json("uff.json");
    let function = &result["response_functions"][0];
    assert_eq!(function["kind"], "accelerance");
    let column = |key: &str| function[key].as_array().unwrap().clone();
    let mut table = String::from("frequency_Hz,re,im\n");
    for ((f, re), im) in column("frequency_Hz").iter().zip(column("re")).zip(column("im")) {
        writeln!(table, "{f},{re},{im}").unwrap();
    }
    place.file("table.csv", &table);
    place.succeed(&[
        "tap",
        "--frf",
        "--response-kind",
        "acceleration",
        "table.csv",
        "--json",
        "table.json",
    ]);
    check_modes("table.json");
    place.file("run.csv", &csv(&[(0.3, 200.0)], 2.0));
    refused(&place.run(&["tap", "arm.uff", "run.csv"]), &["separately"]);
    refused(&place.run(&["tap", "--frf", "table.csv"]), &["--response-kind"]);
}

#[test]
fn options_of_hit_records_are_refused_for_response_functions() {
    let place = Place::new();
    place.file("arm.uff", &uff());
    for option in [
        ["--rate", "800"],
        ["--block-s", "1"],
        ["--windows", "none"],
        ["--estimator", "h1"],
        ["--coherence-least", "0.5"],
    ] {
        let words = [&["tap", "arm.uff"][..], &option].concat();
        refused(&place.run(&words), &[option[0], "contain response functions", "leave it out"]);
    }
    // The scale of the force acts, so that it is not refused.
    let mass = |more: &[&str]| {
        place.succeed(&[&["tap", "arm.uff", "--json", "m.json"], more].concat());
        place.json("m.json")["modes"][0]["clearest"]["modal_mass_kg"].as_f64().unwrap()
    };
    assert!((mass(&["--force-scale", "2"]) / mass(&[]) - 2.0).abs() < 1e-6);
}

#[test]
fn a_given_rate_overrides_the_time_column_as_the_help_says() {
    let place = Place::new();
    place.file("one.csv", &csv(&[(0.3, 200.0)], 2.8));
    place.succeed(&["tap", "one.csv", "--rate", "4096", "--json", "tap.json"]);
    let found = place.json("tap.json")["modes"][0]["frequency_Hz"].as_f64().unwrap();
    assert!((found / (2.0 * ROBOT[0].0) - 1.0).abs() < 0.02, "{found} Hz");
    let help = place.succeed(&["tap", "--help"]).out;
    assert!(help.contains("overrides that of the file"), "{help}");
}

#[test]
fn the_real_tools_modes_are_found_from_its_hit_and_from_its_response_functions() {
    let Some(hit) = real_data("tap-test/impact_time_Point1_Channel1_CH1.txt") else { return };
    let place = Place::new();
    let hit = hit.to_str().unwrap();
    let done = place.succeed(&[
        "tap",
        "--force",
        "2",
        "--response",
        "3",
        "--response-kind",
        "acceleration",
        "--band",
        "500",
        "3000",
        hit,
        "--json",
        "hit.json",
    ]);
    assert!(done.err.contains("unverified"), "{}", done.err);
    // The set's note has modes near these; methods differ by one or two percent.
    let check = |file: &str, within: f64| {
        for known_hz in [1056.0, 1941.0, 2598.0] {
            let modes = place.json(file)["modes"].as_array().unwrap().clone();
            let is_near = |mode: &&serde_json::Value| {
                (mode["frequency_Hz"].as_f64().unwrap() / known_hz - 1.0).abs() < within
            };
            let mode =
                modes.iter().find(is_near).unwrap_or_else(|| panic!("{known_hz} Hz: {modes:#?}"));
            assert_eq!(mode["verified"], false);
            eprintln!("{file}: {known_hz} Hz by the note, {mode}");
        }
    };
    check("hit.json", 0.02);
    let functions: Vec<String> = (1..=5)
        .filter_map(|k| real_data(&format!("tap-test/frf_Point_{k}_Channel_1_CH1.txt")))
        .map(|path| path.to_str().unwrap().to_owned())
        .collect();
    let mut arguments =
        vec!["tap", "--frf", "--response-kind", "displacement", "--band", "500", "3500"];
    arguments.extend(functions.iter().map(String::as_str));
    place.succeed(&[arguments.as_slice(), &["--json", "frf.json"]].concat());
    check("frf.json", 0.02);
    // LSCF of pyEMA 0.31 over the same five functions (500 to 3500 Hz, order 30) has these.
    let modes = place.json("frf.json")["modes"].as_array().unwrap().clone();
    for (mode, (hz, zeta)) in
        modes.iter().zip([(1068.3, 0.0318), (1962.8, 0.0402), (2604.6, 0.0211)])
    {
        let of = |key: &str| mode[key].as_f64().unwrap();
        assert!((of("frequency_Hz") - hz).abs() < 2.0 * of("sigma_frequency_Hz"), "{hz}: {mode}");
        assert!(
            (of("damping_ratio") - zeta).abs() < 2.0 * of("sigma_damping_ratio"),
            "{zeta}: {mode}"
        );
    }
}

#[test]
fn units_of_response_functions_are_converted_or_refused() {
    let place = Place::new();
    let mass_of = |text: &str| {
        place.file("arm.uff", text);
        place.succeed(&["tap", "arm.uff", "--json", "arm.json"]);
        place.json("arm.json")["modes"][0]["clearest"]["modal_mass_kg"].as_f64().unwrap()
    };
    let (stated, newton) = (uff(), format!("{:<20} {:<20}", "NONE", "N"));
    let with_force = |unit: &str| {
        assert!(stated.contains(&newton));
        stated.replace(&newton, &format!("{:<20} {unit:<20}", "NONE"))
    };
    let kg = mass_of(&stated);
    for (unit, factor) in [("daN", 10.0), ("kgf", 9.806_65), ("lbs", 4.448_221_615)] {
        assert!((mass_of(&with_force(unit)) / (kg * factor) - 1.0).abs() < 1e-6, "{unit}");
    }
    // Dataset 164 with mm and mN: the numbers of a function in m and N, without a stated unit.
    let system = format!(
        "{:>6}\n{:>6}\n{:>10}{:<20}{:>10}\n{:>25.16e}{:>25.16e}{:>25.16e}\n{:>25.16e}\n{:>6}\n",
        -1, 164, 9, "USER", 2, 1e3, 1e3, 1.0, 273.15, -1
    );
    let bare = with_force("NONE").replace("m/s^2", "NONE ");
    assert!((mass_of(&(system + &bare)) / kg - 1.0).abs() < 1e-6);
    for unit in ["V", "foo"] {
        place.file("arm.uff", &with_force(unit));
        refused(&place.run(&["tap", "arm.uff"]), &["an unknown unit", "--force-scale"]);
    }
    let table = |head: &str| {
        let rows: String = (1..50).map(|k| format!("{k},1,0.5\n")).collect();
        place.file("table.csv", &format!("{head}\n{rows}"));
        place.run(&["tap", "--frf", "--response-kind", "acceleration", "table.csv"])
    };
    refused(&table("omega (rad/s),re,im"), &["its first column is in `rad/s`"]);
    refused(&table("frequency_Hz,Magnitude,Phase (deg)"), &["`Magnitude`", "real part"]);
    refused(&table("frequency_Hz,imag,real"), &["`imag`", "real part"]);
    refused(&table("frequency_Hz,re (V/N),im (V/N)"), &["`V/N`", "an unknown unit"]);
}
