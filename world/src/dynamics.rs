//! Dynamic effects: delay lines, servo lags, flexible modes, reversal spikes.
//!
//! Laws: docs/reference/effects.md (`time_delay`, `servo_lag`, `flexible_mode`, `reversal_spike`),
//! each solved exactly over the curve through the samples, so that there is no step size. They need
//! a whole path and a heap, which the real-time cycle does not have.
//!
//! They do not move an arm at rest; parameters of zero have no effect. Static effects are in
//! `physics`.

use crate::curve::{Cubic, Curve, value};
use glam::DVec3;
use libm::{cos, exp, sin, sqrt};
use physics::effects::OverPath;
use physics::{AnyEffect, Arm, BuildError, Joints, Model, ParameterValues};
use std::f64::consts::TAU;

/// Steps that differ by less than this count as equal: rounding of even time stamps.
const SAME_STEP: f64 = 1e-9;

/// The vibrating part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VibratingPart {
    /// A joint, 0-based.
    Joint(usize),
    /// The base about this axis, unit vector, base frame.
    Base(DVec3),
}

/// `flexible_mode`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// The vibrating part.
    pub part: VibratingPart,
    /// Undamped natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio, below 1.
    pub damping_ratio: f64,
    /// Ratio of the mode's excitation to the joint's acceleration; unused for the base.
    pub participation: f64,
    /// Deflection per load, rad/Nm or m/N.
    pub compliance: f64,
}

/// `reversal_spike`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spike {
    /// 0-based.
    pub joint: usize,
    /// Amplitude, rad or m.
    pub amplitude: f64,
    /// Time constant of the decay, s.
    pub time_constant_s: f64,
}

/// All dynamic effects of one robot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dynamics {
    /// Delay of all joints, s.
    pub delay_s: f64,
    /// Additional delay of joint positions measured on the link side, s.
    pub link_delay_s: f64,
    /// Delay of recorded torques relative to the motion, s.
    pub torque_delay_s: f64,
    /// First-order lags: 0-based joint, time constant, s. Two of one joint are in series.
    pub lags: Vec<(usize, f64)>,
    /// Vibration modes.
    pub modes: Vec<Mode>,
    /// Reversal spikes.
    pub spikes: Vec<Spike>,
}

impl Dynamics {
    /// Adds an effect by its name in files, with values in SI by stems, and 0-based `joint`;
    /// `channel` is the group of measurements of a delay. Returns whether it was added: other
    /// effects, and delays of a group that is neither position nor torque, are ignored.
    ///
    /// # Errors
    /// Values or a joint that the effect does not accept.
    pub fn add_named(
        &mut self,
        arm: &Arm,
        kind: &str,
        joint: Option<usize>,
        channel: Option<&str>,
        given: ParameterValues<'_>,
    ) -> Result<bool, BuildError> {
        let effect = match AnyEffect::build(kind, arm, joint, given) {
            Ok(AnyEffect::OverPath(effect)) => effect,
            Ok(_) | Err(BuildError::UnknownKind) => return Ok(false),
            Err(error) => return Err(error),
        };
        match channel.filter(|_| kind == "time_delay") {
            None => self.add(&effect),
            Some("ql") => self.link_delay_s += effect.values()[0],
            Some("tau") => self.torque_delay_s += effect.values()[0],
            Some(_) => return Ok(false),
        }
        Ok(true)
    }

    /// The dynamic effects of a model.
    #[must_use]
    pub fn from_model(model: &Model) -> Self {
        let mut dynamics = Self::default();
        for effect in model.effects() {
            if let AnyEffect::OverPath(effect) = effect {
                dynamics.add(effect);
            }
        }
        dynamics
    }

    /// Adds an effect.
    pub fn add(&mut self, effect: &OverPath) {
        let (kind, values) = (effect.spec().kind, effect.values());
        match (kind, effect.joint(), values) {
            ("time_delay", _, &[delay_s]) => self.delay_s += delay_s,
            ("torque_delay", _, &[delay_s]) => self.torque_delay_s += delay_s,
            ("servo_lag", Some(joint), &[lag_s]) => self.lags.push((joint, lag_s)),
            ("reversal_spike", Some(joint), &[amplitude, time_constant_s]) => {
                self.spikes.push(Spike { joint, amplitude, time_constant_s });
            }
            ("flexible_mode", joint, &[frequency_hz, damping_ratio, participation, compliance]) => {
                let of_base = effect.axis().map(VibratingPart::Base);
                let Some(part) = joint.map(VibratingPart::Joint).or(of_base) else { return };
                self.modes.push(Mode {
                    part,
                    frequency_hz,
                    damping_ratio,
                    participation,
                    compliance,
                });
            }
            _ => {}
        }
    }

    /// Positions of the motors for the commands `commanded` (samples of each joint) at `times_s`.
    pub(crate) fn motor_positions(
        &self,
        times_s: &[f64],
        commanded: Vec<Vec<f64>>,
    ) -> Vec<Vec<f64>> {
        let mut motors = commanded;
        for (joint, samples) in motors.iter_mut().enumerate() {
            *samples = delayed_samples(times_s, std::mem::take(samples), self.delay_s);
            for (_, lag_s) in self.lags.iter().filter(|(lagging, _)| *lagging == joint) {
                *samples = lagged(times_s, std::mem::take(samples), *lag_s);
            }
        }
        motors
    }
}

/// Samples delayed by `delay_s`.
pub(crate) fn delayed_samples(times_s: &[f64], samples: Vec<f64>, delay_s: f64) -> Vec<f64> {
    if delay_s == 0.0 {
        return samples;
    }
    let curve = Curve::through(times_s, samples);
    times_s.iter().map(|t| curve.at(t - delay_s)).collect()
}

/// `T ẏ + y = u`, exact for the curve through the samples of u; starts in steady state.
fn lagged(times_s: &[f64], samples: Vec<f64>, lag_s: f64) -> Vec<f64> {
    if lag_s == 0.0 || samples.is_empty() {
        return samples;
    }
    let curve = Curve::through(times_s, samples.clone());
    let mut y = samples[0] - lag_s * curve.slope(0);
    let mut lagged = vec![y];
    for (k, t) in times_s.windows(2).enumerate() {
        let [u0, u1, u2, u3] = curve.piece(k);
        let p2 = u2 - 3.0 * lag_s * u3;
        let p1 = u1 - 2.0 * lag_s * p2;
        let particular: Cubic = [u0 - lag_s * p1, p1, p2, u3];
        let s = t[1] - t[0];
        y = value(&particular, s) + (y - particular[0]) * exp(-s / lag_s);
        lagged.push(y);
    }
    lagged
}

impl Mode {
    /// Whether it has any effect: the base vibrates under loads only.
    pub(crate) fn has_effect(&self) -> bool {
        self.compliance > 0.0
            || self.participation != 0.0 && matches!(self.part, VibratingPart::Joint(_))
    }

    /// Its deflection at each sample, rad or m: `x'' + 2ζω x' + ω² x = −γ q'' + ω² C (load − its
    /// mean)`, `motor` the samples of the joint (empty for the base), `loads` those of the load
    /// (empty without compliance). It starts at rest under its load.
    pub(crate) fn deflection(&self, times_s: &[f64], motor: &[f64], loads: &[f64]) -> Vec<f64> {
        let omega = TAU * self.frequency_hz;
        let (square, decay) = (omega * omega, self.damping_ratio * omega);
        let ringing = sqrt(square - decay * decay);
        let mean = loads.iter().sum::<f64>() / loads.len().max(1) as f64;
        let push =
            |k: usize| loads.get(k).map_or(0.0, |load| square * self.compliance * (load - mean));
        let curve = Curve::through(times_s, motor.to_vec());
        // At the two ends of the interval after a sample.
        let accelerations = |k: usize, s: f64| {
            if motor.is_empty() {
                return (0.0, 0.0);
            }
            let [_, _, c2, c3] = curve.piece(k);
            (2.0 * c2, 2.0 * c2 + 6.0 * c3 * s)
        };
        let mut deflections = Vec::with_capacity(times_s.len());
        let (mut x, mut speed) = (0.0, 0.0);
        // For even samples, sine, cosine and decay of the last step are reused.
        let (mut last, mut turned) = (0.0, (1.0, 0.0, 1.0));
        for (k, t) in times_s.windows(2).enumerate() {
            let s = t[1] - t[0];
            let (from, to) = accelerations(k, s);
            let u0 = push(k) - self.participation * from;
            let u1 = (push(k + 1) - self.participation * to - u0) / s;
            if k == 0 {
                x = u0 / square;
                deflections.push(x);
            }
            // Steady-state response to a linear input, plus decaying vibration.
            let (p1, p0) = (u1 / square, (u0 - 2.0 * decay * u1 / square) / square);
            let (a, b) = (x - p0, (speed - p1 + decay * (x - p0)) / ringing);
            if f64::abs(s - last) > SAME_STEP * s {
                (last, turned) = (s, (cos(ringing * s), sin(ringing * s), exp(-decay * s)));
            }
            let (c, d, rest) = turned;
            x = p0 + p1 * s + rest * (a * c + b * d);
            speed = p1 + rest * ((ringing * b - decay * a) * c - (ringing * a + decay * b) * d);
            deflections.push(x);
        }
        deflections.resize(times_s.len(), 0.0);
        deflections
    }
}

impl Spike {
    /// `−A d e^(−Δt/T)` at each sample, Δt from the last sample before the new direction;
    /// `direction` is the sign of the motion before the first sample, 0 if unknown.
    pub(crate) fn deflection(&self, times_s: &[f64], motor: &[f64], direction: f64) -> Vec<f64> {
        let (mut d, mut turned_s, mut before) = (direction, None, None);
        let mut deflections = Vec::with_capacity(motor.len());
        for (t, q) in times_s.iter().zip(motor) {
            if let Some((t_before, q_before)) = before
                && q != q_before
            {
                let now = if q > q_before { 1.0 } else { -1.0 };
                if d != 0.0 && d != now {
                    turned_s = Some(t_before);
                }
                d = now;
            }
            before = Some((*t, q));
            let since =
                |turned: f64| -self.amplitude * d * exp(-(t - turned) / self.time_constant_s);
            deflections.push(turned_s.map_or(0.0, since));
        }
        deflections
    }
}

impl VibratingPart {
    /// Its excitation besides acceleration, for the loads of one sample.
    pub(crate) fn load(&self, loads: &physics::Loads) -> f64 {
        match *self {
            Self::Joint(joint) => loads.wrench_torque[joint],
            Self::Base(axis) => axis.dot(loads.base_moment + loads.inertia_base_moment),
        }
    }

    /// Adds its deflection to a deviation.
    pub(crate) fn add_deflection(&self, deviation: &mut physics::Deviation, by: f64) {
        match *self {
            Self::Joint(joint) => deviation.joints[joint] += by,
            Self::Base(axis) => deviation.base_turn += axis * by,
        }
    }

    /// The samples of the vibrating joint; empty for the base.
    pub(crate) fn motor<'a>(&self, motors: &'a [Vec<f64>]) -> &'a [f64] {
        match *self {
            Self::Joint(joint) => motors.get(joint).map_or(&[], Vec::as_slice),
            Self::Base(_) => &[],
        }
    }
}

/// The samples of all joints at row `k`.
pub(crate) fn at_row(samples: &[Vec<f64>], k: usize) -> Joints {
    let mut q = Joints::default();
    for (slot, samples) in q.iter_mut().zip(samples) {
        *slot = samples[k];
    }
    q
}

#[cfg(test)]
mod tests;
