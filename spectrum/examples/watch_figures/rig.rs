//! A simulated force sensor with noise, connected to a monitor.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use spectrum::{Block, ConfigError, Mode, MonitorConfig, ProcessState, Verdict, VibrationMonitor};

pub(crate) const CHANNELS: usize = 3;

/// How a channel's noise is coloured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Colour {
    /// Flat.
    White,
    /// First-order low pass with this corner, Hz.
    Red(f64),
    /// Flat, plus noise through a resonance: frequency, Hz, and damping ratio.
    Resonant(f64, f64),
}

pub(crate) struct Rig {
    pub(crate) watch: VibrationMonitor,
    pub(crate) rng: ChaCha8Rng,
    rate_hz: f64,
    sigma: f64,
    colour: Colour,
    memory: [[f64; 2]; CHANNELS],
    frame: u64,
    seq: u64,
    samples: Vec<f64>,
}

impl Rig {
    /// Noise of rms `sigma` (N, within 0 to 500 Hz) on each of three channels.
    pub(crate) fn new(
        rate_hz: f64,
        sigma: f64,
        colour: Colour,
        seed: u64,
    ) -> Result<Self, ConfigError> {
        Self::with_threshold(rate_hz, sigma, colour, seed, 1.0)
    }

    /// The same with another threshold of the watch.
    pub(crate) fn with_threshold(
        rate_hz: f64,
        sigma: f64,
        colour: Colour,
        seed: u64,
        threshold: f64,
    ) -> Result<Self, ConfigError> {
        let modes = [20.0, 35.0, 60.0, 67.0, 70.0, 72.0].map(Mode::at_hz).to_vec();
        let config = MonitorConfig {
            rate_hz,
            channels: CHANNELS,
            modes,
            threshold,
            ..MonitorConfig::default()
        };
        Ok(Self {
            watch: VibrationMonitor::new(config)?,
            rng: ChaCha8Rng::seed_from_u64(seed),
            rate_hz,
            sigma: sigma * (rate_hz / 1000.0).sqrt(),
            colour,
            memory: [[0.0; 2]; CHANNELS],
            frame: 0,
            seq: 0,
            samples: Vec::new(),
        })
    }

    pub(crate) fn spindle(&mut self, rpm: f64) {
        let state = ProcessState { spindle_rpm: rpm, teeth: 2, ..ProcessState::default() };
        self.watch.set_process_state(state);
    }

    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.rng.random::<f64>()
    }

    pub(crate) fn now_s(&self) -> f64 {
        self.frame as f64 / self.rate_hz
    }

    fn noise(&mut self, channel: usize) -> f64 {
        let white: f64 = self.rng.sample(StandardNormal);
        let memory = &mut self.memory[channel];
        match self.colour {
            Colour::White => self.sigma * white,
            Colour::Red(corner_hz) => {
                let keep = (-std::f64::consts::TAU * corner_hz / self.rate_hz).exp();
                memory[0] = keep * memory[0] + (1.0 - keep * keep).sqrt() * white;
                self.sigma * memory[0]
            }
            Colour::Resonant(f_hz, damping) => {
                let w = std::f64::consts::TAU * f_hz / self.rate_hz;
                let r = (-damping * w).exp();
                let next = 2.0 * r * w.cos() * memory[0] - r * r * memory[1] + white;
                *memory = [next, memory[0]];
                let gain = (1.0 - r) * 2.0 * w.sin();
                self.sigma * (white + 10.0 * gain * next)
            }
        }
    }

    /// Runs for some seconds; `signal(channel, t_s)` is added, t from the start of this run. Passes
    /// every verdict on, with its time since the start of this run.
    pub(crate) fn run(
        &mut self,
        seconds: f64,
        signal: impl Fn(usize, f64) -> f64,
        mut on_verdict: impl FnMut(f64, &Verdict),
    ) {
        let per_block = (0.002 * self.rate_hz).max(1.0) as u64;
        let start = self.frame;
        let end = start + (seconds * self.rate_hz) as u64;
        while self.frame < end {
            self.samples.clear();
            for i in 0..per_block {
                let t_s = (self.frame - start + i) as f64 / self.rate_hz;
                for channel in 0..CHANNELS {
                    let sample = self.noise(channel) + signal(channel, t_s);
                    self.samples.push(sample);
                }
            }
            let t_ns = (self.now_s() * 1e9) as u64;
            let (rate_hz, samples) = (self.rate_hz, &self.samples);
            let block = Block {
                seq: self.seq,
                t_ns,
                rate_hz,
                channels: CHANNELS,
                samples,
                ..Block::default()
            };
            let verdicts = self.watch.push(&block);
            self.seq += 1;
            self.frame += per_block;
            let now_s = (self.frame - start) as f64 / self.rate_hz;
            for verdict in &verdicts {
                on_verdict(now_s, verdict);
            }
        }
    }
}

/// The `q` quantile of the sorted values; infinite for those never reached.
pub(crate) fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((q * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
}

/// A number as JSON: null if it was not reached.
pub(crate) fn json(value: f64) -> String {
    if value.is_finite() { format!("{value:.2}") } else { "null".into() }
}
