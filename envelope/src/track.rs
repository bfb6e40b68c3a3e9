//! Divided differences of an unevenly sampled signal.
//!
//! [`Track::with`] gives the third divided difference as a jerk: the mean of the third derivative of
//! any smooth signal through the samples, whatever their spacing. It is taken of the newest sample
//! and three nodes: the first sample, and each that is [`NODE_SPACING_S`] or more after the node before.
//! All samples of a regular cycle are nodes; with closer ones, of a back-to-back loop, rounding of the positions
//! would appear as jerk.
//!
//! Where the times of the samples are uncertain by `jitter`, a signal of rate `v` appears to have
//! sample errors of up to `v · jitter`. [`SampleTimes::jitter_jerk`] is the third difference that
//! this can make; rate and acceleration then come from a fading-memory filter (Brookner, *Tracking
//! and Kalman Filtering Made Easy*, 1998, section 1.2) instead of from three samples. With a memory
//! of `N` samples at intervals `h` the acceleration lags by up to `jerk · h · N`, and is off by about
//! `v · jitter / (h² N³)` from the jitter: the sum is least near `N⁴ = jitter_jerk / jerk`.

use crate::motion::Motion;

/// The least time between nodes: half the period of the fastest cycle.
pub(crate) const NODE_SPACING_S: f64 = 5e-5;

/// A filter with a shorter memory than this is no better than three samples.
const MEMORY_MIN: f64 = 1.5;

/// Times of the samples: the same for all signals that are sampled together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SampleTimes {
    /// Time from the last node to the newest sample.
    since_s: f64,
    /// Time between the last two nodes, and between the two before. If both are zero, differences
    /// are derivatives at one instant (Hermite), as at the start of a signal.
    node_s: f64,
    before_s: f64,
    /// Factors of the differences of rates: the inverse of their time span, and two and three times
    /// that over the spans of the next two.
    per_s: [f64; 3],
    /// Whether the previous newest sample is now the last node.
    is_renewed: bool,
    /// Time from the previous sample to the newest.
    dt_s: f64,
    /// Uncertainty of the times.
    jitter_s: f64,
    /// See [`SampleTimes::sum_of_weights`]; zero while the times are certain.
    weights: f64,
}

impl SampleTimes {
    pub(crate) const START: Self = Self {
        since_s: 0.0,
        node_s: 0.0,
        before_s: 0.0,
        per_s: [0.0; 3],
        is_renewed: false,
        dt_s: 0.0,
        jitter_s: 0.0,
        weights: 0.0,
    };

    /// Another sample, `dt_s > 0` later; its time is uncertain by `jitter_s`.
    pub(crate) fn advance(&mut self, dt_s: f64, jitter_s: f64) {
        (self.dt_s, self.jitter_s) = (dt_s, jitter_s);
        self.is_renewed = self.since_s >= NODE_SPACING_S;
        if self.is_renewed {
            (self.before_s, self.node_s, self.since_s) = (self.node_s, self.since_s, 0.0);
        }
        self.since_s += dt_s;
        let span_s = self.since_s + self.node_s;
        self.per_s = [1.0 / self.since_s, 2.0 / span_s, 3.0 / (span_s + self.before_s)];
        self.weights = if jitter_s > 0.0 { self.sum_of_weights() } else { 0.0 };
    }

    pub(crate) fn are_uncertain(&self) -> bool {
        self.jitter_s > 0.0
    }

    /// The apparent jerk that uncertain times can cause in a signal that moves at `rate`.
    ///
    /// Times that are off by up to `e` to either side spread their intervals by up to `4 e`, and by
    /// about `3 e` among the few that [`Intervals`](crate::Intervals) looks at. Each of the four
    /// samples of a third difference is then off by up to `rate · e`, times its weight.
    pub(crate) fn jitter_jerk(&self, rate: f64) -> f64 {
        rate * self.jitter_s / 3.0 * self.weights
    }

    /// Sum of the magnitudes of the weights of four samples in a third difference: 8 over the cube
    /// of the interval if they are even. At the start of a signal that of the newest sample.
    fn sum_of_weights(&self) -> f64 {
        let ([first, second, third], node_s, before_s) = (self.per_s, self.node_s, self.before_s);
        let newest = first * second * third;
        let nodes = node_s * before_s * (node_s + before_s);
        let of_nodes = first * before_s + second / 2.0 * (node_s + before_s) + third / 3.0 * node_s;
        if nodes > 0.0 { newest + 6.0 * of_nodes / nodes } else { newest }
    }

    /// Relative error of a mean rate between two samples.
    pub(crate) fn rate_error(&self) -> f64 {
        2.0 * self.jitter_s * self.per_s[0]
    }

    /// Three times the mean of the newest two intervals: during it an acceleration changes a rate
    /// by three of its newest differences, however long the interval before was.
    fn acceleration_span_s(&self) -> f64 {
        1.5 * (self.since_s + self.node_s)
    }
}

/// The last node and the newest sample of a signal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Track {
    node: Differences,
    newest: Differences,
    /// The filtered motion at the newest sample.
    filtered: Motion,
}

impl Track {
    pub(crate) const fn from_motion(motion: Motion) -> Self {
        let Motion { value, rate, acceleration } = motion;
        let start = Differences { value, rate, acceleration };
        Self { node: start, newest: start, filtered: motion }
    }

    pub(crate) fn value(&self) -> f64 {
        self.newest.value
    }

    /// The largest rate at the samples before the newest of `times`, as far as the uncertainty of
    /// their times allows. One that came right after its node contains no information on the rate.
    pub(crate) fn fastest(&self, times: &SampleTimes) -> f64 {
        let (newest, change) = if times.is_renewed {
            (self.newest.rate.abs(), (self.newest.rate - self.node.rate).abs())
        } else {
            (0.0, self.node.acceleration.abs() * (times.node_s + times.before_s) / 2.0)
        };
        let mean = newest.max(self.node.rate.abs());
        // The receiver sees the samples alone: a plan that has just begun has more acceleration.
        mean + (self.filtered.acceleration.abs() * times.acceleration_span_s()).min(3.0 * change)
    }

    /// Mean rate since the node before.
    pub(crate) fn rate(&self) -> f64 {
        self.newest.rate
    }

    /// The track with the newest sample of `times`, and its jerk, for a signal whose jerk is at
    /// most `jerk_max`.
    pub(crate) fn with(&self, value: f64, times: &SampleTimes, jerk_max: f64) -> (Self, f64) {
        let node = if times.is_renewed { self.newest } else { self.node };
        let (newest, jerk) = node.to(value, times);
        let memory = if times.jitter_s > 0.0 { self.memory(times, jerk_max) } else { 1.0 };
        let filtered = if memory < MEMORY_MIN {
            newest.parabola(times)
        } else if times.since_s < NODE_SPACING_S {
            // A sample this close contains no information on the rate.
            self.filtered.after(times.dt_s, 0.0)
        } else {
            self.filtered(value, times, memory).limited_to_rate(newest.fastest(times), times)
        };
        (Self { node, newest, filtered }, jerk)
    }

    /// The largest jerk in the next two samples if they continue the filtered motion instead of the
    /// samples: a plan adds it to its own jerk where it starts.
    pub(crate) fn departure_jerk(&self, times: &SampleTimes) -> f64 {
        let (mut times, mut track, mut motion) = (*times, *self, self.motion());
        let mut most = 0.0_f64;
        for _ in 0..2 {
            times.advance(times.dt_s, times.jitter_s);
            motion = motion.after(times.dt_s, 0.0);
            let node = if times.is_renewed { track.newest } else { track.node };
            let (newest, jerk) = node.to(motion.value, &times);
            track = Self { node, newest, filtered: motion };
            most = most.max(jerk.abs());
        }
        most
    }

    /// The best memory of the filter, samples.
    fn memory(&self, times: &SampleTimes, jerk_max: f64) -> f64 {
        let ratio = times.jitter_jerk(self.fastest(times)) / jerk_max;
        libm::sqrt(libm::sqrt(ratio))
    }

    /// The motion at the newest sample.
    ///
    /// While the times are certain it is that of the parabola through the sample and the two nodes
    /// before. The parabola has no jerk, so that whatever continues it within a jerk also keeps that
    /// jerk in every divided difference that mixes samples of before and after.
    pub(crate) fn motion(&self) -> Motion {
        Motion { value: self.newest.value, ..self.filtered }
    }

    /// The same track after a jump of the newest sample, which contains no information on the rate
    /// `before`.
    pub(crate) fn after_jump(self, before: &Self, times: &SampleTimes) -> Self {
        if times.jitter_s == 0.0 {
            return self;
        }
        let going_on = before.filtered.after(times.dt_s, 0.0);
        self.with_motion(Motion { value: self.newest.value, ..going_on })
    }

    /// The same track, if the newest sample is known to belong to `motion`.
    pub(crate) fn with_motion(self, motion: Motion) -> Self {
        Self { filtered: motion, ..self }
    }

    /// One step of the fading-memory filter.
    fn filtered(&self, value: f64, times: &SampleTimes, memory: f64) -> Motion {
        let (per_s, forgets) = (times.per_s[0], 1.0 / memory);
        let keeps = 1.0 - forgets;
        let expected = self.filtered.after(times.dt_s, 0.0);
        let miss = value - expected.value;
        let square = forgets * forgets;
        Motion {
            value: expected.value + (1.0 - keeps * keeps * keeps) * miss,
            rate: expected.rate + 1.5 * square * (1.0 + keeps) * miss * per_s,
            acceleration: expected.acceleration + square * forgets * miss * per_s * per_s,
        }
    }
}

/// A sample, and the backward differences that end there.
#[derive(Clone, Copy, Debug)]
struct Differences {
    value: f64,
    rate: f64,
    acceleration: f64,
}

impl Motion {
    /// Limits the rate to that of the samples of the last intervals, because the filter remembers
    /// longer.
    fn limited_to_rate(self, rate: f64, times: &SampleTimes) -> Self {
        let acceleration = rate * times.per_s[0];
        Self {
            value: self.value,
            rate: self.rate.clamp(-rate, rate),
            acceleration: self.acceleration.clamp(-acceleration, acceleration),
        }
    }
}

impl Differences {
    /// Differences at the next sample, and the third difference.
    fn to(&self, value: f64, times: &SampleTimes) -> (Self, f64) {
        let [first, second, third] = times.per_s;
        let rate = (value - self.value) * first;
        let acceleration = (rate - self.rate) * second;
        (Self { value, rate, acceleration }, (acceleration - self.acceleration) * third)
    }

    /// The largest rate between the samples.
    fn fastest(&self, times: &SampleTimes) -> f64 {
        self.rate.abs() + self.acceleration.abs() * times.acceleration_span_s()
    }

    fn parabola(&self, times: &SampleTimes) -> Motion {
        let Self { value, rate, acceleration } = *self;
        Motion { value, rate: rate + acceleration * times.since_s / 2.0, acceleration }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_has_its_jerk_at_any_pace() {
        let cubic = |t: f64| 0.3 + 0.2 * t - 0.5 * t * t + 2.0 * t * t * t / 6.0;
        let mut track = Track::from_motion(Motion { value: 0.3, rate: 0.2, acceleration: -1.0 });
        let (mut t, mut times) = (0.0, SampleTimes::START);
        for dt in [0.01, 0.02, 0.005, 0.013, 0.01] {
            t += dt;
            times.advance(dt, 0.0);
            let (next, jerk) = track.with(cubic(t), &times, 2.0);
            assert!((jerk - 2.0).abs() < 1e-8, "{jerk}");
            track = next;
        }
    }
}
