//! The present model of the arm, and its free parameters.
//!
//! Promises: a free parameter has a prior: the stated value with its uncertainty, or otherwise a width that no undamaged robot exceeds, which
//! regularises weakly determined parameters and does not affect well-determined ones.
//! Never: data.

use glam::DVec3;
use physics::spec::{Count, Parameter, Range, Role, Unit};
use physics::{AnyEffect, Model, ModelError};

/// How far from its bounds a number between two stays, as a share of the width.
const ASIDE: f64 = 5e-3;

/// A number of an effect that a fit may change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Free {
    /// Place in [`Model::effects`].
    pub effect: usize,
    /// Place in the effect's values.
    pub value: usize,
    /// What is believed before the data, SI.
    pub mean: f64,
    /// The standard uncertainty of that belief, SI.
    pub sigma: f64,
    /// Where that uncertainty comes from.
    pub belief: Belief,
}

/// Where the prior of a free number comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Belief {
    /// A wide guard, [`much`]: a number that the data do not determine is not fitted.
    Guard,
    /// A maker's tolerance: the number is always fitted, and the prior decides what a gauge freedom leaves open. It counts as no information.
    Tolerance,
    /// Stated with the model: the number is always fitted, and the prior counts as information.
    Stated,
}

/// A model with the numbers of it that are free.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// The arm and its effects; free numbers start from where they stand here.
    pub model: Box<Model>,
    /// The free numbers, in the order in which they stand in a fit.
    pub free: Vec<Free>,
}

/// A value of an effect by its entry in files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Named {
    /// The entry.
    pub parameter: &'static Parameter,
    /// Place in the entry's list, from 0.
    pub index: usize,
}

impl Hypothesis {
    /// A model of which nothing is free.
    #[must_use]
    pub fn fixed(model: Model) -> Self {
        Self { model: Box::new(model), free: Vec::new() }
    }

    /// Adds an effect of which all values but those of `kept` (stems) are free about where they stand.
    ///
    /// # Errors
    /// More effects than a model has room for.
    pub fn add(&mut self, effect: AnyEffect, kept: &[&str]) -> Result<(), ModelError> {
        let index = self.model.effects().len();
        self.model.push(effect)?;
        self.free_all(index, kept, &[]);
        Ok(())
    }

    /// Frees all values of the effect in place `index` but those of `kept` (stems); `sigma` above zero, in the order of the effect's
    /// values, is the prior's, else [`much`].
    pub fn free_all(&mut self, index: usize, kept: &[&str], sigma: &[f64]) {
        let Some(effect) = self.model.effects().nth(index).copied() else { return };
        for (value, mean) in effect.values().iter().enumerate() {
            let named = named(&effect, value);
            let stated = sigma.get(value).copied().filter(|sigma| *sigma > 0.0);
            if named.is_some_and(|named| !kept.contains(&named.parameter.stem)) {
                let sigma = stated.unwrap_or_else(|| much(&effect, value));
                let belief = if stated.is_some() { Belief::Stated } else { Belief::Guard };
                self.free.push(Free { effect: index, value, mean: *mean, sigma, belief });
            }
        }
    }

    /// Frees the values of the effect in place `index` from what was believed of them; gives that back.
    pub fn revise(&mut self, index: usize) -> Vec<Free> {
        let (stated, kept) = self.free.iter().partition(|free| free.effect == index);
        self.free = kept;
        self.free_all(index, &[], &[]);
        stated
    }

    /// Undoes [`Hypothesis::revise`]: the effect in place `index` is again as in `given`.
    pub fn restore(&mut self, index: usize, given: &Model, stated: &[Free]) {
        self.free.retain(|free| free.effect != index);
        self.free.extend_from_slice(stated);
        let values = given.effects().nth(index).map(AnyEffect::values);
        if let Some(values) = values {
            self.model.change(index, |effect| effect.values_mut().copy_from_slice(values));
        }
    }

    /// Puts the numbers of these effects whose uncertainty is stated to what is believed of them; no fit changes them.
    pub fn believe(&mut self, wanted: impl Fn(&AnyEffect) -> bool) {
        let Self { model, free } = self;
        free.retain(|free| {
            let held = model.change(free.effect, |effect| {
                let held = free.belief == Belief::Stated && wanted(effect);
                if held {
                    effect.values_mut()[free.value] = free.mean;
                }
                held
            });
            !held.unwrap_or(true)
        });
    }

    /// The same without the effect in place `index`.
    #[must_use]
    pub fn without(&self, index: usize) -> Self {
        let mut less = Self::fixed(Model::nominal(self.model.arm));
        for (at, effect) in self.model.effects().enumerate() {
            if at != index {
                // It had room before.
                less.model.push(*effect).unwrap_or_default();
            }
        }
        let others = self.free.iter().filter(|free| free.effect != index);
        less.free = others
            .map(|free| Free { effect: free.effect - usize::from(free.effect > index), ..*free })
            .collect();
        less
    }

    /// The effect and value that a free number stands for.
    #[must_use]
    pub fn effect_of(&self, free: &Free) -> Option<&AnyEffect> {
        self.model.effects().nth(free.effect)
    }

    /// Whether a free number bends what the others of its effect do, a wave's phase aside.
    #[must_use]
    pub fn bends(&self, free: &Free) -> bool {
        let named = self.effect_of(free).and_then(|effect| named(effect, free.value));
        named.is_some_and(|named| {
            named.parameter.role == Role::Nonlinear && named.parameter.unit != Unit::PhaseRadian
        })
    }

    /// The free numbers as they stand.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        let effects: Vec<&AnyEffect> = self.model.effects().collect();
        self.free.iter().map(|free| effects[free.effect].values()[free.value]).collect()
    }

    /// The free numbers after a step. No number goes below where [`Hypothesis::lowest`] lets it; amplitude and phase of a wave go along the
    /// straight line that their sine and cosine go.
    #[must_use]
    pub fn stepped(&self, step: &[f64]) -> Self {
        let mut next = self.clone();
        for ((free, by), least) in self.free.iter().zip(step).zip(self.lowest()) {
            next.model.change(free.effect, |effect| {
                effect.values_mut()[free.value] += by.max(least).min(most(effect, free.value));
            });
        }
        let values = self.values();
        for (amplitude, phase) in self.waves() {
            let (along, across) =
                (values[amplitude] + step[amplitude], values[amplitude] * step[phase]);
            next.model.change(self.free[phase].effect, |effect| {
                // The nearer of the two ways to write the same wave: an amplitude may be negative.
                let sign = 1.0_f64.copysign(along);
                let turn = libm::atan2(sign * across, sign * along);
                effect.values_mut()[self.free[amplitude].value] = sign * along.hypot(across);
                effect.values_mut()[self.free[phase].value] = values[phase] + turn;
            });
        }
        next
    }

    /// The lowest step that each free number may take: one that must stay above zero goes at most nine tenths of the way there, one that must
    /// not be negative ends at zero, one between two bounds beside them.
    #[must_use]
    pub fn lowest(&self) -> Vec<f64> {
        let values = self.values();
        let least = |(free, value): (&Free, f64)| {
            let named = self.effect_of(free).and_then(|effect| named(effect, free.value));
            match named.map(|named| named.parameter.range) {
                Some(Range::Positive) => -0.9 * value,
                Some(Range::NotNegative) => -value,
                Some(Range::Between(low, high)) => low + ASIDE * (high - low) - value,
                _ => f64::NEG_INFINITY,
            }
        };
        self.free.iter().zip(values).map(least).collect()
    }

    /// How large each free number may be: the width on which it counts as hardly known. A phase counts by what it does at the largest amplitude,
    /// so that a wave whose amplitude stands near nothing for a moment keeps both its numbers.
    pub(crate) fn widths(&self) -> Vec<f64> {
        // A stated belief is no reason to leave a direction to others.
        let wide = |free: &Free| self.effect_of(free).map_or(0.0, |e| much(e, free.value));
        let of = |free: &Free| match free.belief {
            Belief::Stated => free.sigma.max(wide(free)),
            Belief::Guard | Belief::Tolerance => free.sigma,
        };
        let mut widths: Vec<f64> = self.free.iter().map(of).collect();
        let values = self.values();
        for (amplitude, phase) in self.waves() {
            let ratio = widths[amplitude] / values[amplitude].abs();
            widths[phase] =
                if ratio.is_finite() { widths[phase].max(ratio) } else { widths[phase] };
        }
        widths
    }

    /// Amplitude and phase of each wave of which both are free: places among the free numbers.
    fn waves(&self) -> Vec<(usize, usize)> {
        let entry = |free: &Free| named(self.effect_of(free)?, free.value);
        let is = |free: &Free, stem: &str| entry(free).filter(|named| named.parameter.stem == stem);
        let mut waves = Vec::new();
        for (phase, of_phase) in self.free.iter().enumerate() {
            let Some(named) = is(of_phase, "phase") else { continue };
            let same = |free: &Free| {
                let other = is(free, "amplitude");
                free.effect == of_phase.effect && other.is_some_and(|o| o.index == named.index)
            };
            waves.extend(self.free.iter().position(same).map(|amplitude| (amplitude, phase)));
        }
        waves
    }

    /// What a free number is called: `joint 3: tilt 2 of axis_tilt`.
    #[must_use]
    pub fn describe(&self, free: &Free) -> String {
        let Some(effect) = self.effect_of(free) else { return String::new() };
        describe(effect, free.value)
    }
}

/// The highest step that a value may take: one that must stay below a bound ends beside it.
fn most(effect: &AnyEffect, value: usize) -> f64 {
    match named(effect, value).map(|named| named.parameter.range) {
        Some(Range::Between(low, high)) => high - ASIDE * (high - low) - effect.values()[value],
        _ => f64::INFINITY,
    }
}

/// Which entry a value of an effect belongs to.
#[must_use]
pub fn named(effect: &AnyEffect, value: usize) -> Option<Named> {
    let mut first = 0;
    for parameter in effect.fitted() {
        let count = match parameter.count {
            Count::One => 1,
            Count::Exactly(count) => count,
            Count::UpTo(_) | Count::ThreePerCarriedBody => effect.values().len() - first,
        };
        if value < first + count {
            return Some(Named { parameter, index: value - first });
        }
        first += count;
    }
    None
}

/// What a value of an effect is called, for users: `joint 3's tilt 2 (axis_tilt)`.
#[must_use]
pub fn describe(effect: &AnyEffect, value: usize) -> String {
    let kind = effect.spec().kind;
    let Some(Named { parameter, index }) = named(effect, value) else { return kind.to_owned() };
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

/// How large a number of a sound robot may be, SI: the width of the prior where nothing is stated.
#[must_use]
pub fn much(effect: &AnyEffect, value: usize) -> f64 {
    let Some(Named { parameter, .. }) = named(effect, value) else { return 1.0 };
    let stands = effect.values()[value].abs();
    match (effect.spec().kind, parameter.unit) {
        ("joint_offset", _) => 0.02,
        ("axis_tilt", Unit::TurnMilliradian) => 5e-3,
        ("tool_offset" | "gravity_tilt", Unit::TurnMilliradian) => 0.02,
        ("gravity_sag" | "joint_polynomial", _) => 5e-3,
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
        (_, Unit::Hertz) => 0.5 * stands.max(1.0),
        (_, Unit::Millisecond) => 0.02_f64.max(stands),
        ("payload", Unit::Millimetre) => 0.3,
        ("counterbalance", Unit::Millimetre) => 0.5 * stands.max(0.1),
        (_, Unit::NewtonPerMetre) => 3.0 * stands.max(1e5),
        (_, Unit::Millimetre) => 0.02,
        (_, Unit::Micrometre) => 1e-3,
        (_, Unit::Compliance) => 2e-3,
        (_, Unit::TurnCompliance) => 2e-3,
        (_, Unit::CubicCompliance) => 1e-5,
        (_, Unit::MicrometrePerNewton) => 1e-5,
        (_, Unit::MicrometrePerKelvin) => 1e-4,
        (_, Unit::MilliradianPerKelvin) => 1e-4,
        (_, Unit::CyclesPerRevolution) => 0.05 * stands.max(1.0),
        (_, Unit::Second) => 3.0 * stands.max(1.0),
        (_, Unit::NewtonMetre | Unit::Moment | Unit::Newton) => 3.0 * stands.max(10.0),
        (_, Unit::Kilogram) => 20.0,
        _ => stands.max(1.0),
    }
}

/// An `axis_shift` has no part along its axis, which rounding may leave: the shift without it.
#[must_use]
pub fn without_axial_part(axis: DVec3, shift: DVec3) -> DVec3 {
    shift - axis * axis.dot(shift)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made::nominal;
    use physics::Given;
    use proptest::prelude::*;

    /// One wave of joint 1 with amplitude and phase free.
    fn wave(amplitude: f64, phase: f64) -> Hypothesis {
        let mut hypothesis = Hypothesis::fixed(nominal());
        let arm = hypothesis.model.arm;
        let given: &[(&str, &[f64])] =
            &[("amplitude", &[amplitude]), ("cycles", &[9.9]), ("phase", &[phase])];
        let effect = AnyEffect::build("transmission_error", &arm, Some(0), Given(given));
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
        let strong = wave(5e-4, 0.0).widths()[1];
        let weak = wave(1e-9, 0.0).widths()[1];
        assert!((strong - 6.0).abs() < 1e-12 && weak * 1e-9 > 0.5e-3, "{strong}, {weak}");
        assert!(wave(0.0, 0.0).widths()[1].is_finite());
    }

    #[test]
    fn what_must_stay_above_zero_stays_there_and_what_may_be_zero_ends_there() {
        let mut hypothesis = Hypothesis::fixed(nominal());
        let arm = hypothesis.model.arm;
        let given: &[(&str, &[f64])] = &[("width", &[1e-4]), ("torque", &[20.0])];
        let effect = AnyEffect::build("lost_motion", &arm, Some(1), Given(given));
        hypothesis.add(effect.expect("sound"), &[]).expect("room");
        let after = hypothesis.stepped(&[-1.0, -100.0]).values();
        assert!(after[0].abs() < 1e-18 && (after[1] - 2.0).abs() < 1e-12, "{after:?}");
    }
}
