//! Derivatives of the tool pose by contributions of effects, on the deviated chain.
//!
//! Derivatives are taken on the real chain at its present deviation, so that unobservable directions have exactly zero derivative. They agree with
//! central differences (property tests).
//!
//! A deviation is the exponential of a twist ξ; a change dξ of it moves what it carries by `J(ξ) dξ`, with the left Jacobian
//! `J = Σ ad_ξᵏ/(k+1)!` (Murray, Li and Sastry, A Mathematical Introduction to Robotic Manipulation, appendix A). Deviations are
//! small: six terms are exact to rounding.

use glam::{DMat3, DVec3};
use physics::frame::Twist;
use physics::{Arm, Chain, Contribution, Evaluation, Frame, JOINTS_MAX, Joints};
use std::cell::OnceCell;

/// A small motion of the tool, base axes, per unit of the parameter that causes it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolMotion {
    /// Rotation, rad.
    pub turn: DVec3,
    /// Translation of the TCP, m.
    pub shift: DVec3,
    /// Changes of the joint positions, rad or m.
    pub joints: Joints,
}

impl ToolMotion {
    /// Displacement of a point fixed to the tool; `lever` is from the TCP to the point, base axes, m.
    #[must_use]
    pub fn point_displacement(&self, lever: DVec3) -> DVec3 {
        self.shift + self.turn.cross(lever)
    }

    /// The motion for the derivative of a contribution, on the arm of `evaluation`; `None` for contributions to loads, torques or forces.
    #[must_use]
    pub fn of(arm: &Arm, evaluation: &Evaluation, change: &Contribution) -> Option<Self> {
        DeviatedArm::of(arm, evaluation).motion(change)
    }

    /// The motion when `joint` of the nominal arm at the configuration `chain` moves by one rad or m.
    #[must_use]
    pub fn of_joint(arm: &Arm, chain: &Chain, joint: usize) -> Self {
        let (shift, turn) = chain.motion_of(joint, arm.joints()[joint].kind);
        let mut joints = Joints::default();
        joints[joint] = 1.0;
        Self { turn, shift, joints }
    }

    /// Sum of two motions.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        let mut joints = self.joints;
        joints.iter_mut().zip(other.joints).for_each(|(sum, joint)| *sum += joint);
        Self { turn: self.turn + other.turn, shift: self.shift + other.shift, joints }
    }

    /// This motion times a scalar.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let joints = self.joints.map(|joint| joint * factor);
        Self { turn: self.turn * factor, shift: self.shift * factor, joints }
    }

    /// The motion from pose `a` of the tool to pose `b` (each with its joint deviations), divided by `step`.
    #[must_use]
    pub fn between(
        (a, a_joints): &(Frame, Joints),
        (b, b_joints): &(Frame, Joints),
        step: f64,
    ) -> Self {
        let turned = b.rotation * a.rotation.transpose();
        Self {
            turn: physics::frame::vector_from_rotation(&turned) / step,
            shift: (b.origin - a.origin) / step,
            joints: std::array::from_fn(|i| (b_joints[i] - a_joints[i]) / step),
        }
    }
}

/// The arm at one evaluation, with the frames at which contributions act; each is computed once.
pub(crate) struct DeviatedArm<'a> {
    arm: &'a Arm,
    pub(crate) evaluation: &'a Evaluation,
    axes: [OnceCell<AxisCarrier>; JOINTS_MAX],
    links: [OnceCell<LinkCarrier>; JOINTS_MAX + 1],
}

/// What carries the axis of a joint, and what the joint carries.
struct AxisCarrier {
    frame: Frame,
    /// Rotation by the joint, in the axes of the carrier.
    turned: DMat3,
    /// The TCP in the axes of the carrier, m, as it is and with the joint's motion undone.
    tcp: [DVec3; 2],
}

/// What carries a link.
struct LinkCarrier {
    frame: Frame,
    /// The TCP in the axes of the carrier, m.
    tcp: DVec3,
    /// Rotation by the link's own deviation; `None` without one.
    bend: Option<DMat3>,
}

impl<'a> DeviatedArm<'a> {
    pub(crate) fn of(arm: &'a Arm, evaluation: &'a Evaluation) -> Self {
        let axes = [const { OnceCell::new() }; JOINTS_MAX];
        let links = [const { OnceCell::new() }; JOINTS_MAX + 1];
        Self { arm, evaluation, axes, links }
    }

    /// [`ToolMotion::of`] this arm.
    pub(crate) fn motion(&self, change: &Contribution) -> Option<ToolMotion> {
        let Self { arm, evaluation, .. } = self;
        let tcp = evaluation.real.base_from_tool.origin;
        match *change {
            Contribution::None => Some(ToolMotion::default()),
            Contribution::Joint { joint, delta } => {
                Some(ToolMotion::of_joint(arm, &evaluation.real, joint).scaled(delta))
            }
            Contribution::Axis { joint, turn, pivot } => {
                let bent = evaluation.deviation.axis(joint).copied().unwrap_or_default();
                let moved = apply_left_jacobian(&bent, &rotation_about(turn, pivot));
                Some(self.axis(joint).displaced(&moved))
            }
            Contribution::LinkTurn { link, turn, pivot } => {
                let bent =
                    evaluation.deviation.link(link).map_or(Twist::default(), |link| link.twist);
                let moved = apply_left_jacobian(&bent, &rotation_about(turn, pivot));
                let LinkCarrier { frame, tcp, .. } = self.link(link);
                Some(twist_as_tool_motion(frame, *tcp, &moved))
            }
            Contribution::LinkShift { link, shift } => {
                let LinkCarrier { frame, bend, .. } = self.link(link);
                let turned = bend.map_or(shift, |bend| bend * shift);
                Some(ToolMotion { shift: frame.rotation * turned, ..ToolMotion::default() })
            }
            Contribution::BaseTurn { turn } => {
                let bent = rotation_about(evaluation.deviation.base_turn, DVec3::ZERO);
                let moved = apply_left_jacobian(&bent, &rotation_about(turn, DVec3::ZERO));
                Some(twist_as_tool_motion(&Frame::IDENTITY, tcp, &moved))
            }
            Contribution::Tool { shift, turn } => {
                let last = arm.count();
                let carrier = after_link(evaluation, last).rotation * arm.tool.base_from_tool;
                let bent = rotation_about(evaluation.deviation.tool_turn, DVec3::ZERO);
                let turned = apply_left_jacobian(&bent, &rotation_about(turn, DVec3::ZERO)).turn;
                let (turn, shift) = (carrier * turned, carrier * shift);
                Some(ToolMotion { turn, shift, ..ToolMotion::default() })
            }
            Contribution::JointLoad { .. }
            | Contribution::GravityTurn { .. }
            | Contribution::Mass { .. }
            | Contribution::Sensor { .. }
            | Contribution::DriveTorque { .. }
            | Contribution::ToolForce(_) => None,
        }
    }

    fn axis(&self, joint: usize) -> &AxisCarrier {
        self.axes[joint].get_or_init(|| {
            let frame = after_link(self.evaluation, joint);
            let inverse = frame.inverse();
            let motion = inverse.after(&self.evaluation.real.body(joint));
            let tcp = inverse.point(self.evaluation.real.base_from_tool.origin);
            let back = motion.inverse().point(tcp);
            AxisCarrier { frame, turned: motion.rotation, tcp: [tcp, back] }
        })
    }

    fn link(&self, link: usize) -> &LinkCarrier {
        self.links[link].get_or_init(|| {
            let frame = before_link(self.evaluation, link);
            let tcp = frame.inverse().point(self.evaluation.real.base_from_tool.origin);
            let bend = self.evaluation.deviation.link(link).map(|link| link.twist.frame().rotation);
            LinkCarrier { frame, tcp, bend }
        })
    }
}

impl AxisCarrier {
    /// Displacement of the joint's axis at constant joint position: the joint's motion `M` becomes `X M X⁻¹`, so what it carries moves by the
    /// difference of `moved` before and after it.
    fn displaced(&self, moved: &Twist) -> ToolMotion {
        let Self { frame, turned, tcp: [tcp, back] } = self;
        let first = moved.turn.cross(*tcp) + moved.velocity;
        let second = turned * (moved.turn.cross(*back) + moved.velocity);
        let turn = moved.turn - turned * moved.turn;
        let shift = frame.rotation * (first - second);
        ToolMotion { turn: frame.rotation * turn, shift, ..ToolMotion::default() }
    }
}

/// The twist of a rotation about a pivot.
fn rotation_about(turn: DVec3, pivot: DVec3) -> Twist {
    let mut twist = Twist::default();
    twist.add(turn, pivot);
    twist
}

/// Lie bracket `[a, b]` of two twists.
fn bracket(a: &Twist, b: &Twist) -> Twist {
    Twist {
        turn: a.turn.cross(b.turn),
        velocity: a.turn.cross(b.velocity) + a.velocity.cross(b.turn),
    }
}

/// The left Jacobian of the exponential at the twist `bent`, applied to `change`.
fn apply_left_jacobian(bent: &Twist, change: &Twist) -> Twist {
    if *bent == Twist::default() {
        return *change;
    }
    let (mut sum, mut term) = (*change, *change);
    for k in 2..=7_u32 {
        let next = bracket(bent, &term);
        let share = 1.0 / f64::from(k);
        term = Twist { turn: next.turn * share, velocity: next.velocity * share };
        sum = Twist { turn: sum.turn + term.turn, velocity: sum.velocity + term.velocity };
    }
    sum
}

/// Frame that carries link `link`, before that link's own deviation.
fn before_link(evaluation: &Evaluation, link: usize) -> Frame {
    match link.checked_sub(1) {
        Some(joint) => evaluation.real.body(joint),
        None => Frame::new(
            physics::frame::rotation_from_vector(evaluation.deviation.base_turn),
            DVec3::ZERO,
        ),
    }
}

/// Frame that carries joint `link`, after that link's own deviation.
fn after_link(evaluation: &Evaluation, link: usize) -> Frame {
    let before = before_link(evaluation, link);
    evaluation.deviation.link(link).map_or(before, |link| before.after(&link.frame()))
}

/// A twist in the axes of `carrier` as a motion of the tool, whose TCP is at `tcp` in these axes.
fn twist_as_tool_motion(carrier: &Frame, tcp: DVec3, twist: &Twist) -> ToolMotion {
    let shift = twist.turn.cross(tcp) + twist.velocity;
    let turn = carrier.rotation * twist.turn;
    ToolMotion { turn, shift: carrier.rotation * shift, ..ToolMotion::default() }
}
