//! Four vectors at once, and vectors of all joints stored by coordinate.
//!
//! Values stored by coordinate are read and written four at once.

use super::{Lanes, WIDTH};
use crate::JOINTS_MAX;
use glam::DVec3;

/// Four vectors at once.
#[derive(Clone, Copy)]
pub struct Three<S: Lanes> {
    lanes: S,
    /// Their first coordinates.
    pub x: S::Four,
    /// Their second.
    pub y: S::Four,
    /// Their third.
    pub z: S::Four,
}

impl<S: Lanes> Three<S> {
    /// From their coordinates.
    #[inline(always)]
    pub fn of(lanes: S, [x, y, z]: [S::Four; 3]) -> Self {
        Self { lanes, x, y, z }
    }

    /// Vectors `4 k` to `4 k + 3`.
    #[inline(always)]
    pub fn gathered(lanes: S, from: &[Padded; JOINTS_MAX], k: usize) -> Self {
        let rows = from.as_chunks::<WIDTH>().0[k];
        Self::of(lanes, lanes.columns(rows.map(|row| row.four(lanes))))
    }

    /// One vector in all lanes.
    #[inline(always)]
    pub fn same(lanes: S, v: DVec3) -> Self {
        Self { lanes, x: lanes.same(v.x), y: lanes.same(v.y), z: lanes.same(v.z) }
    }

    /// `self − other`.
    #[inline(always)]
    pub fn minus(self, other: Self) -> Self {
        let lanes = self.lanes;
        let (x, y) = (lanes.minus(self.x, other.x), lanes.minus(self.y, other.y));
        Self { lanes, x, y, z: lanes.minus(self.z, other.z) }
    }

    /// `self × factor`.
    #[inline(always)]
    pub fn times(self, factor: S::Four) -> Self {
        let lanes = self.lanes;
        let (x, y) = (lanes.times(self.x, factor), lanes.times(self.y, factor));
        Self { lanes, x, y, z: lanes.times(self.z, factor) }
    }

    /// `self + other × factor`.
    #[inline(always)]
    pub fn plus_times(self, other: Self, factor: S::Four) -> Self {
        let lanes = self.lanes;
        let x = lanes.times_plus(other.x, factor, self.x);
        let y = lanes.times_plus(other.y, factor, self.y);
        Self { lanes, x, y, z: lanes.times_plus(other.z, factor, self.z) }
    }

    /// The sum of the four.
    #[inline(always)]
    pub fn sum(self) -> DVec3 {
        let lanes = self.lanes;
        lanes.xyz(lanes.sums([self.x, self.y, self.z, lanes.same(0.0)]))
    }

    /// `self × other`.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        let lanes = self.lanes;
        let x = lanes.times_from(self.z, other.y, lanes.times(self.y, other.z));
        let y = lanes.times_from(self.x, other.z, lanes.times(self.z, other.x));
        let z = lanes.times_from(self.y, other.x, lanes.times(self.x, other.y));
        Self { lanes, x, y, z }
    }

    /// `sum + self × other`.
    #[inline(always)]
    pub fn cross_plus(self, other: Self, sum: Self) -> Self {
        let lanes = self.lanes;
        let x = lanes.times_from(self.z, other.y, lanes.times_plus(self.y, other.z, sum.x));
        let y = lanes.times_from(self.x, other.z, lanes.times_plus(self.z, other.x, sum.y));
        let z = lanes.times_from(self.y, other.x, lanes.times_plus(self.x, other.y, sum.z));
        Self { lanes, x, y, z }
    }

    /// `self · other`.
    #[inline(always)]
    pub fn dot(self, other: Self) -> S::Four {
        let lanes = self.lanes;
        let x = lanes.times(self.x, other.x);
        lanes.times_plus(self.z, other.z, lanes.times_plus(self.y, other.y, x))
    }

    /// `sum + self · other`.
    #[inline(always)]
    pub fn dot_plus(self, other: Self, sum: S::Four) -> S::Four {
        let lanes = self.lanes;
        let x = lanes.times_plus(self.x, other.x, sum);
        lanes.times_plus(self.z, other.z, lanes.times_plus(self.y, other.y, x))
    }
}

/// A vector with a zero as fourth element, read and written as a whole: a read of another width
/// than the preceding write stalls the processor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(32))]
pub struct Padded([f64; WIDTH]);

impl Padded {
    /// From a vector.
    pub const fn of(v: DVec3) -> Self {
        Self([v.x, v.y, v.z, 0.0])
    }

    /// From a vector in lanes.
    #[inline(always)]
    pub fn put<S: Lanes>(lanes: S, four: S::Four) -> Self {
        Self(lanes.numbers(four))
    }

    /// The vector in lanes.
    #[inline(always)]
    pub fn four<S: Lanes>(&self, lanes: S) -> S::Four {
        lanes.of(self.0)
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
pub struct Vectors {
    /// First coordinates.
    pub x: [f64; JOINTS_MAX],
    /// Second.
    pub y: [f64; JOINTS_MAX],
    /// Third.
    pub z: [f64; JOINTS_MAX],
}

impl Vectors {
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
    pub fn part<S: Lanes>(&self, lanes: S, k: usize) -> Three<S> {
        let (x, y) = (lanes.part(&self.x, k), lanes.part(&self.y, k));
        Three::of(lanes, [x, y, lanes.part(&self.z, k)])
    }

    /// Sets the vectors of joints `4 k` to `4 k + 3`.
    #[inline(always)]
    pub fn put<S: Lanes>(&mut self, three: Three<S>, k: usize) {
        let lanes = three.lanes;
        lanes.put(three.x, &mut self.x, k);
        lanes.put(three.y, &mut self.y, k);
        lanes.put(three.z, &mut self.z, k);
    }
}
