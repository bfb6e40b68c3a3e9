//! `trued diagnose`: effects concealed from a model are found, absent ones are not, and invalid
//! recordings are not evaluated.

use std::fmt::Write as _;

use diagnosis_report::progress::ignore;
use diagnosis_report::{ReportedFinding, Settings, diagnose, lines, summary};
use recording::model::presets::preset;
use recording::series::{self, RequiredData};
use report::significant;
use serde_json::Value;
use shm_schema::Cell;
use trued_client::Client;

use tests::rng::TestRng;

use crate::pages;
use crate::program::{Done, Place, signal};
use crate::reload::{beside, status};

pub(crate) const BASE: &str = "irb1600-6-145";
const BACKLASH: &str = "[[effect]]\nkind = \"backlash\"\njoint = 3\nwidth_mrad = 0.42\n";
const ROWS: u32 = 900;
/// Seen from an unknown place.
const ABOUT: &str =
    "schema = \"trued.recording/1\"\nsigma = { x_mm = 0.03, y_mm = 0.03, z_mm = 0.03 }\n";

/// All joints oscillate, each at its own frequency.
pub(crate) fn path() -> String {
    path_of(0.02)
}

/// The same, a row every `step_s`.
pub(crate) fn path_of(step_s: f64) -> String {
    let mut text = String::from("t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n");
    for k in 0..ROWS {
        let t = step_s * f64::from(k);
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
    place.file("seen.toml", ABOUT);
    place
}

fn diagnosed(place: &Place, recording: &str) -> Value {
    place.succeed(&["diagnose", "--model", BASE, "--out", "said", "--seed", "1", recording]);
    place.json("said/diagnosis.json")
}

#[test]
fn a_concealed_backlash_is_named_with_its_joint_and_width_and_the_gain_is_proven() {
    let place = recorded(BACKLASH);
    let result = diagnosed(&place, "seen.csv");
    assert_eq!(result["schema"], "trued.diagnosis/1");
    assert_eq!(result["verdict"], "missing_physics", "{result:#}");
    let finding = &result["findings"][0];
    assert_eq!((&finding["effect"], &finding["joint"]), (&"backlash".into(), &3.into()));
    assert_eq!(finding["change"], "new");
    let width = &finding["parameters"]["width_mrad"];
    let number = |value: &Value| value.as_f64().expect("a number");
    let (low, high) = (number(&width["ci95"][0]), number(&width["ci95"][1]));
    assert!(low < 0.42 && 0.42 < high && high - low < 0.05, "{width}");
    let (before, after) = (&result["heldout_rms_before"], &result["heldout_rms_after"]);
    assert!(number(before) > 2.0 * number(after), "{before} {after}");
    assert!((number(after) / 0.03 - 1.0).abs() < 0.1, "down to the noise: {after}");
    assert_eq!(result["findings"].as_array().map(Vec::len), Some(1), "{result:#}");
    assert_eq!(result["candidates"], Value::Array(Vec::new()), "{result:#}");
    // It alone is missing: its size is the increase of the error, which remains completely without
    // the finding.
    let size = &finding["size"];
    let larger = (number(before).powi(2) - number(after).powi(2)).sqrt();
    assert!((number(&size["rms"]) / larger - 1.0).abs() < 0.2, "{size} beside {larger}");
    assert!(number(&size["max"]) > number(&size["rms"]), "{size}");
    let without = number(&finding["heldout_rms_without"]);
    assert!((without / number(before) - 1.0).abs() < 0.01, "{without} beside {before}");
    assert!(place.read("said/report.html").contains("backlash"));
    place.succeed(&["check", "said/model.toml"]);
    // With the finding in the model the same recording contains nothing more.
    let again =
        ["diagnose", "--model", "said/model.toml", "--out", "again", "--seed", "1", "seen.csv"];
    place.succeed(&again);
    let again = place.json("again/diagnosis.json");
    assert_eq!(again["verdict"], "consistent", "{again:#}");
}

#[test]
fn a_tolerance_is_judged_as_given_and_with_what_was_found_in_text_json_and_page() {
    let place = recorded(BACKLASH);
    let diagnose = ["diagnose", "--model", BASE, "--out", "said", "--seed", "1"];
    let arguments = [&diagnose[..], &["--tolerance-mm", "0.1", "seen.csv"]].concat();
    let text = place.succeed(&arguments).out;
    let statement = "olerance of 0.100 mm not met with the given model and met with the findings";
    assert!(text.contains(statement), "{text}");
    assert!(place.read("said/report.html").contains(statement));
    let result = place.json("said/diagnosis.json");
    let [before, after] = ["before", "after"].map(|side| &result["tolerance"][side]);
    assert_eq!((&before["met"], &after["met"]), (&false.into(), &true.into()), "{result:#}");
    // Noise of 0.03 mm in each of three axes: 95 of 100 distances are within 2.80 times that.
    let p95_mm = after["p95_mm"].as_f64().expect("a number");
    assert!((p95_mm / (2.80 * 0.03) - 1.0).abs() < 0.1, "{p95_mm}");
    let plain = diagnosed(&place, "seen.csv");
    assert!(plain.get("tolerance").is_none(), "{plain:#}");
    assert_eq!(plain["findings"], result["findings"]);
}

#[test]
fn the_library_gives_what_the_command_writes_and_lists_the_largest_findings_first() {
    let tilt = "[[effect]]\nkind = \"axis_tilt\"\njoint = 2\ntilt_mrad = [1.5, 0.0]\n";
    let place = recorded(&format!("{BACKLASH}{tilt}"));
    let written = diagnosed(&place, "seen.csv");
    let found = |findings_most| {
        let model = preset(BASE).expect("preset").model().expect("sound");
        let recording =
            series::read(&place.path("seen.csv"), None, RequiredData::Measurement).expect("a file");
        let settings = Settings { seed: 1, findings_most, ..Settings::default() };
        diagnose(model, vec![recording], &settings, &ignore).expect("a diagnosis")
    };
    let whole: Value = serde_json::from_str(&found(20).json().expect("json")).expect("json");
    assert_eq!(whole["findings"], written["findings"]);
    assert_eq!(whole["findings"].as_array().map(Vec::len), Some(2), "{whole:#}");
    let short = found(1);
    let [report] = &short.reports()[..] else { panic!("one domain") };
    let size = |list: &[ReportedFinding]| list[0].size.as_ref().expect("a size").rms;
    assert_eq!((report.findings.len(), report.minor.len()), (1, 1));
    assert!(size(&report.findings) > size(&report.minor));
    assert!(lines(report).iter().any(|line| line.contains("and 1 smaller effect")));
    assert!(summary(report).starts_with("2 effects"), "{}", summary(report));
    assert!(short.page(&place.path("said")).render().contains("And 1 smaller effect"));
    let model = short.model_toml().expect("a model");
    assert!(model.contains("\"backlash\"") && model.contains("\"axis_tilt\""), "{model}");
}

#[test]
fn the_probabilities_of_a_finding_and_of_what_else_it_may_be_add_up_to_one() {
    // Without load variation a sag is indistinguishable from a compliance, and few rows contain
    // little information.
    let weak = "[[effect]]\nkind = \"joint_compliance\"\njoint = 2\ncompliance_mrad_per_kNm = 0.4\n\
                [[effect]]\nkind = \"backlash\"\njoint = 5\nwidth_mrad = 0.08\n";
    let place = recorded(weak);
    let result = diagnosed(&place, "seen.csv");
    let all = ["findings", "candidates"].map(|key| result[key].as_array().expect("a list"));
    let claimed = result["verdict"] != "undetermined";
    assert!(!all[0].is_empty(), "{result:#}");
    for (is_candidate, finding) in
        all.iter().enumerate().flat_map(|(k, list)| list.iter().map(move |one| (k == 1, one)))
    {
        let confidence = finding["confidence"].as_f64().expect("a probability");
        let others = finding["alternatives"].as_array().expect("a list").iter();
        let sum = confidence + others.map(|one| one["confidence"].as_f64().unwrap()).sum::<f64>();
        assert!((sum - 1.0).abs() < 1e-5, "{sum}: {finding:#}");
        assert!(!claimed || (confidence < 0.5) == is_candidate, "{finding:#}");
    }
}

#[test]
fn the_page_says_first_what_was_found_and_shows_it_in_one_file() {
    let place = recorded(
        "[[effect]]\nkind = \"backlash\"\njoint = 3\nwidth_mrad = 0.42\n[[effect]]\nkind = \"joint_compliance\"\njoint = 2\ncompliance_mrad_per_kNm = 0.4\n",
    );
    diagnosed(&place, "seen.csv");
    let page = place.read("said/report.html");
    let order = [
        "Findings",
        "Before and after",
        "Errors of the readings over time",
        "Held-out errors",
        "Spectrum of the residual",
        "Where model and recording differ",
        "Each finding over its input",
        "measured, increasing",
        "compliance_mrad_per_kNm",
        "Not observable in this recording",
        "Data processing",
    ];
    let mut from = 0;
    for heading in order {
        let position = page[from..].find(heading);
        from += position.unwrap_or_else(|| panic!("`{heading}` stands after what came before"));
    }
    assert!(page.contains(concat!(">trued ", env!("CARGO_PKG_VERSION"), "<")));
    assert!(page.contains("2023-11-14 22:13 UTC"), "the time that the caller fixed");
    let command = format!("trued diagnose --model {BASE} --out said --seed 1 seen.csv");
    assert!(page.contains(&format!("<code>{command}</code>")), "{command}");
    for input in ["seen.csv", "seen.toml"] {
        let hash = challenge::commitment::sha256(&place.read(input));
        assert!(page.contains(&format!("<span title=\"SHA-256 {hash}\">{input} ")), "{input}");
    }
    assert!(!page.contains("<script") && !page.contains("src=") && !page.contains("@import"));
    assert!(page.len() < 600_000, "{} bytes", page.len());
}

#[test]
fn text_json_and_page_of_a_diagnosis_tell_the_same_numbers() {
    let place = recorded(BACKLASH);
    let arguments = ["diagnose", "--model", BASE, "--out", "said", "--seed", "1", "seen.csv"];
    let text = place.succeed(&arguments).out;
    let (result, page) = (place.json("said/diagnosis.json"), place.read("said/report.html"));
    let short = |value: &Value| significant(value.as_f64().expect("a number"), 3);
    let [before, after] =
        ["heldout_rms_before", "heldout_rms_after"].map(|key| short(&result[key]));
    let statement = format!("{before} mm with the given model, {after} with the findings");
    assert!(text.contains(&statement), "`{statement}`: {text}");
    for (label, number) in [("Given model", &before), ("With the findings", &after)] {
        let tile = format!("<dt>{label}</dt><dd class=\"value\">{number}<");
        assert!(page.contains(&tile), "{tile}");
    }
    let residual = format!("<dt>Residual</dt><dd class=\"value\">{}<", short(&result["noise_rms"]));
    assert!(page.contains(&residual), "{residual}");
    for finding in result["findings"].as_array().expect("a list") {
        let [rms, max] = ["rms", "max"].map(|key| short(&finding["size"][key]));
        assert!(text.contains(&format!("{rms} mm (largest {max})")), "{text}");
        let cells = [&rms, &max].map(|number| format!(">{number}</td>"));
        assert!(cells.iter().all(|cell| page.contains(cell)), "{cells:?}");
        assert!(page.contains(finding["says"].as_str().expect("a sentence")));
    }
    assert!(text.trim_end().ends_with("page: said/report.html"), "{text}");
}

#[test]
fn where_nothing_is_missing_nothing_is_found_and_the_same_seed_gives_the_same_bytes() {
    let place = recorded("");
    let result = diagnosed(&place, "seen.csv");
    assert_eq!(result["verdict"], "consistent", "{result:#}");
    assert_eq!(result["findings"].as_array().map(Vec::len), Some(0));
    assert!(result["not_tested"].as_array().is_some_and(|list| !list.is_empty()));
    let (first, page) = (place.read("said/diagnosis.json"), place.read("said/report.html"));
    diagnosed(&place, "seen.csv");
    assert_eq!(place.read("said/diagnosis.json"), first);
    assert_eq!(place.read("said/report.html"), page);
}

#[test]
fn a_model_is_consistent_with_the_recording_that_it_was_calibrated_from_whatever_rows_are_held_out()
{
    let place = Place::new();
    pages::calibrate(&place);
    for seed in ["1", "2", "3", "4", "5", "6", "7"] {
        let out = ["--out", "said", "--seed", seed, "measured.csv"];
        place.run(&[&["diagnose", "--model", "calibrated.toml"], &out[..]].concat());
        let result = place.json("said/diagnosis.json");
        assert_eq!(result["verdict"], "consistent", "seed {seed}: {}", result["unexplained"]);
    }
}

#[test]
fn swapped_columns_and_an_arm_that_is_at_rest_are_not_judged() {
    let place = recorded("");
    let swapped = place.read("seen.csv").replacen("q2_deg,q3_deg", "q3_deg,q2_deg", 1);
    place.file("swapped.csv", &swapped);
    let header = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n";
    let still: String = (0..50).map(|k| format!("{k},1,2,3,4,5,6,{k},0,0\n")).collect();
    place.file("still.csv", &format!("{header}{still}"));
    for name in ["swapped.csv", "still.csv"] {
        let result = diagnosed(&place, name);
        assert_eq!(result["verdict"], "undetermined", "{name}: {result:#}");
        assert_eq!(result["findings"].as_array().map(Vec::len), Some(0), "{name}");
    }
}

#[test]
fn a_band_of_torques_is_refused_where_only_positions_were_recorded() {
    let place = recorded("");
    let words = ["diagnose", "--model", BASE, "--out", "said", "--band", "30", "seen.csv"];
    let done = place.run(&words);
    assert_eq!(done.code, Some(2), "{done:#?}");
    assert!(done.err.contains("--band") && done.err.contains("drive torques"), "{}", done.err);
    assert!(!place.names().contains(&"said".to_owned()));
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

/// A cell whose daemon corrects a known zero error; `daemon` runs until the end of the test.
fn cell(place: &Place) -> (Cell, impl Drop + use<>) {
    struct Running(std::process::Child);
    impl Drop for Running {
        fn drop(&mut self) {
            signal(&self.0, "TERM");
            let _ = self.0.wait();
        }
    }
    let known = "[[effect]]\nkind = \"joint_offset\"\njoint = 2\noffset_mrad = 3.0\n";
    place.file("cell-model.toml", &format!("{}\n{known}", preset(BASE).expect("preset").text));
    // Late commands are not tested here.
    let config = "schema = \"trued.cell/1\"\ncell = \"cell\"\nmodel = \"cell-model.toml\"\nmode = \"full\"\n\
                  [cycle]\nstale_ms = 500.0\n[envelope]\nrate_mrad_s = 10.0\n";
    place.file("cell.toml", config);
    let daemon = Running(place.start(&["run", "--config", "cell.toml"]));
    let cell = Cell::at(&place.path("run"), "cell").expect("a short path");
    let joined =
        (0..100).any(|_| Client::connect_to(&cell, std::time::Duration::from_millis(200)).is_ok());
    assert!(joined, "the daemon is there");
    (cell, daemon)
}

fn apply(place: &Place, cell: &str, recording: &str) -> Done {
    place.run(&[
        "diagnose", "--model", BASE, "--out", "said", "--seed", "1", "--apply", cell, recording,
    ])
}

#[test]
fn the_findings_are_activated_in_the_running_daemon_without_a_missed_answer() {
    let place = recorded(BACKLASH);
    let (cell, _daemon) = cell(&place);
    let (observed, (before, after)) = beside(&cell, |monitor| {
        let before = status(monitor);
        let done = apply(&place, "cell.toml", "seen.csv");
        assert_eq!(done.code, Some(0), "{done:#?}");
        assert!(done.out.contains("loaded from"), "{}", done.out);
        (before, status(monitor))
    });
    assert_eq!(after.model_epoch, before.model_epoch + 1);
    assert_ne!(after.model_hash, before.model_hash);
    assert_eq!(observed.unanswered, 0, "of {}", observed.ticks);
    assert_eq!(observed.broken, Vec::<String>::new());
}

#[test]
fn only_missing_physics_is_applied_and_a_daemon_that_is_not_there_costs_no_diagnosis() {
    let place = recorded(BACKLASH);
    let absent = apply(&place, "nobody", "seen.csv");
    assert_eq!(absent.code, Some(3), "{absent:#?}");
    assert!(absent.err.contains("nobody"), "{}", absent.err);
    assert_eq!(place.json("said/diagnosis.json")["verdict"], "missing_physics");
    assert_eq!(apply(&place, "no-such.toml", "seen.csv").code, Some(2));
    let sound = recorded("");
    let (cell, _daemon) = cell(&sound);
    let (_, epoch) = beside(&cell, |monitor| {
        let done = apply(&sound, "cell", "seen.csv");
        assert_eq!(done.code, Some(1), "{done:#?}");
        assert!(done.out.contains("nothing to apply"), "{}", done.out);
        status(monitor).model_epoch
    });
    assert_eq!(epoch, 1);
    assert!(sound.names().contains(&"said".to_owned()));
}

/// Link sides of a path: joint 3 has backlash with a gap that depends on its position, as with worn
/// teeth; noise of 2 mdeg.
fn worn() -> String {
    let mut chance = TestRng::new(5);
    let (mut text, mut link_deg) = (String::new(), None::<f64>);
    for (row, line) in path().lines().enumerate() {
        let fields: Vec<&str> = line.split(',').collect();
        if row == 0 {
            writeln!(text, "{},ql3_deg", fields[..7].join(",")).unwrap();
            continue;
        }
        let q_deg: f64 = fields[3].parse().unwrap();
        let half = 0.05 * (0.5 + 0.5 * (2.0 * q_deg.to_radians()).sin());
        let link = link_deg.unwrap_or(q_deg).clamp(q_deg - half, q_deg + half);
        link_deg = Some(link);
        let noise: f64 = (0..6).map(|_| chance.uniform() - 0.5).sum();
        writeln!(text, "{},{}", fields[..7].join(","), link + 2.8e-3 * noise).unwrap();
    }
    text
}

#[test]
fn play_whose_gap_follows_the_position_is_no_play() {
    let place = Place::new();
    place.file("worn.csv", &worn());
    place.file("worn.toml", "schema = \"trued.recording/1\"\nsigma = { ql3_deg = 0.002 }\n");
    let result = diagnosed(&place, "worn.csv");
    assert_eq!(result["verdict"], "unknown_structure", "{result:#}");
    let causes: Vec<&str> = result["unexplained"]["depends_on"]
        .as_array()
        .map_or_else(Vec::new, |causes| causes.iter().filter_map(Value::as_str).collect());
    assert!(causes.contains(&"q3") && causes.contains(&"direction_3"), "{result:#}");
}

/// Joint 2 alone, oscillating over ten degrees: gravity compliance and gear ratio error are nearly
/// indistinguishable there.
fn poor() -> Place {
    let place = recorded("");
    let header = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n";
    let row = |k: u32| {
        let t = 0.02 * f64::from(k);
        format!("{t},10,{},5,20,40,0,1,2,3\n", 20.0 + 5.0 * (0.9 * t).sin())
    };
    place.file("path.csv", &(header.to_owned() + &(0..ROWS).map(row).collect::<String>()));
    let effect =
        "[[effect]]\nkind = \"joint_compliance\"\njoint = 2\ncompliance_mrad_per_kNm = 4.0\n";
    place.file("truth.toml", &format!("{}\n{effect}", preset(BASE).expect("preset").text));
    see(&place, "path.csv", "seen");
    place.file("seen.toml", ABOUT);
    place
}

/// What the robot of `truth.toml` shows on a path.
fn see(place: &Place, path: &str, name: &str) {
    let simulate = ["simulate", "--model", "truth.toml", "--out", name, "--seed", "4"];
    place.succeed(&[&simulate[..], &["--overwrite", "--noise", "0.03", path]].concat());
}

#[test]
fn the_proposed_experiment_identifies_what_a_poor_motion_cannot() {
    let place = poor();
    let result = diagnosed(&place, "seen.csv");
    assert_eq!(result["verdict"], "undetermined", "{result:#}");
    assert!(result["next_experiment"].as_str().is_some_and(|next| next.contains("log-likelihood")));
    let expected = result["experiment"]["expected_separation"].as_f64().expect("a number");
    assert!(expected > 5.0, "{:#}", result["experiment"]);
    let plan = place.succeed(&["plan", "--for", "said", "--json", "plan.json"]);
    assert!(plan.out.contains("not checked"), "{}", plan.out);
    assert_eq!(place.json("plan.json")["does"], "experiment");
    see(&place, "said/experiment.csv", "carried_out");
    let both = ["seen.csv", "carried_out.csv"];
    place.succeed(
        &[&["diagnose", "--model", BASE, "--out", "then", "--seed", "1"], &both[..]].concat(),
    );
    let then = place.json("then/diagnosis.json");
    assert_eq!(then["verdict"], "missing_physics", "{then:#}");
    let finding = &then["findings"][0];
    assert_eq!((&finding["effect"], &finding["joint"]), (&"joint_compliance".into(), &2.into()));
    let known = &result["findings"][0]["alternatives"];
    for rival in finding["alternatives"].as_array().expect("a list") {
        let was = known
            .as_array()
            .expect("a list")
            .iter()
            .any(|one| one["effect"] == rival["effect"] && one["joint"] == rival["joint"]);
        let left = rival["confidence"].as_f64().expect("a number");
        assert!(!was || left < 0.01, "five in log-likelihood: {then:#}");
    }
}

#[test]
fn a_diagnosis_that_asks_for_nothing_gives_no_request() {
    let place = recorded("");
    diagnosed(&place, "seen.csv");
    for (name, why) in [("said", "asks for no experiment"), ("absent", "cannot be read")] {
        let done = place.run(&["plan", "--for", name]);
        assert_eq!(done.code, Some(2), "{name}");
        assert!(done.err.contains(why), "{name}: {}", done.err);
    }
    assert!(!place.path("said/experiment.csv").exists());
}

#[test]
fn a_number_off_by_many_times_its_doubt_is_named_and_one_within_it_is_not() {
    let offset = |mrad: f64| {
        format!("[[effect]]\nkind = \"joint_offset\"\njoint = 2\noffset_mrad = {mrad}\n")
    };
    let place = recorded(&offset(1.3));
    for (stated, verdict) in [(0.5, "missing_physics"), (1.27, "consistent")] {
        let prior = "sigma = { offset_mrad = 0.05 }\n";
        let model = format!("{}\n{}{prior}", preset(BASE).expect("preset").text, offset(stated));
        place.file("known.toml", &model);
        place.succeed(&[
            "diagnose",
            "--model",
            "known.toml",
            "--out",
            "k",
            "--seed",
            "1",
            "seen.csv",
        ]);
        let result = place.json("k/diagnosis.json");
        assert_eq!(result["verdict"], verdict, "{stated}: {result:#}");
        if verdict == "missing_physics" {
            let finding = &result["findings"][0];
            assert_eq!(
                (&finding["effect"], &finding["joint"]),
                (&"joint_offset".into(), &2.into())
            );
            let change = finding["parameters"]["offset_mrad"]["value"].as_f64().expect("a number");
            assert!((change - 0.8).abs() < 0.05, "{finding:#}");
        }
    }
}
