//! Lower bound on the uncertainty of parameters by an AR noise model.
//!
//! Cluster-robust uncertainties from blocks of time need no noise model, but rely on few blocks, of which every fitted parameter takes a share. They
//! are therefore compared with those of the AR model of the residual: `Var β = A Xᵀ Σ X A`. Variances are only increased, covariances with them;
//! parameters do not change.

use nalgebra::DMatrix;

use crate::engine::noise;
use crate::engine::normal_equations::LeastSquaresSolution;
use crate::engine::regression_data::{RegressionData, Regressor, residual, whitened_columns};

/// The covariance of a fit, with the variances of the parameters at `places` increased to at least those of the AR noise model.
pub(super) fn with_ar_floor(
    mut covariance: DMatrix<f64>,
    (table, columns): (&RegressionData, &[Regressor]),
    solved: &LeastSquaresSolution,
    places: &[usize],
    used: &[bool],
) -> DMatrix<f64> {
    let variances = ar_variances((table, columns), solved, places, used);
    for (place, variance) in places.iter().zip(variances) {
        let wider = libm::sqrt(variance / covariance[(*place, *place)]);
        if wider > 1.0 && wider.is_finite() {
            covariance.row_mut(*place).iter_mut().for_each(|x| *x *= wider);
            covariance.column_mut(*place).iter_mut().for_each(|x| *x *= wider);
        }
    }
    covariance
}

/// Variances of the parameters at `places` by the AR noise model.
fn ar_variances(
    (table, columns): (&RegressionData, &[Regressor]),
    solved: &LeastSquaresSolution,
    places: &[usize],
    used: &[bool],
) -> Vec<f64> {
    let mut all = vec![0.0; places.len()];
    let each = solved.columns.len() as f64 / table.joints().count().max(1) as f64;
    for joint in table.joints() {
        let left = residual(table, columns, solved, joint);
        let (colour, size) = noise::estimate_from_residual(table, joint, &left, used, each);
        let white = whitened_columns(table, columns, solved, joint);
        let scale = size / table.noise[joint].1;
        for (all, place) in all.iter_mut().zip(places) {
            let mut weights = vec![0.0; table.rows()];
            for (k, values) in &white {
                let share = scale * solved.covariance()[(*place, *k)];
                weights.iter_mut().zip(values).for_each(|(sum, x)| *sum += share * x);
            }
            let counts = used.iter().zip(&table.counts[joint]);
            weights.iter_mut().zip(counts).for_each(|(weight, (used, counts))| {
                *weight *= f64::from(u8::from(*used && *counts));
            });
            *all +=
                table.runs.iter().map(|run| colour.variance_of(&weights[run.clone()])).sum::<f64>();
        }
    }
    all
}
