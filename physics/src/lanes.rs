//! SIMD with four lanes, selected at run time.
//!
//! A kernel is written once over [`Lanes`] and compiled twice: for AVX2 with fused multiply-add, where the processor has them, and for any other. The
//! four lanes are the three coordinates of a vector (one unused), or one coordinate of four joints.
//!
//! The selection is always the same on one machine, so that the same inputs give the same bits;
//! selections differ by rounding. No access to memory.

use crate::JOINTS_MAX;
use crate::trig::quartered;
use glam::DVec3;
#[cfg(target_arch = "x86_64")]
use pulp::{NullaryFnOnce, f64x4, x86::V3};

mod vectors;
pub use vectors::{JointVectors, PaddedVec3, Vec3Lanes};

/// Number of lanes.
pub const WIDTH: usize = 4;

/// Arithmetic on four numbers at once.
pub trait Lanes: Copy {
    /// Four numbers.
    type Four: Copy;

    /// Number of groups of four that hold all joints of the present arm: a compile-time constant,
    /// so that loops over them are unrolled.
    const PARTS: usize;

    /// Four numbers side by side.
    fn load(self, numbers: [f64; WIDTH]) -> Self::Four;

    /// The four numbers as an array.
    fn to_array(self, four: Self::Four) -> [f64; WIDTH];

    /// One number in all lanes.
    fn splat(self, number: f64) -> Self::Four;

    /// `a + b`.
    fn add(self, a: Self::Four, b: Self::Four) -> Self::Four;

    /// `a − b`.
    fn sub(self, a: Self::Four, b: Self::Four) -> Self::Four;

    /// `a b`.
    fn mul(self, a: Self::Four, b: Self::Four) -> Self::Four;

    /// `a b + c`.
    fn mul_add(self, a: Self::Four, b: Self::Four, c: Self::Four) -> Self::Four;

    /// `c − a b`.
    fn neg_mul_add(self, a: Self::Four, b: Self::Four, c: Self::Four) -> Self::Four;

    /// `|a|`.
    fn abs(self, a: Self::Four) -> Self::Four;

    /// The larger of each pair: `b` if `a` is NaN.
    fn max(self, a: Self::Four, b: Self::Four) -> Self::Four;

    /// The sum of each of four.
    fn row_sums(self, vectors: [Self::Four; WIDTH]) -> Self::Four;

    /// The first three columns of four rows.
    fn columns(self, rows: [Self::Four; WIDTH]) -> [Self::Four; 3];

    /// Sines and cosines of angles advanced by as many quarter turns as the last bits of `shifted`
    /// state.
    fn rotate_quarter_turns(
        self,
        shifted: Self::Four,
        sine: Self::Four,
        cosine: Self::Four,
    ) -> (Self::Four, Self::Four);

    /// A vector's coordinates.
    #[inline(always)]
    fn load_vector(self, v: DVec3) -> Self::Four {
        self.load([v.x, v.y, v.z, 0.0])
    }

    /// The vector of these coordinates.
    #[inline(always)]
    fn to_vector(self, four: Self::Four) -> DVec3 {
        let [x, y, z, _] = self.to_array(four);
        DVec3::new(x, y, z)
    }

    /// The numbers of four joints, `4 k` to `4 k + 3`.
    #[inline(always)]
    fn part(self, list: &[f64; JOINTS_MAX], k: usize) -> Self::Four {
        self.load(list.as_chunks().0[k])
    }

    /// The sum of the four.
    #[inline(always)]
    fn sum(self, four: Self::Four) -> f64 {
        let [a, b, c, d] = self.to_array(four);
        (a + b) + (c + d)
    }

    /// The largest of the four.
    #[inline(always)]
    fn largest(self, four: Self::Four) -> f64 {
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        let [a, b, c, d] = self.to_array(four);
        larger(larger(a, c), larger(b, d))
    }

    /// Stores the values of four joints.
    #[inline(always)]
    fn store(self, four: Self::Four, into: &mut [f64; JOINTS_MAX], k: usize) {
        into.as_chunks_mut().0[k] = self.to_array(four);
    }
}

/// A kernel over lanes. Write plain loops: closures and iterator adaptors prevent the compiler from
/// optimising lanes.
pub trait Kernel {
    /// Result of the kernel.
    type Output;

    /// Runs the kernel. Must be inlined completely: functions called from here are compiled for the
    /// selected instruction set only if they are inlined.
    fn run<S: Lanes>(self, lanes: S) -> Self::Output;
}

/// Groups that hold the joints of nearly every arm, and of any.
const FEW_PARTS: usize = 2;
const ALL_PARTS: usize = JOINTS_MAX / WIDTH;

/// Runs the kernel for an arm of `count` joints with the widest lanes of this machine.
#[inline(always)]
pub fn run_widest<W: Kernel>(count: usize, work: W) -> W::Output {
    let are_few = count <= FEW_PARTS * WIDTH;
    #[cfg(target_arch = "x86_64")]
    if let Some(lanes) = V3::try_new() {
        return if are_few {
            lanes.vectorize(KernelCall { lanes: Avx2Lanes::<FEW_PARTS>(lanes), work })
        } else {
            lanes.vectorize(KernelCall { lanes: Avx2Lanes::<ALL_PARTS>(lanes), work })
        };
    }
    if are_few {
        work.run(PortableLanes::<FEW_PARTS>)
    } else {
        work.run(PortableLanes::<ALL_PARTS>)
    }
}

#[cfg(target_arch = "x86_64")]
struct KernelCall<L, W> {
    lanes: L,
    work: W,
}

#[cfg(target_arch = "x86_64")]
impl<L: Lanes, W: Kernel> NullaryFnOnce for KernelCall<L, W> {
    type Output = W::Output;

    #[inline(always)]
    fn call(self) -> W::Output {
        self.work.run(self.lanes)
    }
}

/// Portable code, vectorised by the compiler if possible.
#[derive(Clone, Copy)]
pub struct PortableLanes<const PARTS: usize>;

impl<const PARTS: usize> Lanes for PortableLanes<PARTS> {
    type Four = [f64; WIDTH];

    const PARTS: usize = PARTS;

    #[inline(always)]
    fn load(self, numbers: [f64; WIDTH]) -> Self::Four {
        numbers
    }

    #[inline(always)]
    fn to_array(self, four: Self::Four) -> [f64; WIDTH] {
        four
    }

    #[inline(always)]
    fn splat(self, number: f64) -> Self::Four {
        [number; WIDTH]
    }

    #[inline(always)]
    fn add(self, a: Self::Four, b: Self::Four) -> Self::Four {
        [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
    }

    #[inline(always)]
    fn sub(self, a: Self::Four, b: Self::Four) -> Self::Four {
        [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
    }

    #[inline(always)]
    fn mul(self, a: Self::Four, b: Self::Four) -> Self::Four {
        [a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]]
    }

    #[inline(always)]
    fn mul_add(self, a: Self::Four, b: Self::Four, c: Self::Four) -> Self::Four {
        self.add(self.mul(a, b), c)
    }

    #[inline(always)]
    fn neg_mul_add(self, a: Self::Four, b: Self::Four, c: Self::Four) -> Self::Four {
        self.sub(c, self.mul(a, b))
    }

    #[inline(always)]
    fn abs(self, a: Self::Four) -> Self::Four {
        a.map(f64::abs)
    }

    #[inline(always)]
    fn max(self, a: Self::Four, b: Self::Four) -> Self::Four {
        let larger = |i: usize| if a[i] > b[i] { a[i] } else { b[i] };
        [larger(0), larger(1), larger(2), larger(3)]
    }

    #[inline(always)]
    fn row_sums(self, [a, b, c, d]: [Self::Four; WIDTH]) -> Self::Four {
        [self.sum(a), self.sum(b), self.sum(c), self.sum(d)]
    }

    #[inline(always)]
    fn columns(self, [a, b, c, d]: [Self::Four; WIDTH]) -> [Self::Four; 3] {
        [[a[0], b[0], c[0], d[0]], [a[1], b[1], c[1], d[1]], [a[2], b[2], c[2], d[2]]]
    }

    #[inline(always)]
    fn rotate_quarter_turns(
        self,
        shifted: Self::Four,
        sine: Self::Four,
        cosine: Self::Four,
    ) -> (Self::Four, Self::Four) {
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| quartered(shifted[i], sine[i], cosine[i]));
        ([a.0, b.0, c.0, d.0], [a.1, b.1, c.1, d.1])
    }
}

/// AVX2 with fused multiply-add.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
struct Avx2Lanes<const PARTS: usize>(V3);

#[cfg(target_arch = "x86_64")]
impl<const PARTS: usize> Lanes for Avx2Lanes<PARTS> {
    type Four = f64x4;

    const PARTS: usize = PARTS;

    #[inline(always)]
    fn load(self, [a, b, c, d]: [f64; WIDTH]) -> f64x4 {
        f64x4(a, b, c, d)
    }

    #[inline(always)]
    fn to_array(self, four: f64x4) -> [f64; WIDTH] {
        [four.0, four.1, four.2, four.3]
    }

    #[inline(always)]
    fn splat(self, number: f64) -> f64x4 {
        self.0.splat_f64x4(number)
    }

    #[inline(always)]
    fn add(self, a: f64x4, b: f64x4) -> f64x4 {
        self.0.add_f64x4(a, b)
    }

    #[inline(always)]
    fn sub(self, a: f64x4, b: f64x4) -> f64x4 {
        self.0.sub_f64x4(a, b)
    }

    #[inline(always)]
    fn mul(self, a: f64x4, b: f64x4) -> f64x4 {
        self.0.mul_f64x4(a, b)
    }

    #[inline(always)]
    fn mul_add(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
        self.0.mul_add_f64x4(a, b, c)
    }

    #[inline(always)]
    fn neg_mul_add(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
        self.0.negate_mul_add_f64x4(a, b, c)
    }

    #[inline(always)]
    fn abs(self, a: f64x4) -> f64x4 {
        self.0.abs_f64x4(a)
    }

    #[inline(always)]
    fn max(self, a: f64x4, b: f64x4) -> f64x4 {
        pulp::cast(self.0.avx._mm256_max_pd(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn row_sums(self, vectors: [f64x4; WIDTH]) -> f64x4 {
        let (avx, [a, b, c, d]) = (self.0.avx, vectors.map(pulp::cast));
        // Sums of pairs, those of lower lanes first.
        let (ab, cd) = (avx._mm256_hadd_pd(a, b), avx._mm256_hadd_pd(c, d));
        let low = avx._mm256_permute2f128_pd::<0x20>(ab, cd);
        pulp::cast(avx._mm256_add_pd(low, avx._mm256_permute2f128_pd::<0x31>(ab, cd)))
    }

    #[inline(always)]
    fn columns(self, rows: [f64x4; WIDTH]) -> [f64x4; 3] {
        let (avx, [a, b, c, d]) = (self.0.avx, rows.map(pulp::cast));
        // Even columns of two rows each, then odd ones.
        let (ab, cd) = (avx._mm256_unpacklo_pd(a, b), avx._mm256_unpacklo_pd(c, d));
        let (odd_ab, odd_cd) = (avx._mm256_unpackhi_pd(a, b), avx._mm256_unpackhi_pd(c, d));
        let x = avx._mm256_permute2f128_pd::<0x20>(ab, cd);
        let y = avx._mm256_permute2f128_pd::<0x20>(odd_ab, odd_cd);
        let z = avx._mm256_permute2f128_pd::<0x31>(ab, cd);
        [x, y, z].map(pulp::cast)
    }

    #[inline(always)]
    fn rotate_quarter_turns(self, shifted: f64x4, sine: f64x4, cosine: f64x4) -> (f64x4, f64x4) {
        let (avx, avx2) = (self.0.avx, self.0.avx2);
        let (sine, cosine) = (pulp::cast(sine), pulp::cast(cosine));
        let (bits, minus) = (pulp::cast(shifted), pulp::cast(self.splat(-0.0)));
        // Tests the top bit: whether the quarter is odd, then whether the sign changes.
        let odd = pulp::cast(avx2._mm256_slli_epi64::<63>(bits));
        let next = avx2._mm256_add_epi64(bits, avx._mm256_set1_epi64x(1));
        let [sign, next] =
            [bits, next].map(|quarter| pulp::cast(avx2._mm256_slli_epi64::<62>(quarter)));
        let (sign, next) = (avx._mm256_and_pd(sign, minus), avx._mm256_and_pd(next, minus));
        let first = avx._mm256_blendv_pd(sine, cosine, odd);
        let second = avx._mm256_blendv_pd(cosine, sine, odd);
        let turned = [avx._mm256_xor_pd(first, sign), avx._mm256_xor_pd(second, next)];
        let [sine, cosine] = turned.map(pulp::cast);
        (sine, cosine)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The sums of four rows and their columns, the larger sizes of the first two, and the largest of these.
    struct SumsAndColumns([[f64; WIDTH]; WIDTH]);

    impl Kernel for SumsAndColumns {
        type Output = ([f64; WIDTH], [f64; WIDTH], f64, [[f64; WIDTH]; 3]);

        fn run<S: Lanes>(self, lanes: S) -> Self::Output {
            let [a, b, c, d] = self.0.map(|row| lanes.load(row));
            let larger = lanes.max(lanes.abs(a), lanes.abs(b));
            let sums = lanes.to_array(lanes.row_sums([a, b, c, d]));
            let columns = lanes.columns([a, b, c, d]).map(|column| lanes.to_array(column));
            (sums, lanes.to_array(larger), lanes.largest(larger), columns)
        }
    }

    proptest! {
        #[test]
        fn the_widest_lanes_say_of_four_numbers_what_any_do(rows in prop::array::uniform4(prop::array::uniform4(-9.0..9.0_f64))) {
            let plain = SumsAndColumns(rows).run(PortableLanes::<FEW_PARTS>);
            prop_assert_eq!(run_widest(1, SumsAndColumns(rows)), plain);
            prop_assert!((plain.0[3] - rows[3].iter().sum::<f64>()).abs() < 1e-14);
            let largest = rows[..2].iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
            prop_assert_eq!(plain.2, largest);
            prop_assert_eq!(plain.3, std::array::from_fn(|k| rows.map(|row| row[k])));
        }
    }

    #[test]
    fn nan_is_never_the_larger() {
        let mut rows = [[1.0; WIDTH]; WIDTH];
        rows[0][2] = f64::NAN;
        assert_eq!(run_widest(1, SumsAndColumns(rows)).1, [1.0; WIDTH]);
        assert_eq!(SumsAndColumns(rows).run(PortableLanes::<FEW_PARTS>).1, [1.0; WIDTH]);
    }
}
