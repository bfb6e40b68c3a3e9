//! The table of `docs/faults.md` names existing tests that are run.

use std::fs;
use std::path::Path;
use tests::clients::root;

fn sources(folder: &Path, text: &mut String) {
    for entry in fs::read_dir(folder).unwrap().flatten().map(|entry| entry.path()) {
        if entry.is_dir() && !entry.ends_with("target") {
            sources(&entry, text);
        } else if entry.extension().is_some_and(|e| e == "rs") {
            text.push_str(&fs::read_to_string(entry).unwrap());
        }
    }
}

/// Whether that function is a test: `#[test]` is above it, with only attributes and comments
/// between.
fn is_test(code: &str, name: &str) -> bool {
    let head = format!("fn {name}(");
    let mut above = code.lines().collect::<Vec<_>>().into_iter().rev();
    let is_of_it = |line: &&str| {
        let line = line.trim_start();
        line.starts_with("#[") || line.starts_with("//")
    };
    while above.any(|line| line.trim_start().starts_with(&head)) {
        if above.clone().take_while(is_of_it).any(|line| line.trim() == "#[test]") {
            return true;
        }
    }
    false
}

#[test]
fn a_function_that_is_no_test_holds_nothing() {
    let code = "#[test]\nfn held() {}\n// not any more: #[test]\nfn helper() {}\n\n#[test]\n#[cfg(x)]\n/// Words.\nfn also() {}\n";
    assert_eq!(
        ["held", "helper", "also", "gone"].map(|name| is_test(code, name)),
        [true, false, true, false]
    );
}

#[test]
fn every_fault_in_the_table_names_a_test_that_holds_it() {
    let mut code = String::new();
    for folder in ["tests", "corrector", "shm-schema", "client", "daemon", "envelope", "recording"]
    {
        sources(&root().join(folder), &mut code);
    }
    let page = fs::read_to_string(root().join("docs/faults.md")).unwrap();
    let head = |row: &str| row.starts_with("| fault") || row.starts_with("| ---");
    let rows: Vec<&str> =
        page.lines().filter(|line| line.starts_with("| ") && !head(line)).collect();
    assert!(rows.len() > 25, "{} rows", rows.len());
    let lacking: Vec<&str> = rows
        .into_iter()
        .filter(|row| {
            let held_by = row.trim_end_matches(" |").rsplit(" | ").next().unwrap_or_default();
            let mut names = held_by.split('`').skip(1).step_by(2).peekable();
            names.peek().is_none() || !names.all(|name| is_test(&code, name))
        })
        .collect();
    assert!(lacking.is_empty(), "no test of that name:\n{}", lacking.join("\n"));
}
