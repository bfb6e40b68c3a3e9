//! Detectability of a hidden force effect, and whether another effect would have the same signature: z, ρ and gains as in the other domains
//! ([`crate::comparison`]).
//!
//! Nuisance parameters: the unrecorded spindle angle at the beginning of each pass; amplifier drift and the model's uncertain parameters, each with
//! its prior as one additional value.
//!
//! Expected values are computed without drawing noise. The evaluation does not depend on a solver's answer.

use crate::comparison::{
    Detectability, EffectComparison, add_model_nuisances, identifiable_parameters, prior_count,
};
use crate::effect::{BlindCase, EffectKind};
use crate::instrument::Whitener;
use crate::least_squares::{OrthonormalBasis, dot};
use crate::transform::Vector3;

use super::candidates::{candidates, free_parameter_count};
use super::case::{ForceCase, relative_time};
use super::kinds::{Effect, Kind};
use super::laws::SimulatedPasses;
use super::passes::{Engagement, ToolState};
use super::teeth::ToolShape;

/// Step of the spindle angle for its derivative, rad.
const ANGLE_STEP_RAD: f64 = 0.01;

/// Values of a case, linearised about the model and the other hidden effects.
pub struct LinearisedCase<'a> {
    case: &'a ForceCase,
    simulated: &'a SimulatedPasses<'a>,
    whitener: Whitener,
    base_effects: Vec<Effect>,
    base_forces: Vec<Vector3>,
    drift_count: usize,
}

/// Whitening of the rows in use.
#[must_use]
pub fn whitener(case: &ForceCase, ride: &SimulatedPasses<'_>, counts: &[bool]) -> Whitener {
    let follows = |before: usize, row: usize| ride.rows[before].pass == ride.rows[row].pass;
    Whitener::unit_variance(3, case.noise.autocorrelation, counts, follows)
}

/// Values of all axes in units of their noise, row by row.
#[must_use]
pub fn noise_scaled(case: &ForceCase, forces: &[Vector3]) -> Vec<f64> {
    let of_row = |force: &Vector3| -> Vector3 {
        std::array::from_fn(|k| force[k] / case.noise.total_sigma(k))
    };
    forces.iter().flat_map(of_row).collect()
}

impl<'a> LinearisedCase<'a> {
    /// The columns of recorded rows for which the force laws are defined; `examined`: index of the hidden effect under evaluation.
    #[must_use]
    pub fn of(
        case: &'a ForceCase,
        simulated: &'a SimulatedPasses<'a>,
        recorded: &[bool],
        examined: Option<usize>,
    ) -> Self {
        let others = case.hidden.iter().enumerate().filter(|(k, _)| Some(*k) != examined);
        let base_effects: Vec<Effect> =
            case.nominal().into_iter().chain(others.map(|(_, effect)| effect.clone())).collect();
        let base_forces = simulated.measured_forces(&base_effects);
        let rows = simulated.rows.iter().zip(recorded);
        let counts: Vec<bool> = rows
            .map(|(row, recorded)| *recorded && row.engagement != Engagement::Partial)
            .collect();
        let drift_count = if case.noise.drift > 0.0 { 3 * simulated.scene.passes.len() } else { 0 };
        Self {
            case,
            simulated,
            whitener: whitener(case, simulated, &counts),
            base_effects,
            base_forces,
            drift_count,
        }
    }

    /// Whitened values, followed by the prior entries: those of drifts, then those of the model's parameters.
    fn whiten(&self, forces: &[Vector3]) -> Vec<f64> {
        let mut whitened = self.whitener.apply(&noise_scaled(self.case, forces));
        whitened.resize(whitened.len() + self.drift_count + prior_count(self.case), 0.0);
        whitened
    }

    /// Whitened column of an effect.
    #[must_use]
    pub fn column(&self, effect: &Effect) -> Vec<f64> {
        let mut all = self.base_effects.clone();
        all.push(effect.clone());
        self.whiten(&difference(&self.simulated.measured_forces(&all), &self.base_forces))
    }

    /// Nuisance columns; the model's parameters except those that `except` revises.
    #[must_use]
    pub fn nuisances(&self, except: &Effect) -> OrthonormalBasis {
        let mut basis = OrthonormalBasis::default();
        let of_pass = |number: usize,
                       value: &dyn Fn(&ToolState, usize) -> Vector3|
         -> Vec<Vector3> {
            let rows = self.simulated.rows.iter().enumerate();
            rows.map(|(k, row)| if row.pass == number { value(row, k) } else { [0.0; 3] }).collect()
        };
        let passes = self.simulated.scene.passes.len();
        if !self.case.cut.turning {
            let shape = ToolShape { turned: ANGLE_STEP_RAD, ..ToolShape::default() };
            let turned = difference(
                &self.simulated.measured_forces_with_shape(&self.base_effects, shape),
                &self.base_forces,
            );
            for number in 0..passes {
                basis.add_column(self.whiten(&of_pass(number, &|_, k| turned[k])));
            }
        }
        for drift in 0..self.drift_count {
            let (number, axis) = (drift / 3, drift % 3);
            let ramp = |row: &ToolState, _: usize| {
                let mut force = [0.0; 3];
                force[axis] = relative_time(self.simulated.scene, row);
                force
            };
            let mut column = self.whiten(&of_pass(number, &ramp));
            let prior_row = column.len() - prior_count(self.case) - self.drift_count + drift;
            column[prior_row] = 1.0 / (self.case.noise.drift * self.case.noise.sigma[axis]);
            basis.add_column(column);
        }
        add_model_nuisances(&mut basis, self.case, &[except], |effect| self.column(effect));
        basis
    }

    /// Norm of a hidden effect after projection on the nuisance columns.
    #[must_use]
    pub fn strength(&self, effect: &Effect, basis: &OrthonormalBasis) -> f64 {
        let rest = basis.residual(&self.column(effect));
        dot(&rest, &rest).sqrt()
    }

    /// Detectability of hidden effect `which`, for which the columns were prepared.
    #[must_use]
    pub fn evaluate(&self, which: usize) -> Detectability {
        let truth = &self.case.hidden[which];
        let mut basis = self.nuisances(truth);
        for (k, other) in self.case.hidden.iter().enumerate() {
            if k != which {
                basis.add_column(self.column(other));
            }
        }
        let all = self.simulated.measured_forces(&self.case.true_effects());
        let mut without = self.case.true_effects();
        without.remove(self.case.modelled.len() + which);
        let rest = basis
            .residual(&self.whiten(&difference(&all, &self.simulated.measured_forces(&without))));
        let question = EffectComparison {
            name: truth.kind.name().map(|name| (name, None)),
            parameter_count: free_parameter_count(&self.case.cut, truth.kind),
            nuisances: &basis,
            effect: &rest,
            value_count: self.whitener.count(),
        };
        let candidates = candidates(&self.case.cut, self.simulated.scene);
        let mut detectability =
            question.compare(&candidates, |effect| self.column(effect), |_| false);
        detectability.determined =
            identifiable_parameters(truth, &basis, |effect| self.column(effect));
        match truth.kind {
            // Zero cross-talk coefficients are not parameters of the truth.
            Kind::CrossTalk => {
                let leaks = truth.parameters.iter().map(|x| *x != 0.0);
                detectability
                    .determined
                    .iter_mut()
                    .zip(leaks)
                    .for_each(|(stated, leaks)| *stated &= leaks);
            }
            // With two teeth only the cosine of a runout is observable.
            Kind::Runout if self.case.cut.teeth == 2 => detectability.determined.fill(false),
            _ => {}
        }
        detectability
    }
}

fn difference(a: &[Vector3], b: &[Vector3]) -> Vec<Vector3> {
    a.iter().zip(b).map(|(a, b)| crate::transform::sub(*a, *b)).collect()
}
