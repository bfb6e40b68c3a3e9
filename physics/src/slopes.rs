//! How what the effects add follows the arm: what a small step of the joints changes of joints' deviations and of the base's turn.
//!
//! Gravity and wrench pull through how the masses and the TCP move with each joint. A step turns these motions by all that the joints up to theirs turn,
//! and the joints beyond shift what they move. Memory, temperatures and what the sensor reads are taken as they are.
//!
//! Promises: exact where [`Told::is_whole`], held by the conformance suite. Never: a deviation of links, axes or tool.

use crate::lanes::{Lanes, Three, Vectors, WIDTH};
use crate::laws::Laws;
use crate::{JOINTS_MAX, Joints, Loads, Motions};

/// How what one effect adds follows the arm, memory as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Slope {
    /// It stays as it is, however the arm moves.
    Steady,
    /// It does not say.
    Untold,
    /// So much per unit of its joint's position.
    Position(f64),
    /// So much per unit of each joint's position.
    Positions(Joints),
    /// So much per unit of the load on its joint, rad/Nm or m/N.
    Load {
        /// Of gravity's load.
        gravity: f64,
        /// Of the wrench's load.
        wrench: f64,
    },
    /// The base's turn about x and y per unit of the moment about its origin, rad/Nm.
    Base(f64),
}

/// The sums of what all effects of a model tell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub struct Told {
    /// Each joint's deviation per unit of its own position.
    pub position: Joints,
    /// Per unit of all joints' positions, of those joints that `are_wide` has a bit for.
    positions: [Joints; JOINTS_MAX],
    are_wide: u32,
    gravity: Joints,
    wrench: Joints,
    base: f64,
    is_coupled: bool,
    /// Whether gravity and the wrench bend every joint alike.
    is_even: bool,
    /// Whether that is all that follows the arm.
    pub is_whole: bool,
}

impl Told {
    /// Nothing was told yet but what the laws of joints do.
    pub(crate) fn begin(&mut self, is_whole: bool, laws: &Laws) {
        (self.gravity, self.wrench) = (laws.gravity, laws.wrench);
        (self.is_coupled, self.is_even) = (laws.is_compliant, laws.is_even);
        (self.base, self.is_whole, self.are_wide) = (0.0, is_whole, 0);
    }

    /// Adds what an effect of `joint` tells.
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

    /// How the deviations follow the arm at `loads`; in place of what followed the same arm.
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

    /// What joint `i` deviates more per unit of joints `4 k` to `4 k + 3`, by what [`Told::follow`] found at `loads`. A joint up to the loaded one turns what is
    /// loaded; one beyond it moves what pulls.
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

/// How deviations follow the arm, as far as loads go.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Following {
    /// Whether the base turns; what it turns more about x and y, rad per unit of each joint's position.
    pub turns_base: bool,
    /// About x.
    pub base_x: Joints,
    /// About y.
    pub base_y: Joints,
    /// How the moment about what a joint does changes, per unit of the joint, Nm: of all loads where gravity and the wrench bend every joint alike, else of each.
    pulled: [Vectors; 2],
    /// What each joint does, times what it bends under these loads.
    bends: [Vectors; 2],
    /// What bends each joint more as it is turned, in all.
    bent: Vectors,
}

/// One where a joint of four is the row's.
static OWN: [[f64; WIDTH]; WIDTH] = ones(false);
/// One where it is not beyond the row's.
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
