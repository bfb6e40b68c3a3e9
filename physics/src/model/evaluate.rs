//! Evaluation of a model at one sample, with the lanes of the machine: nominal geometry, its loads,
//! contributions of the effects.
//!
//! The invariants of [`crate::model`] apply. No heap.

use crate::deviation::Contribution;
use crate::lanes::{Kernel, Lanes, run_widest};
use crate::loads::{LoadChange, Loads};
use crate::signals::{Inputs, Signals};
use crate::slopes::SlopeSums;
use crate::spec::ActsOn;
use crate::{Chain, Evaluation, JOINTS_MAX, Joints, Memories, Model};
use glam::DVec3;

impl Model {
    /// [`Model::evaluate`], written over an evaluation of a model of the same arm, or over the
    /// default: nothing is copied.
    pub fn evaluate_into(&self, inputs: &Inputs, memories: &Memories, evaluation: &mut Evaluation) {
        self.deviate_into(inputs, memories, evaluation, None);
        evaluation.set_real(&self.arm, inputs);
    }

    /// The first half of [`Model::evaluate_into`], without the actual geometry; with the effects'
    /// slopes, if requested.
    pub fn deviate_into(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        evaluation: &mut Evaluation,
        slopes: Option<&mut SlopeSums>,
    ) {
        run_widest(
            self.arm.count(),
            DeviationKernel { model: self, inputs, memories, evaluation, on: None, slopes },
        );
    }

    /// The same with the effects' slopes, for joints a step `on` from those of `evaluation`.
    pub fn deviate_on(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        evaluation: &mut Evaluation,
        on: &Joints,
        slopes: &mut SlopeSums,
    ) {
        let (on, slopes) = (Some(on), Some(slopes));
        run_widest(
            self.arm.count(),
            DeviationKernel { model: self, inputs, memories, evaluation, on, slopes },
        );
    }

    /// [`Model::evaluate_into`] for the geometry and loads in `evaluation`, computed by
    /// [`Model::load_into`] and possibly changed since.
    pub fn evaluate_under(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        evaluation: &mut Evaluation,
    ) {
        run_widest(
            self.arm.count(),
            ContributionsKernel { model: self, inputs, memories, evaluation },
        );
        evaluation.set_real(&self.arm, inputs);
    }

    /// The loads for the controller's geometry in `evaluation`, with `beside` as an additional change.
    pub fn load_beside(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        beside: &Contribution,
        evaluation: &mut Evaluation,
    ) {
        let mut change = LoadChange::default();
        change.add(beside);
        let Evaluation { nominal, loads, .. } = evaluation;
        self.load(inputs, nominal, memories, &mut change, loads);
    }

    /// The first part of [`Model::deviate_into`]: the nominal geometry and its loads.
    pub fn load_into(&self, inputs: &Inputs, memories: &Memories, evaluation: &mut Evaluation) {
        evaluation.nominal.set_nominal(&self.arm, &inputs.q);
        let (chain, loads) = (&evaluation.nominal, &mut evaluation.loads);
        self.load(inputs, chain, memories, &mut LoadChange::default(), loads);
    }

    #[inline(always)]
    fn deviate<S: Lanes>(
        &self,
        lanes: S,
        (inputs, memories): (&Inputs, &Memories),
        evaluation: &mut Evaluation,
        on: Option<&Joints>,
        slopes: Option<&mut SlopeSums>,
    ) {
        let Evaluation { nominal, loads, .. } = &mut *evaluation;
        nominal.set_nominal_in(lanes, &self.arm, &inputs.q, on);
        let change = &mut LoadChange::default();
        self.load_in(lanes, (inputs, nominal), memories, change, loads);
        self.sum_contributions(lanes, (inputs, memories), evaluation, slopes);
    }

    /// Contributions of the effects for given geometry and loads.
    #[inline(always)]
    fn sum_contributions<S: Lanes>(
        &self,
        lanes: S,
        (inputs, memories): (&Inputs, &Memories),
        evaluation: &mut Evaluation,
        mut slopes: Option<&mut SlopeSums>,
    ) {
        let Evaluation { nominal, loads, deviation, out_of_range, .. } = evaluation;
        let signals = Signals { arm: &self.arm, inputs, chain: nominal, loads };
        deviation.clear();
        deviation.base_turn = inputs.base_tilt;
        if let Some(sums) = &mut slopes {
            // Effects on the loads, and inertia, have other derivatives.
            let at_rest = loads.at_rest || loads.inertia_torque == [0.0; JOINTS_MAX];
            sums.begin(at_rest && !self.changes_loads, &self.laws);
        }
        self.laws.begin(lanes, &signals, deviation, slopes.as_deref_mut());
        for index in &self.others[..self.others_count] {
            let place = usize::from(*index);
            if let Some(effect) = &self.effects[place] {
                effect.act((&signals, &memories.0[place]), deviation, slopes.as_deref_mut());
            }
        }
        *out_of_range = if self.hardens { self.load_out_of_range(loads) } else { None };
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
        run_widest(
            self.arm.count(),
            LoadsKernel { model: self, inputs, chain, memories, change, loads },
        );
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
        let posture = (&self.arm, chain);
        loads.compute(lanes, posture, inputs.wrench_base, change);
        if self.changes_loads {
            loads.clear_inertia();
            let signals = Signals { arm: &self.arm, inputs, chain, loads };
            for (effect, memory) in self.effects().zip(memories.iter()) {
                if effect.spec().acts_on == ActsOn::Loads {
                    change.add(&effect.predict(&signals, memory));
                }
            }
            loads.compute(lanes, posture, inputs.wrench_base, change);
        }
        loads.compute_inertia(&self.arm, chain, inputs, change);
    }
}

struct DeviationKernel<'a> {
    model: &'a Model,
    inputs: &'a Inputs,
    memories: &'a Memories,
    evaluation: &'a mut Evaluation,
    on: Option<&'a Joints>,
    slopes: Option<&'a mut SlopeSums>,
}

impl Kernel for DeviationKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) {
        let Self { model, inputs, memories, evaluation, on, slopes } = self;
        model.deviate(lanes, (inputs, memories), evaluation, on, slopes);
    }
}

struct ContributionsKernel<'a> {
    model: &'a Model,
    inputs: &'a Inputs,
    memories: &'a Memories,
    evaluation: &'a mut Evaluation,
}

impl Kernel for ContributionsKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) {
        self.model.sum_contributions(lanes, (self.inputs, self.memories), self.evaluation, None);
    }
}

struct LoadsKernel<'a> {
    model: &'a Model,
    inputs: &'a Inputs,
    chain: &'a Chain,
    memories: &'a Memories,
    change: &'a mut LoadChange,
    loads: &'a mut Loads,
}

impl Kernel for LoadsKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) {
        let Self { model, inputs, chain, memories, change, loads } = self;
        model.load_in(lanes, (inputs, chain), memories, change, loads);
    }
}
