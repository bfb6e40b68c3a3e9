//! Robust fit of extrinsic and free parameters; parameters that the data do not determine stay at their prior.
//!
//! Order: extrinsic parameters only; then all determined parameters, iterating the noise scale and the set of determined parameters until both
//! converge; then the weights of outliers.
//!
//! Deterministic: the same input gives the same bits. Sign constraints are satisfied, and every parameter that was not fitted is listed. Effects are
//! selected in [`mod@crate::diagnose`].

use crate::campaign::Campaign;
use crate::extrinsics::Extrinsics;
use crate::fit_result::{Fit, FitParts};
use crate::hypothesis::Hypothesis;
use crate::identifiability::ConfoundedColumn;
use crate::initial_extrinsics;
use crate::least_squares::{FitState, ReadingWeights};
use crate::levenberg_marquardt::{Minimum, Termination, minimise};
use crate::linearisation::{Linearisation, ResidualNorm};
use crate::outlier_runs::{self, ReadingPlace};
use crate::qr::QrFactor;
use crate::robust_weights::{Influence, robust_noise_factor, weight};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Largest number of iterations over noise scale and set of determined parameters.
const ITERATIONS_MAX: usize = 4;
/// Largest number of reweighting iterations.
const REWEIGHTINGS_MAX: usize = 8;
/// Steps between two updates of scale and weights.
const STEPS: usize = 12;
/// Steps of a [`FitEffort::Sketch`].
const SKETCH: usize = 3;
/// Intermediate minimisations end when a full step would reduce the sum of squares by less than this, in units of the noise variance; the last one
/// converges fully. Decisions between two fits are based on differences of fifty times this or more.
pub(crate) const GAIN_LEAST: f64 = 0.01;
/// Weights have converged when none changes by more than this.
const WEIGHT_CHANGE_MAX: f64 = 1e-3;

/// A stream with at least this many measurements has its own scale for outlier detection: their median.
const ENOUGH: usize = 20;

/// Settings of a fit.
#[derive(Clone, Copy, Debug)]
pub struct FitSettings<'a> {
    /// Whether each pose takes part, one entry per pose.
    pub used: &'a [bool],
    /// Influence of outliers.
    pub influence: Influence,
    /// Initial extrinsic parameters; `None`: estimated from the nominal geometry.
    pub from: Option<&'a Extrinsics>,
    /// How far the minimisation is carried.
    pub effort: FitEffort,
}

impl<'a> FitSettings<'a> {
    /// A fit until convergence, from extrinsic parameters that are estimated from the nominal geometry.
    #[must_use]
    pub const fn full(used: &'a [bool], influence: Influence) -> Self {
        Self { used, influence, from: None, effort: FitEffort::Full }
    }
}

/// How far a minimisation is carried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FitEffort {
    /// Until convergence.
    Full,
    /// A few steps from the initial values: enough to see which effects are missing.
    Sketch,
}

/// Fits the free parameters of `hypothesis` and the extrinsic parameters of `campaign` to the poses that take part.
#[must_use]
pub fn fit(campaign: &Campaign, hypothesis: &Hypothesis, settings: &FitSettings<'_>) -> Fit {
    let surroundings = settings.from.cloned().unwrap_or_else(|| {
        initial_extrinsics::estimate_extrinsics(campaign, &hypothesis.model, settings.used)
    });
    let state = FitState { surroundings, hypothesis: hypothesis.clone() };
    let linearisation = Arc::new(Linearisation::of(campaign, state, settings.used));
    Fitter::new(campaign, linearisation, settings.used).fitted(settings)
}

/// Fits further from the result `before`, as [`fit`] of its hypothesis from its extrinsic parameters.
pub(crate) fn fit_further(campaign: &Campaign, before: &Fit, settings: &FitSettings<'_>) -> Fit {
    let settings = FitSettings { from: Some(&before.surroundings), ..*settings };
    let linearisation = before.rows_at(campaign, before.state(), settings.used);
    Fitter::new(campaign, linearisation, settings.used).fitted(&settings)
}

/// Refits from the result `before`, with its weights and noise factors fixed, so that the sums of squares of two such fits are comparable.
#[must_use]
pub fn refit_with_fixed_weights(
    campaign: &Campaign,
    hypothesis: &Hypothesis,
    before: &Fit,
    used: &[bool],
) -> Fit {
    let state = FitState { hypothesis: hypothesis.clone(), ..before.state() };
    refit_from(campaign, state, before, used)
}

/// [`refit_with_fixed_weights`] from another state.
pub(crate) fn refit_from(campaign: &Campaign, state: FitState, before: &Fit, used: &[bool]) -> Fit {
    let mut fitting = Fitter::with_weights_of(campaign, state, before, used);
    fitting.settle();
    fitting.into_fit()
}

/// Influence used until outliers are identified: redescending weights would freeze the first, possibly wrong, classification.
fn monotone_influence(influence: Influence) -> Influence {
    if influence == Influence::Redescending { Influence::Huber } else { influence }
}

struct Fitter<'a> {
    campaign: &'a Campaign,
    linearisation: Arc<Linearisation>,
    weighing: ReadingWeights,
    active: Vec<usize>,
    dependent: Vec<ConfoundedColumn>,
    /// Columns fixed at zero at the end, because the sign constraint is active.
    bounded: Vec<usize>,
    minimum: Option<Minimum>,
    /// The data reduced to these columns; valid while state, weights and factors are unchanged.
    reduced: Option<(Vec<usize>, QrFactor)>,
    steps: usize,
}

impl<'a> Fitter<'a> {
    fn new(campaign: &'a Campaign, linearisation: Arc<Linearisation>, used: &[bool]) -> Self {
        let weighing = ReadingWeights::equal(campaign, used);
        Self {
            campaign,
            linearisation,
            weighing,
            active: Vec::new(),
            dependent: Vec::new(),
            bounded: Vec::new(),
            minimum: None,
            reduced: None,
            steps: 0,
        }
    }

    /// A fit from `state` with weights and noise factors of the result `before`, and with its columns chosen.
    fn with_weights_of(
        campaign: &'a Campaign,
        state: FitState,
        before: &Fit,
        used: &[bool],
    ) -> Self {
        let mut fitting = Self::new(campaign, before.rows_at(campaign, state, used), used);
        fitting.weighing = ReadingWeights::of_fit(before, used);
        fitting.choose_columns();
        fitting
    }

    /// A few steps with fixed weights.
    fn settle(&mut self) {
        self.run(Termination { steps_max: SKETCH, gain_least: GAIN_LEAST });
        self.fix_at_bounds();
        let has_converged = self.minimum.as_ref().is_some_and(|minimum| minimum.converged);
        if !(has_converged && self.bounded.is_empty()) {
            self.run(Termination { steps_max: SKETCH, gain_least: GAIN_LEAST });
        }
    }

    fn fitted(mut self, settings: &FitSettings<'_>) -> Fit {
        match settings.effort {
            FitEffort::Full => {
                self.iterate_to_convergence(settings.from.is_none(), settings.influence);
                if settings.influence == Influence::Redescending {
                    self.iterate_weights(Influence::Redescending);
                }
                self.finish();
            }
            FitEffort::Sketch => self.sketch(settings.influence),
        }
        self.into_fit()
    }

    /// Iterates noise scale, weights and the set of determined parameters until they converge.
    fn iterate_to_convergence(&mut self, afresh: bool, influence: Influence) {
        if afresh {
            self.active = (0..self.linearisation.state.surroundings.parameters().len()).collect();
            self.update_scale_and_weights(influence);
            self.run(Termination { steps_max: STEPS, gain_least: GAIN_LEAST });
        }
        for _ in 0..ITERATIONS_MAX {
            let before = (self.active.clone(), self.weighing.noise_factors.clone());
            self.update_scale_and_weights(influence);
            self.choose_columns();
            self.run(Termination { steps_max: STEPS, gain_least: GAIN_LEAST });
            let is_unchanged = |(a, b): (&f64, &f64)| (a / b - 1.0).abs() < 0.05;
            let same_scale = self.weighing.noise_factors.iter().zip(&before.1).all(is_unchanged);
            if before.0 == self.active && same_scale {
                break;
            }
        }
        self.iterate_weights(monotone_influence(influence));
    }

    /// A few steps from an earlier fit, whose outliers are known.
    fn sketch(&mut self, influence: Influence) {
        self.rescale();
        self.reweigh(influence);
        self.choose_columns();
        self.run(Termination { steps_max: SKETCH, gain_least: GAIN_LEAST });
        self.fix_at_bounds();
        self.final_factors();
        self.run(Termination { steps_max: 1, gain_least: GAIN_LEAST });
    }

    /// Updates scale and weights from the present residuals.
    fn update_scale_and_weights(&mut self, influence: Influence) {
        self.rescale();
        self.reweigh(monotone_influence(influence));
    }

    /// Iterates the weights until they converge.
    fn iterate_weights(&mut self, influence: Influence) {
        for _ in 0..REWEIGHTINGS_MAX {
            let before = self.weighing.weights.clone();
            self.rescale();
            self.reweigh(influence);
            let pairs = self.weighing.weights.iter().zip(&before);
            let changed = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if changed < WEIGHT_CHANGE_MAX {
                break;
            }
            self.run(Termination { steps_max: STEPS, gain_least: GAIN_LEAST });
        }
    }

    /// Final pass: sign constraints, noise factors, then full convergence.
    fn finish(&mut self) {
        self.fix_at_bounds();
        self.final_factors();
        self.run(Termination::CONVERGED);
    }

    fn run(&mut self, until: Termination) {
        let (linearisation, data) = (Arc::clone(&self.linearisation), self.data());
        let found =
            minimise(self.campaign, linearisation, data, &self.weighing, &self.active, until);
        self.linearisation = Arc::clone(&found.linearisation);
        self.steps += found.steps;
        self.reduced = Some((self.active.clone(), found.data.clone()));
        self.minimum = Some(found);
    }

    /// The data reduced to the active columns by QR.
    fn data(&self) -> QrFactor {
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
        let state = self.linearisation.state.clone();
        let all: Vec<usize> = (0..state.width()).collect();
        let data = self.linearisation.triangle(self.campaign, &self.weighing, &all);
        let (state, kept, held) = state.with_undetermined_at_priors(&data);
        self.reduced = Some((all, data));
        self.active = kept;
        self.dependent = held;
        self.move_to(state);
    }

    /// Parameters that ended on their lower bound zero are fixed there; below zero they would compensate for other parameters.
    fn fix_at_bounds(&mut self) {
        let lowest = self.linearisation.state.step_lower_bounds(&self.active);
        let at_zero = self.active.iter().zip(&lowest).filter(|(_, bound)| **bound == 0.0);
        self.bounded = at_zero.map(|(column, _)| *column).collect();
        self.active.retain(|column| !self.bounded.contains(column));
    }

    /// Evaluates the rows at another state.
    fn move_to(&mut self, state: FitState) {
        if state != self.linearisation.state {
            self.reduced = None;
            self.linearisation =
                Arc::new(Linearisation::of(self.campaign, state, &self.weighing.used));
        }
    }

    /// Noise factor of each instrument from its residuals (robust); not below one where the noise is known.
    fn rescale(&mut self) {
        self.reduced = None;
        let lengths = self.linearisation.residual_norms();
        for (index, instrument) in self.campaign.instruments.iter().enumerate() {
            let lengths_of_instrument = lengths.iter().filter(|one| one.instrument == index);
            let factor_min = if instrument.noise_is_known { 1.0 } else { 1e-9 };
            if let Some(found) =
                robust_noise_factor(lengths_of_instrument.map(|one| (one.count, one.length)))
            {
                self.weighing.noise_factors[index] = found.max(factor_min);
            }
        }
    }

    /// Weights from the size of each residual relative to the scale of its own stream: if half of the residuals of one encoder or target are large,
    /// the cause is a missing effect, which must stay visible, not outliers. The same holds for [runs](crate::outlier_runs) of large residuals.
    fn reweigh(&mut self, influence: Influence) {
        self.reduced = None;
        let lengths = self.linearisation.residual_norms();
        let mut streams: BTreeMap<(usize, usize), Vec<(usize, f64)>> = BTreeMap::new();
        for ResidualNorm { instrument, stream, count, length, .. } in &lengths {
            streams.entry((*instrument, *stream)).or_default().push((*count, *length));
        }
        let scale_of =
            |((instrument, stream), stream_lengths): ((usize, usize), Vec<(usize, f64)>)| {
                let factor = self.weighing.noise_factors[instrument];
                let wide = if stream_lengths.len() < ENOUGH {
                    0.0
                } else {
                    robust_noise_factor(stream_lengths.into_iter()).unwrap_or(0.0)
                };
                ((instrument, stream), wide.max(factor))
            };
        let scales: BTreeMap<(usize, usize), f64> = streams.into_iter().map(scale_of).collect();
        let size = |one: &ResidualNorm| one.length / scales[&(one.instrument, one.stream)];
        let is_far: Vec<bool> = lengths
            .iter()
            .map(|one| weight(Influence::Redescending, one.count, size(one)) < 1.0)
            .collect();
        let places: Vec<ReadingPlace> = lengths.iter().map(ReadingPlace::from).collect();
        let in_runs = outlier_runs::in_runs(self.campaign, &places, &is_far);
        for (one, is_in_run) in lengths.iter().zip(in_runs) {
            let influence = if is_in_run { monotone_influence(influence) } else { influence };
            self.weighing.weights[one.reading] = weight(influence, one.count, size(one));
        }
    }

    fn into_fit(self) -> Fit {
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
            FitParts { linearisation, weighing, active, dependent, bounded, minimum, steps, sum };
        Fit::of(campaign, parts)
    }

    /// Noise factors by root mean square, which is efficient for clean data, instead of by the median; measurements with a weight below one half are
    /// excluded. A known noise is kept unless the mean square residual exceeds it by three standard deviations.
    fn final_factors(&mut self) {
        self.reduced = None;
        let lengths = self.linearisation.residual_norms();
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
            self.weighing.noise_factors[index] =
                if !instrument.noise_is_known || too_large { ratio.sqrt().max(1e-9) } else { 1.0 };
        }
    }
}

#[cfg(test)]
mod tests;
