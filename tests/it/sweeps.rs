//! `trued calibrate` on sweeps of single joints and on loaded poses: their direct results are the
//! truth of the simulated robot.

use std::fmt::Write as _;

use diagnosis::{FitParameter, Reading, campaign_import, campaign_simulation};
use glam::{DMat3, DVec3};
use recording::model::RobotModel;
use recording::model::presets::preset;
use recording::series::{RequiredData, read_text};
use serde_json::Value;
use tests::rng::TestRng;

use crate::program::Place;

const BASE: &str = "irb1600-6-145";
const EFFECTS: &str = "
[[effect]]
kind = \"axis_tilt\"
joint = 4
tilt_mrad = [0.8, -0.6]

[[effect]]
kind = \"joint_compliance\"
joint = 2
compliance_mrad_per_kNm = 4.0

[[effect]]
kind = \"joint_compliance\"
joint = 3
compliance_mrad_per_kNm = 8.0

[[effect]]
kind = \"backlash\"
joint = 5
width_mrad = 0.4
";
const ABOUT: &str = "schema = \"trued.recording/1\"
kind = \"poses\"
approach = \"sequence\"
wrench_frame = \"base\"
sigma = { target1_x_mm = 0.01, target1_y_mm = 0.01, target1_z_mm = 0.01 }
";

/// Where targets on the base, on the base, and on joint 2's link are at the zero position, m.
const ON_LINKS: [(usize, [f64; 3]); 3] =
    [(0, [0.2, 0.1, 0.1]), (0, [-0.2, 0.1, 0.1]), (2, [0.15, 0.2, 1.0])];

/// Joint positions, degrees, and the force on the tool, N.
type Row = ([f64; 6], [f64; 3]);

fn csv(rows: &[Row], points: &[[DVec3; 3]]) -> String {
    let mut text = String::from("t_s");
    (1..=6).for_each(|joint| write!(text, ",q{joint}_deg").unwrap());
    text += ",fx_N,fy_N,fz_N";
    for target in 1..=3 {
        ["x", "y", "z"].iter().for_each(|axis| write!(text, ",target{target}_{axis}_mm").unwrap());
    }
    for (t_s, ((q, force), points)) in rows.iter().zip(points).enumerate() {
        write!(text, "\n{t_s}").unwrap();
        q.iter().chain(force).for_each(|number| write!(text, ",{number}").unwrap());
        points.iter().flat_map(DVec3::to_array).for_each(|mm| write!(text, ",{mm:.5}").unwrap());
    }
    text + "\n"
}

/// What a tracker sees of the robot in these rows.
fn tracked(rows: &[Row]) -> Vec<[DVec3; 3]> {
    let text = format!("{}{EFFECTS}", preset(BASE).expect("preset").text);
    let truth = RobotModel::parse("truth", &text).expect("sound").physics;
    let about = recording::series::RecordingMetadata::parse("a.toml", ABOUT).expect("sound");
    let mut points = vec![[DVec3::ZERO; 3]; rows.len()];
    let table = csv(rows, &points);
    let recording =
        read_text("a.csv", &table, None, Some(about), RequiredData::Measurement).expect("read");
    let mut campaign = campaign_import::campaign(&truth.arm, &[recording]).expect("a campaign");
    let station = &mut campaign.surroundings.frames[0].value.measuring_from_base;
    station.rotation = DMat3::from_rotation_z(2.0) * DMat3::from_rotation_x(0.02);
    station.origin = DVec3::new(1.5, -2.0, 0.3);
    let places = [[0.15, 0.0, 0.06], [-0.08, 0.12, 0.05], [-0.07, -0.13, 0.1]];
    for (target, place) in campaign.surroundings.targets.iter_mut().zip(places) {
        *target = FitParameter::known(DVec3::from_array(place));
    }
    let around = campaign.surroundings.clone();
    let made = campaign_simulation::simulate_readings(&campaign, &truth, &around, 1.0, 11);
    for (slots, pose) in points.iter_mut().zip(&made.poses) {
        for (slot, observation) in slots.iter_mut().zip(&pose.seen) {
            if let Reading::Point { at, .. } = observation.reading {
                *slot = at * 1e3;
            }
        }
    }
    points
}

/// Each joint alone, there and back, from the position of the others.
fn sweeps() -> Vec<Row> {
    let home = [10.0, -15.0, 20.0, 5.0, 40.0, 0.0];
    let steps = |joint: usize| {
        let there_and_back = (-6..=6).chain((-6..6).rev());
        there_and_back.map(move |k| {
            let mut q = home;
            q[joint] += 6.0 * f64::from(k);
            (q, [0.0; 3])
        })
    };
    (0..6).flat_map(steps).collect()
}

/// Random poses, each without and then with a force.
fn loaded() -> Vec<Row> {
    let mut chance = TestRng::new(3);
    let mut pair = || {
        let q = [70.0, 35.0, 35.0, 90.0, 70.0, 120.0]
            .map(|swing| swing * (2.0 * chance.uniform() - 1.0));
        let force = [0; 3].map(|_| 500.0 * (2.0 * chance.uniform() - 1.0));
        [(q, [0.0; 3]), (q, force)]
    };
    (0..40).flat_map(|_| pair()).collect()
}

fn place() -> Place {
    let place = Place::new();
    for (name, rows) in [("sweeps", sweeps()), ("loaded", loaded())] {
        place.file(&format!("{name}.csv"), &csv(&rows, &tracked(&rows)));
        place.file(&format!("{name}.toml"), ABOUT);
    }
    place
}

fn calibrated(place: &Place, more: &[&str]) -> Value {
    let command =
        ["calibrate", "--overwrite", "--model", BASE, "--seed", "7", "--out", "robot2.toml"];
    let files = ["--json", "c.json", "--report", "c.html", "sweeps.csv", "loaded.csv"];
    place.succeed(&[&command[..], more, &files].concat());
    place.json("c.json")
}

fn number(of: &Value) -> f64 {
    of.as_f64().expect("a number")
}

#[test]
fn sweeps_and_loads_identify_the_robots_effects() {
    let place = place();
    let found = calibrated(&place, &[]);
    let swept = found["single_joint"].as_array().expect("sweeps");
    let joints: Vec<u64> = swept.iter().map(|s| s["joint"].as_u64().unwrap()).collect();
    assert_eq!(joints, [1, 2, 3, 4, 5, 6]);
    let fourth = &swept[3];
    for (k, truth) in [0.8, -0.6].into_iter().enumerate() {
        let (tilt, sigma) =
            (number(&fourth["tilt_mrad"][k]), number(&fourth["sigma_tilt_mrad"][k]));
        // The common frame is that of the whole fit, which has an error.
        assert!((tilt - truth).abs() < 4.0 * sigma + 0.03, "{tilt} ± {sigma}: {truth}");
    }
    // Noise that the circles leave is the tracker's.
    assert!((number(&fourth["noise_um"]) - 10.0).abs() < 3.0, "{fourth:#}");
    assert!(number(&swept[2]["sag"]["moved_points_um"]) > 5.0, "{:#}", swept[2]["sag"]);
    let fifth = swept[4]["steps"].as_array().unwrap();
    let lost: Vec<f64> = fifth.iter().filter_map(|s| s["half_lost_motion_mrad"].as_f64()).collect();
    let mean = 2.0 * lost.iter().sum::<f64>() / lost.len() as f64;
    assert!(lost.len() >= 10 && (mean - 0.4).abs() < 0.1, "{mean} from {lost:?}");
    let axes = found["axes"].as_array().expect("axes");
    assert_eq!(axes.len(), 5);
    assert!((number(&axes[1]["distance_mm"]) - 700.0).abs() < 0.5, "{:#}", axes[1]);
    let stiffness = &found["stiffness"];
    assert_eq!(stiffness["pairs"], 40);
    for (joint, truth) in [(2, 4.0), (3, 8.0)] {
        let list = stiffness["joints"].as_array().unwrap();
        let one = list.iter().find(|j| j["joint"] == joint).expect("a joint");
        let (value, sigma) = (number(&one["compliance_mrad_per_knm"]), number(&one["sigma"]));
        assert!((value - truth).abs() < 4.0 * sigma && sigma < 0.2, "{value} ± {sigma}: {truth}");
    }
    let load = &stiffness["by_load_um"];
    assert!(number(&load["deflection_max"]) > 300.0 * number(&load["enhanced_max"]), "{load:#}");
    assert!(!load["negligible_rows"].as_array().unwrap().is_empty(), "{load:#}");
    assert!(number(&found["heldout"]["advanced"]["mean"]) < 0.02, "{:#}", found["heldout"]);
    let page = place.read("c.html");
    assert!(page.contains("joint 4 alone") && page.contains("K_c"), "{page}");
}

#[test]
fn the_sag_of_the_others_may_stay_in_and_that_is_reported() {
    let place = place();
    let [on, off] = [["--sag", "on"], ["--sag", "off"]].map(|sag| calibrated(&place, &sag));
    let third = |found: &Value| found["single_joint"][2].clone();
    let (on, off) = (third(&on), third(&off));
    assert_eq!((&on["sag"]["taken_out"], &off["sag"]["taken_out"]), (&true.into(), &false.into()));
    assert!(number(&off["sag"]["moved_points_um"]).abs() < 1e-9, "{off:#}");
    assert_ne!(on["shift_um"], off["shift_um"]);
}

/// Loaded poses with targets on the base and on a link: the columns of targets 4 to 6.
fn with_links() -> String {
    let rows = loaded();
    let text = format!("{}{EFFECTS}", preset(BASE).expect("preset").text);
    let truth = RobotModel::parse("truth", &text).expect("sound").physics;
    let table = csv(&rows, &tracked(&rows));
    let station = DMat3::from_rotation_z(2.0) * DMat3::from_rotation_x(0.02);
    let mut chance = TestRng::new(5);
    let mut lines = table.lines();
    let mut head = lines.next().expect("a head").to_owned();
    for target in 4..=6 {
        ["x", "y", "z"].iter().for_each(|axis| write!(head, ",target{target}_{axis}_mm").unwrap());
    }
    for (line, (q, force)) in lines.zip(&rows) {
        let mut inputs = physics::Inputs::at_rest([0.0; physics::JOINTS_MAX]);
        inputs.q.iter_mut().zip(q).for_each(|(slot, q)| *slot = q.to_radians());
        inputs.wrench_base.force = DVec3::from_array(*force);
        let real = truth.evaluate(&inputs, &physics::Memories::default()).real;
        write!(head, "\n{line}").unwrap();
        for (link, point) in ON_LINKS {
            let point = DVec3::from_array(point);
            let base =
                link.checked_sub(1).map_or(point, |joint: usize| real.body(joint).point(point));
            let measured = station * base + DVec3::new(1.5, -2.0, 0.3);
            for x in measured.to_array() {
                write!(head, ",{:.5}", x * 1e3 + 0.002 * (chance.uniform() - 0.5)).unwrap();
            }
        }
    }
    head + "\n"
}

#[test]
fn targets_on_links_identify_the_stiffness_of_one_joint_and_the_tilt_of_the_base() {
    let place = Place::new();
    place.file("links.csv", &with_links());
    let on = "target4_on_link = 0\ntarget5_on_link = 0\ntarget6_on_link = 2\n";
    place.file("links.toml", &format!("{ABOUT}{on}"));
    let files = ["--json", "c.json", "--seed", "7", "--out", "robot2.toml", "links.csv"];
    place.succeed(&[&["calibrate", "--model", BASE][..], &files].concat());
    let found = place.json("c.json");
    let list = found["stiffness"]["one_by_one"].as_array().expect("joints");
    let second = list.iter().find(|j| j["joint"] == 2).expect("joint 2");
    let (value, sigma) = (number(&second["compliance_mrad_per_knm"]), number(&second["sigma"]));
    assert!((value - 4.0).abs() < 4.0 * sigma && sigma < 0.2, "{value} ± {sigma}");
    // The base is at rest: any tilt is noise.
    let tilt = &found["base_tilt"];
    let turn: f64 = (0..3).map(|k| number(&tilt["turn_mrad"][k]).powi(2)).sum::<f64>().sqrt();
    assert!(turn < 5.0 * number(&tilt["sigma_mrad"]) && tilt["poses"] == 79, "{tilt:#}");
    // Targets on links are no targets of the tool.
    assert!(number(&found["heldout"]["advanced"]["mean"]) < 0.03, "{:#}", found["heldout"]);
    place.file("links.toml", &format!("{ABOUT}target4_on_link = 6\n"));
    let done = place.run(&["calibrate", "--model", BASE, "--out", "m.toml", "links.csv"]);
    assert!(done.code == Some(2) && done.err.contains("target4_on_link"), "{done:#?}");
}
