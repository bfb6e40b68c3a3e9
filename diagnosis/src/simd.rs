//! Loops over slices, compiled for the widest registers of the machine.
//!
//! The results are bit-identical to plain loops on any machine: sums keep their order, and products are not fused with sums.

use physics::lanes::{Kernel, Lanes, run_widest};

/// `from − share · times`, in place.
pub(crate) fn subtract_scaled(from: &mut [f64], share: f64, times: &[f64]) {
    run_widest(0, Subtract { from, share, times });
}

/// Scalar product, summed in eight partial sums in a fixed order.
#[must_use]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    run_widest(0, Dot { a, b })
}

/// [`subtract_scaled`] for use inside vectorised code.
#[inline(always)]
pub(crate) fn subtract_scaled_inline(from: &mut [f64], share: f64, times: &[f64]) {
    for (x, y) in from.iter_mut().zip(times) {
        *x -= share * y;
    }
}

/// [`dot`] for use inside vectorised code.
#[inline(always)]
pub(crate) fn dot_inline(a: &[f64], b: &[f64]) -> f64 {
    let mut strands = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let mut tail = 0.0;
    for (x, y) in a8.remainder().iter().zip(b8.remainder()) {
        tail += x * y;
    }
    for (x, y) in a8.zip(b8) {
        for ((sum, x), y) in strands.iter_mut().zip(x).zip(y) {
            *sum += x * y;
        }
    }
    strands.iter().sum::<f64>() + tail
}

struct Subtract<'a> {
    from: &'a mut [f64],
    share: f64,
    times: &'a [f64],
}

impl Kernel for Subtract<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, _: S) {
        subtract_scaled_inline(self.from, self.share, self.times);
    }
}

struct Dot<'a> {
    a: &'a [f64],
    b: &'a [f64],
}

impl Kernel for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<S: Lanes>(self, _: S) -> f64 {
        dot_inline(self.a, self.b)
    }
}
