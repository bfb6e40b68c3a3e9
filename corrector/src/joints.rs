//! Reductions over the joints, in four independent lanes.
//!
//! There is no early exit, so that the compiler can vectorise the loops.

use core::array;
use physics::lanes::{Kernel, Lanes, PortableLanes, WIDTH, run_widest};
use physics::{JOINTS_MAX, Joints};

/// Adds a step.
pub(crate) fn apply(q: &mut Joints, step: &Joints) {
    for (q, step) in q.iter_mut().zip(step) {
        *q += step;
    }
}

/// `a − b`.
pub(crate) fn difference(a: &Joints, b: &Joints) -> Joints {
    array::from_fn(|i| a[i] - b[i])
}

/// The largest absolute value of a step; NaN is ignored.
pub(crate) fn max_abs(step: &Joints) -> f64 {
    max_abs_in(PortableLanes::<{ JOINTS_MAX / WIDTH }>, step)
}

/// The same, with the given lanes.
#[inline(always)]
pub(crate) fn max_abs_in<S: Lanes>(lanes: S, step: &Joints) -> f64 {
    let mut most = lanes.splat(0.0);
    for k in 0..S::PARTS {
        most = lanes.max(lanes.abs(lanes.part(step, k)), most);
    }
    lanes.largest(most)
}

/// The sum of the absolute values of a step.
pub(crate) fn norm_1(step: &Joints) -> f64 {
    sum(&step.map(f64::abs))
}

/// `a · b`.
pub(crate) fn dot(a: &Joints, b: &Joints) -> f64 {
    sum(&array::from_fn(|i| a[i] * b[i]))
}

fn sum(values: &Joints) -> f64 {
    let mut sums = [0.0_f64; WIDTH];
    for four in values.as_chunks::<WIDTH>().0 {
        sums.iter_mut().zip(four).for_each(|(sum, x)| *sum += x);
    }
    let [a, b, c, d] = sums;
    (a + b) + (c + d)
}

/// Whether `q + step` is within `position_limits` of `centre`, for an arm of `count` joints; false for NaN.
pub(crate) fn stays_within(
    count: usize,
    q: &Joints,
    step: &Joints,
    centre: &Joints,
    position_limits: &Joints,
) -> bool {
    run_widest(count, StaysWithin { q, step, centre, position_limits })
}

struct StaysWithin<'a> {
    q: &'a Joints,
    step: &'a Joints,
    centre: &'a Joints,
    position_limits: &'a Joints,
}

impl Kernel for StaysWithin<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) -> bool {
        let mut stays = true;
        for k in 0..S::PARTS {
            let on = lanes.add(lanes.part(self.q, k), lanes.part(self.step, k));
            let [a, b, c, d] = lanes.to_array(lanes.sub(on, lanes.part(self.centre, k)));
            let [e, f, g, h] = lanes.to_array(lanes.part(self.position_limits, k));
            stays &= (a.abs() <= e) & (b.abs() <= f) & (c.abs() <= g) & (d.abs() <= h);
        }
        stays
    }
}

/// Whether each absolute value is within `times` the allowed one; false for NaN.
pub(crate) fn are_within(step: &Joints, allowed: &Joints, times: f64) -> bool {
    step.iter().zip(allowed).fold(true, |are, (x, allowed)| are & (x.abs() <= times * allowed))
}
