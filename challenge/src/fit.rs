//! Error on an unseen recording, and the oracle: parameters of the true form and of the model, fitted by Gauss-Newton. For all domains.
//!
//! Nuisance parameters are fitted on training rows only, for predictions and oracle alike. Errors of one pair are over the same rows, and do not
//! depend on which effects an answer reports.

use crate::comparison::prior_count;
use crate::effect::{BlindCase, Effect, EffectKind};
use crate::instrument::Whitener;
use crate::least_squares::OrthonormalBasis;

/// One recording: measured values, rows in use, and nuisance columns.
pub struct MeasuredRecording {
    /// Measured values, in a fixed order and unit.
    pub measured: Vec<f64>,
    /// Selects the rows in use.
    pub whitener: Whitener,
    /// Columns of the nuisance parameters, in the order of the values.
    pub nuisance_columns: Vec<Vec<f64>>,
}

impl MeasuredRecording {
    fn residual(&self, predicted: &[f64]) -> Vec<f64> {
        self.measured.iter().zip(predicted).map(|(a, b)| a - b).collect()
    }
}

/// The recording given to the solver, and the unseen one.
pub struct RecordingPair {
    /// Given to the solver.
    pub training: MeasuredRecording,
    /// Never seen by the solver.
    pub unseen: MeasuredRecording,
}

impl RecordingPair {
    /// Root mean square residual of the unseen recording, for predictions of both recordings.
    #[must_use]
    pub fn error(&self, training: &[f64], unseen: &[f64]) -> f64 {
        let mut basis = OrthonormalBasis::default();
        for column in &self.training.nuisance_columns {
            basis.add_column(self.training.whitener.apply(column));
        }
        let found = basis.solve(&self.training.whitener.apply(&self.training.residual(training)));
        let mut rest = self.unseen.residual(unseen);
        for (column, share) in self.unseen.nuisance_columns.iter().zip(found) {
            rest.iter_mut().zip(column).for_each(|(x, c)| *x -= share * c);
        }
        let kept = self.unseen.whitener.select(&rest);
        (kept.iter().map(|x| x * x).sum::<f64>() / kept.len().max(1) as f64).sqrt()
    }

    /// All effects with parameters fitted to the training rows in this number of Gauss-Newton steps; `exact` predicts these rows.
    #[must_use]
    pub fn fit_effects<C: BlindCase>(
        &self,
        case: &C,
        steps: usize,
        exact: impl Fn(&[Effect<C::Kind>]) -> Vec<f64>,
    ) -> Vec<Effect<C::Kind>> {
        let mut all = case.nominal();
        all.extend(case.hidden().iter().cloned());
        for _ in 0..steps {
            self.gauss_newton_step(case, &mut all, &exact);
        }
        all
    }

    /// One step on the uncertain parameters of the model's effects, which come first, and on all parameters of the hidden ones.
    fn gauss_newton_step<C: BlindCase>(
        &self,
        case: &C,
        all: &mut [Effect<C::Kind>],
        exact: &impl Fn(&[Effect<C::Kind>]) -> Vec<f64>,
    ) {
        let part = &self.training;
        let now = exact(all);
        let mut target = part.whitener.apply(&part.residual(&now));
        for (known, effect) in case.modelled().iter().zip(all.iter()) {
            let parameters =
                known.nominal.parameters.iter().zip(&effect.parameters).zip(&known.sigma);
            target.extend(parameters.map(|((stated, now), sigma)| (stated - now) / sigma));
        }
        let mut basis = OrthonormalBasis::default();
        let whole = |values: &[f64]| {
            let mut column = part.whitener.apply(values);
            column.resize(target.len(), 0.0);
            column
        };
        part.nuisance_columns.iter().for_each(|column| {
            basis.add_column(whole(column));
        });
        let mut reading = target.len() - prior_count(case);
        let mut places = Vec::new();
        for which in 0..all.len() {
            let sigma = case.modelled().get(which).map(|modelled| modelled.sigma.as_slice());
            for n in 0..sigma.map_or(all[which].parameters.len(), <[f64]>::len) {
                let h = 1e-3 * C::Kind::step(&all[which], n);
                let mut moved = all.to_vec();
                moved[which].parameters[n] += h;
                let moved = exact(&moved);
                let slope: Vec<f64> = moved.iter().zip(&now).map(|(a, b)| (a - b) / h).collect();
                let mut column = whole(&slope);
                if let Some(sigma) = sigma {
                    column[reading] = 1.0 / sigma[n];
                    reading += 1;
                }
                basis.add_column(column);
                places.push((which, n));
            }
        }
        let found = basis.solve(&target);
        for ((which, n), by) in places.into_iter().zip(&found[part.nuisance_columns.len()..]) {
            let effect = &mut all[which];
            effect.parameters[n] = C::Kind::bounded(effect, n, effect.parameters[n] + by);
        }
    }
}
