//! `trued.manifest/1`: recordings of many robots that are to be diagnosed.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

/// Recordings of many robots for `trued diagnose --batch`, `trued.manifest/1` (docs/reference/batch.md).
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    /// Name and version of the format.
    #[schemars(extend("const" = "trued.manifest/1"))]
    schema: String,
    /// Seed of all chance, of each recording alike.
    #[schemars(range(min = 0, max = 9_223_372_036_854_775_806_u64), extend("default" = 0))]
    seed: Option<u64>,
    /// Torque and motion are compared below this frequency, Hz; default: 40, or a tenth of the sampling rate.
    #[schemars(schema_with = "above_zero")]
    #[serde(default)]
    band_Hz: Option<f64>,
    /// The robots.
    robot: Vec<Robot>,
    /// The recordings, one diagnosis each.
    recording: Vec<Recording>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Robot {
    /// What the plant calls it; each name once.
    #[schemars(length(min = 1))]
    name: String,
    /// The manufacturer's serial number.
    #[schemars(length(min = 1))]
    serial: Option<String>,
    /// A model file, or a preset of `trued model presets`; a relative path counts from the folder of this file.
    #[schemars(length(min = 1))]
    model: String,
    /// Mapping for tables of other programs, for all recordings of the robot; default:
    /// `NAME.mapping.toml` in the folder of each recording.
    #[schemars(length(min = 1))]
    mapping: Option<String>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Recording {
    /// The name of a `[[robot]]`.
    #[schemars(length(min = 1))]
    robot: String,
    /// Files that are diagnosed together; relative paths count from the folder of this file.
    #[schemars(length(min = 1))]
    files: Vec<String>,
    /// When it was recorded: ISO 8601 with its zone, as `2026-03-01T06:30:00Z`.
    recorded_at: Option<String>,
}

fn above_zero(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "number", "exclusiveMinimum": 0 })
}
