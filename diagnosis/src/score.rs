//! What a candidate would gain on top of a fit, without fitting it: the rows of the fit and the candidate's columns, linearised.
//!
//! With `R` the triangle of the fit, `A = JᵀC` and `Y = R⁻ᵀ A`: what is left of the columns is `S = CᵀC − YᵀY + priors`, of their pull
//! `b = Cᵀr − Yᵀ(R⁻ᵀ Jᵀr)`; the numbers would be `S⁻¹ b` and the sum of squares would fall by `bᵀ S⁻¹ b`.
//!
//! Promises: one pass over the campaign for all candidates. Never: a decision; see [`mod@crate::select`].

use crate::campaign::Campaign;
use crate::candidates::Candidate;
use crate::colour::Filter;
use crate::fit::Settings;
use crate::hypothesis::{Free, Hypothesis, much};
use crate::motion::Motion;
use crate::motions::{Motions, is_about_loads};
use crate::problem::{Look, State, Weighing, remember, visit};
use crate::result::Fit;
use crate::rides::Rides;
use crate::triangle::{Triangle, dot};
use glam::DVec3;
use nalgebra::DMatrix;
use physics::{AnyEffect, Chain, Deviation, EFFECTS_MAX, Evaluation, Loads};

/// A candidate's share of its own length that must be left after the fit's columns, squared.
const LEFT: f64 = 1e-6;
/// Rows that are multiplied at once.
const ROWS: usize = 256;

/// What a candidate would bring.
#[derive(Clone, Debug)]
pub(crate) struct Score {
    /// Place in the list of candidates.
    pub(crate) candidate: usize,
    /// By how much the sum of squares would fall, in units of the noise.
    pub(crate) gain: f64,
    /// How many numbers it would take.
    pub(crate) numbers: usize,
    /// The numbers, one per probe.
    pub(crate) found: Vec<f64>,
}

/// Groups of columns that are asked for.
pub(crate) struct Asked {
    /// Columns of each group.
    pub(crate) numbers: Vec<usize>,
    /// How large each column's number may be.
    pub(crate) sigmas: Vec<f64>,
}

/// A fit with its rows, ready to be asked.
pub(crate) struct Fitted<'a> {
    pub(crate) campaign: &'a Campaign,
    pub(crate) fit: &'a Fit,
    pub(crate) state: State,
    pub(crate) weighing: Weighing,
}

impl<'a> Fitted<'a> {
    pub(crate) fn new(campaign: &'a Campaign, fit: &'a Fit, settings: &Settings<'_>) -> Self {
        let state =
            State { surroundings: fit.surroundings.clone(), hypothesis: fit.hypothesis.clone() };
        let weighing = Weighing {
            used: settings.used.to_vec(),
            weights: fit.weights.clone(),
            factors: fit.factors.clone(),
        };
        Self { campaign, fit, state, weighing }
    }

    /// The pull that is left of the fit itself: zero at a minimum, but for priors.
    pub(crate) fn right(&self) -> &[f64] {
        let triangle = &self.fit.triangle;
        triangle.column(triangle.width())
    }

    /// Scores of all candidates that show something of their own.
    pub(crate) fn scores(&self, candidates: &[Candidate]) -> Vec<Score> {
        let mut scores = Vec::new();
        let mut from = 0;
        while from < candidates.len() {
            let (batch, end) = self.batch(candidates, from);
            let motions = self.batch_motions(&batch);
            let asked = Asked {
                numbers: candidates[from..end].iter().map(|c| c.probes.len()).collect(),
                sigmas: batch.free.iter().map(|free| free.sigma).collect(),
            };
            let found = self.scores_of(&asked, |pose, into| into.clone_from(&motions[pose]));
            scores.extend(found.into_iter().map(|s| Score { candidate: s.candidate + from, ..s }));
            from = end;
        }
        scores
    }

    /// Scores of groups of columns, told by how the tool would move with each at a pose.
    pub(crate) fn scores_of(
        &self,
        asked: &Asked,
        motions: impl FnMut(usize, &mut Vec<Motion>),
    ) -> Vec<Score> {
        let sums = self.sums(asked.sigmas.len(), motions);
        let mut column = 0;
        let group = |(index, count): (usize, &usize)| {
            let columns = column..column + count;
            column = columns.end;
            sums.score(index, columns, &asked.sigmas)
        };
        asked.numbers.iter().enumerate().filter_map(group).collect()
    }

    /// As many candidates as fit into one model, from place `from`; and where the next batch begins.
    fn batch(&self, candidates: &[Candidate], from: usize) -> (Hypothesis, usize) {
        let arm = self.state.hypothesis.model.arm;
        let mut batch = Hypothesis::fixed(physics::Model::nominal(arm));
        // What changes the loads or the way is felt by the candidates too, and what gives way shows those that change loads.
        for effect in self.state.hypothesis.model.effects() {
            let over_path = matches!(effect, AnyEffect::OverPath(_));
            if is_about_loads(effect.spec()) || over_path {
                batch.model.push(*effect).unwrap_or_default();
            }
        }
        let mut end = from;
        for candidate in &candidates[from..] {
            if batch.model.effects().len() + candidate.probes.len() > EFFECTS_MAX {
                break;
            }
            for (k, probe) in candidate.probes.iter().enumerate() {
                let again = k > 0 && candidate.probes[k - 1].effect == probe.effect;
                if !again {
                    batch.model.push(probe.effect).unwrap_or_default();
                }
                let effect = batch.model.effects().len() - 1;
                let sigma = much(&probe.effect, probe.value);
                batch.free.push(Free {
                    effect,
                    value: probe.value,
                    mean: 0.0,
                    sigma,
                    stated: false,
                });
            }
            end += 1;
        }
        (batch, end.max(from + 1))
    }

    /// Shows the rows of the fit with further columns, told by how the tool would move with each at a pose: the fit's columns, the others, what is left.
    pub(crate) fn rows(
        &self,
        count: usize,
        mut motions: impl FnMut(usize, &mut Vec<Motion>),
        mut take: impl FnMut(&[f64], &[f64], f64),
    ) {
        let (active, width) = (self.fit.columns(), self.fit.columns().len());
        let effects_from = self.state.surroundings.numbers().len();
        let mut full = vec![vec![0.0; self.state.width()]; 3];
        let mut row = vec![0.0; width + count + 1];
        let mut filter = Filter::new(self.campaign);
        let (mut now, mut moved) = (usize::MAX, Vec::new());
        let look = Look { used: Some(&self.weighing.used), derivatives: true };
        visit(self.campaign, &self.state, look, |at| {
            let scale = self.weighing.scale(at);
            if scale == 0.0 {
                return;
            }
            at.rows.fill(effects_from, at.motions, &mut full);
            if now != at.pose {
                now = at.pose;
                motions(now, &mut moved);
            }
            let along: Vec<DVec3> = moved.iter().map(|motion| at.rows.along(motion)).collect();
            for k in 0..at.rows.count {
                row.iter_mut().zip(active).for_each(|(slot, j)| *slot = scale * full[k][*j]);
                row[width..].iter_mut().zip(&along).for_each(|(slot, c)| *slot = scale * c[k]);
                row[width + count] = scale * at.rows.residual[k];
                filter.pass(at.pose, at.instrument, at.stream, k, &mut row);
                let (fitted, rest) = row.split_at(width);
                take(fitted, &rest[..count], rest[count]);
            }
        });
    }

    fn sums(&self, count: usize, motions: impl FnMut(usize, &mut Vec<Motion>)) -> Sums {
        let mut sums = Sums::new(self.fit.columns().len(), count);
        self.rows(count, motions, |fitted, columns, right| {
            sums.add(fitted.iter().copied(), columns, right);
        });
        sums.project(&self.fit.triangle, self.right());
        sums
    }

    /// Products of all candidates' columns `C`: with the fit's columns at `places` (`JᵀC`), with each other (`CᵀC`), with what is left (`Cᵀr`); and how
    /// large each number may be.
    pub(crate) fn products(
        &self,
        candidates: &[Candidate],
        places: &[usize],
    ) -> (DMatrix<f64>, DMatrix<f64>, Vec<f64>, Vec<f64>) {
        let mut motions: Vec<Vec<Motion>> = vec![Vec::new(); self.campaign.poses.len()];
        let mut sigmas = Vec::new();
        let mut from = 0;
        while from < candidates.len() {
            let (batch, end) = self.batch(candidates, from);
            let found = self.batch_motions(&batch);
            motions.iter_mut().zip(found).for_each(|(all, found)| all.extend(found));
            sigmas.extend(batch.free.iter().map(|free| free.sigma));
            from = end;
        }
        let count = sigmas.len();
        let wide = places.len() + count + 1;
        let mut sums = DMatrix::zeros(wide, wide);
        let mut block = DMatrix::zeros(wide, ROWS);
        let mut filled = 0;
        self.rows(
            count,
            |pose, into| into.clone_from(&motions[pose]),
            |fitted, columns, right| {
                let mut slot = block.column_mut(filled);
                places.iter().enumerate().for_each(|(k, place)| slot[k] = fitted[*place]);
                slot.iter_mut().skip(places.len()).zip(columns).for_each(|(slot, c)| *slot = *c);
                slot[wide - 1] = right;
                filled += 1;
                if filled == ROWS {
                    sums.gemm(1.0, &block, &block.transpose(), 1.0);
                    filled = 0;
                }
            },
        );
        block.columns_range_mut(filled..).fill(0.0);
        sums.gemm(1.0, &block, &block.transpose(), 1.0);
        let fixed = places.len();
        let mixed = sums.view((0, fixed), (fixed, count)).into_owned();
        let own = sums.view((fixed, fixed), (count, count)).into_owned();
        let pulls = (0..count).map(|k| sums[(fixed + k, wide - 1)]).collect();
        (mixed, own, pulls, sigmas)
    }

    /// How the tool would move with each probe, at each pose that takes part. The candidates remember for themselves.
    fn batch_motions(&self, batch: &Hypothesis) -> Vec<Vec<Motion>> {
        let arm = &batch.model.arm;
        let mut all = vec![Vec::new(); self.campaign.poses.len()];
        let rides = Rides::of(&batch.model, self.campaign);
        let slopes = rides.slopes(batch, self.campaign);
        let mut at_pose = Motions::of_candidates(batch);
        let used = Some(self.weighing.used.as_slice());
        remember(&batch.model, self.campaign, &rides, used, |pose, memories| {
            let inputs = rides.inputs(self.campaign, pose);
            let nominal = Chain::nominal(arm, &inputs.q);
            let bare = Evaluation {
                nominal,
                loads: Loads::on(arm, &nominal, inputs.wrench_base),
                deviation: Deviation::default(),
                real: nominal,
                beyond: None,
            };
            let mut motions = at_pose.at(inputs, memories, &bare);
            slopes.fill(arm, &bare, pose, &mut motions);
            all[pose] = motions;
        });
        all
    }
}

/// Sums over all rows, for a batch of columns.
struct Sums {
    width: usize,
    count: usize,
    /// `Jᵀ C`, one slice of `count` per column of the fit.
    mixed: Vec<f64>,
    /// `Cᵀ C` near the diagonal: `near[k][d] = c_k · c_{k+d}`.
    near: Vec<Vec<f64>>,
    pull: Vec<f64>,
    /// `Y`, one column after the other.
    seen: Vec<Vec<f64>>,
    right: Vec<f64>,
}

/// No candidate has more probes than this.
const PROBES_MAX: usize = 3 * physics::JOINTS_MAX;

impl Sums {
    fn new(width: usize, count: usize) -> Self {
        Self {
            width,
            count,
            mixed: vec![0.0; width * count],
            near: vec![Vec::new(); count],
            pull: vec![0.0; count],
            seen: Vec::new(),
            right: Vec::new(),
        }
    }

    fn add(&mut self, row: impl Iterator<Item = f64>, columns: &[f64], right: f64) {
        for (j, slice) in row.zip(self.mixed.chunks_exact_mut(self.count.max(1))) {
            if j != 0.0 {
                slice.iter_mut().zip(columns).for_each(|(sum, c)| *sum += j * c);
            }
        }
        for (k, c) in columns.iter().enumerate() {
            self.pull[k] += c * right;
            let beside = &columns[k..columns.len().min(k + PROBES_MAX)];
            self.near[k].resize(beside.len(), 0.0);
            self.near[k].iter_mut().zip(beside).for_each(|(sum, b)| *sum += c * b);
        }
    }

    fn project(&mut self, triangle: &Triangle, right: &[f64]) {
        let column = |k: usize| (0..self.width).map(|j| self.mixed[j * self.count + k]).collect();
        self.seen = (0..self.count).map(|k| triangle.forward(column(k))).collect();
        self.right = right.to_vec();
    }

    fn score(
        &self,
        candidate: usize,
        columns: std::ops::Range<usize>,
        sigmas: &[f64],
    ) -> Option<Score> {
        let count = columns.len();
        let mut kept: Vec<usize> = Vec::new();
        let mut left = Triangle::new(count);
        let first = columns.start;
        // Cholesky of S with its dependent columns left out, written as rows of a triangle.
        let mut factor: Vec<Vec<f64>> = Vec::new();
        let mut pulls: Vec<f64> = Vec::new();
        for k in columns {
            let of = |a: usize, b: usize| {
                let (a, b) = (a.min(b), a.max(b));
                self.near[a].get(b - a).copied().unwrap_or(0.0) - dot(&self.seen[a], &self.seen[b])
            };
            let prior = sigmas[k].powi(-2);
            let mut row: Vec<f64> = Vec::new();
            for (i, other) in kept.iter().enumerate() {
                let known: f64 = dot(&factor[i][..i], &row[..i]);
                row.push((of(*other, k) - known) / factor[i][i]);
            }
            let own = of(k, k);
            let rest = own + prior - dot(&row, &row);
            let pull = self.pull[k] - dot(&self.seen[k], &self.right) - dot(&row, &pulls);
            if own > LEFT * self.near[k][0] && rest > LEFT * self.near[k][0] {
                let root = rest.sqrt();
                pulls.push(pull / root);
                row.push(root);
                factor.push(row);
                kept.push(k);
            }
        }
        if kept.is_empty() {
            return None;
        }
        for (i, pull) in pulls.iter().enumerate() {
            let mut row = vec![0.0; count];
            for (j, column) in kept.iter().enumerate().skip(i) {
                row[column - first] = factor[j][i];
            }
            left.push(&row, *pull);
        }
        left.reduce();
        let found = left.solve(&vec![1e-12; count]);
        Some(Score { candidate, gain: dot(&pulls, &pulls), numbers: kept.len(), found })
    }
}
