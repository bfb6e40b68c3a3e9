//! Divided differences of a sampled signal at an uneven pace.
//!
//! Promises: [`Track::with`] gives the third divided difference as a jerk, the mean of the third
//! derivative of any smooth signal through the samples, so that even pace or jitter do not matter.
//! It is taken of the newest sample and three nodes: the first sample, and each that is [`NODES_S`]
//! or more after the node before. Samples of a cycle are nodes all; closer ones, of a robot that is
//! run flat out, would make a jerk of the rounding of its position. Never keeps more samples.

use crate::motion::Motion;

/// The least time between nodes: half the period of the fastest cycle.
pub(crate) const NODES_S: f64 = 5e-5;

/// The last nodes and the newest sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Track {
    node: Differences,
    newest: Differences,
    /// From the last node to the newest sample.
    since_s: f64,
}

impl Track {
    pub(crate) const fn from_motion(motion: Motion) -> Self {
        let Motion { value, rate, acceleration } = motion;
        let start = Differences { value, rate, acceleration, dt_s: 0.0, before_s: 0.0 };
        Self { node: start, newest: start, since_s: 0.0 }
    }

    pub(crate) fn value(&self) -> f64 {
        self.newest.value
    }

    /// Mean rate since the node before.
    pub(crate) fn rate(&self) -> f64 {
        self.newest.rate
    }

    /// The track with one sample more, `dt_s > 0` later, and its jerk.
    pub(crate) fn with(&self, value: f64, dt_s: f64) -> (Self, f64) {
        let since_s = self.since_s + dt_s;
        let (newest, jerk) = self.node.with(value, since_s);
        let track = if since_s < NODES_S {
            Self { newest, since_s, ..*self }
        } else {
            Self { node: newest, newest, since_s: 0.0 }
        };
        (track, jerk)
    }

    /// The motion at the newest sample of the parabola through it and the two nodes before.
    ///
    /// The parabola has no jerk, so that whatever continues it within a jerk also keeps that jerk in
    /// every divided difference that mixes samples of before and after.
    pub(crate) fn motion(&self) -> Motion {
        let Differences { value, rate, acceleration, dt_s, .. } = self.newest;
        Motion { value, rate: rate + acceleration * dt_s / 2.0, acceleration }
    }
}

/// A sample, and the backward differences that end there.
///
/// With `dt_s = before_s = 0` the differences are derivatives at one instant (Hermite), which is how
/// a signal starts.
#[derive(Clone, Copy, Debug)]
struct Differences {
    value: f64,
    rate: f64,
    acceleration: f64,
    /// Since the sample before.
    dt_s: f64,
    /// Between that and the one before it.
    before_s: f64,
}

impl Differences {
    /// With one sample more, and the jerk of the last four.
    fn with(&self, value: f64, dt_s: f64) -> (Self, f64) {
        let rate = (value - self.value) / dt_s;
        let acceleration = 2.0 * (rate - self.rate) / (dt_s + self.dt_s);
        let jerk = 3.0 * (acceleration - self.acceleration) / (dt_s + self.dt_s + self.before_s);
        (Self { value, rate, acceleration, dt_s, before_s: self.dt_s }, jerk)
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
