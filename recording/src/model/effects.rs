//! Reads one effect, according to its specification in `physics` (or, for kinds without one, in `kinds`).

use physics::JointKind;
use physics::spec::{Count, EffectScope, Parameter as Spec, Range};

use super::kinds::{self, Kind};
use super::{EffectEntry, Numbers, Parameter};
use crate::faults::nearest;
use crate::toml_reader::{Table, number_of};

/// Reads an effect of a robot whose joints are of these kinds.
pub(super) fn read_effect(table: &Table<'_, '_>, joints: &[JointKind]) -> Option<EffectEntry> {
    table.require("kind", "the name of an effect");
    let Some(kind) = kind(table, joints) else {
        // The other keys of an unknown effect cannot be checked.
        if !table.has("kind") {
            table.fault_here("has no `kind`", "the name of the effect");
        }
        return None;
    };
    let before = table.fault_count();
    let joint = joint(table, &kind, joints.len());
    let joint_kind = joint.and_then(|joint| joints.get(joint - 1).copied()).unwrap_or_default();
    let channel = kind.has_channel.then(|| table.text("channel").map(str::to_owned)).flatten();
    let mut parameters = Vec::new();
    for spec in kind.parameters {
        let carried = joint.map_or(0, |joint| joints.len() + 1 - joint);
        parameters.extend(parameter(table, spec, joint_kind, carried));
    }
    sigmas(table, &mut parameters);
    table.close();
    if table.fault_count() > before {
        return None;
    }
    let entry = EffectEntry { kind: kind.name.to_owned(), joint, channel, parameters };
    if let Err(expected) = kind.check_alternatives(&entry) {
        table.fault_here("is missing", format!("give {expected}"));
        return None;
    }
    Some(entry)
}

fn kind(table: &Table<'_, '_>, joints: &[JointKind]) -> Option<Kind> {
    let name = table.text("kind")?;
    let number = table.raw("joint").and_then(|value| number_of(value.get_ref())).unwrap_or(0.0);
    let joint = joints.get((number as usize).wrapping_sub(1)).copied().unwrap_or_default();
    let found = kinds::find(name, joint, |key| table.keys().any(|found| found == key));
    if found.is_none() {
        let nearest_name = nearest(name, kinds::names());
        let expected = nearest_name.map_or(
            "the name of an effect (docs/reference/effects.md)".to_owned(),
            |nearest_name| {
                format!(
                    "\"{nearest_name}\", or the name of another effect (docs/reference/effects.md)"
                )
            },
        );
        table.fault("kind", format!("is \"{name}\", which is not a known effect"), expected);
    }
    found
}

fn joint(table: &Table<'_, '_>, kind: &Kind, count: usize) -> Option<usize> {
    match kind.place {
        EffectScope::Robot => {
            if table.has("joint") {
                table.fault(
                    "joint",
                    "is given",
                    "no joint; this effect applies to the whole robot",
                );
            }
            None
        }
        EffectScope::Joint | EffectScope::RevoluteJoint | EffectScope::JointOrBase => {
            if !(kind.place == EffectScope::JointOrBase && table.has("axis")) {
                table.require("joint", "the number of a joint, from 1");
            }
            let joint = table.whole("joint", 1..count as i64 + 1)?;
            usize::try_from(joint).ok()
        }
    }
}

fn parameter(
    table: &Table<'_, '_>,
    spec: &Spec,
    joint_kind: JointKind,
    carried: usize,
) -> Option<Parameter> {
    let key = spec.key(joint_kind).to_string();
    if spec.required {
        table.require(&key, describe(spec.count));
    }
    if !table.has(&key) {
        return None;
    }
    let value = match spec.count {
        Count::One => Numbers::One(table.number(&key, ..)?),
        _ => Numbers::List(table.numbers(&key, ..)?),
    };
    let found = value.as_slice().len();
    let fits = match spec.count {
        Count::One => true,
        Count::Exactly(count) => found == count,
        Count::UpTo(count) => (1..=count).contains(&found),
        Count::ThreePerCarriedBody => found == 3 * carried,
    };
    if !fits {
        let expected = match spec.count {
            Count::Exactly(count) => format!("{count} numbers"),
            Count::UpTo(count) => format!("1 to {count} numbers"),
            _ => format!("{} numbers, three for each body that the joint carries", 3 * carried),
        };
        table.fault(&key, format!("has {found} numbers"), expected);
    }
    let si = spec.unit.suffix_and_si(joint_kind).1;
    if let Some(wrong) = value.as_slice().iter().find(|value| !spec.range.holds(*value * si)) {
        table.fault(&key, format!("is {wrong}"), describe_range(spec.range, si));
    }
    Some(Parameter { key, value, sigma: None })
}

fn describe(count: Count) -> &'static str {
    match count {
        Count::One => "a number",
        _ => "a list of numbers",
    }
}

fn describe_range(range: Range, si: f64) -> String {
    match range {
        Range::Any => "a finite number".to_owned(),
        Range::NotNegative => "0 or more".to_owned(),
        Range::Positive => "above 0".to_owned(),
        Range::Between(low, high) => format!("between {} and {}", low / si, high / si),
    }
}

/// The standard uncertainties, each of the shape of its parameter.
fn sigmas(table: &Table<'_, '_>, parameters: &mut [Parameter]) {
    let Some(sigma) = table.table("sigma") else { return };
    for parameter in parameters {
        let key = &parameter.key;
        if !sigma.has(key) {
            continue;
        }
        parameter.sigma = match &parameter.value {
            Numbers::One(_) => sigma.number(key, 0.0..).map(Numbers::One),
            Numbers::List(values) => {
                let list = sigma.numbers(key, 0.0..);
                if let Some(list) = list.as_ref().filter(|list| list.len() != values.len()) {
                    let expected = format!("{}, like the parameter", values.len());
                    sigma.fault(key, format!("has {} numbers", list.len()), expected);
                }
                list.map(Numbers::List)
            }
        };
    }
    sigma.close();
}
