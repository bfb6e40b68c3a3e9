//! Exports a model as URDF: its geometry including constant deviations, as frames.
//!
//! All link frames are parallel to the base at the zero position, so that `<axis>` is the real axis in base
//! axes; only the tip is rotated. Numbers are the shortest that read back to the same bits. What URDF cannot express
//! (effects that depend on position, load, direction, time) is omitted and reported.

use std::fmt::Write;

use glam::{DMat3, DVec3};
use physics::arm::GRAVITY;
use physics::spec::{ActsOn, Need, Spec};
use physics::{AnyEffect, Body, Evaluation, Inputs, JOINTS_MAX, Joint, JointKind, Memories, Model};

use super::rpy;
use crate::model::RobotModel;

/// A URDF, and the parts of the model in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Export {
    /// The file's text.
    pub text: String,
    /// Effects that the frames include, as `axis_tilt of joint 2`.
    pub carried: Vec<String>,
    /// What URDF cannot represent.
    pub left_out: Vec<OmittedPart>,
}

/// A part of a model that URDF cannot represent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OmittedPart {
    /// An effect, as `joint_compliance of joint 2`, or a key of the model.
    pub what: String,
    /// The quantity that it depends on, or another reason against it.
    pub why: &'static str,
}

/// The model as a URDF.
#[must_use]
pub fn export(model: &RobotModel) -> Export {
    let (mut carried, mut left_out) = (Vec::new(), Vec::new());
    let mut fixed = Model::nominal(model.physics.arm);
    let mut in_physics = model.physics.effects().zip(&model.entry_of).peekable();
    for (index, entry) in model.file.effects.iter().enumerate() {
        let effect = in_physics.next_if(|(_, place)| **place == index).map(|(effect, _)| effect);
        let barred = effect.map_or(Some(NO_PLACE), unsupported_reason);
        match (effect, barred) {
            // There is room for as many effects as the model has.
            (Some(effect), None) if fixed.push(*effect).is_ok() => carried.push(entry.title()),
            (_, barred) => {
                left_out.push(OmittedPart { what: entry.title(), why: barred.unwrap_or(NO_PLACE) });
            }
        }
    }
    let keys = [
        ("gravity_m_s2", model.file.gravity_m_s2 != GRAVITY.to_array()),
        ("gear_teeth", model.file.joints.iter().any(|joint| !joint.gear_teeth.is_empty())),
        ("mode", !model.file.modes.is_empty()),
    ];
    let keys = keys.into_iter().filter(|(_, is_stated)| *is_stated);
    left_out.extend(keys.map(|(key, _)| OmittedPart { what: key.to_owned(), why: NO_PLACE }));
    let at_zero = fixed.evaluate(&Inputs::at_rest([0.0; JOINTS_MAX]), &Memories::default());
    Export { text: Writer::write(model, &at_zero, &carried), carried, left_out }
}

const NO_PLACE: &str = "not supported by URDF";

/// Why a URDF cannot represent an effect; `None` for a constant change of the geometry.
fn unsupported_reason(effect: &AnyEffect) -> Option<&'static str> {
    use AnyEffect::{AxisShift, AxisTilt, GravitySag, JointOffset, ToolOffset};
    if matches!(effect, JointOffset(_) | AxisTilt(_) | AxisShift(_) | ToolOffset(_)) {
        return None;
    }
    let spec: &Spec = effect.spec();
    let needs = |wanted: &[Need]| spec.needs.iter().any(|need| wanted.contains(need));
    Some(if needs(&[Need::Direction]) {
        "depends on the direction of motion"
    } else if needs(&[Need::Temperature, Need::Time, Need::SpindleSpeed]) {
        "varies with temperature or time"
    } else if spec.acts_on == ActsOn::Loads {
        NO_PLACE
    } else if needs(&[Need::Masses, Need::Wrench]) || matches!(effect, GravitySag(_)) {
        "depends on the load"
    } else {
        "depends on the joint positions"
    })
}

/// Writer of the text.
struct Writer<'a> {
    out: String,
    /// Names used so far, of links and joints separately.
    links: Vec<String>,
    joints: Vec<String>,
    model: &'a RobotModel,
}

impl<'a> Writer<'a> {
    fn write(model: &'a RobotModel, at_zero: &Evaluation, carried: &[String]) -> String {
        let out = "<?xml version=\"1.0\"?>\n".to_owned();
        let mut writer = Self { out, links: Vec::new(), joints: Vec::new(), model };
        let robot = unused(&mut Vec::new(), &model.file.name);
        writer.line(&format!("<robot name=\"{}\">", escaped(&robot)));
        if !carried.is_empty() {
            writer.line(&format!("  <!-- included in the frames: {} -->", carried.join(", ")));
        }
        writer.chain(at_zero);
        writer.line("</robot>");
        writer.out
    }

    fn chain(&mut self, at_zero: &Evaluation) {
        let arm = &self.model.physics.arm;
        let chain = &at_zero.real;
        let mut parent = self.link("base_link", "base_link", None);
        let mut parent_origin = DVec3::ZERO;
        for (i, joint) in arm.joints().iter().enumerate() {
            let origin = chain.point(i);
            let body = joint.link.map(|body| Body {
                mass: body.mass,
                centre: chain.body(i).point(body.centre) - origin,
                inertia: turned(&body.inertia, &chain.body(i).rotation),
            });
            let child = self.link("", &format!("link_{}", i + 1), body);
            self.joint(i, joint, [&parent, &child], origin - parent_origin, chain.axis(i));
            (parent, parent_origin) = (child, origin);
        }
        let tool = chain.base_from_tool;
        let last = chain.body(arm.count() - 1);
        let tool_from_last = tool.inverse().after(&last);
        let body = arm.tool.body.map(|body| Body {
            mass: body.mass,
            centre: tool_from_last.point(body.centre),
            inertia: turned(&body.inertia, &tool_from_last.rotation),
        });
        let tip = self.link("tip_link", "tool0", body);
        let name = unused(&mut self.joints, &format!("{tip}_fixed"));
        self.line(&format!("  <joint name=\"{}\" type=\"fixed\">", escaped(&name)));
        self.ends([&parent, &tip]);
        let shift = numbers(tool.origin - parent_origin);
        self.line(&format!(
            "    <origin xyz=\"{shift}\" rpy=\"{}\"/>",
            numbers(rpy::angles(&tool.rotation))
        ));
        self.line("  </joint>");
    }

    /// Writes a link and returns its name: that in `[meta]` under `key`, otherwise `otherwise`.
    fn link(&mut self, key: &str, otherwise: &str, body: Option<Body>) -> String {
        let stated = self.model.file.meta.get(key).and_then(|value| value.as_str());
        let name = unused(&mut self.links, stated.unwrap_or(otherwise));
        let Some(Body { mass, centre, inertia }) = body else {
            self.line(&format!("  <link name=\"{}\"/>", escaped(&name)));
            return name;
        };
        let [x, y, z] = [inertia.x_axis, inertia.y_axis, inertia.z_axis];
        self.line(&format!("  <link name=\"{}\">", escaped(&name)));
        self.line("    <inertial>");
        self.line(&format!("      <origin xyz=\"{}\" rpy=\"0 0 0\"/>", numbers(centre)));
        self.line(&format!("      <mass value=\"{mass:?}\"/>"));
        self.line(&format!(
            "      <inertia ixx=\"{:?}\" ixy=\"{:?}\" ixz=\"{:?}\" iyy=\"{:?}\" iyz=\"{:?}\" izz=\"{:?}\"/>",
            x.x, x.y, x.z, y.y, y.z, z.z
        ));
        self.line("    </inertial>");
        self.line("  </link>");
        name
    }

    fn joint(&mut self, i: usize, joint: &Joint, ends: [&str; 2], shift: DVec3, axis: DVec3) {
        let stated = self.model.file.joints.get(i).map(|entry| entry.name.as_str());
        let stated = stated.filter(|name| !name.is_empty());
        let name = unused(&mut self.joints, stated.unwrap_or(&format!("joint_{}", i + 1)));
        let kind = match joint.kind {
            JointKind::Revolute => "revolute",
            JointKind::Prismatic => "prismatic",
        };
        let (low, high) = joint.limits;
        // The format requires a velocity and an effort; by convention 0 means unknown.
        let velocity = if joint.max_speed.is_finite() { joint.max_speed } else { 0.0 };
        self.line(&format!("  <joint name=\"{}\" type=\"{kind}\">", escaped(&name)));
        self.ends(ends);
        self.line(&format!("    <origin xyz=\"{}\" rpy=\"0 0 0\"/>", numbers(shift)));
        self.line(&format!("    <axis xyz=\"{}\"/>", numbers(axis)));
        self.line(&format!(
            "    <limit lower=\"{low:?}\" upper=\"{high:?}\" velocity=\"{velocity:?}\" effort=\"0\"/>"
        ));
        self.line("  </joint>");
    }

    fn ends(&mut self, [parent, child]: [&str; 2]) {
        self.line(&format!("    <parent link=\"{}\"/>", escaped(parent)));
        self.line(&format!("    <child link=\"{}\"/>", escaped(child)));
    }

    fn line(&mut self, text: &str) {
        // Writing into a string cannot fail.
        let _ = writeln!(self.out, "{text}");
    }
}

fn turned(inertia: &DMat3, rotation: &DMat3) -> DMat3 {
    *rotation * *inertia * rotation.transpose()
}

fn numbers(vector: DVec3) -> String {
    let texts = vector.to_array().map(|number| format!("{number:?}"));
    texts.join(" ")
}

/// The name without characters that are invalid in XML, and with a suffix if it is used.
fn unused(taken: &mut Vec<String>, name: &str) -> String {
    let held = |c: &char| !c.is_control() && !matches!(c, '\u{fffe}' | '\u{ffff}');
    let mut free: String = name.chars().filter(held).collect();
    while free.is_empty() || taken.contains(&free) {
        free.push('_');
    }
    taken.push(free.clone());
    free
}

/// A text for an attribute of XML.
fn escaped(text: &str) -> String {
    let pairs = [("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("\"", "&quot;")];
    pairs.iter().fold(text.to_owned(), |text, (plain, entity)| text.replace(plain, entity))
}
