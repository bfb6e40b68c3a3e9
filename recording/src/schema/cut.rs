//! `trued.cut/1`: a cut whose stability is predicted; and the table `[cut]` that recordings share with it.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

use super::Vector;

/// A cut whose stability is predicted, `trued.cut/1` (docs/stability.md). At least one `[[mode]]`, or `taps`.
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("anyOf" = [
    { "required": ["mode"], "properties": { "mode": { "minItems": 1 } } },
    { "required": ["taps"], "properties": { "taps": { "minItems": 1 } } },
]))]
pub(super) struct CutFile {
    /// Name and version of the format.
    #[schemars(extend("const" = "trued.cut/1"))]
    schema: String,
    /// Spindle speed, rev/min.
    #[schemars(range(min = 1.0, max = 1e6))]
    spindle_rpm: f64,
    /// Direction of the feed, in the frame of the modes' directions; any length but 0.
    #[schemars(extend("default" = [1.0, 0.0, 0.0]))]
    feed: Option<Vector>,
    /// Out of the work, against the tool's own z; any length but 0.
    #[schemars(extend("default" = [0.0, 0.0, 1.0]))]
    up: Option<Vector>,
    /// A proposed cut stays below its limit by this share of its depth.
    #[schemars(range(min = 0.0, max = 1.0), extend("default" = 0.1))]
    margin: Option<f64>,
    /// Results of `trued tap --json` with further modes of the cut; relative paths refer to the
    /// folder of this file.
    taps: Option<Vec<String>>,
    /// Cutter, engagement, depth, coefficients.
    cut: Cut,
    /// Modes as the tip of the tool shows them.
    mode: Option<Vec<Mode>>,
    /// What the chart shows.
    chart: Option<Chart>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Mode {
    /// Natural frequency, Hz.
    #[schemars(range(min = 0.1, max = 1e5))]
    frequency_Hz: f64,
    /// Damping ratio.
    #[schemars(range(min = 1e-5, max = 0.99))]
    damping_ratio: f64,
    /// Modal stiffness along the direction, N/µm.
    #[schemars(range(min = 1e-6, max = 1e6))]
    stiffness_N_per_um: f64,
    /// Direction in which the tip moves; any length but 0.
    direction: Vector,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Chart {
    /// Lowest spindle speed, rev/min; default: half the present one.
    #[schemars(range(min = 1.0, max = 1e6))]
    spindle_from_rpm: Option<f64>,
    /// Highest spindle speed, rev/min; default: one and a half times the present one.
    #[schemars(range(min = 1.0, max = 1e6))]
    spindle_to_rpm: Option<f64>,
    /// Largest depth, mm; default: ten times the present one.
    #[schemars(schema_with = "depth")]
    #[serde(default)]
    depth_max_mm: Option<f64>,
    /// Number of spindle speeds.
    #[schemars(range(min = 2, max = 2000), extend("default" = 200))]
    points: Option<u32>,
}

fn depth(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "number", "exclusiveMinimum": 0, "maximum": 1000 })
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Operation {
    Milling,
    Turning,
}

/// A cutter and its engagement. Angles of a tooth from the normal of the feed, with the rotation.
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Cut {
    /// Turning: `teeth = 1`.
    #[schemars(extend("default" = "milling"))]
    operation: Option<Operation>,
    /// Number of teeth.
    #[schemars(range(min = 1, max = 999))]
    teeth: u32,
    /// Diameter of the tool, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    diameter_mm: f64,
    /// Axial depth of cut, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    axial_depth_mm: f64,
    /// Helix angle, degrees.
    #[schemars(range(min = -89.0, max = 89.0), extend("default" = 0.0))]
    helix_deg: Option<f64>,
    /// Angle at which a tooth enters, degrees; below `exit_deg`.
    #[schemars(range(min = -360.0, max = 360.0), extend("default" = 0.0))]
    entry_deg: Option<f64>,
    /// Angle at which a tooth leaves, degrees.
    #[schemars(range(min = -360.0, max = 360.0), extend("default" = 180.0))]
    exit_deg: Option<f64>,
    /// Cutting coefficients, N/mm²: tangential, radial, axial.
    coefficients_N_per_mm2: Vector,
    /// Edge coefficients, N/mm: tangential, radial, axial.
    coefficients_N_per_mm: Vector,
}
