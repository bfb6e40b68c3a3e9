//! Resampling to even time steps by cubic interpolation through the four nearest samples, without extrapolation.

/// Samples at even times, in s, by the cubic through the four nearest (Lagrange); the end values are held.
pub(super) fn resampled(
    times: &[f64],
    samples: &[f64],
    start_s: f64,
    step_s: f64,
    count: usize,
) -> Vec<f64> {
    let last_s = times.last().copied().unwrap_or(start_s);
    let mut interval = 0;
    let value = |k: usize| {
        // Delayed samples are unknown beyond the ends.
        let time = (start_s + k as f64 * step_s).clamp(times[0], last_s);
        while interval + 2 < times.len() && times[interval + 1] <= time {
            interval += 1;
        }
        let from = interval.saturating_sub(1).min(times.len().saturating_sub(4));
        let four = from..(from + 4).min(times.len());
        let mut sum = 0.0;
        for i in four.clone() {
            let weight = |j: usize| (time - times[j]) / (times[i] - times[j]);
            sum += samples[i] * four.clone().filter(|j| *j != i).map(weight).product::<f64>();
        }
        sum
    };
    (0..count).map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_that_jitter_come_back_even() {
        let times: Vec<f64> =
            (0..400).map(|k| 0.01 * f64::from(k) + 0.003 * f64::from(k % 3)).collect();
        let samples: Vec<f64> = times.iter().map(|t| libm::sin(3.0 * t)).collect();
        let even = resampled(&times, &samples, 0.0, 0.01, 390);
        for (k, value) in even.iter().enumerate() {
            assert!((value - libm::sin(0.03 * k as f64)).abs() < 1e-6, "{k}");
        }
    }
}
