//! Fits a mean over recordings to values with an uncertainty, and to bounds where a value was not found.
//!
//! Method: linear regression with censored observations (Tobin, "Estimation of Relationships for Limited Dependent Variables", Econometrica 26, 1958), by Newton
//! steps of the log-likelihood. A value `y` with standard uncertainty `σ` has variance `σ² + τ²`; the scatter `τ` between recordings is estimated with it (maximum
//! likelihood, as the variance between studies in a meta-analysis: DerSimonian and Laird, Controlled Clinical Trials 7, 1986). What was not found lies within
//! `±limit` of zero, except that a share of findings is missed although the effect is there.
//!
//! Not physical: scatter is taken as independent from one recording to the next. Slow wandering without a recorded cause looks like growth.

use std::f64::consts::{PI, SQRT_2};

/// Columns of the mean: level, change, temperature.
pub const TERMS: usize = 3;
/// Largest number of iterations of mean and scatter.
const ROUNDS: usize = 40;
/// Change of the log-likelihood below which the fit has converged.
const LOG_LIKELIHOOD_TOLERANCE: f64 = 1e-7;

/// Observation of a parameter by one recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading {
    /// It was found.
    Value {
        /// The number.
        value: f64,
        /// Its standard uncertainty.
        sigma: f64,
    },
    /// It was not found, so that its size is below the limit.
    Below {
        /// Least size that would have been found.
        limit: f64,
        /// Standard uncertainty that a value would have had.
        sigma: f64,
    },
}

/// A row of a fit.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// The observation.
    pub reading: Reading,
    /// Its columns: the mean is their sum, each times a coefficient.
    pub columns: [f64; TERMS],
}

/// A fitted mean.
#[derive(Debug, Clone, Copy)]
pub struct Fit {
    /// Coefficients of the columns.
    pub coefficients: [f64; TERMS],
    /// Their covariance.
    pub covariance: [[f64; TERMS]; TERMS],
    /// Scatter between recordings beyond the stated uncertainty.
    pub scatter: f64,
    /// Maximum of the log-likelihood.
    pub log_likelihood: f64,
}

impl Fit {
    /// The mean at a row.
    #[must_use]
    pub fn mean(&self, columns: &[f64; TERMS]) -> f64 {
        dot(&self.coefficients, columns)
    }
}

/// Fits the columns selected by `active`; others have the coefficient 0. Starts at `start`, where there is one.
///
/// `missed` is the share of recordings in which the effect is missed although it is there.
#[must_use]
pub fn fit(rows: &[Row], active: [bool; TERMS], missed: f64, start: Option<&Fit>) -> Fit {
    let spread = spread(rows);
    let mut scatter = start.map_or(spread, |fit| fit.scatter);
    let mut coefficients = start.map_or([0.0; TERMS], |fit| fit.coefficients);
    for (coefficient, is_active) in coefficients.iter_mut().zip(active) {
        *coefficient = if is_active { *coefficient } else { 0.0 };
    }
    // The first step ignores bounds: far from the values their slope dominates.
    if start.is_none() {
        let values: Vec<Row> = rows.iter().copied().filter(Row::is_value).collect();
        coefficients = newton_step(&values, &coefficients, active, scatter, missed).0;
    }
    let mut last = f64::NEG_INFINITY;
    let mut covariance = [[0.0; TERMS]; TERMS];
    for _ in 0..ROUNDS {
        let before = sum(rows, &coefficients, scatter, missed);
        let (wanted, found) = newton_step(rows, &coefficients, active, scatter, missed);
        covariance = found;
        coefficients = improved(rows, &coefficients, &wanted, scatter, missed, before);
        scatter = scatter_estimate(rows, &coefficients, spread);
        let now = sum(rows, &coefficients, scatter, missed);
        if (now - last).abs() < LOG_LIKELIHOOD_TOLERANCE {
            break;
        }
        last = now;
    }
    let log_likelihood = sum(rows, &coefficients, scatter, missed);
    Fit { coefficients, covariance, scatter, log_likelihood }
}

impl Row {
    fn is_value(&self) -> bool {
        matches!(self.reading, Reading::Value { .. })
    }
}

/// Standard deviation of the values about their mean: no scatter is larger.
fn spread(rows: &[Row]) -> f64 {
    let values: Vec<f64> =
        rows.iter().filter_map(|row| value(row).map(|(value, _)| value)).collect();
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt()
}

fn value(row: &Row) -> Option<(f64, f64)> {
    match row.reading {
        Reading::Value { value, sigma } => Some((value, sigma)),
        Reading::Below { .. } => None,
    }
}

/// Log-likelihood of all rows.
fn sum(rows: &[Row], coefficients: &[f64; TERMS], scatter: f64, missed: f64) -> f64 {
    let of_row = |row: &Row| {
        let mean = dot(coefficients, &row.columns);
        match row.reading {
            Reading::Value { value, sigma } => {
                let variance = variance(sigma, scatter);
                (1.0 - missed).ln()
                    - 0.5 * ((value - mean).powi(2) / variance + (2.0 * PI * variance).ln())
            }
            Reading::Below { limit, sigma } => {
                let inside = CensoredProbability::of(limit, mean, variance(sigma, scatter).sqrt());
                ((1.0 - missed) * inside.probability + missed).ln()
            }
        }
    };
    rows.iter().map(of_row).sum()
}

fn variance(sigma: f64, scatter: f64) -> f64 {
    (sigma * sigma + scatter * scatter).max(f64::MIN_POSITIVE)
}

/// Probability that a normal value lies within `±limit`, with slope and curvature of its logarithm by the mean.
struct CensoredProbability {
    probability: f64,
    slope: f64,
    curvature: f64,
}

impl CensoredProbability {
    fn of(limit: f64, mean: f64, sigma: f64) -> Self {
        let (low, high) = ((-limit - mean) / sigma, (limit - mean) / sigma);
        let density = |z: f64| (-0.5 * z * z).exp() / (2.0 * PI).sqrt();
        // On the side on which both are small, so that the difference does not cancel.
        let probability = if low > 0.0 {
            upper_tail(low) - upper_tail(high)
        } else {
            upper_tail(-high) - upper_tail(-low)
        };
        if probability < 1e-290 {
            return Self { probability: 0.0, slope: 0.0, curvature: 0.0 };
        }
        let first = (density(low) - density(high)) / probability;
        let second = (low * density(low) - high * density(high)) / probability - first * first;
        Self { probability, slope: first / sigma, curvature: (-second / (sigma * sigma)).max(0.0) }
    }
}

/// Probability that a standard normal value exceeds `z`.
fn upper_tail(z: f64) -> f64 {
    0.5 * libm::erfc(z / SQRT_2)
}

/// Newton step of the coefficients, and the inverse of the curvature.
fn newton_step(
    rows: &[Row],
    parameters: &[f64; TERMS],
    active: [bool; TERMS],
    scatter: f64,
    missed: f64,
) -> ([f64; TERMS], [[f64; TERMS]; TERMS]) {
    let (mut slope, mut curvature) = ([0.0; TERMS], [[0.0; TERMS]; TERMS]);
    for row in rows {
        let mean = dot(parameters, &row.columns);
        let (first, second) = match row.reading {
            Reading::Value { value, sigma } => {
                let variance = variance(sigma, scatter);
                ((value - mean) / variance, 1.0 / variance)
            }
            Reading::Below { limit, sigma } => {
                let inside = CensoredProbability::of(limit, mean, variance(sigma, scatter).sqrt());
                let hit = (1.0 - missed) * inside.probability;
                let share = hit / (hit + missed);
                (share * inside.slope, share * inside.curvature)
            }
        };
        for (i, (slope, line)) in slope.iter_mut().zip(&mut curvature).enumerate() {
            *slope += first * row.columns[i];
            for (cell, column) in line.iter_mut().zip(&row.columns) {
                *cell += second * row.columns[i] * column;
            }
        }
    }
    for (i, is_active) in active.iter().enumerate() {
        if !is_active || curvature[i][i] <= 0.0 {
            (0..TERMS).for_each(|j| (curvature[i][j], curvature[j][i]) = (0.0, 0.0));
            (curvature[i][i], slope[i]) = (1.0, 0.0);
        }
    }
    let mut covariance = inverse(&curvature);
    let mut wanted = *parameters;
    for (i, wanted) in wanted.iter_mut().enumerate() {
        *wanted += dot(&covariance[i], &slope);
    }
    for (i, is_active) in active.iter().enumerate() {
        if !is_active {
            covariance[i][i] = 0.0;
        }
    }
    (wanted, covariance)
}

/// Line search: the step is halved until the likelihood improves.
fn improved(
    rows: &[Row],
    from: &[f64; TERMS],
    wanted: &[f64; TERMS],
    scatter: f64,
    missed: f64,
    before: f64,
) -> [f64; TERMS] {
    let mut share = 1.0;
    for _ in 0..20 {
        let mut tried = *from;
        for (tried, wanted) in tried.iter_mut().zip(wanted) {
            *tried += share * (wanted - *tried);
        }
        if sum(rows, &tried, scatter, missed) >= before {
            return tried;
        }
        share *= 0.5;
    }
    *from
}

/// Maximum-likelihood estimate of the scatter between recordings: where the slope of the likelihood by the variance is zero, or none.
fn scatter_estimate(rows: &[Row], coefficients: &[f64; TERMS], largest: f64) -> f64 {
    let squares: Vec<(f64, f64)> = rows
        .iter()
        .filter_map(|row| {
            value(row).map(|(value, sigma)| {
                ((value - dot(coefficients, &row.columns)).powi(2), sigma * sigma)
            })
        })
        .collect();
    let slope = |between: f64| -> f64 {
        let derivative = |(square, variance_own): &(f64, f64)| {
            let variance = (variance_own + between).max(f64::MIN_POSITIVE);
            (square / variance - 1.0) / variance
        };
        squares.iter().map(derivative).sum()
    };
    if squares.is_empty() || slope(largest * largest * 1e-12) <= 0.0 {
        return largest * 1e-6;
    }
    let (mut low, mut high) = (largest * largest * 1e-12, 4.0 * largest * largest);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        let end = if slope(middle) > 0.0 { &mut low } else { &mut high };
        *end = middle;
        if high - low < 1e-4 * high {
            break;
        }
    }
    (0.5 * (low + high)).sqrt()
}

fn dot(a: &[f64; TERMS], b: &[f64; TERMS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Inverse of a symmetric matrix with a positive diagonal, scaled, with a ridge far below the determined values.
fn inverse(matrix: &[[f64; TERMS]; TERMS]) -> [[f64; TERMS]; TERMS] {
    let scale: [f64; TERMS] = std::array::from_fn(|i| 1.0 / matrix[i][i].sqrt());
    let mut left: [[f64; TERMS]; TERMS] =
        std::array::from_fn(|i| std::array::from_fn(|j| matrix[i][j] * scale[i] * scale[j]));
    (0..TERMS).for_each(|i| left[i][i] += 1e-9);
    let mut right = [[0.0; TERMS]; TERMS];
    (0..TERMS).for_each(|i| right[i][i] = 1.0);
    for pivot in 0..TERMS {
        let by = left[pivot][pivot];
        for j in 0..TERMS {
            left[pivot][j] /= by;
            right[pivot][j] /= by;
        }
        for i in (0..TERMS).filter(|i| *i != pivot) {
            let factor = left[i][pivot];
            for j in 0..TERMS {
                left[i][j] -= factor * left[pivot][j];
                right[i][j] -= factor * right[pivot][j];
            }
        }
    }
    std::array::from_fn(|i| std::array::from_fn(|j| right[i][j] * scale[i] * scale[j]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(reading: Reading, x: f64) -> Row {
        Row { reading, columns: [1.0, x, 0.0] }
    }

    #[test]
    fn values_alone_give_the_weighted_mean() {
        let rows = [(1.0, 0.1), (1.3, 0.2)]
            .map(|(value, sigma)| row(Reading::Value { value, sigma }, 0.0));
        let fit = fit(&rows, [true, false, false], 0.05, None);
        // Weights 100 and 25, as the scatter is within the uncertainty.
        assert!((fit.coefficients[0] - 1.06).abs() < 1e-6, "{fit:?}");
        assert!((fit.covariance[0][0] - 1.0 / 125.0).abs() < 1e-6, "{fit:?}");
    }

    #[test]
    fn the_slope_of_the_likelihood_is_its_derivative() {
        for mean in [-2.0, -0.3, 0.0, 0.4, 3.0] {
            let log = |mean: f64| CensoredProbability::of(0.7, mean, 0.4).probability.ln();
            let inside = CensoredProbability::of(0.7, mean, 0.4);
            let numeric = (log(mean + 1e-5) - log(mean - 1e-5)) / 2e-5;
            assert!((inside.slope - numeric).abs() < 1e-5 * (1.0 + numeric.abs()), "{mean}");
            let bent = (log(mean + 1e-4) + log(mean - 1e-4) - 2.0 * log(mean)) / 1e-8;
            assert!((inside.curvature + bent).abs() < 1e-4 * (1.0 + bent.abs()), "{mean}");
        }
    }

    #[test]
    fn bounds_keep_a_line_from_leaving_them() {
        let values = (0..10).map(|i| {
            let x = f64::from(i);
            row(Reading::Value { value: 0.1 * x, sigma: 0.01 }, x)
        });
        let bounds = (0..10).map(|_| row(Reading::Below { limit: 0.05, sigma: 0.01 }, 0.0));
        let rows: Vec<Row> = values.chain(bounds).collect();
        let fit = fit(&rows, [true, true, false], 0.05, None);
        assert!(fit.coefficients[0].abs() < 0.05, "{fit:?}");
        assert!((fit.coefficients[1] - 0.1).abs() < 0.005, "{fit:?}");
    }

    #[test]
    fn a_few_recordings_that_miss_an_effect_move_nothing() {
        let values = (0..40).map(|i| {
            row(Reading::Value { value: 0.2 + 0.004 * f64::from(i % 3 - 1), sigma: 0.005 }, 0.0)
        });
        let missed = (0..3).map(|_| row(Reading::Below { limit: 0.1, sigma: 0.005 }, 0.0));
        let rows: Vec<Row> = values.chain(missed).collect();
        let fit = fit(&rows, [true, false, false], 0.05, None);
        assert!((fit.coefficients[0] - 0.2).abs() < 0.001 && fit.scatter < 0.002, "{fit:?}");
    }

    #[test]
    fn scatter_beyond_the_stated_uncertainty_is_found() {
        let rows: Vec<Row> = (0..200)
            .map(|i| {
                let value = 1.0 + 0.05 * (f64::from(i) * 2.399).sin() * SQRT_2;
                row(Reading::Value { value, sigma: 0.01 }, 0.0)
            })
            .collect();
        let fit = fit(&rows, [true, false, false], 0.05, None);
        assert!((fit.scatter - 0.049).abs() < 0.002, "{fit:?}");
    }
}
