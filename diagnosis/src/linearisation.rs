//! Cached residuals and derivatives of a whole campaign at one state, so that other weights, columns or noise models need no further evaluation of
//! the arm.
//!
//! Rows are those of [`visit`], in its order, for the poses in use; weights and whitening are applied when rows are used.

use crate::campaign::Campaign;
use crate::colour::Filter;
use crate::problem::{At, Look, State, Weighing, prior_cost, visit};
use crate::residual::Rows;
use crate::triangle::Triangle;

/// A measurement with the index of its first derivative.
#[derive(Debug)]
struct Entry {
    pose: usize,
    reading: usize,
    instrument: usize,
    stream: usize,
    rows: Rows,
    first: usize,
}

/// Norm of the residual of one measurement at a state, in units of the noise, with its number of components.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Length {
    pub(crate) reading: usize,
    pub(crate) pose: usize,
    pub(crate) instrument: usize,
    pub(crate) stream: usize,
    pub(crate) count: usize,
    pub(crate) length: f64,
}

/// The rows at one state.
#[derive(Debug)]
pub(crate) struct Linearisation {
    pub(crate) state: State,
    used: Vec<bool>,
    entries: Vec<Entry>,
    /// Derivatives by every column of the state, row-major, in units of the noise.
    slopes: Vec<f64>,
}

impl Linearisation {
    pub(crate) fn of(campaign: &Campaign, state: State, used: &[bool]) -> Self {
        let effects_from = state.surroundings.numbers().len();
        let mut full = vec![vec![0.0; state.width()]; 3];
        let taken = campaign.poses.iter().zip(used).filter(|(_, used)| **used);
        let numbers = taken.flat_map(|(pose, _)| pose.seen.iter().map(|seen| seen.reading.count()));
        let mut slopes = Vec::with_capacity(numbers.sum::<usize>() * state.width());
        let mut entries = Vec::new();
        let look = Look { used: Some(used), derivatives: true };
        visit(campaign, &state, look, |at| {
            at.rows.fill(effects_from, at.motions, &mut full);
            let At { pose, reading, instrument, stream, .. } = *at;
            let first = slopes.len();
            full.iter().take(at.rows.count).for_each(|row| slopes.extend_from_slice(row));
            let rows = at.rows.clone();
            entries.push(Entry { pose, reading, instrument, stream, rows, first });
        });
        Self { state, used: used.to_vec(), entries, slopes }
    }

    /// Whether it was computed for this state and these poses.
    pub(crate) fn shows(&self, state: &State, used: &[bool]) -> bool {
        self.used == used && self.state == *state
    }

    /// Visits the measurements in order, each with its derivatives, row-major.
    pub(crate) fn look(&self, mut look: impl FnMut(&At<'_>, &[f64])) {
        let width = self.state.width();
        for Entry { pose, reading, instrument, stream, rows, first } in &self.entries {
            let (pose, reading, instrument) = (*pose, *reading, *instrument);
            let at = At { pose, reading, rows, motions: &[], instrument, stream: *stream };
            look(&at, &self.slopes[*first..first + rows.count * width]);
        }
    }

    /// Passes the weighted and whitened rows, restricted to the columns `active`, each with its right-hand side.
    pub(crate) fn rows(
        &self,
        campaign: &Campaign,
        weighing: &Weighing,
        active: &[usize],
        mut take: impl FnMut(&At<'_>, &[f64], f64),
    ) {
        let width = self.state.width();
        let mut row = vec![0.0; active.len() + 1];
        let mut filter = Filter::new(campaign);
        self.look(|at, slopes| {
            let scale = weighing.scale(at);
            if scale == 0.0 {
                return;
            }
            for k in 0..at.rows.count {
                let full = &slopes[k * width..];
                row.iter_mut().zip(active).for_each(|(slot, j)| *slot = scale * full[*j]);
                row[active.len()] = scale * at.rows.residual[k];
                filter.pass(at.pose, at.instrument, at.stream, k, &mut row);
                take(at, &row[..active.len()], row[active.len()]);
            }
        });
    }

    /// The data reduced by QR over the columns `active`.
    pub(crate) fn triangle(
        &self,
        campaign: &Campaign,
        weighing: &Weighing,
        active: &[usize],
    ) -> Triangle {
        let mut triangle = Triangle::new(active.len());
        self.rows(campaign, weighing, active, |_, row, right| triangle.push(row, right));
        triangle.reduce();
        triangle
    }

    /// Weighted sum of squares of data and priors: bit for bit that of [`crate::problem::cost`].
    pub(crate) fn cost(&self, campaign: &Campaign, weighing: &Weighing) -> f64 {
        let mut sum = 0.0;
        self.rows(campaign, weighing, &[], |_, _, right| sum += right * right);
        sum + prior_cost(&self.state.hypothesis)
    }

    /// Norms of the residuals, in units of the stated noise.
    pub(crate) fn lengths(&self) -> Vec<Length> {
        let length = |one: &Entry| {
            let Entry { reading, pose, instrument, stream, ref rows, .. } = *one;
            Length {
                reading,
                pose,
                instrument,
                stream,
                count: rows.count,
                length: rows.residual.length(),
            }
        };
        self.entries.iter().map(length).collect()
    }
}
