//! How the tool moves with each joint, four joints at once.
//!
//! Promises: those of [`Chain::motion_of`], to rounding. Never: a load or an effect.

use crate::lanes::{Lanes, Three, Vectors};
use crate::{Arm, Chain};
use glam::DVec3;

/// How the tool moves per unit of each joint, base axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motions {
    /// The TCP, m per rad or per m.
    pub linear: Vectors,
    /// The tool, rad per rad or per m.
    pub angular: Vectors,
}

impl Motions {
    /// On a chain of the arm; in place of those of the same arm.
    #[inline(always)]
    pub fn take<S: Lanes>(&mut self, lanes: S, arm: &Arm, chain: &Chain) {
        let tcp = Three::same(lanes, chain.base_from_tool.origin);
        for k in 0..S::PARTS {
            let axes = Three::gathered(lanes, &chain.axes, k);
            let levers = tcp.minus(Three::gathered(lanes, &chain.points, k));
            self.linear.put(axes.cross(levers), k);
            self.angular.put(axes, k);
        }
        for i in arm.slides() {
            self.linear.set(i, chain.axis(i));
            self.angular.set(i, DVec3::ZERO);
        }
    }

    /// Those of another, of the same arm or of none before.
    #[inline(always)]
    pub fn copy<S: Lanes>(&mut self, lanes: S, other: &Self) {
        for k in 0..S::PARTS {
            self.linear.put(other.linear.part(lanes, k), k);
            self.angular.put(other.angular.part(lanes, k), k);
        }
    }
}
