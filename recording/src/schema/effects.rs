//! An `[[effect]]` of a model: one closed object for each kind of effect and joint, generated from the specifications of `physics` and the loader.

use std::borrow::Cow;

use physics::JointKind;
use physics::spec::{Count, EffectScope, Parameter, Range};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::{Map, Value, json};

use crate::model::EffectKind;
use crate::series::JOINTS_MAX;

/// A physical effect.
pub(super) struct Effect;

impl JsonSchema for Effect {
    fn schema_name() -> Cow<'static, str> {
        "Effect".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let forms: Vec<Value> = EffectKind::all().flat_map(|kind| forms(&kind)).collect();
        json_schema!({ "anyOf": forms })
    }
}

/// The kind on a revolute joint, and on a prismatic one where its keys have other units there.
fn forms(kind: &EffectKind) -> Vec<Value> {
    let revolute = form(kind, JointKind::Revolute);
    let mut prismatic = form(kind, JointKind::Prismatic);
    let slides = matches!(kind.place, EffectScope::Joint | EffectScope::JointOrBase);
    if !slides || prismatic == revolute {
        return vec![revolute];
    }
    prismatic["title"] = json!(format!("{} (prismatic joint)", kind.name));
    vec![revolute, prismatic]
}

fn form(kind: &EffectKind, joint: JointKind) -> Value {
    let mut properties = Map::new();
    let mut required = vec![json!("kind")];
    let mut sigmas = Map::new();
    properties.insert("kind".to_owned(), json!({ "const": kind.name }));
    if kind.place != EffectScope::Robot {
        properties.insert("joint".to_owned(), joint_number());
    }
    if matches!(kind.place, EffectScope::Joint | EffectScope::RevoluteJoint) {
        required.push(json!("joint"));
    }
    if kind.has_channel {
        let meaning = "The measured group that is late.";
        properties
            .insert("channel".to_owned(), json!({ "type": "string", "description": meaning }));
    }
    for parameter in kind.parameters {
        let key = parameter.key(joint).to_string();
        sigmas.insert(key.clone(), shaped(parameter, &json!({ "type": "number", "minimum": 0 })));
        let number = number(parameter, joint);
        properties.insert(key.clone(), shaped(parameter, &number));
        if parameter.required {
            required.push(json!(key));
        }
    }
    let sigma = json!({
        "type": "object",
        "description": "Standard uncertainty of parameters that stand here: same key, same unit, same shape.",
        "properties": sigmas,
        "additionalProperties": false,
    });
    properties.insert("sigma".to_owned(), sigma);
    let mut form = json!({
        "type": "object",
        "title": kind.name,
        "description": format!("See docs/reference/effects.md#{}", kind.name),
        "properties": properties,
        "required": required,
        "additionalProperties": false,
    });
    if let Some(conditions) = conditions(kind, joint) {
        form["anyOf"] = conditions;
    }
    form
}

fn joint_number() -> Value {
    let meaning = "Number of the joint, from 1, base to flange.";
    json!({ "type": "integer", "minimum": 1, "maximum": JOINTS_MAX, "description": meaning })
}

/// Keys of which one set must be there.
fn conditions(kind: &EffectKind, joint: JointKind) -> Option<Value> {
    if kind.place == EffectScope::JointOrBase {
        return Some(json!([{ "required": ["joint"] }, { "required": ["axis"] }]));
    }
    if kind.alternatives.is_empty() {
        return None;
    }
    let keys: Vec<String> = kind.parameters.iter().map(|p| p.key(joint).to_string()).collect();
    let with_stem = |stem: &&str| {
        let keys = keys.iter().filter(|key| key.starts_with(*stem));
        json!({ "anyOf": keys.map(|key| json!({ "required": [key] })).collect::<Vec<_>>() })
    };
    let set = |stems: &&[&str]| json!({ "allOf": stems.iter().map(with_stem).collect::<Vec<_>>() });
    Some(kind.alternatives.iter().map(set).collect())
}

fn number(parameter: &Parameter, joint: JointKind) -> Value {
    let si = parameter.unit.suffix_and_si(joint).1;
    match parameter.range {
        Range::Any => json!({ "type": "number" }),
        Range::NotNegative => json!({ "type": "number", "minimum": 0 }),
        Range::Positive => json!({ "type": "number", "exclusiveMinimum": 0 }),
        Range::Between(low, high) => {
            json!({ "type": "number", "exclusiveMinimum": low / si, "exclusiveMaximum": high / si })
        }
    }
}

fn shaped(parameter: &Parameter, number: &Value) -> Value {
    let list = |min: usize, max: usize| json!({ "type": "array", "items": number, "minItems": min, "maxItems": max });
    match parameter.count {
        Count::One => number.clone(),
        Count::Exactly(count) => list(count, count),
        Count::UpTo(most) => list(1, most),
        Count::ThreePerCarriedBody => list(3, 3 * (JOINTS_MAX + 1)),
    }
}
