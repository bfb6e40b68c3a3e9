//! Sine and cosine without a branch, so that those of all joints are taken at once.
//!
//! The angle is reduced to an eighth of a turn by subtracting quarter turns in three parts (Cody
//! and Waite, Software Manual for the Elementary Functions, 1980), where two polynomials
//! approximate sine and cosine. Parts and polynomials have the coefficients of Sun's fdlibm
//! (`e_rem_pio2.c`, `k_sin.c`, `k_cos.c`).
//!
//! Within 1e-16 and an ulp of the true values; beyond 300 000 turns, and for values that are not
//! finite, `libm` is used. No table.

use crate::Joints;
use crate::lanes::Lanes;
use libm::sincos;

/// The largest angle that three parts reduce exactly, rad: 300 000 turns.
const LARGE: f64 = 1e6;
/// Adding and subtracting it rounds to a whole number; the last bits of the sum are those of the
/// number.
const WHOLE: f64 = 6_755_399_441_055_744.0;
/// A quarter turn in three parts.
const QUARTER: [f64; 3] =
    [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];
const SINE: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COSINE: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Sine and cosine of an angle, rad.
#[inline(always)]
pub fn sin_cos(angle_rad: f64) -> (f64, f64) {
    if angle_rad.abs() < LARGE { reduced(angle_rad) } else { sincos(angle_rad) }
}

/// Sines and cosines of all joints' angles, four by four.
#[inline(always)]
pub(crate) fn sin_cos_all<S: Lanes>(
    lanes: S,
    angles_rad: &Joints,
    sines: &mut Joints,
    cosines: &mut Joints,
) {
    for k in 0..S::PARTS {
        let (sine, cosine) = sin_cos_four(lanes, lanes.part(angles_rad, k));
        lanes.store(sine, sines, k);
        lanes.store(cosine, cosines, k);
    }
}

/// Sines and cosines of four angles.
#[inline(always)]
pub(crate) fn sin_cos_four<S: Lanes>(lanes: S, angles_rad: S::Four) -> (S::Four, S::Four) {
    let angles = lanes.to_array(angles_rad);
    if angles.iter().all(|angle| angle.abs() < LARGE) {
        return reduced_four(lanes, angles_rad);
    }
    let [a, b, c, d] = angles.map(sin_cos);
    (lanes.load([a.0, b.0, c.0, d.0]), lanes.load([a.1, b.1, c.1, d.1]))
}

/// [`reduced`], four times.
#[inline(always)]
fn reduced_four<S: Lanes>(lanes: S, angle: S::Four) -> (S::Four, S::Four) {
    let one = lanes.splat(1.0);
    let (a_turn, whole) = (lanes.splat(core::f64::consts::FRAC_2_PI), lanes.splat(WHOLE));
    let shifted = lanes.add(lanes.mul(angle, a_turn), whole);
    let quarters = lanes.sub(shifted, whole);
    let mut rest = angle;
    for part in QUARTER {
        rest = lanes.neg_mul_add(quarters, lanes.splat(part), rest);
    }
    let square = lanes.mul(rest, rest);
    let cube = lanes.mul(rest, square);
    let sine = lanes.mul_add(cube, polynomial_four(lanes, square, &SINE), rest);
    let half = lanes.mul(lanes.splat(0.5), square);
    let rounded = lanes.sub(one, half);
    let lost = lanes.sub(lanes.sub(one, rounded), half);
    let fourth = lanes.mul(square, square);
    let lost = lanes.mul_add(fourth, polynomial_four(lanes, square, &COSINE), lost);
    let cosine = lanes.add(rounded, lost);
    lanes.rotate_quarter_turns(shifted, sine, cosine)
}

/// [`polynomial`], four times.
#[inline(always)]
fn polynomial_four<S: Lanes>(lanes: S, x: S::Four, coefficients: &[f64; 6]) -> S::Four {
    let mut sum = lanes.splat(coefficients[5]);
    for k in (0..5).rev() {
        sum = lanes.mul_add(x, sum, lanes.splat(coefficients[k]));
    }
    sum
}

#[inline(always)]
fn reduced(angle: f64) -> (f64, f64) {
    let shifted = angle * core::f64::consts::FRAC_2_PI + WHOLE;
    let quarters = shifted - WHOLE;
    let rest = angle - quarters * QUARTER[0] - quarters * QUARTER[1] - quarters * QUARTER[2];
    let square = rest * rest;
    let sine = rest + rest * square * polynomial(square, &SINE);
    let half = 0.5 * square;
    let rounded = 1.0 - half;
    let cosine = rounded + ((1.0 - rounded) - half + square * square * polynomial(square, &COSINE));
    quartered(shifted, sine, cosine)
}

/// Sine and cosine of an angle advanced by as many quarter turns as the last bits of `shifted`
/// state.
#[inline(always)]
pub(crate) fn quartered(shifted: f64, sine: f64, cosine: f64) -> (f64, f64) {
    let bits = shifted.to_bits();
    // For odd quarters they are exchanged: bitwise, because such a branch could not be predicted.
    let other = (sine.to_bits() ^ cosine.to_bits()) & (bits & 1).wrapping_neg();
    let (first, second) = (sine.to_bits() ^ other, cosine.to_bits() ^ other);
    // The second and third quarter change the sign of the sine, the first and second that of the
    // cosine.
    let signed = |x: u64, turns: u64| f64::from_bits(x ^ ((turns >> 1) << 63));
    (signed(first, bits), signed(second, bits.wrapping_add(1)))
}

/// Horner's rule, lowest coefficient first.
#[inline(always)]
fn polynomial(x: f64, coefficients: &[f64; 6]) -> f64 {
    let [a, b, c, d, e, f] = *coefficients;
    a + x * (b + x * (c + x * (d + x * (e + x * f))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{Kernel, run_widest};
    use proptest::prelude::*;

    struct Many<'a>(&'a Joints, &'a mut Joints, &'a mut Joints);

    impl Kernel for Many<'_> {
        type Output = ();

        fn run<S: Lanes>(self, lanes: S) {
            sin_cos_all(lanes, self.0, self.1, self.2);
        }
    }

    fn is_near(angle: f64) -> bool {
        let (found, known) = (sin_cos(angle), sincos(angle));
        (found.0 - known.0).abs() <= 2.3e-16 && (found.1 - known.1).abs() <= 2.3e-16
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        #[test]
        fn sines_and_cosines_are_those_of_libm(angle in -7.0..7.0_f64, far in -2e6..2e6_f64, exponent in -40..0) {
            prop_assert!(is_near(angle) && is_near(far), "{angle} {far}");
            let tiny = angle * libm::pow(2.0, f64::from(exponent));
            let (sine, _) = sin_cos(tiny);
            prop_assert!((sine / libm::sin(tiny) - 1.0).abs() < 4e-16 || tiny == 0.0, "{tiny}");
        }

        #[test]
        fn near_quarter_turns_what_is_small_keeps_its_size(quarters in -1000..1000_i32, off in -1e-9..1e-9_f64) {
            let angle = f64::from(quarters) * core::f64::consts::FRAC_PI_2 + off;
            let (found, known) = (sin_cos(angle), sincos(angle));
            prop_assert!((found.0 - known.0).abs() < 2.3e-16 && (found.1 - known.1).abs() < 2.3e-16);
        }

        #[test]
        fn many_at_once_are_those_of_libm(angles in prop::array::uniform16(-9.0..9.0_f64), single in any::<f64>()) {
            for angles in [angles, [single; 16]] {
                let (mut sines, mut cosines) = ([0.0; 16], [0.0; 16]);
                run_widest(16, Many(&angles, &mut sines, &mut cosines));
                for (angle, found) in angles.iter().zip(sines.iter().zip(&cosines)) {
                    let known = sincos(*angle);
                    let is_near = |found: f64, known: f64| (found - known).abs() <= 2.3e-16 || known.is_nan() && found.is_nan();
                    prop_assert!(is_near(*found.0, known.0) && is_near(*found.1, known.1), "{angle}");
                }
            }
        }
    }

    #[test]
    fn values_that_are_not_finite_have_no_sine() {
        for angle in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(sin_cos(angle).0.is_nan() && sin_cos(angle).1.is_nan());
        }
    }
}
