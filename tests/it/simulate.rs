//! `trued simulate`: the model's results in the layout of the recording, the same bytes by seed,
//! and noise of the requested size.

use std::fmt::Write as _;

use glam::DVec3;
use recording::model::RobotModel;
use recording::model::presets::preset;
use recording::series::{Channel, Recording, RequiredData, read};

use crate::program::Place;

const BASE: &str = "irb1600-6-145";
const RATE_HZ: f64 = 100.0;

/// Joints 2 and 3 oscillate; a tracker measures every second row from row 10 on.
fn path(rows: usize) -> String {
    let mut text =
        String::from("t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,tau2_Nm,note\n");
    for k in 0..rows {
        let t = k as f64 / RATE_HZ;
        let (q2, q3) = (20.0 * (1.3 * t).sin(), 10.0 * (0.9 * t).sin());
        let reading = if k >= 10 && k % 2 == 0 { "1,2,3" } else { ",," };
        writeln!(text, "{t},5,{q2},{q3},0,40,0,{reading},12,n{k}").unwrap();
    }
    text
}

fn place(rows: usize, effects: &str, about: &str) -> Place {
    let place = Place::new();
    place.file("path.csv", &path(rows));
    place.file("path.toml", &format!("schema = \"trued.recording/1\"\n{about}"));
    place.file("robot.toml", &format!("{}\n{effects}", preset(BASE).expect("preset").text));
    place
}

fn simulated(place: &Place, out: &str, more: &[&str]) -> Recording {
    let mut arguments = vec!["simulate", "--model", "robot.toml", "--out", out, "path.csv"];
    arguments.extend(more);
    place.succeed(&arguments);
    read(&place.path(&format!("{out}.csv")), None, RequiredData::Measurement).expect("a recording")
}

fn point(recording: &Recording, row: usize) -> DVec3 {
    DVec3::from_array(
        [0, 1, 2].map(|k| recording.column(Channel::Position(k)).expect("there")[row]),
    )
}

const IN_BASE: &str = "measuring_frame = \"base\"\n";

#[test]
fn the_layout_stays_and_what_was_measured_is_the_models() {
    let place = place(200, "", IN_BASE);
    let made = simulated(&place, "made", &["--seed", "1"]);
    let model = RobotModel::read(&place.path("robot.toml")).expect("sound").physics;
    for row in 0..200 {
        let measured = point(&made, row);
        if row < 10 || row % 2 == 1 {
            assert!(measured.is_nan(), "row {row} was not measured");
            continue;
        }
        let mut q = physics::Joints::default();
        (0..6).for_each(|i| q[i] = made.input(i).expect("there")[row]);
        let wanted = physics::Chain::nominal(&model.arm, &q).base_from_tool.origin;
        assert!((measured - wanted).length() < 1e-12, "row {row}");
    }
    let torque = made.column(Channel::Torque(1)).expect("simulated");
    assert!(torque.iter().all(|torque| torque.is_finite() && *torque != 12.0));
    assert_eq!(made.other[0].0, "note");
    let toml = place.read("made.toml");
    assert!(toml.starts_with("# simulated: trued simulate --seed 1 --noise 0\n"), "{toml}");
    assert!(toml.contains("model = \"robot.toml\"") && toml.contains(IN_BASE.trim()), "{toml}");
    assert_eq!(place.names(), ["made.csv", "made.toml", "path.csv", "path.toml", "robot.toml"]);
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_noise_is_of_the_requested_size() {
    let place = place(2000, "", IN_BASE);
    let clean = simulated(&place, "clean", &["--seed", "1"]);
    let noisy = simulated(&place, "noisy", &["--seed", "5", "--noise", "0.04"]);
    simulated(&place, "again", &["--seed", "5", "--noise", "0.04"]);
    simulated(&place, "other", &["--seed", "6", "--noise", "0.04"]);
    assert_eq!(place.read("noisy.csv"), place.read("again.csv"));
    assert_ne!(place.read("noisy.csv"), place.read("other.csv"));
    let noise: Vec<f64> = (10..2000)
        .step_by(2)
        .flat_map(|row| (point(&noisy, row) - point(&clean, row)).to_array())
        .collect();
    let rms = (noise.iter().map(|x| x * x).sum::<f64>() / noise.len() as f64).sqrt();
    assert!((rms / 4e-5 - 1.0).abs() < 0.06, "{rms} m");
    assert_eq!(noisy.sigma(Channel::Position(2)), Some(4e-5));
}

#[test]
fn what_is_stated_of_an_instrument_stays_and_noise_beyond_it_is_reported() {
    let place = place(100, "", &format!("{IN_BASE}sigma = {{ x_mm = 0.15, y_mm = 0.01 }}\n"));
    let arguments =
        ["simulate", "--model", "robot.toml", "--out", "made", "--noise", "0.04", "path.csv"];
    let stderr = place.succeed(&arguments).err;
    let made = read(&place.path("made.csv"), None, RequiredData::Measurement).expect("a recording");
    let sigma = [0, 1, 2].map(|axis| made.sigma(Channel::Position(axis)));
    assert_eq!(sigma, [Some(1.5e-4), Some(1e-5), Some(4e-5)]);
    assert!(stderr.contains("which is kept: y\n"), "{stderr}");
}

#[test]
fn a_delay_moves_the_tool_to_where_it_was_before() {
    let delay = "[[effect]]\nkind = \"time_delay\"\ndelay_ms = 20.0\n";
    let (late, exact) = (place(300, delay, IN_BASE), place(300, "", IN_BASE));
    let late = simulated(&late, "late", &[]);
    let exact = simulated(&exact, "exact", &[]);
    for row in (14..300).step_by(2) {
        let difference = (point(&late, row) - point(&exact, row - 2)).length();
        assert!(difference < 1e-9, "row {row}: {difference} m");
    }
}

#[test]
fn effects_that_lag_ring_or_remember_move_the_tool() {
    let list = [
        ("joint = 2\noffset_mrad = 1.0", "joint_offset"),
        ("joint = 2\nwidth_mrad = 1.0", "backlash"),
        ("joint = 2\namplitude_mrad = 1.0\nreversal_mrad = 5.0", "hysteresis"),
        ("joint = 2\ntime_constant_ms = 20.0", "servo_lag"),
        ("joint = 2\nfrequency_Hz = 9.0\ndamping_ratio = 0.03", "flexible_mode"),
        ("joint = 2\namplitude_mrad = 1.0\ntime_constant_ms = 60.0", "reversal_spike"),
        (
            "axis = [0, 1, 0]\nfrequency_Hz = 9.0\ndamping_ratio = 0.03\ndynamic_compliance_mrad_per_kNm = 1.0",
            "flexible_mode",
        ),
    ];
    let exact = simulated(&place(600, "", IN_BASE), "exact", &[]);
    for (numbers, kind) in list {
        let place = place(600, &format!("[[effect]]\nkind = \"{kind}\"\n{numbers}\n"), IN_BASE);
        let made = simulated(&place, "made", &[]);
        let differences =
            (10..600).step_by(2).map(|row| (point(&made, row) - point(&exact, row)).length());
        let most = differences.fold(0.0, f64::max);
        assert!(most > 1e-5, "{kind}: {most} m");
    }
}

#[test]
fn an_unknown_frame_is_found_from_what_was_recorded_and_an_empty_one_is_the_base() {
    let place = place(400, "", IN_BASE);
    let exact = simulated(&place, "exact", &[]);
    // The same, measured by a tracker at another position.
    let turn = glam::DMat3::from_rotation_z(2.0) * glam::DMat3::from_rotation_x(0.05);
    let mut moved = exact.clone();
    moved.metadata.measured_in_base = false;
    for k in 0..3 {
        let column =
            (0..400).map(|row| (turn * point(&exact, row) + DVec3::new(1.0, -2.0, 0.5))[k]);
        moved.set(Channel::Position(k), column.collect());
    }
    recording::series::write(&place.path("path.csv"), &moved).expect("written");
    let made = simulated(&place, "made", &["--json", "said.json"]);
    for row in (10..400).step_by(2) {
        assert!((point(&made, row) - point(&moved, row)).length() < 1e-8, "row {row}");
    }
    assert!(!made.metadata.measured_in_base);
    assert!(place.json("said.json")["recorded_rms_mm"].as_f64().expect("said") < 1e-5);
    for k in 0..3 {
        moved.set(Channel::Position(k), vec![f64::NAN; 400]);
    }
    recording::series::write(&place.path("path.csv"), &moved).expect("written");
    let made = simulated(&place, "again", &[]);
    assert!(made.metadata.measured_in_base, "the frame is said");
    assert!((point(&made, 0) - point(&made, 399)).length() > 0.01, "every row is measured");
}

#[test]
fn noise_of_what_is_not_simulated_is_refused() {
    let place = place(20, "", IN_BASE);
    place.file("path.csv", &place.read("path.csv").replace("tau2_Nm", "seen_Nm"));
    for option in ["--torque-noise", "--force-noise"] {
        let simulate = ["simulate", "--model", "robot.toml", "--out", "made", option, "5"];
        let done = place.run(&[&simulate[..], &["path.csv"]].concat());
        assert_eq!(done.code, Some(2), "{option}: {done:#?}");
        assert!(done.err.contains(option) && done.err.contains("leave it out"), "{}", done.err);
    }
    assert_eq!(place.names(), ["path.csv", "path.toml", "robot.toml"]);
}

#[test]
fn nothing_is_written_over_an_input_or_where_an_input_is_unusable() {
    let place = place(20, "", IN_BASE);
    let onto = ["simulate", "--model", "robot.toml", "--out", "path", "path.csv"];
    assert_eq!(place.run(&onto).code, Some(2));
    let none = ["simulate", "--model", "none.toml", "--out", "made", "path.csv"];
    assert_eq!(place.run(&none).code, Some(2));
    let negative =
        ["simulate", "--model", "robot.toml", "--noise", "-1", "--out", "made", "path.csv"];
    assert_eq!(place.run(&negative).code, Some(2));
    let unseen =
        place.read("path.csv").replace("x_mm,y_mm,z_mm", "target1_x_mm,target1_y_mm,target1_z_mm");
    let unseen = unseen.replace("1,2,3,12", ",,,12");
    place.file("path.csv", &unseen);
    let done = place.run(&["simulate", "--model", "robot.toml", "--out", "made", "path.csv"]);
    assert!(done.code == Some(2) && done.err.contains("target1_mm"), "{done:#?}");
    assert_eq!(place.names(), ["path.csv", "path.toml", "robot.toml"]);
}

/// Sixty poses; three nests that a tracker sees to wander by a tenth of a millimetre.
fn poses_with_nests() -> String {
    let joints: Vec<String> = (1..=6).map(|joint| format!("q{joint}_deg")).collect();
    let points = (1..=4).flat_map(|t| ["x", "y", "z"].map(|axis| format!("target{t}_{axis}_mm")));
    let head: Vec<String> = ["t_s".to_owned()].into_iter().chain(joints).chain(points).collect();
    let mut text = head.join(",");
    for k in 0..60 {
        let angle_deg = |joint: u32| 30.0 * (f64::from(k) * (0.37 + 0.11 * f64::from(joint))).sin();
        write!(text, "\n{k}").unwrap();
        (0..6).for_each(|joint| write!(text, ",{:.4}", angle_deg(joint)).unwrap());
        text += ",1,2,3";
        let wander = 0.1 * f64::from(k) / 59.0;
        for [x, y, z] in [[900.0, 500.0, 10.0], [-700.0, 600.0, 0.0], [200.0, -800.0, 30.0]] {
            write!(text, ",{:.5},{y},{z}", x + wander).unwrap();
        }
    }
    text + "\n"
}

#[test]
fn an_instrument_that_wanders_is_simulated_as_it_stood_and_is_no_missing_physics() {
    let place = place(20, "", IN_BASE);
    let on = "target2_on_link = 0\ntarget3_on_link = 0\ntarget4_on_link = 0\n";
    let about = format!(
        "schema = \"trued.recording/1\"\nkind = \"poses\"\n{IN_BASE}target1_mm = [0.0, 0.0, 50.0]\n{on}"
    );
    place.file("path.csv", &poses_with_nests());
    place.file("path.toml", &about);
    let exact = simulated(&place, "exact", &["--seed", "1"]);
    let nest = exact.column(Channel::Target(2, 0)).expect("there");
    assert!((nest[59] - nest[0] - 1e-4).abs() < 1e-9, "a nest stays as it was seen");
    // What the tool's target is read at in the first and the last row wanders as the nests do.
    let arm = RobotModel::read(&place.path("robot.toml")).expect("sound").physics.arm;
    let error_m = |row: usize| {
        let mut q = physics::Joints::default();
        (0..6).for_each(|joint| q[joint] = exact.input(joint).expect("commanded")[row]);
        let tool = physics::Chain::nominal(&arm, &q).base_from_tool.point(DVec3::Z * 0.05);
        exact.column(Channel::Target(0, 0)).expect("there")[row] - tool.x
    };
    assert!((error_m(59) - error_m(0) - 1e-4).abs() < 1e-8, "{} {}", error_m(0), error_m(59));
    simulated(&place, "made", &["--seed", "1", "--noise", "0.01"]);
    let arguments =
        ["diagnose", "--model", "robot.toml", "--seed", "1", "--json", "d.json", "--out", "d"];
    place.succeed(&[&arguments[..], &["made.csv"]].concat());
    let result = place.json("d.json");
    assert_eq!(result["verdict"], "consistent", "{result:#}");
    assert!(result["notes"].to_string().contains("drifted by up to 0.05"), "{:#}", result["notes"]);
    // The model is exact: no fit is better.
    let calibrate = ["calibrate", "--accept-worse", "--model", "robot.toml", "--out", "m.toml"];
    let fitted = place.succeed(&[&calibrate[..], &["made.csv"]].concat());
    assert!(
        fitted.out.contains("frame     the measuring frame was defined by targets 2, 3, 4"),
        "{fitted:#?}"
    );
}
