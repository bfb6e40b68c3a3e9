//! Imports a URDF: frames multiplied out at the zero configuration, fixed joints merged.
//!
//! With all joints at zero the frame of a joint is the product of the origins above it. Its axis and position
//! there are the model's axis and point; the links between a joint and the next one of the chain are the body that it moves.

use glam::{DMat3, DVec3};
use physics::{Body, Frame, JointKind};
use roxmltree::Node;
use toml::Table as FreeTable;

use super::ends::Path;
use super::source::{EXPAND, Source, child, document, macro_of, name};
use super::tree::{Joint, Motion, Tree};
use super::{ChainEnds, Import, bodies, telescope};
use crate::faults::{Fault, Faults, Setting};
use crate::model::{BodyEntry, JointEntry, ModelFile, RobotEntry, RobotModel, ToolEntry};
use crate::unit::Unit;
use crate::xml;

/// Limits of a joint without any, degrees: a model needs some.
const TURNS_DEG: f64 = 360.0;
/// Smaller components of a direction or position, m, are rounding of zero.
const ROUNDING: f64 = 1e-15;

/// Reads the arm between two links of a URDF text; `name` identifies it in error messages.
///
/// # Errors
/// All faults of the text.
pub fn parse(name: &str, text: &str, ends: &ChainEnds<'_>) -> Result<Import, Faults> {
    let relaxed = xml::relaxed(text);
    let document = document(name, text, &relaxed)?;
    let source = Source::new(name, text);
    let robot = document.root_element();
    if !robot.has_tag_name("robot") {
        source.fault(
            robot,
            format!("the root element is <{}>", robot.tag_name().name()),
            "give a URDF: <robot> … </robot>",
        );
    } else if let Some(node) = macro_of(&document) {
        source.fault(node, "is a xacro macro", EXPAND);
    }
    let tree = source.is_sound().then(|| Tree::read(&source, robot)).flatten();
    let found = tree.and_then(|mut tree| {
        let path = Path::find(&source, &tree, ends)?;
        let mut notes = path.remarks(&tree);
        notes.extend(telescope::fold(&source, &mut tree, &path));
        let mut chain = Chain { source: &source, tree: &tree, notes };
        let file = chain.model(&path, robot.attribute("name").unwrap_or("robot"));
        let [base, tip] = [path.base, path.tip].map(|link| tree.link_name(link).to_owned());
        source.is_sound().then_some((file, base, tip, chain.notes))
    });
    let (file, base, tip, notes) = source.finish(found)?;
    Ok(Import { model: RobotModel::of_file(name, file)?, base, tip, notes })
}

struct Chain<'a, 's> {
    source: &'a Source<'s>,
    tree: &'a Tree<'a, 'a>,
    notes: Vec<String>,
}

impl<'a> Chain<'a, '_> {
    fn model(&mut self, path: &Path, robot: &str) -> ModelFile {
        let mut joints: Vec<JointEntry> = Vec::new();
        let mut base_from_link = path.base_from_top;
        for (index, joint) in path.joints.iter().enumerate() {
            let joint = &self.tree.joints[*joint];
            base_from_link = base_from_link.after(&joint.origin);
            if joint.motion == Motion::Fixed {
                continue;
            }
            let next = path.joints[index + 1..]
                .iter()
                .copied()
                .find(|j| self.tree.joints[*j].motion != Motion::Fixed);
            let body = self.body(joint.child, base_from_link, next);
            joints.push(JointEntry { link: body.map(entry), ..self.joint(joint, &base_from_link) });
        }
        self.count(joints.len());
        let [base, tip] = [path.base, path.tip].map(|link| self.tree.link_name(link));
        let meta = [("source", robot), ("base_link", base), ("tip_link", tip)];
        let meta: FreeTable =
            meta.into_iter().map(|(key, text)| (key.to_owned(), text.into())).collect();
        ModelFile {
            robot: RobotEntry::default(),
            name: robot.to_owned(),
            meta,
            gravity_m_s2: self.gravity(path).to_array(),
            joints,
            tool: ToolEntry {
                tcp_mm: millimetres(base_from_link.origin),
                base_from_tool: rows(&base_from_link.rotation),
                body: None,
            },
            modes: Vec::new(),
            effects: Vec::new(),
        }
    }

    fn count(&self, joints: usize) {
        if !(1..=physics::JOINTS_MAX).contains(&joints) {
            let message = format!(
                "the chain has {joints} moving joints, a model has 1 to {}",
                physics::JOINTS_MAX
            );
            self.source.push(
                Fault::new("", message)
                    .help("choose another chain")
                    .by(&[Setting::BaseLink, Setting::TipLink]),
            );
        }
    }

    fn joint(&mut self, joint: &Joint<'_, '_>, base_from_joint: &Frame) -> JointEntry {
        let node = joint.node;
        if let Some(mimic) = child(node, "mimic") {
            let leader = mimic.attribute("joint").unwrap_or_default();
            let help = "joints of a model are independent; choose a chain without it, or remove its <mimic> if it has its own drive";
            let message = format!("follows the joint `{leader}` (mimic) and is part of the chain");
            self.source.fault(node, message, help);
        }
        if joint.motion == Motion::Several {
            let help = format!(
                "begin the chain after it, at the link `{}`",
                self.tree.link_name(joint.child)
            );
            let kind = node.attribute("type").unwrap_or_default();
            self.source.fault(
                node,
                format!("is {kind}: it has more than one degree of freedom"),
                help,
            );
        }
        let kind = match joint.motion {
            Motion::Prismatic => JointKind::Prismatic,
            _ => JointKind::Revolute,
        };
        JointEntry {
            name: name(node).to_owned(),
            kind,
            axis: (base_from_joint.rotation * self.axis(joint)).to_array().map(tidy),
            point_mm: Some(millimetres(base_from_joint.origin)),
            limits: self.limits(joint, kind),
            max_speed: self.max_speed(joint, kind),
            gear_teeth: Vec::new(),
            link: None,
        }
    }

    /// The axis in the joint's frame, of unit length.
    fn axis(&self, joint: &Joint<'_, '_>) -> DVec3 {
        let node = child(joint.node, "axis");
        let axis = node.and_then(|node| self.source.vector(node, "xyz")).unwrap_or(DVec3::X);
        let length = axis.length();
        if !(length > 1e-9 && length.is_finite()) {
            self.source.fault(
                node.unwrap_or(joint.node),
                "has no direction",
                "give a direction, such as xyz=\"0 0 1\"",
            );
            return DVec3::X;
        }
        axis / length
    }

    fn limits(&mut self, joint: &Joint<'_, '_>, kind: JointKind) -> [f64; 2] {
        if joint.motion == Motion::Continuous {
            self.notes.push(format!(
                "joint {} is continuous; its limits are set to ±{TURNS_DEG} deg; extend them if it turns further",
                name(joint.node)
            ));
            return [-TURNS_DEG, TURNS_DEG];
        }
        let Some(limit) = child(joint.node, "limit") else {
            let help = "give <limit lower=\"…\" upper=\"…\" velocity=\"…\" effort=\"…\"/>, or the type \"continuous\"";
            self.source.fault(joint.node, "has no <limit>", help);
            return [0.0, 0.0];
        };
        self.bounds(name(joint.node), limit, kind)
    }

    /// The bounds of a `<limit>`, in the unit of the file.
    fn bounds(&mut self, joint: &str, limit: Node<'_, '_>, kind: JointKind) -> [f64; 2] {
        let is_turning = kind == JointKind::Revolute;
        let unit = if is_turning { "rad" } else { "m" };
        let given = ["lower", "upper"].map(|key| self.source.wide(limit, key));
        let [low, high] = given.map(Option::unwrap_or_default);
        if low.is_nan() || high.is_nan() {
            return [0.0, 0.0];
        }
        let keys = ["lower", "upper"].into_iter().zip(given);
        let missing = keys.filter(|(_, given)| given.is_none()).map(|(key, _)| key).next();
        let otherwise = if is_turning { ", or the type \"continuous\"" } else { "" };
        let give = format!("give lower and upper in {unit}{otherwise}");
        let wrong = if given == [None, None] {
            Some(("has neither `lower` nor `upper`, which means 0 to 0".to_owned(), give))
        } else if let Some(missing) = missing.filter(|_| low >= high) {
            let message = format!("has no `{missing}`, which means 0: {low} to {high}");
            Some((message, give))
        } else if low > high {
            let help = format!("swap them: the lower limit comes first, in {unit}");
            Some((format!("has lower {low} above upper {high}"), help))
        } else if low >= high {
            Some((format!("has lower and upper both at {low}: the joint cannot move"), give))
        } else if !is_turning && (low.is_infinite() || high.is_infinite()) {
            let help = "give lower and upper in m; a prismatic joint needs both".to_owned();
            Some((format!("is infinite: {low} to {high}"), help))
        } else {
            None
        };
        if let Some((message, help)) = wrong {
            self.source.fault(limit, message, help);
            return [0.0, 0.0];
        }
        if let Some(missing) = missing {
            self.notes.push(format!(
                "joint {joint} has no `{missing}` limit: 0 by the URDF specification"
            ));
        }
        if low.is_infinite() || high.is_infinite() {
            self.notes.push(format!(
                "joint {joint} has an infinite limit, set to {TURNS_DEG} deg; extend it if the joint turns further"
            ));
        }
        [low, high].map(|limit| {
            if limit.is_finite() { in_file(limit, kind) } else { TURNS_DEG.copysign(limit) }
        })
    }

    fn max_speed(&self, joint: &Joint<'_, '_>, kind: JointKind) -> Option<f64> {
        let limit = child(joint.node, "limit")?;
        // Infinite: the file states no limit.
        let speed = self.source.wide(limit, "velocity").filter(|speed| *speed < f64::INFINITY)?;
        if speed < 0.0 {
            self.source.fault(
                limit,
                format!("has a velocity of {speed}"),
                "give a velocity above 0, or omit it",
            );
        }
        (speed > 0.0).then(|| in_file(speed, kind))
    }

    /// The body carried by `link`, without the chain's next joint; side branches are at their zero
    /// position.
    fn body(&mut self, link: usize, base_from_link: Frame, next: Option<usize>) -> Option<Body> {
        let mut frames = vec![(link, base_from_link)];
        let mut found = Vec::new();
        let mut beside = Vec::new();
        while let Some((link, base_from_link)) = frames.pop() {
            let node = self.tree.links[link].node;
            found.extend(bodies::of_link(self.source, node, &base_from_link, &mut self.notes));
            for joint in
                self.tree.links[link].child_joints.iter().filter(|joint| Some(**joint) != next)
            {
                let joint = &self.tree.joints[*joint];
                if joint.motion != Motion::Fixed {
                    beside.push(name(joint.node));
                }
                frames.push((joint.child, base_from_link.after(&joint.origin)));
            }
        }
        if let [first, others @ ..] = beside.as_slice() {
            let others = if others.is_empty() {
                String::new()
            } else {
                format!(" and {} more", others.len())
            };
            self.notes.push(format!(
                "joint {first}{others} outside the chain: the masses there are placed as at joint position 0"
            ));
        }
        bodies::together(&found)
    }

    /// Gravity in the frame of the base link: down in the frame of the root, whose z points up (REP
    /// 103).
    fn gravity(&mut self, path: &Path) -> DVec3 {
        let mut root_from_base = DMat3::IDENTITY;
        let mut link = path.base;
        while let Some(joint) =
            self.tree.links[link].parent_joint.map(|joint| &self.tree.joints[joint])
        {
            root_from_base = joint.origin.rotation * root_from_base;
            link = joint.parent;
        }
        let gravity = root_from_base.transpose() * physics::arm::GRAVITY;
        if gravity.distance(physics::arm::GRAVITY) > 1e-9 {
            let root = self.tree.link_name(link);
            let base = self.tree.link_name(path.base);
            self.notes.push(format!(
                "gravity points down in the frame of `{root}`, but `{base}` is tilted relative to it"
            ));
        }
        DVec3::from_array(gravity.to_array().map(tidy))
    }
}

fn entry(body: Body) -> BodyEntry {
    let [x, y, z] = [body.inertia.x_axis, body.inertia.y_axis, body.inertia.z_axis];
    let inertia = [x.x, y.y, z.z, x.y, x.z, y.z];
    BodyEntry {
        mass_kg: body.mass,
        com_mm: millimetres(body.centre),
        inertia_kgm2: inertia.iter().any(|moment| *moment != 0.0).then_some(inertia),
    }
}

/// Rows of a rotation, as in the file; `None` for the identity.
fn rows(rotation: &DMat3) -> Option<[[f64; 3]; 3]> {
    let rows = rotation.transpose().to_cols_array_2d().map(|row| row.map(tidy));
    (rows != DMat3::IDENTITY.to_cols_array_2d()).then_some(rows)
}

fn tidy(value: f64) -> f64 {
    if value.abs() < ROUNDING { 0.0 } else { value }
}

fn millimetres(metres: DVec3) -> [f64; 3] {
    metres.to_array().map(|metre| in_file(tidy(metre), JointKind::Prismatic))
}

/// A position in rad or m, in the unit of the file; it reads back to the same bits where it can.
fn in_file(si: f64, kind: JointKind) -> f64 {
    let name = match kind {
        JointKind::Revolute => "deg",
        JointKind::Prismatic => "mm",
    };
    Unit::from_name(name).map_or(si, |unit| unit.from_si(si))
}
