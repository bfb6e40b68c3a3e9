//! `trued stability`: the worked example of the documents, modes of tap tests, refused input.

use crate::program::Place;
use std::fs;
use tests::clients::root;

/// The blocks of a language in the page of the command.
pub(crate) fn blocks(language: &str) -> Vec<String> {
    let page = fs::read_to_string(root().join("docs/stability.md")).unwrap();
    let start = format!("```{language}\n");
    let blocks = page.split(&start).skip(1);
    blocks.map(|rest| rest.split("```").next().unwrap().to_owned()).collect()
}

/// A folder with the example's `cut.toml`.
fn example() -> Place {
    let place = Place::new();
    place.file("cut.toml", &blocks("toml")[0]);
    place
}

#[test]
fn the_worked_example_matches_the_page() {
    let place = example();
    let commands = blocks("sh");
    let arguments: Vec<&str> = commands[0].split_whitespace().skip(1).collect();
    let done = place.run(&arguments);
    assert_eq!(done.code, Some(1), "the example is not stable: {done:#?}");
    let shown: Vec<String> = blocks("text")[0].lines().map(str::to_owned).collect();
    let lines: Vec<String> = done.out.lines().map(str::to_owned).collect();
    assert_eq!(lines, shown);
    assert!(lines.iter().all(|line| line.chars().count() <= 80), "{lines:#?}");
    place.succeed(&["check", "cut.toml"]);
    let page = place.read("stability.html");
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    roxmltree::Document::parse_with_options(&page, options).unwrap();
    assert!(page.contains("semi-discretisation") && page.contains("nearest stable cuts"));
}

#[test]
fn each_cut_that_is_proposed_is_stable() {
    let place = example();
    let text = place.read("cut.toml");
    place.run(&["stability", "cut.toml", "--json", "s.json"]);
    let result = place.json("s.json");
    assert_eq!(
        (&result["schema"], &result["stable"]),
        (&"trued.stability/1".into(), &false.into())
    );
    let nearest = &result["nearest"];
    let feed: Vec<String> = nearest["direction"]["feed"]
        .as_array()
        .unwrap()
        .iter()
        .map(|x| format!("{:?}", x.as_f64().unwrap()))
        .collect();
    let depth = format!("axial_depth_mm = {:?}", nearest["depth_mm"].as_f64().unwrap());
    let speed = format!("spindle_rpm = {:?}", nearest["spindle_rpm"].as_f64().unwrap());
    let feed = format!("feed = [{}]", feed.join(", "));
    let line = |key: &str| text.lines().find(|line| line.starts_with(key)).unwrap().to_owned();
    for (key, new) in [("axial_depth_mm", depth), ("spindle_rpm", speed), ("feed", feed)] {
        place.file("other.toml", &text.replace(&line(key), &new));
        let done = place.run(&["stability", "other.toml", "--json", "o.json"]);
        assert_eq!(done.code, Some(0), "{new}: {}", done.out);
        let limit = place.json("o.json")["limit_mm"].as_f64().unwrap_or(f64::INFINITY);
        let depth = place.json("o.json")["cut"]["depth_mm"].as_f64().unwrap();
        assert!(limit > 1.095 * depth, "{new}: {depth} mm below {limit} mm");
    }
}

#[test]
fn modes_of_a_tap_test_are_taken_and_one_without_direction_is_refused() {
    let place = example();
    let text = place.read("cut.toml");
    let head = text.split("[[mode]]").next().unwrap();
    place.file("tapped.toml", &format!("taps = [\"tap.json\"]\n{head}"));
    let tap = |direction: &str| {
        format!(
            r#"{{"schema": "trued.tap/1", "modes": [{{"frequency_Hz": 67.0, "sigma_frequency_Hz": 0.1, "damping_ratio": 0.02, "verified": false,
            "direction": {direction}, "clearest": {{"modal_stiffness_N_per_um": 1.5}}}}]}}"#
        )
    };
    place.file("tap.json", &tap("null"));
    let done = place.run(&["stability", "tapped.toml"]);
    assert!(done.code == Some(2) && done.err.contains("--direction"), "{done:#?}");
    place.file("tap.json", &tap("[0.0, 1.0, 0.0]"));
    let done = place.run(&["stability", "tapped.toml", "--json", "s.json"]);
    assert!(done.err.contains("the mode at 67.0 Hz is unverified"), "{done:#?}");
    let mode = &place.json("s.json")["modes"][0];
    assert_eq!(mode["stiffness_N_per_um"], 1.5);
    assert!(mode["tap"].as_str().unwrap().ends_with("tap.json"));
}

#[test]
fn where_a_recorded_cut_chatters_the_prediction_stands_beside_the_advice() {
    let place = example();
    place.file("run.csv", &crate::spectrum::tones(2000.0).csv());
    let process = ["--spindle-rpm", "2400", "--teeth", "2", "--model", "irb1600-6-145-thesis"];
    let run = |more: &[&str]| {
        let all = [&["spectrum", "run.csv", "--json", "s.json"], &process[..], more].concat();
        (place.succeed(&all).out, place.json("s.json"))
    };
    let (_, without) = run(&[]);
    let (output, with) = run(&["--cut", "cut.toml"]);
    assert!(with["episodes"].to_string().contains("\"class\":\"chatter\""), "{output}");
    assert_eq!(without["nearest_stable"].as_array().unwrap().len(), 0);
    let nearest = with["nearest_stable"].to_string();
    assert!(nearest.contains("not stable") && nearest.contains("rpm at this depth"), "{nearest}");
    assert!(output.contains("By modes and cutter: predicted not stable"), "{output}");
}

#[test]
fn an_invalid_cut_is_refused_with_every_fault() {
    let place = example();
    let text = place.read("cut.toml");
    place.file(
        "bad.toml",
        &text.replace("damping_ratio", "dampingratio").replace("teeth = ", "teeth = -"),
    );
    let done = place.run(&["stability", "bad.toml"]);
    assert_eq!(done.code, Some(2), "{done:#?}");
    assert!(
        done.err.contains("did you mean `damping_ratio`?") && done.err.contains("teeth"),
        "{done:#?}"
    );
    for (from, to, words) in [
        ("axial_depth_mm = 0.6", "axial_depth_mm = 1e6", "at most 1000 mm"),
        ("[800.0, 300.0, 150.0]", "[-800.0, 300.0, 150.0]", "the tangential one above 0"),
        ("entry_deg = 90.0", "entry_deg = -200.0", "at most a full turn, 360°"),
    ] {
        place.file("wrong.toml", &text.replace(from, to));
        let done = place.run(&["stability", "wrong.toml"]);
        assert!(done.code == Some(2) && done.err.contains(words), "{words}: {done:#?}");
    }
    place.file("flat.toml", &format!("up = [0.0, 1.0, 0.0]\n{text}"));
    let done = place.run(&["stability", "flat.toml"]);
    assert!(done.code == Some(2) && done.err.contains("parallel"), "{done:#?}");
    place.file("skew.toml", &format!("up = [0.0, 0.5, 1.0]\n{text}"));
    let done = place.run(&["stability", "skew.toml"]);
    assert!(done.code == Some(2) && done.err.contains("63.4° apart"), "{done:#?}");
}
