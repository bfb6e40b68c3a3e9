//! The pose of a body in lanes, and the next joint on it: one step of the product of
//! [`crate::Chain`].
//!
//! Columns of a rotation and an origin are four vectors of three coordinates each, so that a joint
//! parallel to a base axis, as most are, combines two columns with four products.
//!
//! A tool pose alone has the same bits as with a whole chain.

use crate::frame::{SMALL, coefficients, rodrigues};
use crate::lanes::{Lanes, Padded, WIDTH};
use crate::{Frame, JOINTS_MAX, JointKind};
use glam::{DMat3, DVec3};

/// The base axis that a unit vector is parallel to, in either sense.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Along {
    X,
    Y,
    Z,
    None,
}

impl Along {
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
    pub(crate) along: Along,
    /// Unit vector.
    pub(crate) axis: DVec3,
    pub(crate) point: DVec3,
    /// Vector to its point from that of the joint that carries it.
    pub(crate) way: DVec3,
}

/// Pose of a body, given by the position of one of its points: avoids a dependency on the position
/// of the base's origin.
#[derive(Clone, Copy)]
pub(crate) struct Placed<S: Lanes> {
    lanes: S,
    /// Columns of its rotation.
    columns: [S::Four; 3],
    /// Present position of the point.
    at: S::Four,
    /// The point at the zero configuration.
    point: DVec3,
}

/// [`Placed`] in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Kept {
    columns: [Padded; 3],
    at: Padded,
    point: DVec3,
}

impl Kept {
    pub(crate) const IDENTITY: Self = Self {
        columns: [Padded::of(DVec3::X), Padded::of(DVec3::Y), Padded::of(DVec3::Z)],
        at: Padded::of(DVec3::ZERO),
        point: DVec3::ZERO,
    };

    #[inline(always)]
    pub(crate) fn frame(&self) -> Frame {
        let [x, y, z] = &self.columns;
        let rotation = DMat3::from_cols(x.xyz(), y.xyz(), z.xyz());
        Frame { rotation, origin: self.at.xyz() - rotation * self.point }
    }
}

impl<S: Lanes> Placed<S> {
    #[inline(always)]
    pub(crate) fn of(lanes: S, frame: &Frame) -> Self {
        let DMat3 { x_axis, y_axis, z_axis } = frame.rotation;
        let columns = [lanes.vector(x_axis), lanes.vector(y_axis), lanes.vector(z_axis)];
        Self { lanes, columns, at: lanes.vector(frame.origin), point: DVec3::ZERO }
    }

    /// Its lanes.
    #[inline(always)]
    pub(crate) fn lanes(&self) -> S {
        self.lanes
    }

    #[inline(always)]
    pub(crate) fn kept(lanes: S, from: &Kept) -> Self {
        let [a, b, c] = &from.columns;
        let columns = [a.four(lanes), b.four(lanes), c.four(lanes)];
        Self { lanes, columns, at: from.at.four(lanes), point: from.point }
    }

    #[inline(always)]
    pub(crate) fn keep(&self) -> Kept {
        let (lanes, [a, b, c]) = (self.lanes, self.columns);
        let columns = [Padded::put(lanes, a), Padded::put(lanes, b), Padded::put(lanes, c)];
        Kept { columns, at: Padded::put(lanes, self.at), point: self.point }
    }

    /// This pose after the motion `first`, with the same point as reference, so that a zero motion
    /// keeps the same bits.
    #[inline(always)]
    pub(crate) fn after(&self, first: &Frame) -> Self {
        let moved = first.point(self.point) - self.point;
        Self { columns: self.all_turned(&first.rotation), at: self.beyond(moved), ..*self }
    }

    /// A frame of this body.
    #[inline(always)]
    pub(crate) fn frame(&self, of: &Frame) -> Frame {
        let (lanes, [a, b, c]) = (self.lanes, self.all_turned(&of.rotation));
        let rotation = DMat3::from_cols(lanes.xyz(a), lanes.xyz(b), lanes.xyz(c));
        Frame { rotation, origin: lanes.xyz(self.at(of.origin)) }
    }

    #[inline(always)]
    fn all_turned(&self, by: &DMat3) -> [S::Four; 3] {
        let DMat3 { x_axis, y_axis, z_axis } = *by;
        [self.turned(x_axis), self.turned(y_axis), self.turned(z_axis)]
    }

    /// Vector to a point of the body from its reference point.
    #[inline(always)]
    pub(crate) fn way_to(&self, point: DVec3) -> DVec3 {
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
        let point_now = self.beyond(axis.way);
        let moved = Self { at: point_now, point: axis.point, ..*self };
        match kind {
            JointKind::Revolute => {
                let (axis_now, columns) = self.about(axis, turned);
                ((axis_now, point_now), Self { columns, ..moved })
            }
            JointKind::Prismatic => {
                let axis_now = self.turned(axis.axis);
                let at = lanes.times_plus(axis_now, lanes.same(position), point_now);
                ((axis_now, point_now), Self { at, ..moved })
            }
        }
    }

    /// The present axis, and the columns after a rotation about it.
    #[inline(always)]
    fn about(&self, axis: &Axis, (sin, cos): (f64, f64)) -> (S::Four, [S::Four; 3]) {
        let lanes = self.lanes;
        let [a, b, c] = self.columns;
        match axis.along {
            Along::X => {
                let (b, c) = mixed(lanes, (b, c), (sin * axis.axis.x, cos));
                (lanes.times(a, lanes.same(axis.axis.x)), [a, b, c])
            }
            Along::Y => {
                let (c, a) = mixed(lanes, (c, a), (sin * axis.axis.y, cos));
                (lanes.times(b, lanes.same(axis.axis.y)), [a, b, c])
            }
            Along::Z => {
                let (a, b) = mixed(lanes, (a, b), (sin * axis.axis.z, cos));
                (lanes.times(c, lanes.same(axis.axis.z)), [a, b, c])
            }
            Along::None => {
                (self.turned(axis.axis), self.all_turned(&rodrigues(axis.axis, sin, cos)))
            }
        }
    }

    /// A vector of the body in base axes.
    #[inline(always)]
    fn turned(&self, v: DVec3) -> S::Four {
        let (lanes, [a, b, c]) = (self.lanes, self.columns);
        let along_z = lanes.times(c, lanes.same(v.z));
        lanes.times_plus(a, lanes.same(v.x), lanes.times_plus(b, lanes.same(v.y), along_z))
    }

    /// Position of a point of the body.
    #[inline(always)]
    pub(crate) fn at(&self, point: DVec3) -> S::Four {
        self.beyond(self.way_to(point))
    }

    /// Position of a point of the body, given relative to its reference point. The dependency on
    /// the previous joint comes last.
    #[inline(always)]
    fn beyond(&self, way: DVec3) -> S::Four {
        self.lanes.plus(self.at, self.turned(way))
    }

    /// First moment of a mass of the body, from its moment about the reference point.
    #[inline(always)]
    pub(crate) fn moment(&self, mass: f64, moment: DVec3) -> S::Four {
        let lanes = self.lanes;
        lanes.times_plus(self.at, lanes.same(mass), self.turned(moment))
    }
}

/// Rotates two columns: `u cos + v sin`, `v cos − u sin`.
#[inline(always)]
fn mixed<S: Lanes>(
    lanes: S,
    (u, v): (S::Four, S::Four),
    (sin, cos): (f64, f64),
) -> (S::Four, S::Four) {
    let (sine, cosine) = (lanes.same(sin), lanes.same(cos));
    let first = lanes.times_plus(v, sine, lanes.times(u, cosine));
    (first, lanes.times_from(u, sine, lanes.times(v, cosine)))
}

/// Sines and cosines of positions that differ by `by` from those given; the same bits if that is
/// zero.
#[inline(always)]
pub(crate) fn turned_on<S: Lanes>(
    lanes: S,
    (sin, cos): (S::Four, S::Four),
    by: S::Four,
) -> (S::Four, S::Four) {
    let square = lanes.times(by, by);
    let (first, second) = first_coefficients(lanes, square);
    let (sine, less) = (lanes.times(by, first), lanes.times(square, second));
    let more = lanes.times_from(sin, less, lanes.times(cos, sine));
    let fewer = lanes.times_plus(sin, sine, lanes.times(cos, less));
    (lanes.plus(sin, more), lanes.minus(cos, fewer))
}

/// The first two of [`coefficients`], of four squares.
#[inline(always)]
fn first_coefficients<S: Lanes>(lanes: S, square: S::Four) -> (S::Four, S::Four) {
    let [a, b, c, d] = lanes.numbers(square);
    if a < SMALL && b < SMALL && c < SMALL && d < SMALL {
        let half = lanes.times(lanes.same(0.5), series(lanes, square, 2.0));
        return (series(lanes, square, 1.0), half);
    }
    let [a, b, c, d] = [coefficients(a), coefficients(b), coefficients(c), coefficients(d)];
    (lanes.of([a[0], b[0], c[0], d[0]]), lanes.of([a[1], b[1], c[1], d[1]]))
}

/// `1 − θ²/((n+1)(n+2)) (1 − θ²/((n+3)(n+4)) …)`, of four θ².
#[inline(always)]
fn series<S: Lanes>(lanes: S, square: S::Four, n: f64) -> S::Four {
    let one = lanes.same(1.0);
    let mut sum = one;
    for k in [7.0, 5.0, 3.0, 1.0] {
        let share = lanes.same(1.0 / ((n + k) * (n + k + 1.0)));
        sum = lanes.times_from(lanes.times(square, share), sum, one);
    }
    sum
}

const _: () = assert!(JOINTS_MAX.is_multiple_of(WIDTH));
