//! Detection of clipping: a flat top that is not explained by the resolution of the samples.

/// Least number of consecutive equal samples at the extreme value.
const RUN_MIN: usize = 3;
/// Least change, in steps of the resolution, one run length beyond a flat top: a parabola rounded
/// to the resolution changes by at most nine.
const RESOLUTION_STEPS: f64 = 12.0;

/// The largest and the smallest value of a channel, each if it is clipped there.
pub(super) fn clipped_extremes(samples: &[f64]) -> [Option<f64>; 2] {
    let (low, high) = samples
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    let rounding = samples
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .filter(|step| *step > 0.0)
        .fold(f64::INFINITY, f64::min);
    [high, low].map(|end| is_clipped(samples, end, rounding).then_some(end))
}

fn is_clipped(samples: &[f64], end: f64, rounding: f64) -> bool {
    runs(samples, end).any(|(start, length)| {
        let before = start.checked_sub(length).and_then(|index| samples.get(index));
        let after = samples.get(start + 2 * length - 1);
        let fallen = |x: Option<&f64>| x.map_or(0.0, |x| (x - end).abs());
        length >= RUN_MIN && fallen(before).max(fallen(after)) > RESOLUTION_STEPS * rounding
    })
}

/// Starts and lengths of the runs of samples that equal a value.
pub(super) fn runs(samples: &[f64], value: f64) -> impl Iterator<Item = (usize, usize)> + '_ {
    let mut position = 0;
    std::iter::from_fn(move || {
        let start = position + samples.get(position..)?.iter().position(|x| *x == value)?;
        let length = samples[start..].iter().take_while(|x| **x == value).count();
        position = start + length;
        Some((start, length))
    })
}
