//! What is believed of the arm, and which of its numbers a fit may change.
//!
//! Promises: a free number has a prior: what a file states with its uncertainty, or else a width that no sound robot exceeds, which
//! keeps what the data hardly see from running away and is too wide to be felt where they do see.
//! Never: data.

use glam::DVec3;
use physics::spec::{Count, Parameter, Range, Unit};
use physics::{AnyEffect, Model, ModelError};

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
                self.free.push(Free { effect: index, value, mean: *mean, sigma });
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
        if let (Some(effect), Some(values)) = (self.model.effect_mut(index), values) {
            effect.values_mut().copy_from_slice(values);
        }
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

    /// The free numbers as they stand.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        let effects: Vec<&AnyEffect> = self.model.effects().collect();
        self.free.iter().map(|free| effects[free.effect].values()[free.value]).collect()
    }

    /// The free numbers after a step. A number that must stay above zero goes at most nine tenths of the way there, one that must not
    /// be negative ends at zero.
    #[must_use]
    pub fn stepped(&self, step: &[f64]) -> Self {
        let mut next = self.clone();
        for (free, by) in self.free.iter().zip(step) {
            if let Some(effect) = next.model.effect_mut(free.effect) {
                let named = named(effect, free.value);
                let value = &mut effect.values_mut()[free.value];
                let wanted = *value + by;
                *value = match named.map(|named| named.parameter.range) {
                    Some(Range::Positive) => wanted.max(0.1 * *value),
                    Some(Range::NotNegative) => wanted.max(0.0),
                    _ => wanted,
                };
            }
        }
        next
    }

    /// What a free number is called: `joint 3: tilt 2 of axis_tilt`.
    #[must_use]
    pub fn describe(&self, free: &Free) -> String {
        let Some(effect) = self.effect_of(free) else { return String::new() };
        describe(effect, free.value)
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

/// What a value of an effect is called, for people: `joint 3's tilt 2 (axis_tilt)`.
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
        (_, Unit::Milliradian | Unit::TurnMilliradian) => 1e-3,
        (_, Unit::One) => 5e-4,
        (_, Unit::PhaseRadian) => 6.0,
        ("axis_shift", _) => 5e-3,
        ("payload", Unit::Millimetre) => 0.3,
        ("counterbalance", Unit::Millimetre) => 0.5 * stands.max(0.1),
        (_, Unit::NewtonPerMetre) => 3.0 * stands.max(1e5),
        (_, Unit::Millimetre) => 0.02,
        (_, Unit::Micrometre) => 1e-3,
        (_, Unit::Compliance) => 2e-3,
        (_, Unit::TurnCompliance) => 2e-3,
        (_, Unit::CubicCompliance) => 1e-11,
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
