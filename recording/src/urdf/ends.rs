//! The two ends of the chain: the links named as base and tip, and the controller's frames next to them.
//!
//! Any link can be an end. Only fixed joints are allowed between the base and the chain, so a leaf such as the frame `base` of
//! ROS-Industrial (REP 199: the controller's base frame) can be the base as well as the root. If frames with the usual names exist
//! besides the chosen one, a note gives their pose.

use glam::DVec3;
use physics::Frame;

use super::source::{Source, name};
use super::tree::{Motion, Tree};
use super::{ChainEnds, rpy};
use crate::faults::{Fault, Setting};

/// Largest number of names in one message.
const NAMES_SHOWN: usize = 8;
/// Frames of a controller at the base, by ROS-Industrial's names.
const BASES: [&str; 2] = ["base", "base_link"];
/// Frames of a controller at the tool, the usual one first.
const TOOLS: [&str; 3] = ["tool0", "flange", "ee_link"];
/// Frames that differ by less (m, and by component of the rotation) are one: rounding of a file's figures.
const SAME: f64 = 1e-9;
/// Both ends of a chain.
const BOTH: [Setting; 2] = [Setting::BaseLink, Setting::TipLink];

/// From a base link to a tip link.
#[derive(Debug)]
pub(super) struct Path {
    pub(super) base: usize,
    pub(super) tip: usize,
    /// The joints between the chain's uppermost link and the tip, base first.
    pub(super) joints: Vec<usize>,
    /// The chain's uppermost link in the base link's frame: they differ where the base is a leaf.
    pub(super) base_from_top: Frame,
}

impl Path {
    /// The chain between the named links; if one is not named, the only possible one.
    pub(super) fn find(
        source: &Source<'_>,
        tree: &Tree<'_, '_>,
        ends: &ChainEnds<'_>,
    ) -> Option<Self> {
        let base = ends.base.map(|link| named(source, tree, Setting::BaseLink, link));
        let tip = ends.tip.map(|link| named(source, tree, Setting::TipLink, link));
        if base == Some(None) || tip == Some(None) {
            return None;
        }
        let base = base.flatten();
        let tip = match tip.flatten() {
            Some(tip) => tip,
            None => only_tip(source, tree, base)?,
        };
        let mut down = above(tree, tip);
        let root = |link| above(tree, link).last().map_or(link, |joint| tree.joints[*joint].parent);
        let base = base.unwrap_or_else(|| root(tip));
        if root(base) != root(tip) {
            let [base, tip] = [base, tip].map(|link| tree.link_name(link));
            let message = format!("no joint connects the links `{base}` and `{tip}`");
            let help = "choose two links of one tree, or add the missing joint";
            source.push(Fault::new("", message).help(help).by(&BOTH));
            return None;
        }
        let mut up = above(tree, base);
        while let (Some(a), Some(b)) = (up.last(), down.last())
            && a == b
        {
            up.pop();
            down.pop();
        }
        if let Some(moves) = up.iter().find(|joint| tree.joints[**joint].motion != Motion::Fixed) {
            let message = format!(
                "the joint `{}` moves the base `{}` against the rest of the chain to `{}`",
                name(tree.joints[*moves].node),
                tree.link_name(base),
                tree.link_name(tip)
            );
            let help =
                "check whether the base (the fixed link) and the tip (the moving link) are swapped";
            source.push(Fault::new("", message).help(help).by(&BOTH));
            return None;
        }
        down.reverse();
        let base_from_top = down_to(tree, &up).inverse();
        Some(Self { base, tip, joints: down, base_from_top })
    }

    /// Notes on the roots, and on the controller's frames next to the two ends.
    pub(super) fn remarks(&self, tree: &Tree<'_, '_>) -> Vec<String> {
        let mut remarks = Vec::new();
        let roots = (0..tree.links.len()).filter(|link| tree.links[*link].parent_joint.is_none());
        let roots: Vec<usize> = roots.collect();
        if roots.len() > 1 {
            remarks.push(format!(
                "the file has {} roots ({}); the chain belongs to `{}`",
                roots.len(),
                listed(&roots, |link| format!("`{}`", tree.link_name(link))),
                tree.link_name(self.base)
            ));
        }
        beside(tree, self.base, &BASES, "base", &mut remarks);
        beside(tree, self.tip, &TOOLS, "tip", &mut remarks);
        remarks
    }
}

/// The joints above a link, the nearest first.
fn above(tree: &Tree<'_, '_>, mut link: usize) -> Vec<usize> {
    let mut joints = Vec::new();
    while let Some(joint) = tree.links[link].parent_joint {
        joints.push(joint);
        link = tree.joints[joint].parent;
    }
    joints
}

/// The frame below these joints in the frame above them, at zero; the lowest joint comes first.
fn down_to(tree: &Tree<'_, '_>, joints: &[usize]) -> Frame {
    joints.iter().rev().fold(Frame::IDENTITY, |top, joint| top.after(&tree.joints[*joint].origin))
}

/// The fixed joints above a link, the nearest first, and the link above them.
fn fixed_above(tree: &Tree<'_, '_>, link: usize) -> (Vec<usize>, usize) {
    let fixed = |joint: &usize| tree.joints[*joint].motion == Motion::Fixed;
    let joints: Vec<usize> = above(tree, link).into_iter().take_while(fixed).collect();
    let top = joints.last().map_or(link, |joint| tree.joints[*joint].parent);
    (joints, top)
}

/// Notes the frame of each link that has one of these names and is fixed to `end`, unless it is the
/// same frame.
fn beside(tree: &Tree<'_, '_>, end: usize, names: &[&str], option: &str, to: &mut Vec<String>) {
    let (joints, top) = fixed_above(tree, end);
    let end_from_top = down_to(tree, &joints).inverse();
    for link in (0..tree.links.len()).filter(|link| *link != end) {
        if !names.iter().any(|name| is_called(tree.link_name(link), name)) {
            continue;
        }
        let (joints, its_top) = fixed_above(tree, link);
        let frame = end_from_top.after(&down_to(tree, &joints));
        if its_top != top || is_identity(&frame) {
            continue;
        }
        let (chosen, other) = (tree.link_name(end), tree.link_name(link));
        let places = |vector: DVec3| vector.to_array().map(|x| format!("{:.3}", x + 0.0)).join(" ");
        to.push(format!(
            "the {option} frame is `{chosen}`; `{other}` differs: in `{chosen}` it is at xyz {} mm, rpy {} deg (state it as {option} to select it)",
            places(frame.origin * 1e3),
            places(rpy::angles(&frame.rotation).map(f64::to_degrees))
        ));
    }
}

fn is_identity(frame: &Frame) -> bool {
    let turn = (frame.rotation - glam::DMat3::IDENTITY).to_cols_array();
    frame.origin.length() < SAME && turn.iter().all(|x| x.abs() < SAME)
}

/// Whether a link has this name, perhaps behind a robot's prefix: `base`, `left_base`.
fn is_called(link: &str, name: &str) -> bool {
    link.strip_suffix(name)
        .is_some_and(|prefix| prefix.is_empty() || prefix.ends_with(['_', '-', '/', '.']))
}

/// The index of the link with this name; a missing one is a fault.
fn named(source: &Source<'_>, tree: &Tree<'_, '_>, setting: Setting, link: &str) -> Option<usize> {
    let found = tree.places.get(link).copied();
    if found.is_none() {
        let fault = Fault::new("", format!("the robot has no link `{link}`"));
        source.push(fault.help(tree.suggest_link(link)).by(&[setting]));
    }
    found
}

/// The leaves below a link that move against it, each with its count of moving joints.
fn moving_leaves(tree: &Tree<'_, '_>, root: usize, moving: &mut [usize]) -> Vec<usize> {
    let mut leaves = Vec::new();
    tree.below(root, |link, joint| {
        if let Some(joint) = joint.map(|joint| &tree.joints[joint]) {
            moving[link] = moving[joint.parent] + usize::from(joint.motion != Motion::Fixed);
        }
        if tree.links[link].child_joints.is_empty() && moving[link] > 0 {
            leaves.push(link);
        }
    });
    leaves
}

/// The only moving leaf; of several that are fixed to each other, the controller's tool frame.
fn only_tip(source: &Source<'_>, tree: &Tree<'_, '_>, base: Option<usize>) -> Option<usize> {
    let mut moving = vec![0_usize; tree.links.len()];
    let roots: Vec<usize> = match base {
        Some(base) => vec![base],
        None => {
            (0..tree.links.len()).filter(|link| tree.links[*link].parent_joint.is_none()).collect()
        }
    };
    let mut ends = Vec::new();
    for root in roots {
        ends.extend(moving_leaves(tree, root, &mut moving));
    }
    if let (Some(base), true) = (base, ends.is_empty()) {
        // A leaf: the arm begins at the link to which the leaf is fixed.
        ends = moving_leaves(tree, fixed_above(tree, base).1, &mut moving);
    }
    if let [tip] = ends.as_slice() {
        return Some(*tip);
    }
    if let Some(tip) = tool_of(tree, &ends) {
        return Some(tip);
    }
    let fault = if ends.is_empty() {
        Fault::new("", "has no moving joint")
            .help("give the URDF of an arm, or another base")
            .by(&[Setting::BaseLink])
    } else {
        let shown =
            |link: usize| format!("`{}` (moving joints: {})", tree.link_name(link), moving[link]);
        let message = format!("branches into {} ends: {}", ends.len(), listed(&ends, shown));
        Fault::new("", message)
            .help("choose the chain by its tip, and if need be its base")
            .by(&[Setting::TipLink, Setting::BaseLink])
    };
    source.push(fault);
    None
}

/// Among leaves that are fixed to each other, the one with the name of a controller's tool frame.
fn tool_of(tree: &Tree<'_, '_>, ends: &[usize]) -> Option<usize> {
    let (first, others) = ends.split_first()?;
    let top = fixed_above(tree, *first).1;
    if others.iter().any(|link| fixed_above(tree, *link).1 != top) {
        return None;
    }
    TOOLS.iter().find_map(|tool| {
        let mut called = ends.iter().filter(|link| is_called(tree.link_name(**link), tool));
        called.next().filter(|_| called.next().is_none()).copied()
    })
}

fn listed(links: &[usize], shown: impl Fn(usize) -> String) -> String {
    let mut names: Vec<String> = links.iter().take(NAMES_SHOWN).map(|link| shown(*link)).collect();
    if links.len() > NAMES_SHOWN {
        names.push(format!("{} more", links.len() - NAMES_SHOWN));
    }
    names.join(", ")
}
