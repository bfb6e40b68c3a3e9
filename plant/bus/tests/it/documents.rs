//! The commands of docs/plant.md run as written there, and the reference names what there is.

use std::path::PathBuf;
use std::process::Command;

use crate::place::{Folder, HERE, Process, endpoint, plant, until};

fn page(name: &str) -> String {
    std::fs::read_to_string(PathBuf::from(HERE).join("../../docs").join(name)).unwrap()
}

#[test]
fn the_commands_of_the_page_run_as_written() {
    let page = page("plant.md");
    let blocks = page.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next());
    let lines: Vec<&str> =
        blocks.flat_map(str::lines).filter(|line| line.starts_with("trued-plant ")).collect();
    assert!(lines.len() >= 4, "{lines:?}");
    let (folder, address) = (Folder::new(), endpoint());
    let mut bridges = Vec::new();
    for line in lines {
        let line = line.replace("tcp/127.0.0.1:7447", &address);
        let arguments: Vec<&str> = line.split_whitespace().skip(1).collect();
        let command = |arguments: &[&str]| {
            let mut command: Command = plant(arguments);
            command.current_dir(&folder.0).env("TRUED_RUNTIME_DIR", folder.0.join("run"));
            command
        };
        if arguments[0] == "bridge" {
            bridges.push(Process::start(&mut command(&arguments), "ready"));
            continue;
        }
        // No daemon runs here, so that each cell has an alarm.
        until(&line, || {
            (command(&arguments).output().unwrap().status.code() == Some(1)).then_some(())
        });
    }
    assert!(!bridges.is_empty());
}

#[test]
fn the_reference_names_every_option_key_and_setting() {
    let reference = page("reference/plant.md");
    for command in ["bridge", "fleet", "statement", "offer"] {
        let help = plant(&[command, "--help"]).output().unwrap();
        let help = String::from_utf8_lossy(&help.stdout).into_owned();
        let lines = help.lines().filter(|line| line.trim_start().starts_with("--"));
        let options: Vec<&str> = lines.filter_map(|line| line.split_whitespace().next()).collect();
        assert!(options.len() >= 2, "{options:?}");
        for option in options {
            assert!(reference.contains(&format!("`{option}`")), "{option}");
        }
    }
    let settings = format!("{:?}", bus::Settings::default());
    for field in settings.split([' ', '{']).filter_map(|token| token.strip_suffix(':')) {
        assert!(reference.contains(&format!("`{field}`")), "{field}");
    }
    let reasons = serde_json::to_value(schemars::schema_for!(bus::acceptance::Reason)).unwrap();
    let reasons = reasons["oneOf"].as_array().unwrap();
    assert_eq!(reasons.len(), 11);
    for reason in reasons.iter().filter_map(|reason| reason["const"].as_str()) {
        assert!(reference.contains(&format!("`{reason}`")), "{reason}");
    }
    for row in bus::sparkplug::metrics::DEVICE.iter().chain(bus::sparkplug::metrics::NODE) {
        assert!(reference.contains(&format!("`{}`", row.name)), "{}", row.name);
    }
    let schemas = [
        schemars::schema_for!(bus::message::Summary),
        schemars::schema_for!(bus::message::CellHealth),
    ];
    for schema in schemas {
        let schema = serde_json::to_value(schema).unwrap();
        for key in schema["properties"].as_object().unwrap().keys() {
            assert!(reference.contains(&format!("`{key}`")), "{key}");
        }
    }
}
