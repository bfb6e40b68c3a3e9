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
        "docs/bench.md",
        "docs/cell.md",
        "docs/mapping.md",
        "docs/notation.md",
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
