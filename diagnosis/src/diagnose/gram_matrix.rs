//! Gram matrix of all candidate columns: effects are added, removed and exchanged without a further pass over the data.
//!
//! Rows are linearised at a fit. The part of the right-hand side that the effects of this fit explain is added back, so that they compete with the
//! other candidates again. Columns are scaled to unit length; they are included and removed by the sweep operator (Goodnight, A tutorial on the SWEEP
//! operator, 1979).
//!
//! Nuisance parameters, among them parameters with a stated uncertainty, are always included. The selection itself is in `stepwise`.

use crate::candidates::Candidate;
use crate::engine::partial_cholesky::PartialCholesky;
use crate::hypothesis::parameter_key;
use crate::score_test::{CandidateMotions, ScoreTest};
use crate::simd::subtract_scaled;
use nalgebra::DMatrix;
use physics::spec::{Role, Unit};
use std::ops::Range;
use std::sync::Arc;

/// Least share of a column's squared length that must be orthogonal to the included columns; below it the column is linearly dependent on them.
const INDEPENDENT_SHARE_MIN: f64 = 1e-6;

/// Least ratio of the standard deviation of a parameter's prior to its standard uncertainty by the data alone; below it the prior determines the
/// estimate, and the parameter is not included.
const PRIOR_RATIO_MIN: f64 = 3.0;

/// A candidate with its parameters at the point of linearisation.
#[derive(Clone)]
pub(super) struct LinearisedCandidate {
    pub(super) candidate: Candidate,
    /// Parameters at the point of linearisation, one per probe, SI; zeros if the fit does not contain the effect.
    pub(super) linearised_at: Vec<f64>,
    /// Parameters that a fit holds fixed, by stem (name in files, without the suffix of the unit).
    pub(super) fixed: &'static [&'static str],
    /// Part of the penalty that is waived, in the sum of squares: the effect replaced one with fewer parameters on the evidence of a nonlinear fit.
    pub(super) waived_penalty: f64,
    /// Tool displacements per unit of each parameter, if they are cached.
    pub(super) moves: Option<Arc<CandidateMotions>>,
}

impl LinearisedCandidate {
    /// A candidate that the fit does not contain.
    pub(super) fn unfitted(fixed: &'static [&'static str], candidate: Candidate) -> Self {
        let linearised_at = vec![0.0; candidate.probes.len()];
        Self { linearised_at, candidate, fixed, waived_penalty: 0.0, moves: None }
    }

    /// Number of nonlinear parameters, which are searched for outside the columns. The phase of a wave is not counted, since sine and cosine are
    /// columns.
    pub(super) fn nonlinear_count(&self) -> usize {
        let Some(effect) = self.candidate.probes.first().map(|probe| &probe.effect) else {
            return 0;
        };
        // The position of a single mass follows from the masses at the corners, which are columns.
        if self.candidate.changes().is_some() || self.candidate.is_one_mass() {
            return 0;
        }
        if self.candidate.is_spring() {
            return self.candidate.trial_parameter_count();
        }
        let is_searched = |value: &usize| {
            parameter_key(effect, *value).is_some_and(|key| {
                key.parameter.role == Role::Nonlinear
                    && key.parameter.unit != Unit::PhaseRadian
                    && !self.fixed.contains(&key.parameter.stem)
            })
        };
        (0..effect.values().len()).filter(is_searched).count()
    }
}

/// Gram matrix of the candidate columns and the right-hand side, swept by the included columns.
#[derive(Clone)]
pub(super) struct GramMatrix {
    /// Products of columns scaled to unit length; the last row and column belong to the right-hand side.
    products: DMatrix<f64>,
    /// Euclidean lengths of the columns before scaling, priors included.
    lengths: Vec<f64>,
    /// Columns of each entry.
    columns_of: Vec<Range<usize>>,
    /// Share of the data in the squared length of each column; the remainder comes from its prior.
    data_share: Vec<f64>,
    /// Whether each column belongs to a correction of an effect of the model; a fit contains such columns however small their information is.
    is_correction: Vec<bool>,
    is_included: Vec<bool>,
}

/// Estimated parameters of one candidate beside the included ones, and the gain.
#[derive(Clone, Debug)]
pub(super) struct CandidateEstimate {
    /// Reduction of the sum of squares.
    pub(super) gain: f64,
    /// Number of included parameters.
    pub(super) parameter_count: usize,
    /// Estimated parameters, one per probe, SI; zero for those that are not included.
    pub(super) estimates: Vec<f64>,
    /// Standard uncertainty of each for white noise, SI; zero for those that are not included.
    pub(super) sigma: Vec<f64>,
}

impl GramMatrix {
    /// The Gram matrix at a fit. `nuisance`: indices of the columns of the fit that are always included; `stated`: standard uncertainties that the
    /// model states of some of them and the fit did not use, by index in `nuisance`.
    pub(super) fn of(
        fitted: &ScoreTest<'_>,
        entries: &[LinearisedCandidate],
        nuisance: &[usize],
        stated: &[(usize, f64)],
    ) -> Self {
        let moves = displacements(fitted, entries);
        let series = moves.iter().flat_map(|moves| &moves.of_probes);
        let priors: Vec<f64> = moves.iter().flat_map(|moves| moves.sigmas.clone()).collect();
        let (mixed, squares, pulls) = fitted.products(&series.collect::<Vec<_>>(), nuisance);
        let (fixed, count): (usize, usize) = (nuisance.len(), squares.ncols());
        let part = fitted.fit.triangle.of_columns(nuisance);
        let width = fixed + count;
        let mut products = DMatrix::zeros(width + 1, width + 1);
        let places = |k: usize| if k < fixed { k } else { width };
        for i in 0..=fixed {
            for k in 0..=fixed {
                let shared = 0..(i.min(k) + 1).min(fixed);
                let rest = if i == fixed && k == fixed { part.rest() } else { 0.0 };
                let known: f64 = shared.map(|r| part.at(r, i) * part.at(r, k)).sum();
                products[(places(i), places(k))] = known + rest;
            }
        }
        for (place, sigma) in stated {
            products[(*place, *place)] += sigma.powi(-2);
        }
        for c in 0..count {
            for j in 0..fixed {
                (products[(j, fixed + c)], products[(fixed + c, j)]) =
                    (mixed[(j, c)], mixed[(j, c)]);
            }
            for d in 0..count {
                products[(fixed + c, fixed + d)] = squares[(c, d)];
            }
            (products[(width, fixed + c)], products[(fixed + c, width)]) = (pulls[c], pulls[c]);
        }
        let mut columns_of = Vec::with_capacity(entries.len());
        let mut first = fixed;
        let mut estimates = vec![0.0; width];
        let mut is_correction = vec![false; width];
        for entry in entries {
            let columns = first..first + entry.candidate.probes.len();
            estimates[columns.clone()].copy_from_slice(&entry.linearised_at);
            is_correction[columns.clone()].fill(entry.candidate.changes().is_some());
            first = columns.end;
            columns_of.push(columns);
        }
        add_back_explained(&mut products, &estimates);
        let mut gram = Self {
            lengths: vec![1.0; width],
            data_share: vec![1.0; width],
            is_correction,
            is_included: vec![false; width],
            products,
            columns_of,
        };
        gram.scale(fixed, &priors);
        (0..fixed).for_each(|column| gram.sweep(column));
        gram
    }

    /// Adds the priors and scales all columns to unit length.
    fn scale(&mut self, fixed: usize, priors: &[f64]) {
        let width = self.lengths.len();
        for column in 0..width {
            let data = self.products[(column, column)];
            let prior = column.checked_sub(fixed).map_or(0.0, |c| priors[c].powi(-2));
            self.products[(column, column)] = data + prior;
            self.lengths[column] = (data + prior).sqrt().max(f64::MIN_POSITIVE);
            self.data_share[column] = if data > 0.0 { data / (data + prior) } else { 0.0 };
        }
        for i in 0..width {
            let size = self.lengths[i];
            self.products.row_mut(i).scale_mut(1.0 / size);
            self.products.column_mut(i).scale_mut(1.0 / size);
        }
    }

    /// Sweep operator: includes a column, or removes an included one.
    fn sweep(&mut self, k: usize) {
        let pivot = self.products[(k, k)];
        // The diagonal element of an included column is minus the variance of its coefficient.
        if pivot.abs() < f64::MIN_POSITIVE {
            return;
        }
        let row: Vec<f64> = self.products.column(k).iter().copied().collect();
        let sign = if self.is_included[k] { -1.0 } else { 1.0 };
        for (j, along) in row.iter().enumerate() {
            let share = along / pivot;
            if j == k || share == 0.0 {
                continue;
            }
            let height = row.len();
            let column = &mut self.products.as_mut_slice()[j * height..(j + 1) * height];
            subtract_scaled(column, share, &row);
        }
        for (j, along) in row.iter().enumerate() {
            let cell = sign * along / pivot;
            (self.products[(k, j)], self.products[(j, k)]) = (cell, cell);
        }
        self.products[(k, k)] = -1.0 / pivot;
        self.is_included[k] = !self.is_included[k];
    }

    /// Residual sum of squares with all included columns.
    pub(super) fn residual_sum(&self) -> f64 {
        let right = self.lengths.len();
        self.products[(right, right)]
    }

    /// Included columns of a candidate.
    fn included_columns(&self, entry: usize) -> Vec<usize> {
        self.columns_of[entry].clone().filter(|column| self.is_included[*column]).collect()
    }

    /// Includes those columns of a candidate that are identifiable beside the included ones.
    pub(super) fn add(&mut self, entry: usize) {
        for column in self.columns_of[entry].clone() {
            let left = self.products[(column, column)];
            if !self.is_included[column] && self.is_identifiable(column, left) {
                self.sweep(column);
            }
        }
    }

    /// Removes a candidate.
    pub(super) fn remove(&mut self, entry: usize) {
        self.included_columns(entry).into_iter().for_each(|column| self.sweep(column));
    }

    /// Whether a parameter is identifiable: `left` is the squared length of the part of its column that is orthogonal to the included columns.
    fn is_identifiable(&self, column: usize, left: f64) -> bool {
        let prior = 1.0 - self.data_share[column];
        let enough = if self.is_correction[column] {
            0.0
        } else {
            PRIOR_RATIO_MIN * PRIOR_RATIO_MIN * prior
        };
        left - prior > enough.max(INDEPENDENT_SHARE_MIN * self.data_share[column])
            && left > INDEPENDENT_SHARE_MIN
    }

    /// Estimates and gain of a candidate that is not included; `None` if none of its parameters is identifiable.
    pub(super) fn estimate_if_added(&self, entry: usize) -> Option<CandidateEstimate> {
        let columns = self.columns_of[entry].clone();
        let right = self.lengths.len();
        let found = PartialCholesky::of(
            columns.clone(),
            |a, b| self.products[(a, b)],
            |a| self.products[(a, right)],
            |a, left| self.is_identifiable(a, left),
        )?;
        let (mut numbers, mut sigma) = (vec![0.0; columns.len()], vec![0.0; columns.len()]);
        for (place, (column, x)) in found.kept.iter().zip(found.solution()).enumerate() {
            numbers[column - columns.start] = x / self.lengths[*column];
            sigma[column - columns.start] = found.sigma(place) / self.lengths[*column];
        }
        Some(CandidateEstimate {
            gain: found.gain(),
            parameter_count: found.kept.len(),
            estimates: numbers,
            sigma,
        })
    }

    /// Estimates and gain of an included candidate beside all other included ones.
    pub(super) fn estimate_beside_others(&self, entry: usize) -> CandidateEstimate {
        let columns = self.columns_of[entry].clone();
        let inside = self.included_columns(entry);
        let right = self.lengths.len();
        let size = inside.len();
        let inverse = DMatrix::from_fn(size, size, |i, k| -self.products[(inside[i], inside[k])]);
        let x = DMatrix::from_fn(size, 1, |i, _| self.products[(inside[i], right)]);
        let (mut estimates, mut sigma) = (vec![0.0; columns.len()], vec![0.0; columns.len()]);
        for (i, column) in inside.iter().enumerate() {
            estimates[column - columns.start] = x[i] / self.lengths[*column];
            sigma[column - columns.start] = inverse[(i, i)].max(0.0).sqrt() / self.lengths[*column];
        }
        let solved = inverse.cholesky().map(|c| c.solve(&x));
        let gain = solved.map_or(0.0, |solved| solved.dot(&x));
        CandidateEstimate { gain, parameter_count: size, estimates, sigma }
    }
}

/// Tool displacements per unit of the parameters of every candidate, computed unless they are cached.
fn displacements(
    fitted: &ScoreTest<'_>,
    entries: &[LinearisedCandidate],
) -> Vec<Arc<CandidateMotions>> {
    let open = entries.iter().filter(|entry| entry.moves.is_none());
    let open: Vec<Candidate> = open.map(|entry| entry.candidate.clone()).collect();
    let mut computed = fitted.candidate_motions(&open).into_iter().map(Arc::new);
    entries.iter().filter_map(|entry| entry.moves.clone().or_else(|| computed.next())).collect()
}

/// Adds to the right-hand side what the columns explain with the parameters at the point of linearisation.
fn add_back_explained(cells: &mut DMatrix<f64>, estimates: &[f64]) {
    let right = estimates.len();
    let mut added = vec![0.0; right + 1];
    for (column, x) in estimates.iter().enumerate().filter(|(_, x)| **x != 0.0) {
        let products = cells.column(column);
        added.iter_mut().zip(products.iter()).for_each(|(sum, g)| *sum += g * x);
    }
    // |r + Cx|² = |r|² + 2 x·Cᵀr + xᵀCᵀCx
    let along: f64 = estimates.iter().zip(&added).map(|(x, a)| x * a).sum();
    let total = cells[(right, right)] + 2.0 * added[right] + along;
    for column in 0..right {
        let cell = cells[(column, right)] + added[column];
        (cells[(column, right)], cells[(right, column)]) = (cell, cell);
    }
    cells[(right, right)] = total;
}
