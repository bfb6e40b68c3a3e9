//! Cached residuals and derivatives of a whole campaign at one state, so that other weights, columns or noise models need no further evaluation of
//! the arm.
//!
//! Rows are those of [`visit_readings`], in its order, for the poses in use; weights and whitening are applied when rows are used.

use crate::autocorrelation::WhiteningFilter;
use crate::campaign::Campaign;
use crate::least_squares::{
    FitState, ReadingWeights, VisitScope, VisitedReading, prior_cost, visit_readings,
};
use crate::qr::QrFactor;
use crate::residual::ReadingResidual;

/// A measurement with the index of its first derivative.
#[derive(Debug)]
struct CachedReading {
    pose: usize,
    reading: usize,
    instrument: usize,
    stream: usize,
    rows: ReadingResidual,
    first: usize,
}

/// Norm of the residual of one measurement at a state, in units of the noise, with its number of components.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ResidualNorm {
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
    pub(crate) state: FitState,
    used: Vec<bool>,
    entries: Vec<CachedReading>,
    /// Derivatives by every column of the state, row-major, in units of the noise.
    derivatives: Vec<f64>,
}

impl Linearisation {
    pub(crate) fn of(campaign: &Campaign, state: FitState, used: &[bool]) -> Self {
        let effects_from = state.surroundings.parameters().len();
        let mut full = vec![vec![0.0; state.width()]; 3];
        let taken = campaign.poses.iter().zip(used).filter(|(_, used)| **used);
        let numbers = taken
            .flat_map(|(pose, _)| pose.seen.iter().map(|observation| observation.reading.count()));
        let mut derivatives = Vec::with_capacity(numbers.sum::<usize>() * state.width());
        let mut entries = Vec::new();
        let scope = VisitScope { used: Some(used), derivatives: true };
        visit_readings(campaign, &state, scope, |visited| {
            visited.rows.write_derivatives(effects_from, visited.motions, &mut full);
            let VisitedReading { pose, reading, instrument, stream, .. } = *visited;
            let first = derivatives.len();
            full.iter().take(visited.rows.count).for_each(|row| derivatives.extend_from_slice(row));
            let rows = visited.rows.clone();
            entries.push(CachedReading { pose, reading, instrument, stream, rows, first });
        });
        Self { state, used: used.to_vec(), entries, derivatives }
    }

    /// Whether it was computed for this state and these poses.
    pub(crate) fn matches_state(&self, state: &FitState, used: &[bool]) -> bool {
        self.used == used && self.state == *state
    }

    /// Visits the measurements in order, each with its derivatives, row-major.
    pub(crate) fn for_each_reading(&self, mut visit: impl FnMut(&VisitedReading<'_>, &[f64])) {
        let width = self.state.width();
        for CachedReading { pose, reading, instrument, stream, rows, first } in &self.entries {
            let (pose, reading, instrument) = (*pose, *reading, *instrument);
            let visited =
                VisitedReading { pose, reading, rows, motions: &[], instrument, stream: *stream };
            visit(&visited, &self.derivatives[*first..first + rows.count * width]);
        }
    }

    /// Passes the weighted and whitened rows, restricted to the columns `active`, each with its right-hand side.
    pub(crate) fn rows(
        &self,
        campaign: &Campaign,
        weighing: &ReadingWeights,
        active: &[usize],
        mut take: impl FnMut(&VisitedReading<'_>, &[f64], f64),
    ) {
        let width = self.state.width();
        let mut row = vec![0.0; active.len() + 1];
        let mut filter = WhiteningFilter::new(campaign);
        self.for_each_reading(|reading, slopes| {
            let scale = weighing.scale(reading);
            if scale == 0.0 {
                return;
            }
            for k in 0..reading.rows.count {
                let full = &slopes[k * width..];
                row.iter_mut().zip(active).for_each(|(slot, j)| *slot = scale * full[*j]);
                row[active.len()] = scale * reading.rows.residual[k];
                filter.pass(reading.pose, reading.instrument, reading.stream, k, &mut row);
                take(reading, &row[..active.len()], row[active.len()]);
            }
        });
    }

    /// The data reduced by QR over the columns `active`.
    pub(crate) fn triangle(
        &self,
        campaign: &Campaign,
        weighing: &ReadingWeights,
        active: &[usize],
    ) -> QrFactor {
        let mut triangle = QrFactor::new(active.len());
        self.rows(campaign, weighing, active, |_, row, right| triangle.push(row, right));
        triangle.reduce();
        triangle
    }

    /// Weighted sum of squares of data and priors: bit for bit that of [`crate::least_squares::cost`].
    pub(crate) fn cost(&self, campaign: &Campaign, weighing: &ReadingWeights) -> f64 {
        let mut sum = 0.0;
        self.rows(campaign, weighing, &[], |_, _, right| sum += right * right);
        sum + prior_cost(&self.state.hypothesis)
    }

    /// Norms of the residuals, in units of the stated noise.
    pub(crate) fn residual_norms(&self) -> Vec<ResidualNorm> {
        let length = |one: &CachedReading| {
            let CachedReading { reading, pose, instrument, stream, ref rows, .. } = *one;
            ResidualNorm {
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
