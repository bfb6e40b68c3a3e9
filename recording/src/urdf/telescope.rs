//! Stages of a telescope: consecutive prismatic joints that mimic one leader, combined into one joint.
//!
//! Applies only if all move along one line and their sum equals the leader's motion; any other
//! mimic joint is left unchanged and refused later. The body of every stage but the last is treated
//! as if it moved the whole distance.

use glam::{DMat3, DVec3};
use physics::Frame;

use super::ends::Path;
use super::source::{Source, child, name};
use super::tree::{Joint, Motion, Tree};

/// Directions and shares that differ by less are the same.
const SAME: f64 = 1e-6;

/// Combines each telescope along a path into one joint, with an entry in `notes`.
pub(super) fn fold(source: &Source<'_>, tree: &mut Tree<'_, '_>, path: &Path) -> Vec<String> {
    let mut notes = Vec::new();
    let mut rest = path.joints.as_slice();
    while let Some((first, others)) = rest.split_first() {
        rest = others;
        let Some(leader) = leader(tree, *first) else { continue };
        let count = others.iter().take_while(|joint| {
            tree.joints[**joint].motion == Motion::Fixed || follows(tree, **joint, leader)
        });
        let (run, after) = others.split_at(count.count());
        let Some(stages) = stages(source, tree, *first, run, leader) else { continue };
        let names: Vec<&str> =
            stages.iter().map(|(joint, _)| name(tree.joints[*joint].node)).collect();
        notes.push(format!(
            "{} move together as joint {}; their bodies are attached to the last one",
            names.join(", "),
            name(tree.joints[leader].node)
        ));
        for (index, shift) in &stages {
            let joint = &mut tree.joints[*index];
            joint.origin = joint.origin.after(&Frame::new(DMat3::IDENTITY, *shift));
            joint.motion = Motion::Fixed;
        }
        tree.joints[*first].motion = Motion::Prismatic;
        tree.joints[*first].node = tree.joints[leader].node;
        rest = after;
    }
    notes
}

/// The joint that a joint mimics, if that is an independent prismatic joint.
fn leader(tree: &Tree<'_, '_>, joint: usize) -> Option<usize> {
    let wanted = child(tree.joints[joint].node, "mimic")?.attribute("joint")?;
    let found = tree.joints.iter().position(|joint| name(joint.node) == wanted)?;
    let slides = |joint: usize| tree.joints[joint].motion == Motion::Prismatic;
    let free = child(tree.joints[found].node, "mimic").is_none();
    (slides(joint) && slides(found) && free).then_some(found)
}

fn follows(tree: &Tree<'_, '_>, joint: usize, wanted: usize) -> bool {
    leader(tree, joint) == Some(wanted)
}

/// Each stage with its position in its own frame while the leader is at zero; `None` if they are
/// not a telescope.
fn stages(
    source: &Source<'_>,
    tree: &Tree<'_, '_>,
    first: usize,
    run: &[usize],
    leader: usize,
) -> Option<Vec<(usize, DVec3)>> {
    let line = axis(source, &tree.joints[leader])?;
    let mut turned = DMat3::IDENTITY;
    let mut whole = 0.0;
    let mut stages = Vec::new();
    for index in std::iter::once(&first).chain(run) {
        let joint = &tree.joints[*index];
        if *index != first {
            turned *= joint.origin.rotation;
        }
        if joint.motion == Motion::Fixed {
            continue;
        }
        let direction = axis(source, joint)?;
        let mimic = child(joint.node, "mimic")?;
        let number = |key| mimic.attribute(key).and_then(|_| source.number(mimic, key));
        let (share, offset_m) =
            (number("multiplier").unwrap_or(1.0), number("offset").unwrap_or(0.0));
        whole += share;
        if (turned * direction).distance(line) > SAME {
            return None;
        }
        stages.push((*index, direction * offset_m));
    }
    ((whole - 1.0).abs() < SAME).then_some(stages)
}

fn axis(source: &Source<'_>, joint: &Joint<'_, '_>) -> Option<DVec3> {
    source.vector(child(joint.node, "axis")?, "xyz")?.try_normalize()
}

#[cfg(test)]
mod tests {
    use crate::faults::Faults;
    use crate::urdf::tests::ARM;
    use crate::urdf::{ChainEnds, Import, parse};

    fn high(text: &str) -> Result<Import, Faults> {
        parse("arm.urdf", text, &ChainEnds { base: None, tip: Some("high") })
    }

    #[test]
    fn stages_that_slide_together_are_one_joint_and_others_that_follow_are_refused() {
        let stages = |share: f64| {
            let stage = |name: &str, parent: &str, offset: f64| {
                format!(
                    r#"<link name="{name}"/><joint name="to_{name}" type="prismatic"><parent link="{parent}"/><child link="{name}"/>
                    <origin xyz="0.1 0 0"/><axis xyz="1 0 0"/><limit lower="0" upper="0.2" velocity="1" effort="1"/>
                    <mimic joint="slide" multiplier="{share}" offset="{offset}"/></joint>"#
                )
            };
            let both =
                format!("{}{}</robot>", stage("low", "arm", 0.02), stage("high", "low", 0.03));
            ARM.replace("</robot>", &both)
        };
        let import = high(&stages(0.5)).unwrap();
        let [turn, slide] = import.model.file.joints.as_slice() else { panic!("two joints") };
        assert_eq!((turn.name.as_str(), slide.name.as_str()), ("turn", "slide"));
        assert_eq!(slide.limits, [0.0, 400.0]);
        let tcp = import.model.file.tool.tcp_mm;
        assert!((tcp[0] - 250.0).abs() < 1e-9 && (tcp[2] - 500.0).abs() < 1e-9, "{tcp:?}");
        assert!(import.notes[0].contains("to_low, to_high move together as joint slide"));
        let uneven = high(&stages(0.4)).unwrap_err().plain();
        assert!(uneven.contains("`joint to_low`: follows the joint `slide`"), "{uneven}");
    }
}
