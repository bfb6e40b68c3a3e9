//! The sum of the effects: where the tool really goes.
//!
//! Promises: [`Model::evaluate`] is `FK_real(q + δθ(q, W, T))`, loads and effects taken on the controller's geometry at `q`
//! (see docs/decisions/0002); effects on the loads come first, all others see the changed loads.
//! Never: an inverse. Solving for the joint positions that put the tool right is the corrector's.

use crate::deviation::{Contribution, Deviation};
use crate::loads::{LoadChange, Loads};
use crate::signals::{Inputs, Signals};
use crate::spec::ActsOn;
use crate::{AnyEffect, Arm, Chain, EFFECTS_MAX, Memory};
use thiserror::Error;

/// An arm with its effects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// What the controller believes.
    pub arm: Arm,
    effects: [Option<AnyEffect>; EFFECTS_MAX],
    count: usize,
    changes_loads: bool,
}

/// What the effects of one model remember in one run, in the order of [`Model::effects`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Memories([Memory; EFFECTS_MAX]);

impl Default for Memories {
    fn default() -> Self {
        Self([Memory::default(); EFFECTS_MAX])
    }
}

/// Why a model cannot take an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("a model has at most {EFFECTS_MAX} effects")]
pub struct ModelError;

/// Everything that the model says of one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    /// The controller's geometry.
    pub nominal: Chain,
    /// The loads on it.
    pub loads: Loads,
    /// What the effects add.
    pub deviation: Deviation,
    /// Where everything really is.
    pub real: Chain,
}

impl Model {
    /// An arm without any effect.
    pub const fn nominal(arm: Arm) -> Self {
        Self { arm, effects: [None; EFFECTS_MAX], count: 0, changes_loads: false }
    }

    /// An arm with effects.
    ///
    /// # Errors
    /// More than [`EFFECTS_MAX`] effects.
    pub fn new(arm: Arm, effects: &[AnyEffect]) -> Result<Self, ModelError> {
        let mut model = Self::nominal(arm);
        for effect in effects {
            model.push(*effect)?;
        }
        Ok(model)
    }

    /// Adds an effect.
    ///
    /// # Errors
    /// More than [`EFFECTS_MAX`] effects.
    pub fn push(&mut self, effect: AnyEffect) -> Result<(), ModelError> {
        let slot = self.effects.get_mut(self.count).ok_or(ModelError)?;
        self.changes_loads |= effect.spec().acts_on == ActsOn::Loads;
        *slot = Some(effect);
        self.count += 1;
        Ok(())
    }

    /// The effects, in the order in which they were added.
    pub fn effects(&self) -> impl ExactSizeIterator<Item = &AnyEffect> {
        // All slots below `count` are taken: `flatten` would say so too, but without the exact length.
        self.effects[..self.count].iter().map(|slot| match slot {
            Some(effect) => effect,
            None => unreachable!("slots below count are taken"),
        })
    }

    /// The effect in place `index`, to be changed.
    pub fn effect_mut(&mut self, index: usize) -> Option<&mut AnyEffect> {
        self.effects[..self.count].get_mut(index)?.as_mut()
    }

    /// What happens at one sample with these memories; the memories stay.
    pub fn evaluate(&self, inputs: &Inputs, memories: &Memories) -> Evaluation {
        let nominal = Chain::nominal(&self.arm, &inputs.q);
        let loads = self.loads(inputs, &nominal, memories);
        let signals = Signals { arm: &self.arm, inputs, chain: &nominal, loads: &loads };
        let mut deviation = Deviation::default();
        for (effect, memory) in self.effects().zip(&memories.0) {
            deviation.add(&effect.predict(&signals, memory));
        }
        let real = Chain::real(&self.arm, &inputs.q, &deviation);
        Evaluation { nominal, loads, deviation, real }
    }

    /// Calls `visit` with the index and contribution of each effect at one sample.
    pub fn contributions(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        mut visit: impl FnMut(usize, &Contribution),
    ) {
        self.with_signals(inputs, memories, |signals| {
            for (index, (effect, memory)) in self.effects().zip(&memories.0).enumerate() {
                visit(index, &effect.predict(signals, memory));
            }
        });
    }

    /// See [`crate::Effect::settle`], for all effects.
    pub fn settle(&self, inputs: &Inputs, memories: &mut Memories) {
        self.update(inputs, memories, AnyEffect::settle);
    }

    /// See [`crate::Effect::advance`], for all effects. Forward simulation: advance, then evaluate.
    pub fn advance(&self, inputs: &Inputs, memories: &mut Memories) {
        self.update(inputs, memories, AnyEffect::advance);
    }

    /// See [`crate::Effect::follow`], for all effects. Correction: follow once per cycle, then solve.
    pub fn follow(&self, inputs: &Inputs, memories: &mut Memories) {
        self.update(inputs, memories, AnyEffect::follow);
    }

    fn update(
        &self,
        inputs: &Inputs,
        memories: &mut Memories,
        step: impl Fn(&AnyEffect, &Signals<'_>, &mut Memory),
    ) {
        if self.effects().all(|effect| !effect.spec().has_memory) {
            return;
        }
        let before = *memories;
        self.with_signals(inputs, &before, |signals| {
            for (effect, memory) in self.effects().zip(&mut memories.0) {
                step(effect, signals, memory);
            }
        });
    }

    fn with_signals<R>(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        visit: impl FnOnce(&Signals<'_>) -> R,
    ) -> R {
        let chain = Chain::nominal(&self.arm, &inputs.q);
        let loads = self.loads(inputs, &chain, memories);
        visit(&Signals { arm: &self.arm, inputs, chain: &chain, loads: &loads })
    }

    fn loads(&self, inputs: &Inputs, chain: &Chain, memories: &Memories) -> Loads {
        let loads = Loads::on(&self.arm, chain, inputs.wrench_base);
        if !self.changes_loads {
            return loads;
        }
        let signals = Signals { arm: &self.arm, inputs, chain, loads: &loads };
        let mut change = LoadChange::default();
        for (effect, memory) in self.effects().zip(&memories.0) {
            if effect.spec().acts_on == ActsOn::Loads {
                change.add(&effect.predict(&signals, memory));
            }
        }
        Loads::changed(&self.arm, chain, inputs.wrench_base, &change)
    }
}
