//! `trued surface`: known profiles, refused input, and the National Physical Laboratory's reference
//! profiles.

use crate::program::{Done, Place, real_data};
use std::f64::consts::TAU;
use std::fmt::Write;

/// A sine of roughness over one of waviness, µm, on a slope, 1 µm apart.
pub(crate) fn profile(header: &str, row: impl Fn(usize, f64) -> String) -> String {
    let mut text = header.to_owned();
    for i in 0..12_000 {
        let x = i as f64 * 0.001;
        let z = 3.0 * (TAU * x / 4.0).sin() + 0.8 * (TAU * x / 0.15).sin() + 7.0 * x;
        writeln!(text, "{}", row(i, z)).unwrap();
    }
    text
}

fn refused(done: &Done, arguments: &[&str]) {
    assert_eq!(done.code, Some(2), "{done:#?}");
    for part in arguments {
        assert!(done.err.contains(part), "{part:?} in\n{}", done.err);
    }
}

#[test]
fn a_known_profile_gives_its_parameters_segments_and_feed_mark() {
    let place = Place::new();
    place.file("cut.csv", &profile("x_um,z_um\n", |i, z| format!("{i},{z:.6}")));
    let done = place.succeed(&[
        "surface",
        "cut.csv",
        "--json",
        "s.json",
        "--report",
        "s.html",
        "--feed-mm-s",
        "10",
        "--spindle-rpm",
        "2000",
        "--teeth",
        "2",
        "--wheel",
        "3:1=6.6667",
    ]);
    assert!(
        done.out.contains("tooth passing") && done.out.contains("joint 3, shaft 1"),
        "{}",
        done.out
    );
    assert!(done.out.contains("Parseval"), "{}", done.out);
    let result = place.json("s.json");
    let one = &result["profiles"][0];
    let parameter = |path: [&str; 2]| one[path[0]][path[1]].as_f64().unwrap();
    assert_eq!(
        (&result["schema"], &result["cut_off_mm"]),
        (&"trued.surface/1".into(), &0.8.into())
    );
    assert!(
        (parameter(["roughness", "q_um"]) / (0.8 / 2.0_f64.sqrt()) - 1.0).abs() < 0.05,
        "{one:#}"
    );
    assert!((parameter(["roughness", "a_um"]) / (1.6 / TAU * 2.0) - 1.0).abs() < 0.05);
    assert!(
        (one["Rz_um"].as_f64().unwrap() / 1.6 - 1.0).abs() < 0.1 && one["Rz_sampling_lengths"] == 5
    );
    assert!((one["RSm_um"].as_f64().unwrap() / 150.0 - 1.0).abs() < 0.01);
    let by_spectrum = one["Rq_by_spectrum_um"].as_f64().unwrap();
    assert!((by_spectrum - parameter(["roughness", "q_um"])).abs() < 1e-12);
    assert!((one["evaluated_mm"].as_f64().unwrap() - 11.2).abs() < 1e-9);
    let segments = one["segments"].as_array().unwrap();
    let lengths: Vec<_> = segments.iter().map(|s| s["each"].as_array().unwrap().len()).collect();
    assert_eq!(lengths, [4, 44], "2.5 and 0.25 mm, whole ones");
    assert!((segments[1]["mean"]["Rq_um"].as_f64().unwrap() / 0.566 - 1.0).abs() < 0.05);
    let line = &one["lines"][0];
    assert!((line["wavelength_um"].as_f64().unwrap() / 150.0 - 1.0).abs() < 0.005, "{line}");
    assert!((line["frequency_Hz"].as_f64().unwrap() - 66.67).abs() < 0.3, "{line}");
    let page = place.read("s.html");
    let options =
        roxmltree::ParsingOptions { allow_dtd: true, ..roxmltree::ParsingOptions::default() };
    roxmltree::Document::parse_with_options(&page, options).unwrap();
}

#[test]
fn millimetres_heights_alone_and_brackets_are_the_same_profile() {
    let place = Place::new();
    place.file("um.csv", &profile("x_um,z_um\n", |i, z| format!("{i},{z:.6}")));
    place.file(
        "mm.csv",
        &profile("X [mm];Z [mm]\n", |i, z| format!("{};{}", i as f64 * 1e-3, z * 1e-3)),
    );
    place.file("alone.txt", &profile("", |_, z| format!("{z:.6}")));
    let rq = |arguments: &[&str]| {
        place.succeed(&[&["surface", "--json", "s.json"], arguments].concat());
        place.json("s.json")["profiles"][0]["roughness"]["q_um"].as_f64().unwrap()
    };
    let (a, b) = (rq(&["um.csv"]), rq(&["mm.csv"]));
    let c = rq(&["alone.txt", "--spacing-um", "1", "--unit", "um"]);
    assert!((a / b - 1.0).abs() < 1e-5 && (a / c - 1.0).abs() < 1e-5, "{a} {b} {c}");
    let two = place.succeed(&["surface", "um.csv", "mm.csv", "--report", "two.html"]);
    assert!(two.out.contains("um: ") && two.out.contains("mm: "), "{}", two.out);
}

#[test]
fn anything_but_a_profile_is_refused_with_a_remedy() {
    let place = Place::new();
    let good = profile("x_um,z_um\n", |i, z| format!("{i},{z:.6}"));
    place.file("good.csv", &good);
    refused(
        &place.run(&["surface", "--column", "h", "good.csv"]),
        &["`h`", "not a column", "z_um"],
    );
    place.file("alone.txt", &profile("", |_, z| format!("{z:.6}")));
    refused(&place.run(&["surface", "--unit", "um", "alone.txt"]), &["alone.txt"]);
    refused(
        &place.run(&["surface", "--spacing-um", "1", "alone.txt"]),
        &["states no unit", "--unit"],
    );
    place.file("force.csv", &good.replace("z_um", "z_N"));
    refused(&place.run(&["surface", "force.csv"]), &["`N`", "expected heights"]);
    place.file("time.csv", &good.replace("x_um", "t_s"));
    refused(&place.run(&["surface", "time.csv"]), &["--spacing-um", "x_um"]);
    let gap: String = good
        .lines()
        .enumerate()
        .filter(|(i, _)| !(500..600).contains(i))
        .fold(String::new(), |text, (_, line)| text + line + "\n");
    place.file("gap.csv", &gap);
    refused(&place.run(&["surface", "gap.csv"]), &["2 pieces", "gaps"]);
    let hole =
        |line: &str| if line.starts_with("700,") { "700,".to_owned() } else { line.to_owned() };
    place.file("hole.csv", &good.lines().map(|line| hole(line) + "\n").collect::<String>());
    refused(&place.run(&["surface", "hole.csv"]), &["hole.csv", "height 700", "not finite"]);
    refused(&place.run(&["surface", "--cut-off-mm=-1", "good.csv"]), &["--cut-off-mm"]);
    refused(
        &place.run(&["surface", "--cut-off-mm", "0.0005", "good.csv"]),
        &["cut-off", "spacing"],
    );
    refused(&place.run(&["surface", "--wheel", "2=6", "good.csv"]), &["JOINT:SHAFT"]);
    refused(&place.run(&["surface", "absent.csv"]), &["absent.csv"]);
    assert!(place.litter().is_empty());
}

#[test]
fn gear_trains_of_joints_that_the_model_does_not_have_are_refused() {
    let place = Place::new();
    place.file("p.csv", "x_um,z_um\n0,1\n1,2\n2,1\n");
    let wheel = ["surface", "--wheel", "7:1=3", "--feed-mm-s", "5", "--model", "ur10e", "p.csv"];
    refused(&place.run(&wheel), &["joint 7 does not exist", "from 1 to 6"]);
    refused(&place.run(&["surface", "--wheel", "99:1=3", "p.csv"]), &["from 1 to 16"]);
}

#[test]
fn the_reference_profiles_have_the_laboratorys_parameters() {
    let Some(edm) = real_data("surface-profile/edm_profile.csv") else { return };
    let Some(mill) = real_data("surface-profile/mill_profile.csv") else { return };
    let place = Place::new();
    let run = |arguments: &[&str]| {
        place.succeed(&[&["surface", "--form", "0", "--json", "s.json"], arguments].concat());
        place.json("s.json")["profiles"][0].clone()
    };
    let close = |one: &serde_json::Value, known: &[(&str, f64)], within: f64| {
        for (key, known) in known {
            let found = one["primary"][key].as_f64().unwrap();
            assert!((found / known - 1.0).abs() < within, "{key}: {found} for {known}");
        }
    };
    let one = run(&[edm.to_str().unwrap()]);
    let known = [
        ("a_um", 0.46434),
        ("q_um", 0.55994),
        ("t_um", 2.8623),
        ("p_um", 1.39459),
        ("v_um", 1.4677),
        ("ku", 2.36461),
    ];
    close(&one, &known, 1e-4);
    assert_eq!(one["lines"], serde_json::json!([]), "an eroded surface has no feed mark");
    let one = run(&["--short-cut-off-um", "0.8", mill.to_str().unwrap()]);
    close(&one, &[("a_um", 0.19942), ("q_um", 0.24942), ("t_um", 1.41213), ("ku", 2.99606)], 1e-3);
    let wavelength_um = one["lines"][0]["wavelength_um"].as_f64().unwrap();
    assert!((wavelength_um / 200.0 - 1.0).abs() < 0.02, "{wavelength_um}");
}
