//! The part of the signal that is asynchronous to the spindle: the difference to one revolution
//! before.
//!
//! `a(t) = x(t) − x(t − T)`, T: one revolution. Runout, tooth passing and all their harmonics have
//! the period T and cancel; a tone at `f` remains with the gain `|2 sin(π f T)|`, for which its
//! amplitude is corrected. With a slow spindle the harmonics are so close that short windows do not
//! separate chatter from them; the difference isolates it. Source: comb filtering of the periodic
//! force, as for the energy ratio of Caliskan, Kilic and Altintas 2018. Valid for a speed known
//! within 0.5 % and steady over a revolution; if the force itself changes over a revolution
//! (entry), a residual remains at the harmonics, where no lines are searched. Execution does not
//! allocate.

use crate::branch::{Branch, SPLIT_HZ};
use crate::config::MonitorConfig;
use crate::cut_detection::CutState;
use crate::decimate::FrontEnd;
use crate::history::History;
use crate::rules::Rules;
use crate::sliding::Detection;
use realfft::RealFftPlanner;
use std::f64::consts::PI;

/// A larger relative difference is a change of speed: earlier samples are discarded.
const SPEED_CHANGE: f64 = 0.005;
/// Samples beyond one revolution required by the interpolation.
const INTERPOLATION_SAMPLES: usize = 4;

/// The signal minus that of one revolution before, with the same windows as the signal itself.
pub(crate) struct AsynchronousSignal {
    rate_hz: f64,
    least_gain: f64,
    speeds_hz: [f64; 2],
    /// Samples per revolution; 0 without a usable speed.
    revolution: f64,
    raw: Vec<History>,
    differences: Vec<History>,
    pub(crate) low: Branch,
    pub(crate) full: Option<Branch>,
}

impl AsynchronousSignal {
    /// Plans a second set of the monitor's branches, for the difference signal.
    pub(crate) fn new(
        planner: &mut RealFftPlanner<f64>,
        config: &MonitorConfig,
        front: &FrontEnd,
        low_top_hz: f64,
        is_split: bool,
    ) -> Self {
        let Rules { comb_spindle_hz, least_comb_gain, .. } = config.rules;
        let longest = (config.rate_hz / comb_spindle_hz[0]) as usize + INTERPOLATION_SAMPLES;
        let histories =
            |length: usize| (0..config.channels).map(|_| History::new(length)).collect();
        Self {
            rate_hz: config.rate_hz,
            least_gain: least_comb_gain,
            speeds_hz: comb_spindle_hz,
            revolution: 0.0,
            raw: histories(longest),
            differences: histories(front.longest()),
            low: Branch::low(planner, config, front.factor(), low_top_hz),
            full: is_split.then(|| Branch::full(planner, config)),
        }
    }

    /// Sets the spindle's speed, rev/s. There is no difference signal without a speed, for a slow
    /// spindle whose revolution is longer than the windows, and for a fast one whose multiples the
    /// windows resolve.
    pub(crate) fn set_spindle(&mut self, spindle_hz: f64) {
        let [slowest_hz, fastest_hz] = self.speeds_hz;
        let usable = spindle_hz >= slowest_hz && spindle_hz < fastest_hz;
        let revolution = if usable { self.rate_hz / spindle_hz } else { 0.0 };
        let change = (revolution - self.revolution).abs();
        if change == 0.0 {
            return;
        }
        if change > SPEED_CHANGE * revolution.min(self.revolution) {
            // The remaining noise depends on the speed.
            self.clear_windows();
            (0..self.raw.len()).for_each(|channel| self.clear_floor(channel));
        }
        self.revolution = revolution;
    }

    /// Whether lines at a frequency are searched in the difference signal: the speed is known, the
    /// noise floor is learned, and the frequency is not near a harmonic.
    pub(crate) fn covers(&self, frequency_hz: f64) -> bool {
        let branch = if frequency_hz < SPLIT_HZ { Some(&self.low) } else { self.full.as_ref() };
        self.revolution > 0.0
            && branch.or(Some(&self.low)).is_some_and(Branch::is_ready)
            && self.gain(frequency_hz) >= self.least_gain
    }

    /// What the difference leaves of a tone, 0 to 2.
    pub(crate) fn gain(&self, frequency_hz: f64) -> f64 {
        gain(frequency_hz, self.revolution, self.rate_hz)
    }

    /// Adds one sample of a channel.
    #[inline]
    pub(crate) fn push_sample(&mut self, channel: usize, sample: f64) {
        self.raw[channel].push(sample);
        if let Some(before) = self.one_revolution_ago(channel) {
            let difference = sample - before;
            self.differences[channel].push(difference);
            if let Some(full) = &mut self.full {
                full.histories[channel].push(difference);
            }
        }
    }

    /// The sample of one revolution before the newest, by cubic interpolation of the four around
    /// it.
    #[inline]
    fn one_revolution_ago(&self, channel: usize) -> Option<f64> {
        if self.revolution <= 0.0 {
            return None;
        }
        let whole = self.revolution.floor();
        let t = self.revolution - whole;
        // Oldest first: 2, 1, 0 and −1 samples before the one at `whole`.
        let run = self.raw[channel].newest(whole as usize + 3)?;
        let (second_before, before, middle, after) = (run[0], run[1], run[2], run[3]);
        Some(
            -t * (t - 1.0) * (t - 2.0) / 6.0 * after
                + (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0 * middle
                - (t + 1.0) * t * (t - 2.0) / 2.0 * before
                + (t + 1.0) * t * (t - 1.0) / 6.0 * second_before,
        )
    }

    /// Computes one sample of the low branch.
    pub(crate) fn decimate(&mut self, front: &FrontEnd) {
        for (difference, low) in self.differences.iter().zip(&mut self.low.histories) {
            if let Some(samples) = difference.newest(front.taps()) {
                low.push(front.output(samples));
            }
        }
    }

    /// Processes a hop at the full rate; passes on detections away from the harmonics.
    pub(crate) fn process_full_rate_hop(
        &mut self,
        surroundings: CutState,
        lines_hz: &[f64],
        sighted: impl FnMut(Detection),
    ) {
        let Some(full) = &mut self.full else { return };
        process_hop(
            full,
            surroundings,
            lines_hz,
            [self.revolution, self.rate_hz, self.least_gain],
            sighted,
        );
    }

    /// Processes a hop of the low branch; passes on detections away from the harmonics.
    pub(crate) fn process_low_hop(
        &mut self,
        surroundings: CutState,
        lines_hz: &[f64],
        sighted: impl FnMut(Detection),
    ) {
        let comb = [self.revolution, self.rate_hz, self.least_gain];
        process_hop(&mut self.low, surroundings, lines_hz, comb, sighted);
    }

    /// Clears samples and peaks; learned floors are kept.
    pub(crate) fn reset(&mut self) {
        self.raw.iter_mut().for_each(History::clear);
        self.clear_windows();
    }

    /// Clears the learned floor of a channel.
    pub(crate) fn clear_floor(&mut self, channel: usize) {
        self.low.clear_floor(channel);
        if let Some(full) = &mut self.full {
            full.clear_floor(channel);
        }
    }

    fn clear_windows(&mut self) {
        self.differences.iter_mut().for_each(History::clear);
        self.low.reset();
        if let Some(full) = &mut self.full {
            full.reset();
        }
    }
}

fn process_hop(
    branch: &mut Branch,
    surroundings: CutState,
    lines_hz: &[f64],
    [revolution, rate_hz, least_gain]: [f64; 3],
    mut sighted: impl FnMut(Detection),
) {
    branch.set_cut_state(surroundings);
    branch.process_hop(lines_hz, |mut sighting| {
        let gain = gain(sighting.frequency_hz, revolution, rate_hz);
        if revolution > 0.0 && gain >= least_gain {
            sighting.power /= gain * gain;
            sighting.is_asynchronous = true;
            sighted(sighting);
        }
    });
}

/// What the difference leaves of a tone, 0 to 2.
fn gain(frequency_hz: f64, revolution: f64, rate_hz: f64) -> f64 {
    (2.0 * (PI * frequency_hz * revolution / rate_hz).sin()).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn multiples_of_the_speed_vanish_and_a_tone_between_them_keeps_its_gain() {
        let config = MonitorConfig { channels: 1, ..MonitorConfig::default() };
        let front = FrontEnd::new(config.rate_hz, SPLIT_HZ);
        let mut apart =
            AsynchronousSignal::new(&mut RealFftPlanner::new(), &config, &front, SPLIT_HZ, true);
        apart.set_spindle(33.63);
        let largest = |apart: &mut AsynchronousSignal, hz: f64| {
            apart.reset();
            let tone = |i: u32| (TAU * hz * f64::from(i) / 10_000.0).sin();
            (0..2000).for_each(|i| apart.push_sample(0, tone(i)));
            let run = apart.differences[0].newest(80).expect("a difference");
            run.iter().fold(0.0_f64, |most, x| most.max(x.abs()))
        };
        for order in [1.0, 3.0, 20.0] {
            assert!(largest(&mut apart, order * 33.63) < 1e-3, "order {order}");
        }
        let halfway = largest(&mut apart, 2.5 * 33.63);
        assert!((halfway - 2.0).abs() < 0.01 && (apart.gain(2.5 * 33.63) - 2.0).abs() < 1e-9);
        assert!(!apart.covers(2.5 * 33.63), "no noise was learned yet");
    }

    #[test]
    fn without_a_speed_and_with_a_fast_one_there_is_no_difference() {
        let config = MonitorConfig { channels: 1, ..MonitorConfig::default() };
        let front = FrontEnd::new(config.rate_hz, SPLIT_HZ);
        let mut apart =
            AsynchronousSignal::new(&mut RealFftPlanner::new(), &config, &front, SPLIT_HZ, true);
        for spindle_hz in [0.0, 5.0, 400.0] {
            apart.set_spindle(spindle_hz);
            (0..2000).for_each(|i| apart.push_sample(0, f64::from(i)));
            assert!(apart.differences[0].newest(1).is_none());
        }
    }
}
