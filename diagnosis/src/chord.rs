//! Minimisation with derivatives held fixed (chord method; Ortega and Rheinboldt, Iterative Solution of Nonlinear Equations, 1970): a step costs one
//! evaluation of the residuals.
//!
//! For refits of which only state and sum of squares are used. Where effects are nearly linear, derivatives change by thousandths between two fits, and
//! each step leaves about a thousandth of the error; elsewhere the caller continues with new derivatives ([`crate::levenberg_marquardt`]).
//!
//! The sum never increases.

use crate::campaign::Campaign;
use crate::fit::{GAIN_LEAST, refit_from};
use crate::fit_result::Fit;
use crate::hypothesis::{FreeParameter, Hypothesis};
use crate::least_squares::{
    FitState, ReadingWeights, for_each_residual, prior_sum_and_gradient, with_priors,
};
use crate::levenberg_marquardt::predicted_reduction;
use crate::linearisation::Linearisation;
use crate::qr::QrFactor;
use crate::simd::subtract_scaled;

/// Largest number of steps.
const STEPS_MAX: usize = 8;
/// Largest ratio of the predicted reductions of successive steps; beyond it, new derivatives cost less. No unit, 0 to 1. Default 0.1.
const REDUCTION_RATIO_MAX: f64 = 0.1;

/// Rows with fixed derivatives.
pub(crate) struct FrozenRows<'a> {
    campaign: &'a Campaign,
    weighing: ReadingWeights,
    /// Weighted and whitened derivatives, row-major, `width` each.
    derivatives: Vec<f64>,
    width: usize,
}

/// End of a minimisation with fixed derivatives.
pub(crate) struct ChordMinimum {
    pub(crate) state: FitState,
    /// Weighted sum of squares of data and priors at this state.
    pub(crate) sum: f64,
    /// Whether a further step would reduce the sum by no more than [`GAIN_LEAST`].
    pub(crate) has_converged: bool,
}

impl<'a> FrozenRows<'a> {
    /// The rows of a linearisation, restricted to `columns`.
    pub(crate) fn of(
        campaign: &'a Campaign,
        linearisation: &Linearisation,
        weighing: ReadingWeights,
        columns: &[usize],
    ) -> Self {
        let mut derivatives = Vec::new();
        linearisation.rows(campaign, &weighing, columns, |_, row, _| {
            derivatives.extend_from_slice(row);
        });
        Self { campaign, weighing, derivatives, width: columns.len() }
    }

    /// Minimises from `state` over its columns `active`, which are the columns `places` of the rows; `triangle`: data and priors reduced to them. Ends
    /// where steps converge too slowly, or would not lower the sum.
    pub(crate) fn minimise(
        &self,
        state: FitState,
        (active, places): (&[usize], &[usize]),
        triangle: &QrFactor,
    ) -> ChordMinimum {
        let mut reached = ChordMinimum { state, sum: f64::INFINITY, has_converged: false };
        let mut next = reached.state.clone();
        let mut gain_before = f64::INFINITY;
        for _ in 0..STEPS_MAX {
            let (sum, gradient) = self.sum_and_gradient(&next, (active, places));
            if sum >= reached.sum {
                break;
            }
            (reached.state, reached.sum) = (next, sum);
            let system = triangle.with_gradient(gradient);
            let lowest = reached.state.step_lower_bounds(active);
            let step = system.solve_above(&vec![0.0; active.len()], &lowest);
            let gain = predicted_reduction(&system, &step);
            if gain <= GAIN_LEAST {
                reached.has_converged = true;
                break;
            }
            if gain > REDUCTION_RATIO_MAX * gain_before {
                break;
            }
            gain_before = gain;
            let mut full = vec![0.0; reached.state.width()];
            active.iter().zip(&step).for_each(|(column, by)| full[*column] = *by);
            next = reached.state.stepped(&full);
        }
        reached
    }

    /// Sum of squares at a state, and its gradient `Jᵀr` with the fixed derivatives.
    fn sum_and_gradient(
        &self,
        state: &FitState,
        (active, places): (&[usize], &[usize]),
    ) -> (f64, Vec<f64>) {
        let mut sum = 0.0;
        let mut falling = vec![0.0; self.width];
        let mut rows = self.derivatives.chunks_exact(self.width.max(1));
        for_each_residual(self.campaign, state, &self.weighing, |residual| {
            sum += residual * residual;
            if let Some(row) = rows.next() {
                subtract_scaled(&mut falling, residual, row);
            }
        });
        let (prior_sum, of_priors) = prior_sum_and_gradient(state, active);
        let gradient = places.iter().zip(of_priors).map(|(place, prior)| prior - falling[*place]);
        (sum + prior_sum, gradient.collect())
    }
}

/// Refits of a fit without some of its effects, with its weights, its noise factors and its derivatives.
pub(crate) struct RefitsWithout<'a> {
    before: &'a Fit,
    rows: FrozenRows<'a>,
    /// The data reduced to all columns of the fit's state.
    data: QrFactor,
}

impl<'a> RefitsWithout<'a> {
    /// Refits of `before` to the poses `used`.
    pub(crate) fn of(campaign: &'a Campaign, before: &'a Fit, used: &[bool]) -> Self {
        let weighing = ReadingWeights::of_fit(before, used);
        let linearisation = before.rows_at(campaign, before.state(), used);
        let all: Vec<usize> = (0..linearisation.state.width()).collect();
        let data = linearisation.triangle(campaign, &weighing, &all);
        let rows = FrozenRows::of(campaign, &linearisation, weighing, &all);
        Self { before, rows, data }
    }

    /// The refitted state of `hypothesis`, which is that of the fit without the effects `removed` (by index in the fit's model), with new derivatives
    /// where these are needed.
    pub(crate) fn state_without(&self, hypothesis: &Hypothesis, removed: &[usize]) -> FitState {
        let reached = self.minimum_without(hypothesis, removed);
        if reached.has_converged { reached.state } else { self.refit_from(reached.state).state() }
    }

    fn refit_from(&self, state: FitState) -> Fit {
        refit_from(self.rows.campaign, state, self.before, &self.rows.weighing.used)
    }

    fn minimum_without(&self, hypothesis: &Hypothesis, removed: &[usize]) -> ChordMinimum {
        let state = FitState { hypothesis: hypothesis.clone(), ..self.before.state() };
        let first = self.before.column_of(0);
        let own = self.before.hypothesis.free.iter().enumerate();
        let own: Vec<_> = own.filter(|(_, free)| !removed.contains(&free.effect)).collect();
        // An effect that the model states is not removed, but has its stated parameters and priors again.
        let is_same = |((_, own), free): (&(usize, &FreeParameter), &FreeParameter)| {
            FreeParameter { effect: free.effect, ..**own } == *free
        };
        if own.len() != hypothesis.free.len() || !own.iter().zip(&hypothesis.free).all(is_same) {
            return ChordMinimum { state, sum: f64::INFINITY, has_converged: false };
        }
        let places: Vec<usize> = (0..first).chain(own.iter().map(|(k, _)| first + k)).collect();
        let data = self.data.of_columns(&places);
        let (state, active, _) = state.with_undetermined_at_priors(&data);
        let triangle = with_priors(&data.of_columns(&active), &state, &active);
        let places: Vec<usize> = active.iter().map(|column| places[*column]).collect();
        self.rows.minimise(state, (&active, &places), &triangle)
    }
}

#[cfg(test)]
mod tests {
    use super::RefitsWithout;
    use crate::campaign_simulation::simulate_readings;
    use crate::fit::{FitSettings, fit, refit_with_fixed_weights};
    use crate::hypothesis::Hypothesis;
    use crate::robust_weights::Influence;
    use crate::test_campaigns::{nominal_robot, unmeasured_campaign};
    use physics::{AnyEffect, ParameterValues};

    #[test]
    fn a_refit_with_fixed_derivatives_is_the_refit_with_new_ones() {
        let arm = nominal_robot().arm;
        let effect = |kind, joint, given: &[(&str, &[f64])]| {
            AnyEffect::build(kind, &arm, Some(joint), ParameterValues(given)).expect("an effect")
        };
        let mut with_all = Hypothesis::fixed(nominal_robot());
        for added in [
            effect("joint_offset", 2, &[("offset", &[2e-3])]),
            effect("axis_tilt", 3, &[("tilt", &[1e-3, -2e-3])]),
            effect("joint_ratio", 1, &[("ratio", &[4e-4])]),
        ] {
            with_all.add(added, &[]).expect("room");
        }
        let unmeasured = unmeasured_campaign(3, 80);
        let around = &unmeasured.surroundings;
        let campaign = simulate_readings(&unmeasured, &with_all.model, around, 1.0, 5);
        let used: Vec<bool> = (0..80).map(|pose| pose % 5 != 0).collect();
        let settings = FitSettings::full(&used, Influence::Redescending);
        let last = fit(&campaign, &with_all, &settings);
        let refits = RefitsWithout::of(&campaign, &last, &used);
        for removed in 0..3 {
            let without = last.hypothesis.without(removed);
            let expected = refit_with_fixed_weights(&campaign, &without, &last, &used);
            assert!(refits.minimum_without(&without, &[removed]).has_converged, "{removed}");
            let is_expected = |sum: f64| (sum - expected.sum_of_squares).abs() < 0.02;
            let state = refits.state_without(&without, &[removed]);
            let sum = crate::least_squares::cost(&campaign, &state, &refits.rows.weighing);
            assert!(is_expected(sum), "{removed}: {sum} not {}", expected.sum_of_squares);
        }
    }
}
