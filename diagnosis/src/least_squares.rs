//! Residuals and derivatives of all measurements of a campaign for a hypothesis, reduced to a triangular system.
//!
//! Columns are the fitted extrinsic parameters, then the free parameters of the hypothesis. Priors are additional rows.
//!
//! Poses are visited in order, together with the memory of effects, so the sum is the same on any machine of one kind. Steps of the fit:
//! [`crate::levenberg_marquardt`].

use crate::autocorrelation::{WhiteningFilter, series_index};
use crate::campaign::{Arrival, Campaign, Pose};
use crate::extrinsics::{ExtrinsicParameter, Extrinsics};
use crate::fit_result::Fit;
use crate::hypothesis::{FreeParameter, Hypothesis, PriorSource};
use crate::identifiability::{ConfoundedColumn, split_identifiable, split_identifiable_keeping};
use crate::linearisation::Linearisation;
use crate::path_dynamics::PathDynamics;
use crate::qr::QrFactor;
use crate::residual::{ExtrinsicColumns, ReadingResidual};
use crate::tool_jacobian::ToolJacobian;
use crate::tool_motion::ToolMotion;
use physics::{Evaluation, Inputs, Memories, Model};
use world::reversal::advance;

/// The quantities that a fit changes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FitState {
    pub(crate) surroundings: Extrinsics,
    pub(crate) hypothesis: Hypothesis,
}

impl FitState {
    pub(crate) fn width(&self) -> usize {
        self.surroundings.parameters().len() + self.hypothesis.free.len()
    }

    /// The state after a step; one entry of `step` per column.
    pub(crate) fn stepped(&self, step: &[f64]) -> Self {
        let (first, second) = step.split_at(self.surroundings.parameters().len());
        Self {
            surroundings: self.surroundings.stepped(first),
            hypothesis: self.hypothesis.stepped(second),
        }
    }

    /// Lower bounds on the step of these columns.
    pub(crate) fn step_lower_bounds(&self, active: &[usize]) -> Vec<f64> {
        let first = self.surroundings.parameters().len();
        let lowest = self.hypothesis.step_lower_bounds();
        let bound_of = |column: &usize| column.checked_sub(first).map(|k| lowest[k]);
        active.iter().map(|column| bound_of(column).unwrap_or(f64::NEG_INFINITY)).collect()
    }

    /// Largest plausible change of each column's parameter: the unit in which a column counts as determined or not.
    pub(crate) fn plausible_sizes(&self) -> Vec<f64> {
        let surroundings =
            self.surroundings.parameters().into_iter().map(|_| ExtrinsicParameter::PLAUSIBLE_ERROR);
        surroundings.chain(self.hypothesis.plausible_sizes()).collect()
    }

    /// Standard deviation of each column's prior; extrinsic parameters have none, so their [`FitState::plausible_sizes`] are used.
    pub(crate) fn prior_sigmas(&self) -> Vec<f64> {
        let surroundings =
            self.surroundings.parameters().into_iter().map(|_| ExtrinsicParameter::PLAUSIBLE_ERROR);
        surroundings.chain(self.hypothesis.free.iter().map(|free| free.sigma)).collect()
    }

    /// The columns of `data` that are fitted, and those that are confounded or without effect. Fitted are the columns that data and tolerances
    /// together determine, and all parameters with a tolerance or a stated prior.
    pub(crate) fn split_columns(&self, data: &QrFactor) -> (Vec<usize>, Vec<ConfoundedColumn>) {
        let first = self.surroundings.parameters().len();
        let free = &self.hypothesis.free;
        let bends = |free: &FreeParameter| self.hypothesis.is_nonlinear(free);
        let mut widths = self.plausible_sizes();
        let own_widths = widths[first..].iter_mut().zip(free).filter(|(_, free)| bends(free));
        own_widths.for_each(|(width, _)| *width *= NONLINEAR_SIZE_FACTOR);
        let (mut fitted, mut others) = split_identifiable(data, &widths);
        let is = |column: usize, source: PriorSource| {
            column.checked_sub(first).is_some_and(|k| free[k].prior_source == source)
        };
        if free.iter().any(|free| free.prior_source == PriorSource::Tolerance) {
            let mut believed = data.clone();
            for (k, free) in
                free.iter().enumerate().filter(|(_, f)| f.prior_source != PriorSource::WideDefault)
            {
                believed.push_one(first + k, 1.0 / free.sigma, 0.0);
            }
            believed.reduce();
            let has_prior = |column| column >= first && !is(column, PriorSource::WideDefault);
            let (kept, left) = split_identifiable_keeping(&believed, &widths, has_prior);
            fitted = kept;
            others.retain(|other| is(other.column, PriorSource::Tolerance));
            others.extend(left);
        }
        let is_stated = |other: &ConfoundedColumn| is(other.column, PriorSource::Stated);
        fitted.extend(others.iter().filter(|other| is_stated(other)).map(|other| other.column));
        fitted.sort_unstable();
        fitted.dedup();
        others.retain(|other| !is_stated(other));
        (fitted, others)
    }

    /// The state with parameters that the data do not determine at their prior mean, the columns that are fitted, and the others.
    pub(crate) fn with_undetermined_at_priors(
        mut self,
        data: &QrFactor,
    ) -> (Self, Vec<usize>, Vec<ConfoundedColumn>) {
        let (kept, mut others) = self.split_columns(data);
        others.retain(|other| kept.binary_search(&other.column).is_err());
        let first = self.surroundings.parameters().len();
        let Hypothesis { model, free } = &mut self.hypothesis;
        for k in others.iter().filter_map(|other| other.column.checked_sub(first)) {
            let FreeParameter { effect, value, mean, .. } = free[k];
            model.change(effect, |effect| effect.values_mut()[value] = mean);
        }
        (self, kept, others)
    }
}

/// Factor on the width of nonlinear parameters: they are fitted on weaker evidence, because a fixed one would not contribute to the uncertainty of
/// the others.
const NONLINEAR_SIZE_FACTOR: f64 = 5.0;

/// A measurement at its position in the campaign.
pub(crate) struct VisitedReading<'a> {
    /// Index into [`Campaign::poses`].
    pub(crate) pose: usize,
    /// Index among all measurements of the campaign.
    pub(crate) reading: usize,
    pub(crate) rows: &'a ReadingResidual,
    /// One per free parameter of the hypothesis; empty if derivatives were not requested.
    pub(crate) motions: &'a [ToolMotion],
    pub(crate) instrument: usize,
    /// The series of consecutive measurements that it belongs to.
    pub(crate) stream: usize,
}

/// Weights of the measurements.
#[derive(Clone, Debug)]
pub(crate) struct ReadingWeights {
    /// Whether each pose takes part.
    pub(crate) used: Vec<bool>,
    /// Weight of each measurement, 0 to 1.
    pub(crate) weights: Vec<f64>,
    /// Factor on each instrument's stated noise.
    pub(crate) noise_factors: Vec<f64>,
}

impl ReadingWeights {
    pub(crate) fn equal(campaign: &Campaign, used: &[bool]) -> Self {
        Self {
            used: used.to_vec(),
            weights: vec![1.0; campaign.readings()],
            noise_factors: vec![1.0; campaign.instruments.len()],
        }
    }

    /// Weights and noise factors of a fit, for the poses `used`.
    pub(crate) fn of_fit(fit: &Fit, used: &[bool]) -> Self {
        Self {
            used: used.to_vec(),
            weights: fit.weights.clone(),
            noise_factors: fit.factors.clone(),
        }
    }

    /// Factor on the rows of a measurement; zero if its pose takes no part.
    pub(crate) fn scale(&self, reading: &VisitedReading<'_>) -> f64 {
        if self.used[reading.pose] {
            self.weights[reading.reading].sqrt() / self.noise_factors[reading.instrument]
        } else {
            0.0
        }
    }
}

/// Scope of a visit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VisitScope<'a> {
    /// Whether each pose is evaluated; `None`: all.
    pub(crate) used: Option<&'a [bool]>,
    /// Whether derivatives are computed.
    pub(crate) derivatives: bool,
}

/// Visits the measurements in order.
pub(crate) fn visit_readings(
    campaign: &Campaign,
    state: &FitState,
    wanted: VisitScope<'_>,
    mut visit: impl FnMut(&VisitedReading<'_>),
) {
    let columns = ExtrinsicColumns::of(&state.surroundings);
    let mut motions = Vec::new();
    let mut first = Vec::with_capacity(campaign.poses.len());
    let mut readings = 0;
    for pose in &campaign.poses {
        first.push(readings);
        readings += pose.seen.len();
    }
    let hypothesis = &state.hypothesis;
    let rides = PathDynamics::of(&hypothesis.model, campaign);
    let slopes = wanted.derivatives.then(|| rides.derivatives(hypothesis, campaign));
    let mut at_pose = ToolJacobian::of(hypothesis);
    visit_poses_with_dynamics(
        &hypothesis.model,
        campaign,
        &rides,
        wanted.used,
        |pose, evaluation, memories| {
            let inputs = rides.inputs(campaign, pose);
            if let Some(slopes) = &slopes {
                motions = at_pose.at(inputs, memories, evaluation);
                slopes.fill(&hypothesis.model.arm, evaluation, pose, &mut motions);
            }
            for (reading, observation) in (first[pose]..).zip(&campaign.poses[pose].seen) {
                let surroundings = &state.surroundings;
                let rows =
                    ReadingResidual::of(observation, evaluation, &inputs.q, surroundings, &columns);
                let instrument = observation.instrument;
                let stream = series_index(&observation.reading);
                visit(&VisitedReading {
                    pose,
                    reading,
                    rows: &rows,
                    motions: &motions,
                    instrument,
                    stream,
                });
            }
        },
    );
}

/// Advances the memory of effects along the campaign and passes each pose in use, with its evaluation, to `visit`; all poses if `used` is `None`.
pub(crate) fn visit_poses(
    model: &Model,
    campaign: &Campaign,
    used: Option<&[bool]>,
    visit: impl FnMut(usize, &Evaluation, &Memories),
) {
    visit_poses_with_dynamics(model, campaign, &PathDynamics::of(model, campaign), used, visit);
}

/// As [`visit_poses`], with the dynamics `rides` of the model already computed.
fn visit_poses_with_dynamics(
    model: &Model,
    campaign: &Campaign,
    rides: &PathDynamics,
    used: Option<&[bool]>,
    mut visit: impl FnMut(usize, &Evaluation, &Memories),
) {
    let mut evaluation = Evaluation::default();
    visit_memories(model, campaign, rides, used, |pose, memories| {
        model.evaluate_into(rides.inputs(campaign, pose), memories, &mut evaluation);
        rides.add_deflections(&model.arm, pose, &mut evaluation);
        visit(pose, &evaluation, memories);
    });
}

/// As [`visit_poses`], without evaluating the arm.
pub(crate) fn visit_memories(
    model: &Model,
    campaign: &Campaign,
    rides: &PathDynamics,
    used: Option<&[bool]>,
    mut visit: impl FnMut(usize, &Memories),
) {
    let mut memories = Memories::default();
    for (index, pose) in campaign.poses.iter().enumerate() {
        let inputs = rides.inputs(campaign, index);
        match pose.arrival {
            Arrival::Settled => model.settle_pose(inputs, &mut memories),
            Arrival::FromPrevious => {
                advance(model, neighbouring_inputs(campaign, rides, index), &mut memories);
            }
        }
        if used.is_none_or(|used| used[index]) {
            visit(index, &memories);
        }
    }
}

/// Inputs of a pose on a path, of the two before and of the one after. For joint positions that were read back only those of the pose itself: their
/// quantisation and delay would falsify the direction of motion.
fn neighbouring_inputs<'a>(
    campaign: &'a Campaign,
    rides: &'a PathDynamics,
    index: usize,
) -> [Option<&'a Inputs>; 4] {
    let poses = &campaign.poses;
    let is_contiguous = |from: &usize| {
        let next = poses.get(from + 1);
        let is_one = |next: &Pose| poses[*from].recording == next.recording;
        next.is_some_and(|next| is_one(next) && next.arrival == Arrival::FromPrevious)
    };
    let inputs = |pose: usize| rides.inputs(campaign, pose);
    let source = campaign.recordings.get(poses[index].recording);
    if source.is_none_or(|source| !source.is_path || source.reads_back) {
        return [None, None, Some(inputs(index)), None];
    }
    let before = index.checked_sub(1).filter(is_contiguous);
    let first = before.and_then(|k| k.checked_sub(1)).filter(is_contiguous);
    let after = is_contiguous(&index).then_some(index + 1);
    [first, before, Some(index), after].map(|pose| pose.map(inputs))
}

/// Weighted sum of squares of data and priors.
pub(crate) fn cost(campaign: &Campaign, state: &FitState, weighing: &ReadingWeights) -> f64 {
    let mut sum = 0.0;
    for_each_residual(campaign, state, weighing, |residual| sum += residual * residual);
    sum + prior_cost(&state.hypothesis)
}

/// Passes the weighted and whitened residuals, in the order of [`Linearisation::rows`].
pub(crate) fn for_each_residual(
    campaign: &Campaign,
    state: &FitState,
    weighing: &ReadingWeights,
    mut take: impl FnMut(f64),
) {
    let scope = VisitScope { used: Some(&weighing.used), derivatives: false };
    let mut filter = WhiteningFilter::new(campaign);
    visit_readings(campaign, state, scope, |reading| {
        let scale = weighing.scale(reading);
        if scale == 0.0 {
            return;
        }
        for part in 0..reading.rows.count {
            let mut left = [scale * reading.rows.residual[part]];
            filter.pass(reading.pose, reading.instrument, reading.stream, part, &mut left);
            take(left[0]);
        }
    });
}

/// Sum of squares of the priors.
pub(crate) fn prior_cost(hypothesis: &Hypothesis) -> f64 {
    prior_rows(hypothesis).map(|(_, right)| right * right).sum()
}

/// Sum of squares of the priors, and the gradient of theirs by the columns `active`: `Jᵀr` of their rows.
pub(crate) fn prior_sum_and_gradient(state: &FitState, active: &[usize]) -> (f64, Vec<f64>) {
    let first = state.surroundings.parameters().len();
    let priors: Vec<(f64, f64)> = prior_rows(&state.hypothesis).collect();
    let sum = priors.iter().map(|(_, right)| right * right).sum();
    let of_column = |column: &usize| {
        let prior = column.checked_sub(first).and_then(|k| priors.get(k));
        prior.map_or(0.0, |(weight, right)| weight * right)
    };
    (sum, active.iter().map(of_column).collect())
}

/// Weight and right-hand side of the prior of each free parameter.
fn prior_rows(hypothesis: &Hypothesis) -> impl Iterator<Item = (f64, f64)> {
    let values = hypothesis.values();
    hypothesis
        .free
        .iter()
        .zip(values)
        .map(|(free, value)| (1.0 / free.sigma, (free.mean - value) / free.sigma))
}

/// Passes the rows of the data alone, restricted to the columns `active`.
pub(crate) fn data_rows(
    campaign: &Campaign,
    state: &FitState,
    weighing: &ReadingWeights,
    active: &[usize],
    take: impl FnMut(&VisitedReading<'_>, &[f64], f64),
) {
    let linearisation = Linearisation::of(campaign, state.clone(), &weighing.used);
    linearisation.rows(campaign, weighing, active, take);
}

/// The reduced system with the priors of the free parameters among `active` added.
pub(crate) fn with_priors(data: &QrFactor, state: &FitState, active: &[usize]) -> QrFactor {
    let mut triangle = data.clone();
    let first = state.surroundings.parameters().len();
    let priors: Vec<(f64, f64)> = prior_rows(&state.hypothesis).collect();
    for (index, column) in active.iter().enumerate() {
        if let Some((weight, right)) = column.checked_sub(first).and_then(|k| priors.get(k)) {
            triangle.push_one(index, *weight, *right);
        }
    }
    triangle.reduce();
    triangle
}

#[cfg(test)]
mod tests;
