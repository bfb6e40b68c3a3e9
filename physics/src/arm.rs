//! The controller's geometry: axes, points on them, bodies and the tool, at the zero configuration.
//!
//! Invariant: an [`Arm`] is valid: axes are unit vectors, limits are ordered, all values are
//! finite. Deviations from this geometry are in [`crate::effects`].

use crate::lane_pose::BaseAxis;
use crate::{JOINTS_MAX, Joints};
use glam::{DMat3, DVec3};
use thiserror::Error;

/// Gravity unless a model states another one, base axes, m/s².
pub const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.80665);

/// How a joint moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JointKind {
    /// Turns about its axis; positions in rad.
    #[default]
    Revolute,
    /// Slides along its axis; positions in m.
    Prismatic,
}

/// A rigid body at the zero configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Mass, kg, above zero.
    pub mass: f64,
    /// Centre of mass at the zero configuration, base frame, m.
    pub centre: DVec3,
    /// Inertia about the centre of mass, base axes at the zero configuration, kg m²; zero for a point mass.
    pub inertia: DMat3,
}

impl Body {
    /// A point mass: `mass` in kg at `centre` in m.
    pub const fn point_mass(mass: f64, centre: DVec3) -> Self {
        Self { mass, centre, inertia: DMat3::ZERO }
    }
}

/// One joint and the body that it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Revolute or prismatic.
    pub kind: JointKind,
    /// Unit vector of the axis at the zero configuration, base frame; the positive sense.
    pub axis: DVec3,
    /// A point on the axis at the zero configuration, base frame, m. It is the joint's pivot.
    pub point: DVec3,
    /// Least and largest position, rad or m.
    pub limits: (f64, f64),
    /// Largest speed, rad/s or m/s; infinite where unknown.
    pub max_speed: f64,
    /// The body that this joint moves, where its mass is known.
    pub link: Option<Body>,
}

/// The tool at the zero configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tool {
    /// Tool centre point at the zero configuration, base frame, m.
    pub tcp: DVec3,
    /// Rotation from tool axes to base axes at the zero configuration.
    pub base_from_tool: DMat3,
    /// The tool's own mass, where known.
    pub body: Option<Body>,
}

/// A serial arm of 1 to [`JOINTS_MAX`] joints, base to flange, with its tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm {
    joints: [Joint; JOINTS_MAX],
    along: [BaseAxis; JOINTS_MAX],
    /// Vector to each joint's point from that of the previous joint, of the first from the base's
    /// origin, m.
    ways: [DVec3; JOINTS_MAX],
    /// The first moment of each link about its joint's point, kg m.
    moments: [DVec3; JOINTS_MAX],
    /// One bit per prismatic joint.
    slides: u32,
    count: usize,
    /// The tool.
    pub tool: Tool,
    /// Gravity in the base frame, m/s².
    pub gravity: DVec3,
}

/// Why an arm is not valid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum ArmError {
    /// No joint, or more than [`JOINTS_MAX`].
    #[error("an arm has 1 to {JOINTS_MAX} joints, this one has {0}")]
    JointCount(usize),
    /// The axis of a joint (1-based) is not of unit length to 1e-6.
    #[error("joint {joint}: its axis has length {length}, expected 1 within 1e-6")]
    AxisLength {
        /// 1-based joint.
        joint: usize,
        /// The length found.
        length: f64,
    },
    /// The limits of a joint (1-based) are reversed or not finite.
    #[error("joint {0}: its limits must be finite, the lower below the upper")]
    Limits(usize),
    /// A value of a joint (1-based) is not finite, or a mass or speed is not above zero.
    #[error("joint {0}: points must be finite, masses and speeds above zero")]
    JointNumbers(usize),
    /// The tool's values are not finite, or its rotation is not a right-handed rotation to 1e-6.
    #[error(
        "the tool: numbers must be finite, the rotation right-handed and orthonormal within 1e-6"
    )]
    Tool,
    /// Gravity is not finite.
    #[error("gravity must be finite")]
    Gravity,
}

impl Arm {
    /// An arm from its joints, base to flange.
    ///
    /// # Errors
    /// Why the arm is not valid, see [`ArmError`].
    pub fn new(joints: &[Joint], tool: Tool, gravity: DVec3) -> Result<Self, ArmError> {
        let Some(first) = joints.first() else { return Err(ArmError::JointCount(0)) };
        if joints.len() > JOINTS_MAX {
            return Err(ArmError::JointCount(joints.len()));
        }
        let mut all = [*first; JOINTS_MAX];
        for (i, (slot, joint)) in all.iter_mut().zip(joints).enumerate() {
            *slot = checked(*joint, i + 1)?;
        }
        if !gravity.is_finite() {
            return Err(ArmError::Gravity);
        }
        check_tool(&tool)?;
        let along = all.map(|joint| BaseAxis::of(joint.axis));
        let before = |i: usize| if i == 0 { DVec3::ZERO } else { all[i - 1].point };
        let ways = core::array::from_fn(|i| all[i].point - before(i));
        let moment = |joint: Joint| {
            joint.link.map_or(DVec3::ZERO, |link| (link.centre - joint.point) * link.mass)
        };
        let moments = all.map(moment);
        let slides = |i: usize| u32::from(joints[i].kind == JointKind::Prismatic) << i;
        let slides = (0..joints.len()).map(slides).sum();
        let count = joints.len();
        Ok(Self { joints: all, along, ways, moments, slides, count, tool, gravity })
    }

    /// The joints, base to flange.
    pub fn joints(&self) -> &[Joint] {
        &self.joints[..self.count]
    }

    /// The number of joints, 1 to [`JOINTS_MAX`].
    pub const fn count(&self) -> usize {
        self.count
    }

    /// The base axis that the axis of joint `i` is parallel to.
    #[inline(always)]
    pub(crate) fn along(&self, i: usize) -> BaseAxis {
        self.along[i]
    }

    /// Vector to the point of joint `i` from that of the previous joint, of the first from the
    /// base's origin, m.
    #[inline(always)]
    pub(crate) fn way(&self, i: usize) -> DVec3 {
        self.ways[i]
    }

    /// The first moment of link `i` about its joint's point, kg m; zero if its mass is not known.
    #[inline(always)]
    pub(crate) fn moment(&self, i: usize) -> DVec3 {
        self.moments[i]
    }

    /// Prismatic joints.
    #[inline(always)]
    pub(crate) fn slides(&self) -> impl Iterator<Item = usize> {
        let slides = self.slides;
        (0..self.count).take_while(move |i| slides >> i != 0).filter(move |i| slides >> i & 1 == 1)
    }

    /// Whether every position is finite and within its joint's limits.
    pub fn within_limits(&self, q: &Joints) -> bool {
        self.joints().iter().zip(q).all(|(joint, &q)| q >= joint.limits.0 && q <= joint.limits.1)
    }

    /// The point at the far end of link `i` (moved by joint `i`, 0-based): the next joint's point,
    /// or the TCP.
    pub fn next_point(&self, i: usize) -> DVec3 {
        self.joints().get(i + 1).map_or(self.tool.tcp, |next| next.point)
    }

    /// All known masses, each with the 0-based joint that moves it; the tool is moved by the last
    /// joint.
    pub fn bodies(&self) -> impl Iterator<Item = (usize, &Body)> {
        let links =
            self.joints().iter().enumerate().filter_map(|(i, j)| Some((i, j.link.as_ref()?)));
        links.chain(self.tool.body.as_ref().map(|body| (self.count - 1, body)))
    }
}

fn checked(joint: Joint, number: usize) -> Result<Joint, ArmError> {
    let length = libm::sqrt(joint.axis.length_squared());
    if !(length - 1.0).abs().is_finite() || (length - 1.0).abs() > 1e-6 {
        return Err(ArmError::AxisLength { joint: number, length });
    }
    let (low, high) = joint.limits;
    if !(low.is_finite() && high.is_finite() && low < high) {
        return Err(ArmError::Limits(number));
    }
    let body_is_sound = joint.link.as_ref().is_none_or(is_sound);
    if !(joint.point.is_finite() && joint.max_speed > 0.0 && body_is_sound) {
        return Err(ArmError::JointNumbers(number));
    }
    Ok(Joint { axis: joint.axis / length, ..joint })
}

fn check_tool(tool: &Tool) -> Result<(), ArmError> {
    let r = tool.base_from_tool;
    let deviation = r.transpose() * r - DMat3::IDENTITY;
    let orthonormal = deviation.to_cols_array().iter().all(|x| x.abs() <= 1e-6);
    let sound = tool.body.as_ref().is_none_or(is_sound);
    let right_handed = r.determinant() > 0.0;
    if tool.tcp.is_finite() && orthonormal && right_handed && sound {
        Ok(())
    } else {
        Err(ArmError::Tool)
    }
}

fn is_sound(body: &Body) -> bool {
    body.mass > 0.0 && body.mass.is_finite() && body.centre.is_finite() && body.inertia.is_finite()
}
