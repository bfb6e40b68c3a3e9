//! The present model of the arm, and its free parameters.
//!
//! Every free parameter has a prior: the stated value with its uncertainty, or otherwise a width that no undamaged robot exceeds, which regularises
//! weakly determined parameters and does not affect well-determined ones.

use glam::DVec3;
use physics::spec::{Count, Parameter, Range, Role, Unit};
use physics::{AnyEffect, Model, ModelError};

/// Standard deviation of the prior of a joint's sag by its own body, rad: joints of industrial robots bend by up to a few mrad under the arm's weight.
const SAG_SIGMA_RAD: f64 = 3e-3;
/// Distance that a parameter with two bounds keeps from them, as a fraction of the interval.
const ASIDE: f64 = 5e-3;

/// A parameter of an effect that a fit may change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeParameter {
    /// Index into [`Model::effects`].
    pub effect: usize,
    /// Index into the parameters of the effect.
    pub value: usize,
    /// Mean of the prior, SI.
    pub mean: f64,
    /// Standard deviation of the prior, SI.
    pub sigma: f64,
    /// Origin of the prior.
    pub prior_source: PriorSource,
}

/// Origin of the prior of a free parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PriorSource {
    /// A wide default, [`plausible_size`]: the parameter is fitted only if the data determine it.
    WideDefault,
    /// A manufacturing tolerance: the parameter is always fitted, and the prior fixes gauge freedoms. It does not count as information.
    Tolerance,
    /// Stated with the model: the parameter is always fitted, and the prior counts as information.
    Stated,
}

/// A model with the set of its free parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// The arm and its effects; the present values are the initial values of a fit.
    pub model: Box<Model>,
    /// The free parameters, in the order of the columns of a fit.
    pub free: Vec<FreeParameter>,
}

/// A parameter of an effect by its key in files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterKey {
    /// The key with its unit and range.
    pub parameter: &'static Parameter,
    /// Index in the list of that key, 0-based.
    pub index: usize,
}

impl Hypothesis {
    /// A model without free parameters.
    #[must_use]
    pub fn fixed(model: Model) -> Self {
        Self { model: Box::new(model), free: Vec::new() }
    }

    /// Adds an effect with all parameters free except those of the stems `kept`; the priors are centred on the present values.
    ///
    /// # Errors
    /// More effects than a model has room for.
    pub fn add(&mut self, effect: AnyEffect, kept: &[&str]) -> Result<(), ModelError> {
        let index = self.model.effects().len();
        self.model.push(effect)?;
        self.free_all(index, kept, &[]);
        Ok(())
    }

    /// Frees all parameters of the effect at `index` except those of the stems `kept`. Positive entries of `sigma` (in the order of the effect's
    /// parameters, SI) are the standard deviations of the priors; the others use [`plausible_size`].
    pub fn free_all(&mut self, index: usize, kept: &[&str], sigma: &[f64]) {
        let Some(effect) = self.model.effects().nth(index).copied() else { return };
        for (value, mean) in effect.values().iter().enumerate() {
            let named = parameter_key(&effect, value);
            let stated = sigma.get(value).copied().filter(|sigma| *sigma > 0.0);
            if named.is_some_and(|named| !kept.contains(&named.parameter.stem)) {
                let sigma = stated.unwrap_or_else(|| plausible_size(&effect, value));
                let prior_source =
                    if stated.is_some() { PriorSource::Stated } else { PriorSource::WideDefault };
                self.free.push(FreeParameter {
                    effect: index,
                    value,
                    mean: *mean,
                    sigma,
                    prior_source,
                });
            }
        }
    }

    /// Replaces the priors of the effect at `index` by wide ones and returns the former priors.
    pub fn widen_priors(&mut self, index: usize) -> Vec<FreeParameter> {
        let (stated, kept) = self.free.iter().partition(|free| free.effect == index);
        self.free = kept;
        self.free_all(index, &[], &[]);
        stated
    }

    /// Undoes [`Hypothesis::widen_priors`]: parameters and priors of the effect at `index` are those of `given` and `stated` again.
    pub fn restore_priors(&mut self, index: usize, given: &Model, stated: &[FreeParameter]) {
        self.free.retain(|free| free.effect != index);
        self.free.extend_from_slice(stated);
        let values = given.effects().nth(index).map(AnyEffect::values);
        if let Some(values) = values {
            self.model.change(index, |effect| effect.values_mut().copy_from_slice(values));
        }
    }

    /// Fixes the parameters with stated priors of the effects selected by `wanted` at their prior means.
    pub fn fix_at_stated_means(&mut self, wanted: impl Fn(&AnyEffect) -> bool) {
        let Self { model, free } = self;
        free.retain(|free| {
            let held = model.change(free.effect, |effect| {
                let held = free.prior_source == PriorSource::Stated && wanted(effect);
                if held {
                    effect.values_mut()[free.value] = free.mean;
                }
                held
            });
            !held.unwrap_or(true)
        });
    }

    /// The same hypothesis without the effect at `index`.
    #[must_use]
    pub fn without(&self, index: usize) -> Self {
        let mut less = Self::fixed(Model::nominal(self.model.arm));
        for (other, effect) in self.model.effects().enumerate() {
            if other != index {
                // Cannot fail: the effect was in the model before.
                less.model.push(*effect).unwrap_or_default();
            }
        }
        let others = self.free.iter().filter(|free| free.effect != index);
        less.free = others
            .map(|free| FreeParameter {
                effect: free.effect - usize::from(free.effect > index),
                ..*free
            })
            .collect();
        less
    }

    /// The effect that a free parameter belongs to.
    #[must_use]
    pub fn effect_of(&self, free: &FreeParameter) -> Option<&AnyEffect> {
        self.model.effects().nth(free.effect)
    }

    /// Whether a parameter is nonlinear, except the phase of a wave.
    #[must_use]
    pub fn is_nonlinear(&self, free: &FreeParameter) -> bool {
        let named = self.effect_of(free).and_then(|effect| parameter_key(effect, free.value));
        named.is_some_and(|named| {
            named.parameter.role == Role::Nonlinear && named.parameter.unit != Unit::PhaseRadian
        })
    }

    /// Present values of the free parameters, SI.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        let effects: Vec<&AnyEffect> = self.model.effects().collect();
        self.free.iter().map(|free| effects[free.effect].values()[free.value]).collect()
    }

    /// The free parameters after a step. No parameter goes below the bound given by [`Hypothesis::step_lower_bounds`]; amplitude and phase of a wave move along
    /// the straight line of their sine and cosine components.
    #[must_use]
    pub fn stepped(&self, step: &[f64]) -> Self {
        let mut next = self.clone();
        for ((free, by), lower) in self.free.iter().zip(step).zip(self.step_lower_bounds()) {
            next.model.change(free.effect, |effect| {
                effect.values_mut()[free.value] +=
                    by.max(lower).min(step_upper_bound(effect, free.value));
            });
        }
        let values = self.values();
        for (amplitude, phase) in self.waves() {
            let (along, across) =
                (values[amplitude] + step[amplitude], values[amplitude] * step[phase]);
            next.model.change(self.free[phase].effect, |effect| {
                // Of the two equivalent forms of the wave, the one closer to the present values: an amplitude may be negative.
                let sign = 1.0_f64.copysign(along);
                let turn = libm::atan2(sign * across, sign * along);
                effect.values_mut()[self.free[amplitude].value] = sign * along.hypot(across);
                effect.values_mut()[self.free[phase].value] = values[phase] + turn;
            });
        }
        next
    }

    /// Lower bound on the step of each free parameter: a parameter that must stay positive moves at most nine tenths of the way to zero, a
    /// non-negative one at most to zero, one with two bounds to slightly inside them.
    #[must_use]
    pub fn step_lower_bounds(&self) -> Vec<f64> {
        let values = self.values();
        let lower_bound = |(free, value): (&FreeParameter, f64)| {
            let named = self.effect_of(free).and_then(|effect| parameter_key(effect, free.value));
            match named.map(|named| named.parameter.range) {
                Some(Range::Positive) => -0.9 * value,
                Some(Range::NotNegative) => -value,
                Some(Range::Between(low, high)) => low + ASIDE * (high - low) - value,
                _ => f64::NEG_INFINITY,
            }
        };
        self.free.iter().zip(values).map(lower_bound).collect()
    }

    /// Largest plausible change of each free parameter: the unit in which a column counts as determined or not. For a phase it is scaled by the
    /// present amplitude relative to the largest plausible one, so that a wave whose amplitude is momentarily near zero keeps both parameters.
    pub(crate) fn plausible_sizes(&self) -> Vec<f64> {
        // A narrow stated prior must not make a direction count as undetermined.
        let wide = |free: &FreeParameter| {
            self.effect_of(free).map_or(0.0, |e| plausible_size(e, free.value))
        };
        let width_of = |free: &FreeParameter| match free.prior_source {
            PriorSource::Stated => free.sigma.max(wide(free)),
            PriorSource::WideDefault | PriorSource::Tolerance => free.sigma,
        };
        let mut widths: Vec<f64> = self.free.iter().map(width_of).collect();
        let values = self.values();
        for (amplitude, phase) in self.waves() {
            let ratio = widths[amplitude] / values[amplitude].abs();
            widths[phase] =
                if ratio.is_finite() { widths[phase].max(ratio) } else { widths[phase] };
        }
        widths
    }

    /// Amplitude and phase of each wave of which both are free, as indices of free parameters.
    fn waves(&self) -> Vec<(usize, usize)> {
        let entry = |free: &FreeParameter| parameter_key(self.effect_of(free)?, free.value);
        let is = |free: &FreeParameter, stem: &str| {
            entry(free).filter(|named| named.parameter.stem == stem)
        };
        let mut waves = Vec::new();
        for (phase, of_phase) in self.free.iter().enumerate() {
            let Some(named) = is(of_phase, "phase") else { continue };
            let same = |free: &FreeParameter| {
                let other = is(free, "amplitude");
                free.effect == of_phase.effect && other.is_some_and(|o| o.index == named.index)
            };
            waves.extend(self.free.iter().position(same).map(|amplitude| (amplitude, phase)));
        }
        waves
    }

    /// Name of a free parameter for users, see [`describe`].
    #[must_use]
    pub fn describe(&self, free: &FreeParameter) -> String {
        let Some(effect) = self.effect_of(free) else { return String::new() };
        describe(effect, free.value)
    }
}

/// Upper bound on the step of a parameter: slightly inside its upper bound.
fn step_upper_bound(effect: &AnyEffect, value: usize) -> f64 {
    match parameter_key(effect, value).map(|named| named.parameter.range) {
        Some(Range::Between(low, high)) => high - ASIDE * (high - low) - effect.values()[value],
        _ => f64::INFINITY,
    }
}

/// The key of files that a parameter of an effect belongs to.
#[must_use]
pub fn parameter_key(effect: &AnyEffect, value: usize) -> Option<ParameterKey> {
    let mut first = 0;
    for parameter in effect.fitted() {
        let count = match parameter.count {
            Count::One => 1,
            Count::Exactly(count) => count,
            Count::UpTo(_) | Count::ThreePerCarriedBody => effect.values().len() - first,
        };
        if value < first + count {
            return Some(ParameterKey { parameter, index: value - first });
        }
        first += count;
    }
    None
}

/// Name of a parameter of an effect for users: `joint 3's tilt 2 (axis_tilt)`.
#[must_use]
pub fn describe(effect: &AnyEffect, value: usize) -> String {
    let kind = effect.spec().kind;
    let Some(ParameterKey { parameter, index }) = parameter_key(effect, value) else {
        return kind.to_owned();
    };
    let whose = effect.joint().map_or("the robot's".to_owned(), |j| format!("joint {}'s", j + 1));
    let which = match parameter.count {
        Count::One => parameter.stem.to_owned(),
        Count::ThreePerCarriedBody => {
            let body = effect.joint().unwrap_or(0) + index / 3 + 1;
            format!("{} {} of body {body}", parameter.stem, ["x", "y", "z"][index % 3])
        }
        _ => format!("{} {}", parameter.stem, index + 1),
    };
    format!("{whose} {which} ({kind})")
}

/// Largest plausible value of a parameter of an undamaged robot, SI: the width of the prior if none is stated.
#[must_use]
pub fn plausible_size(effect: &AnyEffect, value: usize) -> f64 {
    let Some(ParameterKey { parameter, .. }) = parameter_key(effect, value) else { return 1.0 };
    let size = effect.values()[value].abs();
    match (effect.spec().kind, parameter.unit) {
        ("joint_offset", _) => 0.02,
        ("axis_tilt", Unit::TurnMilliradian) => 5e-3,
        ("tool_offset" | "gravity_tilt", Unit::TurnMilliradian) => 0.02,
        // Each body farther out is lighter than the one that carries it.
        ("gravity_sag", _) => SAG_SIGMA_RAD * 0.5_f64.powi((value / 3) as i32),
        ("joint_polynomial", _) => 5e-3,
        ("axis_wobble", Unit::TurnMilliradian) => 5e-4,
        ("joint_ratio" | "joint_coupling", _) => 3e-3,
        ("wrench_misalignment", _) => 0.2,
        (_, Unit::Milliradian | Unit::TurnMilliradian) => 1e-3,
        ("wrench_bias", _) => 30.0,
        ("wrench_scale", _) => 1.0,
        ("flexible_mode", Unit::One) if parameter.stem == "participation" => 3.0,
        ("flexible_mode", Unit::One) => 0.2,
        (_, Unit::One) => 5e-4,
        (_, Unit::PhaseRadian) => 6.0,
        ("axis_shift", _) => 5e-3,
        (_, Unit::Hertz) => 0.5 * size.max(1.0),
        (_, Unit::Millisecond) => 0.02_f64.max(size),
        ("payload", Unit::Millimetre) => 0.3,
        ("counterbalance", Unit::Millimetre) => 0.5 * size.max(0.1),
        (_, Unit::NewtonPerMetre) => 3.0 * size.max(1e5),
        (_, Unit::Millimetre) => 0.02,
        (_, Unit::Micrometre) => 1e-3,
        (_, Unit::Compliance) => 2e-3,
        (_, Unit::TurnCompliance) => 2e-3,
        (_, Unit::CubicCompliance) => 1e-5,
        (_, Unit::MicrometrePerNewton) => 1e-5,
        (_, Unit::MicrometrePerKelvin) => 1e-4,
        (_, Unit::MilliradianPerKelvin) => 1e-4,
        (_, Unit::CyclesPerRevolution) => 0.05 * size.max(1.0),
        (_, Unit::Second) => 3.0 * size.max(1.0),
        (_, Unit::NewtonMetre | Unit::Moment | Unit::Newton) => 3.0 * size.max(10.0),
        (_, Unit::Kilogram) => 20.0,
        _ => size.max(1.0),
    }
}

/// The shift without its component along the axis, which is not a parameter of `axis_shift` and may remain from rounding.
#[must_use]
pub fn without_axial_part(axis: DVec3, shift: DVec3) -> DVec3 {
    shift - axis * axis.dot(shift)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_campaigns::nominal_robot;
    use physics::ParameterValues;
    use proptest::prelude::*;

    /// One transmission error of joint 1 with amplitude and phase free.
    fn wave(amplitude: f64, phase: f64) -> Hypothesis {
        let mut hypothesis = Hypothesis::fixed(nominal_robot());
        let arm = hypothesis.model.arm;
        let given: &[(&str, &[f64])] =
            &[("amplitude", &[amplitude]), ("cycles", &[9.9]), ("phase", &[phase])];
        let effect = AnyEffect::build("transmission_error", &arm, Some(0), ParameterValues(given));
        hypothesis.add(effect.expect("sound"), &["cycles"]).expect("room");
        hypothesis
    }

    proptest! {
        #[test]
        fn a_step_of_a_wave_is_straight_in_its_sine_and_cosine(
            amplitude in 1e-6..1e-3_f64, phase in -3.0..3.0_f64, along in -2e-3..2e-3_f64, turn in -4.0..4.0_f64,
        ) {
            let before = wave(amplitude, phase);
            let after = before.stepped(&[along, turn]).values();
            let (sin, cos) = phase.sin_cos();
            let sine = (amplitude + along) * cos - amplitude * turn * sin;
            let cosine = (amplitude + along) * sin + amplitude * turn * cos;
            prop_assert!((after[0] * after[1].cos() - sine).abs() < 1e-15);
            prop_assert!((after[0] * after[1].sin() - cosine).abs() < 1e-15);
        }
    }

    #[test]
    fn a_wave_that_stands_near_nothing_keeps_its_phase_among_what_can_be_told() {
        let strong = wave(5e-4, 0.0).plausible_sizes()[1];
        let weak = wave(1e-9, 0.0).plausible_sizes()[1];
        assert!((strong - 6.0).abs() < 1e-12 && weak * 1e-9 > 0.5e-3, "{strong}, {weak}");
        assert!(wave(0.0, 0.0).plausible_sizes()[1].is_finite());
    }

    #[test]
    fn what_must_stay_above_zero_stays_there_and_what_may_be_zero_ends_there() {
        let mut hypothesis = Hypothesis::fixed(nominal_robot());
        let arm = hypothesis.model.arm;
        let given: &[(&str, &[f64])] = &[("width", &[1e-4]), ("torque", &[20.0])];
        let effect = AnyEffect::build("lost_motion", &arm, Some(1), ParameterValues(given));
        hypothesis.add(effect.expect("sound"), &[]).expect("room");
        let after = hypothesis.stepped(&[-1.0, -100.0]).values();
        assert!(after[0].abs() < 1e-18 && (after[1] - 2.0).abs() < 1e-12, "{after:?}");
    }
}
