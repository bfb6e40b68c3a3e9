//! The pose of a body in lanes, and the next joint on it: one step of the product of
//! [`crate::Chain`].
//!
//! Columns of a rotation and an origin are four vectors of three coordinates each, so that a joint
//! parallel to a base axis, as most are, combines two columns with four products.
//!
//! A tool pose alone has the same bits as with a whole chain.

use crate::frame::{SMALL, coefficients, rodrigues};
use crate::lanes::{Lanes, PaddedVec3, WIDTH};
use crate::{Frame, JOINTS_MAX, JointKind};
use glam::{DMat3, DVec3};

/// The base axis that a unit vector is parallel to, in either sense.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BaseAxis {
    X,
    Y,
    Z,
    None,
}

impl BaseAxis {
    /// For a unit vector.
    pub(crate) fn of(axis: DVec3) -> Self {
        match (axis.x == 0.0, axis.y == 0.0, axis.z == 0.0) {
            (false, true, true) => Self::X,
            (true, false, true) => Self::Y,
            (true, true, false) => Self::Z,
            _ => Self::None,
        }
    }
}

/// A joint's axis at the zero configuration.
pub(crate) struct Axis {
    pub(crate) along: BaseAxis,
    /// Unit vector.
    pub(crate) axis: DVec3,
    pub(crate) point: DVec3,
    /// Vector to its point from that of the joint that carries it.
    pub(crate) offset: DVec3,
}

/// Pose of a body, given by the position of one of its points: avoids a dependency on the position
/// of the base's origin.
#[derive(Clone, Copy)]
pub(crate) struct LanePose<S: Lanes> {
    lanes: S,
    /// Columns of its rotation.
    columns: [S::Four; 3],
    /// Present position of the point.
    at: S::Four,
    /// The point at the zero configuration.
    point: DVec3,
}

/// [`LanePose`] in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct StoredPose {
    columns: [PaddedVec3; 3],
    at: PaddedVec3,
    point: DVec3,
}

impl StoredPose {
    pub(crate) const IDENTITY: Self = Self {
        columns: [PaddedVec3::of(DVec3::X), PaddedVec3::of(DVec3::Y), PaddedVec3::of(DVec3::Z)],
        at: PaddedVec3::of(DVec3::ZERO),
        point: DVec3::ZERO,
    };

    #[inline(always)]
    pub(crate) fn frame(&self) -> Frame {
        let [x, y, z] = &self.columns;
        let rotation = DMat3::from_cols(x.xyz(), y.xyz(), z.xyz());
        Frame { rotation, origin: self.at.xyz() - rotation * self.point }
    }
}

impl<S: Lanes> LanePose<S> {
    #[inline(always)]
    pub(crate) fn of(lanes: S, frame: &Frame) -> Self {
        let DMat3 { x_axis, y_axis, z_axis } = frame.rotation;
        let columns =
            [lanes.load_vector(x_axis), lanes.load_vector(y_axis), lanes.load_vector(z_axis)];
        Self { lanes, columns, at: lanes.load_vector(frame.origin), point: DVec3::ZERO }
    }

    /// Its lanes.
    #[inline(always)]
    pub(crate) fn lanes(&self) -> S {
        self.lanes
    }

    #[inline(always)]
    pub(crate) fn load(lanes: S, from: &StoredPose) -> Self {
        let [a, b, c] = &from.columns;
        let columns = [a.four(lanes), b.four(lanes), c.four(lanes)];
        Self { lanes, columns, at: from.at.four(lanes), point: from.point }
    }

    #[inline(always)]
    pub(crate) fn store(&self) -> StoredPose {
        let (lanes, [a, b, c]) = (self.lanes, self.columns);
        let columns =
            [PaddedVec3::put(lanes, a), PaddedVec3::put(lanes, b), PaddedVec3::put(lanes, c)];
        StoredPose { columns, at: PaddedVec3::put(lanes, self.at), point: self.point }
    }

    /// This pose after the motion `first`, with the same point as reference, so that a zero motion
    /// keeps the same bits.
    #[inline(always)]
    pub(crate) fn after(&self, first: &Frame) -> Self {
        let moved = first.point(self.point) - self.point;
        Self {
            columns: self.rotate_columns_by(&first.rotation),
            at: self.position_at_offset(moved),
            ..*self
        }
    }

    /// A frame of this body.
    #[inline(always)]
    pub(crate) fn frame(&self, offset: &Frame) -> Frame {
        let (lanes, [a, b, c]) = (self.lanes, self.rotate_columns_by(&offset.rotation));
        let rotation = DMat3::from_cols(lanes.to_vector(a), lanes.to_vector(b), lanes.to_vector(c));
        Frame { rotation, origin: lanes.to_vector(self.at(offset.origin)) }
    }

    #[inline(always)]
    fn rotate_columns_by(&self, by: &DMat3) -> [S::Four; 3] {
        let DMat3 { x_axis, y_axis, z_axis } = *by;
        [self.in_base_axes(x_axis), self.in_base_axes(y_axis), self.in_base_axes(z_axis)]
    }

    /// Vector to a point of the body from its reference point.
    #[inline(always)]
    pub(crate) fn offset_to(&self, point: DVec3) -> DVec3 {
        point - self.point
    }

    /// A joint at a position with this sine and cosine: its present axis and point, and the body
    /// that it moves.
    #[inline(always)]
    pub(crate) fn joint(
        &self,
        axis: &Axis,
        kind: JointKind,
        position: f64,
        turned: (f64, f64),
    ) -> ((S::Four, S::Four), Self) {
        let lanes = self.lanes;
        let point_now = self.position_at_offset(axis.offset);
        let moved = Self { at: point_now, point: axis.point, ..*self };
        match kind {
            JointKind::Revolute => {
                let (axis_now, columns) = self.rotate_about(axis, turned);
                ((axis_now, point_now), Self { columns, ..moved })
            }
            JointKind::Prismatic => {
                let axis_now = self.in_base_axes(axis.axis);
                let at = lanes.mul_add(axis_now, lanes.splat(position), point_now);
                ((axis_now, point_now), Self { at, ..moved })
            }
        }
    }

    /// The present axis, and the columns after a rotation about it.
    #[inline(always)]
    fn rotate_about(&self, axis: &Axis, (sin, cos): (f64, f64)) -> (S::Four, [S::Four; 3]) {
        let lanes = self.lanes;
        let [a, b, c] = self.columns;
        match axis.along {
            BaseAxis::X => {
                let (b, c) = rotate_columns(lanes, (b, c), (sin * axis.axis.x, cos));
                (lanes.mul(a, lanes.splat(axis.axis.x)), [a, b, c])
            }
            BaseAxis::Y => {
                let (c, a) = rotate_columns(lanes, (c, a), (sin * axis.axis.y, cos));
                (lanes.mul(b, lanes.splat(axis.axis.y)), [a, b, c])
            }
            BaseAxis::Z => {
                let (a, b) = rotate_columns(lanes, (a, b), (sin * axis.axis.z, cos));
                (lanes.mul(c, lanes.splat(axis.axis.z)), [a, b, c])
            }
            BaseAxis::None => (
                self.in_base_axes(axis.axis),
                self.rotate_columns_by(&rodrigues(axis.axis, sin, cos)),
            ),
        }
    }

    /// A vector of the body in base axes.
    #[inline(always)]
    fn in_base_axes(&self, v: DVec3) -> S::Four {
        let (lanes, [a, b, c]) = (self.lanes, self.columns);
        let along_z = lanes.mul(c, lanes.splat(v.z));
        lanes.mul_add(a, lanes.splat(v.x), lanes.mul_add(b, lanes.splat(v.y), along_z))
    }

    /// Position of a point of the body.
    #[inline(always)]
    pub(crate) fn at(&self, point: DVec3) -> S::Four {
        self.position_at_offset(self.offset_to(point))
    }

    /// Position of a point of the body, given relative to its reference point. The dependency on
    /// the previous joint comes last.
    #[inline(always)]
    fn position_at_offset(&self, way: DVec3) -> S::Four {
        self.lanes.add(self.at, self.in_base_axes(way))
    }

    /// First moment of a mass of the body, from its moment about the reference point.
    #[inline(always)]
    pub(crate) fn moment(&self, mass: f64, moment: DVec3) -> S::Four {
        let lanes = self.lanes;
        lanes.mul_add(self.at, lanes.splat(mass), self.in_base_axes(moment))
    }
}

/// Rotates two columns: `u cos + v sin`, `v cos − u sin`.
#[inline(always)]
fn rotate_columns<S: Lanes>(
    lanes: S,
    (u, v): (S::Four, S::Four),
    (sin, cos): (f64, f64),
) -> (S::Four, S::Four) {
    let (sine, cosine) = (lanes.splat(sin), lanes.splat(cos));
    let first = lanes.mul_add(v, sine, lanes.mul(u, cosine));
    (first, lanes.neg_mul_add(u, sine, lanes.mul(v, cosine)))
}

/// Sines and cosines of positions that differ by `by` from those given; the same bits if that is
/// zero.
#[inline(always)]
pub(crate) fn advance_sin_cos<S: Lanes>(
    lanes: S,
    (sin, cos): (S::Four, S::Four),
    by: S::Four,
) -> (S::Four, S::Four) {
    let square = lanes.mul(by, by);
    let (first, second) = first_coefficients(lanes, square);
    let (sine, less) = (lanes.mul(by, first), lanes.mul(square, second));
    let more = lanes.neg_mul_add(sin, less, lanes.mul(cos, sine));
    let fewer = lanes.mul_add(sin, sine, lanes.mul(cos, less));
    (lanes.add(sin, more), lanes.sub(cos, fewer))
}

/// The first two of [`coefficients`], of four squares.
#[inline(always)]
fn first_coefficients<S: Lanes>(lanes: S, square: S::Four) -> (S::Four, S::Four) {
    let [a, b, c, d] = lanes.to_array(square);
    if a < SMALL && b < SMALL && c < SMALL && d < SMALL {
        let half = lanes.mul(lanes.splat(0.5), series(lanes, square, 2.0));
        return (series(lanes, square, 1.0), half);
    }
    let [a, b, c, d] = [coefficients(a), coefficients(b), coefficients(c), coefficients(d)];
    (lanes.load([a[0], b[0], c[0], d[0]]), lanes.load([a[1], b[1], c[1], d[1]]))
}

/// `1 − θ²/((n+1)(n+2)) (1 − θ²/((n+3)(n+4)) …)`, of four θ².
#[inline(always)]
fn series<S: Lanes>(lanes: S, square: S::Four, n: f64) -> S::Four {
    let one = lanes.splat(1.0);
    let mut sum = one;
    for k in [7.0, 5.0, 3.0, 1.0] {
        let share = lanes.splat(1.0 / ((n + k) * (n + k + 1.0)));
        sum = lanes.neg_mul_add(lanes.mul(square, share), sum, one);
    }
    sum
}

const _: () = assert!(JOINTS_MAX.is_multiple_of(WIDTH));
