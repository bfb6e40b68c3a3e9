//! The commands of docs/trends.md run as written there.

use std::path::Path;
use std::process::Command;

use crate::written::{Recorded, backlash, write};

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/trends.md");

/// The commands of the page that call the program.
fn commands(page: &str) -> Vec<Vec<String>> {
    let blocks = page.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next());
    let lines = blocks.flat_map(str::lines).filter(|line| line.starts_with("trued-trends "));
    lines.map(|line| line.split_whitespace().skip(1).map(str::to_owned).collect()).collect()
}

#[test]
fn the_commands_of_the_page_run_as_written() {
    let page = std::fs::read_to_string(PAGE).unwrap();
    let commands = commands(&page);
    assert!(commands.len() >= 3, "{commands:?}");
    let place = crate::written::Folder::new();
    for folder in ["results", "line-1", "line-2"] {
        let folder = place.0.join(folder);
        std::fs::create_dir(&folder).unwrap();
        for day in 0..20 {
            let findings = Some(vec![backlash(0.2 + 0.02 * day as f64)]);
            let recorded = Recorded { robot: "R3", day: Some(day), ambient_c: None, findings };
            let key = format!("{}-{day}", folder.display());
            let other = if folder.ends_with("line-2") { "R4" } else { "R3" };
            write(
                &folder.join(format!("{day}.parquet")),
                &key,
                &Recorded { robot: other, ..recorded },
            );
        }
    }
    for arguments in commands {
        let program = Path::new(env!("CARGO_BIN_EXE_trued-trends"));
        let output = Command::new(program).current_dir(&place.0).args(&arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {output:?}");
    }
}

#[test]
fn the_page_and_the_reference_name_every_option_and_setting() {
    let reference = Path::new(PAGE).with_file_name("reference").join("trends.md");
    let reference = std::fs::read_to_string(reference).unwrap();
    let help = Command::new(env!("CARGO_BIN_EXE_trued-trends")).arg("--help").output().unwrap();
    let help = String::from_utf8_lossy(&help.stdout).into_owned();
    let lines = help.lines().filter(|line| line.trim_start().starts_with('-'));
    let options: Vec<&str> = lines
        .filter_map(|line| line.split_whitespace().find(|token| token.starts_with("--")))
        .collect();
    assert!(options.len() >= 5, "{options:?}");
    for option in options {
        assert!(reference.contains(&format!("`{option}`")), "{option}");
    }
    let settings = format!("{:?}", trends::Settings::default());
    let fields = settings.split([' ', '{']).filter_map(|token| token.strip_suffix(':'));
    for field in fields {
        assert!(reference.contains(&format!("`{field}`")), "{field}");
    }
}
