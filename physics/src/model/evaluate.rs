//! Evaluation of a model at one sample, with the lanes of the machine: nominal geometry, its loads,
//! contributions of the effects.
//!
//! The invariants of [`crate::model`] apply. No heap.

use crate::deviation::Contribution;
use crate::lanes::{Lanes, Work, widest};
use crate::loads::{LoadChange, Loads};
use crate::signals::{Inputs, Signals};
use crate::slopes::Told;
use crate::spec::ActsOn;
use crate::{Chain, Evaluation, JOINTS_MAX, Joints, Memories, Model};
use glam::DVec3;

impl Model {
    /// [`Model::evaluate`], written over an evaluation of a model of the same arm, or over the
    /// default: nothing is copied.
    pub fn evaluate_into(&self, inputs: &Inputs, memories: &Memories, seen: &mut Evaluation) {
        self.deviate_into(inputs, memories, seen, None);
        seen.stand(&self.arm, inputs);
    }

    /// The first half of [`Model::evaluate_into`], without the actual geometry; with the effects'
    /// slopes, if requested.
    pub fn deviate_into(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        seen: &mut Evaluation,
        told: Option<&mut Told>,
    ) {
        widest(self.arm.count(), Deviate { model: self, inputs, memories, seen, on: None, told });
    }

    /// The same with the effects' slopes, for joints a step `on` from those of `seen`.
    pub fn deviate_on(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        seen: &mut Evaluation,
        on: &Joints,
        told: &mut Told,
    ) {
        let (on, told) = (Some(on), Some(told));
        widest(self.arm.count(), Deviate { model: self, inputs, memories, seen, on, told });
    }

    /// [`Model::evaluate_into`] for the geometry and loads in `seen`, computed by
    /// [`Model::load_into`] and possibly changed since.
    pub fn evaluate_under(&self, inputs: &Inputs, memories: &Memories, seen: &mut Evaluation) {
        widest(self.arm.count(), Bend { model: self, inputs, memories, seen });
        seen.stand(&self.arm, inputs);
    }

    /// The loads for the controller's geometry in `seen`, with `beside` as an additional change.
    pub fn load_beside(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        beside: &Contribution,
        seen: &mut Evaluation,
    ) {
        let mut change = LoadChange::default();
        change.add(beside);
        let Evaluation { nominal, loads, .. } = seen;
        self.load(inputs, nominal, memories, &mut change, loads);
    }

    /// The first part of [`Model::deviate_into`]: the nominal geometry and its loads.
    pub fn load_into(&self, inputs: &Inputs, memories: &Memories, seen: &mut Evaluation) {
        seen.nominal.stand(&self.arm, &inputs.q);
        let (chain, loads) = (&seen.nominal, &mut seen.loads);
        self.load(inputs, chain, memories, &mut LoadChange::default(), loads);
    }

    #[inline(always)]
    fn deviate<S: Lanes>(
        &self,
        lanes: S,
        (inputs, memories): (&Inputs, &Memories),
        seen: &mut Evaluation,
        on: Option<&Joints>,
        told: Option<&mut Told>,
    ) {
        let Evaluation { nominal, loads, .. } = &mut *seen;
        nominal.stand_in(lanes, &self.arm, &inputs.q, on);
        let change = &mut LoadChange::default();
        self.load_in(lanes, (inputs, nominal), memories, change, loads);
        self.bend(lanes, (inputs, memories), seen, told);
    }

    /// Contributions of the effects for given geometry and loads.
    #[inline(always)]
    fn bend<S: Lanes>(
        &self,
        lanes: S,
        (inputs, memories): (&Inputs, &Memories),
        seen: &mut Evaluation,
        mut told: Option<&mut Told>,
    ) {
        let Evaluation { nominal, loads, deviation, beyond, .. } = seen;
        let signals = Signals { arm: &self.arm, inputs, chain: nominal, loads };
        deviation.clear();
        deviation.base_turn = inputs.base_tilt;
        if let Some(told) = &mut told {
            // Effects on the loads, and inertia, have other derivatives.
            let at_rest = loads.at_rest || loads.inertia_torque == [0.0; JOINTS_MAX];
            told.begin(at_rest && !self.changes_loads, &self.laws);
        }
        self.laws.begin(lanes, &signals, deviation, told.as_deref_mut());
        for index in &self.others[..self.others_count] {
            let place = usize::from(*index);
            if let Some(effect) = &self.effects[place] {
                effect.act((&signals, &memories.0[place]), deviation, told.as_deref_mut());
            }
        }
        *beyond = if self.hardens { self.beyond(loads) } else { None };
    }

    /// The loads, including changes by effects, which are zero before.
    pub(crate) fn load(
        &self,
        inputs: &Inputs,
        chain: &Chain,
        memories: &Memories,
        change: &mut LoadChange,
        loads: &mut Loads,
    ) {
        widest(self.arm.count(), Load { model: self, inputs, chain, memories, change, loads });
    }

    #[inline(always)]
    fn load_in<S: Lanes>(
        &self,
        lanes: S,
        (inputs, chain): (&Inputs, &Chain),
        memories: &Memories,
        change: &mut LoadChange,
        loads: &mut Loads,
    ) {
        if inputs.base_tilt != DVec3::ZERO {
            change.add(&Contribution::GravityTurn { turn: inputs.base_tilt });
        }
        let stands = (&self.arm, chain);
        loads.carry(lanes, stands, inputs.wrench_base, change);
        if self.changes_loads {
            loads.forget_inertia();
            let signals = Signals { arm: &self.arm, inputs, chain, loads };
            for (effect, memory) in self.effects().zip(memories.iter()) {
                if effect.spec().acts_on == ActsOn::Loads {
                    change.add(&effect.predict(&signals, memory));
                }
            }
            loads.carry(lanes, stands, inputs.wrench_base, change);
        }
        loads.carry_inertia(&self.arm, chain, inputs, change);
    }
}

struct Deviate<'a> {
    model: &'a Model,
    inputs: &'a Inputs,
    memories: &'a Memories,
    seen: &'a mut Evaluation,
    on: Option<&'a Joints>,
    told: Option<&'a mut Told>,
}

impl Work for Deviate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) {
        let Self { model, inputs, memories, seen, on, told } = self;
        model.deviate(lanes, (inputs, memories), seen, on, told);
    }
}

struct Bend<'a> {
    model: &'a Model,
    inputs: &'a Inputs,
    memories: &'a Memories,
    seen: &'a mut Evaluation,
}

impl Work for Bend<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) {
        self.model.bend(lanes, (self.inputs, self.memories), self.seen, None);
    }
}

struct Load<'a> {
    model: &'a Model,
    inputs: &'a Inputs,
    chain: &'a Chain,
    memories: &'a Memories,
    change: &'a mut LoadChange,
    loads: &'a mut Loads,
}

impl Work for Load<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) {
        let Self { model, inputs, chain, memories, change, loads } = self;
        model.load_in(lanes, (inputs, chain), memories, change, loads);
    }
}
