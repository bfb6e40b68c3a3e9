//! Detection of rest from the recorded position, independent of ringing of the filter; a reversal is not taken for rest.

/// Minimum duration of an unchanged recorded position for rest, s; a joint passes a reversal in less.
const REST_LEAST_S: f64 = 0.03;

/// Resolution of a position: smallest non-zero step between two samples.
pub(super) fn resolution(samples: &[f64]) -> f64 {
    let steps = samples.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    steps.filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min)
}

/// Samples in a section of at least [`REST_LEAST_S`] in which the position stays within half the resolution.
pub(super) fn stopped_samples(q: &[f64], digit: f64, step_s: f64) -> Vec<bool> {
    let shortest = (REST_LEAST_S / step_s).ceil().max(3.0) as usize;
    let mut all = vec![false; q.len()];
    let mut from = 0;
    for k in 1..=q.len() {
        if k < q.len() && (q[k] - q[from]).abs() < 0.5 * digit {
            continue;
        }
        if k - from > shortest {
            all[from..k].fill(true);
        }
        from = k;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_stop_is_rest_and_a_turn_is_none() {
        let step_s = 2e-3;
        let rounded = |x: f64| (x / 1e-6).round() * 1e-6;
        let turning: Vec<f64> =
            (0..1000).map(|k| rounded(libm::sin(step_s * f64::from(k)))).collect();
        assert!(!stopped_samples(&turning, resolution(&turning), step_s).contains(&true));
        let mut stopping = turning.clone();
        stopping[300..350].fill(turning[300]);
        let found = stopped_samples(&stopping, resolution(&stopping), step_s);
        assert!((0..1000).all(|k| found[k] == (300..350).contains(&k)));
        stopping[300..1000].copy_from_slice(&turning[300..]);
        stopping[300..310].fill(turning[300]);
        assert!(!stopped_samples(&stopping, resolution(&stopping), step_s).contains(&true));
    }
}
