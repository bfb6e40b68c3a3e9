//! Jacobian of the tool pose by the free parameters of a hypothesis, for each pose.
//!
//! Parameters of the loads act through all that follows the loads: what it adds is evaluated twice, under slightly smaller and larger loads.
//!
//! Promises: agrees with central differences of the whole model (property tests); one evaluation per loaded joint suffices.
//! Never: a delay, a lag, a mode; see [`crate::rides`].

use crate::hypothesis::{Hypothesis, much, named};
use crate::motion::Motion;
use physics::spec::{ActsOn, Need, Role, Spec};
use physics::{AnyEffect, Contribution, Evaluation, Inputs, JOINTS_MAX, Memories, Model};

/// Steps of a central difference, as shares of how large a number may be.
const STEP: f64 = 1e-4;

/// Whether an effect changes the loads or gives way under them.
pub(crate) fn is_about_loads(spec: &Spec) -> bool {
    let gives_way = spec.needs.contains(&Need::Masses) || spec.needs.contains(&Need::Wrench);
    spec.acts_on == ActsOn::Loads || gives_way
}

/// The free numbers of a hypothesis, ready to be asked.
pub(crate) struct Motions<'a> {
    model: &'a Model,
    /// Effect and value of each free number.
    wanted: Vec<(usize, usize)>,
    /// How large each of them may be.
    much: Vec<f64>,
    are_candidates: bool,
    yielding: Option<Yielding>,
}

impl<'a> Motions<'a> {
    pub(crate) fn of(hypothesis: &'a Hypothesis) -> Self {
        let wanted = hypothesis.free.iter().map(|free| (free.effect, free.value)).collect();
        let effects: Vec<&AnyEffect> = hypothesis.model.effects().collect();
        let much =
            hypothesis.free.iter().map(|free| much(effects[free.effect], free.value)).collect();
        Self { model: &hypothesis.model, wanted, much, are_candidates: false, yielding: None }
    }

    /// The same of candidates, which stand beside one another without being there.
    pub(crate) fn of_candidates(hypothesis: &'a Hypothesis) -> Self {
        Self { are_candidates: true, ..Self::of(hypothesis) }
    }

    /// At one pose, of which `seen` is what the model says, or at least [`Model::load_into`]; one motion per free number.
    pub(crate) fn at(
        &mut self,
        inputs: &Inputs,
        memories: &Memories,
        seen: &Evaluation,
    ) -> Vec<Motion> {
        let mut motions = vec![Motion::default(); self.wanted.len()];
        let mut on_loads = Vec::new();
        self.model.derivatives_under(inputs, memories, seen, &self.wanted, |place, change| {
            match Motion::of(&self.model.arm, seen, change) {
                Some(motion) => motions[place] = motion,
                None => on_loads.push((place, *change)),
            }
        });
        if !on_loads.is_empty() {
            let yielding = self.yielding.get_or_insert_with(|| {
                // A sag has gravity's direction, which no compliance has; candidates give way by compliances alone.
                let is_sag = |effect: &AnyEffect| matches!(effect, AnyEffect::GravitySag(_));
                let follows = |effect: &AnyEffect| {
                    is_about_loads(effect.spec()) || !self.are_candidates && is_sag(effect)
                };
                Yielding::of(self.model, follows)
            });
            yielding.stand_at(memories, seen);
            let bent = self.are_candidates.then(|| yielding.bent(inputs));
            let seen = bent.as_ref().unwrap_or(seen);
            // What one unit of load does is told by the change that loads most: others may do next to nothing here, as at a spring's dead point.
            let mut most = [0.0_f64; JOINTS_MAX];
            for (place, change) in &on_loads {
                if let Contribution::JointLoad { joint, load } = change {
                    most[*joint] = most[*joint].max(self.much[*place] * load.abs());
                }
            }
            for (joint, size) in most.iter().enumerate().filter(|(_, size)| **size > 0.0) {
                yielding.respond(joint, STEP * size, inputs, seen);
            }
            for (place, change) in &on_loads {
                motions[*place] = match *change {
                    // Where no load on a joint changes, nothing responds.
                    Contribution::JointLoad { joint, load } => {
                        yielding.responses[joint].unwrap_or_default().times(load)
                    }
                    _ => yielding.respond_to(change, STEP * self.much[*place], inputs, seen),
                };
            }
        }
        motions
    }
}

/// A model of what follows the loads, at one pose.
struct Yielding {
    model: Box<Model>,
    memories: Memories,
    /// Where each effect of the whole model stands here, if it follows the loads.
    places: Vec<Option<usize>>,
    /// How the tool moves per unit of load on a joint.
    responses: [Option<Motion>; JOINTS_MAX],
    /// The controller's geometry at the pose, and the loads as they were changed last.
    loaded: Box<Evaluation>,
    /// What each effect adds under slightly smaller loads.
    below: Vec<Contribution>,
}

impl Yielding {
    fn of(whole: &Model, follows: impl Fn(&AnyEffect) -> bool) -> Self {
        let mut model = Box::new(Model::nominal(whole.arm));
        let mut places = Vec::with_capacity(whole.effects().len());
        for effect in whole.effects() {
            let at_work = follows(effect)
                && (0..effect.values().len()).any(|value| {
                    let role = named(effect, value).map(|named| named.parameter.role);
                    role == Some(Role::Linear) && effect.values()[value] != 0.0
                });
            // It had room in the whole model.
            let stands = at_work && model.push(*effect).is_ok();
            places.push(stands.then(|| model.effects().len() - 1));
        }
        let (memories, loaded) = (Memories::default(), Box::default());
        let responses = [None; JOINTS_MAX];
        Self { model, memories, places, responses, loaded, below: Vec::new() }
    }

    /// `seen`: the geometry and the loads here.
    fn stand_at(&mut self, all: &Memories, seen: &Evaluation) {
        for (from, to) in self.places.iter().enumerate() {
            if let Some(to) = to {
                self.memories.take(*to, all, from);
            }
        }
        self.responses = [None; JOINTS_MAX];
        (self.loaded.nominal, self.loaded.loads) = (seen.nominal, seen.loads);
    }

    /// What gives way under the loads here, and the arm with that alone.
    fn bent(&self, inputs: &Inputs) -> Evaluation {
        let mut bent = *self.loaded;
        self.model.evaluate_under(inputs, &self.memories, &mut bent);
        bent
    }

    /// How the tool moves per unit of load on a joint.
    fn respond(&mut self, joint: usize, step: f64, inputs: &Inputs, seen: &Evaluation) {
        let here = seen.loads.gravity_torque[joint];
        let response = self.response(inputs, seen, step, |yielding, by| {
            yielding.loaded.loads.gravity_torque[joint] = here + by;
        });
        self.loaded.loads.gravity_torque[joint] = here;
        self.responses[joint] = Some(response);
    }

    /// How the tool moves per unit of a contribution to the loads that is no torque of a joint.
    fn respond_to(
        &mut self,
        change: &Contribution,
        step: f64,
        inputs: &Inputs,
        seen: &Evaluation,
    ) -> Motion {
        self.response(inputs, seen, step, |yielding, by| {
            let Self { model, memories, loaded, .. } = yielding;
            model.load_beside(inputs, memories, &change.times(by), loaded);
        })
    }

    /// How the tool moves per unit of a change of the loads, of which `load` brings in so many: the difference of what each effect adds under a little less
    /// and a little more of it, on the arm as `seen`.
    fn response(
        &mut self,
        inputs: &Inputs,
        seen: &Evaluation,
        step: f64,
        load: impl Fn(&mut Self, f64),
    ) -> Motion {
        load(self, -step);
        let mut below = std::mem::take(&mut self.below);
        below.clear();
        let Self { model, memories, loaded, .. } = &*self;
        model.contributions_under(inputs, memories, loaded, |_, added| below.push(*added));
        load(self, step);
        let Self { model, memories, loaded, .. } = &*self;
        let mut moved = Motion::default();
        model.contributions_under(inputs, memories, loaded, |place, above| {
            let change = above.minus(&below[place]).times(0.5 / step);
            let of_one = Motion::of(&model.arm, seen, &change);
            moved = moved.plus(&of_one.unwrap_or_default());
        });
        self.below = below;
        moved
    }
}
