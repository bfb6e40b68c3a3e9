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

/// When the samples were: the same for all signals that are sampled together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Times {
    /// From the last node to the newest sample.
    since_s: f64,
    /// Between the last two nodes, and between the two before. Zero in both: differences are derivatives at one instant (Hermite), which is how a
    /// signal starts.
    node_s: f64,
    before_s: f64,
    /// What makes differences of rates: one over the time that they span, twice and three times that over the spans of the next two.
    per_s: [f64; 3],
    /// Whether what was the newest sample before is now the last node.
    is_renewed: bool,
}

impl Times {
    pub(crate) const START: Self =
        Self { since_s: 0.0, node_s: 0.0, before_s: 0.0, per_s: [0.0; 3], is_renewed: false };

    /// One sample more, `dt_s > 0` later.
    pub(crate) fn pass(&mut self, dt_s: f64) {
        self.is_renewed = self.since_s >= NODES_S;
        if self.is_renewed {
            (self.before_s, self.node_s, self.since_s) = (self.node_s, self.since_s, 0.0);
        }
        self.since_s += dt_s;
        let span_s = self.since_s + self.node_s;
        self.per_s = [1.0 / self.since_s, 2.0 / span_s, 3.0 / (span_s + self.before_s)];
    }
}

/// The last node and the newest sample of a signal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Track {
    node: Differences,
    newest: Differences,
}

impl Track {
    pub(crate) const fn from_motion(motion: Motion) -> Self {
        let Motion { value, rate, acceleration } = motion;
        let start = Differences { value, rate, acceleration };
        Self { node: start, newest: start }
    }

    pub(crate) fn value(&self) -> f64 {
        self.newest.value
    }

    /// Mean rate since the node before.
    pub(crate) fn rate(&self) -> f64 {
        self.newest.rate
    }

    /// The track with the newest sample of `times`, and its jerk.
    pub(crate) fn with(&self, value: f64, times: &Times) -> (Self, f64) {
        let node = if times.is_renewed { self.newest } else { self.node };
        let [first, second, third] = times.per_s;
        let rate = (value - node.value) * first;
        let acceleration = (rate - node.rate) * second;
        let jerk = (acceleration - node.acceleration) * third;
        (Self { node, newest: Differences { value, rate, acceleration } }, jerk)
    }

    /// The motion at the newest sample of the parabola through it and the two nodes before.
    ///
    /// The parabola has no jerk, so that whatever continues it within a jerk also keeps that jerk in
    /// every divided difference that mixes samples of before and after.
    pub(crate) fn motion(&self, times: &Times) -> Motion {
        let Differences { value, rate, acceleration } = self.newest;
        Motion { value, rate: rate + acceleration * times.since_s / 2.0, acceleration }
    }
}

/// A sample, and the backward differences that end there.
#[derive(Clone, Copy, Debug)]
struct Differences {
    value: f64,
    rate: f64,
    acceleration: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_has_its_jerk_at_any_pace() {
        let cubic = |t: f64| 0.3 + 0.2 * t - 0.5 * t * t + 2.0 * t * t * t / 6.0;
        let mut track = Track::from_motion(Motion { value: 0.3, rate: 0.2, acceleration: -1.0 });
        let (mut t, mut times) = (0.0, Times::START);
        for dt in [0.01, 0.02, 0.005, 0.013, 0.01] {
            t += dt;
            times.pass(dt);
            let (next, jerk) = track.with(cubic(t), &times);
            assert!((jerk - 2.0).abs() < 1e-8, "{jerk}");
            track = next;
        }
    }
}
