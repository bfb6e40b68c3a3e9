//! Rigid transformations: position and orientation of a body.
//!
//! Invariant: rotations remain orthonormal to rounding over an arm's length of products. Euler
//! angles are not used.

use crate::trig::sin_cos;
use glam::{DMat3, DVec3};
use libm::{atan2, sqrt};

/// A rigid motion `x ↦ R x + p`.
///
/// For a body it maps a point's base coordinates at the zero configuration to its base coordinates now;
/// for the tool it maps tool coordinates to base coordinates (`base_from_tool`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The rotation `R`.
    pub rotation: DMat3,
    /// The translation `p`, m.
    pub origin: DVec3,
}

impl Default for Frame {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Frame {
    /// No motion.
    pub const IDENTITY: Self = Self { rotation: DMat3::IDENTITY, origin: DVec3::ZERO };

    /// A frame from its rotation and translation.
    #[inline]
    pub const fn new(rotation: DMat3, origin: DVec3) -> Self {
        Self { rotation, origin }
    }

    /// A pure translation, m.
    #[inline]
    pub const fn translation(shift: DVec3) -> Self {
        Self { rotation: DMat3::IDENTITY, origin: shift }
    }

    /// The rotation `rotation` about the fixed point `pivot`.
    #[inline]
    pub fn about(pivot: DVec3, rotation: DMat3) -> Self {
        Self { rotation, origin: pivot - rotation * pivot }
    }

    /// This motion after `first`.
    #[inline]
    pub fn after(&self, first: &Self) -> Self {
        Self {
            rotation: self.rotation * first.rotation,
            origin: self.rotation * first.origin + self.origin,
        }
    }

    /// Moves a point.
    #[inline]
    pub fn point(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.origin
    }

    /// The inverse motion.
    #[inline]
    pub fn inverse(&self) -> Self {
        let back = self.rotation.transpose();
        Self { rotation: back, origin: -(back * self.origin) }
    }
}

/// A sum of small turns about pivots, independent of their order: the rate of a screw motion, `x ↦
/// turn × x + velocity`, applied for unit time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Rotation vector, rad.
    pub turn: DVec3,
    /// Displacement of the origin, m.
    pub velocity: DVec3,
}

impl Twist {
    /// Adds the turn `turn` (rotation vector, rad) about `pivot` (m).
    #[inline]
    pub fn add(&mut self, turn: DVec3, pivot: DVec3) {
        self.turn += turn;
        self.velocity += pivot.cross(turn);
    }

    /// Adds a multiple of a twist that is given in coordinates moved by `frame`.
    pub(crate) fn follow(&mut self, twist: &Self, frame: &Frame, times: f64) {
        let turn = frame.rotation * twist.turn * times;
        self.turn += turn;
        self.velocity += frame.rotation * twist.velocity * times + frame.origin.cross(turn);
    }

    /// The motion: the exponential of the twist. Turns about one pivot give exactly the rotation
    /// about it; turns about different pivots whose sum is zero give a pure shift.
    #[inline]
    pub fn frame(&self) -> Frame {
        let (turn, velocity) = (self.turn, self.velocity);
        let [first, second, third] = coefficients(turn.length_squared());
        let across = turn.cross(velocity);
        let origin = velocity + across * second + turn.cross(across) * third;
        Frame { rotation: exponential(turn, first, second), origin }
    }
}

/// The rotation by `angle_rad` about the unit vector `axis` (Rodrigues).
#[inline]
pub fn rotation_about(axis: DVec3, angle_rad: f64) -> DMat3 {
    let (sin, cos) = sin_cos(angle_rad);
    rodrigues(axis, sin, cos)
}

/// The rotation about the unit vector `axis` by an angle of this sine and cosine.
#[inline]
pub(crate) fn rodrigues(axis: DVec3, sin: f64, cos: f64) -> DMat3 {
    let (DVec3 { x, y, z }, rest) = (axis, 1.0 - cos);
    DMat3::from_cols(
        DVec3::new(cos + x * x * rest, x * y * rest + z * sin, x * z * rest - y * sin),
        DVec3::new(x * y * rest - z * sin, cos + y * y * rest, y * z * rest + x * sin),
        DVec3::new(x * z * rest + y * sin, y * z * rest - x * sin, cos + z * z * rest),
    )
}

/// The rotation by a rotation vector: its direction is the axis, its length the angle in rad.
#[inline]
pub fn rotation_from_vector(turn: DVec3) -> DMat3 {
    let [first, second, _] = coefficients(turn.length_squared());
    exponential(turn, first, second)
}

/// Below this square of an angle, rad², series are used: their next terms are below rounding.
pub(crate) const SMALL: f64 = 0.01;

/// `sin θ/θ`, `(1 − cos θ)/θ²` and `(θ − sin θ)/θ³`, of `θ²`.
#[inline]
pub(crate) fn coefficients(square: f64) -> [f64; 3] {
    if square < SMALL { small_coefficients(square) } else { large_coefficients(square) }
}

#[inline]
fn small_coefficients(square: f64) -> [f64; 3] {
    // 1/n! · (1 − θ²/((n+1)(n+2)) (1 − θ²/((n+3)(n+4)) …))
    let series = |n: f64| {
        let term = |k: f64, inner: f64| 1.0 - square * inner * (1.0 / ((n + k) * (n + k + 1.0)));
        term(1.0, term(3.0, term(5.0, term(7.0, 1.0))))
    };
    [series(1.0), 0.5 * series(2.0), series(3.0) * (1.0 / 6.0)]
}

#[cold]
fn large_coefficients(square: f64) -> [f64; 3] {
    let angle = sqrt(square);
    let (sin, half_sin) = (sin_cos(angle).0, sin_cos(0.5 * angle).0);
    [sin / angle, 2.0 * half_sin * half_sin / square, (angle - sin) / (angle * square)]
}

/// `1 + a [w] + b [w]²` for the rotation vector w.
#[inline]
fn exponential(turn: DVec3, a: f64, b: f64) -> DMat3 {
    let rest = 1.0 - b * turn.length_squared();
    let (along, w) = (turn * b, turn * a);
    DMat3::from_cols(
        DVec3::new(rest + along.x * turn.x, along.x * turn.y + w.z, along.x * turn.z - w.y),
        DVec3::new(along.x * turn.y - w.z, rest + along.y * turn.y, along.y * turn.z + w.x),
        DVec3::new(along.x * turn.z + w.y, along.y * turn.z - w.x, rest + along.z * turn.z),
    )
}

/// Below this square of a sine two terms of the arc sine suffice: the third is below 1e-15 of it.
const HARDLY_ANY: f64 = 1e-7;
/// Below this square of a sine its arc is computed by a series, whose next term is below rounding.
const NEARLY_NONE: f64 = 1e-3;

/// The rotation vector of a rotation, rad; its length is at most π.
///
/// Accurate for small angles (`atan2` of the antisymmetric part). Within 1e-7 rad of a half turn
/// the direction is taken from the symmetric part and its sign is arbitrary.
#[inline]
pub fn vector_from_rotation(rotation: &DMat3) -> DVec3 {
    let (c0, c1, c2) = (rotation.x_axis, rotation.y_axis, rotation.z_axis);
    let twice_sin = DVec3::new(c1.z - c2.y, c2.x - c0.z, c0.y - c1.x);
    let twice_cos = c0.x + c1.y + c2.z - 1.0;
    let square = 0.25 * twice_sin.length_squared();
    if square < HARDLY_ANY && twice_cos > 0.0 {
        return twice_sin * (0.5 + square * (0.5 / 6.0));
    }
    large_vector(rotation, twice_sin, twice_cos)
}

/// The same for a rotation that is not nearly zero.
#[inline(never)]
fn large_vector(rotation: &DMat3, twice_sin: DVec3, twice_cos: f64) -> DVec3 {
    let (c0, c1, c2) = (rotation.x_axis, rotation.y_axis, rotation.z_axis);
    let square = 0.25 * twice_sin.length_squared();
    if square < NEARLY_NONE && twice_cos > 0.0 {
        // The arc sine of s over s, by powers of s².
        let series = [1.0, 1.0 / 6.0, 3.0 / 40.0, 5.0 / 112.0, 35.0 / 1152.0];
        let ratio = series.iter().rev().fold(0.0, |sum, term| sum * square + term);
        return twice_sin * (0.5 * ratio);
    }
    let length = 2.0 * sqrt(square);
    let angle = atan2(length, twice_cos);
    if length > 1e-7 {
        return twice_sin * (angle / length);
    }
    let square = DVec3::new(c0.x + 1.0, c1.y + 1.0, c2.z + 1.0) * 0.5;
    let column = if square.x >= square.y && square.x >= square.z {
        DVec3::new(square.x, (c0.y + c1.x) * 0.25, (c0.z + c2.x) * 0.25)
    } else if square.y >= square.z {
        DVec3::new((c0.y + c1.x) * 0.25, square.y, (c1.z + c2.y) * 0.25)
    } else {
        DVec3::new((c0.z + c2.x) * 0.25, (c1.z + c2.y) * 0.25, square.z)
    };
    column * (angle / sqrt(column.length_squared()))
}

/// Two unit vectors normal to the unit vector `axis`, by the definition of
/// `docs/reference/effects.md`: the base axis `k` with the smallest `|k·e|` (ties to 1e-9: x, then
/// y, then z), `n1 = unit(k − (k·e)e)`, `n2 = e × n1`.
pub fn normals(axis: DVec3) -> (DVec3, DVec3) {
    let along = axis.abs();
    let smallest = along.min_element();
    let k = if along.x <= smallest + 1e-9 {
        DVec3::X
    } else if along.y <= smallest + 1e-9 {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let across = k - axis * k.dot(axis);
    let n1 = across / sqrt(across.length_squared());
    (n1, axis.cross(n1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = DVec3> {
        (-2.0..2.0, -2.0..2.0, -2.0..2.0).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn a_rotation_vector_survives_the_round_trip(turn in vector().prop_filter("below a half turn", |t| t.length() < 3.1)) {
            let back = vector_from_rotation(&rotation_from_vector(turn));
            prop_assert!((back - turn).length() < 1e-11, "{turn} became {back}");
        }

        #[test]
        fn tiny_rotations_keep_their_relative_precision(turn in vector(), exponent in -12..-3) {
            let tiny = turn * libm::pow(10.0, f64::from(exponent));
            let back = vector_from_rotation(&rotation_from_vector(tiny));
            prop_assert!((back - tiny).length() <= 1e-9 * tiny.length() + 1e-17);
        }

        #[test]
        fn a_motion_and_its_inverse_cancel(turn in vector(), pivot in vector(), point in vector()) {
            let motion = Frame::about(pivot, rotation_from_vector(turn));
            let back = motion.inverse().point(motion.point(point));
            prop_assert!((back - point).length() < 1e-13);
            prop_assert!((motion.point(pivot) - pivot).length() < 1e-14);
        }

        #[test]
        fn a_twist_about_one_pivot_is_the_rotation_about_it(turn in vector(), pivot in vector(), share in 0.0..1.0, exponent in -9..1, point in vector()) {
            let turn = turn * libm::pow(10.0, f64::from(exponent));
            let mut twist = Twist::default();
            twist.add(turn * share, pivot);
            twist.add(turn * (1.0 - share), pivot);
            let wanted = Frame::about(pivot, rotation_from_vector(turn)).point(point);
            prop_assert!((twist.frame().point(point) - wanted).length() < 1e-12);
        }

        #[test]
        fn turns_that_cancel_about_two_pivots_leave_their_shift(turn in vector(), a in vector(), b in vector(), point in vector()) {
            let turn = turn * 1e-3;
            let mut twist = Twist::default();
            twist.add(turn, a);
            twist.add(-turn, b);
            let moved = twist.frame().point(point) - point;
            prop_assert!((moved - turn.cross(b - a)).length() < 1e-15);
        }

        #[test]
        fn the_normals_make_a_right_handed_frame(axis in vector().prop_filter("not null", |a| a.length() > 1e-3)) {
            let e = axis / axis.length();
            let (n1, n2) = normals(e);
            prop_assert!(e.dot(n1).abs() < 1e-14 && e.dot(n2).abs() < 1e-14);
            prop_assert!((n1.cross(n2) - e).length() < 1e-14);
        }
    }

    #[test]
    fn a_half_turn_is_found_about_any_axis() {
        for axis in
            [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.6, 0.0, 0.8), DVec3::ONE.normalize()]
        {
            let turn = vector_from_rotation(&rotation_about(axis, core::f64::consts::PI));
            assert!((turn.length() - core::f64::consts::PI).abs() < 1e-12);
            assert!(turn.normalize().dot(axis).abs() > 1.0 - 1e-12);
        }
    }

    #[test]
    fn the_normals_follow_the_contract_for_the_base_axes() {
        assert_eq!(normals(DVec3::Z), (DVec3::X, DVec3::Y));
        assert_eq!(normals(DVec3::X), (DVec3::Y, DVec3::Z));
        assert_eq!(normals(DVec3::Y), (DVec3::X, -DVec3::Z));
    }
}
