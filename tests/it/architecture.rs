//! House rules that a program can check: lengths of functions, dependencies between crates, where
//! `unsafe` is allowed.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

const FUNCTION_LINES_MAX: usize = 70;

/// Allowed dependencies between crates (docs: ARCHITECTURE.md). A crate that is not listed here may
/// depend on all.
const ARROWS: &[(&str, &[&str])] = &[
    ("physics", &[]),
    ("spectrum", &[]),
    ("shm-schema", &[]),
    ("report", &[]),
    ("envelope", &[]),
    ("corrector", &["physics", "envelope"]),
    ("recording", &["physics"]),
    ("world", &["physics", "recording", "spectrum"]),
    ("diagnosis", &["world", "recording", "spectrum", "report", "physics"]),
    ("diagnosis-report", &["diagnosis", "recording", "report", "spectrum", "physics"]),
    ("spectrum-report", &["spectrum", "recording", "report", "physics", "world"]),
    ("challenge-report", &["challenge", "diagnosis", "world", "recording", "report", "physics"]),
    ("batch", &["recording"]),
    ("joint-dynamics", &["recording", "physics"]),
    ("feedforward", &["joint-dynamics", "diagnosis", "world", "recording", "physics", "envelope"]),
    ("client", &["shm-schema", "envelope"]),
    ("client/c", &["client", "shm-schema"]),
    // Of `physics` only the controller's geometry: the effect of a joint correction on the tool.
    ("bridge", &["client", "recording", "physics"]),
    (
        "daemon",
        &[
            "corrector",
            "joint-dynamics",
            "physics",
            "envelope",
            "spectrum",
            "recording",
            "shm-schema",
        ],
    ),
    // Of `daemon` only its states as messages of a recording.
    ("live", &["client", "shm-schema", "recording", "physics", "daemon", "report"]),
    ("challenge", &[]),
    // Of `daemon` only the real-time settings of a thread, so that everything compared has the same ones.
    ("harness", &["client", "shm-schema", "daemon", "report"]),
    // Of `harness` only child processes that end with their handle.
    (
        "demo-report",
        &[
            "diagnosis-report",
            "diagnosis",
            "world",
            "client",
            "shm-schema",
            "harness",
            "recording",
            "report",
            "physics",
        ],
    ),
    // Of `harness` only child processes that end with their handle.
    (
        "correction-report",
        &[
            "feedforward",
            "joint-dynamics",
            "corrector",
            "daemon",
            "client",
            "shm-schema",
            "harness",
            "recording",
            "report",
            "physics",
        ],
    ),
    ("xtask", &["report", "trued"]),
];

#[test]
fn crates_name_only_whom_they_may() {
    let house = folders_of_packages();
    let mut faults = Vec::new();
    for (folder, may_name) in ARROWS {
        for named in dependencies(folder) {
            let Some(target) = house.get(&named) else { continue };
            if !may_name.contains(&target.as_str()) {
                faults.push(format!("{folder} names {target}"));
            }
        }
    }
    for folder in house.values() {
        // Man pages are generated from the program's own command line.
        let others = ["trued", "tests", "xtask"].contains(&folder.as_str());
        if !others && dependencies(folder).iter().any(|d| d == "trued" || d == "tests") {
            faults.push(format!("{folder} names trued or tests, which nothing may"));
        }
    }
    assert!(faults.is_empty(), "arrows against the plan:\n{}", faults.join("\n"));
}

#[test]
fn the_harness_has_no_correction_of_its_own() {
    let faults = named_besides("harness/", "daemon::", &["realtime", "pacer::sleep_until"]);
    assert!(
        faults.is_empty(),
        "of the daemon, more than real-time settings:\n{}",
        faults.join("\n")
    );
}

#[test]
fn reports_take_of_the_harness_its_child_processes_alone() {
    let faults = ["demo-report/", "correction-report/"]
        .map(|folder| named_besides(folder, "harness::", &["child"]))
        .concat();
    assert!(faults.is_empty(), "of the harness, more than child processes:\n{}", faults.join("\n"));
}

/// Names below `module` in the sources of `folder` that do not begin with one of `may`.
fn named_besides(folder: &str, module: &str, may: &[&str]) -> Vec<String> {
    let mut faults = Vec::new();
    for path in sources().filter(|path| shown(path).starts_with(folder)) {
        let text = fs::read_to_string(&path).unwrap();
        // Not the end of a longer name, as in `measured_daemon::`.
        let is_whole = |start: usize| {
            !text[..start].ends_with(|before: char| before.is_alphanumeric() || before == '_')
        };
        let named = text.match_indices(module).filter(|(start, _)| is_whole(*start));
        let named = named.map(|(start, _)| &text[start + module.len()..]);
        let named = named.filter(|rest| !may.iter().any(|may| rest.starts_with(may)));
        let first_line = |rest: &str| rest.lines().next().unwrap_or_default().to_owned();
        faults.extend(named.map(|rest| format!("{}: {module}{}", shown(&path), first_line(rest))));
    }
    faults
}

#[test]
fn functions_fit_on_a_screen() {
    let mut faults = Vec::new();
    for path in sources() {
        let text = fs::read_to_string(&path).unwrap();
        let file = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", shown(&path)));
        let mut long = LongFunctions { path: shown(&path), found: Vec::new() };
        long.visit_file(&file);
        faults.extend(long.found);
    }
    assert!(faults.is_empty(), "longer than a screen:\n{}", faults.join("\n"));
}

#[test]
fn every_file_has_a_header() {
    let faults: Vec<_> = sources()
        .filter(|path| !fs::read_to_string(path).unwrap().trim_start().starts_with("//!"))
        .map(|path| shown(&path))
        .collect();
    assert!(faults.is_empty(), "without a module header:\n{}", faults.join("\n"));
}

#[test]
fn unsafe_is_only_in_shm_schema_and_at_the_border_to_c() {
    let allowed = ["shm-schema/", "client/c/"];
    let faults: Vec<_> = sources()
        .filter(|path| !allowed.iter().any(|folder| shown(path).starts_with(folder)))
        .filter(|path| {
            let file = syn::parse_file(&fs::read_to_string(path).unwrap()).unwrap();
            let mut finder = Unsafe { found: false };
            finder.visit_file(&file);
            finder.found
        })
        .map(|path| shown(&path))
        .collect();
    assert!(faults.is_empty(), "unsafe outside {allowed:?}:\n{}", faults.join("\n"));
}

#[test]
fn the_crates_that_compute_know_no_clock_no_file_and_no_thread() {
    let forbidden = ["std::time", "std::fs", "std::net", "std::thread", "std::process", "std::env"];
    let mut faults = Vec::new();
    for path in sources() {
        let shown = shown(&path);
        let computes = ["physics/src", "envelope/src", "corrector/src", "spectrum/src"];
        if !computes.iter().any(|folder| shown.starts_with(folder)) || is_test_code(&shown) {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        faults.extend(
            forbidden.iter().filter(|f| code.contains(*f)).map(|f| format!("{shown}: {f}")),
        );
    }
    assert!(faults.is_empty(), "computing crates reach outside:\n{}", faults.join("\n"));
}

/// A caller of a library cannot act on an option of the command line: `recording::faults::Setting` names what it stands for.
#[test]
fn no_message_of_a_reader_names_an_option_of_the_command_line() {
    let mut faults = Vec::new();
    for path in sources() {
        let shown = shown(&path);
        let is_library = ["recording/src", "batch/src"].iter().any(|of| shown.starts_with(of));
        if !is_library || is_test_code(&shown) {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        let names_option = |line: &str| {
            let (_, literal) = line.split_once('"').unwrap_or_default();
            let mut after = literal.split("--").skip(1);
            after.any(|rest| rest.starts_with(|c: char| c.is_ascii_lowercase()))
        };
        let is_code =
            |line: &&str| !line.trim_start().starts_with("//") && !line.contains("`trued ");
        let found = code.lines().filter(is_code).filter(|line| names_option(line));
        faults.extend(found.map(|line| format!("{shown}: {}", line.trim())));
    }
    assert!(faults.is_empty(), "options in messages of libraries:\n{}", faults.join("\n"));
}

/// Defaults in help texts come from the settings, so that they cannot differ from what is done.
#[test]
fn no_help_text_has_a_default_typed_by_hand() {
    // The band of `diagnose` depends on the recording, its first number is private to the diagnosis; radii depend on the arm, and a test of their options
    // holds their parts of its length.
    let allowed = ["[default: 40, or a tenth of the sampling rate]", "% of the arm's length"];
    let mut faults = Vec::new();
    for path in sources().filter(|path| shown(path).starts_with("trued/src")) {
        let text = fs::read_to_string(&path).unwrap();
        let typed = |line: &&str| {
            let is_doc = line.trim_start().starts_with("///");
            let states = line.contains("[default:")
                || line
                    .split("default ")
                    .skip(1)
                    .any(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
            is_doc && states && !allowed.iter().any(|allowed| line.contains(allowed))
        };
        let lines = text.lines().filter(typed);
        faults.extend(lines.map(|line| format!("{}: {}", shown(&path), line.trim())));
    }
    assert!(faults.is_empty(), "defaults typed by hand:\n{}", faults.join("\n"));
}

fn is_test_code(shown: &str) -> bool {
    shown.ends_with("tests.rs") || shown.contains("/tests/") || shown.ends_with("conformance.rs")
}

struct LongFunctions {
    path: String,
    found: Vec<String>,
}

impl LongFunctions {
    fn check(&mut self, name: &syn::Ident, span: proc_macro2::Span) {
        let lines = span.end().line + 1 - span.start().line;
        if lines > FUNCTION_LINES_MAX {
            self.found.push(format!("{}: fn {name} has {lines} lines", self.path));
        }
    }
}

impl<'ast> Visit<'ast> for LongFunctions {
    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        self.check(&item.sig.ident, item.sig.span().join(item.block.span()).unwrap_or(item.span()));
        visit::visit_item_fn(self, item);
    }
    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        self.check(&item.sig.ident, item.sig.span().join(item.block.span()).unwrap_or(item.span()));
        visit::visit_impl_item_fn(self, item);
    }
}

struct Unsafe {
    found: bool,
}

impl<'ast> Visit<'ast> for Unsafe {
    fn visit_expr_unsafe(&mut self, _: &'ast syn::ExprUnsafe) {
        self.found = true;
    }
    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        self.found |= item.unsafety.is_some();
        visit::visit_item_impl(self, item);
    }
    fn visit_signature(&mut self, signature: &'ast syn::Signature) {
        self.found |= signature.unsafety.is_some();
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_path_buf()
}

fn shown(path: &Path) -> String {
    path.strip_prefix(root()).unwrap().display().to_string()
}

/// Package name → folder, for every member of the workspace.
fn folders_of_packages() -> BTreeMap<String, String> {
    let workspace = manifest(&root());
    let members = workspace["workspace"]["members"].as_array().unwrap().clone();
    let folder = |member: &toml::Value| member.as_str().unwrap().to_owned();
    members
        .iter()
        .map(folder)
        .map(|f| (manifest(&root().join(&f))["package"]["name"].as_str().unwrap().to_owned(), f))
        .collect()
}

fn dependencies(folder: &str) -> Vec<String> {
    let manifest = manifest(&root().join(folder));
    let table = manifest.get("dependencies").and_then(toml::Value::as_table);
    table.map(|t| t.keys().cloned().collect()).unwrap_or_default()
}

fn manifest(folder: &Path) -> toml::Table {
    let text = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
    toml::from_str(&text).unwrap()
}

/// Every Rust source of the workspace's members.
fn sources() -> impl Iterator<Item = PathBuf> {
    let mut found = Vec::new();
    let mut folders: Vec<PathBuf> =
        folders_of_packages().values().map(|f| root().join(f)).collect();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()) {
            if entry.is_dir() && !entry.ends_with("target") {
                folders.push(entry);
            } else if entry.extension().is_some_and(|e| e == "rs") {
                found.push(entry);
            }
        }
    }
    found.sort();
    // A member may stand in another's folder.
    found.dedup();
    found.into_iter()
}
