//! Common parts of hidden effects of all domains: facts about a kind, an effect with its parameters, the model's knowledge, and the interface of a case.
//!
//! A domain gives its kinds ([`Law`]) and its cases ([`Trial`]); drawing, weighing, sealing and proving then know nothing else of it.
//!
//! Promises: numbers are SI in the order of the keys. Never: a formula of physics.

use std::fmt::Debug;

use crate::case::{Known, Tier};

/// A key of an effect in a model file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Key with its unit where the joint turns, and where it slides.
    pub keys: [&'static str; 2],
    /// Numbers.
    pub count: usize,
    /// SI of one such unit.
    pub si: f64,
    /// Whether intervals are counted on it: not where the contract's law and the one here have no common number.
    pub counted: bool,
}

impl Entry {
    /// A key of several numbers that is the same for all joints.
    #[must_use]
    pub const fn of(key: &'static str, count: usize, si: f64) -> Self {
        Self { keys: [key; 2], count, si, counted: true }
    }

    /// The same, with no number in common with the contract's law.
    #[must_use]
    pub const fn loose(self) -> Self {
        Self { counted: false, ..self }
    }

    /// The key on a joint that turns or slides.
    #[must_use]
    pub const fn key(&self, slides: bool) -> &'static str {
        self.keys[slides as usize]
    }
}

/// What is said of a kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facts<N: 'static> {
    /// Name in the contract; none outside the library.
    pub name: Option<&'static str>,
    /// Whether it belongs to a joint.
    pub of_joint: bool,
    /// Keys in order.
    pub entries: &'static [Entry],
    /// How many numbers, from the first, the effect is proportional to.
    pub leads: usize,
    /// The largest magnitude of a leading number, SI; infinite where the case alone says it.
    pub most: f64,
    /// Whether the leading number may not be negative.
    pub not_negative: bool,
    /// What it needs.
    pub needs: &'static [N],
}

/// A kind of effect of a domain.
pub trait Law: Copy + PartialEq + Debug {
    /// What must be there for a kind to show.
    type Need: Copy + PartialEq + 'static;

    /// What is said of it.
    #[must_use]
    fn facts(self) -> Facts<Self::Need>;

    /// Its name in answers; outside the library none.
    #[must_use]
    fn name(self) -> Option<&'static str> {
        self.facts().name
    }

    /// How many numbers it has.
    #[must_use]
    fn count(self) -> usize {
        self.facts().entries.iter().map(|entry| entry.count).sum()
    }

    /// Whether it needs this.
    #[must_use]
    fn needs(self, need: Self::Need) -> bool {
        self.facts().needs.contains(&need)
    }

    /// Of what size a change of a number is.
    #[must_use]
    fn step(effect: &Effect<Self>, number: usize) -> f64 {
        effect.numbers[number].abs().max(effect.lead()).max(1e-9)
    }

    /// What a fit that wants a number to be so may make of it: what scales something stays above nothing.
    #[must_use]
    fn bounded(effect: &Effect<Self>, number: usize, wanted: f64) -> f64 {
        let (from, facts) = (effect.numbers[number], effect.kind.facts());
        if number < facts.leads {
            return if facts.not_negative { wanted.max(0.0) } else { wanted };
        }
        if from > 0.0 { wanted.max(0.3 * from) } else { wanted }
    }
}

/// An effect with its numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect<K> {
    /// Which law.
    pub kind: K,
    /// From 0; 0 for effects of the whole robot.
    pub joint: usize,
    /// Another joint that has a part in it, from 0; its own where none has.
    pub other: usize,
    /// SI, in the order of the keys.
    pub numbers: Vec<f64>,
}

impl<K: Law> Effect<K> {
    /// An effect of one joint.
    #[must_use]
    pub fn of(kind: K, joint: usize, numbers: &[f64]) -> Self {
        Self { kind, joint, other: joint, numbers: numbers.to_vec() }
    }

    /// The same with its leading numbers times `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        scaled.numbers.iter_mut().take(self.kind.facts().leads).for_each(|x| *x *= factor);
        scaled
    }

    /// The largest of its leading numbers.
    #[must_use]
    pub fn lead(&self) -> f64 {
        let leads = self.numbers.iter().take(self.kind.facts().leads);
        leads.fold(0.0, |most, x| most.max(x.abs()))
    }

    /// The joint as answers name it, from 1.
    #[must_use]
    pub fn joint_said(&self) -> Option<usize> {
        self.kind.facts().of_joint.then_some(self.joint + 1)
    }

    /// Its keys, each with its numbers, SI.
    pub fn entries(&self) -> impl Iterator<Item = (&'static Entry, &[f64])> {
        let mut from = 0;
        self.kind.facts().entries.iter().map(move |entry| {
            let numbers = &self.numbers[from..from + entry.count];
            from += entry.count;
            (entry, numbers)
        })
    }
}

/// A blind case of any domain, as far as drawing, weighing, sealing and proving look at it.
pub trait Trial {
    /// The domain's kinds.
    type Kind: Law;

    /// What it asks.
    fn tier(&self) -> Tier;

    /// What the model knows.
    fn known(&self) -> &[Known<Self::Kind>];

    /// What it does not.
    fn hidden(&self) -> &[Effect<Self::Kind>];

    /// Whether its joints slide.
    fn slides(&self) -> bool {
        false
    }

    /// The words of the contract for what a law outside the library follows.
    fn follows(&self, effect: &Effect<Self::Kind>) -> Vec<String>;

    /// The effects that the model has, with its numbers.
    fn nominal(&self) -> Vec<Effect<Self::Kind>> {
        self.known().iter().map(|known| known.nominal.clone()).collect()
    }

    /// All effects, as they are: known ones first.
    fn real(&self) -> Vec<Effect<Self::Kind>> {
        let known = self.known().iter().map(|known| known.real.clone());
        known.chain(self.hidden().iter().cloned()).collect()
    }

    /// What the model knows of this kind on this joint.
    fn known_of(&self, kind: Self::Kind, joint: usize) -> Option<&Known<Self::Kind>> {
        self.known().iter().find(|k| k.nominal.kind == kind && k.nominal.joint == joint)
    }

    /// What the model has where a hidden effect stands: its numbers are then the difference.
    fn revised(&self, effect: &Effect<Self::Kind>) -> Option<&Known<Self::Kind>> {
        self.known_of(effect.kind, effect.joint)
    }

    /// Whether every hidden effect is one: a known number that is off within its uncertainty is no finding.
    fn is_certain(&self) -> bool {
        let beyond = |effect: &Effect<Self::Kind>, known: &Known<Self::Kind>| {
            let pairs = effect.numbers.iter().zip(&known.sigma);
            pairs.into_iter().any(|(x, sigma)| x.abs() > 6.0 * sigma)
        };
        self.hidden().iter().all(|e| self.revised(e).is_none_or(|known| beyond(e, known)))
    }
}
