//! Common parts of hidden effects of all domains: facts about a kind, an effect with its parameters, the model's knowledge, and the interface of a
//! case.
//!
//! A domain provides its kinds ([`Law`]) and its cases ([`Trial`]); generation, evaluation, sealing and scoring use only these. Parameters are SI, in
//! the order of the keys.

use std::fmt::Debug;

use crate::case::{Known, Tier};

/// A key of an effect in a model file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Key with its unit for revolute joints, and for prismatic joints.
    pub keys: [&'static str; 2],
    /// Number of values.
    pub count: usize,
    /// Factor from the key's unit to SI.
    pub si: f64,
    /// Whether its confidence intervals are scored: not if the law here has no parameter in common with that of the model format.
    pub counted: bool,
}

impl Entry {
    /// A key with several values, identical for all joints.
    #[must_use]
    pub const fn of(key: &'static str, count: usize, si: f64) -> Self {
        Self { keys: [key; 2], count, si, counted: true }
    }

    /// The same key, without a parameter in common with the law of the model format.
    #[must_use]
    pub const fn loose(self) -> Self {
        Self { counted: false, ..self }
    }

    /// The key for a prismatic (`slides`) or revolute joint.
    #[must_use]
    pub const fn key(&self, slides: bool) -> &'static str {
        self.keys[slides as usize]
    }
}

/// Facts of a kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facts<N: 'static> {
    /// Name in the model format; `None` outside the candidate dictionary.
    pub name: Option<&'static str>,
    /// Whether it belongs to a joint.
    pub of_joint: bool,
    /// Keys in order.
    pub entries: &'static [Entry],
    /// Number of leading parameters, to which the effect is proportional.
    pub leads: usize,
    /// Largest magnitude of a leading parameter, SI; infinite if it depends on the case.
    pub most: f64,
    /// Whether leading parameters must not be negative.
    pub not_negative: bool,
    /// Conditions for it to be observable.
    pub needs: &'static [N],
}

/// A kind of effect of a domain.
pub trait Law: Copy + PartialEq + Debug {
    /// Condition for a kind to be observable.
    type Need: Copy + PartialEq + 'static;

    /// Facts of the kind.
    #[must_use]
    fn facts(self) -> Facts<Self::Need>;

    /// Its name in answers; `None` outside the candidate dictionary.
    #[must_use]
    fn name(self) -> Option<&'static str> {
        self.facts().name
    }

    /// Number of its parameters.
    #[must_use]
    fn count(self) -> usize {
        self.facts().entries.iter().map(|entry| entry.count).sum()
    }

    /// Whether it has this condition.
    #[must_use]
    fn needs(self, need: Self::Need) -> bool {
        self.facts().needs.contains(&need)
    }

    /// Typical size of a change of a parameter, for finite differences.
    #[must_use]
    fn step(effect: &Effect<Self>, number: usize) -> f64 {
        effect.numbers[number].abs().max(effect.lead()).max(1e-9)
    }

    /// A fitted value limited to its range: non-negative leading parameters stay non-negative, scale-like parameters positive.
    #[must_use]
    fn bounded(effect: &Effect<Self>, number: usize, wanted: f64) -> f64 {
        let (from, facts) = (effect.numbers[number], effect.kind.facts());
        if number < facts.leads {
            return if facts.not_negative { wanted.max(0.0) } else { wanted };
        }
        if from > 0.0 { wanted.max(0.3 * from) } else { wanted }
    }
}

/// An effect with its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect<K> {
    /// Kind of the effect.
    pub kind: K,
    /// 0-based; 0 for effects of the whole robot.
    pub joint: usize,
    /// Another joint that takes part, 0-based; the same joint if there is none.
    pub other: usize,
    /// Parameters, SI, in the order of the keys.
    pub numbers: Vec<f64>,
}

impl<K: Law> Effect<K> {
    /// An effect of one joint.
    #[must_use]
    pub fn of(kind: K, joint: usize, numbers: &[f64]) -> Self {
        Self { kind, joint, other: joint, numbers: numbers.to_vec() }
    }

    /// The effect with leading parameters multiplied by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        scaled.numbers.iter_mut().take(self.kind.facts().leads).for_each(|x| *x *= factor);
        scaled
    }

    /// Largest magnitude of its leading parameters.
    #[must_use]
    pub fn lead(&self) -> f64 {
        let leads = self.numbers.iter().take(self.kind.facts().leads);
        leads.fold(0.0, |most, x| most.max(x.abs()))
    }

    /// The joint as in answers, 1-based; `None` for effects of the whole robot.
    #[must_use]
    pub fn joint_said(&self) -> Option<usize> {
        self.kind.facts().of_joint.then_some(self.joint + 1)
    }

    /// Its keys with their values, SI.
    pub fn entries(&self) -> impl Iterator<Item = (&'static Entry, &[f64])> {
        let mut from = 0;
        self.kind.facts().entries.iter().map(move |entry| {
            let numbers = &self.numbers[from..from + entry.count];
            from += entry.count;
            (entry, numbers)
        })
    }
}

/// Interface of a blind case of any domain, for generation, evaluation, sealing and scoring.
pub trait Trial {
    /// Kinds of the domain.
    type Kind: Law;

    /// Its tier.
    fn tier(&self) -> Tier;

    /// Effects in the model.
    fn known(&self) -> &[Known<Self::Kind>];

    /// Effects missing from the model.
    fn hidden(&self) -> &[Effect<Self::Kind>];

    /// Whether its joints are prismatic.
    fn slides(&self) -> bool {
        false
    }

    /// Names of the covariates that an effect outside the dictionary depends on.
    fn follows(&self, effect: &Effect<Self::Kind>) -> Vec<String>;

    /// Effects of the model with nominal parameters.
    fn nominal(&self) -> Vec<Effect<Self::Kind>> {
        self.known().iter().map(|known| known.nominal.clone()).collect()
    }

    /// All true effects: those of the model first.
    fn real(&self) -> Vec<Effect<Self::Kind>> {
        let known = self.known().iter().map(|known| known.real.clone());
        known.chain(self.hidden().iter().cloned()).collect()
    }

    /// The model's effect of this kind on this joint.
    fn known_of(&self, kind: Self::Kind, joint: usize) -> Option<&Known<Self::Kind>> {
        self.known().iter().find(|k| k.nominal.kind == kind && k.nominal.joint == joint)
    }

    /// The model's effect that a hidden effect revises: the hidden parameters are then the difference.
    fn revised(&self, effect: &Effect<Self::Kind>) -> Option<&Known<Self::Kind>> {
        self.known_of(effect.kind, effect.joint)
    }

    /// Whether every revision exceeds the stated uncertainty by far: an error within it is not a finding.
    fn is_certain(&self) -> bool {
        let beyond = |effect: &Effect<Self::Kind>, known: &Known<Self::Kind>| {
            let pairs = effect.numbers.iter().zip(&known.sigma);
            pairs.into_iter().any(|(x, sigma)| x.abs() > 6.0 * sigma)
        };
        self.hidden().iter().all(|e| self.revised(e).is_none_or(|known| beyond(e, known)))
    }
}
