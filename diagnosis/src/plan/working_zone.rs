//! Working zone in which the tool error is minimised: a box with tool directions, and joint positions with the TCP in it, if reachable.

use super::arm_constraints::ArmConstraints;
use super::inverse_kinematics::solve_tool_axis;
use glam::DVec3;
use physics::{Arm, Joints};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Number of inverse-kinematics starts per position.
const STARTS_MAX: usize = 30;

/// A working zone, base frame.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkingZone {
    /// Lowest and highest corner, m.
    pub corners: [DVec3; 2],
    /// Directions of the tool's z axis, unit length; at least one.
    pub directions: Vec<DVec3>,
}

impl WorkingZone {
    /// About `count` uniformly random joint positions in the zone; fewer if the arm does not reach all of it, none if it reaches nothing.
    #[must_use]
    pub fn positions(
        &self,
        arm: &Arm,
        reach: &ArmConstraints,
        count: usize,
        seed: u64,
    ) -> Vec<Joints> {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let mut found = Vec::new();
        for place in 0..count {
            let Some(along) = self.directions.get(place % self.directions.len().max(1)) else {
                break;
            };
            let share = DVec3::new(rng.random(), rng.random(), rng.random());
            let position = self.corners[0] + (self.corners[1] - self.corners[0]) * share;
            found.extend(joints_at(arm, reach, rng, position, *along));
        }
        found
    }
}

/// Joint positions with the TCP at `position` (base frame, m) and the tool's z axis along `along`, if the constraints are satisfied.
pub(super) fn joints_at(
    arm: &Arm,
    reach: &ArmConstraints,
    rng: &mut ChaCha8Rng,
    position: DVec3,
    along: DVec3,
) -> Option<Joints> {
    for _ in 0..STARTS_MAX {
        let mut start = Joints::default();
        for (i, slot) in start.iter_mut().enumerate().take(arm.count()) {
            let (low, high) = reach.limits(arm, i);
            // Starts within half a turn avoid solutions that differ by whole turns.
            let (low, high) = (low.max(-3.0), high.min(3.0).max(low));
            *slot = low + (high - low).max(0.0) * rng.random::<f64>();
        }
        let found = solve_tool_axis(arm, &start, position, along).filter(|q| reach.allows(arm, q));
        if found.is_some() {
            return found;
        }
    }
    None
}
