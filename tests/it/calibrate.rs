//! `trued calibrate`: a simulated campaign with known truth, gross faults that are reported, and no
//! output if a calibration is impossible.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::OnceLock;

use diagnosis::{Campaign, FitParameter, Reading, campaign_import, campaign_simulation};
use diagnosis_report::Error;
use diagnosis_report::calibration::{self, Settings};
use diagnosis_report::progress::ignore;
use glam::{DMat3, DVec3};
use recording::model::RobotModel;
use recording::model::presets::preset;
use recording::series::{RequiredData, read, read_text};
use serde_json::Value;
use tests::rng::TestRng;

use crate::program::Place;

const BASE: &str = "irb1600-6-145";
const POSES: usize = 60;
/// Effects of the robot that its controller does not know.
const EFFECTS: &str = "
[[effect]]
kind = \"joint_offset\"
joint = 3
offset_mrad = 1.5

[[effect]]
kind = \"axis_tilt\"
joint = 4
tilt_mrad = [0.8, -0.6]

[[effect]]
kind = \"joint_compliance\"
joint = 2
compliance_mrad_per_kNm = 4.0
";
const ABOUT: &str = "schema = \"trued.recording/1\"
kind = \"poses\"
approach = \"columns\"
sigma = { target1_x_mm = 0.02, target1_y_mm = 0.02, target1_z_mm = 0.02 }
";

/// One row: joint positions in degrees, arrivals, three reflectors in mm.
type Row = ([f64; 6], [f64; 6], [DVec3; 3]);

fn csv(rows: &[Row]) -> String {
    let mut text = String::from("t_s");
    (1..=6).for_each(|joint| write!(text, ",q{joint}_deg").unwrap());
    (1..=6).for_each(|joint| write!(text, ",d{joint}").unwrap());
    for target in 1..=3 {
        ["x", "y", "z"].iter().for_each(|axis| write!(text, ",target{target}_{axis}_mm").unwrap());
    }
    for (t_s, (q, d, points)) in rows.iter().enumerate() {
        write!(text, "\n{t_s}").unwrap();
        q.iter().chain(d).for_each(|number| write!(text, ",{number}").unwrap());
        points.iter().flat_map(DVec3::to_array).for_each(|mm| write!(text, ",{mm:.5}").unwrap());
    }
    text + "\n"
}

fn unseen(poses: usize) -> Vec<Row> {
    let mut chance = TestRng::new(3);
    let mut row = || {
        let q = [70.0, 35.0, 35.0, 90.0, 70.0, 120.0]
            .map(|swing| swing * (2.0 * chance.uniform() - 1.0));
        let d = [0.0; 6].map(|_: f64| if chance.uniform() < 0.5 { 1.0 } else { -1.0 });
        (q, d, [DVec3::ZERO; 3])
    };
    (0..poses).map(|_| row()).collect()
}

/// The robot with its effects, measured once for all tests.
fn measured() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| seen_of(&format!("{}{EFFECTS}", preset(BASE).expect("preset").text)))
}

/// What a tracker would have seen of the robot in this model file.
fn seen_of(text: &str) -> Vec<Row> {
    seen_at(text, POSES, |_| ())
}

/// The same for a number of poses, with changed joint positions (degrees).
fn seen_at(text: &str, poses: usize, change: impl Fn(&mut [f64; 6])) -> Vec<Row> {
    let truth = RobotModel::parse("truth", text).expect("sound").physics;
    let mut rows = unseen(poses);
    rows.iter_mut().for_each(|row| change(&mut row.0));
    let recording = read_text("made.csv", &csv(&rows), None, None, RequiredData::Measurement);
    let mut campaign =
        campaign_import::campaign(&truth.arm, &[recording.expect("read")]).expect("a campaign");
    let station = &mut campaign.surroundings.frames[0].value.measuring_from_base;
    station.rotation = DMat3::from_rotation_z(2.0) * DMat3::from_rotation_x(0.02);
    station.origin = DVec3::new(1.5, -2.0, 0.3);
    let places = [[0.09, 0.0, 0.06], [-0.05, 0.08, 0.05], [-0.04, -0.09, 0.1]];
    for (target, place) in campaign.surroundings.targets.iter_mut().zip(places) {
        *target = FitParameter::known(DVec3::from_array(place));
    }
    let whole: Campaign = campaign.clone();
    let made =
        campaign_simulation::simulate_readings(&campaign, &truth, &whole.surroundings, 0.4, 11);
    for (row, pose) in rows.iter_mut().zip(&made.poses) {
        for (slot, observation) in row.2.iter_mut().zip(&pose.seen) {
            if let Reading::Point { at, .. } = observation.reading {
                *slot = at * 1e3;
            }
        }
    }
    rows
}

fn place_with(rows: &[Row]) -> Place {
    let place = Place::new();
    place.file("seen.csv", &csv(rows));
    place.file("seen.toml", ABOUT);
    place
}

const CALIBRATE: [&str; 8] =
    ["calibrate", "--model", BASE, "--seed", "7", "--out", "robot2.toml", "seen.csv"];

fn calibrate(place: &Place, more: &[&str]) -> Value {
    place.succeed(&[&CALIBRATE[..], &["--json", "c.json"], more].concat());
    place.json("c.json")
}

fn number(of: &Value, keys: &[&str]) -> f64 {
    keys.iter().fold(of, |of, key| &of[*key]).as_f64().expect("a number under these keys")
}

fn parameter<'v>(found: &'v Value, effect: &str, joint: u8) -> &'v Value {
    let list = found["parameters"].as_array().expect("parameters");
    let is = |p: &&Value| p["effect"] == effect && p["joint"] == joint;
    list.iter().find(is).expect("the effect among the parameters")
}

#[test]
fn the_effects_of_a_simulated_robot_are_found_and_its_model_loads_and_corrects() {
    let place = place_with(measured());
    let found = calibrate(&place, &["--report", "c.html"]);
    assert_eq!((&found["schema"], &found["unit"]), (&"trued.calibrate/1".into(), &"mm".into()));
    let [nominal, calibrated, advanced] = ["nominal", "calibrated", "advanced"]
        .map(|model| number(&found, &["heldout", model, "mean"]));
    assert!(advanced < 0.5 * calibrated && calibrated < nominal, "{:#}", found["heldout"]);
    // Three reflectors with 0.02 mm per axis: 0.032 mm in the mean, plus the uncertainty from sixty
    // poses.
    assert!(advanced < 0.045, "{:#}", found["heldout"]);
    for key in ["p95", "max", "median"] {
        assert!(number(&found, &["heldout", "advanced", key]) > 0.0);
    }
    let soft = parameter(&found, "joint_compliance", 2);
    assert_eq!(soft["parameter"], "compliance_mrad_per_kNm");
    let (value, sigma) = (number(soft, &["value"]), number(soft, &["sigma"]));
    assert!((value - 4.0).abs() < 4.0 * sigma && sigma < 0.4, "{soft:#}");
    // Frame and reflectors are unknown: a zero moves together with the axes behind it, and with these.
    let offset = parameter(&found, "joint_offset", 3);
    assert!(offset["identifiable"] == false && offset["sigma"].is_null(), "{offset:#}");
    assert_eq!(found["residuals"][0]["factor"], 1.0, "{:#}", found["residuals"]);
    let [fitted, determined] =
        ["fitted", "determined"].map(|k| number(&found["conditioning"], &[k]));
    assert!(
        determined < fitted && number(&found, &["conditioning", "condition"]) > 1.0,
        "{found:#}"
    );
    assert!(found["parameters"].as_array().unwrap().iter().all(|p| p["identifiable"].is_boolean()));
    assert!(found["outliers"].is_array() && found["seed"] == 7, "{found:#}");
    place.succeed(&["check", "robot2.toml"]);
    let text = place.read("robot2.toml");
    assert!(text.contains("offset_mrad") && text.contains("sigma = {"), "{text}");
    assert!(text.contains("\"calibrated_from\" = \"seen.csv, 60 poses"), "{text}");
    place.succeed(&["correct", "--model", "robot2.toml", "--out", "corrected.csv", "seen.csv"]);
    let page = place.read("c.html");
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    roxmltree::Document::parse_with_options(&page, options).expect("a sound page");
    assert!(page.contains("Not identifiable from these data") && page.contains("rising"), "{page}");
}

#[test]
fn the_library_gives_the_model_and_the_result_that_the_command_writes() {
    let place = place_with(measured());
    let arguments = [&CALIBRATE[..], &["--json", "c.json"]].concat();
    let text = place.succeed(&arguments).out;
    let model = preset(BASE).expect("preset").model().expect("sound");
    let mut recording =
        read(&place.path("seen.csv"), None, RequiredData::Measurement).expect("a recording");
    // The command is run in the folder: its result names the file without it.
    recording.file = "seen.csv".into();
    let settings = Settings { seed: 7, ..Settings::default() };
    let calibrated = calibration::calibrate(model, &[recording], &settings, &ignore);
    let calibrated = calibrated.expect("a calibration");
    assert!(calibrated.is_validated(), "{:?}", calibrated.rejection_reasons);
    assert_eq!(calibrated.model_toml().expect("a model"), place.read("robot2.toml"));
    let out = Path::new("robot2.toml");
    let json: Value = serde_json::from_str(&calibrated.json(Some(out)).expect("json")).unwrap();
    assert_eq!(json, place.json("c.json"));
    assert!(text.starts_with(&calibrated.text(Some(out), None)), "{text}");
    let unwritten = calibrated.page(None).render();
    assert!(unwritten.contains("Validation") && !unwritten.contains("robot2.toml"));
}

#[test]
fn recordings_that_do_not_belong_to_the_model_are_refused_by_the_library_with_the_fault() {
    let mut rows = measured().to_vec();
    rows.iter_mut().for_each(|row| row.2.iter_mut().for_each(|point| point.x = -point.x));
    let place = place_with(&rows);
    let model = preset(BASE).expect("preset").model().expect("sound");
    let recording =
        read(&place.path("seen.csv"), None, RequiredData::Measurement).expect("a recording");
    let refused = calibration::calibrate(model, &[recording], &Settings::default(), &ignore);
    let Err(Error::GrossFaults(faults)) = refused else { panic!("a mirrored frame is a fault") };
    assert!(faults[0].message.contains("mirrored"), "{faults:?}");
}

#[test]
fn text_json_and_page_of_a_calibration_tell_the_same_numbers() {
    let place = place_with(measured());
    let arguments = [&CALIBRATE[..], &["--json", "c.json", "--report", "c.html"]].concat();
    let text = place.succeed(&arguments).out;
    let (found, page) = (place.json("c.json"), place.read("c.html"));
    for model in ["nominal", "calibrated", "advanced"] {
        let of = |key: &str| number(&found, &["heldout", model, key]);
        let line = text.lines().find(|line| line.starts_with(model)).expect("a line of the model");
        let numbers: Vec<&str> = line.split_whitespace().skip(1).collect();
        let wanted = ["mean", "median", "p95", "max"].map(|key| report::fixed(of(key), 3));
        assert_eq!(numbers, wanted, "{line}");
        let mean = report::significant(of("mean"), 3);
        let tile = format!("<dt>Mean error, {model}</dt><dd class=\"value\">{mean}<");
        assert!(page.contains(&tile), "{tile}");
        let within = report::significant(of("p95"), 3);
        assert!(page.contains(&format!("95 % within {within} mm")), "{within}");
    }
    assert!(text.trim_end().ends_with("page: c.html"), "{text}");
}

#[test]
fn a_tolerance_that_held_out_errors_exceed_is_reported_and_ends_with_1() {
    for (tolerance_mm, code, part) in
        [("0.2", 0, "tolerance 0.200 mm met"), ("0.01", 1, "tolerance 0.0100 mm not met")]
    {
        let place = place_with(measured());
        let options = ["--json", "c.json", "--tolerance-mm", tolerance_mm];
        let ran = place.run(&[&CALIBRATE[..], &options].concat());
        assert_eq!(ran.code, Some(code), "{ran:?}");
        assert!(ran.out.contains(part), "{}", ran.out);
        let found = place.json("c.json");
        assert_eq!(found["tolerance"]["met"], code == 0);
        let within_mm = number(&found, &["tolerance", "p95_mm"]);
        assert!(within_mm > 0.01 && within_mm < 0.2, "{within_mm}");
        place.succeed(&["check", "robot2.toml"]);
    }
    let place = place_with(measured());
    for no_length in ["0", "-1", "nan", "wide"] {
        let refused = place.run(&[&CALIBRATE[..], &["--tolerance-mm", no_length]].concat());
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(refused.err.contains("invalid value"), "{}", refused.err);
    }
}

#[test]
fn a_shift_of_a_slanted_axis_is_found_across_it() {
    let base = preset(BASE).expect("preset").text;
    let straight = base.split("name = \"4\"").nth(1).expect("joint 4");
    let slanted = straight.replacen("[1.0, 0.0, 0.0]", "[0.8, 0.0, 0.6]", 1);
    let base = base.replace(straight, &slanted);
    let shifted = "\n[[effect]]\nkind = \"axis_shift\"\njoint = 4\nshift_mm = [-0.3, 0.2, 0.4]\n";
    let place = place_with(&seen_of(&format!("{base}{shifted}")));
    place.file("slanted.toml", &base);
    let out = ["--model", "slanted.toml", "--out", "s2.toml", "--json", "s.json", "--seed", "7"];
    place.succeed(&[&["calibrate"], &out[..], &["seen.csv"]].concat());
    place.succeed(&["check", "s2.toml"]);
    let found = place.json("s.json");
    let is_shift = |p: &&Value| p["effect"] == "axis_shift" && p["joint"] == 4;
    let list = found["parameters"].as_array().expect("parameters").iter().filter(is_shift);
    let shift: Vec<f64> = list.map(|p| number(p, &["value"])).collect();
    assert_eq!(shift.len(), 3);
    assert!((0.8 * shift[0] + 0.6 * shift[2]).abs() < 1e-9, "{shift:?}");
    assert!(shift.iter().any(|x| x.abs() > 0.1), "{shift:?}");
    assert!(number(&found, &["heldout", "advanced", "mean"]) < 0.045, "{:#}", found["heldout"]);
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_a_calibrated_model_can_be_calibrated_again() {
    let (one, two) = (place_with(measured()), place_with(measured()));
    let found = [&one, &two].map(|place| calibrate(place, &[]));
    assert_eq!(found[0], found[1]);
    assert_eq!(one.read("robot2.toml"), two.read("robot2.toml"));
    // The held-out poses were used for the initial model.
    let again = ["calibrate", "--accept-worse", "--model", "robot2.toml", "--out", "robot3.toml"];
    one.succeed(&[&again[..], &["seen.csv"]].concat());
    let again = one.read("robot3.toml");
    let count = |text: &str| text.matches("[[effect]]").count();
    assert!(count(&again) <= count(&one.read("robot2.toml")) + 2, "{again}");
}

#[test]
fn another_seed_of_the_split_gives_the_same_model() {
    let place = place_with(measured());
    let model = |seed: &str| {
        let out = format!("robot{seed}.toml");
        place.succeed(&["calibrate", "--model", BASE, "--seed", seed, "--out", &out, "seen.csv"]);
        let text = place.read(&out);
        text.split_once("[[effect]]").expect("effects").1.to_owned()
    };
    assert_eq!(model("1"), model("2"));
}

#[test]
fn residuals_beyond_the_stated_noise_are_reported_with_their_factor() {
    let place = place_with(measured());
    place.file("seen.toml", &ABOUT.replace("= 0.02", "= 0.005"));
    let found = calibrate(&place, &[]);
    // The noise is 0.02 mm.
    let factor = number(&found["residuals"][0], &["factor"]);
    assert!((3.0..5.0).contains(&factor), "{:#}", found["residuals"]);
    let warnings = found["warnings"].to_string();
    assert!(warnings.contains("times as large as the stated noise"), "{warnings}");
}

/// Warnings and mean held-out error, mm, of a calibration by the measured rows with their points displaced by `moved_mm` of row, target and rotation of the tool
/// in the measuring frame.
fn calibrated_if_moved(moved_mm: impl Fn(usize, usize, DMat3) -> DVec3) -> (String, f64) {
    let arm = preset(BASE).expect("preset").model().expect("sound").physics.arm;
    let station = DMat3::from_rotation_z(2.0) * DMat3::from_rotation_x(0.02);
    let mut rows = measured().to_vec();
    for (row, (q_deg, _, points)) in rows.iter_mut().enumerate() {
        let mut q = physics::Joints::default();
        q.iter_mut().zip(q_deg.iter()).for_each(|(q, deg)| *q = deg.to_radians());
        let tool = station * physics::Chain::nominal(&arm, &q).base_from_tool.rotation;
        for (target, point) in points.iter_mut().enumerate() {
            *point += moved_mm(row, target, tool);
        }
    }
    let found = calibrate(&place_with(&rows), &[]);
    (found["warnings"].to_string(), number(&found, &["heldout", "advanced", "mean"]))
}

#[test]
fn a_target_that_slipped_and_an_instrument_that_drifts_are_named() {
    let (slipped, drifts) = ("moved on the tool between 29", "measuring frame moves");
    let (warnings, sound_mm) = calibrated_if_moved(|_, _, _| DVec3::ZERO);
    assert!(!warnings.contains("moved on the tool") && !warnings.contains(drifts), "{warnings}");
    let slip_mm = DVec3::new(0.4, -0.3, 0.2);
    let (warnings, error_mm) = calibrated_if_moved(|row, target, tool| match (row, target) {
        (30.., 1) => tool * slip_mm,
        _ => DVec3::ZERO,
    });
    assert!(warnings.contains(slipped) && !warnings.contains(drifts), "{warnings}");
    // The model is as good as without the slip.
    assert!(error_mm < 1.3 * sound_mm, "{error_mm} instead of {sound_mm}");
    let drift_mm = DVec3::new(0.3, -0.2, 0.1);
    let (warnings, _) = calibrated_if_moved(|row, _, _| drift_mm * (row as f64 / POSES as f64));
    assert!(warnings.contains(drifts) && !warnings.contains("moved on the tool"), "{warnings}");
}

#[test]
fn what_no_reading_shows_is_named_and_warned_of_and_no_failure() {
    let place = place_with(measured());
    let found = calibrate(&place, &[]);
    // The reflectors turn with joint 6: its zero and their places are one.
    let zero = parameter(&found, "joint_offset", 6);
    assert!(zero["identifiable"] == false && zero["sigma"].is_null(), "{zero:#}");
    let has_statement = |key: &str, part: &str| {
        let list = found[key].as_array().expect(key);
        list.iter().any(|statement| statement.as_str().expect(key).contains(part))
    };
    assert!(has_statement("undetermined", "joint 6's offset"), "{:#}", found["undetermined"]);
    assert!(has_statement("warnings", "cannot be determined"), "{:#}", found["warnings"]);
}

#[test]
fn poses_that_a_recording_keeps_for_validation_are_the_held_out_ones() {
    let place = place_with(measured());
    // Both were measured from one station: otherwise the station of the held-out ones would be
    // undetermined.
    let stationed = |rows: &[Row]| {
        let rows = csv(rows);
        let lines = rows.lines().enumerate();
        let with = |(k, line)| format!("{line},{}\n", if k == 0 { "station" } else { "1" });
        lines.map(with).collect::<String>()
    };
    place.file("kept.csv", &stationed(&measured()[..15]));
    place.file("kept.toml", &format!("{ABOUT}heldout = \"all\"\n"));
    place.file("seen.csv", &stationed(&measured()[15..]));
    let found = calibrate(&place, &["kept.csv"]);
    assert_eq!(found["poses"]["heldout"], 15);
    assert_eq!((&found["poses"]["written_model"], &found["seed"]), (&45.into(), &Value::Null));
    assert!(
        found["heldout"]["advanced"]["mean"].as_f64().is_some_and(|mean| mean < 0.2),
        "{found:#}"
    );
}

#[test]
fn gross_faults_are_reported_with_a_remedy_and_nothing_is_written() {
    let refused = |change: &dyn Fn(&mut Row), part: &str| {
        let mut rows = measured().to_vec();
        rows.iter_mut().for_each(change);
        let place = place_with(&rows);
        let before = place.names();
        let done = place.run(&[&CALIBRATE[..], &["--report", "c.html"]].concat());
        assert_eq!(done.code, Some(1), "{done:#?}");
        assert!(done.out.contains(part), "{part:?} in\n{}", done.out);
        assert_eq!(place.names(), before);
    };
    refused(&|row| row.2.iter_mut().for_each(|point| point.x = -point.x), "mirrored");
    refused(&|row| row.0.swap(1, 2), "columns of joints 2 and 3 are swapped");
    refused(&|row| row.0[3] = -row.0[3], "joint 4 has the opposite sign");
    refused(&|row| row.2.iter_mut().for_each(|point| *point *= 1e-3), "factor of 1000 too small");
    refused(&|row| row.0 = row.0.map(f64::to_radians), "in radians, but degrees are stated");
    let swapped = |point: &mut DVec3| *point = DVec3::new(point.y, point.x, point.z);
    refused(
        &|row| swapped(&mut row.2[1]),
        "only target 2 has a gross error: its columns x and y are swapped",
    );
    // There is no remedy for noise of a decimetre, nor for rows of something else.
    refused(
        &|row| row.2[0] += 100.0 * DVec3::new(row.0[0].sin(), row.0[1].sin(), row.0[2].sin()),
        "target 1 was measured",
    );
}

#[test]
fn a_model_that_its_own_proof_calls_worse_is_not_written_unless_it_is_asked_for() {
    // The robot equals the model: a geometry fitted to few poses can only be worse.
    let rows = seen_at(preset(BASE).expect("preset").text, 12, |_| ());
    let place = place_with(&rows);
    let arguments = [&CALIBRATE[..], &["--json", "c.json", "--report", "c.html"]].concat();
    let done = place.run(&arguments);
    assert_eq!(done.code, Some(1), "{done:#?}");
    assert!(
        done.out.contains("no model was written") && done.out.contains("not validated"),
        "{done:#?}"
    );
    assert_eq!(place.names(), ["c.html", "c.json", "seen.csv", "seen.toml"]);
    let found = place.json("c.json");
    let mean = |model: &str| number(&found, &["heldout", model, "mean"]);
    assert!(mean("advanced") > mean("nominal") && found["out"].is_null(), "{found:#}");
    assert!(found["refused"].to_string().contains("held-out poses"), "{found:#}");
    let done = place.succeed(&[&arguments[..], &["--accept-worse"]].concat());
    assert!(done.out.contains("not validated"), "{done:#?}");
    place.succeed(&["check", "robot2.toml"]);
}

#[test]
fn degrees_under_the_name_of_radians_and_a_wrong_tool_are_reported() {
    let place = place_with(measured());
    place.file("seen.csv", &csv(measured()).replace("_deg", "_rad"));
    let done = place.run(&CALIBRATE);
    let output = format!("{}{}", done.out, done.err);
    assert!(matches!(done.code, Some(1 | 2)) && output.contains("degrees"), "{done:#?}");
    // A reflector with known position, and a model with another tool position.
    let place = place_with(measured());
    let tcp =
        preset(BASE).expect("preset").text.replacen("tcp_mm = [815.0,", "tcp_mm = [845.0,", 1);
    place.file("longer.toml", &tcp);
    let known = "target1_mm = [90.0, 0.0, 60.0]\ntarget2_mm = [-50.0, 80.0, 50.0]\ntarget3_mm = [-40.0, -90.0, 100.0]\n";
    place.file("seen.toml", &format!("{ABOUT}{known}"));
    let run = ["calibrate", "--model", "longer.toml", "--out", "m.toml", "seen.csv"];
    let done = place.run(&run);
    assert!(done.code == Some(1) && done.out.contains("tool"), "{done:#?}");
}

#[test]
fn two_hundred_poses_with_a_joint_that_never_moves_give_a_model_and_say_what_stays_open() {
    let truth = format!("{}{EFFECTS}", preset(BASE).expect("preset").text);
    let rows = seen_at(&truth, 200, |q| q[5] = 10.0);
    let place = place_with(&rows);
    let done = place.run(&[&CALIBRATE[..], &["--json", "c.json"]].concat());
    assert_eq!(done.code, Some(0), "{done:#?}");
    assert!(done.err.contains("cannot be determined"), "a warning: {}", done.err);
    let open = done.out.lines().filter(|line| line.starts_with("open")).collect::<Vec<_>>();
    assert!(
        open.len() <= 5 && open.iter().any(|line| line.contains("joint 6's joint offset")),
        "{open:#?}"
    );
    let found = place.json("c.json");
    let zero = parameter(&found, "joint_offset", 6);
    assert!(zero["identifiable"] == false && number(zero, &["value"]).abs() < 1e-3, "{zero:#}");
    let list = |key: &str| found[key].as_array().expect(key).len();
    assert!(list("left_open") <= 5 && list("undetermined") > list("left_open"), "{found:#}");
    assert!(number(&found, &["heldout", "advanced", "mean"]) < 0.045, "{:#}", found["heldout"]);
    let counts = found["histogram"]["counts"]["advanced"].as_array().expect("counts");
    let points: u64 = counts.iter().filter_map(Value::as_u64).sum();
    assert_eq!(Some(points), found["heldout"]["advanced"]["points"].as_u64());
    assert_eq!(found["by_recording"][0]["moves"], "spatial");
    let arrived = &found["approach"][1]["rising"];
    for (model, key) in [("nominal", "median"), ("calibrated", "p95"), ("advanced", "mean")] {
        assert!(number(arrived, &[model, key]) > 0.0, "{arrived:#}");
    }
    place.succeed(&["check", "robot2.toml"]);
}

#[test]
fn what_cannot_be_read_or_would_be_written_over_is_refused() {
    let place = place_with(measured());
    let refused = |arguments: &[&str], part: &str| {
        let before = place.names();
        let done = place.run(&[&["calibrate"], arguments].concat());
        assert_eq!(done.code, Some(2), "{done:#?}");
        assert!(done.err.contains(part), "{part:?} in\n{}", done.err);
        assert_eq!(place.names(), before);
    };
    place.file("robot.toml", preset(BASE).expect("preset").text);
    place.file("few.csv", &csv(&measured()[..5]));
    refused(&["--model", BASE, "--out", "m.toml", "absent.csv"], "absent.csv");
    refused(&["--model", "absent", "--out", "m.toml", "seen.csv"], "neither a model file");
    refused(&["--model", "fr3", "--out", "m.toml", "seen.csv"], "joint");
    refused(
        &["--model", "robot.toml", "--out", "robot.toml", "seen.csv"],
        "overwrite an input file",
    );
    refused(&["--model", BASE, "--out", "m.toml", "few.csv"], "measure more poses");
    refused(&["--model", BASE, "--out", "no/folder/m.toml", "seen.csv"], "no/folder");
}
