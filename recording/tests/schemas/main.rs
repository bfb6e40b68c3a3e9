//! The JSON Schemas of files: every file and every example in the tree is valid, and a schema
//! refuses nothing that its reader accepts.
//!
//! The validator is the crate `jsonschema`.
#![expect(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test that cannot go on fails, and says what it tried"
)]

mod agreement;
mod mutations;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use jsonschema::{ValidationError, Validator};
use serde_json::Value;

/// A schema and the name of its format in files.
struct Known {
    format: String,
    schema: Value,
    validator: Validator,
}

fn known() -> &'static [Known] {
    static KNOWN: OnceLock<Vec<Known>> = OnceLock::new();
    KNOWN.get_or_init(|| {
        let one = |schema: Value| Known {
            format: schema["properties"]["schema"]["const"].as_str().unwrap().to_owned(),
            validator: jsonschema::validator_for(&schema).unwrap(),
            schema,
        };
        let of_plant =
            concat!(env!("CARGO_MANIFEST_DIR"), "/../plant/bus/schemas/models.schema.json");
        let of_plant = serde_json::from_str(&std::fs::read_to_string(of_plant).unwrap()).unwrap();
        let all = recording::schema::all().into_iter().map(|known| known.schema);
        all.chain([of_plant]).map(one).collect()
    })
}

fn known_as(format: &str) -> &'static Known {
    known()
        .iter()
        .find(|known| known.format == format)
        .unwrap_or_else(|| panic!("no schema of {format}"))
}

/// What is wrong with a file by its schema.
fn faults(format: &str, value: &Value) -> Vec<String> {
    let fault = |error: ValidationError<'_>| format!("{}: {error}", error.instance_path());
    known_as(format).validator.iter_errors(value).map(fault).collect()
}

/// A file of the tree, or a fenced block of a document.
struct Sample {
    name: String,
    format: String,
    value: Value,
}

#[test]
fn every_file_and_every_example_in_the_tree_fits_its_schema() {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut wrong = Vec::new();
    for Sample { name, format, value } in samples() {
        wrong.extend(faults(&format, &value).into_iter().map(|fault| format!("{name}: {fault}")));
        *counts.entry(format).or_default() += 1;
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for known in known() {
        assert!(counts.contains_key(&known.format), "no example of {}: {counts:?}", known.format);
    }
}

#[test]
fn the_complete_examples_name_every_key_of_their_schema() {
    for file in ["deploy/cell.toml", "deploy/bridge-egm.toml", "deploy/bridge-rsi.toml"] {
        // A key without a default may be a comment.
        let text = read(&root().join(file));
        let uncommented = |line: &str| match line.strip_prefix("# ") {
            Some(key) if key.contains(" = ") => key.to_owned(),
            _ => line.to_owned(),
        };
        let text = text.lines().map(uncommented).collect::<Vec<_>>().join("\n");
        let Sample { format, value, .. } = sample(file.to_owned(), &text).unwrap();
        let schema = &known_as(&format).schema;
        let missing = missing_keys(schema, schema, &value);
        assert!(missing.is_empty(), "{file} lacks {missing:?}");
    }
}

/// Keys that `schema`, a part of `root`, lists and `value` lacks.
fn missing_keys(root: &Value, schema: &Value, value: &Value) -> Vec<String> {
    let definition = schema["$ref"].as_str().and_then(|to| root.pointer(to.strip_prefix('#')?));
    let Some(properties) = definition.unwrap_or(schema)["properties"].as_object() else {
        return Vec::new();
    };
    let of_key = |(key, schema): (&String, &Value)| match value.get(key) {
        None => vec![key.clone()],
        Some(value) => {
            let missing = missing_keys(root, schema, value);
            missing.into_iter().map(|below| format!("{key}.{below}")).collect()
        }
    };
    properties.iter().flat_map(of_key).collect()
}

fn samples() -> Vec<Sample> {
    let folders = ["deploy", "deploy/etc", "deploy/presets", "deploy/mappings"];
    let files = folders.iter().flat_map(|folder| files_in(folder));
    let files = files.filter(|path| path.extension().is_some_and(|end| end == "toml"));
    let mut texts: Vec<(String, String)> = files.map(|path| (shown(&path), read(&path))).collect();
    for page in ["docs", "docs/reference", "client/ros2"].iter().flat_map(|folder| files_in(folder))
    {
        if page.extension().is_some_and(|end| end == "md") {
            texts.extend(blocks(&read(&page)).into_iter().map(|block| (shown(&page), block)));
        }
    }
    texts.into_iter().filter_map(|(name, text)| sample(name, &text)).collect()
}

/// None for a block that is no whole file of ours.
fn sample(name: String, text: &str) -> Option<Sample> {
    let has_format = text.lines().any(|line| line.starts_with("schema = \"trued."));
    let table: toml::Table =
        has_format.then(|| text.parse().unwrap_or_else(|why| panic!("{name}: {why}")))?;
    let format = table["schema"].as_str().unwrap().to_owned();
    Some(Sample { name, format, value: serde_json::to_value(table).unwrap() })
}

fn blocks(page: &str) -> Vec<String> {
    let mut lines = page.lines();
    let mut found = Vec::new();
    while let Some(line) = lines.next() {
        if line == "```toml" {
            let block = lines.by_ref().take_while(|line| !line.starts_with("```"));
            found.push(block.map(|line| format!("{line}\n")).collect());
        }
    }
    found
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

fn files_in(folder: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> =
        fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.is_file());
    files.sort();
    files
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap()
}

fn shown(path: &Path) -> String {
    path.strip_prefix(root()).unwrap().display().to_string()
}
