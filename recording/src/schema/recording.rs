//! `trued.recording/1`: the TOML of a recording, and the table `[recording]` of a mapping.

use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::Value;

use super::cell::Frame;
use super::cut::Cut;
use super::{NUMBER, Vector};
use crate::series::Channel;

/// Metadata of a recording, `trued.recording/1` (docs/reference/recording.md): `NAME.toml` next to
/// `NAME.csv` or `NAME.parquet`.
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Recording {
    /// Name and version of the format.
    #[schemars(extend("const" = "trued.recording/1"))]
    schema: String,
    /// Model file (relative to this folder) or name of a preset; `--model` takes precedence.
    model: Option<String>,
    /// `path`: motion in time; `poses`: a settled pose in each row.
    #[schemars(extend("default" = "path"))]
    kind: Option<Kind>,
    /// Which joint positions are the input; default: `q` if present, otherwise `qa`.
    input: Option<Input>,
    /// Frame of points, targets and orientation. `unknown`: its six parameters are fitted.
    #[schemars(extend("default" = "unknown"))]
    measuring_frame: Option<MeasuringFrame>,
    /// Axes of the wrench; the moment stays about the TCP. Default: `tool`.
    wrench_frame: Option<Frame>,
    /// Standard uncertainty of columns, by their names, in their units, above 0; default: estimated.
    #[schemars(schema_with = "sigma")]
    #[serde(default)]
    sigma: Option<BTreeMap<String, f64>>,
    /// Source of the direction of the last motion at poses: columns `d1` …, the previous row, or
    /// unknown.
    #[schemars(extend("default" = "unknown"))]
    approach: Option<Approach>,
    /// Nm (N) at the joint per ampere, one per joint up to the last `iN_A`; required with currents.
    torque_per_ampere: Option<Vec<f64>>,
    /// Position of a target in the tool frame, mm; default: fitted.
    #[serde(rename = "target#_mm")]
    target_mm: Option<Vector>,
    /// The target sits on the base (0), or on the link that this joint moves; default: on the tool.
    #[schemars(range(min = 0, max = 15))]
    #[serde(rename = "target#_on_link")]
    target_on_link: Option<u32>,
    /// Rows for validation only: a list of segments, or `"all"`; default: chosen by the command.
    #[schemars(schema_with = "heldout")]
    #[serde(default)]
    heldout: Option<Value>,
    /// The cutter, for the force domain.
    cut: Option<Cut>,
    /// Reference of a distance; parameters that are not stated are fitted.
    #[serde(rename = "distance#")]
    distance: Option<Distance>,
    /// The touch probe; required with touches.
    probe: Option<Probe>,
    /// A touched plane.
    #[serde(rename = "plane#")]
    plane: Option<Plane>,
    /// A touched sphere; parameters that are not stated are fitted.
    #[serde(rename = "sphere#")]
    sphere: Option<Sphere>,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Path,
    Poses,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Input {
    Q,
    Qa,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum MeasuringFrame {
    Unknown,
    Base,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Approach {
    Columns,
    Sequence,
    Unknown,
}

fn sigma(_: &mut SchemaGenerator) -> Schema {
    json_schema!({
        "type": "object",
        "propertyNames": { "pattern": column_names() },
        "additionalProperties": { "type": "number", "exclusiveMinimum": 0 },
    })
}

/// Pattern of the name of a column of samples.
fn column_names() -> String {
    let mut names = Vec::new();
    let mut add = |base: String, channel: Channel| match channel.units() {
        [] => names.push(base),
        units => names.push(format!("{base}_({})", units.join("|"))),
    };
    let of_joint: [fn(usize) -> Channel; 7] = [
        Channel::Command,
        Channel::Motor,
        Channel::Link,
        Channel::Direction,
        Channel::Torque,
        Channel::Current,
        Channel::JointTemperature,
    ];
    for channel in of_joint.map(|channel| channel(0)) {
        add(channel.base().replace('1', "([1-9]|1[0-6])"), channel);
    }
    for channel in
        [Channel::Target(0, 0), Channel::Target(0, 1), Channel::Target(0, 2), Channel::Distance(0)]
    {
        add(channel.base().replace('1', NUMBER), channel);
    }
    let vectors = (0..3).flat_map(|axis| [Channel::Position(axis), Channel::Acceleration(axis)]);
    let wrench = (0..6).map(Channel::Wrench);
    let orientation = (0..4).map(Channel::Orientation);
    let tilt = (0..2).map(Channel::BaseTilt);
    let others = [
        Channel::Ambient,
        Channel::Spindle,
        Channel::Feed,
        Channel::Tacho,
        Channel::TouchPlane,
        Channel::TouchSphere,
        Channel::Station,
    ];
    for channel in vectors.chain(wrench).chain(orientation).chain(tilt).chain(others) {
        add(channel.base(), channel);
    }
    format!("^({})$", names.join("|"))
}

fn heldout(_: &mut SchemaGenerator) -> Schema {
    let segment = json_schema!({ "type": "integer", "minimum": i32::MIN, "maximum": i32::MAX - 1 });
    json_schema!({ "anyOf": [{ "const": "all" }, { "type": "array", "items": segment }] })
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Distance {
    /// Fixed end, base frame, mm; default: fitted.
    anchor_mm: Option<Vector>,
    /// Target at the moving end; default: the TCP.
    #[schemars(range(min = 1, max = 32))]
    target: Option<u32>,
    /// Reading minus distance, mm, or `"fitted"`.
    #[schemars(schema_with = "offset", extend("default" = 0.0))]
    #[serde(default)]
    offset_mm: Option<Value>,
}

fn offset(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "anyOf": [{ "type": "number" }, { "const": "fitted" }] })
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Probe {
    /// Radius of the ball, mm; 0 for a point.
    #[schemars(range(min = 0.0))]
    radius_mm: f64,
    /// Target at the centre of the ball; default: the TCP.
    #[schemars(range(min = 1, max = 32))]
    target: Option<u32>,
    /// Standard uncertainty of a touch, mm; default: estimated.
    #[schemars(extend("exclusiveMinimum" = 0))]
    sigma_mm: Option<f64>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Plane {
    /// Towards the touched side, base frame, not zero; approximate where the plane is fitted.
    normal: Vector,
    /// Along the normal from the base origin, mm: the plane counts as exact; default: the plane is fitted.
    offset_mm: Option<f64>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Sphere {
    /// Centre, base frame, mm; default: fitted.
    centre_mm: Option<Vector>,
    /// Radius, mm; default: fitted.
    #[schemars(extend("exclusiveMinimum" = 0))]
    radius_mm: Option<f64>,
}

/// The same as a table of a mapping: without the name of the format.
pub(super) fn table(generator: &mut SchemaGenerator) -> Schema {
    let mut schema = Recording::json_schema(generator);
    let Some(object) = schema.as_object_mut() else { return schema };
    if let Some(Value::Object(properties)) = object.get_mut("properties") {
        properties.remove("schema");
    }
    object.remove("required");
    schema
}
