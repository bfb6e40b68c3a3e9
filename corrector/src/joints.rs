//! Reductions over the joints, in four independent lanes.
//!
//! There is no early exit, so that the compiler can vectorise the loops.

use core::array;
use physics::lanes::{Lanes, Plain, WIDTH, Work, widest};
use physics::{JOINTS_MAX, Joints};

/// Adds a step.
pub(crate) fn apply(q: &mut Joints, step: &Joints) {
    for (q, step) in q.iter_mut().zip(step) {
        *q += step;
    }
}

/// `a − b`.
pub(crate) fn off(a: &Joints, b: &Joints) -> Joints {
    array::from_fn(|i| a[i] - b[i])
}

/// The largest absolute value of a step; NaN is ignored.
pub(crate) fn largest(step: &Joints) -> f64 {
    largest_in(Plain::<{ JOINTS_MAX / WIDTH }>, step)
}

/// The same, with the given lanes.
#[inline(always)]
pub(crate) fn largest_in<S: Lanes>(lanes: S, step: &Joints) -> f64 {
    let mut most = lanes.same(0.0);
    for k in 0..S::PARTS {
        most = lanes.larger(lanes.size(lanes.part(step, k)), most);
    }
    lanes.largest(most)
}

/// The sum of the absolute values of a step.
pub(crate) fn length(step: &Joints) -> f64 {
    sum(&step.map(f64::abs))
}

/// `a · b`.
pub(crate) fn product(a: &Joints, b: &Joints) -> f64 {
    sum(&array::from_fn(|i| a[i] * b[i]))
}

fn sum(of: &Joints) -> f64 {
    let mut sums = [0.0_f64; WIDTH];
    for four in of.as_chunks::<WIDTH>().0 {
        sums.iter_mut().zip(four).for_each(|(sum, x)| *sum += x);
    }
    let [a, b, c, d] = sums;
    (a + b) + (c + d)
}

/// Whether `q + step` is within `reach` of `centre`, for an arm of `count` joints; false for NaN.
pub(crate) fn stays_within(
    count: usize,
    q: &Joints,
    step: &Joints,
    centre: &Joints,
    reach: &Joints,
) -> bool {
    widest(count, Stays { q, step, centre, reach })
}

struct Stays<'a> {
    q: &'a Joints,
    step: &'a Joints,
    centre: &'a Joints,
    reach: &'a Joints,
}

impl Work for Stays<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) -> bool {
        let mut stays = true;
        for k in 0..S::PARTS {
            let on = lanes.plus(lanes.part(self.q, k), lanes.part(self.step, k));
            let [a, b, c, d] = lanes.numbers(lanes.minus(on, lanes.part(self.centre, k)));
            let [e, f, g, h] = lanes.numbers(lanes.part(self.reach, k));
            stays &= (a.abs() <= e) & (b.abs() <= f) & (c.abs() <= g) & (d.abs() <= h);
        }
        stays
    }
}

/// Whether each absolute value is within `times` the allowed one; false for NaN.
pub(crate) fn are_within(step: &Joints, allowed: &Joints, times: f64) -> bool {
    step.iter().zip(allowed).fold(true, |are, (x, allowed)| are & (x.abs() <= times * allowed))
}
