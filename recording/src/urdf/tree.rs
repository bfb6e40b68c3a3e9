//! The link tree of a URDF: names, parents and children.
//!
//! A valid [`Tree`] has no loop and unique names. Traversal takes linear time.

use std::collections::HashMap;

use physics::Frame;
use roxmltree::Node;

use super::source::{Source, child, name};
use crate::faults::nearest;

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Motion {
    Fixed,
    Revolute,
    Continuous,
    Prismatic,
    /// Floating, planar, spherical: several degrees of freedom.
    Several,
}

/// One joint; links are indices into [`Tree::links`].
pub(super) struct Joint<'d, 's> {
    pub(super) node: Node<'d, 's>,
    pub(super) motion: Motion,
    /// The joint's frame at zero in that of its parent link, m.
    pub(super) origin: Frame,
    pub(super) parent: usize,
    pub(super) child: usize,
}

/// One link.
pub(super) struct Link<'d, 's> {
    pub(super) node: Node<'d, 's>,
    /// The joint to its parent link.
    pub(super) parent_joint: Option<usize>,
    /// The joints to its child links.
    pub(super) child_joints: Vec<usize>,
}

/// The links and joints of a robot.
pub(super) struct Tree<'d, 's> {
    pub(super) links: Vec<Link<'d, 's>>,
    pub(super) joints: Vec<Joint<'d, 's>>,
    pub(super) places: HashMap<&'d str, usize>,
}

impl<'d, 's> Tree<'d, 's> {
    /// The links and joints below `<robot>`; `None`, with faults, if they are not a tree.
    pub(super) fn read(source: &Source<'_>, robot: Node<'d, 's>) -> Option<Self> {
        let mut tree = Self { links: Vec::new(), joints: Vec::new(), places: HashMap::new() };
        for node in named(source, robot, "link") {
            tree.places.insert(name(node), tree.links.len());
            tree.links.push(Link { node, parent_joint: None, child_joints: Vec::new() });
        }
        for node in named(source, robot, "joint") {
            let motion = motion(source, node);
            let parent = tree.end(source, node, "parent");
            let child = tree.end(source, node, "child");
            let (Some(motion), Some(parent), Some(child)) = (motion, parent, child) else {
                continue;
            };
            let index = tree.joints.len();
            if let Some(other) = tree.links[child].parent_joint {
                let other = name(tree.joints[other].node);
                let message = format!(
                    "moves the link `{}`, as joint `{other}` does",
                    name(tree.links[child].node)
                );
                source.fault(
                    node,
                    message,
                    "a link has one parent joint; correct the `child` of one of the two",
                );
                continue;
            }
            tree.links[child].parent_joint = Some(index);
            tree.links[parent].child_joints.push(index);
            tree.joints.push(Joint { node, motion, origin: Frame::IDENTITY, parent, child });
        }
        if tree.links.is_empty() {
            source.fault(
                robot,
                "has no link",
                "give a complete URDF with links and the joints between them",
            );
        }
        tree.refuse_loops(source);
        if !source.is_sound() {
            return None;
        }
        for joint in &mut tree.joints {
            joint.origin = source.origin(joint.node);
        }
        Some(tree)
    }

    fn end(&self, source: &Source<'_>, joint: Node<'d, 's>, tag: &str) -> Option<usize> {
        let Some(link) = child(joint, tag).and_then(|node| node.attribute("link")) else {
            source.fault(joint, format!("has no <{tag} link=\"…\"/>"), "specify the link");
            return None;
        };
        let found = self.places.get(link).copied();
        if found.is_none() {
            source.fault(
                joint,
                format!("has the {tag} link `{link}`, which does not exist"),
                self.suggest_link(link),
            );
        }
        found
    }

    /// Help for a link that does not exist.
    pub(super) fn suggest_link(&self, link: &str) -> String {
        let nearest_name = nearest(link, self.links.iter().map(|link| name(link.node)));
        nearest_name.map_or_else(
            || "use a link of this file".to_owned(),
            |nearest_name| format!("did you mean `{nearest_name}`?"),
        )
    }

    /// Links that cannot be reached from a root form a loop.
    fn refuse_loops(&self, source: &Source<'_>) {
        let roots = self.links.iter().enumerate().filter(|(_, link)| link.parent_joint.is_none());
        let mut is_reached = vec![false; self.links.len()];
        for (root, _) in roots {
            self.below(root, |link, _| is_reached[link] = true);
        }
        if let Some(link) = is_reached.iter().position(|is_reached| !is_reached) {
            source.fault(
                self.links[link].node,
                "is part of a loop of joints",
                "remove one joint of the loop; a serial arm is an open chain",
            );
        }
    }

    /// Visits a link and all its descendants, parents first, with the joint between.
    pub(super) fn below(&self, top: usize, mut visit: impl FnMut(usize, Option<usize>)) {
        let mut open = vec![(top, None)];
        while let Some((link, joint)) = open.pop() {
            visit(link, joint);
            let carried = self.links[link].child_joints.iter().rev();
            open.extend(carried.map(|joint| (self.joints[*joint].child, Some(*joint))));
        }
    }

    /// The name of a link.
    pub(super) fn link_name(&self, link: usize) -> &'d str {
        name(self.links[link].node)
    }
}

/// The children of the robot with this tag; one without a name, or with that of another, is a fault.
fn named<'d, 's>(source: &Source<'_>, robot: Node<'d, 's>, tag: &str) -> Vec<Node<'d, 's>> {
    let mut taken = HashMap::new();
    let mut nodes = Vec::new();
    for node in robot.children().filter(|node| node.has_tag_name(tag)) {
        if name(node).is_empty() {
            source.fault(node, "has no name", format!("give <{tag} name=\"…\">"));
        } else if taken.insert(name(node), ()).is_some() {
            source.fault(
                node,
                "appears twice in the file",
                format!("give each {tag} a unique name"),
            );
        } else {
            nodes.push(node);
        }
    }
    nodes
}

fn motion(source: &Source<'_>, joint: Node<'_, '_>) -> Option<Motion> {
    match joint.attribute("type") {
        Some("fixed") => Some(Motion::Fixed),
        Some("revolute") => Some(Motion::Revolute),
        Some("continuous") => Some(Motion::Continuous),
        Some("prismatic") => Some(Motion::Prismatic),
        Some("floating" | "planar" | "spherical") => Some(Motion::Several),
        other => {
            let message =
                other.map_or("has no `type`".to_owned(), |kind| format!("is of type \"{kind}\""));
            source.fault(
                joint,
                message,
                "give type=\"revolute\", \"continuous\", \"prismatic\" or \"fixed\"",
            );
            None
        }
    }
}
