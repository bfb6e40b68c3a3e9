//! Signals that the whole monitor must report or ignore.

use super::*;
use crate::block::Axis;
use crate::config::Mode;
use crate::fault::Fault;
use crate::verdict::{State, Verdict};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::TAU;

/// A sensor with white noise of rms `sigma` on every channel, plus a signal.
pub(super) struct Rig {
    pub(super) watch: VibrationMonitor,
    rate_hz: f64,
    channels: usize,
    sigma: f64,
    rng: ChaCha8Rng,
    seq: u64,
    frame: u64,
    t_ns: u64,
}

impl Rig {
    pub(super) fn new(config: MonitorConfig, sigma: f64, seed: u64) -> Self {
        let (rate_hz, channels) = (config.rate_hz, config.channels);
        let watch = VibrationMonitor::new(config).expect("a good configuration");
        let rng = ChaCha8Rng::seed_from_u64(seed);
        Self { watch, rate_hz, channels, sigma, rng, seq: 0, frame: 0, t_ns: 1_000_000_000 }
    }

    /// Runs for some seconds in blocks of 2 ms; `signal(channel, t_s)` is added to the noise.
    pub(super) fn run(
        &mut self,
        seconds: f64,
        signal: impl Fn(usize, f64) -> f64,
    ) -> Vec<(f64, Verdict)> {
        let per_block = (0.002 * self.rate_hz).max(1.0) as u64;
        let end = self.frame + (seconds * self.rate_hz) as u64;
        let mut events = Vec::new();
        while self.frame < end {
            let mut samples = Vec::new();
            for i in 0..per_block {
                let t_s = (self.frame + i) as f64 / self.rate_hz;
                for channel in 0..self.channels {
                    let noise: f64 = self.rng.sample(StandardNormal);
                    samples.push(self.sigma * noise + signal(channel, t_s));
                }
            }
            let (rate_hz, channels) = (self.rate_hz, self.channels);
            let block = Block {
                seq: self.seq,
                t_ns: self.t_ns,
                rate_hz,
                channels,
                samples: &samples,
                ..Block::default()
            };
            let verdicts = self.watch.push(&block);
            self.seq += 1;
            self.frame += per_block;
            self.t_ns += (per_block as f64 / self.rate_hz * 1e9).round() as u64;
            let now_s = self.frame as f64 / self.rate_hz;
            events.extend(verdicts.iter().map(|verdict| (now_s, *verdict)));
        }
        events
    }

    pub(super) fn lose_a_block(&mut self) {
        self.seq += 1;
    }
}

pub(super) fn config(rate_hz: f64) -> MonitorConfig {
    let modes = [20.0, 35.0, 60.0, 67.0, 70.0, 72.0].map(Mode::at_hz).to_vec();
    MonitorConfig { rate_hz, modes, ..MonitorConfig::default() }
}

/// A tone on channel y from `start_s` on.
pub(super) fn tone_y(
    frequency_hz: f64,
    amplitude: f64,
    start_s: f64,
) -> impl Fn(usize, f64) -> f64 {
    move |channel, t| {
        let on = channel == 1 && t >= start_s;
        if on { amplitude * (TAU * frequency_hz * (t - start_s)).sin() } else { 0.0 }
    }
}

#[test]
fn a_tone_is_found_on_its_axis_with_its_frequency_and_amplitude() {
    for (rate_hz, frequency_hz) in [
        (248.0, 72.0),
        (1000.0, 72.0),
        (2000.0, 130.0),
        (10_000.0, 72.3),
        (10_000.0, 684.0),
        (51_200.0, 35.0),
    ] {
        let mut rig = Rig::new(config(rate_hz), 1.0, 3);
        let events = rig.run(4.0, tone_y(frequency_hz, 6.0, 2.0));
        let (at_s, first) = events.first().expect("the tone is seen");
        assert!((2.0..2.3).contains(at_s), "{rate_hz}: {at_s}");
        let cell_hz = 32.0;
        assert!((first.frequency_hz - frequency_hz).abs() < cell_hz);
        let (_, last) =
            events.iter().rfind(|(_, v)| v.state == State::Confirmed).expect("confirmed");
        assert!((last.frequency_hz - frequency_hz).abs() < 0.5, "{rate_hz}: {}", last.frequency_hz);
        assert!((last.amplitude_n - 6.0).abs() < 0.5, "{rate_hz}: {}", last.amplitude_n);
        assert_eq!(last.axis, Axis::Y);
        assert!(events.iter().all(|(_, v)| v.line == first.line), "one line: {events:?}");
    }
}

#[test]
fn noise_alone_raises_nothing() {
    for (seed, rate_hz) in (0..4).flat_map(|seed| [(seed, 2000.0), (seed, 248.0)]) {
        let mut rig = Rig::new(config(rate_hz), 3.0, seed);
        let events = rig.run(60.0, |_, _| 0.0);
        assert!(events.is_empty(), "{events:?}");
    }
}

#[test]
fn a_line_that_stops_is_over_and_reported_once() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 5);
    rig.run(3.0, tone_y(72.0, 5.0, 1.5));
    let events = rig.run(2.0, |_, _| 0.0);
    let over: Vec<_> = events.iter().filter(|(_, v)| v.state == State::Over).collect();
    assert_eq!(over.len(), 1);
    assert!((3.4..4.0).contains(&over[0].0), "{}", over[0].0);
    assert!(rig.watch.lines().is_empty());
}

#[test]
fn a_line_that_is_there_from_the_start_is_seen_too() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 6);
    let events = rig.run(3.0, tone_y(72.0, 4.0, 0.0));
    assert!(events.iter().any(|(_, v)| (v.frequency_hz - 72.0).abs() < 1.0), "{events:?}");
}

#[test]
fn a_second_of_air_is_enough_to_alarm_a_chatter_that_the_cut_brings_at_once() {
    for (frequency_hz, latest_s) in [(72.0, 1.45), (684.0, 1.3)] {
        let mut rig = Rig::new(config(10_000.0), 1.0, 8);
        let process = ProcessState { spindle_rpm: 5000.0, teeth: 4, ..ProcessState::default() };
        rig.watch.set_process_state(process);
        let events = rig.run(2.0, tone_y(frequency_hz, 20.0, 1.0));
        let alarm = events.iter().find(|(_, v)| v.state == State::Alarm).expect("an alarm");
        assert!((1.0..latest_s).contains(&alarm.0), "{frequency_hz} Hz: {}", alarm.0);
    }
}

#[test]
fn a_gap_restarts_the_windows_and_is_counted() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 7);
    rig.run(2.0, |_, _| 0.0);
    rig.lose_a_block();
    let events = rig.run(0.5, |_, _| 0.0);
    assert!(events.is_empty());
    let health = rig.watch.health();
    assert_eq!((health.gaps, health.lost_blocks), (1, 1));
    assert!(health.stream.contains(Fault::Gap));
    let events = rig.run(1.0, tone_y(72.0, 5.0, 2.6));
    assert!(!events.is_empty(), "the floor is kept over a gap, so the tone is seen at once");
}

#[test]
fn verdicts_do_not_depend_on_how_the_samples_are_cut() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let tone = tone_y(72.0, 5.0, 1.5);
    let samples: Vec<f64> = (0..25_000 * 3)
        .map(|k| rng.sample::<f64, _>(StandardNormal) + tone(k % 3, (k / 3) as f64 / 10_000.0))
        .collect();
    let run = |frames: usize| {
        let mut watch = VibrationMonitor::new(config(10_000.0)).expect("a good configuration");
        let mut events = Vec::new();
        for (seq, part) in samples.chunks(3 * frames).enumerate() {
            let t_ns = (seq * frames) as u64 * 100_000;
            let block = Block {
                seq: seq as u64,
                t_ns,
                rate_hz: 10_000.0,
                channels: 3,
                samples: part,
                ..Block::default()
            };
            events.extend(watch.push(&block).iter().copied());
        }
        events
    };
    let one = run(1);
    assert!(!one.is_empty());
    assert_eq!(one, run(250));
    assert_eq!(one, run(777));
}

#[test]
fn a_mode_that_rings_down_after_a_shock_warns_at_most() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 9);
    rig.run(3.0, |_, _| 0.0);
    for k in 0..8 {
        let (f, start_s) = (40.0 + 9.0 * f64::from(k), 3.2 + 3.0 * f64::from(k));
        let events = rig.run(3.0, move |channel, t| {
            let s = (t - start_s).max(0.0);
            30.0 / (channel + 1) as f64 * (-0.04 * TAU * f * s).exp() * (TAU * f * s).sin()
        });
        let alarmed =
            events.iter().any(|(_, v)| matches!(v.state, State::Alarm | State::Confirmed));
        assert!(!alarmed, "{f} Hz: {events:?}");
    }
}

#[test]
fn a_line_that_the_spindle_takes_along_has_its_new_frequency_at_once() {
    let mut rig = Rig::new(MonitorConfig { modes: vec![], ..config(10_000.0) }, 1.0, 10);
    let mut turned = 0.0;
    for (rpm, seconds) in [(11_280.0, 12.0), (11_760.0, 1.0)] {
        let hz = rpm / 60.0;
        let state = ProcessState { spindle_rpm: rpm, teeth: 2, ..ProcessState::default() };
        rig.watch.set_process_state(state);
        let from_s = turned;
        let events = rig.run(seconds, move |_, t| 8.0 * (TAU * hz * (t - from_s)).sin());
        turned += seconds;
        let lines: Vec<f64> = rig.watch.lines().iter().map(|v| v.frequency_hz).collect();
        let astray = |f: &&f64| (**f - hz).abs() > 1.0;
        assert!(
            !lines.is_empty() && lines.iter().find(astray).is_none(),
            "{lines:?}, {hz}: {events:?}"
        );
    }
}

#[test]
fn a_lower_threshold_finds_a_weaker_line() {
    let found = |threshold: f64| {
        let mut rig = Rig::new(MonitorConfig { threshold, ..config(1000.0) }, 1.0, 11);
        rig.run(4.0, |_, _| 0.0);
        let events = rig.run(0.6, tone_y(90.0, 0.55, 4.0));
        events.iter().any(|(_, v)| v.state != State::Over)
    };
    assert!(found(0.5) && !found(3.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn no_input_makes_it_panic(
        samples in proptest::collection::vec(prop_oneof![
            proptest::num::f64::ANY, -10.0..10.0_f64, Just(f64::NAN), Just(0.0)], 0..6000),
        rpm in proptest::num::f64::ANY,
        feed in proptest::num::f64::ANY,
    ) {
        let mut watch = VibrationMonitor::new(config(1000.0)).expect("a good configuration");
        watch.set_process_state(ProcessState { spindle_rpm: rpm, feed_mm_s: feed, ..ProcessState::default() });
        for (seq, part) in samples.chunks(300).enumerate() {
            let t_ns = seq as u64 * 100_000_000;
            let block = Block { seq: seq as u64, t_ns, rate_hz: 1000.0, channels: 3, samples: part, ..Block::default() };
            for verdict in &watch.push(&block) {
                prop_assert!(verdict.frequency_hz.is_finite() && verdict.amplitude_n.is_finite());
            }
        }
    }
}
