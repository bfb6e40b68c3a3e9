//! The command line: exit codes, streams, JSON, faults, and that nothing is half written.

use crate::program::{Place, signal};
use std::thread::sleep;
use std::time::Duration;

const CELL: &str = "schema = \"trued.cell/1\"\ncell = \"cell-1\"\nmodel = \"robot.toml\"\n";
const PATH: &str = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n\
    0,0,10,10,0,30,0\n0.001,0,10.01,10,0,30,0\n0.002,0,10.02,10,0,30,0\n";

fn thesis() -> &'static str {
    recording::model::presets::preset("irb1600-6-145-thesis").unwrap().text
}

#[test]
fn exit_codes_are_those_of_the_contract() {
    let place = Place::new();
    place.file("robot.toml", thesis());
    place.file("cell.toml", CELL);
    place.file("wrong.toml", &CELL.replace("cell-1", "Cell 1"));
    let code = |arguments: &[&str]| place.run(arguments).code;
    assert_eq!(code(&["--help"]), Some(0));
    assert_eq!(code(&["check", "cell.toml", "robot.toml"]), Some(0));
    assert_eq!(code(&["check", "cell.toml", "wrong.toml"]), Some(1));
    assert_eq!(code(&["check", "absent.toml"]), Some(2));
    assert_eq!(code(&["check"]), Some(2));
    assert_eq!(code(&["straighten", "cell.toml"]), Some(2));
    assert_eq!(code(&["model", "show", "ur11"]), Some(2));
    assert_eq!(code(&["run", "--config", "wrong.toml"]), Some(2));
    assert_eq!(code(&["reload", "--config", "cell.toml"]), Some(3), "no daemon runs");
    assert!(place.litter().is_empty());
}

#[test]
fn check_tells_the_faults_of_a_cell_and_of_its_model_at_once_with_line_and_caret() {
    let place = Place::new();
    place.file(
        "robot.toml",
        &thesis().replace("kind = \"backlash\"\njoint = 1", "kind = \"backlsh\"\njoint = 1"),
    );
    place.file("cell.toml", &format!("{CELL}mode = \"ful\"\n[cycle]\nperiod_s = 1\n"));
    let done = place.run(&["check", "cell.toml"]);
    assert_eq!(done.code, Some(1), "{done:#?}");
    for line in [
        "cell.toml:4:8",
        "4 | mode = \"ful\"",
        "^^^^^",
        "cell.toml:6:1",
        "`backlsh`, ",
        "did you mean",
    ] {
        let line = line.replace("`backlsh`, ", "\"backlsh\"");
        assert!(done.out.contains(&line), "{line:?} in\n{}", done.out);
    }
    assert!(!done.out.contains('\u{1b}'), "no colour where there is no terminal");
}

#[test]
fn check_tells_what_does_not_fit_between_a_cell_and_its_model() {
    let place = Place::new();
    place.file("robot.toml", thesis());
    place.file("cell.toml", &format!("{CELL}[envelope]\nangle_mrad = [20, 20]\n"));
    let done = place.run(&["check", "cell.toml", "--json", "check.json"]);
    assert_eq!(done.code, Some(1));
    assert!(done.out.contains("cell.toml:5:1"), "{}", done.out);
    let report = place.json("check.json");
    assert_eq!((&report["schema"], &report["ok"]), (&"trued.check/1".into(), &false.into()));
    let fault = &report["files"][0]["faults"][0];
    assert_eq!((&fault["key"], &fault["line"]), (&"envelope.angle_mrad".into(), &5.into()));
    place.file("lost.toml", &CELL.replace("robot.toml", "nowhere.toml"));
    let done = place.run(&["check", "lost.toml"]);
    assert_eq!(done.code, Some(1));
    assert!(
        done.out.contains("lost.toml:3:1") && done.out.contains("nowhere.toml"),
        "{}",
        done.out
    );
}

#[test]
fn every_json_names_its_schema() {
    let place = Place::new();
    place.file("path.csv", PATH);
    for (schema, arguments) in [
        ("trued.model/1", vec!["model", "presets"]),
        ("trued.model/1", vec!["model", "show", "fr3"]),
        ("trued.model/1", vec!["model", "export", "fr3", "--urdf", "/dev/null"]),
        ("trued.check/1", vec!["check", "path.csv"]),
        ("trued.correct/1", vec!["correct", "--model", "irb1600-6-145-thesis", "path.csv"]),
        ("trued.replay/1", vec!["replay", "--model", "irb1600-6-145-thesis", "path.csv"]),
        ("trued.spectrum/1", vec!["spectrum", "--column", "q1_deg", "path.csv"]),
    ] {
        let done = place.succeed(&[arguments.as_slice(), &["--json", "-"]].concat());
        let object: serde_json::Value = serde_json::from_str(&done.out).unwrap();
        assert_eq!(object["schema"], schema, "{arguments:?}");
        assert!(!done.err.is_empty(), "the text goes to standard error then");
    }
}

#[test]
fn a_preset_starts_a_model_that_is_the_same_model() {
    let place = Place::new();
    let text = place.succeed(&["model", "show", "ur10e", "--toml"]).out;
    place.file("robot.toml", &text);
    let hash = |model: &str| {
        let done = place.succeed(&["model", "show", model, "--json", "-", "-q"]);
        let object: serde_json::Value = serde_json::from_str(&done.out).unwrap();
        object["hash"].as_str().unwrap().to_owned()
    };
    assert_eq!(hash("robot.toml"), hash("ur10e"));
    place.file("cell.toml", &CELL.replace("robot.toml", "ur10e"));
    place.succeed(&["check", "cell.toml"]);
}

#[test]
fn a_model_says_which_robot_it_is_of() {
    let place = Place::new();
    let geometry = |model: &str| {
        let json = place.succeed(&["model", "show", model, "--json", "-", "-q"]).out;
        let result: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(result["robot"]["maker"], "ABB");
        assert_eq!(result["robot"]["type"], "IRB 1600-6/1.45");
        result["robot"]["geometry"].as_str().unwrap().to_owned()
    };
    // A calibration is of the same robot, and another tool is too.
    let nominal = geometry("irb1600-6-145");
    place.file("robot.toml", &thesis().replacen("tcp_mm = [", "tcp_mm = [1", 1));
    assert_eq!(
        [geometry("irb1600-6-145-thesis"), geometry("robot.toml")],
        [nominal.clone(), nominal.clone()]
    );
    let text = place.succeed(&["model", "show", "irb1600-6-145"]).out;
    assert!(text.contains(&format!("robot: ABB IRB 1600-6/1.45, geometry {nominal}")), "{text}");
}

#[test]
fn a_description_becomes_a_model_and_a_calibrated_model_a_description() {
    let place = Place::new();
    let export =
        place.succeed(&["model", "export", "irb1600-6-145-thesis", "--urdf", "arm.urdf"]).out;
    for line in [
        "included in the frames: joint_offset of joint 2,",
        "left out (depends on the load): load_",
    ] {
        assert!(export.contains(line), "{line:?} in\n{export}");
    }
    place.succeed(&["model", "import", "arm.urdf", "--out", "arm.toml", "--json", "import.json"]);
    assert_eq!(place.json("import.json")["tip"], "tool0");
    place.succeed(&["check", "arm.toml"]);
    // The model beside the URDF is not read as the TOML of a recording.
    let done = place.run(&["check", "arm.urdf", "--mapping", "arm.toml"]);
    assert_eq!(done.code, Some(2), "{done:#?}");
    assert!(
        done.err.contains("--mapping is for recordings") && done.out.contains("ok:"),
        "{done:#?}"
    );
    place.file("bad.urdf", &place.read("arm.urdf").replace("\"revolute\"", "\"hinge\""));
    let refused = place.run(&["model", "import", "bad.urdf", "--out", "bad.toml"]);
    assert_eq!(refused.code, Some(2));
    assert!(refused.err.contains("bad.urdf has 6 faults"), "{}", refused.err);
    assert!(!place.path("bad.toml").exists());
}

#[test]
fn bad_input_leaves_nothing_half_written_and_what_was_there() {
    let place = Place::new();
    place.file("good.csv", PATH);
    place.file("bad.csv", &PATH.replace("10.02", "ten"));
    place.file("kept.csv", "before");
    for command in [["correct", "--out"], ["replay", "--corrections"]] {
        let done = place.run(&[
            command[0],
            "--model",
            "ur10e",
            command[1],
            "kept.csv",
            "--overwrite",
            "--json",
            "new.json",
            "bad.csv",
        ]);
        assert_eq!(done.code, Some(2), "{done:#?}");
        assert!(done.err.contains("bad.csv:4:9") && done.err.contains("^^^"), "{}", done.err);
        let over = place.run(&[command[0], "--model", "ur10e", command[1], "good.csv", "good.csv"]);
        assert_eq!(over.code, Some(2), "an input is not replaced");
        let few = place.run(&[command[0], "--model", "fr3", command[1], "new.csv", "good.csv"]);
        assert_eq!(few.code, Some(2), "six joints do not fit seven");
        assert!(few.err.contains("q7"), "{}", few.err);
    }
    assert_eq!(place.names(), ["bad.csv", "good.csv", "kept.csv"]);
    assert_eq!((place.read("kept.csv"), place.read("good.csv")), ("before".into(), PATH.into()));
    assert!(place.litter().is_empty());
}

#[test]
fn a_running_daemon_takes_a_good_model_and_refuses_a_bad_one() {
    let place = Place::new();
    place.file("robot.toml", thesis());
    place.file("cell.toml", CELL);
    let mut daemon = place.start(&["run", "--config", "cell.toml"]);
    let mut tries = 0;
    let first = loop {
        let done = place.run(&["reload", "--config", "cell.toml"]);
        if done.code != Some(3) || tries == 10 {
            break done;
        }
        tries += 1;
        sleep(Duration::from_millis(100));
    };
    assert_eq!(first.code, Some(0), "{first:#?}");
    assert!(first.out.contains("loaded"), "{}", first.out);
    let preset = place.run(&["reload", "--config", "cell.toml", "irb1600-6-145"]);
    assert_eq!(preset.code, Some(0), "{preset:#?}");
    for (bad, part) in [("fr3", "7 joints"), ("cell.toml", "schema")] {
        let refused = place.run(&["reload", "--config", "cell.toml", bad]);
        assert_eq!(refused.code, Some(1), "{refused:#?}");
        assert!(refused.out.contains(part), "{}", refused.out);
    }
    signal(&daemon, "TERM");
    assert_eq!(daemon.wait().unwrap().code(), Some(0));
    assert!(place.litter().is_empty(), "{:?}", place.litter());
}
