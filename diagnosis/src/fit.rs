//! Robust fit of extrinsic and free parameters; parameters that the data do not determine stay at their prior.
//!
//! Order: extrinsic parameters only; then all determined parameters, iterating the noise scale and the set of determined parameters until both
//! converge; then the weights of outliers.
//!
//! Deterministic: the same input gives the same bits. Sign constraints are satisfied, and every parameter that was not fitted is listed. Effects are
//! selected in [`mod@crate::diagnose`].

use crate::campaign::Campaign;
use crate::colour::follows;
use crate::hypothesis::Hypothesis;
use crate::independent::Dependent;
use crate::linearisation::{Length, Linearisation};
use crate::minimise::{Minimum, Until, minimise};
use crate::problem::{State, Weighing};
use crate::result::{Fit, Parts};
use crate::robust::{Influence, scale, weight};
use crate::start;
use crate::surroundings::Surroundings;
use crate::triangle::Triangle;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Largest number of iterations over noise scale and set of determined parameters.
const SETTLING: usize = 4;
/// Largest number of reweighting iterations.
const WEIGHING: usize = 8;
/// Steps between two updates of scale and weights.
const STEPS: usize = 12;
/// Steps of a [`Effort::Sketch`].
const SKETCH: usize = 3;
/// Intermediate minimisations end when a full step would reduce the sum of squares by less than this, in units of the noise variance; the last one
/// converges fully. Decisions between two fits are based on differences of fifty times this or more.
const SETTLED: f64 = 0.01;
/// Weights have converged when none changes by more than this.
const STANDS: f64 = 1e-3;

/// A stream with at least this many measurements has its own scale for outlier detection: their median.
const ENOUGH: usize = 20;

/// This many consecutive rows of a path with large residuals indicate a missing effect, not outliers.
const LASTING: usize = 4;

/// Settings of a fit.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'a> {
    /// Whether each pose takes part, one entry per pose.
    pub used: &'a [bool],
    /// Influence of outliers.
    pub influence: Influence,
    /// Initial extrinsic parameters; `None`: estimated from the nominal geometry.
    pub from: Option<&'a Surroundings>,
    /// How far the minimisation is carried.
    pub effort: Effort,
}

/// How far a minimisation is carried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Until convergence.
    Full,
    /// A few steps from the initial values: enough to see which effects are missing.
    Sketch,
}

/// Fits the free parameters of `hypothesis` and the extrinsic parameters of `campaign` to the poses that take part.
#[must_use]
pub fn fit(campaign: &Campaign, hypothesis: &Hypothesis, settings: &Settings<'_>) -> Fit {
    let surroundings = settings
        .from
        .cloned()
        .unwrap_or_else(|| start::surroundings(campaign, &hypothesis.model, settings.used));
    let state = State { surroundings, hypothesis: hypothesis.clone() };
    let mut fitting = Fitting::new(campaign, state, settings.used);
    match settings.effort {
        Effort::Full => {
            fitting.settle(settings.from.is_none(), settings.influence);
            if settings.influence == Influence::Redescending {
                fitting.weigh(Influence::Redescending);
            }
            fitting.end();
        }
        Effort::Sketch => fitting.sketch(settings.influence),
    }
    fitting.done()
}

/// Refits from the result `before`, with its weights and noise factors fixed, so that the sums of squares of two such fits are comparable.
#[must_use]
pub fn compare(campaign: &Campaign, hypothesis: &Hypothesis, before: &Fit, used: &[bool]) -> Fit {
    let surroundings = before.surroundings.clone();
    let state = State { surroundings, hypothesis: hypothesis.clone() };
    let mut fitting = Fitting::new(campaign, state, used);
    fitting.weighing.weights.clone_from(&before.weights);
    fitting.weighing.factors.clone_from(&before.factors);
    fitting.choose_columns();
    fitting.run(Until { steps_max: SKETCH, gain_least: SETTLED });
    fitting.leave_at_zero();
    let has_converged = fitting.minimum.as_ref().is_some_and(|minimum| minimum.converged);
    if !(has_converged && fitting.bounded.is_empty()) {
        fitting.run(Until { steps_max: SKETCH, gain_least: SETTLED });
    }
    fitting.done()
}

/// Influence used until outliers are identified: redescending weights would freeze the first, possibly wrong, classification.
fn careful(influence: Influence) -> Influence {
    if influence == Influence::Redescending { Influence::Huber } else { influence }
}

struct Fitting<'a> {
    campaign: &'a Campaign,
    linearisation: Arc<Linearisation>,
    weighing: Weighing,
    active: Vec<usize>,
    dependent: Vec<Dependent>,
    /// Columns fixed at zero at the end, because the sign constraint is active.
    bounded: Vec<usize>,
    minimum: Option<Minimum>,
    /// The data reduced to these columns; valid while state, weights and factors are unchanged.
    reduced: Option<(Vec<usize>, Triangle)>,
    steps: usize,
}

impl<'a> Fitting<'a> {
    fn new(campaign: &'a Campaign, state: State, used: &[bool]) -> Self {
        let weighing = Weighing::equal(campaign, used);
        Self {
            campaign,
            linearisation: Arc::new(Linearisation::of(campaign, state, used)),
            weighing,
            active: Vec::new(),
            dependent: Vec::new(),
            bounded: Vec::new(),
            minimum: None,
            reduced: None,
            steps: 0,
        }
    }

    /// Iterates noise scale, weights and the set of determined parameters until they converge.
    fn settle(&mut self, afresh: bool, influence: Influence) {
        if afresh {
            self.active = (0..self.linearisation.state.surroundings.numbers().len()).collect();
            self.look_again(influence);
            self.run(Until { steps_max: STEPS, gain_least: SETTLED });
        }
        for _ in 0..SETTLING {
            let before = (self.active.clone(), self.weighing.factors.clone());
            self.look_again(influence);
            self.choose_columns();
            self.run(Until { steps_max: STEPS, gain_least: SETTLED });
            let stands = |(a, b): (&f64, &f64)| (a / b - 1.0).abs() < 0.05;
            let same_scale = self.weighing.factors.iter().zip(&before.1).all(stands);
            if before.0 == self.active && same_scale {
                break;
            }
        }
        self.weigh(careful(influence));
    }

    /// A few steps from an earlier fit, whose outliers are known.
    fn sketch(&mut self, influence: Influence) {
        self.rescale();
        self.reweigh(influence);
        self.choose_columns();
        self.run(Until { steps_max: SKETCH, gain_least: SETTLED });
        self.leave_at_zero();
        self.final_factors();
        self.run(Until { steps_max: 1, gain_least: SETTLED });
    }

    /// Updates scale and weights from the present residuals.
    fn look_again(&mut self, influence: Influence) {
        self.rescale();
        self.reweigh(careful(influence));
    }

    /// Iterates the weights until they converge.
    fn weigh(&mut self, influence: Influence) {
        for _ in 0..WEIGHING {
            let before = self.weighing.weights.clone();
            self.rescale();
            self.reweigh(influence);
            let pairs = self.weighing.weights.iter().zip(&before);
            let changed = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if changed < STANDS {
                break;
            }
            self.run(Until { steps_max: STEPS, gain_least: SETTLED });
        }
    }

    /// Final pass: sign constraints, noise factors, then full convergence.
    fn end(&mut self) {
        self.leave_at_zero();
        self.final_factors();
        self.run(Until::CONVERGED);
    }

    fn run(&mut self, until: Until) {
        let (linearisation, data) = (Arc::clone(&self.linearisation), self.data());
        let found =
            minimise(self.campaign, linearisation, data, &self.weighing, &self.active, until);
        self.linearisation = Arc::clone(&found.linearisation);
        self.steps += found.steps;
        self.reduced = Some((self.active.clone(), found.data.clone()));
        self.minimum = Some(found);
    }

    /// The data reduced to the active columns by QR.
    fn data(&self) -> Triangle {
        if let Some((columns, data)) = &self.reduced {
            let place = |column: &usize| columns.binary_search(column).ok();
            let places: Option<Vec<usize>> = self.active.iter().map(place).collect();
            match places {
                Some(places) if places.len() == columns.len() => return data.clone(),
                Some(places) => return data.of_columns(&places),
                None => {}
            }
        }
        self.linearisation.triangle(self.campaign, &self.weighing, &self.active)
    }

    /// Selects the columns that the data or a stated prior determine; the others return to their prior mean.
    fn choose_columns(&mut self) {
        let state = &self.linearisation.state;
        let all: Vec<usize> = (0..state.width()).collect();
        let data = self.linearisation.triangle(self.campaign, &self.weighing, &all);
        let (kept, dependent) = state.sort(&data);
        self.reduced = Some((all, data));
        let first = state.surroundings.numbers().len();
        let free = &state.hypothesis.free;
        let held = dependent.iter().filter(|d| kept.binary_search(&d.column).is_err());
        let places = held.clone().filter_map(|d| d.column.checked_sub(first));
        let believed: Vec<(usize, f64)> = places.map(|k| (k, free[k].mean)).collect();
        let held = held.cloned().collect();
        self.active = kept;
        self.dependent = held;
        self.put(&believed);
    }

    /// Parameters that ended on their lower bound zero are fixed there; below zero they would compensate for other parameters.
    fn leave_at_zero(&mut self) {
        let lowest = self.linearisation.state.lowest(&self.active);
        let at_zero = self.active.iter().zip(&lowest).filter(|(_, least)| **least == 0.0);
        self.bounded = at_zero.map(|(column, _)| *column).collect();
        self.active.retain(|column| !self.bounded.contains(column));
    }

    /// Sets free parameters, given as index and value.
    fn put(&mut self, values: &[(usize, f64)]) {
        let mut state = self.linearisation.state.clone();
        let State { hypothesis, .. } = &mut state;
        for (k, value) in values {
            let free = hypothesis.free[*k];
            hypothesis.model.change(free.effect, |effect| effect.values_mut()[free.value] = *value);
        }
        if state != self.linearisation.state {
            self.reduced = None;
            self.linearisation =
                Arc::new(Linearisation::of(self.campaign, state, &self.weighing.used));
        }
    }

    /// Noise factor of each instrument from its residuals (robust); not below one where the noise is known.
    fn rescale(&mut self) {
        self.reduced = None;
        let lengths = self.linearisation.lengths();
        for (index, instrument) in self.campaign.instruments.iter().enumerate() {
            let own = lengths.iter().filter(|one| one.instrument == index);
            let least = if instrument.noise_is_known { 1.0 } else { 1e-9 };
            if let Some(found) = scale(own.map(|one| (one.count, one.length))) {
                self.weighing.factors[index] = found.max(least);
            }
        }
    }

    /// Weights from the size of each residual relative to the scale of its own stream: if half of the residuals of one encoder or target are large,
    /// the cause is a missing effect, which must stay visible, not outliers. The same holds for several consecutive rows of a path.
    fn reweigh(&mut self, influence: Influence) {
        self.reduced = None;
        let lengths = self.linearisation.lengths();
        let mut streams: BTreeMap<(usize, usize), Vec<(usize, f64)>> = BTreeMap::new();
        for Length { instrument, stream, count, length, .. } in &lengths {
            streams.entry((*instrument, *stream)).or_default().push((*count, *length));
        }
        let own = |((instrument, stream), of): ((usize, usize), Vec<(usize, f64)>)| {
            let factor = self.weighing.factors[instrument];
            let wide = if of.len() < ENOUGH { 0.0 } else { scale(of.into_iter()).unwrap_or(0.0) };
            ((instrument, stream), wide.max(factor))
        };
        let own: BTreeMap<(usize, usize), f64> = streams.into_iter().map(own).collect();
        let size = |one: &Length| one.length / own[&(one.instrument, one.stream)];
        let lasting = self.lasting(&lengths, size);
        for (one, lasts) in lengths.iter().zip(lasting) {
            let influence = if lasts { careful(influence) } else { influence };
            self.weighing.weights[one.reading] = weight(influence, one.count, size(one));
        }
    }

    /// Which measurements have large residuals together with those of the same stream in adjacent rows: at least [`LASTING`] consecutive rows of one
    /// path.
    fn lasting(&self, lengths: &[Length], size: impl Fn(&Length) -> f64) -> Vec<bool> {
        let mut lasting = vec![false; lengths.len()];
        let mut runs: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
        for (place, one) in lengths.iter().enumerate() {
            let run = runs.entry((one.instrument, one.stream)).or_default();
            let goes_on = run.last().is_some_and(|last: &usize| {
                follows(self.campaign, lengths[*last].pose, one.pose)
                    && self.campaign.recordings[self.campaign.poses[one.pose].recording].is_path
            });
            let is_far = weight(Influence::Redescending, one.count, size(one)) < 1.0;
            if !(goes_on && is_far) {
                run.clear();
            }
            if is_far {
                run.push(place);
            }
            match run.len() {
                ..LASTING => {}
                LASTING => run.iter().for_each(|place| lasting[*place] = true),
                _ => lasting[place] = true,
            }
        }
        lasting
    }

    fn done(self) -> Fit {
        let sum = self.linearisation.cost(self.campaign, &self.weighing);
        let Self {
            campaign,
            linearisation,
            weighing,
            active,
            dependent,
            bounded,
            minimum,
            steps,
            ..
        } = self;
        let parts =
            Parts { linearisation, weighing, active, dependent, bounded, minimum, steps, sum };
        Fit::of(campaign, parts)
    }

    /// Noise factors by root mean square, which is efficient for clean data, instead of by the median; measurements with a weight below one half are
    /// excluded. A known noise is kept unless the mean square residual exceeds it by three standard deviations.
    fn final_factors(&mut self) {
        self.reduced = None;
        let lengths = self.linearisation.lengths();
        let clean = lengths.iter().filter(|l| self.weighing.weights[l.reading] >= 0.5);
        let all: f64 =
            clean.clone().map(|l| self.weighing.weights[l.reading] * l.count as f64).sum();
        let freedom = (all - self.active.len() as f64).max(1.0) / all.max(1.0);
        for (index, instrument) in self.campaign.instruments.iter().enumerate() {
            let (mut square, mut count) = (0.0, 0.0);
            for one in clean.clone().filter(|one| one.instrument == index) {
                let weight = self.weighing.weights[one.reading];
                square += weight * one.length * one.length;
                count += weight * one.count as f64;
            }
            let ratio = square / (count * freedom).max(1.0);
            let too_large = ratio > 1.0 + 3.0 * (2.0 / (count * freedom).max(1.0)).sqrt();
            self.weighing.factors[index] =
                if !instrument.noise_is_known || too_large { ratio.sqrt().max(1e-9) } else { 1.0 };
        }
    }
}

#[cfg(test)]
mod tests;
