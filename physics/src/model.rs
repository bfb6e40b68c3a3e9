//! The sum of the effects: where the tool really goes.
//!
//! Promises: [`Model::evaluate`] is `FK_real(q + δθ(q, W, T))`, loads and effects taken on the controller's geometry at `q`
//! (see docs/decisions/0002); effects on the loads come first, all others see the changed loads; [`Model::check`] holds what
//! effects must not see of each other.
//! Never: an inverse. Solving for the joint positions that put the tool right is the corrector's.

use crate::deviation::{Contribution, Deviation};
use crate::laws::Laws;
use crate::loads::Loads;
use crate::signals::{Inputs, Signals};
use crate::spec::{ActsOn, Need};
use crate::{AnyEffect, Arm, Chain, EFFECTS_MAX, Memory};
use core::mem::discriminant;
use thiserror::Error;

mod evaluate;

/// An arm with its effects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// What the controller believes.
    pub arm: Arm,
    effects: [Option<AnyEffect>; EFFECTS_MAX],
    count: usize,
    changes_loads: bool,
    hardens: bool,
    /// Effects that are a law of their joint, summed; places of all others.
    laws: Laws,
    others: [u8; EFFECTS_MAX],
    others_count: usize,
}

const _: () = assert!(EFFECTS_MAX <= 1 << u8::BITS, "a place of an effect fits into a byte");

/// What the effects of one model remember in one run, in the order of [`Model::effects`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Memories([Memory; EFFECTS_MAX]);

impl Default for Memories {
    fn default() -> Self {
        Self([Memory::default(); EFFECTS_MAX])
    }
}

impl Memories {
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Memory> {
        self.0.iter()
    }

    /// What the effect in place `to` remembers becomes what the one in place `from` of `other` does.
    pub fn take(&mut self, to: usize, other: &Self, from: usize) {
        if let (Some(slot), Some(memory)) = (self.0.get_mut(to), other.0.get(from)) {
            *slot = *memory;
        }
    }
}

/// Why effects do not make a model. Joints are 1-based here, as in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ModelError {
    /// More effects than there is room for.
    #[error("a model has at most {EFFECTS_MAX} effects")]
    TooManyEffects,
    /// A `stiffness_hardening` with nothing to harden.
    #[error("joint {joint}: `stiffness_hardening` needs a linear compliance on the same joint")]
    HardensNothing {
        /// 1-based.
        joint: usize,
    },
    /// The whole and one of its halves.
    #[error(
        "joint {joint}: `joint_compliance` stands for `gravity_compliance` and `load_compliance` with one number, \
         it cannot stand beside either"
    )]
    CompliantTwice {
        /// 1-based.
        joint: usize,
    },
}

/// A load for which a joint's stiffening law is not physical any more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// 0-based joint.
    pub joint: usize,
    /// The load, Nm or N.
    pub torque: f64,
    /// The law holds below this load's magnitude, Nm or N.
    pub limit: f64,
}

/// Everything that the model says of one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evaluation {
    /// The controller's geometry.
    pub nominal: Chain,
    /// The loads on it.
    pub loads: Loads,
    /// What the effects add.
    pub deviation: Deviation,
    /// Where everything really is.
    pub real: Chain,
    /// The first joint that is loaded beyond what its `stiffness_hardening` holds for: refuse this evaluation then.
    pub beyond: Option<Beyond>,
}

impl Evaluation {
    /// The second half of [`Model::evaluate_into`]: where everything really is.
    pub fn stand(&mut self, arm: &Arm, inputs: &Inputs) {
        self.real.deviate(arm, &inputs.q, &self.deviation, &self.nominal);
    }
}

fn acts_on_loads(effect: &AnyEffect) -> bool {
    effect.spec().acts_on == ActsOn::Loads
}

fn is_hardening(effect: &AnyEffect) -> bool {
    matches!(effect, AnyEffect::StiffnessHardening(_))
}

impl Model {
    /// An arm without any effect.
    pub const fn nominal(arm: Arm) -> Self {
        Self {
            arm,
            effects: [None; EFFECTS_MAX],
            count: 0,
            changes_loads: false,
            hardens: false,
            laws: Laws::NONE,
            others: [0; EFFECTS_MAX],
            others_count: 0,
        }
    }

    /// An arm with effects that fit each other.
    ///
    /// # Errors
    /// What does not fit, see [`ModelError`].
    pub fn new(arm: Arm, effects: &[AnyEffect]) -> Result<Self, ModelError> {
        let mut model = Self::nominal(arm);
        for effect in effects {
            model.push(*effect)?;
        }
        model.check()?;
        Ok(model)
    }

    /// Whether the effects fit each other; [`Model::new`] asks this.
    ///
    /// # Errors
    /// The first joint at which they do not.
    pub fn check(&self) -> Result<(), ModelError> {
        for i in 0..self.arm.count() {
            let joint = i + 1;
            let has = |kind| self.effects().any(|e| e.spec().kind == kind && e.joint() == Some(i));
            let halves = has("gravity_compliance") || has("load_compliance");
            if has("joint_compliance") && halves {
                return Err(ModelError::CompliantTwice { joint });
            }
            if has("stiffness_hardening") && !has("joint_compliance") && !halves {
                return Err(ModelError::HardensNothing { joint });
            }
        }
        Ok(())
    }

    /// Adds an effect; see [`Model::check`] for whether it fits the others.
    ///
    /// # Errors
    /// More than [`EFFECTS_MAX`] effects.
    pub fn push(&mut self, effect: AnyEffect) -> Result<(), ModelError> {
        let slot = self.effects.get_mut(self.count).ok_or(ModelError::TooManyEffects)?;
        self.changes_loads |= acts_on_loads(&effect);
        self.hardens |= is_hardening(&effect);
        *slot = Some(effect);
        self.count += 1;
        self.sort(self.count - 1);
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

    /// Changes the effect in place `index`; what the change answers, none where there is no such effect.
    pub fn change<R>(
        &mut self,
        index: usize,
        change: impl FnOnce(&mut AnyEffect) -> R,
    ) -> Option<R> {
        let effect = self.effects[..self.count].get_mut(index)?.as_mut()?;
        let (kind, before) = (discriminant(effect), effect.law());
        let answer = change(effect);
        let (same_kind, same_law) = (discriminant(effect) == kind, effect.law() == before);
        if !same_law {
            (self.laws, self.others_count) = (Laws::NONE, 0);
            (0..self.count).for_each(|index| self.sort(index));
        }
        if !same_kind {
            let any = |is: fn(&AnyEffect) -> bool| self.effects().any(is);
            (self.changes_loads, self.hardens) = (any(acts_on_loads), any(is_hardening));
        }
        Some(answer)
    }

    /// Sums the effect in place `index` with the laws of joints, or puts it among the others.
    fn sort(&mut self, index: usize) {
        let law = self.effects[index].as_ref().and_then(|e| e.joint().zip(e.law()));
        if !law.is_some_and(|(joint, law)| self.laws.take(joint, &law)) {
            self.others[self.others_count] = index as u8;
            self.others_count += 1;
        }
    }

    /// What happens at one sample with these memories; the memories stay.
    pub fn evaluate(&self, inputs: &Inputs, memories: &Memories) -> Evaluation {
        let mut seen = Evaluation::default();
        self.evaluate_into(inputs, memories, &mut seen);
        seen
    }

    /// Calls `visit` with the index and contribution of each effect at one sample.
    pub fn contributions(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        visit: impl FnMut(usize, &Contribution),
    ) {
        let mut seen = Evaluation::default();
        self.load_into(inputs, memories, &mut seen);
        self.contributions_under(inputs, memories, &seen, visit);
    }

    /// [`Model::contributions`] for the geometry and loads in `seen`, computed by [`Model::load_into`] and possibly changed since.
    pub fn contributions_under(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        seen: &Evaluation,
        mut visit: impl FnMut(usize, &Contribution),
    ) {
        let Evaluation { nominal: chain, loads, .. } = seen;
        let signals = Signals { arm: &self.arm, inputs, chain, loads };
        for (index, (effect, memory)) in self.effects().zip(&memories.0).enumerate() {
            visit(index, &effect.predict(&signals, memory));
        }
    }

    /// Calls `visit` with each place in `wanted` and the derivative of that effect's contribution by that value; `wanted` names
    /// places in [`Model::effects`] and values of these.
    pub fn derivatives(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        wanted: &[(usize, usize)],
        visit: impl FnMut(usize, &Contribution),
    ) {
        let mut seen = Evaluation::default();
        self.load_into(inputs, memories, &mut seen);
        self.derivatives_under(inputs, memories, &seen, wanted, visit);
    }

    /// [`Model::derivatives`] at a sample of which [`Model::load_into`] has said where the arm is at rest and what pulls at it.
    pub fn derivatives_under(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        seen: &Evaluation,
        wanted: &[(usize, usize)],
        mut visit: impl FnMut(usize, &Contribution),
    ) {
        let Evaluation { nominal: chain, loads, .. } = seen;
        let signals = Signals { arm: &self.arm, inputs, chain, loads };
        for (place, &(index, value)) in wanted.iter().enumerate() {
            if let Some(effect) = self.effects[..self.count].get(index).and_then(Option::as_ref) {
                visit(place, &effect.derivative(value, &signals, &memories.0[index]));
            }
        }
    }

    /// See [`crate::Effect::settle`], for all effects.
    pub fn settle(&self, inputs: &Inputs, memories: &mut Memories) {
        self.update(inputs, memories, AnyEffect::settle);
    }

    /// A settled pose after another one, `inputs.dt_s` later: what remembers the way of a joint settles, what remembers warmth follows the
    /// time; without a pose before (`dt_s` of 0) all settles.
    pub fn arrive(&self, inputs: &Inputs, memories: &mut Memories) {
        self.update(inputs, memories, |effect, inputs, memory| {
            if inputs.dt_s > 0.0 && !effect.spec().needs.contains(&Need::Direction) {
                effect.advance(inputs, memory);
            } else {
                effect.settle(inputs, memory);
            }
        });
    }

    /// See [`crate::Effect::advance`], for all effects. Forward simulation: advance, then evaluate.
    pub fn advance(&self, inputs: &Inputs, memories: &mut Memories) {
        self.update(inputs, memories, AnyEffect::advance);
    }

    /// See [`crate::Effect::follow`], for all effects. Correction: follow once per cycle, then solve.
    pub fn follow(&self, inputs: &Inputs, memories: &mut Memories) {
        self.update(inputs, memories, AnyEffect::follow);
    }

    /// Whether a joint hardens: then its law has a limit ([`Evaluation::beyond`]).
    #[must_use]
    pub fn hardens(&self) -> bool {
        self.hardens
    }

    /// The first joint whose load is at or above `sqrt(C/3D)`, C and D being the sums over that joint. Where gravity
    /// and wrench have compliances of their own, the smaller counts.
    fn beyond(&self, loads: &Loads) -> Option<Beyond> {
        (0..self.arm.count()).find_map(|joint| {
            let sum = |wanted: fn(&AnyEffect) -> bool| -> f64 {
                let here = self.effects().filter(|e| wanted(e) && e.joint() == Some(joint));
                here.map(|effect| effect.values()[0]).sum()
            };
            let cubic = sum(|e| matches!(e, AnyEffect::StiffnessHardening(_)));
            if cubic <= 0.0 {
                return None;
            }
            let of_gravity = sum(|e| matches!(e, AnyEffect::GravityCompliance(_)));
            let of_wrench = sum(|e| matches!(e, AnyEffect::LoadCompliance(_)));
            let halves = if of_gravity > 0.0 && of_wrench > 0.0 {
                of_gravity.min(of_wrench)
            } else {
                of_gravity + of_wrench
            };
            let compliance = sum(|e| matches!(e, AnyEffect::JointCompliance(_))) + halves;
            let (torque, limit) = (loads.torque(joint), libm::sqrt(compliance / (3.0 * cubic)));
            (torque.abs() >= limit).then_some(Beyond { joint, torque, limit })
        })
    }

    fn update(
        &self,
        inputs: &Inputs,
        memories: &mut Memories,
        step: impl Fn(&AnyEffect, &Inputs, &mut Memory),
    ) {
        for (effect, memory) in self.effects().zip(&mut memories.0) {
            step(effect, inputs, memory);
        }
    }
}
