//! Contributions of effects to the controller's geometry.
//!
//! Invariants: contributions add up in any order (to rounding); a zero deviation changes nothing.
//! Whether a deviation is small is not checked.

use crate::cut::ForceTerm;
use crate::drive::DriveTerm;
use crate::frame::Twist;
use crate::lanes::{Kernel, Lanes, Vec3Lanes, run_widest};
use crate::{Chain, Frame, JOINTS_MAX, Joints, Motions, Wrench};
use glam::DVec3;

/// Contribution of one effect, at the place where it acts. Joints and links are 0-based.
///
/// Link `k` is the body between joint `k − 1` and joint `k`: link 0 is the base, link `n` the
/// flange. A derivative of an effect by a parameter is a contribution too, because all of these are
/// linear.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Contribution {
    /// Nothing.
    #[default]
    None,
    /// An addition to the position of joint `joint`, rad or m.
    Joint {
        /// 0-based joint.
        joint: usize,
        /// Actual minus commanded, rad or m.
        delta: f64,
    },
    /// Joint `joint`'s axis alone turns about `pivot`; the rest of the zero configuration is
    /// unchanged.
    Axis {
        /// 0-based joint.
        joint: usize,
        /// Rotation vector, zero configuration, base axes, rad.
        turn: DVec3,
        /// A point on the axis, zero configuration, base frame, m.
        pivot: DVec3,
    },
    /// Everything that link `link` carries turns about `pivot`.
    LinkTurn {
        /// 0-based link.
        link: usize,
        /// Rotation vector, base axes as carried from the zero configuration, rad.
        turn: DVec3,
        /// Fixed point, base frame at the zero configuration, m.
        pivot: DVec3,
    },
    /// Everything that link `link` carries, including the joint after it, is shifted.
    LinkShift {
        /// 0-based link.
        link: usize,
        /// Shift, base axes at the zero configuration, m.
        shift: DVec3,
    },
    /// The whole robot turns about the base frame's origin.
    BaseTurn {
        /// Rotation vector, base axes, rad.
        turn: DVec3,
    },
    /// A displacement of the TCP and a rotation of the tool.
    Tool {
        /// Shift of the TCP, tool axes, m.
        shift: DVec3,
        /// Rotation vector, tool axes, rad.
        turn: DVec3,
    },
    /// A load on joint `joint`, Nm or N, besides gravity and wrench.
    JointLoad {
        /// 0-based joint.
        joint: usize,
        /// Positive in the joint's positive sense.
        load: f64,
    },
    /// Gravity as the base sees it is turned by this rotation vector, base axes, rad.
    GravityTurn {
        /// Rotation vector of the robot's base: gravity becomes `Rᵀ g`.
        turn: DVec3,
    },
    /// A mass at the flange that the arm does not include.
    Mass {
        /// kg.
        mass: f64,
        /// First moment `m c` with `c` the centre at the zero configuration, base frame, kg m.
        first_moment: DVec3,
    },
    /// Errors of the force sensor, tool axes: actual `= R(turn) (measured − bias) / (1 + scale)`,
    /// axis by axis.
    Sensor {
        /// Additive error.
        bias: Wrench,
        /// Relative error.
        scale: Wrench,
        /// Rotation vector of the sensor's mounting, rad.
        turn: DVec3,
    },
    /// Additional torque of the drive of joint `joint`, besides the rigid body's; [`crate::DriveTorques`]
    /// adds these up.
    DriveTorque {
        /// 0-based joint.
        joint: usize,
        /// The term, positive in the joint's positive sense.
        term: DriveTerm,
    },
    /// A change of the force of a cut, or of the measured force; [`crate::CutForce`] adds these up.
    ToolForce(ForceTerm),
}

impl Contribution {
    /// This contribution times a number.
    pub fn times(&self, factor: f64) -> Self {
        let mut scaled = *self;
        match &mut scaled {
            Self::None => {}
            Self::Joint { delta, .. } => *delta *= factor,
            Self::Axis { turn, .. } | Self::LinkTurn { turn, .. } => *turn *= factor,
            Self::LinkShift { shift, .. } => *shift *= factor,
            Self::BaseTurn { turn } | Self::GravityTurn { turn } => *turn *= factor,
            Self::Tool { shift, turn } => {
                *shift *= factor;
                *turn *= factor;
            }
            Self::JointLoad { load, .. } => *load *= factor,
            Self::Mass { mass, first_moment } => {
                *mass *= factor;
                *first_moment *= factor;
            }
            Self::Sensor { bias, scale, turn } => {
                *bias = bias.times(factor);
                *scale = scale.times(factor);
                *turn *= factor;
            }
            Self::ToolForce(term) => *term = term.times(factor),
            Self::DriveTorque { term, .. } => *term = term.times(factor),
        }
        scaled
    }

    /// The difference of two contributions of the same effect, which act at the same place; if one
    /// of them is `None`, the other one. Contributions at different places have no difference:
    /// `None`.
    pub fn minus(&self, other: &Self) -> Self {
        let mut difference = *self;
        match (&mut difference, other) {
            (_, Self::None) => {}
            (Self::None, _) => return other.times(-1.0),
            (Self::Joint { delta, .. }, Self::Joint { delta: b, .. }) => *delta -= b,
            (Self::Axis { turn, .. }, Self::Axis { turn: b, .. })
            | (Self::LinkTurn { turn, .. }, Self::LinkTurn { turn: b, .. })
            | (Self::BaseTurn { turn }, Self::BaseTurn { turn: b })
            | (Self::GravityTurn { turn }, Self::GravityTurn { turn: b }) => *turn -= *b,
            (Self::LinkShift { shift, .. }, Self::LinkShift { shift: b, .. }) => *shift -= *b,
            (Self::Tool { shift, turn }, Self::Tool { shift: s, turn: t }) => {
                *shift -= *s;
                *turn -= *t;
            }
            (Self::JointLoad { load, .. }, Self::JointLoad { load: b, .. }) => *load -= b,
            (Self::Mass { mass, first_moment }, Self::Mass { mass: m, first_moment: s }) => {
                *mass -= m;
                *first_moment -= *s;
            }
            (Self::Sensor { bias, scale, turn }, Self::Sensor { bias: b, scale: s, turn: t }) => {
                *bias = bias.plus(&b.times(-1.0));
                *scale = scale.plus(&s.times(-1.0));
                *turn -= *t;
            }
            (Self::ToolForce(term), Self::ToolForce(b)) => *term = term.minus(*b),
            (Self::DriveTorque { term, .. }, Self::DriveTorque { term: b, .. }) => {
                *term = term.minus(*b);
            }
            _ => return Self::None,
        }
        difference
    }
}

/// The deviation of one link: turns about pivots, then (nearer to the tool) a shift.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkDeviation {
    /// Turns, base axes and frame at the zero configuration.
    pub twist: Twist,
    /// Shift, base axes at the zero configuration, m.
    pub shift: DVec3,
}

impl LinkDeviation {
    /// The rigid motion of this deviation.
    pub fn frame(&self) -> Frame {
        self.twist.frame().after(&Frame::translation(self.shift))
    }
}

/// Motion of the tool, m and rad, for given steps of the joints.
struct ByJoints<'a> {
    by: &'a Joints,
    motions: &'a Motions,
}

impl Kernel for ByJoints<'_> {
    type Output = (DVec3, DVec3);

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) -> (DVec3, DVec3) {
        let none = Vec3Lanes::same(lanes, DVec3::ZERO);
        let (mut linear, mut angular) = (none, none);
        for k in 0..S::PARTS {
            let by = lanes.part(self.by, k);
            linear = linear.plus_times(self.motions.linear.part(lanes, k), by);
            angular = angular.plus_times(self.motions.angular.part(lanes, k), by);
        }
        (linear.sum(), angular.sum())
    }
}

/// The sum of all contributions to the geometry.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Deviation {
    /// Actual minus commanded per joint, rad or m.
    pub joints: Joints,
    axes: [Twist; JOINTS_MAX],
    links: [LinkDeviation; JOINTS_MAX + 1],
    /// One bit per axis and per link with a contribution.
    moved: u32,
    bent: u32,
    /// The whole robot about the base origin: rotation vector, rad.
    pub base_turn: DVec3,
    /// Shift of the TCP, tool axes, m.
    pub tool_shift: DVec3,
    /// Turn of the tool, tool axes, rad.
    pub tool_turn: DVec3,
}

impl Default for Deviation {
    fn default() -> Self {
        Self {
            joints: [0.0; JOINTS_MAX],
            axes: [Twist::default(); JOINTS_MAX],
            links: [LinkDeviation::default(); JOINTS_MAX + 1],
            moved: 0,
            bent: 0,
            base_turn: DVec3::ZERO,
            tool_shift: DVec3::ZERO,
            tool_turn: DVec3::ZERO,
        }
    }
}

impl Deviation {
    /// The displacement of joint `i`'s axis alone, base axes and frame at the zero configuration;
    /// `None` without one.
    #[inline]
    pub fn axis(&self, i: usize) -> Option<&Twist> {
        (self.moved >> i & 1 == 1).then(|| &self.axes[i])
    }

    /// The deviation of link `link`, 0 (base) to `n` (flange); `None` without one.
    #[inline]
    pub fn link(&self, link: usize) -> Option<&LinkDeviation> {
        (self.bent >> link & 1 == 1).then(|| &self.links[link])
    }

    /// Whether no axis and no link deviates.
    #[inline(always)]
    pub(crate) fn is_of_joints(&self) -> bool {
        self.moved | self.bent == 0
    }

    /// The displacement of the TCP (m) and the rotation of the tool (rad) to first order, base
    /// axes; `chain` is the arm without deviation, `motions` its Jacobian.
    pub fn moves(&self, chain: &Chain, motions: &Motions) -> (DVec3, DVec3) {
        let tool = &chain.base_from_tool;
        let (linear, angular) = run_widest(chain.count(), ByJoints { by: &self.joints, motions });
        let mut sum = Twist { turn: self.base_turn, velocity: DVec3::ZERO };
        let carrier = |link: usize| match link {
            0 => Frame::IDENTITY,
            _ => chain.body(link - 1),
        };
        if !self.is_of_joints() {
            for i in 0..=chain.count() {
                if let Some(axis) = self.axis(i) {
                    // What a displaced axis adds at its joint's zero, it subtracts again at its
                    // position.
                    sum.follow(axis, &carrier(i), 1.0);
                    sum.follow(axis, &chain.body(i), -1.0);
                }
                if let Some(by) = self.link(i) {
                    let velocity = by.twist.velocity + by.shift;
                    sum.follow(&Twist { velocity, ..by.twist }, &carrier(i), 1.0);
                }
            }
        }
        let shift = tool.rotation * self.tool_shift;
        let turn = tool.rotation * self.tool_turn;
        let moved = linear + sum.velocity + sum.turn.cross(tool.origin) + shift;
        (moved, angular + sum.turn + turn)
    }

    /// Resets the deviation to zero.
    pub(crate) fn clear(&mut self) {
        self.joints = [0.0; JOINTS_MAX];
        while self.moved != 0 {
            self.axes[self.moved.trailing_zeros() as usize] = Twist::default();
            self.moved &= self.moved - 1;
        }
        while self.bent != 0 {
            self.links[self.bent.trailing_zeros() as usize] = LinkDeviation::default();
            self.bent &= self.bent - 1;
        }
        self.base_turn = DVec3::ZERO;
        self.tool_shift = DVec3::ZERO;
        self.tool_turn = DVec3::ZERO;
    }

    /// Adds a contribution to the geometry; contributions to loads and torques are ignored.
    #[inline(always)]
    pub fn add(&mut self, contribution: &Contribution) {
        match *contribution {
            Contribution::Joint { joint, delta } => self.joints[joint] += delta,
            Contribution::Axis { joint, turn, pivot } => {
                self.moved |= 1 << joint;
                self.axes[joint].add(turn, pivot);
            }
            Contribution::LinkTurn { link, turn, pivot } => {
                self.bent |= 1 << link;
                self.links[link].twist.add(turn, pivot);
            }
            Contribution::LinkShift { link, shift } => {
                self.bent |= 1 << link;
                self.links[link].shift += shift;
            }
            Contribution::BaseTurn { turn } => self.base_turn += turn,
            Contribution::Tool { shift, turn } => {
                self.tool_shift += shift;
                self.tool_turn += turn;
            }
            _ => {}
        }
    }
}
