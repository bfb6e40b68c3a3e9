//! Detects clipping of a channel: a flat top that rounding does not explain.

/// Fewest equal largest samples in a row.
const RUN: usize = 3;
/// Beyond a rounded top, one run's length further, a parabola has fallen by nine roundings; a cut one by far more.
const ROUNDINGS: f64 = 12.0;

/// The largest and the smallest value of a channel, where it was cut off there.
pub(super) fn ends(samples: &[f64]) -> [Option<f64>; 2] {
    let (low, high) = samples
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    let rounding = samples
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .filter(|step| *step > 0.0)
        .fold(f64::INFINITY, f64::min);
    [high, low].map(|end| is_cut(samples, end, rounding).then_some(end))
}

fn is_cut(samples: &[f64], end: f64, rounding: f64) -> bool {
    runs(samples, end).any(|(start, length)| {
        let before = start.checked_sub(length).and_then(|at| samples.get(at));
        let after = samples.get(start + 2 * length - 1);
        let fallen = |x: Option<&f64>| x.map_or(0.0, |x| (x - end).abs());
        length >= RUN && fallen(before).max(fallen(after)) > ROUNDINGS * rounding
    })
}

/// Starts and lengths of the runs of samples that equal a value.
pub(super) fn runs(samples: &[f64], value: f64) -> impl Iterator<Item = (usize, usize)> + '_ {
    let mut at = 0;
    std::iter::from_fn(move || {
        let start = at + samples.get(at..)?.iter().position(|x| *x == value)?;
        let length = samples[start..].iter().take_while(|x| **x == value).count();
        at = start + length;
        Some((start, length))
    })
}
