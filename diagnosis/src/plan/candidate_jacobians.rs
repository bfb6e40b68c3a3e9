//! Scaled derivatives of the readings of each candidate pose with respect to the identifiable parameters.
//!
//! Columns are those that a fit of all candidates and all measurements would determine, extrinsic parameters first.

use super::task::{CandidatePose, Task, campaign};
use super::{ExistingMeasurements, PlanError};
use crate::campaign::Campaign;
use crate::fit_result::ColumnNames;
use crate::hypothesis::Hypothesis;
use crate::least_squares::{FitState, ReadingWeights, data_rows, visit_poses};
use crate::qr::QrFactor;
use crate::tool_jacobian::ToolJacobian;
use nalgebra::DMatrix;
use physics::Joints;

/// Scaled derivatives of all candidates, and the information of the existing measurements.
#[derive(Clone, Debug)]
pub(crate) struct CandidateJacobians {
    pub(crate) candidates: Vec<CandidatePose>,
    /// One matrix per candidate: rows are whitened readings, columns parameters scaled by their priors.
    pub(crate) jacobians: Vec<DMatrix<f64>>,
    /// Information matrix before the first pose: priors and existing measurements.
    pub(crate) prior_information: DMatrix<f64>,
    /// Information matrix of the existing measurements alone, and the number of their scalar readings.
    pub(crate) measured_information: (DMatrix<f64>, usize),
    /// Quadratic form that gives the mean square tool error over the test poses from the scaled parameters, m².
    pub(crate) tool_error_form: DMatrix<f64>,
    /// Indices of the kept columns.
    pub(crate) columns: Vec<usize>,
    /// Number of kept columns that are extrinsic parameters.
    pub(crate) nuisance_count: usize,
    /// Scale of each kept column: the prior standard deviation of its parameter.
    pub(crate) scales: Vec<f64>,
    /// Ratio of the covariance to that of independent readings (design effect).
    pub(crate) design_effect: f64,
    pub(crate) undetermined: Vec<String>,
}

impl CandidateJacobians {
    pub(crate) fn of(
        task: &Task,
        known: Option<ExistingMeasurements<'_>>,
        candidates: Vec<CandidatePose>,
    ) -> Result<Self, PlanError> {
        let state = state(task);
        let all: Vec<usize> = (0..state.width()).collect();
        let mut triangle = QrFactor::new(all.len());
        let whitened = whitened_jacobians(&state, &candidates, &all);
        let push = |triangle: &mut QrFactor, rows: &DMatrix<f64>| {
            rows.row_iter()
                .for_each(|row| triangle.push(&row.iter().copied().collect::<Vec<_>>(), 0.0));
        };
        whitened.iter().for_each(|rows| push(&mut triangle, rows));
        let old = known.map(|known| measured_rows(known, &state, &all));
        old.iter().for_each(|rows| push(&mut triangle, rows));
        triangle.reduce();
        let (columns, others) = state.split_columns(&triangle);
        let first = state.surroundings.parameters().len();
        let undetermined = others
            .iter()
            .filter(|other| !other.partners.is_empty())
            .map(|other| ColumnNames(&state).undetermined(other).message());
        let nuisance_count = columns.iter().filter(|c| **c < first).count();
        if columns.len() == nuisance_count {
            return Err(PlanError::NothingIdentifiable);
        }
        let priors = state.prior_sigmas();
        let scales: Vec<f64> = columns.iter().map(|column| priors[*column]).collect();
        let part = |rows: &DMatrix<f64>| scaled(rows, &columns, &scales);
        let measured_information =
            old.map_or((DMatrix::zeros(columns.len(), columns.len()), 0), |rows| {
                let rows = part(&rows);
                (rows.transpose() * &rows, rows.nrows())
            });
        Ok(Self {
            jacobians: whitened.iter().map(part).collect(),
            prior_information: &measured_information.0
                + DMatrix::identity(columns.len(), columns.len()),
            tool_error_form: tool_error_form(task, &state, &columns, &scales),
            design_effect: known.map_or(1.0, |known| known.fit.design_effect),
            undetermined: undetermined.collect(),
            measured_information,
            candidates,
            columns,
            nuisance_count,
            scales,
        })
    }

    /// Adds candidates.
    pub(crate) fn add(&mut self, task: &Task, candidates: Vec<CandidatePose>) {
        let state = state(task);
        let all: Vec<usize> = (0..state.width()).collect();
        let rows = whitened_jacobians(&state, &candidates, &all);
        self.jacobians.extend(rows.iter().map(|rows| scaled(rows, &self.columns, &self.scales)));
        self.candidates.extend(candidates);
    }
}

pub(crate) fn state(task: &Task) -> FitState {
    FitState { surroundings: task.surroundings.clone(), hypothesis: task.hypothesis.clone() }
}

/// Derivatives of each candidate's whitened readings with respect to the parameters `columns`, per SI unit.
pub(crate) fn whitened_jacobians(
    state: &FitState,
    candidates: &[CandidatePose],
    columns: &[usize],
) -> Vec<DMatrix<f64>> {
    let poses = candidates.iter().flat_map(|candidate| candidate.poses.iter().cloned());
    let campaign = campaign(poses.collect(), &state.surroundings);
    let owner: Vec<usize> =
        candidates.iter().enumerate().flat_map(|(k, c)| c.poses.iter().map(move |_| k)).collect();
    let weighing = ReadingWeights::equal(&campaign, &vec![true; campaign.poses.len()]);
    let mut flat: Vec<Vec<f64>> = vec![Vec::new(); candidates.len()];
    data_rows(&campaign, state, &weighing, columns, |reading, row, _| {
        flat[owner[reading.pose]].extend_from_slice(row);
    });
    let width = columns.len();
    flat.iter()
        .map(|flat| DMatrix::from_row_slice(flat.len() / width.max(1), width, flat))
        .collect()
}

/// Rows of the existing measurements, weighted as in their fit.
fn measured_rows(
    known: ExistingMeasurements<'_>,
    state: &FitState,
    columns: &[usize],
) -> DMatrix<f64> {
    let ExistingMeasurements { campaign, fit } = known;
    let used = vec![true; campaign.poses.len()];
    let weighing =
        ReadingWeights { used, weights: fit.weights.clone(), noise_factors: fit.factors.clone() };
    let mut flat = Vec::new();
    data_rows(campaign, state, &weighing, columns, |_, row, _| flat.extend_from_slice(row));
    DMatrix::from_row_slice(flat.len() / columns.len().max(1), columns.len(), &flat)
}

fn scaled(rows: &DMatrix<f64>, columns: &[usize], widths: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.nrows(), columns.len(), |i, j| rows[(i, columns[j])] * widths[j])
}

/// `Σ JᵀJ / n` over the test poses, with J the derivative of the TCP in base axes with respect to each column, as in [`crate::uncertainty_propagation`].
fn tool_error_form(
    task: &Task,
    state: &FitState,
    columns: &[usize],
    widths: &[f64],
) -> DMatrix<f64> {
    let mut focus = DMatrix::zeros(columns.len(), columns.len());
    let first = state.surroundings.parameters().len();
    for q in &task.test_poses {
        let rows = tcp_jacobian(&state.hypothesis, q);
        let part = DMatrix::from_fn(3, columns.len(), |axis, j| {
            columns[j].checked_sub(first).map_or(0.0, |k| rows[(axis, k)] * widths[j])
        });
        focus += part.transpose() * part;
    }
    focus / task.test_poses.len().max(1) as f64
}

/// Derivative of the TCP position with respect to each free parameter, m per SI unit.
fn tcp_jacobian(hypothesis: &Hypothesis, q: &Joints) -> DMatrix<f64> {
    let inputs = physics::Inputs::at_rest(*q);
    let pose = crate::Pose {
        inputs,
        arrival: crate::Arrival::Settled,
        recording: 0,
        row: 0,
        seen: Vec::new(),
    };
    let campaign = Campaign {
        poses: vec![pose],
        surroundings: crate::Extrinsics::default(),
        instruments: Vec::new(),
        recordings: Vec::new(),
    };
    let mut rows = DMatrix::zeros(3, hypothesis.free.len());
    let mut at_pose = ToolJacobian::of(hypothesis);
    visit_poses(&hypothesis.model, &campaign, None, |_, evaluation, memories| {
        for (k, motion) in at_pose.at(&inputs, memories, evaluation).iter().enumerate() {
            (0..3).for_each(|axis| rows[(axis, k)] = motion.shift[axis]);
        }
    });
    rows
}
