//! Derivatives of the effects by the joints: change of the joints' deviations and of the base's
//! rotation by a small step of the joints.
//!
//! Loads of gravity and wrench depend on the motion of the masses and of the TCP with each joint. A
//! step rotates these motions by all joints up to theirs, and the joints beyond shift the moved
//! masses. Memory, temperatures and sensor values are constant.
//!
//! Exact if [`SlopeSums::is_complete`], verified by the conformance suite. Deviations of links, axes and
//! tool are not included.

use crate::lanes::{JointVectors, Lanes, Vec3Lanes, WIDTH};
use crate::laws::Laws;
use crate::{JOINTS_MAX, Joints, Loads, Motions};

/// Derivative of one effect's contribution by the joints, for constant memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Slope {
    /// Independent of the joints.
    Zero,
    /// Not provided.
    Unknown,
    /// Per unit of its joint's position.
    Position(f64),
    /// Per unit of each joint's position.
    Positions(Joints),
    /// Per unit of the load on its joint, rad/Nm or m/N.
    Load {
        /// For the load by gravity.
        gravity: f64,
        /// For the load by the wrench.
        wrench: f64,
    },
    /// Rotation of the base about x and y per unit of the moment about its origin, rad/Nm.
    Base(f64),
}

/// The sums over all effects of a model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub struct SlopeSums {
    /// Deviation of each joint per unit of its own position.
    pub position: Joints,
    /// Deviation per unit of all joints' positions, for the joints whose bit is set in `all_joints_mask`.
    positions: [Joints; JOINTS_MAX],
    all_joints_mask: u32,
    gravity: Joints,
    wrench: Joints,
    base: f64,
    is_coupled: bool,
    /// Whether every joint has the same compliance under gravity and under the wrench.
    is_uniform: bool,
    /// Whether all derivatives are included.
    pub is_complete: bool,
}

impl SlopeSums {
    /// Starts with the laws of joints only.
    pub(crate) fn begin(&mut self, is_whole: bool, laws: &Laws) {
        (self.gravity, self.wrench) = (laws.gravity, laws.wrench);
        (self.is_coupled, self.is_uniform) = (laws.is_compliant, laws.is_even);
        (self.base, self.is_complete, self.all_joints_mask) = (0.0, is_whole, 0);
    }

    /// Adds the slope of an effect of `joint`.
    #[inline(always)]
    pub(crate) fn add(&mut self, joint: Option<usize>, slope: Slope) {
        let joint = joint.unwrap_or(0);
        match slope {
            Slope::Zero => {}
            Slope::Unknown => self.is_complete = false,
            Slope::Position(position) => self.position[joint] += position,
            Slope::Positions(positions) if self.has_all_joints(joint) => {
                let sums = self.positions[joint].iter_mut().zip(positions);
                sums.for_each(|(sum, slope)| *sum += slope);
            }
            Slope::Positions(positions) => {
                self.positions[joint] = positions;
                self.all_joints_mask |= 1 << joint;
            }
            Slope::Load { gravity, wrench } => {
                self.gravity[joint] += gravity;
                self.wrench[joint] += wrench;
                self.is_coupled = true;
                self.is_uniform &= gravity == wrench;
            }
            Slope::Base(base) => {
                self.base += base;
                self.is_coupled = true;
            }
        }
    }

    fn has_all_joints(&self, joint: usize) -> bool {
        self.all_joints_mask >> joint & 1 == 1
    }

    /// The derivatives of the deviations at `loads`; written over those of the same arm.
    #[inline(always)]
    pub fn load_slopes<S: Lanes>(&self, lanes: S, loads: &Loads, into: &mut LoadSlopes) {
        into.turns_base = self.base != 0.0;
        if !self.is_coupled {
            return;
        }
        let (gravity, force) = (loads.gravity, loads.wrench.force);
        let (gravity, force) = (Vec3Lanes::same(lanes, gravity), Vec3Lanes::same(lanes, force));
        let moment = Vec3Lanes::same(lanes, loads.wrench.moment);
        for k in 0..S::PARTS {
            let Motions { linear, angular } = &loads.motions;
            let (linear, angular) = (linear.part(lanes, k), angular.part(lanes, k));
            let (of_gravity, of_wrench) =
                (lanes.part(&self.gravity, k), lanes.part(&self.wrench, k));
            let swung = loads.moment_rates.part(lanes, k).cross(gravity);
            let all = linear.cross_plus(force, swung);
            if self.is_uniform {
                into.moment_slopes[0].put(all, k);
                into.deflections.put(angular.cross_plus(moment, all).times(of_gravity), k);
            } else {
                let pulled = linear.cross(force);
                into.moment_slopes[0].put(swung, k);
                into.moment_slopes[1].put(pulled, k);
                let turned = angular.cross_plus(moment, pulled).times(of_wrench);
                into.deflections.put(turned.plus_times(swung, of_gravity), k);
                into.compliances[1].put(angular.times(of_wrench), k);
            }
            into.compliances[0].put(angular.times(of_gravity), k);
            if into.turns_base {
                let base = lanes.splat(self.base);
                lanes.store(lanes.mul(all.x, base), &mut into.base_x, k);
                lanes.store(lanes.mul(all.y, base), &mut into.base_y, k);
            }
        }
    }

    /// Derivative of joint `i`'s deviation by joints `4 k` to `4 k + 3`, from the result of
    /// [`SlopeSums::load_slopes`] at `loads`. A joint up to the loaded one rotates the loaded axis; a joint
    /// beyond it moves the loads.
    #[inline(always)]
    pub fn row<S: Lanes>(
        &self,
        lanes: S,
        (following, loads): (&LoadSlopes, &Loads),
        (i, k): (usize, usize),
    ) -> S::Four {
        let (group, lane) = (i / WIDTH, i % WIDTH);
        let mut row = lanes.splat(0.0);
        if self.has_all_joints(i) {
            row = lanes.part(&self.positions[i], k);
        }
        if group == k {
            row = lanes.mul_add(lanes.load(OWN_LANE[lane]), lanes.splat(self.position[i]), row);
        }
        if !self.is_coupled {
            return row;
        }
        let (mut before, mut beyond) = (row, row);
        if k <= group {
            let bent = Vec3Lanes::same(lanes, following.deflections.at(i));
            before = loads.motions.angular.part(lanes, k).dot_plus(bent, row);
        }
        if k >= group {
            let bends = Vec3Lanes::same(lanes, following.compliances[0].at(i));
            beyond = following.moment_slopes[0].part(lanes, k).dot_plus(bends, beyond);
            if !self.is_uniform {
                let bends = Vec3Lanes::same(lanes, following.compliances[1].at(i));
                beyond = following.moment_slopes[1].part(lanes, k).dot_plus(bends, beyond);
            }
        }
        if k == group {
            let up_to = lanes.load(LANES_UP_TO[lane]);
            lanes.mul_add(up_to, lanes.sub(before, beyond), beyond)
        } else if k < group {
            before
        } else {
            beyond
        }
    }
}

/// Derivatives of the deviations through the loads.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadSlopes {
    /// Whether the base rotates; its rotation about x and y, rad per unit of each joint's position.
    pub turns_base: bool,
    /// About x.
    pub base_x: Joints,
    /// About y.
    pub base_y: Joints,
    /// Change of the moment about each joint's motion per unit of the joint, Nm: of all loads if
    /// every joint has the same compliance under gravity and wrench, otherwise of each.
    moment_slopes: [JointVectors; 2],
    /// Motion of each joint, times its deflection under these loads.
    compliances: [JointVectors; 2],
    /// Total additional deflection by a rotation of the joint.
    deflections: JointVectors,
}

/// One in the lane of the row's joint.
static OWN_LANE: [[f64; WIDTH]; WIDTH] = lane_masks(false);
/// One in the lanes of joints up to the row's.
static LANES_UP_TO: [[f64; WIDTH]; WIDTH] = lane_masks(true);

const fn lane_masks(below_too: bool) -> [[f64; WIDTH]; WIDTH] {
    let mut rows = [[0.0; WIDTH]; WIDTH];
    let mut i = 0;
    while i < WIDTH {
        let mut k = if below_too { 0 } else { i };
        while k <= i {
            rows[i][k] = 1.0;
            k += 1;
        }
        i += 1;
    }
    rows
}
