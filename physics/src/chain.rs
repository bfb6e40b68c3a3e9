//! Where every axis and the tool are, for given joint positions: the product of rotations (thesis equations 3.1 to 3.4).
//!
//! Promises: [`Chain::nominal`] is the controller's own geometry; [`Chain::real`] is the same product with a
//! [`Deviation`] put in; both agree to the bit where the deviation is zero in every entry.
//! Never: a load or an effect.

use crate::deviation::Deviation;
use crate::frame::{coefficients, rotation_from_vector, turned_about};
use crate::trig::sin_cos_all;
use crate::{Arm, Frame, JOINTS_MAX, JointKind, Joints};
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
    /// Sine and cosine of each position.
    turned: [(f64, f64); JOINTS_MAX],
    count: usize,
}

impl Default for Chain {
    /// No arm at all.
    fn default() -> Self {
        Self {
            bodies: [Frame::IDENTITY; JOINTS_MAX],
            axes: [DVec3::ZERO; JOINTS_MAX],
            points: [DVec3::ZERO; JOINTS_MAX],
            base_from_tool: Frame::IDENTITY,
            turned: [(0.0, 0.0); JOINTS_MAX],
            count: 0,
        }
    }
}

impl Chain {
    /// The controller's geometry at `q` (rad or m).
    pub fn nominal(arm: &Arm, q: &Joints) -> Self {
        let mut chain = Self::default();
        chain.stand(arm, q);
        chain
    }

    /// The geometry at `q` (rad or m) with `deviation` put in.
    pub fn real(arm: &Arm, q: &Joints, deviation: &Deviation) -> Self {
        let mut chain = Self::default();
        chain.deviate(arm, q, deviation, &Self::nominal(arm, q));
        chain
    }

    /// Where the tool is at `q`: [`Chain::nominal`]'s to the bit, and nothing else of it.
    pub fn tool_at(arm: &Arm, q: &Joints) -> Frame {
        let mut turned = [(0.0, 0.0); JOINTS_MAX];
        sin_cos_all(&q[..arm.count()], &mut turned);
        let joints = arm.joints().iter().zip(q).zip(&turned);
        let carrier = joints.fold(Frame::IDENTITY, |carrier, ((joint, q), turned)| {
            let axis = (joint.axis, joint.point);
            placed(&carrier, axis, joint.kind, (*q, *turned)).body
        });
        carrier.after(&Frame::new(arm.tool.base_from_tool, arm.tool.tcp))
    }

    /// [`Chain::nominal`] in place of a chain of the same arm.
    pub(crate) fn stand(&mut self, arm: &Arm, q: &Joints) {
        self.count = arm.count();
        sin_cos_all(&q[..self.count], &mut self.turned);
        let mut carrier = Frame::IDENTITY;
        for (i, joint) in arm.joints().iter().enumerate() {
            self.place(i, &carrier, (joint.axis, joint.point), joint.kind, q[i]);
            carrier = self.bodies[i];
        }
        self.base_from_tool = carrier.after(&Frame::new(arm.tool.base_from_tool, arm.tool.tcp));
    }

    /// [`Chain::real`] in place of a chain of the same arm; `nominal` is the arm without the deviation.
    pub(crate) fn deviate(&mut self, arm: &Arm, q: &Joints, deviation: &Deviation, nominal: &Self) {
        self.count = arm.count();
        let mut carrier = Frame::IDENTITY;
        if deviation.base_turn != DVec3::ZERO {
            carrier.rotation = rotation_from_vector(deviation.base_turn);
        }
        for (i, joint) in arm.joints().iter().enumerate() {
            if let Some(link) = deviation.link(i) {
                carrier = carrier.after(&link.frame());
            }
            let axis = deviation.axis(i).map_or((joint.axis, joint.point), |twist| {
                let moved = twist.frame();
                (moved.rotation * joint.axis, moved.point(joint.point))
            });
            let off = deviation.joints[i];
            self.turned[i] = turned_on(nominal.turned[i], off);
            self.place(i, &carrier, axis, joint.kind, q[i] + off);
            carrier = self.bodies[i];
        }
        if let Some(flange) = deviation.link(self.count) {
            carrier = carrier.after(&flange.frame());
        }
        self.base_from_tool = carrier.after(&Frame::new(arm.tool.base_from_tool, arm.tool.tcp));
        if deviation.tool_turn != DVec3::ZERO || deviation.tool_shift != DVec3::ZERO {
            let turn = rotation_from_vector(deviation.tool_turn);
            self.base_from_tool =
                self.base_from_tool.after(&Frame::new(turn, deviation.tool_shift));
        }
    }

    /// How the TCP moves (m) and the tool turns (rad) per unit of joint `i`, base axes.
    #[inline]
    pub fn motion_of(&self, i: usize, kind: JointKind) -> (DVec3, DVec3) {
        let axis = self.axes[i];
        match kind {
            JointKind::Revolute => (axis.cross(self.base_from_tool.origin - self.points[i]), axis),
            JointKind::Prismatic => (axis, DVec3::ZERO),
        }
    }

    /// How the TCP moves with each joint at this configuration.
    pub fn jacobian(&self, arm: &Arm) -> Jacobian {
        let mut jacobian = Jacobian::zeros();
        for (i, joint) in arm.joints().iter().enumerate() {
            let (linear, angular) = self.motion_of(i, joint.kind);
            let column = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z];
            jacobian.column_mut(i).copy_from_slice(&column);
        }
        jacobian
    }

    /// The number of joints.
    pub const fn count(&self) -> usize {
        self.count
    }

    /// Puts joint `i`, at `position`, onto what carries it.
    #[inline]
    fn place(
        &mut self,
        i: usize,
        carrier: &Frame,
        axis: (DVec3, DVec3),
        kind: JointKind,
        position: f64,
    ) {
        let placed = placed(carrier, axis, kind, (position, self.turned[i]));
        (self.axes[i], self.points[i], self.bodies[i]) = (placed.axis, placed.point, placed.body);
    }
}

/// A joint on what carries it.
struct Placed {
    axis: DVec3,
    point: DVec3,
    body: Frame,
}

/// A joint with this axis through this point (zero configuration), at a position with this sine and cosine, onto what carries it.
#[inline(always)]
fn placed(
    carrier: &Frame,
    (axis, point): (DVec3, DVec3),
    kind: JointKind,
    (position, turned): (f64, (f64, f64)),
) -> Placed {
    let point_now = carrier.point(point);
    match kind {
        JointKind::Revolute => {
            let (axis, rotation) = turned_about(&carrier.rotation, axis, turned);
            // What is on the axis stays.
            let body = Frame { rotation, origin: point_now - rotation * point };
            Placed { axis, point: point_now, body }
        }
        JointKind::Prismatic => {
            let axis = carrier.rotation * axis;
            let origin = carrier.origin + axis * position;
            Placed { axis, point: point_now, body: Frame { origin, ..*carrier } }
        }
    }
}

/// Sine and cosine of `q + off`, given those of `q`; the same bits where `off` is zero.
#[inline]
fn turned_on((sin, cos): (f64, f64), off: f64) -> (f64, f64) {
    let square = off * off;
    let [first, second, _] = coefficients(square);
    let (sine, less) = (off * first, square * second);
    (sin + (cos * sine - sin * less), cos - (sin * sine + cos * less))
}
