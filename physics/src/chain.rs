//! Where every axis and the tool are, for given joint positions: the product of rotations (thesis equations 3.1 to 3.4).
//!
//! Promises: [`Chain::nominal`] is the controller's own geometry; [`Chain::real`] is the same product with a
//! [`Deviation`] put in; both agree to the bit where the deviation is zero in every entry.
//! Never: a load or an effect.

use crate::deviation::{Deviation, LinkDeviation};
use crate::frame::{Twist, rotation_about, rotation_from_vector};
use crate::{Arm, Frame, JOINTS_MAX, Joint, JointKind, Joints};
use glam::DVec3;
use nalgebra::SMatrix;

/// How the TCP moves per unit of each joint: rows are linear (m) then angular (rad) in base axes; columns are
/// joints, zero beyond the arm's joint count.
pub type Jacobian = SMatrix<f64, 6, JOINTS_MAX>;

/// The arm at one configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain {
    /// Body `i` (moved by joint `i`): from base coordinates at the zero configuration to base coordinates now.
    pub bodies: [Frame; JOINTS_MAX],
    /// Unit vectors of the axes now, base frame.
    pub axes: [DVec3; JOINTS_MAX],
    /// The joints' points now, base frame, m.
    pub points: [DVec3; JOINTS_MAX],
    /// Tool coordinates to base coordinates; its origin is the TCP.
    pub base_from_tool: Frame,
    count: usize,
}

impl Chain {
    /// The controller's geometry at `q` (rad or m).
    pub fn nominal(arm: &Arm, q: &Joints) -> Self {
        let mut chain = Self::empty(arm);
        let mut carried = Frame::IDENTITY;
        for (i, joint) in arm.joints().iter().enumerate() {
            carried = chain.place(i, &carried, joint.axis, joint.point, joint.kind, q[i]);
        }
        chain.base_from_tool = carried.after(&Frame::new(arm.tool.base_from_tool, arm.tool.tcp));
        chain
    }

    /// The geometry at `q` (rad or m) with `deviation` put in.
    pub fn real(arm: &Arm, q: &Joints, deviation: &Deviation) -> Self {
        let mut chain = Self::empty(arm);
        let mut carried = Frame::new(rotation_from_vector(deviation.base_turn), DVec3::ZERO);
        for (i, joint) in arm.joints().iter().enumerate() {
            carried = carried_by(carried, &deviation.links[i]);
            let (axis, point) = deviated_axis(joint, &deviation.axes[i]);
            let position = q[i] + deviation.joints[i];
            carried = chain.place(i, &carried, axis, point, joint.kind, position);
        }
        carried = carried_by(carried, &deviation.links[arm.count()]);
        let tool = Frame::new(arm.tool.base_from_tool, arm.tool.tcp);
        let shifted = Frame::new(rotation_from_vector(deviation.tool_turn), deviation.tool_shift);
        chain.base_from_tool = carried.after(&tool).after(&shifted);
        chain
    }

    /// How the TCP moves with each joint at this configuration.
    pub fn jacobian(&self, arm: &Arm) -> Jacobian {
        let mut jacobian = Jacobian::zeros();
        for (i, joint) in arm.joints().iter().enumerate() {
            let (linear, angular) = match joint.kind {
                JointKind::Revolute => {
                    (self.axes[i].cross(self.base_from_tool.origin - self.points[i]), self.axes[i])
                }
                JointKind::Prismatic => (self.axes[i], DVec3::ZERO),
            };
            let column = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z];
            jacobian.column_mut(i).copy_from_slice(&column);
        }
        jacobian
    }

    /// The number of joints.
    pub const fn count(&self) -> usize {
        self.count
    }

    fn empty(arm: &Arm) -> Self {
        Self {
            bodies: [Frame::IDENTITY; JOINTS_MAX],
            axes: [DVec3::ZERO; JOINTS_MAX],
            points: [DVec3::ZERO; JOINTS_MAX],
            base_from_tool: Frame::IDENTITY,
            count: arm.count(),
        }
    }

    /// Puts joint `i` onto what carries it and returns what it carries.
    fn place(
        &mut self,
        i: usize,
        carrier: &Frame,
        axis: DVec3,
        point: DVec3,
        kind: JointKind,
        position: f64,
    ) -> Frame {
        let motion = match kind {
            JointKind::Revolute => Frame::about(point, rotation_about(axis, position)),
            JointKind::Prismatic => Frame::translation(axis * position),
        };
        self.axes[i] = carrier.rotation * axis;
        self.points[i] = carrier.point(point);
        self.bodies[i] = carrier.after(&motion);
        self.bodies[i]
    }
}

/// A joint's axis and point at the zero configuration with the deviation of the axis alone.
fn deviated_axis(joint: &Joint, axis: &Twist) -> (DVec3, DVec3) {
    if *axis == Twist::default() {
        return (joint.axis, joint.point);
    }
    let moved = axis.frame();
    (moved.rotation * joint.axis, moved.point(joint.point))
}

fn carried_by(carried: Frame, link: &LinkDeviation) -> Frame {
    if *link == LinkDeviation::default() { carried } else { carried.after(&link.frame()) }
}
