//! Derivatives of the effects by the joints: change of the joints' deviations and of the base's
//! rotation by a small step of the joints.
//!
//! Loads of gravity and wrench depend on the motion of the masses and of the TCP with each joint. A
//! step rotates these motions by all joints up to theirs, and the joints beyond shift the moved
//! masses. Memory, temperatures and sensor values are constant.
//!
//! Exact if [`Told::is_whole`], verified by the conformance suite. Deviations of links, axes and
//! tool are not included.

use crate::lanes::{Lanes, Three, Vectors, WIDTH};
use crate::laws::Laws;
use crate::{JOINTS_MAX, Joints, Loads, Motions};

/// Derivative of one effect's contribution by the joints, for constant memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Slope {
    /// Independent of the joints.
    Steady,
    /// Not provided.
    Untold,
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
pub struct Told {
    /// Deviation of each joint per unit of its own position.
    pub position: Joints,
    /// Deviation per unit of all joints' positions, for the joints whose bit is set in `are_wide`.
    positions: [Joints; JOINTS_MAX],
    are_wide: u32,
    gravity: Joints,
    wrench: Joints,
    base: f64,
    is_coupled: bool,
    /// Whether every joint has the same compliance under gravity and under the wrench.
    is_even: bool,
    /// Whether all derivatives are included.
    pub is_whole: bool,
}

impl Told {
    /// Starts with the laws of joints only.
    pub(crate) fn begin(&mut self, is_whole: bool, laws: &Laws) {
        (self.gravity, self.wrench) = (laws.gravity, laws.wrench);
        (self.is_coupled, self.is_even) = (laws.is_compliant, laws.is_even);
        (self.base, self.is_whole, self.are_wide) = (0.0, is_whole, 0);
    }

    /// Adds the slope of an effect of `joint`.
    #[inline(always)]
    pub(crate) fn add(&mut self, joint: Option<usize>, slope: Slope) {
        let joint = joint.unwrap_or(0);
        match slope {
            Slope::Steady => {}
            Slope::Untold => self.is_whole = false,
            Slope::Position(position) => self.position[joint] += position,
            Slope::Positions(positions) if self.is_wide(joint) => {
                let sums = self.positions[joint].iter_mut().zip(positions);
                sums.for_each(|(sum, slope)| *sum += slope);
            }
            Slope::Positions(positions) => {
                self.positions[joint] = positions;
                self.are_wide |= 1 << joint;
            }
            Slope::Load { gravity, wrench } => {
                self.gravity[joint] += gravity;
                self.wrench[joint] += wrench;
                self.is_coupled = true;
                self.is_even &= gravity == wrench;
            }
            Slope::Base(base) => {
                self.base += base;
                self.is_coupled = true;
            }
        }
    }

    fn is_wide(&self, joint: usize) -> bool {
        self.are_wide >> joint & 1 == 1
    }

    /// The derivatives of the deviations at `loads`; written over those of the same arm.
    #[inline(always)]
    pub fn follow<S: Lanes>(&self, lanes: S, loads: &Loads, into: &mut Following) {
        into.turns_base = self.base != 0.0;
        if !self.is_coupled {
            return;
        }
        let (gravity, force) = (loads.gravity, loads.wrench.force);
        let (gravity, force) = (Three::same(lanes, gravity), Three::same(lanes, force));
        let moment = Three::same(lanes, loads.wrench.moment);
        for k in 0..S::PARTS {
            let Motions { linear, angular } = &loads.motions;
            let (linear, angular) = (linear.part(lanes, k), angular.part(lanes, k));
            let (of_gravity, of_wrench) =
                (lanes.part(&self.gravity, k), lanes.part(&self.wrench, k));
            let swung = loads.swings.part(lanes, k).cross(gravity);
            let all = linear.cross_plus(force, swung);
            if self.is_even {
                into.pulled[0].put(all, k);
                into.bent.put(angular.cross_plus(moment, all).times(of_gravity), k);
            } else {
                let pulled = linear.cross(force);
                into.pulled[0].put(swung, k);
                into.pulled[1].put(pulled, k);
                let turned = angular.cross_plus(moment, pulled).times(of_wrench);
                into.bent.put(turned.plus_times(swung, of_gravity), k);
                into.bends[1].put(angular.times(of_wrench), k);
            }
            into.bends[0].put(angular.times(of_gravity), k);
            if into.turns_base {
                let base = lanes.same(self.base);
                lanes.put(lanes.times(all.x, base), &mut into.base_x, k);
                lanes.put(lanes.times(all.y, base), &mut into.base_y, k);
            }
        }
    }

    /// Derivative of joint `i`'s deviation by joints `4 k` to `4 k + 3`, from the result of
    /// [`Told::follow`] at `loads`. A joint up to the loaded one rotates the loaded axis; a joint
    /// beyond it moves the loads.
    #[inline(always)]
    pub fn row<S: Lanes>(
        &self,
        lanes: S,
        (following, loads): (&Following, &Loads),
        (i, k): (usize, usize),
    ) -> S::Four {
        let (own, lane) = (i / WIDTH, i % WIDTH);
        let mut row = lanes.same(0.0);
        if self.is_wide(i) {
            row = lanes.part(&self.positions[i], k);
        }
        if own == k {
            row = lanes.times_plus(lanes.of(OWN[lane]), lanes.same(self.position[i]), row);
        }
        if !self.is_coupled {
            return row;
        }
        let (mut before, mut beyond) = (row, row);
        if k <= own {
            let bent = Three::same(lanes, following.bent.at(i));
            before = loads.motions.angular.part(lanes, k).dot_plus(bent, row);
        }
        if k >= own {
            let bends = Three::same(lanes, following.bends[0].at(i));
            beyond = following.pulled[0].part(lanes, k).dot_plus(bends, beyond);
            if !self.is_even {
                let bends = Three::same(lanes, following.bends[1].at(i));
                beyond = following.pulled[1].part(lanes, k).dot_plus(bends, beyond);
            }
        }
        if k == own {
            let up_to = lanes.of(UP_TO[lane]);
            lanes.times_plus(up_to, lanes.minus(before, beyond), beyond)
        } else if k < own {
            before
        } else {
            beyond
        }
    }
}

/// Derivatives of the deviations through the loads.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Following {
    /// Whether the base rotates; its rotation about x and y, rad per unit of each joint's position.
    pub turns_base: bool,
    /// About x.
    pub base_x: Joints,
    /// About y.
    pub base_y: Joints,
    /// Change of the moment about each joint's motion per unit of the joint, Nm: of all loads if
    /// every joint has the same compliance under gravity and wrench, otherwise of each.
    pulled: [Vectors; 2],
    /// Motion of each joint, times its deflection under these loads.
    bends: [Vectors; 2],
    /// Total additional deflection by a rotation of the joint.
    bent: Vectors,
}

/// One in the lane of the row's joint.
static OWN: [[f64; WIDTH]; WIDTH] = ones(false);
/// One in the lanes of joints up to the row's.
static UP_TO: [[f64; WIDTH]; WIDTH] = ones(true);

const fn ones(below_too: bool) -> [[f64; WIDTH]; WIDTH] {
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
