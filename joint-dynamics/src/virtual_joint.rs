//! A joint in the time domain, for tests: a delay line, lags and modes integrated by a Runge-Kutta
//! method. Independent of the inverse.

use joint_dynamics::plant::{Mode, Plant, Plants, UncertainValue};

/// Parameters of a joint with one lag and one mode.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VirtualJoint {
    pub(crate) delay_s: f64,
    pub(crate) lag_s: f64,
    pub(crate) frequency_hz: f64,
    pub(crate) damping_ratio: f64,
    pub(crate) participation: f64,
}

/// Sampling time of the tests' paths, s.
pub(crate) const STEP_S: f64 = 4e-3;

/// The joint of the tests: 30 ms of delay and lag, a mode of 8 Hz.
pub(crate) const JOINT: VirtualJoint = VirtualJoint {
    delay_s: 0.0177,
    lag_s: 0.0123,
    frequency_hz: 8.0,
    damping_ratio: 0.02,
    participation: 1.0,
};

/// Integration steps per sample.
const SUBSTEPS: usize = 8;

impl VirtualJoint {
    /// A model of it whose parameters have this relative standard uncertainty.
    pub(crate) fn plants(&self, sigma: f64) -> Plants {
        let number = |value: f64| UncertainValue { value, sigma: sigma * value };
        let mode = Mode {
            frequency_hz: number(self.frequency_hz),
            damping_ratio: number(self.damping_ratio),
            participation: UncertainValue { value: self.participation, sigma: 0.0 },
        };
        let plant = Plant {
            delays_s: vec![number(self.delay_s)],
            lags_s: vec![number(self.lag_s)],
            modes: vec![mode],
        };
        Plants { joints: vec![plant], left_out: Vec::new() }
    }

    /// The same with delay, lag and frequency times `factor`: the parameters of a wrong model.
    pub(crate) fn believed(self, factor: f64) -> Self {
        let Self { delay_s, lag_s, frequency_hz, .. } = self;
        let [delay_s, lag_s, frequency_hz] = [delay_s, lag_s, frequency_hz].map(|x| x * factor);
        Self { delay_s, lag_s, frequency_hz, ..self }
    }

    /// Position of its link for commands every `step_s`; it starts at rest.
    pub(crate) fn run(&self, step_s: f64, commanded: &[f64]) -> Vec<f64> {
        let mut state = [commanded[0], 0.0, 0.0];
        let h = step_s / SUBSTEPS as f64;
        let mut link = vec![commanded[0]];
        for k in 0..commanded.len() - 1 {
            for substep in 0..SUBSTEPS {
                let t = k as f64 * step_s + substep as f64 * h;
                let rate = |state: [f64; 3], t: f64| self.rate(state, t, step_s, commanded);
                let add =
                    |a: [f64; 3], b: [f64; 3], by: f64| std::array::from_fn(|i| a[i] + by * b[i]);
                let k1 = rate(state, t);
                let k2 = rate(add(state, k1, h / 2.0), t + h / 2.0);
                let k3 = rate(add(state, k2, h / 2.0), t + h / 2.0);
                let k4 = rate(add(state, k3, h), t + h);
                for i in 0..3 {
                    state[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
                }
            }
            let t = (k + 1) as f64 * step_s;
            link.push(self.link(state, t, step_s, commanded));
        }
        link
    }

    fn command(&self, t: f64, step_s: f64, commanded: &[f64]) -> f64 {
        let place = ((t - self.delay_s) / step_s).clamp(0.0, (commanded.len() - 1) as f64);
        let k = (place as usize).min(commanded.len() - 2);
        commanded[k] + (place - k as f64) * (commanded[k + 1] - commanded[k])
    }

    /// Motor, and the mode driven by the motor's position: `z'' + 2ζω z' + ω² z = γ q`, deflection `x = −z'' = ω² z + 2ζω z' − γ q`.
    fn rate(
        &self,
        [motor, z, speed]: [f64; 3],
        t: f64,
        step_s: f64,
        commanded: &[f64],
    ) -> [f64; 3] {
        let command = self.command(t, step_s, commanded);
        let (motor, motor_rate) =
            if self.lag_s > 0.0 { (motor, (command - motor) / self.lag_s) } else { (command, 0.0) };
        [motor_rate, speed, self.participation * (motor - commanded[0]) - self.restoring(z, speed)]
    }

    fn restoring(&self, z: f64, speed: f64) -> f64 {
        let omega = std::f64::consts::TAU * self.frequency_hz;
        omega * omega * z + 2.0 * self.damping_ratio * omega * speed
    }

    fn link(&self, [motor, z, speed]: [f64; 3], t: f64, step_s: f64, commanded: &[f64]) -> f64 {
        let motor = if self.lag_s > 0.0 { motor } else { self.command(t, step_s, commanded) };
        let deflection = self.restoring(z, speed) - self.participation * (motor - commanded[0]);
        motor + deflection
    }
}

/// Speeds change linearly over this time, s: 0.1 rad/s at 2 rad/s².
const BLEND_S: f64 = 0.05;

/// A path of constant speeds, rad/s, each with its duration, s, between rests of a second.
pub(crate) fn corners(step_s: f64, legs: &[(f64, f64)]) -> Vec<f64> {
    let mut path = vec![0.3; (1.0 / step_s) as usize];
    for (speed, time_s) in legs {
        for _ in 0..(time_s / step_s) as usize {
            path.push(path[path.len() - 1] + speed * step_s);
        }
    }
    let last = path[path.len() - 1];
    path.extend(vec![last; (1.0 / step_s) as usize]);
    let half = (BLEND_S / step_s / 2.0) as usize;
    let about = |k: usize| k.saturating_sub(half)..(k + half + 1).min(path.len());
    (0..path.len()).map(|k| path[about(k)].iter().sum::<f64>() / about(k).len() as f64).collect()
}

pub(crate) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| value.abs().max(largest))
}

pub(crate) fn differences(wanted: &[f64], reached: &[f64]) -> Vec<f64> {
    wanted.iter().zip(reached).map(|(w, r)| w - r).collect()
}
