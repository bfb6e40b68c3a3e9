//! `trued.bridge-egm/1`, `trued.bridge-rsi/1`: the configurations of the bridges.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use std::collections::BTreeMap;

use super::cell::Frame;

/// Configuration of a bridge for ABB EGM, `trued.bridge-egm/1` (docs/reference/bridge.md).
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Egm {
    /// Name and version of the format.
    #[schemars(extend("const" = "trued.bridge-egm/1"))]
    schema: String,
    /// The configuration of the cell; a relative path counts from the folder of this file.
    cell: String,
    /// `on` if the controller compensates its robot itself: then nothing is corrected here.
    absolute_accuracy: AbsoluteAccuracy,
    /// `joints`: an application streams joint targets (`EGMRunJoint`), and `[application]` is required; `path`: RAPID moves, y and z are corrected.
    guidance: Guidance,
    /// The controller.
    robot: EgmRobot,
    /// The existing application.
    application: Option<Application>,
    /// How long the daemon is waited for.
    timing: Option<Timing>,
    /// Path corrections.
    path: Option<PathCorrections>,
    /// Measured force is sent to the daemon; off without this table.
    force: Option<EgmForce>,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum AbsoluteAccuracy {
    Off,
    On,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Guidance {
    Joints,
    Path,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct EgmRobot {
    /// Address of the controller, like `192.168.125.1`; datagrams of others are dropped.
    address: String,
    /// Address with port to which the controller sends.
    #[schemars(schema_with = "socket", extend("default" = "0.0.0.0:6510"))]
    #[serde(default)]
    listen: Option<String>,
    /// Port that the mechanical unit to serve sends from; default: whichever sends first.
    #[schemars(range(min = 1, max = 65_535))]
    port: Option<u32>,
    /// For an arm with seven axes: number of axes before the one that EGM transmits as first
    /// external axis; default: six axes.
    #[schemars(range(min = 1, max = 6))]
    seventh_after: Option<u32>,
}

/// An address with a port.
fn socket(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "string", "pattern": ":[0-9]{1,5}$" })
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Application {
    /// Address with port where the application listens, like `127.0.0.1:6511`.
    #[schemars(schema_with = "socket")]
    address: String,
    /// The bridge's own address towards it.
    #[schemars(schema_with = "socket", extend("default" = "0.0.0.0:0"))]
    #[serde(default)]
    local: Option<String>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Timing {
    /// How long the daemon is waited for, ms; in practice below the cycle.
    #[schemars(range(min = 0.05, max = 100.0), extend("default" = 1.0))]
    answer_within_ms: Option<f64>,
    /// Silence of the controller that ends its run, ms; longer than the controller itself waits for answers.
    #[schemars(range(min = 400.0, max = 10_000.0), extend("default" = 1000.0))]
    run_ends_after_ms: Option<f64>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct PathCorrections {
    /// Least time between two path corrections, ms.
    #[schemars(range(min = 24.0, max = 1000.0), extend("multipleOf" = 24, "default" = 48.0))]
    period_ms: Option<f64>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct EgmForce {
    /// Whether measured force is sent to the daemon.
    #[schemars(extend("default" = true))]
    enabled: Option<bool>,
    /// Axes of the force.
    #[schemars(extend("default" = "tool"))]
    frame: Option<Frame>,
}

/// Configuration of a bridge for KUKA RSI, `trued.bridge-rsi/1` (docs/reference/bridge.md).
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Rsi {
    /// Name and version of the format.
    #[schemars(extend("const" = "trued.bridge-rsi/1"))]
    schema: String,
    /// The configuration of the cell; a relative path counts from the folder of this file.
    cell: String,
    /// `on` if the controller compensates its robot itself: then nothing is corrected here.
    absolute_accuracy: AbsoluteAccuracy,
    /// A copy of the controller's own `RSI_EthernetConfig.xml`.
    ethernet: String,
    /// The controller.
    robot: RsiRobot,
    /// How long the daemon is waited for.
    timing: Option<Timing>,
    /// Where the program wants the axes, degrees.
    setpoint: Setpoint,
    /// The corrected element, and how corrections accumulate.
    correction: Correction,
    /// Where the controller takes the feed override.
    feed: Option<RsiFeed>,
    /// Every other element that the controller receives, by its tag, and its value.
    #[schemars(schema_with = "constants")]
    #[serde(default)]
    others: Option<BTreeMap<String, f64>>,
}

fn constants(_: &mut SchemaGenerator) -> Schema {
    json_schema!({
        "type": "object",
        "additionalProperties": { "type": "number", "minimum": -1e9, "maximum": 1e9 },
    })
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct RsiFeed {
    /// Tag of the element connected to `MAP2OV_PRO`; its value is percent of the programmed feed,
    /// whole numbers if its type is `LONG`.
    tag: String,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct RsiRobot {
    /// Address of the controller, like `192.168.1.2`; telegrams of others are dropped.
    address: String,
    /// Address with port to which the controller sends; default: any address, the `PORT` of the controller's configuration.
    #[schemars(schema_with = "socket")]
    #[serde(default)]
    listen: Option<String>,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct Setpoint {
    /// Tag of the element.
    #[schemars(extend("default" = "ASPos"))]
    tag: Option<String>,
    /// Its attributes, one per joint of the model; default: A1 to A6.
    #[schemars(length(min = 1, max = 6), extend("uniqueItems" = true))]
    names: Option<Vec<String>>,
    /// Whether the controller's setpoint contains the correction already; `ASPos` does not.
    holds_correction: bool,
}

#[derive(JsonSchema)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Correction {
    /// Axes, degrees (AXISCORR).
    Axes(AxesCorrection),
    /// The pose of the tool, mm and degrees (POSCORR).
    Pose(PoseCorrection),
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct AxesCorrection {
    /// Tag of the element.
    #[schemars(extend("default" = "AKorr"))]
    tag: Option<String>,
    /// Its attributes, one per joint of the model; default: A1 to A6.
    #[schemars(length(min = 1, max = 6), extend("uniqueItems" = true))]
    names: Option<Vec<String>>,
    /// How the controller accumulates corrections, as `RSI_ON` in the robot's program.
    sums: Sums,
}

#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
struct PoseCorrection {
    /// Tag of the element.
    #[schemars(extend("default" = "RKorr"))]
    tag: Option<String>,
    /// Its attributes for x, y, z, A, B, C; default: X, Y, Z, A, B, C.
    #[schemars(length(min = 6, max = 6), extend("uniqueItems" = true))]
    names: Option<Vec<String>>,
    /// `base` (ROBROOT) or `tool`, as `RefCorrSys` of `POSCORR`.
    frame: Frame,
    /// How the controller accumulates corrections, as `RSI_ON` in the robot's program.
    sums: Sums,
}

#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Sums {
    Absolute,
    Relative,
}
