//! Four numbers at once, as wide as the machine can: chosen at run time.
//!
//! A kernel is written once over [`Lanes`] and compiled twice: for AVX2 with fused multiply-add, where the processor has them, and for any other. What goes
//! four by four are the three coordinates of a vector (and nothing), or one coordinate of four joints.
//!
//! Promises: on one machine always the same choice, so that the same numbers give the same bits; choices differ by rounding. Never: a look at memory.

use crate::JOINTS_MAX;
use glam::DVec3;
#[cfg(target_arch = "x86_64")]
use pulp::{NullaryFnOnce, f64x4, x86::V3};

/// Numbers at once.
pub const WIDTH: usize = 4;

/// How four numbers are reckoned with at once.
pub trait Lanes: Copy {
    /// Four numbers.
    type Four: Copy;

    /// Parts of four that hold all joints of the arm at hand: known to the compiler, so that no loop over them is left.
    const PARTS: usize;

    /// Four numbers side by side.
    fn of(self, numbers: [f64; WIDTH]) -> Self::Four;

    /// The numbers.
    fn numbers(self, four: Self::Four) -> [f64; WIDTH];

    /// One number four times.
    fn same(self, number: f64) -> Self::Four;

    /// `a + b`.
    fn plus(self, a: Self::Four, b: Self::Four) -> Self::Four;

    /// `a − b`.
    fn minus(self, a: Self::Four, b: Self::Four) -> Self::Four;

    /// `a b`.
    fn times(self, a: Self::Four, b: Self::Four) -> Self::Four;

    /// `a b + c`.
    fn times_plus(self, a: Self::Four, b: Self::Four, c: Self::Four) -> Self::Four;

    /// `c − a b`.
    fn times_from(self, a: Self::Four, b: Self::Four, c: Self::Four) -> Self::Four;

    /// A vector's coordinates.
    #[inline(always)]
    fn vector(self, v: DVec3) -> Self::Four {
        self.of([v.x, v.y, v.z, 0.0])
    }

    /// The vector of these coordinates.
    #[inline(always)]
    fn xyz(self, four: Self::Four) -> DVec3 {
        let [x, y, z, _] = self.numbers(four);
        DVec3::new(x, y, z)
    }

    /// The numbers of four joints, `4 k` to `4 k + 3`.
    #[inline(always)]
    fn part(self, of: &[f64; JOINTS_MAX], k: usize) -> Self::Four {
        self.of(of.as_chunks().0[k])
    }

    /// The sum of the four.
    #[inline(always)]
    fn sum(self, four: Self::Four) -> f64 {
        let [a, b, c, d] = self.numbers(four);
        (a + b) + (c + d)
    }

    /// Puts the numbers of four joints in their places.
    #[inline(always)]
    fn put(self, four: Self::Four, into: &mut [f64; JOINTS_MAX], k: usize) {
        into.as_chunks_mut().0[k] = self.numbers(four);
    }
}

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
    /// Of their coordinates.
    #[inline(always)]
    pub fn of(lanes: S, [x, y, z]: [S::Four; 3]) -> Self {
        Self { lanes, x, y, z }
    }

    /// Vectors `4 k` to `4 k + 3`.
    #[inline(always)]
    pub fn gathered(lanes: S, from: &[DVec3; JOINTS_MAX], k: usize) -> Self {
        let [a, b, c, d] = from.as_chunks::<WIDTH>().0[k];
        let x = lanes.of([a.x, b.x, c.x, d.x]);
        let y = lanes.of([a.y, b.y, c.y, d.y]);
        Self { lanes, x, y, z: lanes.of([a.z, b.z, c.z, d.z]) }
    }

    /// One vector four times.
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
        DVec3::new(lanes.sum(self.x), lanes.sum(self.y), lanes.sum(self.z))
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

/// A vector of each joint, one array a coordinate.
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
    /// That of joint `i`.
    #[inline(always)]
    pub fn at(&self, i: usize) -> DVec3 {
        DVec3::new(self.x[i], self.y[i], self.z[i])
    }

    /// Sets that of joint `i`.
    pub(crate) fn set(&mut self, i: usize, v: DVec3) {
        (self.x[i], self.y[i], self.z[i]) = (v.x, v.y, v.z);
    }

    /// Those of joints `4 k` to `4 k + 3`.
    #[inline(always)]
    pub fn part<S: Lanes>(&self, lanes: S, k: usize) -> Three<S> {
        let (x, y) = (lanes.part(&self.x, k), lanes.part(&self.y, k));
        Three { lanes, x, y, z: lanes.part(&self.z, k) }
    }

    /// Sets those of joints `4 k` to `4 k + 3`.
    #[inline(always)]
    pub fn put<S: Lanes>(&mut self, three: Three<S>, k: usize) {
        let lanes = three.lanes;
        lanes.put(three.x, &mut self.x, k);
        lanes.put(three.y, &mut self.y, k);
        lanes.put(three.z, &mut self.z, k);
    }
}

/// What is to be done with lanes. Closures and adaptors of iterators that reckon with lanes stand in the way of the compiler: plain loops do not.
pub trait Work {
    /// What comes of it.
    type Output;

    /// Does it. To be inlined whole: what is called from here is compiled for the machine at hand only where it stands here.
    fn run<S: Lanes>(self, lanes: S) -> Self::Output;
}

/// Parts that hold the joints of nearly every arm, and of any.
const FEW: usize = 2;
const ALL: usize = JOINTS_MAX / WIDTH;

/// Does the work for an arm of `count` joints with the widest lanes that this machine has.
#[inline(always)]
pub fn widest<W: Work>(count: usize, work: W) -> W::Output {
    let are_few = count <= FEW * WIDTH;
    #[cfg(target_arch = "x86_64")]
    if let Some(lanes) = V3::try_new() {
        return if are_few {
            lanes.vectorize(On { lanes: Wide::<FEW>(lanes), work })
        } else {
            lanes.vectorize(On { lanes: Wide::<ALL>(lanes), work })
        };
    }
    if are_few { work.run(Plain::<FEW>) } else { work.run(Plain::<ALL>) }
}

#[cfg(target_arch = "x86_64")]
struct On<L, W> {
    lanes: L,
    work: W,
}

#[cfg(target_arch = "x86_64")]
impl<L: Lanes, W: Work> NullaryFnOnce for On<L, W> {
    type Output = W::Output;

    #[inline(always)]
    fn call(self) -> W::Output {
        self.work.run(self.lanes)
    }
}

/// Whatever the compiler makes of it.
#[derive(Clone, Copy)]
pub struct Plain<const PARTS: usize>;

impl<const PARTS: usize> Lanes for Plain<PARTS> {
    type Four = [f64; WIDTH];

    const PARTS: usize = PARTS;

    #[inline(always)]
    fn of(self, numbers: [f64; WIDTH]) -> Self::Four {
        numbers
    }

    #[inline(always)]
    fn numbers(self, four: Self::Four) -> [f64; WIDTH] {
        four
    }

    #[inline(always)]
    fn same(self, number: f64) -> Self::Four {
        [number; WIDTH]
    }

    #[inline(always)]
    fn plus(self, a: Self::Four, b: Self::Four) -> Self::Four {
        [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
    }

    #[inline(always)]
    fn minus(self, a: Self::Four, b: Self::Four) -> Self::Four {
        [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
    }

    #[inline(always)]
    fn times(self, a: Self::Four, b: Self::Four) -> Self::Four {
        [a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]]
    }

    #[inline(always)]
    fn times_plus(self, a: Self::Four, b: Self::Four, c: Self::Four) -> Self::Four {
        self.plus(self.times(a, b), c)
    }

    #[inline(always)]
    fn times_from(self, a: Self::Four, b: Self::Four, c: Self::Four) -> Self::Four {
        self.minus(c, self.times(a, b))
    }
}

/// AVX2 with fused multiply-add.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
struct Wide<const PARTS: usize>(V3);

#[cfg(target_arch = "x86_64")]
impl<const PARTS: usize> Lanes for Wide<PARTS> {
    type Four = f64x4;

    const PARTS: usize = PARTS;

    #[inline(always)]
    fn of(self, [a, b, c, d]: [f64; WIDTH]) -> f64x4 {
        f64x4(a, b, c, d)
    }

    #[inline(always)]
    fn numbers(self, four: f64x4) -> [f64; WIDTH] {
        [four.0, four.1, four.2, four.3]
    }

    #[inline(always)]
    fn same(self, number: f64) -> f64x4 {
        self.0.splat_f64x4(number)
    }

    #[inline(always)]
    fn plus(self, a: f64x4, b: f64x4) -> f64x4 {
        self.0.add_f64x4(a, b)
    }

    #[inline(always)]
    fn minus(self, a: f64x4, b: f64x4) -> f64x4 {
        self.0.sub_f64x4(a, b)
    }

    #[inline(always)]
    fn times(self, a: f64x4, b: f64x4) -> f64x4 {
        self.0.mul_f64x4(a, b)
    }

    #[inline(always)]
    fn times_plus(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
        self.0.mul_add_f64x4(a, b, c)
    }

    #[inline(always)]
    fn times_from(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
        self.0.negate_mul_add_f64x4(a, b, c)
    }
}
