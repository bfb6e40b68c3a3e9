//! The sum of the effects: actual position of the tool.
//!
//! [`Model::evaluate`] is `FK_real(q + δθ(q, W, T))`, with loads and effects evaluated on the
//! nominal geometry at `q` (see docs/decisions/0002); effects on the loads are applied first, all
//! others see the changed loads; [`Model::check`] verifies dependencies between effects. The
//! inverse problem is solved by the corrector.

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
    /// The nominal arm.
    pub arm: Arm,
    effects: [Option<AnyEffect>; EFFECTS_MAX],
    count: usize,
    changes_loads: bool,
    hardens: bool,
    /// The sum of effects that are laws of their joint, and the indices of all others.
    laws: Laws,
    others: [u8; EFFECTS_MAX],
    others_count: usize,
}

const _: () = assert!(EFFECTS_MAX <= 1 << u8::BITS, "a place of an effect fits into a byte");

/// Memories of the effects of one model in one run, in the order of [`Model::effects`].
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

    /// Copies the memory of effect `from` of `other` to effect `to`.
    pub fn take(&mut self, to: usize, other: &Self, from: usize) {
        if let (Some(slot), Some(memory)) = (self.0.get_mut(to), other.0.get(from)) {
            *slot = *memory;
        }
    }
}

/// Why effects do not form a model. Joints are 1-based here, as in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ModelError {
    /// More effects than [`EFFECTS_MAX`].
    #[error("a model has at most {EFFECTS_MAX} effects")]
    TooManyEffects,
    /// A `stiffness_hardening` without a compliance at its joint.
    #[error("joint {joint}: `stiffness_hardening` needs a linear compliance on the same joint")]
    HardensNothing {
        /// 1-based.
        joint: usize,
    },
    /// A compliance and one of its two parts.
    #[error(
        "joint {joint}: `joint_compliance` covers `gravity_compliance` and `load_compliance` with one parameter \
         and cannot be combined with either"
    )]
    CompliantTwice {
        /// 1-based.
        joint: usize,
    },
}

/// A load outside the physical range of a joint's stiffening law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadOutOfRange {
    /// 0-based joint.
    pub joint: usize,
    /// The load, Nm or N.
    pub torque: f64,
    /// Largest magnitude of the load for which the law holds, Nm or N.
    pub limit: f64,
}

/// Results of the model for one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evaluation {
    /// The controller's geometry.
    pub nominal: Chain,
    /// The loads on this geometry.
    pub loads: Loads,
    /// Sum of the effects' contributions.
    pub deviation: Deviation,
    /// The actual geometry.
    pub real: Chain,
    /// The first joint whose load is outside the range of its `stiffness_hardening`: the evaluation
    /// is then not valid.
    pub out_of_range: Option<LoadOutOfRange>,
}

impl Evaluation {
    /// The second half of [`Model::evaluate_into`]: the actual geometry.
    pub fn set_real(&mut self, arm: &Arm, inputs: &Inputs) {
        self.real.set_deviated(arm, &inputs.q, &self.deviation, &self.nominal);
    }
}

fn acts_on_loads(effect: &AnyEffect) -> bool {
    effect.spec().acts_on == ActsOn::Loads
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

    /// An arm with compatible effects.
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

    /// Checks whether the effects are compatible; used by [`Model::new`].
    ///
    /// # Errors
    /// The first joint at which they are not.
    pub fn check(&self) -> Result<(), ModelError> {
        for i in 0..self.arm.count() {
            let joint = i + 1;
            let has = |kind| self.effects().any(|e| e.spec().kind == kind && e.joint() == Some(i));
            let halves = has("gravity_compliance") || has("load_compliance");
            if has("joint_compliance") && halves {
                return Err(ModelError::CompliantTwice { joint });
            }
            let mut hardenings =
                self.effects().filter(|e| e.is_hardening() && e.joint() == Some(i));
            if hardenings.any(|hardening| !self.effects().any(|e| hardening.hardens(e))) {
                return Err(ModelError::HardensNothing { joint });
            }
        }
        Ok(())
    }

    /// Adds an effect; [`Model::check`] verifies whether it is compatible with the others.
    ///
    /// # Errors
    /// More than [`EFFECTS_MAX`] effects.
    pub fn push(&mut self, effect: AnyEffect) -> Result<(), ModelError> {
        let slot = self.effects.get_mut(self.count).ok_or(ModelError::TooManyEffects)?;
        self.changes_loads |= acts_on_loads(&effect);
        self.hardens |= effect.is_hardening();
        *slot = Some(effect);
        self.count += 1;
        self.assign_to_laws(self.count - 1);
        Ok(())
    }

    /// The effects, in the order in which they were added.
    pub fn effects(&self) -> impl ExactSizeIterator<Item = &AnyEffect> {
        // All slots below `count` are occupied: `flatten` would work too, but without the exact
        // length.
        self.effects[..self.count].iter().map(|slot| match slot {
            Some(effect) => effect,
            None => unreachable!("slots below count are taken"),
        })
    }

    /// Changes effect `index`; returns the result of the change, `None` if there is no such effect.
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
            (0..self.count).for_each(|index| self.assign_to_laws(index));
        }
        if !same_kind {
            let any = |is: fn(&AnyEffect) -> bool| self.effects().any(is);
            (self.changes_loads, self.hardens) = (any(acts_on_loads), any(AnyEffect::is_hardening));
        }
        Some(answer)
    }

    /// Adds effect `index` to the laws of joints, or to the other effects.
    fn assign_to_laws(&mut self, index: usize) {
        let law = self.effects[index].as_ref().and_then(|e| e.joint().zip(e.law()));
        if !law.is_some_and(|(joint, law)| self.laws.add(joint, &law)) {
            self.others[self.others_count] = index as u8;
            self.others_count += 1;
        }
    }

    /// Evaluates one sample with these memories, which are not changed.
    pub fn evaluate(&self, inputs: &Inputs, memories: &Memories) -> Evaluation {
        let mut evaluation = Evaluation::default();
        self.evaluate_into(inputs, memories, &mut evaluation);
        evaluation
    }

    /// Calls `visit` with the index and contribution of each effect at one sample.
    pub fn contributions(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        visit: impl FnMut(usize, &Contribution),
    ) {
        let mut evaluation = Evaluation::default();
        self.load_into(inputs, memories, &mut evaluation);
        self.contributions_under(inputs, memories, &evaluation, visit);
    }

    /// [`Model::contributions`] for the geometry and loads in `evaluation`, computed by [`Model::load_into`] and possibly changed since.
    pub fn contributions_under(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        evaluation: &Evaluation,
        mut visit: impl FnMut(usize, &Contribution),
    ) {
        let Evaluation { nominal: chain, loads, .. } = evaluation;
        let signals = Signals { arm: &self.arm, inputs, chain, loads };
        for (index, (effect, memory)) in self.effects().zip(&memories.0).enumerate() {
            visit(index, &effect.predict(&signals, memory));
        }
    }

    /// Calls `visit` with each place in `wanted` and the derivative of that effect's contribution
    /// by that value; `wanted` names places in [`Model::effects`] and values of these.
    pub fn derivatives(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        wanted: &[(usize, usize)],
        visit: impl FnMut(usize, &Contribution),
    ) {
        let mut evaluation = Evaluation::default();
        self.load_into(inputs, memories, &mut evaluation);
        self.derivatives_under(inputs, memories, &evaluation, wanted, visit);
    }

    /// [`Model::derivatives`] for the nominal geometry and loads that [`Model::load_into`]
    /// computed.
    pub fn derivatives_under(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        evaluation: &Evaluation,
        wanted: &[(usize, usize)],
        mut visit: impl FnMut(usize, &Contribution),
    ) {
        let Evaluation { nominal: chain, loads, .. } = evaluation;
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

    /// A settled pose after another one, `inputs.dt_s` later: memories of motion settle, thermal
    /// memories advance by the time; without a previous pose (`dt_s` of 0) all settle.
    pub fn settle_pose(&self, inputs: &Inputs, memories: &mut Memories) {
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

    /// Whether a joint has a hardening law, whose range is limited ([`Evaluation::out_of_range`]).
    #[must_use]
    pub fn has_hardening(&self) -> bool {
        self.hardens
    }

    /// The first joint whose load is at or above `sqrt(C/3D)`, C and D being the sums over that
    /// joint. If gravity and wrench have separate compliances, the smaller one is used.
    fn load_out_of_range(&self, loads: &Loads) -> Option<LoadOutOfRange> {
        (0..self.arm.count()).find_map(|joint| {
            let sum = |wanted: fn(&AnyEffect) -> bool| -> f64 {
                let at_joint = self.effects().filter(|e| wanted(e) && e.joint() == Some(joint));
                at_joint.map(|effect| effect.values()[0]).sum()
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
            (torque.abs() >= limit).then_some(LoadOutOfRange { joint, torque, limit })
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
