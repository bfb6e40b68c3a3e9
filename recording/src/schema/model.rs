//! `trued.model/1`: a robot, its tool, its natural frequencies, its effects.

use schemars::JsonSchema;
use serde_json::{Map, Value};

use super::Vector;
use super::effects::Effect;

/// A model of one robot, `trued.model/1` (docs/reference/model.md): geometry, tool, natural frequencies, effects. Base frame, zero configuration.
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Model {
    /// Name and version of the format.
    #[schemars(extend("const" = "trued.model/1"))]
    schema: String,
    /// Name for people.
    name: Option<String>,
    /// Gravity in the base frame, m/s².
    #[schemars(extend("default" = [0.0, 0.0, -9.80665]))]
    gravity_m_s2: Option<Vector>,
    /// Which robot it is.
    robot: Option<Robot>,
    /// Anything, for people.
    meta: Option<Map<String, Value>>,
    /// Joints, base to flange.
    #[schemars(length(min = 1, max = 16))]
    joint: Vec<Joint>,
    /// The tool.
    tool: Tool,
    /// Known natural frequencies.
    mode: Option<Vec<Mode>>,
    /// Physical effects; their order does not matter.
    effect: Option<Vec<Effect>>,
}

/// Names as the manufacturer gives them.
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Robot {
    /// Manufacturer, as `ABB`.
    #[schemars(length(min = 1, max = 64))]
    maker: Option<String>,
    /// Type, as `IRB 1600-6/1.45`.
    #[schemars(length(min = 1, max = 64))]
    #[serde(rename = "type")]
    kind: Option<String>,
    /// Serial number of this robot.
    #[schemars(length(min = 1, max = 64))]
    serial: Option<String>,
}

#[derive(JsonSchema)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Joint {
    /// Turns right-handed about its axis.
    Revolute(Revolute),
    /// Slides along its axis.
    Prismatic(Prismatic),
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Revolute {
    /// Name for people.
    name: Option<String>,
    /// Positive sense of the joint, unit length to 1e-6.
    axis: Vector,
    /// A point on the axis, mm.
    point_mm: Vector,
    /// Lower and upper joint limit, degrees.
    limits_deg: [f64; 2],
    /// A command that moves faster is flagged `command_jump`, deg/s; default: not limited.
    #[schemars(extend("exclusiveMinimum" = 0))]
    max_speed_deg_s: Option<f64>,
    /// Teeth per stage `[driver, driven]`, motor side first.
    gear_teeth: Option<Vec<Stage>>,
    /// The body that this joint moves.
    link: Option<Body>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Prismatic {
    /// Name for people.
    name: Option<String>,
    /// Positive sense of the joint, unit length to 1e-6.
    axis: Vector,
    /// A point on the axis, mm; default: the origin.
    point_mm: Option<Vector>,
    /// Lower and upper joint limit, mm.
    limits_mm: [f64; 2],
    /// A command that moves faster is flagged `command_jump`, mm/s; default: not limited.
    #[schemars(extend("exclusiveMinimum" = 0))]
    max_speed_mm_s: Option<f64>,
    /// Teeth per stage `[driver, driven]`, motor side first.
    gear_teeth: Option<Vec<Stage>>,
    /// The body that this joint moves.
    link: Option<Body>,
}

/// Teeth of driver and driven gear.
#[derive(JsonSchema)]
struct Stage(Teeth, Teeth);

#[derive(JsonSchema)]
struct Teeth(#[schemars(range(min = 1, max = 99_999))] u32);

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Body {
    /// Mass, kg; 0 means unknown.
    #[schemars(range(min = 0.0))]
    mass_kg: f64,
    /// Centre of mass, mm.
    com_mm: Vector,
    /// `[Ixx, Iyy, Izz, Ixy, Ixz, Iyz]` about the centre of mass, base axes, kg m²; default: a point mass.
    inertia_kgm2: Option<[f64; 6]>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("dependentRequired" = { "mass_kg": ["com_mm"], "com_mm": ["mass_kg"] }))]
struct Tool {
    /// The tool centre point, mm.
    tcp_mm: Vector,
    /// Rows of the rotation from tool axes to base axes; default: identity.
    base_from_tool: Option<[Vector; 3]>,
    /// Mass, kg; 0 means unknown.
    #[schemars(range(min = 0.0))]
    mass_kg: Option<f64>,
    /// Centre of mass, mm.
    com_mm: Option<Vector>,
    /// `[Ixx, Iyy, Izz, Ixy, Ixz, Iyz]` about the centre of mass, base axes, kg m²; default: a point mass.
    inertia_kgm2: Option<[f64; 6]>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Mode {
    /// Natural frequency, Hz.
    #[schemars(extend("exclusiveMinimum" = 0))]
    frequency_Hz: f64,
    /// Damping ratio.
    #[schemars(range(min = 0.0), extend("exclusiveMaximum" = 1))]
    damping_ratio: Option<f64>,
    /// Direction of the motion, not zero; default: unknown.
    direction: Option<Vector>,
}
