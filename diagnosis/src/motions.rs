//! Jacobian of the tool pose by the free parameters of a hypothesis, for each pose.
//!
//! Parameters of the loads act through all compliances: the arm is evaluated twice, with slightly smaller and larger loads.
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
        let here = (inputs, memories);
        self.model.derivatives_under(here, seen, &self.wanted, |place, change| {
            match Motion::of(&self.model.arm, seen, change) {
                Some(motion) => motions[place] = motion,
                None => on_loads.push((place, *change)),
            }
        });
        if !on_loads.is_empty() {
            let yielding = self.yielding.get_or_insert_with(|| {
                // Waves stand among the candidates at full size, and feel no load.
                let counts = |spec: &Spec| !self.are_candidates || is_about_loads(spec);
                Yielding::of(self.model, counts)
            });
            yielding.stand_at(memories, seen);
            // What one unit of load does is told by the change that loads most: others may do next to nothing here, as at a spring's dead point.
            let mut most = [0.0_f64; JOINTS_MAX];
            for (place, change) in &on_loads {
                if let Contribution::JointLoad { joint, load } = change {
                    most[*joint] = most[*joint].max(self.much[*place] * load.abs());
                }
            }
            for (joint, size) in most.iter().enumerate().filter(|(_, size)| **size > 0.0) {
                yielding.respond(joint, STEP * size, inputs);
            }
            for (place, change) in &on_loads {
                motions[*place] = yielding.motion(self.model, self.wanted[*place], change, inputs);
            }
        }
        motions
    }
}

/// A model of what is at work, at one pose.
struct Yielding {
    model: Box<Model>,
    memories: Memories,
    /// Where each effect of the whole model stands here, if it is at work.
    places: Vec<Option<usize>>,
    /// How the tool moves per unit of load on a joint.
    responses: [Option<Motion>; JOINTS_MAX],
    /// What the model says; the geometry stands as it does at the pose, and the loads do until an effect is changed.
    seen: Box<Evaluation>,
}

impl Yielding {
    fn of(whole: &Model, counts: impl Fn(&Spec) -> bool) -> Self {
        let mut model = Box::new(Model::nominal(whole.arm));
        let mut places = Vec::with_capacity(whole.effects().len());
        for effect in whole.effects() {
            let at_work = counts(effect.spec())
                && (0..effect.values().len()).any(|value| {
                    let role = named(effect, value).map(|named| named.parameter.role);
                    role == Some(Role::Linear) && effect.values()[value] != 0.0
                });
            // It had room in the whole model.
            let stands = at_work && model.push(*effect).is_ok();
            places.push(stands.then(|| model.effects().len() - 1));
        }
        let (memories, seen) = (Memories::default(), Box::default());
        Self { model, memories, places, responses: [None; JOINTS_MAX], seen }
    }

    /// `seen`: the geometry and the loads here.
    fn stand_at(&mut self, all: &Memories, seen: &Evaluation) {
        for (from, to) in self.places.iter().enumerate() {
            if let Some(to) = to {
                self.memories.take(*to, all, from);
            }
        }
        self.responses = [None; JOINTS_MAX];
        (self.seen.nominal, self.seen.loads) = (seen.nominal, seen.loads);
    }

    /// How the tool moves per unit of load on a joint, from a little less of it and a little more.
    fn respond(&mut self, joint: usize, step: f64, inputs: &Inputs) {
        let here = self.seen.loads.gravity_torque[joint];
        let mut at = |load: f64| {
            self.seen.loads.gravity_torque[joint] = load;
            self.model.evaluate_under(inputs, &self.memories, &mut self.seen);
            (self.seen.real.base_from_tool, self.seen.deviation.joints)
        };
        let motion = Motion::between(&at(here - step), &at(here + step), 2.0 * step);
        self.seen.loads.gravity_torque[joint] = here;
        self.responses[joint] = Some(motion);
    }

    /// The motion per unit of a value of an effect on the loads; `change` is what it adds to them. All that gives way does so in proportion.
    fn motion(
        &mut self,
        whole: &Model,
        (effect, value): (usize, usize),
        change: &Contribution,
        inputs: &Inputs,
    ) -> Motion {
        let Some(own) = whole.effects().nth(effect) else { return Motion::default() };
        let place = self.places[effect];
        let Contribution::JointLoad { joint, load } = *change else {
            return self.by_difference(own, place, value, inputs);
        };
        // Where no load on a joint changes, nothing responds.
        self.responses[joint].map_or_else(Motion::default, |response| response.times(load))
    }

    /// `place`: where the effect stands here; none: it takes the place behind all that do.
    fn by_difference(
        &mut self,
        own: &AnyEffect,
        place: Option<usize>,
        value: usize,
        inputs: &Inputs,
    ) -> Motion {
        let spare = self.places.iter().flatten().count();
        let place = place.unwrap_or(spare);
        if place == self.model.effects().len() && self.model.push(*own).is_err() {
            return Motion::default();
        }
        let stands = own.values()[value];
        let step = STEP * much(own, value).max(stands.abs());
        let mut at = |value_there: f64| {
            self.model.change(place, |effect| {
                *effect = *own;
                effect.values_mut()[value] = value_there;
            });
            self.model.evaluate_on(inputs, &self.memories, &mut self.seen);
            (self.seen.real.base_from_tool, self.seen.deviation.joints)
        };
        let motion = Motion::between(&at(stands - step), &at(stands + step), 2.0 * step);
        self.model.change(place, |effect| {
            *effect = *own;
            // What is only a guest here does nothing to the next.
            if place == spare {
                effect.values_mut().fill(0.0);
            }
        });
        motion
    }
}
