//! Forward kinematics of all axes and the tool: the product of rotations (thesis equations 3.1 to 3.4).
//!
//! Invariants: [`Chain::nominal`] is the controller's own geometry; [`Chain::real`] is the same
//! product with a [`Deviation`]; both agree bit for bit if all entries of the deviation are zero.
//! Loads and effects are computed elsewhere.

use crate::deviation::Deviation;
use crate::frame::rotation_from_vector;
use crate::lane_pose::{Axis, BaseAxis, LanePose, StoredPose, advance_sin_cos};
use crate::lanes::{Kernel, Lanes, PaddedVec3, run_widest};
use crate::trig::sin_cos_all;
use crate::{Arm, Frame, JOINTS_MAX, JointKind, Joints};
use glam::DVec3;
use nalgebra::SMatrix;

/// Motion of the TCP per unit of each joint: rows are linear (m) then angular (rad) in base axes;
/// columns are joints, zero beyond the arm's joint count.
pub type Jacobian = SMatrix<f64, 6, JOINTS_MAX>;

/// The arm at one configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Chain {
    pub(crate) bodies: [StoredPose; JOINTS_MAX],
    pub(crate) axes: [PaddedVec3; JOINTS_MAX],
    pub(crate) points: [PaddedVec3; JOINTS_MAX],
    /// Tool coordinates to base coordinates; its origin is the TCP.
    pub base_from_tool: Frame,
    /// Sine of each joint position.
    sines: Joints,
    cosines: Joints,
    count: usize,
}

impl Default for Chain {
    /// A chain without joints.
    fn default() -> Self {
        Self {
            bodies: [StoredPose::IDENTITY; JOINTS_MAX],
            axes: [PaddedVec3::of(DVec3::ZERO); JOINTS_MAX],
            points: [PaddedVec3::of(DVec3::ZERO); JOINTS_MAX],
            base_from_tool: Frame::IDENTITY,
            sines: [0.0; JOINTS_MAX],
            cosines: [0.0; JOINTS_MAX],
            count: 0,
        }
    }
}

impl Chain {
    /// The controller's geometry at `q` (rad or m).
    pub fn nominal(arm: &Arm, q: &Joints) -> Self {
        let mut chain = Self::default();
        chain.set_nominal(arm, q);
        chain
    }

    /// The geometry at `q` (rad or m) with `deviation`.
    pub fn real(arm: &Arm, q: &Joints, deviation: &Deviation) -> Self {
        let mut chain = Self::default();
        chain.set_deviated(arm, q, deviation, &Self::nominal(arm, q));
        chain
    }

    /// The tool pose at `q`: bit for bit that of [`Chain::nominal`], without the rest of the chain.
    pub fn tool_at(arm: &Arm, q: &Joints) -> Frame {
        run_widest(arm.count(), ToolPoseKernel { arm, q })
    }

    /// [`Chain::nominal`], written over a chain of the same arm.
    pub(crate) fn set_nominal(&mut self, arm: &Arm, q: &Joints) {
        run_widest(arm.count(), NominalKernel { chain: self, arm, q });
    }

    /// The same, with these lanes; `on` is the step from the configuration of this chain to `q`, if
    /// known.
    #[inline(always)]
    pub(crate) fn set_nominal_in<S: Lanes>(
        &mut self,
        lanes: S,
        arm: &Arm,
        q: &Joints,
        on: Option<&Joints>,
    ) {
        self.count = arm.count();
        match on {
            Some(on) => {
                for k in 0..S::PARTS {
                    let before = (lanes.part(&self.sines, k), lanes.part(&self.cosines, k));
                    self.advance_angles(lanes, before, on, k);
                }
            }
            None => sin_cos_all(lanes, q, &mut self.sines, &mut self.cosines),
        }
        let mut carrier = LanePose::of(lanes, &Frame::IDENTITY);
        for (i, joint) in arm.joints().iter().enumerate() {
            let axis = nominal_axis(arm, i);
            carrier = self.place_joint(i, &carrier, &axis, joint.kind, q[i]);
        }
        self.base_from_tool = carrier.frame(&nominal_tool(arm));
    }

    /// [`Chain::real`], written over a chain of the same arm; `nominal` is the arm without the
    /// deviation.
    pub(crate) fn set_deviated(
        &mut self,
        arm: &Arm,
        q: &Joints,
        deviation: &Deviation,
        nominal: &Self,
    ) {
        run_widest(arm.count(), DeviatedKernel { chain: self, arm, q, deviation, nominal });
    }

    #[inline(always)]
    fn set_deviated_in<S: Lanes>(
        &mut self,
        lanes: S,
        arm: &Arm,
        q: &Joints,
        deviation: &Deviation,
        nominal: &Self,
    ) {
        self.count = arm.count();
        for k in 0..S::PARTS {
            let before = (lanes.part(&nominal.sines, k), lanes.part(&nominal.cosines, k));
            self.advance_angles(lanes, before, &deviation.joints, k);
        }
        let mut base = Frame::IDENTITY;
        if deviation.base_turn != DVec3::ZERO {
            base.rotation = rotation_from_vector(deviation.base_turn);
        }
        let (mut carrier, is_of_joints) = (LanePose::of(lanes, &base), deviation.is_of_joints());
        for (i, joint) in arm.joints().iter().enumerate() {
            if let Some(link) = deviation.link(i) {
                carrier = carrier.after(&link.frame());
            }
            let mut axis = nominal_axis(arm, i);
            if let Some(twist) = deviation.axis(i) {
                let moved = twist.frame();
                axis.axis = moved.rotation * joint.axis;
                axis.point = moved.point(joint.point);
                axis.along = BaseAxis::of(axis.axis);
            }
            if !is_of_joints {
                axis.offset = carrier.offset_to(axis.point);
            }
            let position = q[i] + deviation.joints[i];
            carrier = self.place_joint(i, &carrier, &axis, joint.kind, position);
        }
        if let Some(flange) = deviation.link(self.count) {
            carrier = carrier.after(&flange.frame());
        }
        let (tool, shift) = (nominal_tool(arm), deviation.tool_shift);
        self.base_from_tool = if deviation.tool_turn == DVec3::ZERO && shift == DVec3::ZERO {
            carrier.frame(&tool)
        } else {
            let turn = rotation_from_vector(deviation.tool_turn);
            carrier.frame(&LanePose::of(lanes, &tool).frame(&Frame::new(turn, shift)))
        };
    }

    /// Body `i` (moved by joint `i`): from base coordinates at the zero configuration to base coordinates now.
    pub fn body(&self, i: usize) -> Frame {
        self.bodies[i].frame()
    }

    /// The unit vector of joint `i`'s axis now, base frame.
    #[inline(always)]
    pub fn axis(&self, i: usize) -> DVec3 {
        self.axes[i].xyz()
    }

    /// Joint `i`'s point now, base frame, m; of a prismatic joint, before its motion.
    #[inline(always)]
    pub fn point(&self, i: usize) -> DVec3 {
        self.points[i].xyz()
    }

    /// Motion of the TCP (m) and rotation of the tool (rad) per unit of joint `i`, base axes.
    #[inline]
    pub fn motion_of(&self, i: usize, kind: JointKind) -> (DVec3, DVec3) {
        let axis = self.axis(i);
        match kind {
            JointKind::Revolute => (axis.cross(self.base_from_tool.origin - self.point(i)), axis),
            JointKind::Prismatic => (axis, DVec3::ZERO),
        }
    }

    /// Jacobian of the TCP at this configuration.
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

    /// Sines and cosines of joints `4 k` to `4 k + 3`, by the angle difference from those before.
    #[inline(always)]
    fn advance_angles<S: Lanes>(
        &mut self,
        lanes: S,
        before: (S::Four, S::Four),
        by: &Joints,
        k: usize,
    ) {
        let (sines, cosines) = advance_sin_cos(lanes, before, lanes.part(by, k));
        lanes.store(sines, &mut self.sines, k);
        lanes.store(cosines, &mut self.cosines, k);
    }

    /// Adds joint `i`, at `position`, to the body that carries it; returns the pose of its own
    /// body.
    #[inline(always)]
    fn place_joint<S: Lanes>(
        &mut self,
        i: usize,
        carrier: &LanePose<S>,
        axis: &Axis,
        kind: JointKind,
        position: f64,
    ) -> LanePose<S> {
        let turned = (self.sines[i], self.cosines[i]);
        let ((axis, point), body) = carrier.joint(axis, kind, position, turned);
        let lanes = body.lanes();
        (self.axes[i], self.points[i]) =
            (PaddedVec3::put(lanes, axis), PaddedVec3::put(lanes, point));
        self.bodies[i] = body.store();
        body
    }
}

/// The nominal axis of joint `i`.
#[inline(always)]
fn nominal_axis(arm: &Arm, i: usize) -> Axis {
    let joint = &arm.joints()[i];
    Axis { along: arm.along(i), axis: joint.axis, point: joint.point, offset: arm.way(i) }
}

/// The tool on the last body, at the zero configuration.
#[inline(always)]
fn nominal_tool(arm: &Arm) -> Frame {
    Frame::new(arm.tool.base_from_tool, arm.tool.tcp)
}

struct NominalKernel<'a> {
    chain: &'a mut Chain,
    arm: &'a Arm,
    q: &'a Joints,
}

impl Kernel for NominalKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) {
        self.chain.set_nominal_in(lanes, self.arm, self.q, None);
    }
}

struct DeviatedKernel<'a> {
    chain: &'a mut Chain,
    arm: &'a Arm,
    q: &'a Joints,
    deviation: &'a Deviation,
    nominal: &'a Chain,
}

impl Kernel for DeviatedKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) {
        self.chain.set_deviated_in(lanes, self.arm, self.q, self.deviation, self.nominal);
    }
}

struct ToolPoseKernel<'a> {
    arm: &'a Arm,
    q: &'a Joints,
}

impl Kernel for ToolPoseKernel<'_> {
    type Output = Frame;

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) -> Frame {
        let Self { arm, q } = self;
        let (mut sines, mut cosines) = ([0.0; JOINTS_MAX], [0.0; JOINTS_MAX]);
        sin_cos_all(lanes, q, &mut sines, &mut cosines);
        let mut carrier = LanePose::of(lanes, &Frame::IDENTITY);
        for (i, joint) in arm.joints().iter().enumerate() {
            let axis = nominal_axis(arm, i);
            carrier = carrier.joint(&axis, joint.kind, q[i], (sines[i], cosines[i])).1;
        }
        carrier.frame(&nominal_tool(arm))
    }
}
