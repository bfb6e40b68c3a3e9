//! The reference pages: their examples load, and they list every effect with its keys, every code
//! and every schema of the source.

use std::fs;
use std::path::{Path, PathBuf};

use physics::JointKind;
use physics::effects::{CUTTING, DRIVES, OVER_PATHS, SPECS};
use physics::spec::{EffectScope as Belongs, Spec};
use shm_schema::{
    Advice, Answer, CorrectionStatus, Health, InCut, Mode, Operation, Reason, RecorderAction,
    RecorderState, SensorFault, VibrationClass, VibrationState, WatchState, WrenchGate,
};
use tests::clients::root;

use crate::program::Place;

fn page(name: &str) -> String {
    fs::read_to_string(root().join("docs").join(name)).expect(name)
}

/// The files in a page: fenced blocks, each below a line with only the file's name in backticks.
fn files(page: &str) -> Vec<(String, String)> {
    let mut files = Vec::new();
    let mut name = None;
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        if line.starts_with("```") {
            let block = lines.by_ref().take_while(|line| !line.starts_with("```"));
            let text: String = block.map(|line| format!("{line}\n")).collect();
            files.extend(name.take().map(|name| (name, text)));
        } else if !line.is_empty() {
            let quoted = line.strip_prefix('`').and_then(|rest| rest.strip_suffix('`'));
            let is_file = |name: &&str| name.contains('.') && !name.contains(['`', ' ']);
            name = quoted.filter(is_file).map(str::to_owned);
        }
    }
    files
}

#[test]
fn the_examples_of_the_reference_load() {
    let place = Place::new();
    let pages = ["reference/model.md", "reference/recording.md", "reference/mapping.md"];
    let all: Vec<(String, String)> = pages.iter().flat_map(|name| files(&page(name))).collect();
    for (name, text) in &all {
        place.file(name, text);
    }
    let names: Vec<&str> = all.iter().map(|(name, _)| name.as_str()).collect();
    let expected = ["arm.toml", "path.csv", "path.toml", "poses.csv", "poses.toml", "cut.csv"];
    let mapped = ["cut.toml", "tracker.csv", "tracker.mapping.toml"];
    for name in expected.iter().chain(&mapped) {
        assert!(names.contains(name), "{name} among {names:?}");
    }
    let mut arguments = vec!["check", "--json", "all.json"];
    arguments.extend(&names);
    let done = place.succeed(&arguments);
    assert!(done.out.contains("servo_lag of joint 1 is not compensated"), "{}", done.out);
    let notes = place.json("all.json")["files"].to_string();
    assert!(!notes.contains("unused columns"), "every column is one of ours: {notes}");
    place.succeed(&["check", "--model", "arm.toml", "path.csv", "poses.csv", "tracker.csv"]);
    let shown = place.succeed(&["model", "show", "arm.toml", "--json", "arm.json"]);
    assert_eq!(place.json("arm.json")["effects"].as_array().unwrap().len(), 5, "{}", shown.out);
    for name in ["path", "poses", "tracker"] {
        let (out, input) = (format!("{name}-simulated"), format!("{name}.csv"));
        place.succeed(&["simulate", "--seed", "1", "--out", &out, &input]);
    }
}

/// The sections of a page, each from its heading of the third level on.
fn sections(page: &str) -> Vec<&str> {
    page.split("\n### ").skip(1).map(|part| part.split("\n## ").next().unwrap()).collect()
}

#[test]
fn the_reference_names_every_effect_with_all_its_keys() {
    let text = page("reference/effects.md");
    let sections = sections(&text);
    let both = [JointKind::Revolute, JointKind::Prismatic];
    let all: Vec<&Spec> = SPECS.iter().chain(OVER_PATHS).chain(DRIVES).chain(CUTTING).collect();
    for spec in &all {
        let may_slide = matches!(spec.scope, Belongs::Joint | Belongs::JointOrBase);
        let kinds = if may_slide { &both[..] } else { &both[..1] };
        let keys: Vec<String> = kinds
            .iter()
            .flat_map(|kind| spec.parameters.iter().map(|p| format!("`{}`", p.key(*kind))))
            .collect();
        let head = format!("`{}`", spec.kind);
        let with_name = sections.iter().filter(|section| section.starts_with(&head));
        let found =
            with_name.filter(|section| keys.iter().all(|key| section.contains(key))).count();
        assert_eq!(found, 1, "a section {head} with {keys:?}");
    }
    assert_eq!(sections.len(), all.len(), "no section of an effect that the source has not");
}

/// Asserts that the page has each code of these lists with its name, in a table or in a line.
macro_rules! assert_codes {
    ($page:expr, $($list:ty),+ $(,)?) => {
        $(for one in <$list>::ALL {
            let (code, name) = (one.code(), one.name());
            let forms = [format!("| {code} | `{name}` |"), format!(" {code} `{name}`")];
            assert!(forms.iter().any(|form| $page.contains(form)), "{}: {code} {name}", stringify!($list));
        })+
    };
}

#[test]
fn the_reference_has_every_code_with_its_name() {
    let text = page("reference/status.md");
    assert_codes!(
        text,
        CorrectionStatus,
        Reason,
        WrenchGate,
        Health,
        Mode,
        WatchState,
        RecorderState,
        RecorderAction,
        SensorFault,
        VibrationState,
        VibrationClass,
        Advice,
        Operation,
        Answer,
        InCut,
    );
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            sources(&entry, found);
        } else if entry.extension().is_some_and(|ending| ending == "rs") {
            found.push(entry);
        }
    }
}

#[test]
fn the_reference_lists_every_json_that_a_command_writes() {
    let text = page("reference/results.md");
    let mut found = Vec::new();
    sources(&root().join("trued/src/commands"), &mut found);
    let mut count = 0;
    for path in found {
        let source = fs::read_to_string(&path).unwrap();
        for call in
            source.split("console.write(").skip(1).chain(source.split("console.json(").skip(1))
        {
            let Some(schema) = call.split('"').nth(1).filter(|schema| schema.starts_with("trued."))
            else {
                continue;
            };
            assert!(text.contains(&format!("`{schema}`")), "{schema} of {}", path.display());
            count += 1;
        }
    }
    assert!(count >= 18, "{count} calls are found");
}
