//! How what the effects add follows the arm: what a small step of the joints changes of joints' deviations and of the base's turn.
//!
//! Gravity and wrench pull through how the masses and the TCP move with each joint. A step turns these motions by all that the joints up to theirs turn,
//! and the joints beyond shift what they move. Memory, temperatures and what the sensor reads are taken as they are.
//!
//! Promises: exact where [`Told::is_whole`], held by the conformance suite. Never: a deviation of links, axes or tool.

use crate::lanes::{Lanes, Three, Vectors};
use crate::laws::Laws;
use crate::{JOINTS_MAX, Joints, Loads, Wrench};
use glam::DVec3;

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
    pub fn follow<S: Lanes>(&self, lanes: S, count: usize, loads: &Loads, into: &mut Following) {
        let count = count.min(JOINTS_MAX);
        for (i, own) in OWN.iter().enumerate().take(count) {
            let (row, is_wide) = (&mut into.joints[i], self.is_wide(i));
            for k in 0..S::PARTS {
                let from =
                    if is_wide { lanes.part(&self.positions[i], k) } else { lanes.same(0.0) };
                // One number put among four that were just written would have to wait until these are.
                let own = lanes.part(own, k);
                lanes.put(lanes.times_plus(own, lanes.same(self.position[i]), from), row, k);
            }
        }
        into.turns_base = self.base != 0.0;
        if !self.is_coupled {
            return;
        }
        let Loads { gravity, wrench, .. } = *loads;
        if self.is_even {
            swing(lanes, loads, (gravity, wrench), (&self.gravity, count), into);
        } else {
            let nothing = DVec3::ZERO;
            swing(lanes, loads, (gravity, Wrench::ZERO), (&self.gravity, count), into);
            swing(lanes, loads, (nothing, wrench), (&self.wrench, count), into);
        }
        if into.turns_base {
            if !self.is_even {
                into.pulls.take(lanes, loads, (gravity, wrench));
            }
            for k in 0..S::PARTS {
                let (pulled, base) = (into.pulls.pulled.part(lanes, k), lanes.same(self.base));
                lanes.put(lanes.times(pulled.x, base), &mut into.base_x, k);
                lanes.put(lanes.times(pulled.y, base), &mut into.base_y, k);
            }
        }
    }
}

/// How deviations follow the arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Following {
    /// What each joint deviates more, per unit of each joint's position: a row a joint.
    pub joints: [Joints; JOINTS_MAX],
    /// Whether the base turns; what it turns more about x and y, rad per unit of each joint's position.
    pub turns_base: bool,
    /// About x.
    pub base_x: Joints,
    /// About y.
    pub base_y: Joints,
    pulls: Pulls,
}

impl Default for Following {
    fn default() -> Self {
        let none = [0.0; JOINTS_MAX];
        let pulls = Pulls::default();
        Self { joints: [none; JOINTS_MAX], turns_base: false, base_x: none, base_y: none, pulls }
    }
}

/// What pulls at what moves with each joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Pulls {
    /// How the moment about what the joint does changes, per unit of the joint, Nm.
    pulled: Vectors,
    /// The same, and how the wrench's own moment does.
    turned: Vectors,
}

impl Pulls {
    #[inline(always)]
    fn take<S: Lanes>(&mut self, lanes: S, loads: &Loads, (gravity, wrench): (DVec3, Wrench)) {
        let (gravity, force) = (Three::same(lanes, gravity), Three::same(lanes, wrench.force));
        let moment = Three::same(lanes, wrench.moment);
        for k in 0..S::PARTS {
            let swing = loads.swings.part(lanes, k);
            let linear = loads.motions.linear.part(lanes, k);
            let pulled = linear.cross_plus(force, swing.cross(gravity));
            let angular = loads.motions.angular.part(lanes, k);
            self.pulled.put(pulled, k);
            self.turned.put(angular.cross_plus(moment, pulled), k);
        }
    }
}

/// One where a joint is the row's.
static OWN: [Joints; JOINTS_MAX] = ones(false);
/// One where a joint is not beyond the row's: what it turns, else what pulls at it counts.
static UP_TO: [Joints; JOINTS_MAX] = ones(true);

const fn ones(below_too: bool) -> [Joints; JOINTS_MAX] {
    let mut rows = [[0.0; JOINTS_MAX]; JOINTS_MAX];
    let mut i = 0;
    while i < JOINTS_MAX {
        let mut k = if below_too { 0 } else { i };
        while k <= i {
            rows[i][k] = 1.0;
            k += 1;
        }
        i += 1;
    }
    rows
}

/// Adds what each joint's load changes by per unit of each joint, times its compliance. A joint up to the loaded one turns what is loaded; one beyond it
/// moves what pulls.
#[inline(always)]
fn swing<S: Lanes>(
    lanes: S,
    loads: &Loads,
    pulling: (DVec3, Wrench),
    (compliance, count): (&Joints, usize),
    into: &mut Following,
) {
    into.pulls.take(lanes, loads, pulling);
    let angular = &loads.motions.angular;
    for i in 0..count.min(JOINTS_MAX) {
        if compliance[i] == 0.0 {
            continue;
        }
        let turned = Three::same(lanes, into.pulls.turned.at(i));
        let own = Three::same(lanes, angular.at(i));
        for k in 0..S::PARTS {
            let before = angular.part(lanes, k).dot(turned);
            let beyond = into.pulls.pulled.part(lanes, k).dot(own);
            let up_to = lanes.part(&UP_TO[i], k);
            let change = lanes.times_plus(up_to, lanes.minus(before, beyond), beyond);
            let row = lanes.part(&into.joints[i], k);
            let more = lanes.times_plus(change, lanes.same(compliance[i]), row);
            lanes.put(more, &mut into.joints[i], k);
        }
    }
}
