//! A model as text, in the units of its file.

use std::collections::BTreeMap;
use std::path::PathBuf;

use physics::JointKind;
use recording::model::{BodyEntry, EffectEntry, JointEntry, Numbers, Parameter, RobotModel};
use report::TextTable;
use serde::Serialize;

use crate::exit::{Answer, Outcome};
use crate::output::{Console, Emphasis};
use crate::table::on_stdout;

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Shown<'a> {
    name: &'a str,
    hash: String,
    robot: Robot<'a>,
    joints: Vec<Joint<'a>>,
    effects: Vec<Effect<'a>>,
    /// Effects that are loaded and not compensated, as `servo_lag of joint 2`.
    not_compensated: Vec<String>,
}

/// Which robot it is: names where the model states them, and the hash of the nominal geometry.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Robot<'a> {
    maker: Option<&'a str>,
    #[serde(rename = "type")]
    kind: Option<&'a str>,
    serial: Option<&'a str>,
    geometry: String,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Joint<'a> {
    name: &'a str,
    kind: &'static str,
    limits: [f64; 2],
    max_speed: Option<f64>,
    /// Of limits and, per second, of the speed.
    unit: &'static str,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Effect<'a> {
    effect: &'a str,
    joint: Option<usize>,
    compensated: bool,
    parameters: BTreeMap<&'a str, Value>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Value {
    value: serde_json::Value,
    sigma: Option<serde_json::Value>,
}

/// Shows the model of a file, or of a preset.
pub(super) fn run(console: &mut Console, path: &PathBuf, model: &RobotModel) -> Outcome {
    console.json_of([path], "trued.model/1", &shown(model))?;
    let file = &model.file;
    console.say(console.paint(Emphasis::Strong, &file.name))?;
    console.say(format!("robot: {}", file.identity()))?;
    console.say(format!("hash {:016x}\n\n", model.hash))?;
    console.say(joints(&file.joints))?;
    console.say(format!(
        "\ntool: TCP at {} mm{}",
        list(&file.tool.tcp_mm),
        body(file.tool.body)
    ))?;
    if !file.modes.is_empty() {
        let modes: Vec<String> =
            file.modes.iter().map(|mode| mode.frequency_hz.to_string()).collect();
        console.say(format!("natural frequencies: {} Hz", modes.join(", ")))?;
    }
    if file.effects.is_empty() {
        console.say("no effects; the correction is zero until a calibration adds some")?;
    } else {
        console.say(format!("\n{}", effects(&file.effects)))?;
    }
    for name in model.not_compensated_names() {
        console.say(format!("not compensated: {name}"))?;
    }
    Ok(Answer::Done)
}

/// How they move, then where they are: each table within 80 columns.
fn joints(joints: &[JointEntry]) -> String {
    let mut motions = TextTable::new(["joint", "kind", "limits", "speed", "mass, kg"]);
    let mut axes = TextTable::new(["joint", "axis", "point, mm"]);
    for (i, joint) in joints.iter().enumerate() {
        let (kind, unit) = kind(joint.kind);
        let name = if joint.name.is_empty() { (i + 1).to_string() } else { joint.name.clone() };
        let [low, high] = joint.limits;
        motions = motions.row([
            name.clone(),
            kind.to_owned(),
            format!("{low} to {high} {unit}"),
            joint.max_speed.map(|speed| format!("{speed} {unit}/s")).unwrap_or_default(),
            joint.link.map(|link| link.mass_kg.to_string()).unwrap_or_default(),
        ]);
        let point = joint.point_mm.map(|point| list(&point)).unwrap_or_default();
        axes = axes.row([name, list(&joint.axis), point]);
    }
    format!("{}\n{}", on_stdout(&motions), on_stdout(&axes))
}

/// Each effect with its parameters under it, ± their standard uncertainty.
fn effects(effects: &[EffectEntry]) -> String {
    let mut text = String::new();
    for effect in effects {
        let whose = effect.joint.map(|joint| format!(", joint {joint}")).unwrap_or_default();
        text += &format!("{}{whose}\n", effect.kind);
        for Parameter { key, value, sigma } in &effect.parameters {
            let sigma = sigma.as_ref().map(|sigma| format!(" ± {}", numbers(sigma)));
            text += &format!("  {key:<26}  {}{}\n", numbers(value), sigma.unwrap_or_default());
        }
    }
    text
}

fn kind(kind: JointKind) -> (&'static str, &'static str) {
    match kind {
        JointKind::Revolute => ("revolute", "deg"),
        JointKind::Prismatic => ("prismatic", "mm"),
    }
}

fn body(body: Option<BodyEntry>) -> String {
    let description = |body: BodyEntry| {
        format!(", {} kg with its centre of mass at {} mm", body.mass_kg, list(&body.com_mm))
    };
    body.map(description).unwrap_or_default()
}

fn numbers(numbers: &Numbers) -> String {
    match numbers {
        Numbers::One(number) => short(*number),
        Numbers::List(many) => list(many),
    }
}

/// Six significant digits; the file and `--json` contain all.
fn short(number: f64) -> String {
    let rounded = format!("{number:.5e}").parse().unwrap_or(number);
    f64::to_string(&rounded)
}

/// Zeros of a list from this many on are written as their number.
const ZEROS_LEAST: usize = 4;

/// A list; a run of zeros is written as `12 × 0`.
fn list(values: &[f64]) -> String {
    let runs = values.chunk_by(|a, b| *a == 0.0 && *b == 0.0);
    let runs = runs.flat_map(|run| match run {
        [0.0, ..] if run.len() >= ZEROS_LEAST => vec![format!("{} × 0", run.len())],
        run => run.iter().copied().map(short).collect(),
    });
    format!("({})", runs.collect::<Vec<String>>().join(", "))
}

fn shown(model: &RobotModel) -> Shown<'_> {
    let joint = |joint: &'_ JointEntry| kind(joint.kind);
    Shown {
        name: &model.file.name,
        hash: format!("{:016x}", model.hash),
        robot: Robot {
            maker: model.file.robot.maker.as_deref(),
            kind: model.file.robot.kind.as_deref(),
            serial: model.file.robot.serial.as_deref(),
            geometry: model.file.identity().geometry(),
        },
        joints: model
            .file
            .joints
            .iter()
            .map(|entry| Joint {
                name: &entry.name,
                kind: joint(entry).0,
                limits: entry.limits,
                max_speed: entry.max_speed,
                unit: joint(entry).1,
            })
            .collect(),
        effects: model
            .file
            .effects
            .iter()
            .enumerate()
            .map(|(index, entry)| effect(model, index, entry))
            .collect(),
        not_compensated: model.not_compensated_names(),
    }
}

fn effect<'a>(model: &RobotModel, index: usize, entry: &'a EffectEntry) -> Effect<'a> {
    let value = |numbers: &Numbers| match numbers {
        Numbers::One(number) => serde_json::json!(number),
        Numbers::List(many) => serde_json::json!(many),
    };
    let parameter = |p: &'a Parameter| {
        (p.key.as_str(), Value { value: value(&p.value), sigma: p.sigma.as_ref().map(value) })
    };
    Effect {
        effect: &entry.kind,
        joint: entry.joint,
        compensated: !model.not_compensated.contains(&index),
        parameters: entry.parameters.iter().map(parameter).collect(),
    }
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Shown<'_>>("model-show", "trued.model/1")
}

#[cfg(test)]
mod tests {
    use super::list;

    #[test]
    fn a_long_run_of_zeros_is_counted_and_three_coordinates_are_not() {
        assert_eq!(list(&[0.0, 0.0, 486.5]), "(0, 0, 486.5)");
        assert_eq!(list(&[0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 0.0, 0.0]), "(0, 0, 0.25, 5 × 0)");
        assert_eq!(list(&[0.0; 15]), "(15 × 0)");
    }
}
