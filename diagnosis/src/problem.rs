//! The campaign against a hypothesis: every reading's residual and derivatives, reduced to a triangle.
//!
//! Columns are the surroundings' fitted numbers, then the hypothesis' free ones. Priors stand as rows beside the data.
//!
//! Promises: poses are visited in order, memory of effects follows them, so the sum is the same on any machine of one kind.
//! Never: a step; see [`crate::minimise`].

use crate::campaign::{Arrival, Campaign};
use crate::colour::{Filter, stream};
use crate::hypothesis::{Hypothesis, much};
use crate::motion::Motion;
use crate::residual::{Columns, Rows};
use crate::surroundings::{Number, Surroundings};
use crate::triangle::Triangle;
use physics::spec::ActsOn;
use physics::{Evaluation, Inputs, Memories, Model};

/// What a fit changes.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub(crate) surroundings: Surroundings,
    pub(crate) hypothesis: Hypothesis,
}

impl State {
    pub(crate) fn width(&self) -> usize {
        self.surroundings.numbers().len() + self.hypothesis.free.len()
    }

    /// One entry of `step` per column.
    pub(crate) fn stepped(&self, step: &[f64]) -> Self {
        let (first, second) = step.split_at(self.surroundings.numbers().len());
        Self {
            surroundings: self.surroundings.stepped(first),
            hypothesis: self.hypothesis.stepped(second),
        }
    }

    /// The lowest step that each of these columns may take.
    pub(crate) fn lowest(&self, active: &[usize]) -> Vec<f64> {
        let first = self.surroundings.numbers().len();
        let lowest = self.hypothesis.lowest();
        let of = |column: &usize| column.checked_sub(first).map(|k| lowest[k]);
        active.iter().map(|column| of(column).unwrap_or(f64::NEG_INFINITY)).collect()
    }

    /// How large each column's number may be: the width on which it counts as hardly known.
    pub(crate) fn widths(&self) -> Vec<f64> {
        let surroundings = self.surroundings.numbers().into_iter().map(Number::much);
        surroundings.chain(self.hypothesis.widths()).collect()
    }
}

/// A reading at its place in the campaign.
pub(crate) struct At<'a> {
    /// Place in [`Campaign::poses`].
    pub(crate) pose: usize,
    /// Place among all readings of the campaign.
    pub(crate) reading: usize,
    pub(crate) rows: &'a Rows,
    /// One per free number of the hypothesis; empty where none were asked for.
    pub(crate) motions: &'a [Motion],
    pub(crate) instrument: usize,
    /// Which run of readings of one kind it belongs to.
    pub(crate) stream: usize,
}

/// Which readings count, and how much.
#[derive(Clone, Debug)]
pub(crate) struct Weighing {
    /// Poses that take part.
    pub(crate) used: Vec<bool>,
    /// Weight of each reading, 0 to 1.
    pub(crate) weights: Vec<f64>,
    /// Factor on each instrument's stated noise.
    pub(crate) factors: Vec<f64>,
}

impl Weighing {
    pub(crate) fn equal(campaign: &Campaign, used: &[bool]) -> Self {
        Self {
            used: used.to_vec(),
            weights: vec![1.0; campaign.readings()],
            factors: vec![1.0; campaign.instruments.len()],
        }
    }

    /// What a reading's rows are to be multiplied with; zero where its pose takes no part.
    pub(crate) fn scale(&self, at: &At<'_>) -> f64 {
        if self.used[at.pose] {
            self.weights[at.reading].sqrt() / self.factors[at.instrument]
        } else {
            0.0
        }
    }
}

/// What a visit looks at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Look<'a> {
    /// Poses that are looked at; none: all.
    pub(crate) used: Option<&'a [bool]>,
    /// Whether the motions are wanted.
    pub(crate) derivatives: bool,
}

/// Visits the readings in order.
pub(crate) fn visit(
    campaign: &Campaign,
    state: &State,
    wanted: Look<'_>,
    mut look: impl FnMut(&At<'_>),
) {
    let columns = Columns::of(&state.surroundings);
    let mut motions = Vec::new();
    let mut first = Vec::with_capacity(campaign.poses.len());
    let mut readings = 0;
    for pose in &campaign.poses {
        first.push(readings);
        readings += pose.seen.len();
    }
    follow(&state.hypothesis.model, campaign, wanted.used, |pose, seen, memories| {
        let derivatives = wanted.derivatives;
        let inputs = &campaign.poses[pose].inputs;
        if derivatives {
            motions = motions_of(&state.hypothesis, inputs, memories, seen);
        }
        for (reading, observation) in (first[pose]..).zip(&campaign.poses[pose].seen) {
            let surroundings = &state.surroundings;
            let rows = Rows::of(observation, seen, &inputs.q, surroundings, &columns);
            let instrument = observation.instrument;
            let stream = stream(&observation.reading);
            look(&At { pose, reading, rows: &rows, motions: &motions, instrument, stream });
        }
    });
}

/// Lets the model's memory follow the campaign and shows the poses that are used; all where nothing is said.
pub(crate) fn follow(
    model: &Model,
    campaign: &Campaign,
    used: Option<&[bool]>,
    mut look: impl FnMut(usize, &Evaluation, &Memories),
) {
    let mut memories = Memories::default();
    for (index, pose) in campaign.poses.iter().enumerate() {
        match pose.arrival {
            Arrival::Settled => model.arrive(&pose.inputs, &mut memories),
            Arrival::FromBefore => model.advance(&pose.inputs, &mut memories),
        }
        if used.is_none_or(|used| used[index]) {
            look(index, &model.evaluate(&pose.inputs, &memories), &memories);
        }
    }
}

/// How the tool moves with each free number.
pub(crate) fn motions_of(
    hypothesis: &Hypothesis,
    inputs: &Inputs,
    memories: &Memories,
    seen: &Evaluation,
) -> Vec<Motion> {
    let model = &hypothesis.model;
    let wanted: Vec<(usize, usize)> =
        hypothesis.free.iter().map(|free| (free.effect, free.value)).collect();
    let mut motions = vec![Motion::default(); wanted.len()];
    model.derivatives(inputs, memories, &wanted, |place, change| {
        motions[place] = Motion::of(&model.arm, seen, change).unwrap_or_default();
    });
    let acts_on_loads: Vec<bool> =
        model.effects().map(|effect| effect.spec().acts_on == ActsOn::Loads).collect();
    let mut yielding = None;
    for (motion, (effect, value)) in motions.iter_mut().zip(wanted) {
        if acts_on_loads[effect] {
            let yielding = yielding.get_or_insert_with(|| Yielding::of(model, memories));
            *motion = yielding.through_loads(effect, value, inputs);
        }
    }
    motions
}

/// A model without the effects that do nothing: candidates, mostly.
struct Yielding {
    model: Box<Model>,
    memories: Memories,
    /// Where each effect of the whole model stands here.
    places: Vec<Option<usize>>,
}

impl Yielding {
    fn of(whole: &Model, all: &Memories) -> Self {
        let mut model = Box::new(Model::nominal(whole.arm));
        let mut memories = Memories::default();
        let mut places = Vec::with_capacity(whole.effects().len());
        for (place, effect) in whole.effects().enumerate() {
            let at_work = effect.values().iter().any(|value| *value != 0.0);
            let taken = effect.spec().acts_on == ActsOn::Loads || at_work;
            places.push(taken.then(|| model.effects().len()));
            if taken {
                memories.take(model.effects().len(), all, place);
                // It had room in the whole model.
                model.push(*effect).unwrap_or_default();
            }
        }
        Self { model, memories, places }
    }

    /// The motion per unit of a value of an effect on the loads, by central difference.
    fn through_loads(&mut self, effect: usize, value: usize, inputs: &Inputs) -> Motion {
        let Some(effect) = self.places[effect] else { return Motion::default() };
        let own = self.model.effects().nth(effect);
        let stands = own.map_or(0.0, |effect| effect.values()[value]);
        let step = 1e-4 * own.map_or(1.0, |effect| much(effect, value)).max(stands.abs());
        let mut at = |value_there: f64| {
            if let Some(effect) = self.model.effect_mut(effect) {
                effect.values_mut()[value] = value_there;
            }
            self.model.evaluate(inputs, &self.memories)
        };
        let (below, above) = (at(stands - step), at(stands + step));
        at(stands);
        Motion::between(&below, &above, 2.0 * step)
    }
}

/// The weighed sum of squares of data and priors.
pub(crate) fn cost(campaign: &Campaign, state: &State, weighing: &Weighing) -> f64 {
    let mut sum = 0.0;
    let look = Look { used: Some(&weighing.used), derivatives: false };
    let mut filter = Filter::new(campaign);
    visit(campaign, state, look, |at| {
        let scale = weighing.scale(at);
        for part in 0..at.rows.count {
            let mut left = [scale * at.rows.residual[part]];
            filter.pass(at.pose, at.instrument, at.stream, part, &mut left);
            sum += left[0] * left[0];
        }
    });
    sum + prior_rows(&state.hypothesis).map(|(_, right)| right * right).sum::<f64>()
}

/// Weight and right-hand side of each free number's prior.
fn prior_rows(hypothesis: &Hypothesis) -> impl Iterator<Item = (f64, f64)> {
    let values = hypothesis.values();
    hypothesis
        .free
        .iter()
        .zip(values)
        .map(|(free, value)| (1.0 / free.sigma, (free.mean - value) / free.sigma))
}

/// The rows of the data alone over the columns `active`, row by row.
pub(crate) fn data_rows(
    campaign: &Campaign,
    state: &State,
    weighing: &Weighing,
    active: &[usize],
    mut take: impl FnMut(&At<'_>, &[f64], f64),
) {
    let effects_from = state.surroundings.numbers().len();
    let mut rows = vec![vec![0.0; state.width()]; 3];
    let mut row = vec![0.0; active.len() + 1];
    let mut filter = Filter::new(campaign);
    let look = Look { used: Some(&weighing.used), derivatives: true };
    visit(campaign, state, look, |at| {
        let scale = weighing.scale(at);
        if scale == 0.0 {
            return;
        }
        at.rows.fill(effects_from, at.motions, &mut rows);
        for (k, full) in rows.iter().enumerate().take(at.rows.count) {
            for (slot, column) in row.iter_mut().zip(active) {
                *slot = scale * full[*column];
            }
            row[active.len()] = scale * at.rows.residual[k];
            filter.pass(at.pose, at.instrument, at.stream, k, &mut row);
            take(at, &row[..active.len()], row[active.len()]);
        }
    });
}

/// Data reduced to a triangle over the columns `active`.
pub(crate) fn data_triangle(
    campaign: &Campaign,
    state: &State,
    weighing: &Weighing,
    active: &[usize],
) -> Triangle {
    let mut triangle = Triangle::new(active.len());
    data_rows(campaign, state, weighing, active, |_, row, right| triangle.push(row, right));
    triangle.reduce();
    triangle
}

/// The triangle with the priors of the free numbers among `active` added.
pub(crate) fn with_priors(data: &Triangle, state: &State, active: &[usize]) -> Triangle {
    let mut triangle = data.clone();
    let first = state.surroundings.numbers().len();
    let priors: Vec<(f64, f64)> = prior_rows(&state.hypothesis).collect();
    for (at, column) in active.iter().enumerate() {
        if let Some((weight, right)) = column.checked_sub(first).and_then(|k| priors.get(k)) {
            triangle.push_one(at, *weight, *right);
        }
    }
    triangle.reduce();
    triangle
}

#[cfg(test)]
mod tests;
