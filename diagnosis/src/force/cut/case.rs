//! Data of one comparison of forces with a cut: rows, tooth model at the current parameters, its derivatives as columns, noise.
//!
//! The model is linearised at the current parameters; solving gives new parameters, at which it is linearised again (Gauss-Newton). Amplifier drift
//! and parameters with a stated uncertainty are always fitted too, and angle and speed of the spindle in the variant that fits them. Selects nothing. SI
//! units.

use glam::DVec3;
use nalgebra::DMatrix;
use physics::ToothForces;

use super::cut_model::{CHIP, CutModel, EDGE, PARAMETERS, RowState, Spindle};
use crate::autocorrelation::ArModel;
use crate::engine::dictionary::CandidateDictionary;
use crate::engine::noise;
use crate::engine::normal_equations::{LeastSquaresSolution, NormalEquations};
use crate::engine::regression_data;
use crate::engine::regression_data::Regressor;
use crate::engine::regression_data::{RegressionData, residual};
use crate::engine::split::RowSets;
use crate::engine::validation::{rms_of, sum_of_squares};

/// Step of the spindle angle for derivatives and for borders of engagement, rad.
const ANGLE_STEP: f64 = 5e-3;
/// A row lies at a border of engagement if a change of `TURNED` in either direction changes the engaged share of a tooth by this much.
const ENGAGEMENT_CHANGE_MOST: f64 = 0.3;
/// Largest change of a phase in one iteration, rad.
const PHASE_CHANGE_MOST: f64 = 0.2;
/// Maximum number of Gauss-Newton iterations.
const ROUNDS: usize = 4;
/// A smaller gain in log-likelihood ends the iteration.
const GAIN_LEAST: f64 = 0.05;

/// A column whose squared norm, after projecting out the other columns, is a smaller share of its own adds nothing. Far below the usual threshold,
/// because a candidate's column retains little after projecting out the nuisance column of the same parameter with a wide prior.
const RESIDUAL_NORM_SHARE_LEAST: f64 = 1e-8;
/// Prior standard deviation of an amplifier's drift over a segment, as a multiple of the noise.
pub(super) const DRIFT_PRIOR_RATIO: f64 = 0.15;
/// The stated noise is limited to the range from the residual divided by this factor to the residual.
const NOISE_RATIO_MOST: f64 = 2.0;

/// Current parameter estimates.
#[derive(Clone, Debug)]
pub(super) struct Estimates {
    pub(super) parameters: Vec<f64>,
    pub(super) spindle: Spindle,
    /// Drift of each axis at the end of each segment, three values per segment, N.
    pub(super) drift: Vec<f64>,
    /// Negative log prior density of the parameters with a prior, up to a constant.
    pub(super) prior_penalty: f64,
}

/// A parameter that the model states with an uncertainty.
#[derive(Clone, Copy, Debug)]
pub(super) struct UncertainParameter {
    /// Index in the list of parameters.
    pub(super) parameter: usize,
    /// Standard uncertainty, SI units.
    pub(super) sigma: f64,
}

/// Columns of nuisance parameters.
#[derive(Clone, Debug, Default)]
pub(super) struct NuisanceColumns {
    /// Spindle: phase of each segment, then the speed.
    pub(super) spindle: Vec<usize>,
    /// Amplifier drift: three per segment.
    pub(super) drift: Vec<usize>,
    /// Parameters that the model states with an uncertainty.
    pub(super) uncertain_parameters: Vec<usize>,
}

#[derive(Clone)]
pub(super) struct Case {
    pub(super) model: CutModel,
    pub(super) estimates: Estimates,
    /// Recorded force per axis and row, N.
    pub(super) measured: [Option<Vec<f64>>; 3],
    pub(super) table: RegressionData,
    pub(super) library: CandidateDictionary,
    /// Parameters of each column with their weights; indices from `NUMBERS` on are phases of segments, the speed, drifts and their curvatures.
    pub(super) column_parameters: Vec<Vec<(usize, f64)>>,
    pub(super) always: Vec<usize>,
    pub(super) nuisance: NuisanceColumns,
    pub(super) uncertain_parameters: Vec<UncertainParameter>,
    /// Stated noise of each axis, N.
    pub(super) stated_noise: [Option<f64>; 3],
    pub(super) row_sets: RowSets,
}

impl Estimates {
    /// The model as stated.
    pub(super) fn as_stated(spindle: Spindle) -> Self {
        let drift = vec![0.0; 3 * spindle.phases.len()];
        Self { parameters: vec![0.0; PARAMETERS], spindle, drift, prior_penalty: 0.0 }
    }

    /// Drift of an axis in a row, N.
    fn drift_at(&self, axis: usize, state: &RowState) -> f64 {
        self.drift[3 * state.segment + axis] * state.relative_time
    }
}

impl Case {
    /// Predicted readings per axis, N.
    pub(super) fn readings(&self, estimates: &Estimates) -> [Vec<f64>; 3] {
        let bites = self.model.all_tooth_forces(&estimates.spindle);
        let reader = self.model.reading_model(&estimates.parameters);
        by_axis(bites.iter().enumerate().map(|(k, b)| reader.reading(k, b)))
    }

    /// Residual per axis, N.
    pub(super) fn residual(&self, estimates: &Estimates) -> [Vec<f64>; 3] {
        let mut left = self.readings(estimates);
        for (axis, (left, measured)) in left.iter_mut().zip(&self.measured).enumerate() {
            let Some(values) = measured else {
                left.fill(0.0);
                continue;
            };
            for ((x, m), state) in left.iter_mut().zip(values).zip(&self.model.rows) {
                *x = m - *x - estimates.drift_at(axis, state);
            }
        }
        left
    }

    /// First index of phases, speed, drifts and drift curvatures in the list of parameters.
    pub(super) fn nuisance_offsets(&self) -> [usize; 4] {
        let segments = self.estimates.spindle.phases.len();
        let speed = PARAMETERS + segments;
        [PARAMETERS, speed, speed + 1, speed + 1 + 3 * segments]
    }

    /// Selects the columns that every fit includes; those of the spindle only in the variant that fits them.
    pub(super) fn set_always_fitted(&mut self, is_doubted: bool) {
        let of_spindle = self.nuisance.spindle.iter().filter(|_| is_doubted);
        let rest = self.nuisance.drift.iter().chain(&self.nuisance.uncertain_parameters);
        self.always = of_spindle.chain(rest).copied().collect();
    }

    /// Linearises the model at `estimates`: right-hand side, and the wanted columns.
    fn linearise_at(
        &self,
        estimates: &Estimates,
        wanted: &[usize],
    ) -> ([Vec<f64>; 3], Vec<(usize, Regressor)>) {
        let bites = self.model.all_tooth_forces(&estimates.spindle);
        let mut used: Vec<usize> = wanted
            .iter()
            .flat_map(|k| self.column_parameters[*k].iter().map(|(parameter, _)| *parameter))
            .collect();
        used.sort_unstable();
        used.dedup();
        let (numbers, turned): (Vec<usize>, Vec<usize>) =
            used.iter().partition(|k| **k < PARAMETERS);
        let slopes = self.model.derivatives(&bites, &estimates.parameters, &numbers);
        let mut target = self.residual(estimates);
        for (axis, target) in target.iter_mut().enumerate() {
            let rows = target.iter_mut().zip(&self.model.rows);
            rows.for_each(|(x, state)| *x += estimates.drift_at(axis, state));
        }
        for (k, slope) in numbers.iter().zip(&slopes) {
            for (target, slope) in target.iter_mut().zip(slope) {
                let value = estimates.parameters[*k];
                target.iter_mut().zip(slope).for_each(|(t, x)| *t += value * x);
            }
        }
        let drifts = self.nuisance_offsets()[2];
        let is_turned = turned.iter().any(|parameter| *parameter < drifts);
        let by_angle =
            if is_turned { self.angle_derivative(estimates) } else { Default::default() };
        let column = |k: usize| {
            let mut parts: [Vec<f64>; 3] =
                std::array::from_fn(|_| vec![0.0; self.model.rows.len()]);
            for (parameter, weight) in &self.column_parameters[k] {
                match numbers.iter().position(|n| n == parameter) {
                    Some(place) => add_weighted(&mut parts, &slopes[place], *weight),
                    None if *parameter >= drifts => {
                        self.add_drift_column(parameter - drifts, &mut parts);
                    }
                    None => add_weighted(
                        &mut parts,
                        &self.spindle_column(parameter - PARAMETERS, &by_angle),
                        1.0,
                    ),
                }
            }
            let is_nonzero = |values: &Vec<f64>| values.iter().any(|x| *x != 0.0);
            let parts = parts.into_iter().enumerate().filter(|(_, values)| is_nonzero(values));
            Regressor { parts: parts.map(|(axis, values)| (axis, values.into())).collect() }
        };
        let columns = wanted.iter().map(|k| (*k, column(*k))).collect();
        (target, columns)
    }

    /// Derivative of the readings with respect to the spindle angle, N/rad.
    fn angle_derivative(&self, estimates: &Estimates) -> [Vec<f64>; 3] {
        let reader = self.model.reading_model(&estimates.parameters);
        by_axis(self.model.rows.iter().enumerate().map(|(row, state)| {
            let force_at = |by: f64| -> DVec3 {
                let bite: ToothForces = self.model.tooth_forces(&estimates.spindle, state, by);
                reader.reading(row, &bite)
            };
            (force_at(ANGLE_STEP) - force_at(-ANGLE_STEP)) / (2.0 * ANGLE_STEP)
        }))
    }

    /// Column of the phase of one segment, or, for the last index, of the speed.
    fn spindle_column(&self, which: usize, by_angle: &[Vec<f64>; 3]) -> [Vec<f64>; 3] {
        let is_speed = which == self.estimates.spindle.phases.len();
        let weight = |row: usize| {
            let state = &self.model.rows[row];
            if is_speed { state.angle_rad } else { f64::from(u8::from(state.segment == which)) }
        };
        std::array::from_fn(|axis| {
            by_angle[axis].iter().enumerate().map(|(row, x)| x * weight(row)).collect()
        })
    }

    /// Adds the linear drift of one axis over one segment, or its curvature.
    fn add_drift_column(&self, which: usize, parts: &mut [Vec<f64>; 3]) {
        let lines = 3 * self.estimates.spindle.phases.len();
        let (which, is_bend) = (which % lines, which >= lines);
        let rows = parts[which % 3].iter_mut().zip(&self.model.rows);
        for (x, state) in rows.filter(|(_, state)| state.segment == which / 3) {
            *x += if is_bend {
                state.relative_time * (1.0 - state.relative_time)
            } else {
                state.relative_time
            };
        }
    }

    /// Linearises the model at the current parameters, for all columns of the library.
    pub(super) fn linearise(&mut self) {
        let all: Vec<usize> = (0..self.column_parameters.len()).collect();
        let (target, columns) = self.linearise_at(&self.estimates, &all);
        self.set_target(target);
        columns.into_iter().for_each(|(k, column)| self.library.columns[k] = column);
    }

    fn set_target(&mut self, target: [Vec<f64>; 3]) {
        for (axis, values) in target.into_iter().enumerate() {
            self.table.target[axis] = self.measured[axis].is_some().then_some(values);
        }
    }

    /// Selects the rows that count: not in entry or exit, and not at a border of engagement.
    pub(super) fn select_counted_rows(&mut self, is_between: &[bool]) {
        let spindle = &self.estimates.spindle;
        let counts: Vec<bool> = self
            .model
            .rows
            .iter()
            .zip(is_between)
            .map(|(state, between)| {
                let engaged = |by: f64| self.model.tooth_forces(spindle, state, by).engaged;
                !between
                    && (engaged(ANGLE_STEP) - engaged(-ANGLE_STEP)).abs() < ENGAGEMENT_CHANGE_MOST
            })
            .collect();
        self.table.counts.fill(counts);
    }

    pub(super) fn products(&self, used: &[bool]) -> NormalEquations {
        let columns: Vec<&Regressor> = self.library.columns.iter().collect();
        let products =
            NormalEquations::new(&self.table, &columns, self.library.prior.clone(), used);
        NormalEquations { further_share_min: RESIDUAL_NORM_SHARE_LEAST, ..products }
    }

    /// Estimates each axis' noise from the residual of the fit of all candidates.
    pub(super) fn estimate_noise(&mut self) {
        for _ in 0..2 {
            self.table.noise.iter_mut().for_each(|(colour, _)| *colour = ArModel::default());
            let rich = self.products(&self.row_sets.train);
            let rich = rich.solve(&(0..self.library.columns.len()).collect::<Vec<usize>>());
            self.table.noise = noise::estimate_noise(
                &self.table,
                &self.library.columns,
                &rich,
                &self.row_sets.train,
            );
            for ((_, size), stated) in self.table.noise.iter_mut().zip(self.stated_noise) {
                *size =
                    stated.map_or(*size, |stated| stated.clamp(*size / NOISE_RATIO_MOST, *size));
            }
            for (index, column) in self.nuisance.drift.iter().enumerate() {
                let sigma = DRIFT_PRIOR_RATIO * self.table.noise[index % 3].1;
                self.library.prior[*column] = 1.0 / (sigma * sigma);
            }
        }
    }

    /// Parameters from a solution of the linearised model.
    pub(super) fn estimates_from(
        &self,
        from: &Estimates,
        solved: &LeastSquaresSolution,
    ) -> Estimates {
        let mut estimates = Estimates::as_stated(from.spindle.clone());
        let [phases, speed, drifts, bends] = self.nuisance_offsets();
        for (k, value) in solved.columns.iter().zip(&solved.values) {
            estimates.prior_penalty += 0.5 * self.library.prior[*k] * value * value;
            for (parameter, weight) in &self.column_parameters[*k] {
                match *parameter {
                    parameter if parameter >= bends => {}
                    parameter if parameter >= drifts => {
                        estimates.drift[parameter - drifts] += value;
                    }
                    parameter if parameter == speed => estimates.spindle.excess_speed += value,
                    parameter if parameter >= phases => {
                        estimates.spindle.phases[parameter - phases] +=
                            value.clamp(-PHASE_CHANGE_MOST, PHASE_CHANGE_MOST);
                    }
                    parameter => estimates.parameters[parameter] += weight * value,
                }
            }
        }
        estimates
    }

    /// Negative log-likelihood of parameters on rows, including their prior, up to a constant.
    pub(super) fn misfit(&self, estimates: &Estimates, used: &[bool]) -> f64 {
        let left = self.residual(estimates);
        let mut sum = estimates.prior_penalty;
        for axis in self.table.joints() {
            let white = self.table.whitened(axis, &left[axis]);
            let counts = &self.table.counts[axis];
            let rows = (0..white.len()).filter(|row| used[*row] && counts[*row]);
            sum += 0.5 * rows.map(|row| white[row] * white[row]).sum::<f64>();
        }
        sum
    }

    /// Fits the parameters of the given columns to the nonlinear model by Gauss-Newton iterations; returns them and their misfit.
    pub(super) fn fit_nonlinear(
        &self,
        start: &Estimates,
        columns: &[usize],
        used: &[bool],
    ) -> (Estimates, f64) {
        let mut estimates = start.clone();
        let kept: Vec<usize> =
            columns.iter().flat_map(|k| self.column_parameters[*k].iter().map(|d| d.0)).collect();
        for (k, number) in estimates.parameters.iter_mut().enumerate() {
            if !kept.contains(&k) {
                *number = 0.0;
            }
        }
        let mut best = (estimates.clone(), f64::INFINITY);
        for _ in 0..ROUNDS {
            let (target, taken) = self.linearise_at(&estimates, columns);
            let mut table = self.table.clone();
            for (axis, values) in target.into_iter().enumerate() {
                table.target[axis] = self.measured[axis].is_some().then_some(values);
            }
            let refs: Vec<&Regressor> = taken.iter().map(|(_, column)| column).collect();
            let prior = columns.iter().map(|k| self.library.prior[*k]).collect();
            let products = NormalEquations::new(&table, &refs, prior, used);
            let mut solved = products.solve(&(0..columns.len()).collect::<Vec<usize>>());
            solved.columns.iter_mut().for_each(|k| *k = columns[*k]);
            estimates = self.estimates_from(&estimates, &solved);
            let misfit = self.misfit(&estimates, used);
            let gained = best.1 - misfit;
            if gained > 0.0 {
                best = (estimates.clone(), misfit);
            }
            if gained < GAIN_LEAST {
                break;
            }
        }
        best
    }

    /// RMS residual on `used` rows, weighted by the noise of each axis and scaled by the geometric mean of these, N.
    pub(super) fn rms(&self, solved: &LeastSquaresSolution, used: &[bool]) -> f64 {
        rms_of(&self.table, &self.library.columns, solved, used, &self.table.counts)
    }

    /// Half the sum of squares of the innovations on `used` rows, in units of the noise: negative log-likelihood.
    pub(super) fn negative_log_likelihood(
        &self,
        solved: &LeastSquaresSolution,
        used: &[bool],
    ) -> f64 {
        let of_axis = |axis: usize| {
            let left = residual(&self.table, &self.library.columns, solved, axis);
            0.5 * sum_of_squares(&self.table, axis, &self.table.whitened(axis, &left), used)
        };
        self.table.joints().map(of_axis).sum()
    }

    pub(super) fn covariance(&self, solved: &LeastSquaresSolution, used: &[bool]) -> DMatrix<f64> {
        regression_data::covariance(&self.table, &self.library.columns, solved, used)
    }

    /// Largest stated shear and edge coefficient, N/m² and N/m.
    pub(super) fn largest_stated_coefficients(&self) -> [f64; 2] {
        let force = self.model.stated_forces.first().copied().unwrap_or_default();
        [
            force.chip(&self.model.cutter).abs().max_element(),
            force.edge(&self.model.cutter, 0.0).abs().max_element(),
        ]
    }

    /// Coefficients of the stated cut with the model's effects: first index, and tangential, radial, axial values.
    pub(super) fn coefficients(&self) -> [(usize, DVec3); 2] {
        let force = self.model.stated_forces.first().copied().unwrap_or_default();
        let cutter = &self.model.cutter;
        [(CHIP.from, force.chip(cutter)), (EDGE.from, force.edge(cutter, 0.0))]
    }
}

fn add_weighted(parts: &mut [Vec<f64>; 3], more: &[Vec<f64>; 3], weight: f64) {
    for (part, more) in parts.iter_mut().zip(more) {
        part.iter_mut().zip(more).for_each(|(x, m)| *x += weight * m);
    }
}

fn by_axis(rows: impl Iterator<Item = DVec3>) -> [Vec<f64>; 3] {
    let mut all: [Vec<f64>; 3] = Default::default();
    for row in rows {
        all.iter_mut().zip(row.to_array()).for_each(|(list, x)| list.push(x));
    }
    all
}
