//! The README is correct: its code is the compiled example, its commands are those of CI, its links
//! resolve.

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
            example.lines().any(|shown| shown.trim() == line.trim()),
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
            let is_shown = example.lines().any(|shown| shown.trim() == line.trim());
            assert!(is_shown, "{language}: not in the example: {line}");
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

/// The documents in `docs`, as paths from there.
fn documents() -> Vec<String> {
    let docs = root().join("docs");
    let (mut found, mut folders) = (Vec::new(), vec![docs.clone()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|end| end == "md") {
                found.push(path.strip_prefix(&docs).unwrap().to_string_lossy().into_owned());
            }
        }
    }
    found.sort_unstable();
    found
}

fn links(text: &str) -> Vec<&str> {
    text.split("](").skip(1).filter_map(|rest| rest.split([')', ' ', '\n']).next()).collect()
}

/// The places in a document that a link may lead to: its headings, as GitHub and mdBook name them.
fn anchors(text: &str) -> Vec<String> {
    let mut is_code = false;
    let headings = text.lines().filter(|line| {
        is_code ^= line.starts_with("```");
        !is_code && line.starts_with('#')
    });
    let slug = |heading: &str| {
        let heading = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = heading.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    headings.map(slug).collect()
}

#[test]
fn every_link_leads_to_a_file_and_to_a_heading_in_it() {
    let top = ["README.md", "ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md"];
    let of_docs = documents().into_iter().map(|document| format!("docs/{document}"));
    let mut dead = Vec::new();
    for document in top.map(str::to_owned).into_iter().chain(of_docs) {
        let folder = root().join(&document).parent().unwrap().to_path_buf();
        let text = read(&document);
        for target in links(&text).into_iter().filter(|target| !target.starts_with("http")) {
            let (path, heading) = target.split_once('#').unwrap_or((target, ""));
            let file = if path.is_empty() { root().join(&document) } else { folder.join(path) };
            let leads = file.exists()
                && (heading.is_empty()
                    || anchors(&fs::read_to_string(&file).unwrap())
                        .iter()
                        .any(|anchor| anchor == heading));
            if !leads {
                dead.push(format!("{document}: {target}"));
            }
        }
    }
    assert!(dead.is_empty(), "links to nowhere:\n{}", dead.join("\n"));
}

#[test]
fn the_book_has_every_document_once() {
    let summary = read("docs/SUMMARY.md");
    let mut listed = links(&summary);
    listed.sort_unstable();
    let documents = documents();
    let documents: Vec<&str> =
        documents.iter().map(String::as_str).filter(|one| *one != "SUMMARY.md").collect();
    assert_eq!(listed, documents);
}
