//! Common parts of hidden effects of all domains: specification of a kind, an effect with its parameters, and the interface of a
//! case.
//!
//! A domain provides its kinds ([`EffectKind`]) and its cases ([`BlindCase`]); generation, evaluation, sealing and scoring use only these. Parameters are SI, in
//! the order of the keys.

use std::fmt::Debug;

use crate::case::{ModelledEffect, Tier};

/// A key of an effect in a model file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterKey {
    /// Key with its unit for revolute joints, and for prismatic joints.
    pub keys: [&'static str; 2],
    /// Number of values.
    pub count: usize,
    /// Factor from the key's unit to SI.
    pub si: f64,
    /// Whether its confidence intervals are scored: not if the law here has no parameter in common with that of the model format.
    pub is_scored: bool,
}

impl ParameterKey {
    /// A key with several values, identical for all joints.
    #[must_use]
    pub const fn of(key: &'static str, count: usize, si: f64) -> Self {
        Self { keys: [key; 2], count, si, is_scored: true }
    }

    /// The same key, without a parameter in common with the law of the model format.
    #[must_use]
    pub const fn unscored(self) -> Self {
        Self { is_scored: false, ..self }
    }

    /// The key for a prismatic (`slides`) or revolute joint.
    #[must_use]
    pub const fn key(&self, slides: bool) -> &'static str {
        self.keys[slides as usize]
    }
}

/// Specification of a kind of effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KindSpec<N: 'static> {
    /// Name in the model format; `None` outside the candidate dictionary.
    pub name: Option<&'static str>,
    /// Whether it belongs to a joint.
    pub per_joint: bool,
    /// Keys in order.
    pub keys: &'static [ParameterKey],
    /// Number of leading parameters, to which the effect is proportional.
    pub linear_count: usize,
    /// Largest magnitude of a leading parameter, SI; infinite if it depends on the case.
    pub max_linear: f64,
    /// Whether leading parameters must not be negative.
    pub non_negative: bool,
    /// Conditions for it to be observable.
    pub needs: &'static [N],
}

/// A kind of effect of a domain.
pub trait EffectKind: Copy + PartialEq + Debug {
    /// Condition for a kind to be observable.
    type Requirement: Copy + PartialEq + 'static;

    /// Specification of the kind.
    #[must_use]
    fn spec(self) -> KindSpec<Self::Requirement>;

    /// Its name in answers; `None` outside the candidate dictionary.
    #[must_use]
    fn name(self) -> Option<&'static str> {
        self.spec().name
    }

    /// Number of its parameters.
    #[must_use]
    fn count(self) -> usize {
        self.spec().keys.iter().map(|entry| entry.count).sum()
    }

    /// Whether it has this condition.
    #[must_use]
    fn needs(self, need: Self::Requirement) -> bool {
        self.spec().needs.contains(&need)
    }

    /// Typical size of a change of a parameter, for finite differences.
    #[must_use]
    fn step(effect: &Effect<Self>, number: usize) -> f64 {
        effect.parameters[number].abs().max(effect.linear_magnitude()).max(1e-9)
    }

    /// A fitted value limited to its range: non-negative leading parameters stay non-negative, scale-like parameters positive.
    #[must_use]
    fn bounded(effect: &Effect<Self>, number: usize, wanted: f64) -> f64 {
        let (from, spec) = (effect.parameters[number], effect.kind.spec());
        if number < spec.linear_count {
            return if spec.non_negative { wanted.max(0.0) } else { wanted };
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
    pub other_joint: usize,
    /// Parameters, SI, in the order of the keys.
    pub parameters: Vec<f64>,
}

impl<K: EffectKind> Effect<K> {
    /// An effect of one joint.
    #[must_use]
    pub fn of(kind: K, joint: usize, parameters: &[f64]) -> Self {
        Self { kind, joint, other_joint: joint, parameters: parameters.to_vec() }
    }

    /// The effect with leading parameters multiplied by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        scaled.parameters.iter_mut().take(self.kind.spec().linear_count).for_each(|x| *x *= factor);
        scaled
    }

    /// Largest magnitude of its leading parameters.
    #[must_use]
    pub fn linear_magnitude(&self) -> f64 {
        let leads = self.parameters.iter().take(self.kind.spec().linear_count);
        leads.fold(0.0, |most, x| most.max(x.abs()))
    }

    /// The joint as in answers, 1-based; `None` for effects of the whole robot.
    #[must_use]
    pub fn joint_number(&self) -> Option<usize> {
        self.kind.spec().per_joint.then_some(self.joint + 1)
    }

    /// Its keys with their values, SI.
    pub fn keyed_parameters(&self) -> impl Iterator<Item = (&'static ParameterKey, &[f64])> {
        let mut from = 0;
        self.kind.spec().keys.iter().map(move |entry| {
            let parameters = &self.parameters[from..from + entry.count];
            from += entry.count;
            (entry, parameters)
        })
    }
}

/// Interface of a blind case of any domain, for generation, evaluation, sealing and scoring.
pub trait BlindCase {
    /// Kinds of the domain.
    type Kind: EffectKind;

    /// Its tier.
    fn tier(&self) -> Tier;

    /// Effects in the model.
    fn modelled(&self) -> &[ModelledEffect<Self::Kind>];

    /// Effects missing from the model.
    fn hidden(&self) -> &[Effect<Self::Kind>];

    /// Whether its joints are prismatic.
    fn is_prismatic(&self) -> bool {
        false
    }

    /// Names of the covariates that an effect outside the dictionary depends on.
    fn covariates(&self, effect: &Effect<Self::Kind>) -> Vec<String>;

    /// Effects of the model with nominal parameters.
    fn nominal(&self) -> Vec<Effect<Self::Kind>> {
        self.modelled().iter().map(|modelled| modelled.nominal.clone()).collect()
    }

    /// All true effects: those of the model first.
    fn true_effects(&self) -> Vec<Effect<Self::Kind>> {
        let modelled = self.modelled().iter().map(|known| known.true_effect.clone());
        modelled.chain(self.hidden().iter().cloned()).collect()
    }

    /// The model's effect of this kind on this joint.
    fn modelled_effect(
        &self,
        kind: Self::Kind,
        joint: usize,
    ) -> Option<&ModelledEffect<Self::Kind>> {
        self.modelled().iter().find(|k| k.nominal.kind == kind && k.nominal.joint == joint)
    }

    /// The model's effect that a hidden effect revises: the hidden parameters are then the difference.
    fn revised_effect(&self, effect: &Effect<Self::Kind>) -> Option<&ModelledEffect<Self::Kind>> {
        self.modelled_effect(effect.kind, effect.joint)
    }

    /// Whether every revision exceeds the stated uncertainty by far: an error within it is not a finding.
    fn revisions_exceed_uncertainty(&self) -> bool {
        let beyond = |effect: &Effect<Self::Kind>, modelled: &ModelledEffect<Self::Kind>| {
            let pairs = effect.parameters.iter().zip(&modelled.sigma);
            pairs.into_iter().any(|(x, sigma)| x.abs() > 6.0 * sigma)
        };
        self.hidden()
            .iter()
            .all(|e| self.revised_effect(e).is_none_or(|modelled| beyond(e, modelled)))
    }
}
