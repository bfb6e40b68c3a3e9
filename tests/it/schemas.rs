//! The JSON Schemas under `schemas/`: they match the source, and results match them.
//!
//! Results are checked after every command that any test runs: `Place::run`. The validator is the
//! crate `jsonschema`. Schemas of files are compared with their readers in
//! `recording/tests/schemas`.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use jsonschema::Validator;
use serde_json::Value;
use tests::clients::root;

use crate::program::Place;

/// A schema and the name of its format in files.
struct Known {
    place: PathBuf,
    format: Option<String>,
    validator: Validator,
}

fn known() -> &'static [Known] {
    static KNOWN: OnceLock<Vec<Known>> = OnceLock::new();
    KNOWN.get_or_init(|| {
        let one = |(place, schema): (PathBuf, Value)| Known {
            place,
            format: schema["properties"]["schema"]["const"].as_str().map(str::to_owned),
            validator: jsonschema::validator_for(&schema).unwrap(),
        };
        trued::schemas::all().into_iter().map(one).collect()
    })
}

/// Errors of a value by its own schema, or by the nearest of those with the same format; empty if
/// it fits one.
fn faults(value: &Value) -> Vec<String> {
    let format = value["schema"].as_str();
    let is_of = |known: &&Known| {
        known.place.starts_with("results") && format.is_some() && known.format.as_deref() == format
    };
    let of_schema = |known: &Known| -> Vec<String> {
        let fault = |error: jsonschema::ValidationError<'_>| {
            format!("{}: {}: {error}", known.place.display(), error.instance_path())
        };
        known.validator.iter_errors(value).map(fault).collect()
    };
    let found: Vec<Vec<String>> = known().iter().filter(is_of).map(of_schema).collect();
    let nearest = found.into_iter().min_by_key(Vec::len);
    nearest.unwrap_or_else(|| vec![format!("no schema for the format {format:?}")])
}

/// Asserts that a result of the program fits its schema.
pub(crate) fn assert_result_fits(text: &str, command: &[&str]) {
    let value: Value = serde_json::from_str(text).expect("JSON");
    let faults = faults(&value);
    assert!(faults.is_empty(), "{command:?}:\n{}", faults.join("\n"));
}

#[test]
fn the_schemas_in_the_tree_are_those_of_the_source() {
    let folder = root().join("schemas");
    let mut stale = Vec::new();
    let mut expected = Vec::new();
    for (place, schema) in trued::schemas::all() {
        let path = folder.join(place);
        if fs::read_to_string(&path).unwrap_or_default() != format!("{schema:#}\n") {
            stale.push(path.display().to_string());
        }
        expected.push(path);
    }
    let found = [folder.clone(), folder.join("results")];
    let found = found.iter().flat_map(|folder| files_in(folder));
    let left = found.filter(|path| !expected.contains(path));
    stale.extend(left.map(|path| path.display().to_string()));
    assert!(stale.is_empty(), "write them anew with `cargo xtask schemas`:\n{}", stale.join("\n"));
}

#[test]
fn every_schema_is_a_schema_of_its_draft() {
    for (place, schema) in trued::schemas::all() {
        assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
        if let Err(error) = jsonschema::meta::validate(&schema) {
            panic!("{}: {error}", place.display());
        }
    }
}

#[test]
fn the_reference_names_every_schema() {
    let text = fs::read_to_string(root().join("docs/reference/schemas.md")).unwrap();
    for known in known() {
        let name = format!("`{}`", known.place.display());
        assert!(text.contains(&name), "docs/reference/schemas.md lacks {name}");
    }
}

#[test]
fn a_result_that_lacks_a_key_or_has_a_wrong_type_does_not_fit() {
    let place = Place::new();
    let json = place.succeed(&["model", "show", "fr3", "--json", "-", "-q"]).out;
    let good: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(faults(&good), Vec::<String>::new());
    let broken = |change: &dyn Fn(&mut Value)| {
        let mut value = good.clone();
        change(&mut value);
        !faults(&value).is_empty()
    };
    assert!(broken(&|value| drop(value.as_object_mut().unwrap().remove("hash"))));
    assert!(broken(&|value| value["joints"][0]["limits"] = 3.into()));
    assert!(broken(&|value| value["schema"] = "trued.model/2".into()));
}

fn files_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.is_file());
    files.sort();
    files
}
