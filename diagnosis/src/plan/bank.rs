//! Scaled derivatives of the readings of each candidate pose with respect to the identifiable parameters.
//!
//! Columns are those that a fit of all candidates and all measurements would determine, extrinsic parameters first.

use super::task::{Candidate, Task, campaign};
use super::{Known, NoPlan};
use crate::campaign::Campaign;
use crate::hypothesis::Hypothesis;
use crate::motions::Motions;
use crate::problem::{State, Weighing, data_rows, follow};
use crate::result::Names;
use crate::triangle::Triangle;
use nalgebra::DMatrix;
use physics::Joints;

/// Scaled derivatives of all candidates, and the information of the existing measurements.
#[derive(Clone, Debug)]
pub(crate) struct Bank {
    pub(crate) candidates: Vec<Candidate>,
    /// One matrix per candidate: rows are whitened readings, columns parameters scaled by their priors.
    pub(crate) rows: Vec<DMatrix<f64>>,
    /// Information matrix before the first pose: priors and existing measurements.
    pub(crate) before: DMatrix<f64>,
    /// Information matrix of the existing measurements alone, and the number of their scalar readings.
    pub(crate) measured: (DMatrix<f64>, usize),
    /// Quadratic form that gives the mean square tool error over the test poses from the scaled parameters, m².
    pub(crate) focus: DMatrix<f64>,
    /// Indices of the kept columns.
    pub(crate) columns: Vec<usize>,
    /// Number of kept columns that are extrinsic parameters.
    pub(crate) nuisance: usize,
    /// Scale of each kept column: the prior standard deviation of its parameter.
    pub(crate) widths: Vec<f64>,
    /// Ratio of the covariance to that of independent readings (design effect).
    pub(crate) inflation: f64,
    pub(crate) undetermined: Vec<String>,
}

impl Bank {
    pub(crate) fn of(
        task: &Task,
        known: Option<Known<'_>>,
        candidates: Vec<Candidate>,
    ) -> Result<Self, NoPlan> {
        let state = state(task);
        let all: Vec<usize> = (0..state.width()).collect();
        let mut triangle = Triangle::new(all.len());
        let seen = rows_of(&state, &candidates, &all);
        let push = |triangle: &mut Triangle, rows: &DMatrix<f64>| {
            rows.row_iter()
                .for_each(|row| triangle.push(&row.iter().copied().collect::<Vec<_>>(), 0.0));
        };
        seen.iter().for_each(|rows| push(&mut triangle, rows));
        let old = known.map(|known| old_rows(known, &state, &all));
        old.iter().for_each(|rows| push(&mut triangle, rows));
        triangle.reduce();
        let (columns, others) = state.sort(&triangle);
        let first = state.surroundings.numbers().len();
        let undetermined = others
            .iter()
            .filter(|other| !other.partners.is_empty())
            .map(|other| Names(&state).undetermined(other).says());
        let nuisance = columns.iter().filter(|c| **c < first).count();
        if columns.len() == nuisance {
            return Err(NoPlan::Nothing);
        }
        let priors = state.priors();
        let widths: Vec<f64> = columns.iter().map(|column| priors[*column]).collect();
        let part = |rows: &DMatrix<f64>| scaled(rows, &columns, &widths);
        let measured = old.map_or((DMatrix::zeros(columns.len(), columns.len()), 0), |rows| {
            let rows = part(&rows);
            (rows.transpose() * &rows, rows.nrows())
        });
        Ok(Self {
            rows: seen.iter().map(part).collect(),
            before: &measured.0 + DMatrix::identity(columns.len(), columns.len()),
            focus: focus(task, &state, &columns, &widths),
            inflation: known.map_or(1.0, |known| known.fit.design_effect),
            undetermined: undetermined.collect(),
            measured,
            candidates,
            columns,
            nuisance,
            widths,
        })
    }

    /// Adds candidates.
    pub(crate) fn add(&mut self, task: &Task, candidates: Vec<Candidate>) {
        let state = state(task);
        let all: Vec<usize> = (0..state.width()).collect();
        let rows = rows_of(&state, &candidates, &all);
        self.rows.extend(rows.iter().map(|rows| scaled(rows, &self.columns, &self.widths)));
        self.candidates.extend(candidates);
    }
}

pub(crate) fn state(task: &Task) -> State {
    State { surroundings: task.surroundings.clone(), hypothesis: task.hypothesis.clone() }
}

/// Derivatives of each candidate's whitened readings with respect to the parameters `columns`, per SI unit.
pub(crate) fn rows_of(
    state: &State,
    candidates: &[Candidate],
    columns: &[usize],
) -> Vec<DMatrix<f64>> {
    let poses = candidates.iter().flat_map(|candidate| candidate.poses.iter().cloned());
    let campaign = campaign(poses.collect(), &state.surroundings);
    let owner: Vec<usize> =
        candidates.iter().enumerate().flat_map(|(k, c)| c.poses.iter().map(move |_| k)).collect();
    let weighing = Weighing::equal(&campaign, &vec![true; campaign.poses.len()]);
    let mut flat: Vec<Vec<f64>> = vec![Vec::new(); candidates.len()];
    data_rows(&campaign, state, &weighing, columns, |at, row, _| {
        flat[owner[at.pose]].extend_from_slice(row);
    });
    let width = columns.len();
    flat.iter()
        .map(|flat| DMatrix::from_row_slice(flat.len() / width.max(1), width, flat))
        .collect()
}

/// Rows of the existing measurements, weighted as in their fit.
fn old_rows(known: Known<'_>, state: &State, columns: &[usize]) -> DMatrix<f64> {
    let Known { campaign, fit } = known;
    let used = vec![true; campaign.poses.len()];
    let weighing = Weighing { used, weights: fit.weights.clone(), factors: fit.factors.clone() };
    let mut flat = Vec::new();
    data_rows(campaign, state, &weighing, columns, |_, row, _| flat.extend_from_slice(row));
    DMatrix::from_row_slice(flat.len() / columns.len().max(1), columns.len(), &flat)
}

fn scaled(rows: &DMatrix<f64>, columns: &[usize], widths: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.nrows(), columns.len(), |i, j| rows[(i, columns[j])] * widths[j])
}

/// `Σ JᵀJ / n` over the test poses, with J the derivative of the TCP in base axes with respect to each column, as in [`crate::expected`].
fn focus(task: &Task, state: &State, columns: &[usize], widths: &[f64]) -> DMatrix<f64> {
    let mut focus = DMatrix::zeros(columns.len(), columns.len());
    let first = state.surroundings.numbers().len();
    for q in &task.asked {
        let rows = tool_rows(&state.hypothesis, q);
        let part = DMatrix::from_fn(3, columns.len(), |axis, j| {
            columns[j].checked_sub(first).map_or(0.0, |k| rows[(axis, k)] * widths[j])
        });
        focus += part.transpose() * part;
    }
    focus / task.asked.len().max(1) as f64
}

/// Derivative of the TCP position with respect to each free parameter, m per SI unit.
fn tool_rows(hypothesis: &Hypothesis, q: &Joints) -> DMatrix<f64> {
    let inputs = physics::Inputs::at_rest(*q);
    let pose = crate::Pose {
        inputs,
        arrival: crate::Arrival::Settled,
        recording: 0,
        row: 0,
        seen: Vec::new(),
    };
    let asked = Campaign {
        poses: vec![pose],
        surroundings: crate::Surroundings::default(),
        instruments: Vec::new(),
        recordings: Vec::new(),
    };
    let mut rows = DMatrix::zeros(3, hypothesis.free.len());
    let mut at_pose = Motions::of(hypothesis);
    follow(&hypothesis.model, &asked, None, |_, seen, memories| {
        for (k, motion) in at_pose.at(&inputs, memories, seen).iter().enumerate() {
            (0..3).for_each(|axis| rows[(axis, k)] = motion.shift[axis]);
        }
    });
    rows
}
