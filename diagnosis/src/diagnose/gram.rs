//! Products of all candidate columns with each other, so that adding, removing and exchanging effects needs no further pass over the data.
//!
//! Rows are linearised at a fit; the part of the right-hand side that its own effects explain is added back, so that they compete again. Columns
//! enter and leave by the sweep operator (Goodnight, A tutorial on the SWEEP operator, 1979), scaled to unit length.
//!
//! Nuisance parameters and parameters with a stated uncertainty are always in. Decides nothing; see `stepwise`.

use crate::candidates::Candidate;
use crate::engine::partial_cholesky::PartialCholesky;
use crate::hypothesis::named;
use crate::score::{Fitted, Moves};
use crate::wide::subtract;
use nalgebra::DMatrix;
use physics::spec::{Role, Unit};
use std::ops::Range;
use std::sync::Arc;

/// A column's share of its own length that must be left by those that are in, squared.
const LEFT: f64 = 1e-6;

/// A number that is less sure than this part of what a sound robot may have says nothing: it would take any size.
const SHOWN: f64 = 3.0;

/// Candidates with the numbers that they have where the rows are linearised; zeros for those that are not in the fit.
#[derive(Clone)]
pub(super) struct Entry {
    pub(super) candidate: Candidate,
    pub(super) stands: Vec<f64>,
    /// Stems that a fit of it keeps.
    pub(super) kept: &'static [&'static str],
    /// What its numbers need not pay, in the sum of squares: by evidence it has taken the place of a name of fewer.
    pub(super) spared: f64,
    /// How the tool moves with it, where that is known.
    pub(super) moves: Option<Arc<Moves>>,
}

impl Entry {
    /// A candidate that nothing in the fit stands for.
    pub(super) fn open(kept: &'static [&'static str], candidate: Candidate) -> Self {
        let stands = vec![0.0; candidate.probes.len()];
        Self { stands, candidate, kept, spared: 0.0, moves: None }
    }

    /// Numbers that are searched for outside the columns: those that are not linear, but a wave's phase, which its sine and cosine stand for.
    pub(super) fn searched(&self) -> usize {
        let Some(effect) = self.candidate.probes.first().map(|probe| &probe.effect) else {
            return 0;
        };
        // A mass' place is in its corners' masses.
        if self.candidate.changes().is_some() || self.candidate.is_one_mass() {
            return 0;
        }
        if self.candidate.is_spring() {
            return self.candidate.tried_numbers();
        }
        let is_searched = |value: &usize| {
            named(effect, *value).is_some_and(|named| {
                named.parameter.role == Role::Nonlinear
                    && named.parameter.unit != Unit::PhaseRadian
                    && !self.kept.contains(&named.parameter.stem)
            })
        };
        (0..effect.values().len()).filter(is_searched).count()
    }
}

/// The products, with some columns in.
#[derive(Clone)]
pub(super) struct Gram {
    /// Scaled; the last row and column are the right-hand side.
    cells: DMatrix<f64>,
    /// Lengths of the columns.
    sizes: Vec<f64>,
    /// Columns of each entry.
    groups: Vec<Range<usize>>,
    /// The data's share of each scaled column's square: the rest is its prior.
    seen: Vec<f64>,
    /// Columns of what the model has: a fit keeps them whatever they show.
    is_change: Vec<bool>,
    is_in: Vec<bool>,
}

/// What an entry would bring, or brings.
#[derive(Clone, Debug)]
pub(super) struct Gain {
    /// By how much the sum of squares falls.
    pub(super) gain: f64,
    /// How many numbers it takes.
    pub(super) numbers: usize,
    /// The numbers, one per probe, SI.
    pub(super) found: Vec<f64>,
    /// How unsure each is, as standard deviation under noise without memory; zero for those that are not in.
    pub(super) sigma: Vec<f64>,
}

impl Gram {
    /// The products at the fit. `nuisance`: places among the fit's columns that are always in; `stated`: the doubt of some of them, by place in
    /// `nuisance`, that the fit left out.
    pub(super) fn of(
        fitted: &Fitted<'_>,
        entries: &[Entry],
        nuisance: &[usize],
        stated: &[(usize, f64)],
    ) -> Self {
        let moves = moves(fitted, entries);
        let series = moves.iter().flat_map(|moves| &moves.of_probes);
        let priors: Vec<f64> = moves.iter().flat_map(|moves| moves.sigmas.clone()).collect();
        let (mixed, own, pulls) = fitted.products(&series.collect::<Vec<_>>(), nuisance);
        let (fixed, count): (usize, usize) = (nuisance.len(), own.ncols());
        let part = fitted.fit.triangle.of_columns(nuisance);
        let width = fixed + count;
        let mut cells = DMatrix::zeros(width + 1, width + 1);
        let places = |k: usize| if k < fixed { k } else { width };
        for i in 0..=fixed {
            for k in 0..=fixed {
                let shared = 0..(i.min(k) + 1).min(fixed);
                let rest = if i == fixed && k == fixed { part.rest() } else { 0.0 };
                let known: f64 = shared.map(|r| part.at(r, i) * part.at(r, k)).sum();
                cells[(places(i), places(k))] = known + rest;
            }
        }
        for (place, sigma) in stated {
            cells[(*place, *place)] += sigma.powi(-2);
        }
        for c in 0..count {
            for j in 0..fixed {
                (cells[(j, fixed + c)], cells[(fixed + c, j)]) = (mixed[(j, c)], mixed[(j, c)]);
            }
            for d in 0..count {
                cells[(fixed + c, fixed + d)] = own[(c, d)];
            }
            (cells[(width, fixed + c)], cells[(fixed + c, width)]) = (pulls[c], pulls[c]);
        }
        let mut groups = Vec::with_capacity(entries.len());
        let mut first = fixed;
        let mut stands = vec![0.0; width];
        let mut is_change = vec![false; width];
        for entry in entries {
            let columns = first..first + entry.candidate.probes.len();
            stands[columns.clone()].copy_from_slice(&entry.stands);
            is_change[columns.clone()].fill(entry.candidate.changes().is_some());
            first = columns.end;
            groups.push(columns);
        }
        give_back(&mut cells, &stands);
        let mut gram = Self {
            sizes: vec![1.0; width],
            seen: vec![1.0; width],
            is_change,
            is_in: vec![false; width],
            cells,
            groups,
        };
        gram.scale(fixed, &priors);
        (0..fixed).for_each(|column| gram.sweep(column));
        gram
    }

    /// Unit lengths, priors included.
    fn scale(&mut self, fixed: usize, priors: &[f64]) {
        let width = self.sizes.len();
        for column in 0..width {
            let data = self.cells[(column, column)];
            let prior = column.checked_sub(fixed).map_or(0.0, |c| priors[c].powi(-2));
            self.cells[(column, column)] = data + prior;
            self.sizes[column] = (data + prior).sqrt().max(f64::MIN_POSITIVE);
            self.seen[column] = if data > 0.0 { data / (data + prior) } else { 0.0 };
        }
        for i in 0..width {
            let size = self.sizes[i];
            self.cells.row_mut(i).scale_mut(1.0 / size);
            self.cells.column_mut(i).scale_mut(1.0 / size);
        }
    }

    /// Brings a column in, or takes it out again.
    fn sweep(&mut self, k: usize) {
        let pivot = self.cells[(k, k)];
        // A column that is in has its inverse, below zero, on the diagonal.
        if pivot.abs() < f64::MIN_POSITIVE {
            return;
        }
        let row: Vec<f64> = self.cells.column(k).iter().copied().collect();
        let sign = if self.is_in[k] { -1.0 } else { 1.0 };
        for (j, along) in row.iter().enumerate() {
            let share = along / pivot;
            if j == k || share == 0.0 {
                continue;
            }
            let height = row.len();
            let column = &mut self.cells.as_mut_slice()[j * height..(j + 1) * height];
            subtract(column, share, &row);
        }
        for (j, along) in row.iter().enumerate() {
            let cell = sign * along / pivot;
            (self.cells[(k, j)], self.cells[(j, k)]) = (cell, cell);
        }
        self.cells[(k, k)] = -1.0 / pivot;
        self.is_in[k] = !self.is_in[k];
    }

    /// The sum of squares that is left by all that is in.
    pub(super) fn rest(&self) -> f64 {
        let right = self.sizes.len();
        self.cells[(right, right)]
    }

    /// Columns of an entry that are in.
    fn inside(&self, entry: usize) -> Vec<usize> {
        self.groups[entry].clone().filter(|column| self.is_in[*column]).collect()
    }

    /// Brings an entry in: those of its columns that show something of their own.
    pub(super) fn add(&mut self, entry: usize) {
        for column in self.groups[entry].clone() {
            let left = self.cells[(column, column)];
            if !self.is_in[column] && self.shows(column, left) {
                self.sweep(column);
            }
        }
    }

    /// Takes an entry out.
    pub(super) fn remove(&mut self, entry: usize) {
        self.inside(entry).into_iter().for_each(|column| self.sweep(column));
    }

    fn shows(&self, column: usize, left: f64) -> bool {
        let prior = 1.0 - self.seen[column];
        let enough = if self.is_change[column] { 0.0 } else { SHOWN * SHOWN * prior };
        left - prior > enough.max(LEFT * self.seen[column]) && left > LEFT
    }

    /// What an entry that is out would bring; none where it shows nothing of its own.
    pub(super) fn would_gain(&self, entry: usize) -> Option<Gain> {
        let columns = self.groups[entry].clone();
        let right = self.sizes.len();
        let found = PartialCholesky::of(
            columns.clone(),
            |a, b| self.cells[(a, b)],
            |a| self.cells[(a, right)],
            |a, left| self.shows(a, left),
        )?;
        let (mut numbers, mut sigma) = (vec![0.0; columns.len()], vec![0.0; columns.len()]);
        for (place, (column, x)) in found.kept.iter().zip(found.solution()).enumerate() {
            numbers[column - columns.start] = x / self.sizes[*column];
            sigma[column - columns.start] = found.sigma(place) / self.sizes[*column];
        }
        Some(Gain { gain: found.gain(), numbers: found.kept.len(), found: numbers, sigma })
    }

    /// What an entry that is in brings beside all others that are.
    pub(super) fn gains(&self, entry: usize) -> Gain {
        let columns = self.groups[entry].clone();
        let inside = self.inside(entry);
        let right = self.sizes.len();
        let size = inside.len();
        let inverse = DMatrix::from_fn(size, size, |i, k| -self.cells[(inside[i], inside[k])]);
        let x = DMatrix::from_fn(size, 1, |i, _| self.cells[(inside[i], right)]);
        let (mut found, mut sigma) = (vec![0.0; columns.len()], vec![0.0; columns.len()]);
        for (i, column) in inside.iter().enumerate() {
            found[column - columns.start] = x[i] / self.sizes[*column];
            sigma[column - columns.start] = inverse[(i, i)].max(0.0).sqrt() / self.sizes[*column];
        }
        let solved = inverse.cholesky().map(|c| c.solve(&x));
        let gain = solved.map_or(0.0, |solved| solved.dot(&x));
        Gain { gain, numbers: size, found, sigma }
    }
}

/// How the tool moves with every entry; asked where it is not known.
fn moves(fitted: &Fitted<'_>, entries: &[Entry]) -> Vec<Arc<Moves>> {
    let open = entries.iter().filter(|entry| entry.moves.is_none());
    let open: Vec<Candidate> = open.map(|entry| entry.candidate.clone()).collect();
    let mut asked = fitted.moves(&open).into_iter().map(Arc::new);
    entries.iter().filter_map(|entry| entry.moves.clone().or_else(|| asked.next())).collect()
}

/// Adds to the right-hand side what columns explain with the numbers that they stand at.
fn give_back(cells: &mut DMatrix<f64>, stands: &[f64]) {
    let right = stands.len();
    let mut added = vec![0.0; right + 1];
    for (column, x) in stands.iter().enumerate().filter(|(_, x)| **x != 0.0) {
        let products = cells.column(column);
        added.iter_mut().zip(products.iter()).for_each(|(sum, g)| *sum += g * x);
    }
    // |r + Cx|² = |r|² + 2 x·Cᵀr + xᵀCᵀCx
    let along: f64 = stands.iter().zip(&added).map(|(x, a)| x * a).sum();
    let total = cells[(right, right)] + 2.0 * added[right] + along;
    for column in 0..right {
        let cell = cells[(column, right)] + added[column];
        (cells[(column, right)], cells[(right, column)]) = (cell, cell);
    }
    cells[(right, right)] = total;
}
