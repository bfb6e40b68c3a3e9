//! Divided differences of a sampled signal at an uneven pace.
//!
//! Promises: [`Track::with`] gives the third divided difference as a jerk, the mean of the third
//! derivative of any smooth signal through the samples, so that even pace or jitter do not matter.
//! Never keeps more than the last three samples say.

use crate::motion::Motion;

/// The last sample, and the backward differences that end there.
///
/// With `dt_s = before_s = 0` the differences are derivatives at one instant (Hermite), which is how
/// a signal starts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Track {
    value: f64,
    rate: f64,
    acceleration: f64,
    /// Between the last two samples.
    dt_s: f64,
    /// Between the two before.
    before_s: f64,
}

impl Track {
    pub(crate) const fn from_motion(motion: Motion) -> Self {
        let Motion { value, rate, acceleration } = motion;
        Self { value, rate, acceleration, dt_s: 0.0, before_s: 0.0 }
    }

    pub(crate) fn value(&self) -> f64 {
        self.value
    }

    /// Mean rate over the last step.
    pub(crate) fn rate(&self) -> f64 {
        self.rate
    }

    /// The track with one sample more, `dt_s > 0` later, and the jerk of the last four.
    pub(crate) fn with(&self, value: f64, dt_s: f64) -> (Self, f64) {
        let rate = (value - self.value) / dt_s;
        let acceleration = 2.0 * (rate - self.rate) / (dt_s + self.dt_s);
        let jerk = 3.0 * (acceleration - self.acceleration) / (dt_s + self.dt_s + self.before_s);
        (Self { value, rate, acceleration, dt_s, before_s: self.dt_s }, jerk)
    }

    /// The motion at the last sample of the parabola through the last three.
    ///
    /// The parabola has no jerk, so that whatever continues it within a jerk also keeps that jerk in
    /// every divided difference that mixes samples of before and after.
    pub(crate) fn motion(&self) -> Motion {
        Motion {
            value: self.value,
            rate: self.rate + self.acceleration * self.dt_s / 2.0,
            acceleration: self.acceleration,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_has_its_jerk_at_any_pace() {
        let cubic = |t: f64| 0.3 + 0.2 * t - 0.5 * t * t + 2.0 * t * t * t / 6.0;
        let mut track = Track::from_motion(Motion { value: 0.3, rate: 0.2, acceleration: -1.0 });
        let mut t = 0.0;
        for dt in [0.01, 0.02, 0.005, 0.013, 0.01] {
            t += dt;
            let (next, jerk) = track.with(cubic(t), dt);
            assert!((jerk - 2.0).abs() < 1e-8, "{jerk}");
            track = next;
        }
    }
}
