//! The model as text: the same document gives the same bytes, and reads back to the same bits.

use physics::JointKind;
use toml::{Table, Value};

use crate::toml_text::{line, list, number, string};

use super::{BodyEntry, EffectEntry, JointEntry, ModelFile, Numbers, SCHEMA};

impl ModelFile {
    /// The document as TOML, keys in the contract's order.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let mut out = format!("schema = \"{SCHEMA}\"\n");
        line(&mut out, "name", &string(&self.name));
        line(&mut out, "gravity_m_s2", &list(&self.gravity_m_s2));
        let named = self.robot.entries().map(|(key, name)| name.map(|name| (key, name)));
        if named.iter().any(Option::is_some) {
            out.push_str("\n[robot]\n");
        }
        for (key, name) in named.into_iter().flatten() {
            line(&mut out, key, &string(name));
        }
        if !self.meta.is_empty() {
            out.push_str("\n[meta]\n");
            for (key, value) in &self.meta {
                line(&mut out, &string(key), &free(value));
            }
        }
        for joint in &self.joints {
            write_joint(&mut out, joint);
        }
        out.push_str("\n[tool]\n");
        line(&mut out, "tcp_mm", &list(&self.tool.tcp_mm));
        if let Some(rows) = &self.tool.base_from_tool {
            let rows: Vec<String> = rows.iter().map(|row| list(row)).collect();
            line(&mut out, "base_from_tool", &format!("[{}]", rows.join(", ")));
        }
        for (key, value) in self.tool.body.iter().flat_map(body_pairs) {
            line(&mut out, key, &value);
        }
        for mode in &self.modes {
            out.push_str("\n[[mode]]\n");
            line(&mut out, "frequency_Hz", &number(mode.frequency_hz));
            if let Some(damping) = mode.damping_ratio {
                line(&mut out, "damping_ratio", &number(damping));
            }
            if let Some(direction) = mode.direction {
                line(&mut out, "direction", &list(&direction));
            }
        }
        for effect in &self.effects {
            write_effect(&mut out, effect);
        }
        out
    }
}

fn write_joint(out: &mut String, joint: &JointEntry) {
    out.push_str("\n[[joint]]\n");
    let (kind, limits, speed) = match joint.kind {
        JointKind::Revolute => ("\"revolute\"", "limits_deg", "max_speed_deg_s"),
        JointKind::Prismatic => ("\"prismatic\"", "limits_mm", "max_speed_mm_s"),
    };
    if !joint.name.is_empty() {
        line(out, "name", &string(&joint.name));
    }
    line(out, "kind", kind);
    line(out, "axis", &list(&joint.axis));
    if let Some(point) = joint.point_mm {
        line(out, "point_mm", &list(&point));
    }
    line(out, limits, &list(&joint.limits));
    if let Some(max) = joint.max_speed {
        line(out, speed, &number(max));
    }
    if !joint.gear_teeth.is_empty() {
        let stage = |[driver, driven]: &[u32; 2]| format!("[{driver}, {driven}]");
        let stages: Vec<String> = joint.gear_teeth.iter().map(stage).collect();
        line(out, "gear_teeth", &format!("[{}]", stages.join(", ")));
    }
    if let Some(link) = &joint.link {
        let pairs: Vec<String> =
            body_pairs(link).into_iter().map(|(key, value)| format!("{key} = {value}")).collect();
        line(out, "link", &format!("{{ {} }}", pairs.join(", ")));
    }
}

fn body_pairs(body: &BodyEntry) -> Vec<(&'static str, String)> {
    let mut pairs = vec![("mass_kg", number(body.mass_kg)), ("com_mm", list(&body.com_mm))];
    pairs.extend(body.inertia_kgm2.map(|inertia| ("inertia_kgm2", list(&inertia))));
    pairs
}

fn write_effect(out: &mut String, effect: &EffectEntry) {
    out.push_str("\n[[effect]]\n");
    line(out, "kind", &string(&effect.kind));
    if let Some(joint) = effect.joint {
        line(out, "joint", &joint.to_string());
    }
    if let Some(channel) = &effect.channel {
        line(out, "channel", &string(channel));
    }
    for parameter in &effect.parameters {
        line(out, &parameter.key, &numbers(&parameter.value));
    }
    let sigma = effect.parameters.iter().filter_map(|parameter| {
        Some(format!("{} = {}", parameter.key, numbers(parameter.sigma.as_ref()?)))
    });
    let sigma: Vec<String> = sigma.collect();
    if !sigma.is_empty() {
        line(out, "sigma", &format!("{{ {} }}", sigma.join(", ")));
    }
}

fn numbers(numbers: &Numbers) -> String {
    match numbers {
        Numbers::One(one) => number(*one),
        Numbers::List(many) => list(many),
    }
}

/// A value of `[meta]`, tables inline.
fn free(value: &Value) -> String {
    match value {
        Value::String(text) => string(text),
        Value::Integer(integer) => integer.to_string(),
        Value::Float(float) => number(*float),
        Value::Boolean(flag) => flag.to_string(),
        Value::Datetime(time) => time.to_string(),
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(free).collect();
            format!("[{}]", items.join(", "))
        }
        Value::Table(table) => inline(table),
    }
}

fn inline(table: &Table) -> String {
    let pairs: Vec<String> =
        table.iter().map(|(key, value)| format!("{} = {}", string(key), free(value))).collect();
    format!("{{ {} }}", pairs.join(", "))
}
