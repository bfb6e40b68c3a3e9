//! Visibility of a target: range, acceptance angle of the reflector, and occlusion by the arm.
//!
//! A target is visible if the straight line from the instrument to it stays clear of the links' capsules. Fixtures, people and the tool's own body
//! are not described, hence not considered.

use super::arm_constraints::{LinkSegment, links};
use crate::campaign::ToolPoint;
use crate::extrinsics::Extrinsics;
use glam::DVec3;
use physics::{Arm, Chain};

/// Line-of-sight instrument and its targets; SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct LineOfSight {
    /// Position of the instrument, base frame, m.
    pub instrument_base: DVec3,
    /// Smallest and largest measuring distance, m.
    pub range_m: [f64; 2],
    /// Largest angle between a reflector's axis and the beam, rad.
    pub acceptance_rad: f64,
    /// Axis of each target, tool axes, unit length; `None` if visible from all directions (a ball, a sphere of markers).
    pub facing_tool: Vec<Option<DVec3>>,
}

impl LineOfSight {
    /// Whether `place` is visible with the arm as in `chain`; `radius_m` is the radius of the links.
    #[must_use]
    pub fn sees(
        &self,
        arm: &Arm,
        chain: &Chain,
        surroundings: &Extrinsics,
        place: ToolPoint,
        radius_m: f64,
    ) -> bool {
        let tool = &chain.base_from_tool;
        let (reflector, facing) = match place {
            ToolPoint::Tcp => (tool.origin, self.facing_tool.first()),
            ToolPoint::Target(i) => {
                let place = surroundings.targets.get(i).map_or(DVec3::ZERO, |target| target.value);
                (tool.point(place), self.facing_tool.get(i))
            }
        };
        let away = self.instrument_base - reflector;
        let distance = away.length();
        let [nearest, farthest] = self.range_m;
        let Some(beam) = away.try_normalize().filter(|_| (nearest..=farthest).contains(&distance))
        else {
            return false;
        };
        let turned = facing.copied().flatten().map(|facing| tool.rotation * facing);
        let accepts = |axis: DVec3| axis.dot(beam) >= self.acceptance_rad.cos();
        // The ray ends before the target, which is mounted on the arm.
        let end = reflector + beam * (1.5 * radius_m).min(distance);
        let ray = LinkSegment { a: self.instrument_base, b: end, from: 0 };
        turned.is_none_or(accepts) && links(arm, chain).iter().all(|l| l.distance(&ray) >= radius_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_campaigns::nominal_robot;
    use physics::Joints;

    fn sight(instrument_base: DVec3, facing: Option<DVec3>) -> LineOfSight {
        LineOfSight {
            instrument_base,
            range_m: [0.5, 20.0],
            acceptance_rad: 0.5,
            facing_tool: vec![facing],
        }
    }

    fn sees(sight: &LineOfSight) -> bool {
        let arm = nominal_robot().arm;
        let chain = Chain::nominal(&arm, &Joints::default());
        sight.sees(&arm, &chain, &Extrinsics::default(), ToolPoint::Tcp, 0.1)
    }

    #[test]
    fn the_arm_hides_the_tool_from_an_instrument_behind_it() {
        // The arm extends along +x at z = 1.19: from behind, the forearm obstructs the line of sight.
        assert!(sees(&sight(DVec3::new(4.0, 0.0, 1.2), None)));
        assert!(sees(&sight(DVec3::new(0.8, 4.0, 1.2), None)));
        assert!(!sees(&sight(DVec3::new(-4.0, 0.0, 1.2), None)));
    }

    #[test]
    fn a_reflector_takes_the_beam_only_within_its_angle_and_range() {
        let arm = nominal_robot().arm;
        let tool = Chain::nominal(&arm, &Joints::default()).base_from_tool.rotation;
        let towards = |base: DVec3| Some(tool.transpose() * base);
        let instrument = DVec3::new(4.0, 0.0, 1.1865);
        assert!(sees(&sight(instrument, towards(DVec3::X))));
        assert!(!sees(&sight(instrument, towards(DVec3::Y))), "looks aside");
        assert!(!sees(&sight(instrument, towards(DVec3::NEG_X))), "looks away");
        assert!(!sees(&LineOfSight { range_m: [0.5, 2.0], ..sight(instrument, None) }), "too far");
        assert!(!sees(&LineOfSight { range_m: [5.0, 9.0], ..sight(instrument, None) }), "too near");
    }
}
