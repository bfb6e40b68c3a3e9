//! The README says what is: its code is the compiled example, its commands are the ones that CI runs, its links lead somewhere.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_path_buf()
}

fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap()
}

#[test]
fn the_readmes_code_is_the_compiled_example() {
    let readme = read("README.md");
    let block = readme.split("```rust\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let example = read("client/examples/robot_loop.rs");
    for line in block.lines() {
        assert!(
            example.lines().any(|there| there.trim() == line.trim()),
            "not in the example: {line}"
        );
    }
}

#[test]
fn the_ten_lines_of_every_language_are_those_of_its_example() {
    let text = read("docs/clients.md");
    for (language, example) in [
        ("rust", "client/examples/robot_loop.rs"),
        ("c", "client/c/examples/robot_loop.c"),
        ("cpp", "client/c/examples/robot_loop.cpp"),
        ("python", "client/python/examples/robot_loop.py"),
    ] {
        let start = format!("```{language}\n");
        let block = text.split(&start).nth(1).and_then(|rest| rest.split("```").next()).unwrap();
        assert!(block.lines().count() >= 7, "{language}");
        let example = read(example);
        for line in block.lines() {
            let there = example.lines().any(|there| there.trim() == line.trim());
            assert!(there, "{language}: not in the example: {line}");
        }
    }
}

#[test]
fn ci_runs_the_readmes_commands() {
    let readme = read("README.md");
    for command in ["cargo test --workspace", "cargo run --release -- demo"] {
        assert!(
            readme.lines().any(|line| line == command),
            "{command} stands on no line of its own"
        );
        assert!(read(".ci/run").contains(command), "CI does not look for {command}");
    }
}

#[test]
fn every_link_leads_to_a_file() {
    let documents = [
        "README.md",
        "ARCHITECTURE.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "SECURITY.md",
        "docs/bench.md",
        "docs/cell.md",
        "docs/clients.md",
        "docs/guide.md",
        "docs/install.md",
        "docs/notation.md",
        "docs/reference/README.md",
        "docs/reference/bridge.md",
        "docs/reference/cell.md",
        "docs/reference/effects.md",
        "docs/reference/mapping.md",
        "docs/reference/model.md",
        "docs/reference/recording.md",
        "docs/reference/results.md",
        "docs/reference/schemas.md",
        "docs/reference/status.md",
        "docs/safety.md",
        "docs/stability.md",
        "docs/threat-model.md",
        "docs/vibration.md",
    ];
    let mut dead = Vec::new();
    for document in documents {
        let folder = root().join(document).parent().unwrap().to_path_buf();
        for target in read(document).split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let path = target.split('#').next().unwrap_or_default();
            if !target.starts_with("http") && !path.is_empty() && !folder.join(path).exists() {
                dead.push(format!("{document}: {target}"));
            }
        }
    }
    assert!(dead.is_empty(), "links to nowhere:\n{}", dead.join("\n"));
}
