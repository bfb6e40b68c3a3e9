//! Levenberg-Marquardt minimisation of a weighted sum of squares.
//!
//! The step solves `min |J dx − r|² + λ |D dx|²`, D the largest column norms seen so far (Moré 1978); λ follows the ratio of actual to predicted
//! reduction (Nielsen 1999). A step that does not lower the sum needs no new derivatives. A parameter that would go below its bound is fixed there
//! for the step of the others.
//!
//! The sum never increases; the same input gives the same bits; the number of steps is bounded. Columns and weights are selected by the caller.

use crate::campaign::Campaign;
use crate::least_squares::{ReadingWeights, cost, with_priors};
use crate::linearisation::Linearisation;
use crate::qr::QrFactor;
use std::sync::Arc;

/// Converged when a full step would reduce the sum by no more than this fraction.
const ENOUGH: f64 = 1e-13;
const STEPS_MAX: usize = 60;
const DAMPING_START: f64 = 1e-6;
const DAMPING_MAX: f64 = 1e12;

/// Result of a minimisation.
pub(crate) struct Minimum {
    pub(crate) linearisation: Arc<Linearisation>,
    /// Reduced system of data and priors at the end.
    pub(crate) triangle: QrFactor,
    /// Reduced system of the data alone at the end.
    pub(crate) data: QrFactor,
    pub(crate) steps: usize,
    pub(crate) converged: bool,
}

/// Termination criterion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Termination {
    /// Largest number of steps.
    pub(crate) steps_max: usize,
    /// Smallest predicted reduction of the sum by a full step, in units of the noise variance; with zero, steps end at rounding.
    pub(crate) gain_least: f64,
}

impl Termination {
    /// Until the predicted reduction is within rounding.
    pub(crate) const CONVERGED: Self = Self { steps_max: usize::MAX, gain_least: 0.0 };
}

/// Minimises over the columns `active`, starting from `linearisation`, whose data are already reduced to these columns.
pub(crate) fn minimise(
    campaign: &Campaign,
    mut linearisation: Arc<Linearisation>,
    mut data: QrFactor,
    weighing: &ReadingWeights,
    active: &[usize],
    until: Termination,
) -> Minimum {
    let mut sum = linearisation.cost(campaign, weighing);
    let mut triangle = with_priors(&data, &linearisation.state, active);
    let mut largest = vec![0.0_f64; active.len()];
    let (mut damping, mut growth) = (DAMPING_START, 2.0);
    let (mut steps, mut converged) = (0, false);
    while steps < until.steps_max.min(STEPS_MAX) && damping < DAMPING_MAX {
        let state = &linearisation.state;
        for (j, norm) in largest.iter_mut().enumerate() {
            *norm = norm.max(triangle.norm(j));
        }
        let lowest = state.step_lower_bounds(active);
        if predicted_full_reduction(&triangle, &lowest) <= until.gain_least.max(ENOUGH * sum) {
            converged = true;
            break;
        }
        let weights: Vec<f64> = largest.iter().map(|norm| damping.sqrt() * norm).collect();
        let step = triangle.solve_above(&weights, &lowest);
        let promised = predicted_reduction(&triangle, &step);
        let mut full = vec![0.0; state.width()];
        active.iter().zip(&step).for_each(|(column, by)| full[*column] = *by);
        // Derivatives are computed only once the step is accepted.
        let next = state.stepped(&full);
        let next_sum = cost(campaign, &next, weighing);
        let ratio = if promised > 0.0 { (sum - next_sum) / promised } else { -1.0 };
        if next_sum < sum {
            sum = next_sum;
            linearisation = Arc::new(Linearisation::of(campaign, next, &weighing.used));
            data = linearisation.triangle(campaign, weighing, active);
            triangle = with_priors(&data, &linearisation.state, active);
            let back = 2.0 * ratio - 1.0;
            damping = (damping * (1.0 - back * back * back).max(1.0 / 3.0)).max(1e-12);
            growth = 2.0;
            steps += 1;
        } else {
            // Rounding: the predicted reduction is too small compared with the sum to be verified.
            if promised <= 1e-11 * sum {
                converged = true;
                break;
            }
            damping *= growth;
            growth *= 2.0;
        }
    }
    Minimum { linearisation, triangle, data, steps, converged }
}

/// Reduction of the linearised sum of squares by a full step.
fn predicted_full_reduction(triangle: &QrFactor, lowest: &[f64]) -> f64 {
    if lowest.iter().all(|bound| bound.is_infinite()) {
        return triangle.total() - triangle.rest();
    }
    predicted_reduction(triangle, &triangle.solve_above(&vec![0.0; lowest.len()], lowest))
}

/// Reduction of the linearised sum of squares by this step.
pub(crate) fn predicted_reduction(triangle: &QrFactor, step: &[f64]) -> f64 {
    let mut left: f64 = triangle.rest();
    for i in 0..step.len() {
        let moved: f64 = (i..step.len()).map(|j| triangle.at(i, j) * step[j]).sum();
        let rest = triangle.at(i, step.len()) - moved;
        left += rest * rest;
    }
    triangle.total() - left
}
