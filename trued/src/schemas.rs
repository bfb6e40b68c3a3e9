//! JSON Schemas (draft 2020-12) of every input file and every JSON result.
//!
//! A result is valid for its schema. A result may get additional keys without a new format name:
//! readers ignore unknown keys. Non-finite numbers are `null`.

use std::path::PathBuf;

use schemars::generate::SchemaSettings;
use schemars::transform::{Transform, transform_subschemas};
use schemars::{JsonSchema, Schema};
use serde_json::{Value, json};

use crate::commands;

/// Every schema, with its place under `schemas/`.
#[must_use]
pub fn all() -> Vec<(PathBuf, Value)> {
    let name = |file: &str| format!("{file}.schema.json");
    let files = recording::schema::all().into_iter();
    let files = files.map(|one| (PathBuf::from(name(one.file)), one.schema));
    let results = commands::result_schemas().into_iter();
    let results = results.map(|one| (PathBuf::from("results").join(name(one.file)), one.schema));
    files.chain(results).collect()
}

/// The schema of a command's result.
pub(crate) struct ResultSchema {
    file: &'static str,
    schema: Value,
}

impl ResultSchema {
    /// Of an object that is written under this name of its format.
    pub(crate) fn of<T: JsonSchema>(file: &'static str, format: &str) -> Self {
        let mut one = Self::without_format::<T>(file);
        for key in ["schema", "version"] {
            assert!(one.schema["properties"].get(key).is_none(), "{format} has `{key}` twice");
        }
        let version =
            "Which program wrote it: name, version, and commit where the build stated it.";
        one.schema["properties"]["schema"] = json!({ "const": format });
        one.schema["properties"]["version"] = json!({ "type": "string", "description": version });
        let required = one.schema["required"].as_array().cloned().unwrap_or_default();
        one.schema["required"] =
            [json!("schema"), json!("version")].into_iter().chain(required).collect();
        one.schema["title"] = json!(format);
        one
    }

    /// The schema of a value that does not state its format.
    pub(crate) fn without_format<T: JsonSchema>(file: &'static str) -> Self {
        let settings = SchemaSettings::draft2020_12().for_serialize().with_transform(AsWritten);
        let schema = settings.into_generator().into_root_schema_for::<T>();
        Self { file, schema: schema.to_value() }
    }
}

/// Non-finite numbers are written as null; unknown keys are allowed.
#[derive(Clone)]
struct AsWritten;

impl Transform for AsWritten {
    fn transform(&mut self, schema: &mut Schema) {
        transform_subschemas(self, schema);
        let Some(object) = schema.as_object_mut() else { return };
        // Rust's names of number formats are of no use to others.
        object.remove("format");
        match object.get_mut("type") {
            Some(Value::String(one)) if one == "number" => {
                object.insert("type".to_owned(), json!(["number", "null"]));
            }
            Some(Value::Array(types))
                if types.contains(&json!("number")) && !types.contains(&json!("null")) =>
            {
                types.push(json!("null"));
            }
            _ => {}
        }
    }
}
