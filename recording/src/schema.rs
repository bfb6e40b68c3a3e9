//! JSON Schemas (draft 2020-12) of every TOML file that the program reads, for editors and for other programs.
//!
//! A schema describes single keys: type, unit (in the name), range, allowed words, default, and whether a key is required. Relations between keys
//! (order of limits, orthonormal rotations, existing columns) are checked only by the readers: a file refused by a schema is also refused by the reader,
//! but not vice versa. `recording/tests/schemas` compares both.
#![expect(
    dead_code,
    non_snake_case,
    reason = "only the shape of these types is used, and their names are the keys"
)]

mod bridge;
mod cell;
mod cut;
mod effects;
mod manifest;
mod mapping;
mod model;
mod recording;

use schemars::generate::SchemaSettings;
use schemars::transform::{Transform, transform_subschemas};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::{Map, Value};

/// A schema of a file.
#[derive(Debug, Clone)]
pub struct FileSchema {
    /// Name of the schema's file, without `.schema.json`.
    pub file: &'static str,
    /// The schema.
    pub schema: Value,
}

/// The schemas of all files that are read.
#[must_use]
pub fn all() -> Vec<FileSchema> {
    vec![
        of::<bridge::Egm>("bridge-egm"),
        of::<bridge::Rsi>("bridge-rsi"),
        of::<cell::Cell>("cell"),
        of::<cut::CutFile>("cut"),
        of::<manifest::Manifest>("manifest"),
        of::<mapping::Mapping>("mapping"),
        of::<model::Model>("model"),
        of::<recording::Recording>("recording"),
    ]
}

fn of<T: JsonSchema>(file: &'static str) -> FileSchema {
    let settings = SchemaSettings::draft2020_12().with_transform(AsToml);
    let schema = settings.into_generator().into_root_schema_for::<T>();
    FileSchema { file, schema: schema.to_value() }
}

/// Pattern of a number from 1 to 32 in a key: targets, distances, planes, spheres.
const NUMBER: &str = "([1-9]|[12][0-9]|3[0-2])";

/// TOML has no null: an optional key is omitted. A key with `#` represents those with a number in
/// its place.
#[derive(Clone)]
struct AsToml;

impl Transform for AsToml {
    fn transform(&mut self, schema: &mut Schema) {
        transform_subschemas(self, schema);
        let Some(object) = schema.as_object_mut() else { return };
        if let Some(Value::Array(types)) = object.get_mut("type") {
            types.retain(|one| one != "null");
            if let [only] = types.as_slice() {
                let only = only.clone();
                object.insert("type".to_owned(), only);
            }
        }
        if let Some(Value::Array(values)) = object.get_mut("enum") {
            values.retain(|value| !value.is_null());
        }
        without_null(object);
        numbered_keys(object);
        if object.get("default").is_some_and(Value::is_null) {
            object.remove("default");
        }
        // Editors warn about Rust's number formats, which they do not know.
        object.remove("format");
    }
}

/// `anyOf: [X, null]` is X.
fn without_null(object: &mut Map<String, Value>) {
    let Some(Value::Array(forms)) = object.get_mut("anyOf") else { return };
    forms.retain(|form| form.get("type").is_none_or(|kind| kind != "null"));
    if let [Value::Object(only)] = forms.as_slice() {
        let only = only.clone();
        object.remove("anyOf");
        for (key, value) in only {
            object.entry(key).or_insert(value);
        }
    }
}

fn numbered_keys(object: &mut Map<String, Value>) {
    let Some(Value::Object(properties)) = object.get_mut("properties") else { return };
    let keys: Vec<String> = properties.keys().filter(|key| key.contains('#')).cloned().collect();
    let patterns: Map<String, Value> = keys
        .into_iter()
        .filter_map(|key| {
            Some((format!("^{}$", key.replace('#', NUMBER)), properties.remove(&key)?))
        })
        .collect();
    if !patterns.is_empty() {
        object.insert("patternProperties".to_owned(), Value::Object(patterns));
    }
}

/// One number, or a list of one per joint.
fn one_or_per_joint(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "anyOf": [
        { "type": "number" },
        { "type": "array", "items": { "type": "number" }, "minItems": 1, "maxItems": crate::series::JOINTS_MAX },
    ] })
}

/// Three numbers: x, y, z.
type Vector = [f64; 3];
