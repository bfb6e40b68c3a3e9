//! How what the effects add follows the arm: what a small step of the joints changes of joints' deviations and of the base's turn.
//!
//! Gravity and wrench pull through how the masses and the TCP move with each joint. A step turns these motions by all that the joints up to theirs turn,
//! and the joints beyond shift what they move. Memory, temperatures and what the sensor reads are taken as they are.
//!
//! Promises: exact where [`Told::is_whole`], held by the conformance suite. Never: a deviation of links, axes or tool.

use crate::loads::Motion;
use crate::{Arm, Evaluation, JOINTS_MAX, Joints, Loads, Wrench};
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
    /// Nothing was told yet.
    pub(crate) fn clear(&mut self, is_whole: bool) {
        let none = [0.0; JOINTS_MAX];
        (self.position, self.gravity, self.wrench) = (none, none, none);
        (self.base, self.is_coupled, self.is_even, self.is_whole) = (0.0, false, true, is_whole);
        self.are_wide = 0;
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

    /// How much more each joint deviates, and the base turns (rad), for a small step of the joints at `seen`.
    pub fn follow(&self, arm: &Arm, seen: &Evaluation, step: &Joints) -> (Joints, DVec3) {
        let (mut more, count) = ([0.0; JOINTS_MAX], arm.count());
        let own = more.iter_mut().zip(&self.position).zip(step);
        own.take(count).for_each(|((more, slope), step)| *more = slope * step);
        for joint in (0..count).filter(|joint| self.is_wide(*joint)) {
            let slopes = self.positions[joint].iter().zip(step).take(count);
            more[joint] += slopes.map(|(slope, step)| slope * step).sum::<f64>();
        }
        if !self.is_coupled {
            return (more, DVec3::ZERO);
        }
        let Loads { gravity, wrench, .. } = seen.loads;
        let motions = &seen.loads.motions[..count];
        let mut moment = DVec3::ZERO;
        if self.is_even {
            moment += swing(motions, step, (gravity, wrench), &self.gravity, &mut more);
        } else {
            moment += swing(motions, step, (gravity, Wrench::ZERO), &self.gravity, &mut more);
            moment += swing(motions, step, (DVec3::ZERO, wrench), &self.wrench, &mut more);
        }
        (more, DVec3::new(moment.x, moment.y, 0.0) * self.base)
    }
}

/// Adds to `more` what a small step of the joints changes of each joint's load, times its compliance; how the moment about the base's origin changes, Nm.
fn swing(
    motions: &[Motion],
    step: &Joints,
    (gravity, wrench): (DVec3, Wrench),
    compliance: &Joints,
    more: &mut Joints,
) -> DVec3 {
    // What the joints up to this one turn, and how the moment of what the joints beyond it move changes.
    let steps = motions.iter().zip(step);
    let mut turn: DVec3 = steps.map(|(motion, step)| motion.angular * *step).sum();
    let mut moment = DVec3::ZERO;
    for (i, motion) in motions.iter().enumerate().rev() {
        let pulled = motion.swing.cross(gravity) + motion.linear.cross(wrench.force);
        let turned = pulled + motion.angular.cross(wrench.moment);
        more[i] += compliance[i] * (turn.dot(turned) + motion.angular.dot(moment));
        moment += pulled * step[i];
        turn -= motion.angular * step[i];
    }
    moment
}
