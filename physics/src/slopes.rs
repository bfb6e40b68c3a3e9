//! How what the effects add follows the arm: what a small step of the joints changes of joints' deviations and of the base's turn.
//!
//! Gravity and wrench pull through how the masses and the TCP move with each joint. A step turns these motions by all that the joints up to theirs turn,
//! and the joints beyond shift what they move. Memory, temperatures and what the sensor reads are taken as they are.
//!
//! Promises: exact where [`Told::is_whole`], held by the conformance suite. Never: a deviation of links, axes or tool.

use crate::{Arm, Evaluation, JOINTS_MAX, Joints, Loads};
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
    gravity: Joints,
    wrench: Joints,
    base: f64,
    is_coupled: bool,
    /// Whether that is all that follows the arm.
    pub is_whole: bool,
}

impl Told {
    /// Nothing was told yet.
    pub(crate) fn clear(&mut self, is_whole: bool) {
        let none = [0.0; JOINTS_MAX];
        (self.position, self.gravity, self.wrench) = (none, none, none);
        (self.base, self.is_coupled, self.is_whole) = (0.0, false, is_whole);
    }

    /// Adds what an effect of `joint` tells.
    #[inline(always)]
    pub(crate) fn add(&mut self, joint: Option<usize>, slope: Slope) {
        let joint = joint.unwrap_or(0);
        match slope {
            Slope::Steady => {}
            Slope::Untold => self.is_whole = false,
            Slope::Position(position) => self.position[joint] += position,
            Slope::Load { gravity, wrench } => {
                self.gravity[joint] += gravity;
                self.wrench[joint] += wrench;
                self.is_coupled = true;
            }
            Slope::Base(base) => {
                self.base += base;
                self.is_coupled = true;
            }
        }
    }

    /// How much more each joint deviates, and the base turns (rad), for a small step of the joints at `seen`.
    pub fn follow(&self, arm: &Arm, seen: &Evaluation, step: &Joints) -> (Joints, DVec3) {
        let (mut more, count) = ([0.0; JOINTS_MAX], arm.count());
        let own = more.iter_mut().zip(&self.position).zip(step);
        own.take(count).for_each(|((more, slope), step)| *more = slope * step);
        if !self.is_coupled {
            return (more, DVec3::ZERO);
        }
        let Loads { gravity, wrench, .. } = seen.loads;
        let motions = seen.loads.motions[..count].iter().zip(step);
        let mut turn: DVec3 = motions.map(|(motion, step)| motion.angular * *step).sum();
        // How the first moment of all beyond a joint moves, and the TCP with what is beyond.
        let (mut swung, mut reached) = (DVec3::ZERO, DVec3::ZERO);
        for i in (0..count).rev() {
            let (motion, step) = (&seen.loads.motions[i], step[i]);
            let (by_gravity, by_force) = (gravity.cross(turn), wrench.force.cross(turn));
            let gravity = motion.swing.dot(by_gravity) + motion.angular.dot(swung.cross(gravity));
            let wrench = motion.linear.dot(by_force)
                + motion.angular.dot(wrench.moment.cross(turn) + reached.cross(wrench.force));
            more[i] += self.gravity[i] * gravity + self.wrench[i] * wrench;
            swung += motion.swing * step;
            reached += motion.linear * step;
            turn -= motion.angular * step;
        }
        let moment = swung.cross(gravity) + reached.cross(wrench.force);
        (more, DVec3::new(moment.x, moment.y, 0.0) * self.base)
    }
}
