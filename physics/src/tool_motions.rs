//! Motion of the tool by each joint (Jacobian), for four joints at once.
//!
//! Equal to [`Chain::motion_of`], to rounding.

use crate::lanes::{JointVectors, Lanes, Vec3Lanes};
use crate::{Arm, Chain};
use glam::DVec3;

/// Motion of the tool per unit of each joint, base axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motions {
    /// The TCP, m per rad or per m.
    pub linear: JointVectors,
    /// The tool, rad per rad or per m.
    pub angular: JointVectors,
}

impl Motions {
    /// Computed for a chain of the arm; written over those of the same arm.
    #[inline(always)]
    pub fn take<S: Lanes>(&mut self, lanes: S, arm: &Arm, chain: &Chain) {
        let tcp = Vec3Lanes::same(lanes, chain.base_from_tool.origin);
        for k in 0..S::PARTS {
            let axes = Vec3Lanes::gathered(lanes, &chain.axes, k);
            let levers = tcp.minus(Vec3Lanes::gathered(lanes, &chain.points, k));
            self.linear.put(axes.cross(levers), k);
            self.angular.put(axes, k);
        }
        for i in arm.slides() {
            self.linear.set(i, chain.axis(i));
            self.angular.set(i, DVec3::ZERO);
        }
    }

    /// Copies another, of the same arm, or over the default.
    #[inline(always)]
    pub fn copy<S: Lanes>(&mut self, lanes: S, other: &Self) {
        for k in 0..S::PARTS {
            self.linear.put(other.linear.part(lanes, k), k);
            self.angular.put(other.angular.part(lanes, k), k);
        }
    }
}
