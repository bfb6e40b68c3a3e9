//! A sampled motion as a curve in continuous time.
//!
//! Between two samples a cubic with the slopes of the parabola through three neighbours (Bessel);
//! next to an interval at rest the slope is zero, so that a rest remains a rest; beyond the ends it
//! is linear. Speeds and accelerations at the samples come from a parabola fitted to a window,
//! because positions in files are rounded (Savitzky and Golay, 1964); the window is no wider than
//! the rounding requires, because it smears a stop or a reversal within it.
//!
//! It passes through every sample; times may be uneven. Each interval depends on at most three
//! samples.

use libm::sqrt;

/// Half width of the widest window for velocities and accelerations, s: ten samples at 1 kHz, only the neighbours at 100 Hz.
const HALF_WINDOW_S: f64 = 8e-3;
/// Largest error by rounding, as a share of the motion's own acceleration.
const ROUGH: f64 = 2e-3;
/// Median of the absolute fourth difference of white noise, in units of its standard deviation: 0.6745 √70.
const FOURTH: f64 = 5.643;

/// A cubic from one sample to the next: `c0 + c1 s + c2 s² + c3 s³`, s from the first of the two, s.
pub(crate) type Cubic = [f64; 4];

/// A motion through samples at strictly increasing times.
#[derive(Clone, Debug)]
pub(crate) struct Curve<'a> {
    times_s: &'a [f64],
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl<'a> Curve<'a> {
    /// The curve through `values` at `times_s`, of the same length.
    pub(crate) fn through(times_s: &'a [f64], values: Vec<f64>) -> Self {
        let slopes = slopes(times_s, &values);
        Self { times_s, values, slopes }
    }

    /// The cubic after sample `k`, which is not the last.
    pub(crate) fn piece(&self, k: usize) -> Cubic {
        let h = self.times_s[k + 1] - self.times_s[k];
        let (a, b) = (self.slopes[k], self.slopes[k + 1]);
        let secant = (self.values[k + 1] - self.values[k]) / h;
        [self.values[k], a, (3.0 * secant - 2.0 * a - b) / h, (a + b - 2.0 * secant) / (h * h)]
    }

    /// The slope at sample `k`.
    pub(crate) fn slope(&self, k: usize) -> f64 {
        self.slopes[k]
    }

    /// The position at `t_s`.
    pub(crate) fn at(&self, t_s: f64) -> f64 {
        let Some(last) = self.times_s.len().checked_sub(1) else { return f64::NAN };
        if t_s <= self.times_s[0] {
            return self.values[0] + self.slopes[0] * (t_s - self.times_s[0]);
        }
        if t_s >= self.times_s[last] {
            return self.values[last] + self.slopes[last] * (t_s - self.times_s[last]);
        }
        let k = self.times_s.partition_point(|t| *t <= t_s) - 1;
        value(&self.piece(k), t_s - self.times_s[k])
    }
}

impl Curve<'_> {
    /// The speed at `t_s`.
    pub(crate) fn rate_at(&self, t_s: f64) -> f64 {
        let Some(last) = self.times_s.len().checked_sub(1) else { return f64::NAN };
        if t_s <= self.times_s[0] || last == 0 {
            return self.slopes[0];
        }
        if t_s >= self.times_s[last] {
            return self.slopes[last];
        }
        let k = self.times_s.partition_point(|t| *t <= t_s) - 1;
        let ([_, a, b, c], s) = (self.piece(k), t_s - self.times_s[k]);
        a + s * (2.0 * b + s * 3.0 * c)
    }
}

/// A cubic's value.
pub(crate) fn value(cubic: &Cubic, s: f64) -> f64 {
    cubic.iter().rev().fold(0.0, |sum, c| sum * s + c)
}

fn slopes(t: &[f64], y: &[f64]) -> Vec<f64> {
    let secants: Vec<f64> =
        t.windows(2).zip(y.windows(2)).map(|(t, y)| (y[1] - y[0]) / (t[1] - t[0])).collect();
    let steps: Vec<f64> = t.windows(2).map(|t| t[1] - t[0]).collect();
    // The slope at the middle of three samples: the secant of each side, weighted with the step of
    // the other side.
    let middle = |k: usize| {
        let (a, b) = (secants[k - 1], secants[k]);
        if a == 0.0 || b == 0.0 {
            return 0.0;
        }
        (a * steps[k] + b * steps[k - 1]) / (steps[k - 1] + steps[k])
    };
    let end = |secant: f64, inner: f64| if secant == 0.0 { 0.0 } else { 2.0 * secant - inner };
    match secants.len() {
        0 => vec![0.0; y.len()],
        1 => vec![secants[0]; 2],
        n => {
            let inner: Vec<f64> = (1..n).map(middle).collect();
            let first = end(secants[0], inner[0]);
            let last = end(secants[n - 1], inner[n - 2]);
            std::iter::once(first).chain(inner).chain([last]).collect()
        }
    }
}

/// Speed and acceleration at each sample; the speed is zero where a rest begins or ends, and within
/// it the acceleration too.
pub(crate) fn derivatives(t: &[f64], y: &[f64]) -> Vec<(f64, f64)> {
    let widest = by_windows(t, y, HALF_WINDOW_S);
    let Some((half, step_s)) = narrower(t, y, &widest) else { return widest };
    let mut found = by_windows(t, y, (half as f64 + 0.5) * step_s);
    if half == 1 {
        for k in (1..y.len()).filter(|k| y[*k] == y[k - 1]) {
            (found[k - 1].0, found[k].0) = (0.0, 0.0);
        }
    }
    found
}

/// Half of the narrowest window whose result is not dominated by rounding, in samples, and the time
/// step, s; `None` if that is the widest.
fn narrower(t: &[f64], y: &[f64], widest: &[(f64, f64)]) -> Option<(usize, f64)> {
    let mut steps: Vec<f64> = t.windows(2).map(|t| t[1] - t[0]).collect();
    let step_s = median(&mut steps)?;
    let fourth = |y: &[f64]| (y[0] - 4.0 * y[1] + 6.0 * y[2] - 4.0 * y[3] + y[4]).abs();
    let mut rough: Vec<f64> = y.windows(5).map(fourth).filter(|rough| *rough > 0.0).collect();
    let rough = median(&mut rough)? / FOURTH;
    let squares = widest.iter().map(|(_, a)| a * a).sum::<f64>();
    let usual = sqrt(squares / widest.len() as f64);
    let spoilt = |half: usize| {
        let n = (2 * half + 1) as f64;
        let square = 720.0 / (n * (n * n - 1.0) * (n * n - 4.0));
        rough * sqrt(square) / (step_s * step_s) > ROUGH * usual
    };
    let most = (HALF_WINDOW_S / step_s + 1e-6) as usize;
    (1..most).find(|half| !spoilt(*half)).map(|half| (half, step_s))
}

fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

fn by_windows(t: &[f64], y: &[f64], half_s: f64) -> Vec<(f64, f64)> {
    let n = t.len();
    let mut found = Vec::with_capacity(n);
    let (mut from, mut to) = (0, 0);
    for k in 0..n {
        while t[from] < t[k] - half_s {
            from += 1;
        }
        while to < n && t[to] <= t[k] + half_s {
            to += 1;
        }
        // At least three samples, on both sides if available.
        let low = from.min(k.saturating_sub(1));
        let high = to.max((k + 2).min(n));
        let low = if high - low < 3 { high.saturating_sub(3).min(low) } else { low };
        let high = if high - low < 3 { (low + 3).min(n) } else { high };
        found.push(parabola(t[k], &t[low..high], &y[low..high]));
    }
    found
}

/// Slope and curvature at `centre` of the parabola of least squares.
fn parabola(centre: f64, t: &[f64], y: &[f64]) -> (f64, f64) {
    let (Some(first), Some(last)) = (t.first(), t.last()) else { return (0.0, 0.0) };
    // At rest, rounding errors would give the velocity a sign.
    if y.iter().all(|value| *value == y[0]) {
        return (0.0, 0.0);
    }
    let scale = last - first;
    if t.len() < 3 || scale <= 0.0 {
        let slope = if t.len() == 2 { (y[1] - y[0]) / scale } else { 0.0 };
        return (slope, 0.0);
    }
    let mean = y.iter().sum::<f64>() / y.len() as f64;
    let (mut s, mut b) = ([0.0; 5], [0.0; 3]);
    for (t, y) in t.iter().zip(y) {
        let x = (t - centre) / scale;
        let mut power = 1.0;
        for (k, sum) in s.iter_mut().enumerate() {
            *sum += power;
            if k < 3 {
                b[k] += power * (y - mean);
            }
            power *= x;
        }
    }
    let minor = |i: usize, j: usize, k: usize, l: usize| s[i] * s[j] - s[k] * s[l];
    let (a, c, e) = (minor(2, 4, 3, 3), minor(1, 4, 2, 3), minor(1, 3, 2, 2));
    let determinant = s[0] * a - s[1] * c + s[2] * e;
    let slope = -b[0] * c + b[1] * minor(0, 4, 2, 2) - b[2] * minor(0, 3, 1, 2);
    let bend = b[0] * e - b[1] * minor(0, 3, 1, 2) + b[2] * minor(0, 2, 1, 1);
    (slope / determinant / scale, 2.0 * bend / determinant / (scale * scale))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn times(n: usize, dt: f64) -> Vec<f64> {
        (0..n).map(|k| k as f64 * dt).collect()
    }

    #[test]
    fn a_sine_is_hit_between_its_samples() {
        let t = times(500, 4e-3);
        let curve = Curve::through(&t, t.iter().map(|t| (6.0 * t).sin()).collect());
        for k in 10..4000_u32 {
            let time = f64::from(k) * 4.7e-4;
            assert!((curve.at(time) - (6.0 * time).sin()).abs() < 4e-7, "{time}");
        }
    }

    #[test]
    fn a_rest_stays_a_rest_beside_a_motion() {
        let t = times(40, 0.01);
        let moved = |k: usize| if k < 20 { 0.3 } else { 0.3 + 0.02 * (k - 19) as f64 };
        let curve = Curve::through(&t, (0..40).map(moved).collect());
        for k in 0..1900_u32 {
            assert_eq!(curve.at(f64::from(k) * 1e-4), 0.3);
        }
    }

    #[test]
    fn a_window_of_a_thousand_hertz_gets_through_the_last_digit_of_a_file() {
        let t = times(1000, 1e-3);
        let digit = 1e-4_f64.to_radians();
        let y: Vec<f64> = t.iter().map(|t| ((3.0 * t).sin() / digit).round() * digit).collect();
        for (k, (speed, acceleration)) in derivatives(&t, &y).into_iter().enumerate() {
            if (10..990).contains(&k) {
                assert!((speed - 3.0 * (3.0 * t[k]).cos()).abs() < 5e-4);
                assert!((acceleration + 9.0 * (3.0 * t[k]).sin()).abs() < 0.05);
            }
        }
    }

    #[test]
    fn a_motion_without_rounding_stops_where_it_stops() {
        // Speed decreases linearly to zero at 0.3 s.
        let t = times(1000, 5e-4);
        let position = |t: f64| if t < 0.3 { 2.0 * t - t * t / 0.3 } else { 0.3 };
        let y: Vec<f64> = t.iter().map(|t| position(*t)).collect();
        for (k, (speed, acceleration)) in derivatives(&t, &y).into_iter().enumerate() {
            if k >= 600 {
                assert_eq!(speed, 0.0, "{k}");
                assert!(k == 600 || acceleration == 0.0, "{k}");
            } else if k < 598 {
                assert!((speed - 2.0 * (1.0 - t[k] / 0.3)).abs() < 1e-6, "{k}: {speed}");
                assert!((acceleration + 2.0 / 0.3).abs() < 1e-3, "{k}: {acceleration}");
            }
        }
    }

    proptest! {
        #[test]
        fn parabolas_are_met_exactly(
            steps in prop::collection::vec(1e-3..5e-2_f64, 3..20), c in prop::array::uniform3(-2.0..2.0_f64), share in 0.0..1.0_f64,
        ) {
            let t: Vec<f64> = steps.iter().scan(0.0, |t, step| { *t += step; Some(*t) }).collect();
            let y = |t: f64| c[0] + c[1] * t + c[2] * t * t;
            let values: Vec<f64> = t.iter().map(|t| y(*t)).collect();
            for (k, (speed, acceleration)) in derivatives(&t, &values).into_iter().enumerate() {
                prop_assert!((speed - c[1] - 2.0 * c[2] * t[k]).abs() < 1e-8);
                prop_assert!((acceleration - 2.0 * c[2]).abs() < 1e-6);
            }
            let curve = Curve::through(&t, values);
            let inside = t[0] + share * (t[t.len() - 1] - t[0]);
            prop_assert!((curve.at(inside) - y(inside)).abs() < 1e-12);
        }
    }
}
