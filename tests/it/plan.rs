//! `trued plan`: reachable and measurable poses, guided capture with a stopping rule, a check that
//! identifies damage, ISO 9283.

use diagnosis::{FitParameter, campaign_import, campaign_simulation};
use glam::{DMat3, DVec3};
use physics::{AnyEffect, Model, ParameterValues};
use recording::model::presets::preset;
use recording::series::{self, Channel, Recording, RequiredData};
use serde_json::Value;

use crate::program::Place;

const NOMINAL: &str = "irb1600-6-145";
const CALIBRATED: &str = "irb1600-6-145-thesis";
/// A reflector facing along the tool's axis, a tracker in front of the robot.
const SETUP: [&str; 8] = [
    "--instrument",
    "3500,-1500,1000",
    "--target",
    "50,0,100,0,0,1",
    "--accept-deg",
    "60",
    "--sigma-mm",
    "0.03",
];

fn model(name: &str) -> Model {
    preset(name).expect("preset").model().expect("sound").physics
}

fn plan(place: &Place, more: &[&str]) -> Value {
    place.succeed(&[&["plan", "--seed", "5", "--json", "p.json"], more].concat());
    place.json("p.json")
}

fn number(of: &Value, key: &str) -> f64 {
    of[key].as_f64().expect(key)
}

/// Fills the list of poses in a folder with the measurements of a tracker for `truth`; `known`: in
/// the base frame, otherwise in the tracker's own.
fn measure(place: &Place, folder: &str, truth: &Model, known: bool, sigma: f64) {
    let path = place.path(&format!("{folder}/poses.csv"));
    let mut list = series::read(&path, None, RequiredData::Path).expect("the list is a recording");
    let columns: Vec<Channel> = list
        .channels()
        .filter(|c| matches!(c, Channel::Target(..) | Channel::Position(_)))
        .collect();
    assert_eq!(columns.len(), 3);
    // Any value: the readings are replaced.
    columns.iter().for_each(|column| list.set(*column, vec![1.0; list.len()]));
    let mut campaign =
        campaign_import::campaign(&truth.arm, std::slice::from_ref(&list)).expect("a campaign");
    let station = &mut campaign.surroundings.frames[0].value.measuring_from_base;
    if !known {
        station.rotation = DMat3::from_rotation_z(2.0) * DMat3::from_rotation_x(0.02);
        station.origin = DVec3::new(1.5, -2.0, 0.3);
    }
    for target in &mut campaign.surroundings.targets {
        *target = FitParameter::known(DVec3::new(0.05, 0.0, 0.1));
    }
    let around = campaign.surroundings.clone();
    let made = campaign_simulation::simulate_readings(&campaign, truth, &around, sigma, 11);
    let made = &made;
    let readings = |axis: usize| {
        made.poses.iter().map(move |pose| match pose.seen.first().map(|first| first.reading) {
            Some(diagnosis::Reading::Point { at, .. }) => at[axis],
            _ => f64::NAN,
        })
    };
    for column in columns {
        if let Channel::Target(_, axis) | Channel::Position(axis) = column {
            list.set(column, readings(axis).collect());
        }
    }
    write(place, folder, &list);
}

fn write(place: &Place, folder: &str, list: &Recording) {
    series::write(&place.path(&format!("{folder}/seen.csv")), list).expect("written");
}

#[test]
fn planned_poses_come_as_a_list_and_as_programs_within_the_limits() {
    let place = Place::new();
    let arguments = [&["--model", NOMINAL, "--count", "8", "--out", "d"], &SETUP[..]].concat();
    let found = plan(&place, &arguments);
    assert_eq!(
        (&found["schema"], &found["does"], &found["seed"]),
        (&"trued.plan/1".into(), &"plan".into(), &5.into())
    );
    let poses = found["poses"].as_array().expect("poses");
    assert_eq!(poses.len(), 8);
    let arm = model(NOMINAL).arm;
    for pose in poses {
        for (joint, about) in arm.joints().iter().enumerate() {
            let q = number(pose, &format!("q{}_deg", joint + 1)).to_radians();
            assert!(q > about.limits.0 && q < about.limits.1);
        }
        assert!(number(pose, "tool_after_mm") <= number(pose, "tool_before_mm"));
        assert!(
            number(pose, "log_det_gain") > 0.0
                && pose["surer"].as_array().is_some_and(|s| !s.is_empty())
        );
    }
    assert!(found["not_checked"].as_array().is_some_and(|open| !open.is_empty()));
    let list =
        series::read(&place.path("d/poses.csv"), None, RequiredData::Path).expect("a recording");
    assert_eq!(list.len(), 16, "each pose from below and from above");
    let directions = list.column(Channel::Direction(2)).expect("d3");
    assert!(directions.chunks(2).all(|pair| pair == [1.0, -1.0]));
    assert_eq!(list.sigma(Channel::Target(0, 1)).map(|sigma| (1e6 * sigma).round()), Some(30.0));
    assert_eq!(place.read("d/poses.mod").matches("WaitTime \\InPos").count(), 16);
    assert_eq!(place.read("d/poses.src").matches("WAIT SEC").count(), 16);
    assert!(place.read("d/poses.dat").contains("DEFDAT poses"));
    let twice = place.run(&[&["plan", "--seed", "5"], &arguments[..]].concat());
    assert!(
        twice.code == Some(2) && twice.err.contains("d/poses.toml already exists"),
        "{twice:?}"
    );
    let again = plan(&place, &[&arguments[..], &["--overwrite"]].concat());
    assert_eq!(found["poses"], again["poses"]);
}

#[test]
fn a_list_for_a_ballbar_or_a_probe_is_a_recording_of_what_that_measures() {
    let place = Place::new();
    let begin = ["--model", NOMINAL, "--count", "6", "--sigma-mm", "0.002", "--out"];
    let bar = ["bar", "--anchor", "900,0,200", "--length-mm", "598,602"];
    let probe = ["probe", "--plane", "900,0,300,0,0,2,300", "--sphere", "900,200,300,25"];
    plan(&place, &[&begin[..], &bar].concat());
    plan(&place, &[&begin[..], &probe].concat());
    let read = |folder: &str| {
        let path = place.path(&format!("{folder}/poses.csv"));
        series::read(&path, None, RequiredData::Path).expect("a recording")
    };
    let bar = read("bar");
    assert!(bar.channels().any(|column| column == Channel::Distance(0)));
    assert_eq!(bar.sigma(Channel::Distance(0)).map(|sigma| (1e6 * sigma).round()), Some(2.0));
    let gauge = bar.metadata.gauges.distances[&0];
    assert_eq!(
        (gauge.anchor_m, gauge.offset_m),
        (None, Some(0.0)),
        "a rough place is not a known one"
    );
    // Touches are refused until something is touched: here in turn, plane and sphere.
    let text = place.read("probe/poses.csv");
    let names: Vec<&str> = text.lines().next().expect("a header").split(',').collect();
    let fill = |(row, line): (usize, &str)| {
        let wanted = ["touch_plane", "touch_sphere"][row % 2];
        let cells = names.iter().zip(line.split(','));
        let cells = cells.map(|(name, cell)| if *name == wanted { "1" } else { cell });
        if row == 0 { line.to_owned() } else { cells.collect::<Vec<_>>().join(",") }
    };
    let filled: Vec<String> = text.lines().enumerate().map(fill).collect();
    place.file("probe/poses.csv", &filled.join("\n"));
    let probe = read("probe");
    for column in [Channel::TouchPlane, Channel::TouchSphere] {
        assert!(probe.channels().any(|found| found == column), "{column:?}");
    }
    let gauges = &probe.metadata.gauges;
    assert_eq!(gauges.probe.and_then(|probe| probe.sigma_m).map(|s| (1e6 * s).round()), Some(2.0));
    assert_eq!((gauges.planes[&0].normal, gauges.planes[&0].offset_m), ([0.0, 0.0, 1.0], None));
    assert_eq!(gauges.spheres[&0].radius_m, Some(0.025));
}

#[test]
fn guided_capture_continues_until_ten_more_poses_are_worth_nothing() {
    let place = Place::new();
    let begin = [&["--model", NOMINAL, "--approach", "direct"], &SETUP[..]].concat();
    let first = plan(&place, &[&begin[..], &["--next"]].concat());
    assert_eq!((&first["enough"], &first["measured_poses"]), (&false.into(), &0.into()));
    plan(&place, &[&begin[..], &["--count", "40", "--out", "d"]].concat());
    measure(&place, "d", &model(NOMINAL), false, 0.6);
    let goes_on = [&begin[..], &["d/seen.csv", "--next", "--worth-mm"]].concat();
    let done = place
        .succeed(&[&["plan", "--seed", "5", "--json", "p.json"], &goes_on[..], &["1.0"]].concat());
    assert!(
        done.out.contains("enough") && done.out.contains("ten more") | done.out.contains("10 more"),
        "{}",
        done.out
    );
    let after = place.json("p.json");
    assert_eq!((&after["enough"], &after["measured_poses"]), (&true.into(), &40.into()));
    assert!(number(&after, "tool_mm") < 0.1 * number(&first, "tool_mm"));
    assert!(number(&after, "tool_with_ten_more_mm") < number(&after, "tool_mm"));
    assert_eq!(plan(&place, &[&goes_on[..], &["0.0000001"]].concat())["enough"], false);
}

#[test]
fn a_check_lets_a_sound_robot_pass_and_names_the_joint_that_moved() {
    let place = Place::new();
    let begin = [&["--model", CALIBRATED, "--check", "--targets-known"], &SETUP[..]].concat();
    let chosen = plan(&place, &[&begin[..], &["--out", "d"]].concat());
    assert_eq!(chosen["poses"].as_array().map(Vec::len), Some(10));
    let detectable = chosen["detectable"].as_array().expect("detectable").iter();
    let third =
        detectable.clone().find(|d| d["damage"] == "joint 3 has a zero offset").expect("joint 3");
    assert!(number(third, "least") < 1.0, "{third}");
    let sound = model(CALIBRATED);
    measure(&place, "d", &sound, false, 1.0);
    let judged = place.succeed(&["plan", "--check", "--model", CALIBRATED, "d/seen.csv"]);
    assert!(judged.out.contains("still holds"), "{}", judged.out);
    // The fitted measuring frame absorbs whatever happened to the arm in a single pose.
    let one: Vec<String> = place.read("d/seen.csv").lines().take(2).map(str::to_owned).collect();
    place.file("d/one.csv", &(one.join("\n") + "\n"));
    place.file("d/one.toml", &place.read("d/seen.toml"));
    let blind = place.run(&["plan", "--check", "--model", CALIBRATED, "d/one.csv"]);
    assert_eq!(blind.code, Some(1), "{blind:?}");
    assert!(blind.out.contains("not judged") && !blind.out.contains("still holds"), "{blind:?}");
    let mut bent = sound;
    let given: &[(&str, &[f64])] = &[("offset", &[2e-3])];
    bent.push(
        AnyEffect::build("joint_offset", &bent.arm, Some(2), ParameterValues(given))
            .expect("built"),
    )
    .expect("room");
    measure(&place, "d", &bent, false, 1.0);
    let judge = ["plan", "--check", "--model", CALIBRATED, "d/seen.csv"];
    let judged = place.run(&[&judge[..], &["--json", "j.json", "--report", "check.html"]].concat());
    assert_eq!(judged.code, Some(1), "{judged:?}");
    let page = place.read("check.html");
    for part in [
        "the model does not hold",
        "Most likely joint 3 has a zero offset by 2",
        "<b>Figure 1.</b>",
    ] {
        assert!(page.contains(part), "{part} in {page}");
    }
    assert!(judged.out.contains("joint 3 has a zero offset by 2"), "{}", judged.out);
    assert_eq!(
        (&place.json("j.json")["holds"], &place.json("j.json")["is_explained"]),
        (&false.into(), &true.into())
    );
}

#[test]
fn a_check_without_known_targets_says_that_a_bent_tool_does_not_show_and_that_the_noise_is_overstated()
 {
    let place = Place::new();
    let begin = [&["--model", CALIBRATED, "--check", "--out", "d"], &SETUP[..]].concat();
    plan(&place, &begin);
    let mut bent = model(CALIBRATED);
    let given: &[(&str, &[f64])] = &[("shift", &[1e-3, 0.0, 0.0])];
    bent.push(
        AnyEffect::build("tool_offset", &bent.arm, None, ParameterValues(given)).expect("built"),
    )
    .expect("room");
    measure(&place, "d", &bent, false, 0.2);
    let judged = place.succeed(&[
        "plan",
        "--check",
        "--model",
        CALIBRATED,
        "d/seen.csv",
        "--json",
        "j.json",
    ]);
    let result = place.json("j.json");
    assert!(result["unseen"].to_string().contains("the tool was shifted"), "{result:#}");
    assert!(judged.out.contains("not detectable by this check"), "{}", judged.out);
    let scatter = number(&result, "scatter");
    assert!(
        (0.1..1.0).contains(&scatter),
        "a fifth, and what the model is uncertain by: {scatter}"
    );
    assert!(judged.out.contains("noise overstated"), "{}", judged.out);
}

#[test]
fn iso_9283_is_planned_and_evaluated() {
    let place = Place::new();
    let found = plan(
        &place,
        &[
            "--model",
            NOMINAL,
            "--iso9283",
            "--count",
            "30",
            "--frame-known",
            "--target",
            "50,0,100",
            "--targets-known",
            "--out",
            "d",
        ],
    );
    assert_eq!(found["poses"].as_array().map(Vec::len), Some(5));
    // Each joint off by 0.2 mrad: accuracy, not repeatability.
    let mut truth = model(NOMINAL);
    let given: &[(&str, &[f64])] = &[("offset", &[2e-4])];
    truth
        .push(
            AnyEffect::build("joint_offset", &truth.arm, Some(1), ParameterValues(given))
                .expect("built"),
        )
        .expect("room");
    // The list states 0.05 mm: noise of 0.01 mm.
    measure(&place, "d", &truth, true, 0.2);
    let evaluate = ["--model", NOMINAL, "--iso9283", "d/seen.csv", "--report", "iso.html"];
    let found = plan(&place, &evaluate);
    let page = place.read("iso.html");
    assert!(
        page.contains("evaluated by ISO 9283") && page.contains("Accuracy AP, worst"),
        "{page}"
    );
    let poses = found["poses"].as_array().expect("poses");
    assert_eq!(poses.len(), 5);
    for pose in poses {
        assert_eq!(pose["visits"], 30);
        // Mean 1.6 and three deviations of 0.67 each, times the noise per axis.
        let repeatability = number(pose, "repeatability_mm");
        assert!((0.025..0.05).contains(&repeatability), "{pose}");
        assert!((0.05..0.4).contains(&number(pose, "accuracy_mm")), "{pose}");
    }
    assert!(found["distance"].is_object());
    let text = place.read("d/seen.toml").replace("measuring_frame = \"base\"\n", "");
    place.file("d/seen.toml", &text);
    let blind = plan(&place, &["--model", NOMINAL, "--iso9283", "d/seen.csv"]);
    assert!(
        blind["poses"][0]["accuracy_mm"].is_null()
            && blind["poses"][0]["repeatability_mm"].is_number()
    );
}

#[test]
fn the_command_on_the_page_names_a_folder_with_a_blank_as_one_word() {
    let place = Place::new();
    let to = ["--count", "3", "--candidates", "40", "--out", "my poses"];
    place.succeed(&[&["plan", "--seed", "1", "--model", NOMINAL], &to[..]].concat());
    let page = place.read("my poses/plan.html");
    assert!(
        page.contains("<span>&#39;my poses/poses.csv&#39;</span>")
            || page.contains("<span>'my poses/poses.csv'</span>"),
        "{page}"
    );
}

#[test]
fn the_page_of_an_evaluation_is_refused_where_poses_are_planned() {
    let place = Place::new();
    for also in [&["--check"][..], &["--iso9283"], &[]] {
        let plan = ["plan", "--seed", "1", "--model", NOMINAL, "--report", "p.html"];
        let done = place.run(&[&plan[..], also].concat());
        assert_eq!(done.code, Some(2), "{also:?}: {done:?}");
        assert!(!place.path("p.html").exists(), "{also:?}");
    }
}

#[test]
fn an_impossible_plan_is_refused_with_a_remedy() {
    let place = Place::new();
    let refused = |more: &[&str]| {
        let done = place.run(&[&["plan", "--seed", "1"], more].concat());
        assert_eq!(done.code, Some(2), "{done:?}");
        done.err
    };
    assert!(refused(&[]).contains("--model"));
    assert!(refused(&["--model", NOMINAL, "--zone", "9000,0,0,9100,10,10"]).contains("--zone"));
    assert!(refused(&["--model", NOMINAL, "--zone", "1,2,3"]).contains("expected 6 numbers"));
    assert!(
        refused(&["--model", NOMINAL, "--instrument", "90000,0,0"])
            .contains("0 of these can be measured")
    );
    assert!(refused(&["--model", NOMINAL, "--margin-deg", "200"]).contains("--margin-deg"));
    assert!(refused(&["--model", NOMINAL, "--check", "--next"]).contains("--check"));
    let unused = refused(&["--model", NOMINAL, "--mapping", "absent.toml"]);
    assert!(unused.contains("--mapping is for recordings"), "{unused}");
    let endless = refused(&["--model", NOMINAL, "--next", "--worth-mm", "nan"]);
    assert!(endless.contains("0 mm or above"), "{endless}");
    assert!(place.names().is_empty(), "{:?}", place.names());
}
