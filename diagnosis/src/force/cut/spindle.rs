//! Angle and true speed of the spindle: the recording states a speed that may be slightly wrong, and no angle.
//!
//! The speed is the one at which the forces have most energy at harmonics of the tooth-passing frequency; the angle of each segment is the one at
//! which the tooth model fits best, with its coefficients free within their priors. Among equally good angles, 0 at the start of a segment is
//! preferred. Angles in rad.

use crate::engine::statistics::median;
use nalgebra::{SMatrix, SVector};
use std::f64::consts::TAU;

use super::case::Case;
use super::cut_model::{CutModel, RowState, Spindle};

/// Largest relative deviation of the spindle speed.
const SPEED_DEVIATION_MOST: f64 = 4e-3;
/// Step of the speed search: phase of the highest harmonic over the longest segment, in cycles.
const STEP_TURNS: f64 = 0.2;
/// Largest number of steps.
const STEPS_MOST: f64 = 3000.0;
/// Number of harmonics of the tooth-passing frequency that are used.
const HARMONICS: u32 = 2;
/// Minimum ratio of the energy at the best speed to the median over all speeds.
const ENERGY_RATIO_LEAST: f64 = 3.0;
/// Number of angles tried per pitch, and of finer steps around the best.
const ANGLES: u32 = 72;
const FINE_STEPS: i32 = 8;
/// Prior standard deviation of the coefficients, relative to the largest.
const COEFFICIENT_SIGMA: f64 = 0.3;
/// Angles whose log-likelihoods differ by less are equally good.
const EQUALLY_GOOD: f64 = 3.0;
/// Number of coefficients: three of the chip, three of the edge, three of the sensor's bias.
const COEFFICIENTS: usize = 9;

type Matrix = SMatrix<f64, COEFFICIENTS, COEFFICIENTS>;
type Vector = SVector<f64, COEFFICIENTS>;

/// Finds speed and angles of the spindle from the `used` rows.
pub(super) fn find(case: &Case, used: &[bool]) -> Spindle {
    let segments = case.estimates.spindle.phases.len();
    let mut spindle = Spindle { phases: vec![0.0; segments], excess_speed: 0.0 };
    if case.model.cutter.turning {
        return spindle;
    }
    spindle.excess_speed = excess_speed(case, used);
    for segment in 0..segments {
        let rows: Vec<usize> = (0..used.len())
            .filter(|row| used[*row] && case.model.rows[*row].segment == segment)
            .filter(|row| case.model.rows[*row].is_cutting)
            .collect();
        if rows.len() > 2 * COEFFICIENTS {
            spindle.phases[segment] = start_angle(case, &rows, &spindle, segment);
        }
    }
    spindle
}

/// Relative excess of the spindle speed over the stated one.
fn excess_speed(case: &Case, used: &[bool]) -> f64 {
    let teeth = case.model.cutter.teeth;
    let rows: Vec<usize> =
        (0..used.len()).filter(|k| used[*k] && case.model.rows[*k].is_cutting).collect();
    let turns = |segment: usize| {
        let of_segment =
            rows.iter().map(|row| &case.model.rows[*row]).filter(|s| s.segment == segment);
        let [low, high] = of_segment
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], state: &RowState| {
                [l.min(state.angle_rad), h.max(state.angle_rad)]
            });
        ((high - low) / TAU).max(0.0)
    };
    let longest = (0..case.estimates.spindle.phases.len()).map(turns).fold(0.0, f64::max);
    let highest = f64::from(HARMONICS * teeth);
    let step =
        (STEP_TURNS / (longest.max(1.0) * highest)).max(2.0 * SPEED_DEVIATION_MOST / STEPS_MOST);
    let steps = (SPEED_DEVIATION_MOST / step) as i32;
    let gathered: Vec<f64> =
        (-steps..=steps).map(|k| harmonic_energy(case, &rows, f64::from(k) * step)).collect();
    let best = (0..gathered.len()).max_by(|a, b| gathered[*a].total_cmp(&gathered[*b]));
    let Some(best) = best.filter(|best| *best > 0 && *best + 1 < gathered.len()) else {
        return 0.0;
    };
    if gathered[best] < ENERGY_RATIO_LEAST * median(gathered.iter().copied()) {
        return 0.0;
    }
    let [a, b, c] = [gathered[best - 1], gathered[best], gathered[best + 1]];
    let bend = a - 2.0 * b + c;
    let beside = if bend < 0.0 { 0.5 * (a - c) / bend } else { 0.0 };
    (f64::from(best as i32 - steps) + beside) * step
}

/// Energy of all segments at harmonics of the tooth-passing frequency.
fn harmonic_energy(case: &Case, rows: &[usize], faster: f64) -> f64 {
    let segments = case.estimates.spindle.phases.len();
    let teeth = f64::from(case.model.cutter.teeth);
    let mut sums = vec![[[0.0; 2 * HARMONICS as usize]; 3]; segments];
    let mut means = vec![([0.0; 3], 0.0); segments];
    for row in rows {
        let (sum, count) = &mut means[case.model.rows[*row].segment];
        *count += 1.0;
        for (axis, measured) in case.measured.iter().enumerate() {
            sum[axis] += measured.as_ref().map_or(0.0, |values| values[*row]);
        }
    }
    for row in rows {
        let state = &case.model.rows[*row];
        let (sin, cos) = libm::sincos(teeth * state.angle_rad * (1.0 + faster));
        let (mean, count) = &means[state.segment];
        let values: [f64; 3] = std::array::from_fn(|axis| {
            let measured = case.measured[axis].as_ref();
            measured.map_or(0.0, |values| values[*row] - mean[axis] / count)
        });
        let (mut s, mut c) = (sin, cos);
        for harmonic in 0..HARMONICS as usize {
            for (axis, value) in values.iter().enumerate() {
                sums[state.segment][axis][2 * harmonic] += value * c;
                sums[state.segment][axis][2 * harmonic + 1] += value * s;
            }
            (s, c) = (s * cos + c * sin, c * cos - s * sin);
        }
    }
    let energy = |(sum, mean): (&[[f64; 4]; 3], &([f64; 3], f64))| {
        sum.iter().flatten().map(|x| x * x).sum::<f64>() / mean.1.max(1.0)
    };
    sums.iter().zip(&means).map(energy).sum()
}

/// Spindle angle at the start of a segment, rad.
fn start_angle(case: &Case, rows: &[usize], spindle: &Spindle, segment: usize) -> f64 {
    let pitch = TAU / f64::from(case.model.cutter.teeth.max(1));
    let step = pitch / f64::from(ANGLES);
    let equations_at = |phase: f64| {
        let mut spindle = spindle.clone();
        spindle.phases[segment] = phase;
        AngleNormalEquations::of(case, rows, &spindle)
    };
    let coarse: Vec<(f64, AngleNormalEquations)> = (0..ANGLES)
        .map(|k| f64::from(k) * step)
        .map(|phase| (if phase > 0.5 * pitch { phase - pitch } else { phase }, equations_at(phase)))
        .collect();
    // The noise is estimated from the residual of the best angle with unconstrained coefficients.
    let free = coarse.iter().map(|(_, sums)| sums.residual_with_ridge(&[1e-12; COEFFICIENTS]));
    let count = 3.0 * rows.len() as f64;
    let variance = |left: f64| (left / count).max(1e-18);
    let mut noise = variance(free.fold(f64::INFINITY, f64::min));
    let prior = CoefficientPrior::of(case, rows);
    let mut best = prior.best_angle(&coarse, noise);
    let mut finer = step;
    for _ in 0..3 {
        let from = best.0;
        finer /= f64::from(FINE_STEPS);
        let mut around: Vec<(f64, AngleNormalEquations)> = (-FINE_STEPS..=FINE_STEPS)
            .map(|k| from + f64::from(k) * finer)
            .map(|phase| (phase, equations_at(phase)))
            .collect();
        let free = around.iter().map(|(_, sums)| sums.residual_with_ridge(&[1e-12; COEFFICIENTS]));
        noise = noise.min(variance(free.fold(f64::INFINITY, f64::min)));
        around.push((0.0, equations_at(0.0)));
        best = prior.best_angle(&around, noise);
    }
    best.0
}

/// Normal equations of the tooth model at one angle.
struct AngleNormalEquations {
    gram: Matrix,
    right: Vector,
    square: f64,
}

impl AngleNormalEquations {
    fn of(case: &Case, rows: &[usize], spindle: &Spindle) -> Self {
        let law: &CutModel = &case.model;
        let (mut gram, mut right, mut square) = (Matrix::zeros(), Vector::zeros(), 0.0);
        for row in rows {
            let state = &law.rows[*row];
            let bite = law.tooth_forces(spindle, state, 0.0);
            for (axis, measured) in case.measured.iter().enumerate() {
                let Some(values) = measured else { continue };
                let mut column = Vector::zeros();
                for k in 0..3 {
                    column[k] = bite.chip.col(k)[axis];
                    column[3 + k] = bite.edge.col(k)[axis];
                }
                column[6 + axis] = 1.0;
                gram.syger(1.0, &column, &column, 1.0);
                right += column * values[*row];
                square += values[*row] * values[*row];
            }
        }
        gram.fill_upper_triangle_with_lower_triangle();
        Self { gram, right, square }
    }

    /// Residual sum of squares with a ridge penalty: `ridge` per parameter, relative to the diagonal of the normal matrix.
    fn residual_with_ridge(&self, ridge: &[f64; COEFFICIENTS]) -> f64 {
        let prior = std::array::from_fn(|k| ridge[k] * self.gram[(k, k)]);
        self.residual_with_prior(&prior, &Vector::zeros())
    }

    fn residual_with_prior(&self, prior: &[f64; COEFFICIENTS], means: &Vector) -> f64 {
        let mut gram = self.gram;
        let mut right = self.right;
        let mut square = self.square;
        for k in 0..COEFFICIENTS {
            gram[(k, k)] += prior[k];
            right[k] += prior[k] * means[k];
            square += prior[k] * means[k] * means[k];
            if gram[(k, k)] <= 0.0 {
                gram[(k, k)] = 1.0;
            }
        }
        let scale = Vector::from_fn(|k, _| 1.0 / libm::sqrt(gram[(k, k)]));
        let scaled = Matrix::from_fn(|i, j| gram[(i, j)] * scale[i] * scale[j]);
        let right = right.component_mul(&scale);
        match scaled.cholesky() {
            Some(factors) => square - right.dot(&factors.solve(&right)),
            None => square,
        }
    }
}

/// Prior of the coefficients: stated values and standard deviations.
struct CoefficientPrior {
    values: Vector,
    sigma: Vector,
}

impl CoefficientPrior {
    fn of(case: &Case, rows: &[usize]) -> Self {
        let [(_, chip), (_, edge)] = case.coefficients();
        let feeds = rows.iter().map(|row| case.model.rows[*row].feed_per_tooth_m);
        let feed = feeds.sum::<f64>() / rows.len().max(1) as f64;
        let [of_chip, of_edge] = case.largest_stated_coefficients();
        let mut values = Vector::zeros();
        let mut sigma = Vector::repeat(f64::INFINITY);
        for k in 0..3 {
            (values[k], values[3 + k]) = (chip[k], edge[k]);
            sigma[k] = COEFFICIENT_SIGMA * of_chip.max(of_edge / feed.max(1e-9));
            sigma[3 + k] = COEFFICIENT_SIGMA * of_edge.max(of_chip * feed);
        }
        Self { values, sigma }
    }

    /// The best angle and its misfit; 0 if it is equally good.
    fn best_angle(&self, tried: &[(f64, AngleNormalEquations)], noise: f64) -> (f64, f64) {
        let misfit = |sums: &AngleNormalEquations| {
            let prior = std::array::from_fn(|k| {
                let one = self.sigma[k];
                if one.is_finite() { noise / (one * one) } else { 1e-12 * sums.gram[(k, k)] }
            });
            0.5 * sums.residual_with_prior(&prior, &self.values) / noise
        };
        let all: Vec<(f64, f64)> =
            tried.iter().map(|(angle, sums)| (*angle, misfit(sums))).collect();
        let lowest = all.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0.0, 0.0));
        let as_stated = all.iter().copied().find(|(angle, _)| *angle == 0.0);
        as_stated.filter(|(_, misfit)| *misfit < lowest.1 + EQUALLY_GOOD).unwrap_or(lowest)
    }
}
