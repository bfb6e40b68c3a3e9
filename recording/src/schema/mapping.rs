//! `trued.mapping/1`: conversion of tables of other programs to recordings.

use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::Value;

use super::one_or_per_joint;
use crate::unit::UNITS;

/// Conversion of a table of another program to a recording, `trued.mapping/1`
/// (docs/reference/mapping.md): `NAME.mapping.toml` in the same folder.
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Mapping {
    /// Name and version of the format.
    #[schemars(extend("const" = "trued.mapping/1"))]
    schema: String,
    /// How many joints `*` runs over; default: the length of a list or of `order`.
    #[schemars(range(min = 1, max = 16))]
    joints: Option<u32>,
    /// Separator of the columns; default: detected from the first line.
    #[schemars(extend("enum" = [",", ";", "tab", "space", "|"]))]
    separator: Option<String>,
    /// Decimal mark; default: detected from the numbers.
    #[schemars(extend("enum" = [".", ","]))]
    decimal: Option<String>,
    /// What groups thousands, not the decimal mark; default: none.
    #[schemars(extend("enum" = [".", ",", "space", "'"]))]
    thousands: Option<String>,
    /// The line below the header holds units; default: if all of its cells are units.
    units_row: Option<bool>,
    /// Lines that begin with this ASCII character are skipped.
    #[schemars(length(equal = 1))]
    comment: Option<String>,
    /// Lines before the header.
    #[schemars(range(min = 0, max = 99_999), extend("default" = 0))]
    skip_rows: Option<u32>,
    /// false: columns are named by their numbers, from 1.
    #[schemars(extend("default" = true))]
    header: Option<bool>,
    /// Only rows in which the column has one of these texts are kept.
    keep: Option<BTreeMap<String, Vec<String>>>,
    /// `drop`: rows whose time does not increase are left out and counted.
    #[schemars(extend("enum" = ["fault", "drop"], "default" = "fault"))]
    repeated_time: Option<String>,
    /// Columns of a recording, each with its source; `*` in a name stands for the joint's number.
    /// Without this table the names in the header are used.
    #[schemars(schema_with = "columns")]
    #[serde(default)]
    columns: Option<Value>,
    /// Content of `NAME.toml`; an existing `NAME.toml` replaces all of it.
    #[schemars(schema_with = "super::recording::table")]
    #[serde(default)]
    recording: Option<Value>,
}

fn columns(generator: &mut SchemaGenerator) -> Schema {
    let time = with_format(generator);
    let orientation = generator.subschema_for::<Orientation>();
    let column = generator.subschema_for::<Column>();
    json_schema!({
        "type": "object",
        "properties": { "t_s": time, "orientation": orientation },
        "additionalProperties": column,
    })
}

/// Time may be written as a date or a time of the day.
fn with_format(generator: &mut SchemaGenerator) -> Schema {
    let mut schema = Column::json_schema(generator);
    if let Some(Value::Object(properties)) =
        schema.as_object_mut().and_then(|object| object.get_mut("properties"))
    {
        let format = json_schema!({
            "type": "string",
            "description": "How a date or time is written, as `%d.%m.%Y %H:%M:%S`; takes the place of `unit`.",
        });
        properties.insert("format".to_owned(), format.to_value());
    }
    schema
}

/// Source of a column: exactly one of `from`, `constant`, `per_row`.
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["from"] }, { "required": ["constant"] }, { "required": ["per_row"] }]))]
struct Column {
    /// Source column, by name or by number from 1; a list: one per joint, or with `labels`, `sum`
    /// or `format` several for one. `*` is the joint's number.
    #[schemars(schema_with = "names")]
    #[serde(default)]
    from: Option<Value>,
    /// The same number in each row.
    constant: Option<f64>,
    /// The row's number, from 0, times this factor.
    per_row: Option<f64>,
    /// Their unit; default: that of our name.
    #[schemars(schema_with = "unit")]
    #[serde(default)]
    unit: Option<String>,
    /// Joint numbers of the source: `[2, 1, 3]`: joint 1 is joint 2 of the source.
    #[schemars(schema_with = "order")]
    #[serde(default)]
    order: Option<Vec<u32>>,
    /// Sense: 1 or -1, or one per joint.
    #[schemars(schema_with = "sign", extend("default" = 1))]
    #[serde(default)]
    sign: Option<Value>,
    /// Value = `scale` · source + `offset`, in the unit of the recording's column: one number, or
    /// one per joint.
    #[schemars(schema_with = "one_or_per_joint", extend("default" = 1.0))]
    #[serde(default)]
    scale: Option<Value>,
    /// See `scale`.
    #[schemars(schema_with = "one_or_per_joint", extend("default" = 0.0))]
    #[serde(default)]
    offset: Option<Value>,
    /// Different texts, or combinations of them, are numbered from 0 in the order in which they appear.
    #[schemars(extend("default" = false))]
    labels: Option<bool>,
    /// The columns are added.
    #[schemars(extend("default" = false))]
    sum: Option<bool>,
    /// The numbers assigned to texts.
    numbers: Option<BTreeMap<String, f64>>,
}

/// An orientation of the tool in the measuring frame.
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("anyOf" = [
    { "required": ["unit"] },
    { "properties": { "convention": { "enum": ["matrix_rows", "matrix_columns", "wxyz", "xyzw"] } } },
]))]
struct Orientation {
    /// Source columns: three angles, three numbers of a rotation vector, nine of a matrix, four of
    /// a quaternion.
    #[schemars(schema_with = "name_list")]
    from: Value,
    /// Angles: a sequence of axes, capitals about the moving ones (`ZYX`: KUKA A B C), small
    /// letters about the fixed ones (`xyz`: roll, pitch, yaw). Or `rotation_vector`, `matrix_rows`,
    /// `matrix_columns`, `wxyz`, `xyzw`.
    #[schemars(regex(
        pattern = "^([XYZ]{3}|[xyz]{3}|rotation_vector|matrix_rows|matrix_columns|wxyz|xyzw)$"
    ))]
    convention: String,
    /// Unit of angles and rotation vectors, required for them.
    #[schemars(extend("enum" = ["deg", "rad", "mrad"]))]
    unit: Option<String>,
}

fn names(generator: &mut SchemaGenerator) -> Schema {
    json_schema!({ "anyOf": [{ "type": ["string", "integer"] }, name_list(generator)] })
}

fn name_list(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "array", "items": { "type": ["string", "integer"] } })
}

fn unit(_: &mut SchemaGenerator) -> Schema {
    let names: Vec<&str> = UNITS.iter().map(|unit| unit.name).collect();
    json_schema!({ "type": "string", "enum": names })
}

fn order(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "array", "items": { "type": "integer", "minimum": 1, "maximum": 999 } })
}

fn sign(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "anyOf": [
        { "enum": [1, -1] },
        { "type": "array", "items": { "enum": [1, -1] }, "minItems": 1 },
    ] })
}
