//! Jacobian of the tool pose by the free parameters of a hypothesis, for each pose.
//!
//! Load parameters act through all load-dependent effects: these are evaluated twice, under slightly smaller and larger loads.
//!
//! Agrees with central differences of the whole model (property tests); one evaluation per loaded joint suffices. Delay, lag and modes are treated in
//! [`crate::path_dynamics`].

use crate::hypothesis::{Hypothesis, parameter_key, plausible_size};
use crate::tool_motion::{DeviatedArm, ToolMotion};
use physics::spec::{ActsOn, Need, Role, Spec};
use physics::{AnyEffect, Contribution, Evaluation, Inputs, JOINTS_MAX, Memories, Model};

/// Steps of a central difference, as fractions of the largest plausible value.
const STEP: f64 = 1e-4;

/// Whether an effect changes the loads or depends on them.
pub(crate) fn changes_or_uses_loads(spec: &Spec) -> bool {
    let needs_loads = spec.needs.contains(&Need::Masses) || spec.needs.contains(&Need::Wrench);
    spec.acts_on == ActsOn::Loads || needs_loads
}

/// The free parameters of a hypothesis, prepared for evaluation at many poses.
pub(crate) struct ToolJacobian<'a> {
    model: &'a Model,
    /// Effect and parameter index of each free parameter.
    wanted: Vec<(usize, usize)>,
    /// Largest plausible value of each.
    sizes: Vec<f64>,
    are_candidates: bool,
    yielding: Option<LoadResponse>,
}

impl<'a> ToolJacobian<'a> {
    pub(crate) fn of(hypothesis: &'a Hypothesis) -> Self {
        let wanted = hypothesis.free.iter().map(|free| (free.effect, free.value)).collect();
        let effects: Vec<&AnyEffect> = hypothesis.model.effects().collect();
        let sizes = hypothesis
            .free
            .iter()
            .map(|free| plausible_size(effects[free.effect], free.value))
            .collect();
        Self { model: &hypothesis.model, wanted, sizes, are_candidates: false, yielding: None }
    }

    /// The same for candidates: each is evaluated alone, not together with the others.
    pub(crate) fn of_candidates(hypothesis: &'a Hypothesis) -> Self {
        Self { are_candidates: true, ..Self::of(hypothesis) }
    }

    /// Motions at one pose, one per free parameter; `evaluation` is that of the model, or at least the result of [`Model::load_into`].
    pub(crate) fn at(
        &mut self,
        inputs: &Inputs,
        memories: &Memories,
        evaluation: &Evaluation,
    ) -> Vec<ToolMotion> {
        let mut motions = vec![ToolMotion::default(); self.wanted.len()];
        let mut on_loads = Vec::new();
        let deviated = DeviatedArm::of(&self.model.arm, evaluation);
        self.model.derivatives_under(
            inputs,
            memories,
            evaluation,
            &self.wanted,
            |place, change| match deviated.motion(change) {
                Some(motion) => motions[place] = motion,
                None => on_loads.push((place, *change)),
            },
        );
        if !on_loads.is_empty() {
            let yielding = self.yielding.get_or_insert_with(|| {
                // Gravity sag depends on the direction of gravity like no compliance; among candidates only compliances respond to loads.
                let is_sag = |effect: &AnyEffect| matches!(effect, AnyEffect::GravitySag(_));
                let follows = |effect: &AnyEffect| {
                    changes_or_uses_loads(effect.spec()) || !self.are_candidates && is_sag(effect)
                };
                LoadResponse::of(self.model, follows)
            });
            yielding.set_pose(memories, evaluation);
            let bent = self.are_candidates.then(|| yielding.deflected(inputs));
            let bent = bent.as_ref().map(|bent| DeviatedArm::of(&self.model.arm, bent));
            let deviated = bent.as_ref().unwrap_or(&deviated);
            // The response to a unit load is computed with the step of the largest change: others may be nearly zero here, as at the dead point of a
            // spring.
            let mut most = [0.0_f64; JOINTS_MAX];
            for (place, change) in &on_loads {
                if let Contribution::JointLoad { joint, load } = change {
                    most[*joint] = most[*joint].max(self.sizes[*place] * load.abs());
                }
            }
            for (joint, size) in most.iter().enumerate().filter(|(_, size)| **size > 0.0) {
                yielding.compute_joint_response(joint, STEP * size, inputs, deviated);
            }
            for (place, change) in &on_loads {
                motions[*place] = match *change {
                    // A joint without a change of load has no response.
                    Contribution::JointLoad { joint, load } => {
                        yielding.responses[joint].unwrap_or_default().scaled(load)
                    }
                    _ => yielding.response_to(change, STEP * self.sizes[*place], inputs, deviated),
                };
            }
        }
        motions
    }
}

/// The load-dependent effects of a model, at one pose.
struct LoadResponse {
    model: Box<Model>,
    memories: Memories,
    /// Index of each effect of the whole model in this one, if it depends on the loads.
    places: Vec<Option<usize>>,
    /// Motion of the tool per unit of load on each joint.
    responses: [Option<ToolMotion>; JOINTS_MAX],
    /// The nominal chain at the pose, and the loads as last changed.
    loaded: Box<Evaluation>,
    /// Contribution of each effect under slightly smaller loads.
    below: Vec<Contribution>,
}

impl LoadResponse {
    fn of(whole: &Model, follows: impl Fn(&AnyEffect) -> bool) -> Self {
        let mut model = Box::new(Model::nominal(whole.arm));
        let mut places = Vec::with_capacity(whole.effects().len());
        for effect in whole.effects() {
            let at_work = follows(effect)
                && (0..effect.values().len()).any(|value| {
                    let role = parameter_key(effect, value).map(|named| named.parameter.role);
                    role == Some(Role::Linear) && effect.values()[value] != 0.0
                });
            // Cannot fail: the whole model has room for it.
            let is_included = at_work && model.push(*effect).is_ok();
            places.push(is_included.then(|| model.effects().len() - 1));
        }
        let (memories, loaded) = (Memories::default(), Box::default());
        let responses = [None; JOINTS_MAX];
        Self { model, memories, places, responses, loaded, below: Vec::new() }
    }

    /// Moves to a pose; `evaluation` contains its chain and loads.
    fn set_pose(&mut self, all: &Memories, evaluation: &Evaluation) {
        for (from, to) in self.places.iter().enumerate() {
            if let Some(to) = to {
                self.memories.take(*to, all, from);
            }
        }
        self.responses = [None; JOINTS_MAX];
        (self.loaded.nominal, self.loaded.loads) = (evaluation.nominal, evaluation.loads);
    }

    /// The deflection under the present loads, and the arm with only that.
    fn deflected(&self, inputs: &Inputs) -> Evaluation {
        let mut bent = *self.loaded;
        self.model.evaluate_under(inputs, &self.memories, &mut bent);
        bent
    }

    /// Motion of the tool per unit of load on a joint.
    fn compute_joint_response(
        &mut self,
        joint: usize,
        step: f64,
        inputs: &Inputs,
        deviated: &DeviatedArm<'_>,
    ) {
        let loaded_torque = deviated.evaluation.loads.gravity_torque[joint];
        let response = self.response(inputs, deviated, step, |yielding, by| {
            yielding.loaded.loads.gravity_torque[joint] = loaded_torque + by;
        });
        self.loaded.loads.gravity_torque[joint] = loaded_torque;
        self.responses[joint] = Some(response);
    }

    /// Motion of the tool per unit of a contribution to the loads other than a joint torque.
    fn response_to(
        &mut self,
        change: &Contribution,
        step: f64,
        inputs: &Inputs,
        deviated: &DeviatedArm<'_>,
    ) -> ToolMotion {
        self.response(inputs, deviated, step, |yielding, by| {
            let Self { model, memories, loaded, .. } = yielding;
            model.load_beside(inputs, memories, &change.times(by), loaded);
        })
    }

    /// Motion of the tool per unit of a change of the loads, which `load` applies by a given amount: difference of the contributions of all effects
    /// under slightly smaller and larger loads, on the arm `deviated`.
    fn response(
        &mut self,
        inputs: &Inputs,
        deviated: &DeviatedArm<'_>,
        step: f64,
        load: impl Fn(&mut Self, f64),
    ) -> ToolMotion {
        load(self, -step);
        let mut below = std::mem::take(&mut self.below);
        below.clear();
        let Self { model, memories, loaded, .. } = &*self;
        model.contributions_under(inputs, memories, loaded, |_, added| below.push(*added));
        load(self, step);
        let Self { model, memories, loaded, .. } = &*self;
        let mut moved = ToolMotion::default();
        model.contributions_under(inputs, memories, loaded, |place, above| {
            // Most effects depend on the load of one joint only.
            if *above == below[place] {
                return;
            }
            let change = above.minus(&below[place]).times(0.5 / step);
            moved = moved.plus(&deviated.motion(&change).unwrap_or_default());
        });
        self.below = below;
        moved
    }
}
