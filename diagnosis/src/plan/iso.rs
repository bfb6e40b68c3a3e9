//! Poses of ISO 9283: its five poses in a cube of the workspace, and the visits in a recording that belong to one pose.
//!
//! Source: ISO 9283:1998, 6.8: P1 at the centre of a cube's diagonal plane, P2 to P5 on the plane's diagonals, a tenth of a diagonal from their ends;
//! edges parallel to the base; all five with the same orientation of the tool. Load, speed and temperature of the standard are the user's
//! responsibility.

mod evaluation;

pub use self::evaluation::{EvaluatedPose, Evaluation};
use super::arm_constraints::ArmConstraints;
use super::inverse_kinematics::solve_tool_pose;
use super::working_zone::joints_at;
use crate::campaign::{Campaign, Reading, ToolPoint};
use crate::iso9283::Placement;
use glam::{DQuat, DVec3};
use physics::{Arm, Chain, Joints};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Number of visits of each pose that the standard requires.
pub const VISITS_REQUIRED: usize = 30;
/// Share of the distance from the centre to a corner: a tenth of the diagonal from its end.
const DIAGONAL_SHARE: f64 = 0.8;
/// Number of grid steps in the search for a cube.
const STEPS: u32 = 9;
/// Joint positions that differ by less belong to the same pose, rad or m.
const SAME_POSE: f64 = 1e-6;

/// A cube and its five poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IsoCube {
    /// Centre, base frame, m.
    pub middle: DVec3,
    /// Edge length, m.
    pub edge_m: f64,
    /// Joint positions of P1 to P5, rad or m.
    pub poses: [Joints; 5],
}

/// The visits of one pose.
#[derive(Clone, Debug)]
pub struct PoseVisits {
    /// Commanded joint positions, rad or m.
    pub q: Joints,
    /// Commanded placement of the measured point of the tool by the controller's geometry, base frame.
    pub command: Placement,
    /// Measured placements, in the measuring frame (in the base frame if that is known).
    pub attained: Vec<Placement>,
}

/// The five poses in a cube; `None` if the arm cannot reach all of them.
#[must_use]
pub fn cube(
    arm: &Arm,
    reach: &ArmConstraints,
    middle: DVec3,
    edge_m: f64,
    along: DVec3,
    seed: u64,
) -> Option<IsoCube> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Another arm configuration may reach poses that the first does not.
    (0..4).find_map(|_| {
        let first = joints_at(arm, reach, &mut rng, middle, along)?;
        let turned = Chain::nominal(arm, &first).base_from_tool.rotation;
        let mut poses = [first; 5];
        let corners = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
        for (slot, [out, side]) in poses.iter_mut().skip(1).zip(corners) {
            let corner = middle + 0.5 * DIAGONAL_SHARE * edge_m * DVec3::new(out, side, out);
            *slot =
                solve_tool_pose(arm, &first, corner, &turned).filter(|q| reach.allows(arm, q))?;
        }
        Some(IsoCube { middle, edge_m, poses })
    })
}

/// The largest cube in front of the arm, among those on a grid, whose poses it reaches with the tool's z axis along `along`.
#[must_use]
pub fn largest_cube(arm: &Arm, reach: &ArmConstraints, along: DVec3, seed: u64) -> Option<IsoCube> {
    let length: f64 = (0..arm.count())
        .map(|i| arm.joints().get(i).map_or(0.0, |joint| joint.point.distance(arm.next_point(i))))
        .sum();
    let foot =
        arm.joints().first().map_or(DVec3::ZERO, |joint| joint.point * DVec3::new(1.0, 1.0, 0.0));
    for edge in (1..=STEPS).rev().map(|step| 0.1 * f64::from(step) * length) {
        for out in 3..=STEPS {
            for up in 0..STEPS {
                let share = |step: u32| 0.1 * f64::from(step) * length;
                let middle = foot + DVec3::new(share(out), 0.0, share(up));
                let found = cube(arm, reach, middle, edge, along, seed);
                if found.is_some() {
                    return found;
                }
            }
        }
    }
    None
}

/// The visits of each pose that was visited at least twice, in the order of the first visits, by the first measured point.
#[must_use]
pub fn pose_visits(arm: &Arm, campaign: &Campaign) -> Vec<PoseVisits> {
    let mut all: Vec<PoseVisits> = Vec::new();
    for pose in &campaign.poses {
        let Some((place, frame, at)) =
            pose.seen.iter().find_map(|observation| match observation.reading {
                Reading::Point { place, frame, at } => Some((place, frame, at)),
                _ => None,
            })
        else {
            continue;
        };
        let orientation = pose.seen.iter().find_map(|observation| match observation.reading {
            Reading::Orientation { measuring_from_tool, .. } => {
                Some(DQuat::from_mat3(&measuring_from_tool))
            }
            _ => None,
        });
        let known = campaign.surroundings.frames.get(frame).filter(|frame| !frame.free);
        let turned = known.map_or(DQuat::IDENTITY, |known| {
            DQuat::from_mat3(&known.value.measuring_from_base.rotation).inverse()
        });
        let position_m =
            known.map_or(at, |known| known.value.measuring_from_base.inverse().point(at));
        let attained = Placement { position_m, orientation: orientation.map(|o| turned * o) };
        let q = pose.inputs.q;
        let same = |visits: &&mut PoseVisits| {
            visits.q.iter().zip(&q).all(|(a, b)| (a - b).abs() < SAME_POSE)
        };
        if let Some(visits) = all.iter_mut().find(same) {
            visits.attained.push(attained);
            continue;
        }
        let tool = Chain::nominal(arm, &q).base_from_tool;
        let on_tool = match place {
            ToolPoint::Tcp => DVec3::ZERO,
            ToolPoint::Target(i) => {
                campaign.surroundings.targets.get(i).map_or(DVec3::ZERO, |t| t.value)
            }
        };
        let orientation = Some(DQuat::from_mat3(&tool.rotation));
        let command = Placement { position_m: tool.point(on_tool), orientation };
        all.push(PoseVisits { q, command, attained: vec![attained] });
    }
    all.retain(|visits| visits.attained.len() > 1);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_campaigns::nominal_robot;

    #[test]
    fn the_five_poses_stand_on_the_diagonals_of_a_cube_with_one_orientation() {
        let arm = nominal_robot().arm;
        let reach = ArmConstraints::of(&arm);
        let found = largest_cube(&arm, &reach, DVec3::NEG_Z, 1).expect("a cube");
        assert!(found.edge_m > 0.3, "{}", found.edge_m);
        let tools = found.poses.map(|q| Chain::nominal(&arm, &q).base_from_tool);
        let places = tools.map(|tool| tool.origin);
        assert!(places[0].distance(found.middle) < 1e-5);
        let diagonal = 3.0_f64.sqrt() * found.edge_m;
        for (k, place) in places.iter().enumerate().skip(1) {
            assert!((place.distance(places[0]) / diagonal - 0.4).abs() < 1e-4, "P{}", k + 1);
            assert!(reach.allows(&arm, &found.poses[k]));
        }
        // P2 and P4 are at the ends of one diagonal, P3 and P5 at those of the other.
        assert!((0.5 * (places[1] + places[3])).distance(places[0]) < 1e-5);
        assert!((0.5 * (places[2] + places[4])).distance(places[0]) < 1e-5);
        for tool in &tools {
            let turn = tool.rotation * tools[0].rotation.transpose();
            assert!(physics::frame::vector_from_rotation(&turn).length() < 1e-5);
        }
    }
}
