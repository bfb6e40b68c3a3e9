//! A recording through the daemon: the same bits each time, the same as without a daemon, and
//! physically correct.

use crate::program::{Place, real_data, signal, workspace};
use physics::{Chain, Inputs, JOINTS_MAX, Memories, Wrench};
use recording::model::{EffectEntry, ModelFile, Numbers, Parameter, RobotModel, presets};
use std::fmt::Write;
use std::path::Path;
use std::time::{Duration, Instant};

const THESIS: &str = "irb1600-6-145-thesis";

/// A path of six joints at 500 Hz in two segments, with a wrench at every second row and temperatures.
fn path() -> String {
    let mut text = "t_s,segment,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,\
        fx_N,fy_N,fz_N,temp_C,temp2_C,note\n"
        .to_owned();
    for k in 0..1500 {
        let segment = 1 + k / 1000;
        let t = f64::from(k % 1000) * 0.002;
        let q = |joint: f64| 10.0 + 4.0 * joint + 8.0 * (0.15 * t * joint + joint).sin();
        let joints: Vec<String> = (1..=6).map(|joint| q(f64::from(joint)).to_string()).collect();
        let wrench =
            if k % 2 == 0 { format!("{},{},-40", 20.0 * t, 30.0) } else { ",,".to_owned() };
        let warm = if k % 100 == 0 { format!("{},31.5", 20.0 + t) } else { ",".to_owned() };
        writeln!(text, "{t},{segment},{},{wrench},{warm},row {k}", joints.join(",")).unwrap();
    }
    text
}

#[test]
fn a_replay_gives_the_same_bits_twice_and_those_of_the_corrector_alone() {
    let place = Place::new();
    place.file("path.csv", &path());
    for name in ["one", "two"] {
        let (csv, json) = (format!("{name}.csv"), format!("{name}.json"));
        place.succeed(&[
            "replay",
            "--model",
            THESIS,
            "--corrections",
            &csv,
            "--json",
            &json,
            "path.csv",
        ]);
    }
    place.succeed(&[
        "correct",
        "--model",
        THESIS,
        "--out",
        "alone.csv",
        "--json",
        "alone.json",
        "path.csv",
    ]);
    let (one, two, alone) = (place.read("one.csv"), place.read("two.csv"), place.read("alone.csv"));
    assert!(one == two, "two replays differ");
    assert!(one == alone, "the daemon and the corrector alone differ");
    let hash = |name| place.json(name)["corrections_hash"].clone();
    assert_eq!(hash("one.json"), hash("two.json"));
    assert_eq!(hash("one.json"), hash("alone.json"));

    let report = place.json("one.json");
    assert_eq!(report["rows"], 1500);
    assert!(report["statuses"]["corrected"].as_u64().unwrap() > 1000, "{report:#}");
    assert!(report["latency_ns"]["max"].as_u64() >= report["latency_ns"]["p50"].as_u64());
    assert!(report["largest_correction"][0]["value"].as_f64().unwrap() > 0.1, "{report:#}");
    let header = one.lines().next().unwrap();
    assert!(header.starts_with("t_s,segment,q1_deg"), "{header}");
    let columns =
        "note,c1_deg,c2_deg,c3_deg,c4_deg,c5_deg,c6_deg,status,left_mm,left_mrad,limited_by";
    assert!(header.ends_with(columns), "{header}");
    assert_eq!(one.lines().count(), 1501);
    let left = column(&one, "left_mm");
    assert!(left[0] > 0.1, "the correction begins at zero: {} mm are left", left[0]);
    let largest = left.iter().copied().fold(0.0, f64::max);
    let reported = report["largest_left"]["mm"].as_f64().unwrap();
    assert!((reported - largest).abs() < 1e-6, "{reported} of {largest}");
    assert!(place.litter().is_empty(), "{:?}", place.litter());
}

/// A numeric column of a table without empty cells in it.
fn column(table: &str, name: &str) -> Vec<f64> {
    let mut lines = table.lines().map(|line| line.split(','));
    let index = lines.next().unwrap().position(|column| column == name).unwrap();
    lines.map(|mut fields| fields.nth(index).unwrap().parse().unwrap()).collect()
}

/// The same path, as input and corrected: an existing correction is replaced, not doubled.
#[test]
fn a_row_without_a_joint_is_refused_by_its_number_with_a_daemon_and_without() {
    let place = Place::new();
    let lacking = path().lines().enumerate().fold(String::new(), |text, (line, row)| {
        let mut cells: Vec<&str> = row.split(',').collect();
        if line == 3 {
            cells[4] = "";
        }
        text + &cells.join(",") + "\n"
    });
    place.file("path.csv", &lacking);
    for command in [&["replay"][..], &["correct", "--out", "corrected.csv"]] {
        let done = place.run(&[command, &["--model", THESIS, "path.csv"]].concat());
        assert_eq!(done.code, Some(2), "{command:?}: {}", done.err);
        let named =
            done.err.contains("path.csv: row 3 of the data") && done.err.contains("joint 3");
        assert!(named, "{command:?}: {}", done.err);
    }
}

#[test]
fn what_was_corrected_can_be_corrected_again() {
    let place = Place::new();
    place.file("path.csv", &path());
    place.succeed(&["correct", "--model", THESIS, "--out", "one.csv", "path.csv"]);
    place.succeed(&["correct", "--model", THESIS, "--out", "two.csv", "one.csv"]);
    assert_eq!(place.read("one.csv"), place.read("two.csv"));
}

/// For settled poses the remaining error decides, whatever limited the correction.
fn what_is_left_is_held_against_a_tolerance(place: &Place) {
    let arguments =
        ["correct", "--model", THESIS, "--overwrite", "--out", "t.csv", "--json", "t.json"];
    let within = |mm: &str| {
        let done = place.run(&[&arguments[..], &["--tolerance-mm", mm, "poses.csv"]].concat());
        let tolerance = place.json("t.json")["tolerance"].clone();
        assert_eq!(tolerance["met"], done.code == Some(0), "{done:#?}");
        assert!(done.out.contains("tolerance"), "{}", done.out);
        (
            done.code,
            tolerance["largest_mm"].as_f64().expect("known"),
            tolerance["rows_beyond"].as_u64(),
        )
    };
    let (code, largest_mm, beyond) = within("1000");
    assert_eq!((code, beyond), (Some(0), Some(0)));
    assert!(largest_mm > 1e-6, "some pose is limited: {largest_mm}");
    let (code, _, beyond) = within(&(0.5 * largest_mm).to_string());
    assert!(code == Some(1) && beyond.is_some_and(|rows| rows > 0), "{code:?} {beyond:?}");
}

#[test]
fn poses_are_settled_solutions_with_their_whole_wrench_and_direction() {
    let place = Place::new();
    let mut text = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,d1,d2,d3,d4,d5,d6,\
        fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm\n"
        .to_owned();
    for k in 0..40 {
        let q = |joint: f64| 15.0 + 40.0 * (f64::from(k) * 1.7 + joint).sin();
        let d = |joint: i32| (k * joint) % 3 - 1;
        let joints: Vec<String> = (1..=6).map(|joint| q(f64::from(joint)).to_string()).collect();
        let signs: Vec<String> = (1..=6).map(|joint| d(joint).to_string()).collect();
        let wrench = format!("{},-120,{},5,-3,{}", 10 * k, 200 - 9 * k, k);
        writeln!(text, "{},{},{},{wrench}", 3 * k, joints.join(","), signs.join(",")).unwrap();
    }
    place.file("poses.csv", &text);
    place.file(
        "poses.toml",
        "schema = \"trued.recording/1\"\nkind = \"poses\"\napproach = \"columns\"\nwrench_frame = \"base\"\n",
    );
    place.succeed(&["replay", "--model", THESIS, "--corrections", "out.csv", "poses.csv"]);
    let accept = "--accept-limited";
    place.succeed(&["correct", "--model", THESIS, "--out", "alone.csv", accept, "poses.csv"]);
    assert_eq!(place.read("out.csv"), place.read("alone.csv"));
    what_is_left_is_held_against_a_tolerance(&place);
    let model = presets::preset(THESIS).unwrap().model().unwrap().physics;
    let out = place.read("out.csv");
    let mut solved = 0;
    for line in out.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |index: usize| fields[index].parse::<f64>().unwrap();
        let joints = |first: usize, scale: f64| {
            let mut all = [0.0; JOINTS_MAX];
            all.iter_mut().take(6).enumerate().for_each(|(i, q)| *q = number(first + i) * scale);
            all
        };
        let (commanded, corrected) =
            (joints(1, 1_f64.to_radians()), joints(19, 1_f64.to_radians()));
        let mut inputs = Inputs::at_rest(commanded);
        inputs.direction = joints(7, 1.0);
        inputs.wrench_base = Wrench {
            force: [number(13), number(14), number(15)].into(),
            moment: [number(16), number(17), number(18)].into(),
        };
        let mut memories = Memories::default();
        model.settle(&inputs, &mut memories);
        inputs.q = corrected;
        let real = model.evaluate(&inputs, &memories).real.base_from_tool;
        let wanted = Chain::nominal(&model.arm, &commanded).base_from_tool;
        let error_m = (real.origin - wanted.origin).length();
        let turned = (real.rotation - wanted.rotation).determinant().abs()
            + (real.rotation - wanted.rotation).x_axis.length();
        assert!((error_m * 1e3 - number(26)).abs() < 1e-6, "{error_m} m are left: {line}");
        assert_ne!(commanded, corrected);
        if fields[25] != "corrected" {
            assert_eq!(fields[25], "limited", "a singular pose at worst: {line}");
            continue;
        }
        assert!(error_m < 1e-9 && turned < 1e-8, "{error_m} m, {turned}: {line}");
        solved += 1;
    }
    assert!(solved > 35, "{solved} of 40");
}

#[test]
fn a_recording_with_a_bad_row_is_refused_whole() {
    let place = Place::new();
    let text = path();
    let row = text.lines().nth(700).unwrap();
    let fields: Vec<&str> = row.split(',').collect();
    place.file("path.csv", &text.replace(row, &row.replacen(fields[2], "inf", 1)));
    let done = place.run(&["replay", "--model", THESIS, "--corrections", "out.csv", "path.csv"]);
    assert_eq!(done.code, Some(2));
    assert!(done.err.contains("path.csv:701:") && done.err.contains("infinite"), "{}", done.err);
    assert_eq!(place.names(), ["path.csv"]);
}

#[test]
fn a_command_that_cannot_be_is_rejected_in_its_row_and_the_others_stand() {
    let place = Place::new();
    let text = path();
    let row = text.lines().nth(700).unwrap();
    let fields: Vec<&str> = row.split(',').collect();
    place.file("path.csv", &text.replace(row, &row.replacen(fields[2], "500", 1)));
    place.succeed(&[
        "replay",
        "--model",
        THESIS,
        "--corrections",
        "out.csv",
        "--json",
        "out.json",
        "path.csv",
    ]);
    let report = place.json("out.json");
    assert_eq!(report["statuses"]["rejected"], 1, "{report:#}");
    let reasons = report["reasons"].as_array().unwrap();
    let named = |r: &&serde_json::Value| r["reason"] == "out_of_limits" && r["first_row"] == 700;
    assert!(reasons.iter().any(|reason| named(&reason)), "{report:#}");
    assert!(place.read("out.csv").lines().nth(700).unwrap().contains(",rejected,"));
}

#[test]
fn an_interrupted_replay_ends_at_once_and_leaves_nothing() {
    let place = Place::new();
    let mut text = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n".to_owned();
    (0..100).for_each(|k| writeln!(text, "{k},0,0,0,0,30,0").unwrap());
    place.file("path.csv", &text);
    let mut child = place.start(&[
        "replay",
        "--pace",
        "--model",
        THESIS,
        "--corrections",
        "out.csv",
        "path.csv",
    ]);
    let since = Instant::now();
    let runs = || place.litter().iter().any(|dir| dir.join("trued-r/current").exists());
    while !runs() && since.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(runs(), "the daemon did not open");
    signal(&child, "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(place.names(), ["path.csv"]);
    assert!(place.litter().is_empty(), "{:?}", place.litter());
}

/// A model of a robot with recordings but without known geometry: the corrections are arbitrary,
/// the path is real.
fn made(preset: &str, joints: usize) -> ModelFile {
    let mut file = presets::preset(preset).unwrap().model().unwrap().file;
    assert_eq!(file.joints.len(), joints);
    file.joints.iter_mut().for_each(|joint| joint.limits = [-400.0, 400.0]);
    for joint in 1..=3 {
        let parameter = |key: &str, value: f64| Parameter {
            key: key.to_owned(),
            value: Numbers::One(value),
            sigma: None,
        };
        let effect = |kind: &str, parameters| EffectEntry {
            kind: kind.to_owned(),
            joint: Some(joint),
            channel: None,
            parameters,
        };
        file.effects.push(effect("joint_offset", vec![parameter("offset_mrad", 0.3)]));
        file.effects.push(effect("backlash", vec![parameter("width_mrad", 0.2)]));
        file.effects.push(effect(
            "joint_compliance",
            vec![parameter("compliance_mrad_per_kNm", 0.5 * joint as f64)],
        ));
    }
    file
}

/// Replays a real recording and compares it with the corrector alone; returns the share of
/// corrected rows.
fn replay_real(data: &Path, mapping: &str, file: &ModelFile) -> f64 {
    let place = Place::new();
    let model = RobotModel::of_file("made", file.clone()).unwrap();
    place.file("robot.toml", &model.file.to_toml());
    let mapping = workspace().join(format!("deploy/mappings/{mapping}.mapping.toml"));
    let (mapping, data) = (mapping.to_str().unwrap(), data.to_str().unwrap());
    let input = ["--model", "robot.toml", "--mapping", mapping, "--json", "out.json", data];
    // What is compared is the corrections; a singular pose may leave an error.
    place.succeed(
        &[["correct", "--accept-limited", "--out", "alone.csv"].as_slice(), &input].concat(),
    );
    place.succeed(&[["replay", "--corrections", "out.csv"].as_slice(), &input].concat());
    assert!(place.read("out.csv") == place.read("alone.csv"), "{data}: they differ");
    let report = place.json("out.json");
    let (rows, statuses) = (report["rows"].as_u64().unwrap(), &report["statuses"]);
    let corrected = statuses["corrected"].as_u64().unwrap_or(0);
    eprintln!("{data}: {rows} rows, {statuses}, {} rows/s", report["rows_per_s"]);
    assert!(statuses["rejected"].is_null(), "{data}: {statuses}");
    assert_eq!(place.read("out.csv").lines().count() as u64, 1 + rows);
    corrected as f64 / rows as f64
}

#[test]
fn the_ur10e_runs_replay() {
    for run in [
        "20_01_17-ptp_10_points",
        "20_01_22-joint_1",
        "20_01_22-joint_2",
        "20_01_22-joint_3",
        "20_02_10-30sec_12harm",
        "20_02_12-50sec_12harm",
        "20_02_19_14harm50sec",
        "20_02_19_14harm50secLoad",
    ] {
        let Some(data) = real_data(&format!("ur10e/ur-{run}.csv")) else { return };
        let share = replay_real(&data, "ur10e", &made("ur10e", 6));
        // Single joints were moved with the wrist stretched: a singular pose, for which there is no correction.
        let singular = run.contains("joint");
        assert!(singular || share > 0.5, "{run}: {share}");
    }
}

#[test]
fn the_kukas_commanded_paths_replay() {
    for run in ["traj_A", "traj_B"] {
        let Some(data) = real_data(&format!("kuka-link-encoder/{run}.csv")) else { return };
        assert!(replay_real(&data, "kuka-link-encoder", &made("kuka-kr240", 6)) > 0.5);
    }
}

#[test]
fn the_laser_trackers_poses_replay() {
    for (data, mapping, preset, joints) in [
        ("irb120-tracker/poses_1000.csv", "irb120-tracker", "irb1600-6-145", 6),
        ("kuka-3smr/poses_36.csv", "kuka-3smr", "kuka-kr240", 6),
        ("motoman-leica/leica_poses_all.csv", "motoman-leica-left", "fr3", 7),
        ("motoman-leica/leica_poses_all.csv", "motoman-leica-right", "fr3", 7),
    ] {
        let Some(data) = real_data(data) else { return };
        assert!(replay_real(&data, mapping, &made(preset, joints)) > 0.5);
    }
}
