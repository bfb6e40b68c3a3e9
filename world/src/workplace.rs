//! A working area in front of an arm.
//!
//! The point of a grid straight ahead (base +x) that the arm reaches with the given tool
//! orientation and that is farthest from singular poses and joint limits. The surroundings are not
//! considered.

use crate::ik::{self, IkError};
use glam::{DMat3, DVec3};
use physics::{Arm, Frame, Joints};

/// A working position of the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workplace {
    /// Its position, base frame, m.
    pub point_base: DVec3,
    /// Joint positions with the TCP there, rad or m.
    pub q: Joints,
}

/// The best working position for the tool orientation `base_from_tool`.
///
/// # Errors
/// Why the last place could not be reached, if none could.
pub fn workplace(arm: &Arm, base_from_tool: DMat3) -> Result<Workplace, IkError> {
    let links = (1..arm.count()).map(|i| (arm.next_point(i) - arm.joints()[i].point).length());
    let reach: f64 = links.sum();
    let shoulder = arm.joints().get(1).map_or(DVec3::ZERO, |joint| joint.point);
    let mut best: Option<(f64, Workplace)> = None;
    let mut failure = IkError::TooFewJoints(arm.count());
    for (ahead, up) in grid() {
        let point_base = DVec3::new(shoulder.x + ahead * reach, 0.0, shoulder.z + up * reach);
        let wanted = Frame::new(base_from_tool, point_base);
        let found = match &best {
            Some((_, previous)) => ik::solve(arm, &wanted, &previous.q),
            None => ik::start_pose(arm, &wanted),
        };
        match found {
            Ok(q) => {
                let clear = ik::clearance(arm, &q);
                if best.is_none_or(|(clearance_max, _)| clear > clearance_max) {
                    best = Some((clear, Workplace { point_base, q }));
                }
            }
            Err(error) => failure = error,
        }
    }
    best.map(|(_, workplace)| workplace).ok_or(failure)
}

/// Distances ahead and heights as fractions of the reach, in order of preference; only heights of a
/// table.
fn grid() -> impl Iterator<Item = (f64, f64)> {
    let ahead = [0.55, 0.5, 0.6, 0.45, 0.65, 0.4, 0.7, 0.35, 0.75];
    ahead.into_iter().flat_map(|ahead| [-0.1, -0.2, 0.0, -0.3].map(|up| (ahead, up)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint_path::JointPath;
    use crate::path::tool_along;
    use crate::slots::Slots;
    use crate::test_arm::{irb1600, seven_joints};

    #[test]
    fn the_thesis_slots_fit_at_the_workplace_of_every_arm() {
        for arm in [irb1600(), seven_joints()] {
            let down = tool_along(-DVec3::Z, arm.tool.base_from_tool);
            let place = workplace(&arm, down).expect("within reach");
            let slots = Slots::quick(place.point_base);
            let path = slots.tool_path(down).expect("a sound path");
            let plan = JointPath::plan(&arm, &path, 1e-3, Some(&place.q)).expect("within reach");
            let clearance_min =
                plan.samples.iter().map(|s| ik::clearance(&arm, &s.q)).fold(1.0, f64::min);
            assert!(
                clearance_min > 0.5 * ik::clearance(&arm, &place.q),
                "clear all along: {clearance_min}"
            );
            assert!(place.point_base.x > 0.2, "in front: {}", place.point_base);
        }
    }
}
