//! A joint as a linear plant: response of its motor to the command, and of its link to the motor.
//!
//! `G(s) = e^(−D s) Π 1/(1 + T s) · (1 − Σ γ s² / (s² + 2 ζ ω s + ω²))`: delay D, first-order lags T, modes of natural frequency ω, damping ratio ζ,
//! participation γ. Laws: effects `time_delay`, `servo_lag`, `flexible_mode` (docs/reference/effects.md), written as frequency response.
//!
//! Linear about any pose: variation of parameters over the workspace counts as uncertainty. Modes of the base and excitation by wrenches are not included.

use physics::Arm;
use realfft::num_complex::Complex64;
use recording::model::{EffectEntry, RobotModel};
use std::f64::consts::TAU;

/// A value with its standard uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UncertainValue {
    /// SI.
    pub value: f64,
    /// SI.
    pub sigma: f64,
}

/// A flexible mode of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// Undamped natural frequency, Hz.
    pub frequency_hz: UncertainValue,
    /// Share of critical damping.
    pub damping_ratio: UncertainValue,
    /// Ratio of the mode's excitation to the motor's acceleration.
    pub participation: UncertainValue,
}

/// One joint.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plant {
    /// Delays, s; they add up.
    pub delays_s: Vec<UncertainValue>,
    /// Time constants of first-order lags in series, s.
    pub lags_s: Vec<UncertainValue>,
    /// Modes; their deflections add up.
    pub modes: Vec<Mode>,
}

/// All joints of an arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Plants {
    /// One per joint.
    pub joints: Vec<Plant>,
    /// Dynamic effects that move the tool and are not compensated, by name.
    pub left_out: Vec<String>,
}

impl Plants {
    /// From a model; `unstated`: relative standard uncertainty of parameters without a stated one.
    #[must_use]
    pub fn of(model: &RobotModel, unstated: f64) -> Self {
        let arm = &model.physics.arm;
        let mut plants = Self { joints: vec![Plant::default(); arm.count()], left_out: Vec::new() };
        let entries =
            model.not_compensated.iter().filter_map(|index| model.file.effects.get(*index));
        entries.for_each(|entry| plants.add(arm, entry, unstated));
        plants
    }

    /// Whether this is an effect that plants contain.
    #[must_use]
    pub fn is_supported(entry: &EffectEntry) -> bool {
        match entry.kind.as_str() {
            "time_delay" => entry.channel.is_none(),
            "servo_lag" | "flexible_mode" => entry.joint.is_some(),
            _ => false,
        }
    }

    /// Effects of a model that are not compensated, by name; `leads`: whether delay, lags and modes are.
    #[must_use]
    pub fn not_compensated(model: &RobotModel, leads: bool) -> Vec<String> {
        let entries =
            model.not_compensated.iter().filter_map(|index| model.file.effects.get(*index));
        entries
            .filter(|entry| !(leads && Self::is_supported(entry)))
            .map(EffectEntry::title)
            .collect()
    }

    /// Whether no joint has anything to compensate.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.joints.iter().all(Plant::is_identity)
    }

    /// The joints with parameters that deviate together by this many standard uncertainties: motors and
    /// modes to the same side, and to opposite ones.
    #[must_use]
    pub fn perturbed_together(&self, sigmas: f64) -> [Self; 4] {
        [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)].map(|(motors, modes)| {
            let shift = |number: &mut UncertainValue, sign: f64| {
                let least = 0.1 * number.value;
                number.value = (number.value + sign * sigmas * number.sigma).max(least);
            };
            let mut plants = self.clone();
            for plant in &mut plants.joints {
                let of_motor = plant.delays_s.iter_mut().chain(&mut plant.lags_s);
                of_motor.for_each(|number| shift(number, motors));
                for mode in &mut plant.modes {
                    shift(&mut mode.frequency_hz, modes);
                    shift(&mut mode.damping_ratio, modes);
                }
            }
            plants
        })
    }

    fn add(&mut self, arm: &Arm, entry: &EffectEntry, unstated: f64) {
        let number = |stem: &str| parameter(arm, entry, stem, unstated);
        let joint = entry.joint.and_then(|joint| self.joints.get_mut(joint.wrapping_sub(1)));
        match (entry.kind.as_str(), joint) {
            ("time_delay", _) if entry.channel.is_none() => {
                let delay = number("delay");
                self.joints.iter_mut().for_each(|plant| plant.delays_s.extend(delay));
            }
            ("servo_lag", Some(plant)) => plant.lags_s.extend(number("time_constant")),
            ("flexible_mode", Some(plant)) => {
                let whole = UncertainValue { value: 1.0, sigma: 0.0 };
                plant.modes.extend(number("frequency").zip(number("damping_ratio")).map(
                    |(frequency_hz, damping_ratio)| Mode {
                        frequency_hz,
                        damping_ratio,
                        participation: number("participation").unwrap_or(whole),
                    },
                ));
                if number("dynamic_compliance").is_some_and(|compliance| compliance.value > 0.0) {
                    self.left_out.push(format!("{} under wrenches", entry.title()));
                }
            }
            ("flexible_mode", None) => self.left_out.push("flexible_mode of the base".to_owned()),
            ("reversal_spike", _) => self.left_out.push(entry.title()),
            _ => {}
        }
    }
}

/// A parameter of an effect in SI; `None` if it is not given.
fn parameter(arm: &Arm, entry: &EffectEntry, stem: &str, unstated: f64) -> Option<UncertainValue> {
    let si = |entry: &EffectEntry| {
        let numbers = entry.to_si(arm)?;
        numbers.into_iter().find(|(found, _)| *found == stem)?.1.first().copied()
    };
    let value = si(entry)?;
    // The uncertainties in place of the values, in the same units.
    let mut uncertainties = entry.clone();
    for parameter in &mut uncertainties.parameters {
        let share = parameter.value.map(|value| value.abs() * unstated);
        parameter.value = parameter.sigma.take().unwrap_or(share);
    }
    Some(UncertainValue { value, sigma: si(&uncertainties)? })
}

impl Plant {
    /// Whether the joint follows its command exactly.
    #[must_use]
    pub fn is_identity(&self) -> bool {
        self.delays_s.is_empty() && self.lags_s.is_empty() && self.modes.is_empty()
    }

    /// The same joint as measured by its motor's encoder.
    #[must_use]
    pub fn of_motor(&self) -> Self {
        Self { modes: Vec::new(), ..self.clone() }
    }

    /// Frequency response from the command to the link, at a frequency in Hz.
    #[must_use]
    pub fn response(&self, hz: f64) -> Complex64 {
        self.motor_response(hz) * self.link_response(hz)
    }

    /// From the command to the motor.
    pub fn motor_response(&self, hz: f64) -> Complex64 {
        let omega = TAU * hz;
        let delay_s: f64 = self.delays_s.iter().map(|delay| delay.value).sum();
        let delayed = Complex64::cis(-omega * delay_s);
        self.lags_s.iter().fold(delayed, |g, lag| g / Complex64::new(1.0, omega * lag.value))
    }

    /// From the motor to the link.
    pub fn link_response(&self, hz: f64) -> Complex64 {
        let one = Complex64::new(1.0, 0.0);
        self.modes.iter().fold(one, |g, mode| {
            let natural = mode.frequency_hz.value;
            let denominator = Complex64::new(
                natural * natural - hz * hz,
                2.0 * mode.damping_ratio.value * natural * hz,
            );
            g + mode.participation.value * hz * hz / denominator
        })
    }

    /// Its delay without lags, s.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        self.delays_s.iter().map(|delay| delay.value).sum()
    }

    /// Duration of its response without modes, s: delay, five time constants of its lags.
    pub fn response_time_s(&self) -> f64 {
        let sum = |numbers: &[UncertainValue]| numbers.iter().map(|n| n.value.abs()).sum::<f64>();
        sum(&self.delays_s) + 5.0 * sum(&self.lags_s)
    }

    /// Decay time of its slowest mode, s: to a hundredth.
    pub fn decay_time_s(&self) -> f64 {
        let decay = |mode: &Mode| TAU * mode.frequency_hz.value * mode.damping_ratio.value;
        self.modes.iter().map(|mode| 4.6 / decay(mode).max(0.5)).fold(0.0, f64::max)
    }

    /// The plant with each parameter in turn shifted by its standard uncertainty, up and down.
    pub fn perturbed_by_sigma(&self) -> Vec<Self> {
        let count = self.clone().parameters_mut().len();
        let shifted = |index: usize, sign: f64| {
            let mut plant = self.clone();
            if let Some(number) = plant.parameters_mut().into_iter().nth(index) {
                number.value += sign * number.sigma;
            }
            plant
        };
        (0..count).flat_map(|index| [shifted(index, -1.0), shifted(index, 1.0)]).collect()
    }

    /// All its parameters.
    pub fn parameters_mut(&mut self) -> Vec<&mut UncertainValue> {
        let of_modes = self.modes.iter_mut().flat_map(|mode| {
            [&mut mode.frequency_hz, &mut mode.damping_ratio, &mut mode.participation]
        });
        self.delays_s.iter_mut().chain(&mut self.lags_s).chain(of_modes).collect()
    }

    /// Motors with deviations of delay and lags up to `share`, each kind by itself.
    pub fn perturbed_motors(&self, share: f64) -> Vec<Self> {
        let scaled = |delay: f64, lag: f64| {
            let mut plant = self.of_motor();
            plant.delays_s.iter_mut().for_each(|number| number.value *= 1.0 + delay);
            plant.lags_s.iter_mut().for_each(|number| number.value *= 1.0 + lag);
            plant
        };
        let shares = [-share, 0.0, share];
        shares.iter().flat_map(|delay| shares.map(|lag| scaled(*delay, lag))).collect()
    }

    /// Links with deviations of the modes up to `share`: frequencies together, in steps that
    /// resolve a peak of 2 % damping; damping at both ends; participation by three standard
    /// uncertainties, at most by `share`.
    pub fn perturbed_links(&self, share: f64) -> Vec<Self> {
        if self.modes.is_empty() {
            return vec![Self::default()];
        }
        let scaled = |frequency: f64, damping: f64, sign: f64| {
            let mut plant = Self { modes: self.modes.clone(), ..Self::default() };
            for mode in &mut plant.modes {
                mode.frequency_hz.value *= 1.0 + frequency;
                mode.damping_ratio.value *= 1.0 + damping;
                let UncertainValue { value, sigma } = mode.participation;
                mode.participation.value += sign * (3.0 * sigma).min(share * value.abs());
            }
            plant
        };
        let steps = (share / 0.02).ceil() as i32;
        let frequencies = (-steps..=steps).map(|k| share * f64::from(k) / f64::from(steps.max(1)));
        let ends = [-share, share];
        frequencies
            .flat_map(|f| ends.map(|d| [-1.0, 1.0].map(|sign| scaled(f, d, sign))))
            .flatten()
            .collect()
    }
}
