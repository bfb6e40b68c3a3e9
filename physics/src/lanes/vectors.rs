//! Four vectors at once, and vectors of all joints stored by coordinate.
//!
//! Values stored by coordinate are read and written four at once.

use super::{Lanes, WIDTH};
use crate::JOINTS_MAX;
use glam::DVec3;

/// Four vectors at once.
#[derive(Clone, Copy)]
pub struct Vec3Lanes<S: Lanes> {
    lanes: S,
    /// Their first coordinates.
    pub x: S::Four,
    /// Their second.
    pub y: S::Four,
    /// Their third.
    pub z: S::Four,
}

impl<S: Lanes> Vec3Lanes<S> {
    /// From their coordinates.
    #[inline(always)]
    pub fn of(lanes: S, [x, y, z]: [S::Four; 3]) -> Self {
        Self { lanes, x, y, z }
    }

    /// Vectors `4 k` to `4 k + 3`.
    #[inline(always)]
    pub fn gathered(lanes: S, from: &[PaddedVec3; JOINTS_MAX], k: usize) -> Self {
        let rows = from.as_chunks::<WIDTH>().0[k];
        Self::of(lanes, lanes.columns(rows.map(|row| row.four(lanes))))
    }

    /// One vector in all lanes.
    #[inline(always)]
    pub fn same(lanes: S, v: DVec3) -> Self {
        Self { lanes, x: lanes.splat(v.x), y: lanes.splat(v.y), z: lanes.splat(v.z) }
    }

    /// `self − other`.
    #[inline(always)]
    pub fn minus(self, other: Self) -> Self {
        let lanes = self.lanes;
        let (x, y) = (lanes.sub(self.x, other.x), lanes.sub(self.y, other.y));
        Self { lanes, x, y, z: lanes.sub(self.z, other.z) }
    }

    /// `self × factor`.
    #[inline(always)]
    pub fn times(self, factor: S::Four) -> Self {
        let lanes = self.lanes;
        let (x, y) = (lanes.mul(self.x, factor), lanes.mul(self.y, factor));
        Self { lanes, x, y, z: lanes.mul(self.z, factor) }
    }

    /// `self + other × factor`.
    #[inline(always)]
    pub fn plus_times(self, other: Self, factor: S::Four) -> Self {
        let lanes = self.lanes;
        let x = lanes.mul_add(other.x, factor, self.x);
        let y = lanes.mul_add(other.y, factor, self.y);
        Self { lanes, x, y, z: lanes.mul_add(other.z, factor, self.z) }
    }

    /// The sum of the four.
    #[inline(always)]
    pub fn sum(self) -> DVec3 {
        let lanes = self.lanes;
        lanes.to_vector(lanes.row_sums([self.x, self.y, self.z, lanes.splat(0.0)]))
    }

    /// `self × other`.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        let lanes = self.lanes;
        let x = lanes.neg_mul_add(self.z, other.y, lanes.mul(self.y, other.z));
        let y = lanes.neg_mul_add(self.x, other.z, lanes.mul(self.z, other.x));
        let z = lanes.neg_mul_add(self.y, other.x, lanes.mul(self.x, other.y));
        Self { lanes, x, y, z }
    }

    /// `sum + self × other`.
    #[inline(always)]
    pub fn cross_plus(self, other: Self, sum: Self) -> Self {
        let lanes = self.lanes;
        let x = lanes.neg_mul_add(self.z, other.y, lanes.mul_add(self.y, other.z, sum.x));
        let y = lanes.neg_mul_add(self.x, other.z, lanes.mul_add(self.z, other.x, sum.y));
        let z = lanes.neg_mul_add(self.y, other.x, lanes.mul_add(self.x, other.y, sum.z));
        Self { lanes, x, y, z }
    }

    /// `self · other`.
    #[inline(always)]
    pub fn dot(self, other: Self) -> S::Four {
        let lanes = self.lanes;
        let x = lanes.mul(self.x, other.x);
        lanes.mul_add(self.z, other.z, lanes.mul_add(self.y, other.y, x))
    }

    /// `sum + self · other`.
    #[inline(always)]
    pub fn dot_plus(self, other: Self, sum: S::Four) -> S::Four {
        let lanes = self.lanes;
        let x = lanes.mul_add(self.x, other.x, sum);
        lanes.mul_add(self.z, other.z, lanes.mul_add(self.y, other.y, x))
    }
}

/// A vector with a zero as fourth element, read and written as a whole: a read of another width
/// than the preceding write stalls the processor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(32))]
pub struct PaddedVec3([f64; WIDTH]);

impl PaddedVec3 {
    /// From a vector.
    pub const fn of(v: DVec3) -> Self {
        Self([v.x, v.y, v.z, 0.0])
    }

    /// From a vector in lanes.
    #[inline(always)]
    pub fn put<S: Lanes>(lanes: S, four: S::Four) -> Self {
        Self(lanes.to_array(four))
    }

    /// The vector in lanes.
    #[inline(always)]
    pub fn four<S: Lanes>(&self, lanes: S) -> S::Four {
        lanes.load(self.0)
    }

    /// The vector.
    #[inline(always)]
    pub fn xyz(&self) -> DVec3 {
        let [x, y, z, _] = self.0;
        DVec3::new(x, y, z)
    }
}

/// One vector per joint, stored as an array per coordinate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub struct JointVectors {
    /// First coordinates.
    pub x: [f64; JOINTS_MAX],
    /// Second.
    pub y: [f64; JOINTS_MAX],
    /// Third.
    pub z: [f64; JOINTS_MAX],
}

impl JointVectors {
    /// The vector of joint `i`.
    #[inline(always)]
    pub fn at(&self, i: usize) -> DVec3 {
        DVec3::new(self.x[i], self.y[i], self.z[i])
    }

    /// Sets the vector of joint `i`.
    pub(crate) fn set(&mut self, i: usize, v: DVec3) {
        (self.x[i], self.y[i], self.z[i]) = (v.x, v.y, v.z);
    }

    /// The vectors of joints `4 k` to `4 k + 3`.
    #[inline(always)]
    pub fn part<S: Lanes>(&self, lanes: S, k: usize) -> Vec3Lanes<S> {
        let (x, y) = (lanes.part(&self.x, k), lanes.part(&self.y, k));
        Vec3Lanes::of(lanes, [x, y, lanes.part(&self.z, k)])
    }

    /// Sets the vectors of joints `4 k` to `4 k + 3`.
    #[inline(always)]
    pub fn put<S: Lanes>(&mut self, three: Vec3Lanes<S>, k: usize) {
        let lanes = three.lanes;
        lanes.store(three.x, &mut self.x, k);
        lanes.store(three.y, &mut self.y, k);
        lanes.store(three.z, &mut self.z, k);
    }
}
