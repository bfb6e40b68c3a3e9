//! `trued calibrate` without a tracker: a ballbar, three balls, a plate; the truth of each
//! simulated robot is found.

use std::fmt::Write as _;

use glam::{DMat3, DVec3};
use physics::{Inputs, JOINTS_MAX, Memories, Model};
use recording::model::RobotModel;
use recording::model::presets::preset;
use serde_json::Value;
use tests::rng::TestRng;

use crate::program::Place;

const BASE: &str = "irb1600-6-145";
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
/// Standard deviation of a length, m.
const NOISE_M: f64 = 5e-6;
const PROBE_M: f64 = 3e-3;
const BALL_M: f64 = 12.7e-3;

type Joints = [f64; JOINTS_MAX];

fn truth() -> Model {
    let text = format!("{}{EFFECTS}", preset(BASE).expect("preset").text);
    RobotModel::parse("truth", &text).expect("sound").physics
}

fn tip(truth: &Model, q: &Joints) -> DVec3 {
    truth.evaluate(&Inputs::at_rest(*q), &Memories::default()).real.base_from_tool.origin
}

fn any_pose(rng: &mut TestRng) -> Joints {
    let mut q = [0.0; JOINTS_MAX];
    for (slot, swing) in q.iter_mut().zip([60.0_f64, 35.0, 35.0, 90.0, 70.0, 120.0]) {
        *slot = swing.to_radians() * (2.0 * rng.uniform() - 1.0);
    }
    q
}

/// A normally distributed number, as the sum of twelve uniform ones.
fn normal(rng: &mut TestRng) -> f64 {
    (0..12).map(|_| rng.uniform()).sum::<f64>() - 6.0
}

/// A pose with the real tip at `at`: minimum-norm Newton steps from a random pose.
fn pose_at(truth: &Model, target: DVec3, rng: &mut TestRng) -> Joints {
    loop {
        let mut q = any_pose(rng);
        for _ in 0..30 {
            let error = target - tip(truth, &q);
            if error.length() < 1e-9 {
                return q;
            }
            let columns: Vec<DVec3> = (0..6)
                .map(|joint| {
                    let mut moved = q;
                    moved[joint] += 1e-6;
                    (tip(truth, &moved) - tip(truth, &q)) / 1e-6
                })
                .collect();
            let mut square = DMat3::from_diagonal(DVec3::splat(1e-4));
            for c in &columns {
                square += DMat3::from_cols(*c * c.x, *c * c.y, *c * c.z);
            }
            let pull = square.inverse() * error;
            q.iter_mut().zip(&columns).for_each(|(q, c)| *q += c.dot(pull));
        }
    }
}

/// A table: joint positions in degrees, and the other columns.
fn csv(head: &str, rows: &[(Joints, String)]) -> String {
    let mut text = String::from("t_s");
    (1..=6).for_each(|joint| write!(text, ",q{joint}_deg").unwrap());
    write!(text, ",{head}").unwrap();
    for (t_s, (q, rest)) in rows.iter().enumerate() {
        write!(text, "\n{t_s}").unwrap();
        q[..6].iter().for_each(|q| write!(text, ",{:.9}", q.to_degrees()).unwrap());
        write!(text, ",{rest}").unwrap();
    }
    text + "\n"
}

fn calibrated(place: &Place, recordings: &[&str]) -> Value {
    let command = ["calibrate", "--model", BASE, "--seed", "7", "--out", "robot2.toml"];
    place
        .succeed(&[&command[..], &["--json", "c.json", "--report", "c.html"], recordings].concat());
    place.succeed(&["check", "robot2.toml"]);
    place.json("c.json")
}

fn mean(found: &Value, model: &str) -> f64 {
    found["heldout"][model]["mean"].as_f64().expect("a mean")
}

/// The first value of an effect is near the truth, which is one of the smallest errors that explain
/// the readings. It is not identifiable: a common rotation of the axes after the joint has the same
/// effect.
fn is_near(found: &Value, effect: &str, joint: u8, truth: f64, most: f64) {
    let list = found["parameters"].as_array().expect("parameters");
    let is = |p: &&Value| p["effect"] == effect && p["joint"] == joint;
    let first = list.iter().find(is).expect("the effect among the parameters");
    let value = first["value"].as_f64().unwrap();
    assert!((value - truth).abs() < most, "{truth}: {first:#}");
    assert_eq!((&first["identifiable"], &first["sigma"]), (&Value::Bool(false), &Value::Null));
}

/// A fitted value of an object, mm, and its standard uncertainty.
fn thing(found: &Value, thing: &str, number: usize, what: &str) -> (f64, f64) {
    let list = found["things"].as_array().expect("things");
    let is = |t: &&Value| t["thing"] == thing && t["number"] == number && t["what"] == what;
    let one = list.iter().find(is).expect("the number among the things");
    (one["value_mm"].as_f64().unwrap(), one["sigma"].as_f64().unwrap_or(f64::NAN))
}

fn middle(found: &Value, of: &str, number: usize) -> DVec3 {
    DVec3::from_array(["x", "y", "z"].map(|what| thing(found, of, number, what).0))
}

#[test]
fn a_ballbar_between_unknown_points_calibrates_and_its_own_offset_is_found() {
    let (truth, mut chance) = (truth(), TestRng::new(5));
    let anchors =
        [DVec3::new(0.9, 0.5, 0.1), DVec3::new(0.7, -0.6, 0.2), DVec3::new(0.2, 0.1, 1.9)];
    let rows: Vec<_> = (0..130)
        .map(|_| {
            let q = any_pose(&mut chance);
            let mut read = |k: usize| {
                let offset = if k == 1 { 3.2e-3 } else { 0.0 };
                let length = tip(&truth, &q).distance(anchors[k]) + offset;
                format!("{:.5}", (length + NOISE_M * normal(&mut chance)) * 1e3)
            };
            let lengths = [0, 1, 2].map(&mut read);
            (q, lengths.join(","))
        })
        .collect();
    let place = Place::new();
    place.file("bar.csv", &csv("distance1_mm,distance2_mm,distance3_mm", &rows));
    let about = "schema = \"trued.recording/1\"\nkind = \"poses\"\n\
                 sigma = { distance1_mm = 0.005, distance2_mm = 0.005, distance3_mm = 0.005 }\n\
                 [distance2]\noffset_mm = \"fitted\"\n";
    place.file("bar.toml", about);
    let found = calibrated(&place, &["bar.csv"]);
    assert!(mean(&found, "advanced") < 0.008, "{:#}", found["heldout"]);
    assert!(mean(&found, "nominal") > 0.2, "{:#}", found["heldout"]);
    is_near(&found, "joint_offset", 3, 1.5, 0.5);
    let (offset, sigma) = thing(&found, "distance", 2, "offset");
    assert!((offset - 3.2).abs() < 4.0 * sigma && sigma < 0.05, "{offset} ± {sigma}");
    // Lengths do not determine the direction of the first axis in the cell.
    let open = found["undetermined"].as_array().expect("a list");
    let names =
        |part: &str| open.iter().any(|statement| statement.as_str().unwrap().contains(part));
    assert!(names("joint 1's") && names("fixed point"), "{open:#?}");
    let between = (middle(&found, "distance", 1) - middle(&found, "distance", 2)).length();
    assert!((between * 1e-3 - anchors[0].distance(anchors[1])).abs() < 1e-4, "{between}");
}

/// A row that touches a ball of unknown place from above.
fn touch_ball(truth: &Model, ball: DVec3, rng: &mut TestRng) -> Joints {
    let side = DVec3::new(normal(rng), normal(rng), normal(rng).abs()).normalize();
    let away = BALL_M + PROBE_M + NOISE_M * normal(rng);
    pose_at(truth, ball + side * away, rng)
}

#[test]
fn three_balls_of_unknown_place_calibrate() {
    let (truth, mut chance) = (truth(), TestRng::new(6));
    let balls = [DVec3::new(0.9, -0.4, 0.5), DVec3::new(0.8, 0.45, 0.9), DVec3::new(1.1, 0.1, 0.4)];
    let rows: Vec<_> = (0..150)
        .map(|k| (touch_ball(&truth, balls[k % 3], &mut chance), format!("{}", k % 3 + 1)))
        .collect();
    let place = Place::new();
    place.file("balls.csv", &csv("touch_sphere", &rows));
    let about = "schema = \"trued.recording/1\"\nkind = \"poses\"\n\
                 [probe]\nradius_mm = 3.0\nsigma_mm = 0.005\n\
                 [sphere1]\nradius_mm = 12.7\n[sphere2]\nradius_mm = 12.7\n[sphere3]\nradius_mm = 12.7\n";
    place.file("balls.toml", about);
    let found = calibrated(&place, &["balls.csv"]);
    assert!(mean(&found, "advanced") < 0.012, "{:#}", found["heldout"]);
    assert!(mean(&found, "nominal") > 0.1, "{:#}", found["heldout"]);
    is_near(&found, "joint_offset", 3, 1.5, 0.5);
    for (a, b) in [(1, 2), (2, 3), (1, 3)] {
        let between = middle(&found, "sphere", a).distance(middle(&found, "sphere", b)) * 1e-3;
        let error = between - balls[a - 1].distance(balls[b - 1]);
        // The rotation of the objects about the first axis is undetermined, their distances are
        // not: only the balls' radii define a length.
        assert!(error.abs() < 2e-4, "balls {a} and {b}: {error} m");
    }
}

#[test]
fn touches_of_a_plate_and_few_points_go_together() {
    let (truth, mut chance) = (truth(), TestRng::new(7));
    let normal_up = DVec3::new(0.03, -0.02, 1.0).normalize();
    let plate: Vec<_> = (0..90)
        .map(|_| {
            let on = DVec3::new(0.7 + 0.5 * chance.uniform(), 1.2 * chance.uniform() - 0.6, 0.0);
            let height = 0.35 + PROBE_M + NOISE_M * normal(&mut chance) - normal_up.dot(on);
            let point = on + DVec3::Z * height / normal_up.z;
            (pose_at(&truth, point, &mut chance), "1".to_owned())
        })
        .collect();
    let station = DMat3::from_rotation_z(2.0) * DMat3::from_rotation_x(0.02);
    let points: Vec<_> = (0..30)
        .map(|_| {
            let q = any_pose(&mut chance);
            let measured = station * tip(&truth, &q) + DVec3::new(1.5, -2.0, 0.3);
            let noisy_mm = measured.to_array().map(|x| (x + 2e-5 * normal(&mut chance)) * 1e3);
            (q, noisy_mm.map(|mm| format!("{mm:.5}")).join(","))
        })
        .collect();
    let place = Place::new();
    place.file("plate.csv", &csv("touch_plane", &plate));
    let about = "schema = \"trued.recording/1\"\nkind = \"poses\"\n\
                 [probe]\nradius_mm = 3.0\nsigma_mm = 0.005\n[plane1]\nnormal = [0, 0, 1]\n";
    place.file("plate.toml", about);
    place.file("points.csv", &csv("x_mm,y_mm,z_mm", &points));
    let about = "schema = \"trued.recording/1\"\nkind = \"poses\"\n\
                 sigma = { x_mm = 0.02, y_mm = 0.02, z_mm = 0.02 }\n";
    place.file("points.toml", about);
    let found = calibrated(&place, &["plate.csv", "points.csv"]);
    assert!(mean(&found, "advanced") < 0.03, "{:#}", found["heldout"]);
    is_near(&found, "joint_offset", 3, 1.5, 0.5);
    let (offset, sigma) = thing(&found, "plane", 1, "offset");
    // A plate is as accurate as the base frame, which the points' frame shares with joint 1.
    assert!((offset - 350.0).abs() < 1.0 && sigma.is_finite(), "{offset} ± {sigma}");
    let page = place.read("c.html");
    assert!(page.contains("plane 1"), "{page}");
}

#[test]
fn recordings_that_contradict_each_other_are_refused_in_words() {
    let place = Place::new();
    let mut chance = TestRng::new(8);
    let rows: Vec<_> = (0..9).map(|_| (any_pose(&mut chance), "700.0".to_owned())).collect();
    for (name, x) in [("one", 900.0), ("two", 901.0)] {
        place.file(&format!("{name}.csv"), &csv("distance1_mm", &rows));
        let anchor = format!("[distance1]\nanchor_mm = [{x}, 0.0, 0.0]\n");
        let about = format!("schema = \"trued.recording/1\"\nkind = \"poses\"\n{anchor}");
        place.file(&format!("{name}.toml"), &about);
    }
    let done = place.run(&["calibrate", "--model", BASE, "--out", "m.toml", "one.csv", "two.csv"]);
    assert_eq!(done.code, Some(2), "{done:#?}");
    assert!(done.err.contains("distance1") && done.err.contains("two.csv"), "{done:#?}");
}
