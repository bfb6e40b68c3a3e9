//! Score test of candidates: improvement of a fit by a candidate, from linearised rows, without fitting it.
//!
//! With `R` the triangle of the fit, `A = JᵀC` and `Y = R⁻ᵀ A`: the projected columns are `S = CᵀC − YᵀY + priors`, their gradient
//! `b = Cᵀr − Yᵀ(R⁻ᵀ Jᵀr)`; the parameters would be `S⁻¹ b`, and the sum of squares would decrease by `bᵀ S⁻¹ b`.
//!
//! One pass over the campaign evaluates all candidates; the selection is made in [`mod@crate::diagnose`].

mod series;
mod sums;

use crate::autocorrelation::WhiteningFilter;
use crate::campaign::Campaign;
use crate::candidates::Candidate;
use crate::fit::FitSettings;
use crate::fit_result::Fit;
use crate::hypothesis::{FreeParameter, Hypothesis, PriorSource, plausible_size};
use crate::least_squares::{FitState, ReadingWeights, VisitedReading, visit_memories};
use crate::linearisation::Linearisation;
use crate::path_dynamics::PathDynamics;
use crate::tool_jacobian::{ToolJacobian, changes_or_uses_loads};
use crate::tool_motion::ToolMotion;
use glam::DVec3;
use nalgebra::{DMatrix, DMatrixView, Dyn};
use physics::{AnyEffect, EFFECTS_MAX, Evaluation};
use series::MotionSeries;
use std::sync::Arc;
use sums::ScoreSums;

/// Rows that are multiplied in one block.
const ROWS: usize = 256;
/// Width of a block of columns in a symmetric product.
const STRIP: usize = 64;

/// Predicted improvement by a candidate.
#[derive(Clone, Debug)]
pub(crate) struct CandidateScore {
    /// Index in the list of candidates.
    pub(crate) candidate: usize,
    /// Decrease of the sum of squares, in units of the noise variance.
    pub(crate) gain: f64,
    /// Number of parameters it would add.
    pub(crate) parameter_count: usize,
    /// Estimated parameters, one per probe.
    pub(crate) values: Vec<f64>,
}

/// Groups of columns to be tested.
pub(crate) struct ColumnGroups {
    /// Number of columns of each group.
    pub(crate) column_counts: Vec<usize>,
    /// Prior standard deviation of each column's parameter.
    pub(crate) sigmas: Vec<f64>,
}

/// A fit with its rows, prepared for score tests.
pub(crate) struct ScoreTest<'a> {
    pub(crate) campaign: &'a Campaign,
    pub(crate) fit: &'a Fit,
    pub(crate) state: FitState,
    pub(crate) weighing: ReadingWeights,
    pub(crate) linearisation: Arc<Linearisation>,
}

impl<'a> ScoreTest<'a> {
    pub(crate) fn new(campaign: &'a Campaign, fit: &'a Fit, settings: &FitSettings<'_>) -> Self {
        let state = fit.state();
        let weighing = ReadingWeights::of_fit(fit, settings.used);
        let linearisation = fit.rows_at(campaign, state.clone(), settings.used);
        Self { campaign, fit, state, weighing, linearisation }
    }

    /// The same fit, evaluated on other poses.
    pub(crate) fn on_poses(&self, used: &[bool]) -> Self {
        let weighing = ReadingWeights { used: used.to_vec(), ..self.weighing.clone() };
        let linearisation = Arc::new(Linearisation::of(self.campaign, self.state.clone(), used));
        Self { weighing, linearisation, state: self.state.clone(), ..*self }
    }

    /// Gradient of the fit itself in the basis of its triangle: zero at a minimum, apart from priors.
    pub(crate) fn right(&self) -> &[f64] {
        let triangle = &self.fit.triangle;
        triangle.column(triangle.width())
    }

    /// Scores of all candidates that are not confounded with the fit.
    pub(crate) fn scores(&self, candidates: &[Candidate]) -> Vec<CandidateScore> {
        let mut scores = Vec::new();
        let mut from = 0;
        while from < candidates.len() {
            let (batch, end) = self.batch(candidates, from);
            let motions = self.batch_motions(&batch);
            let groups = ColumnGroups {
                column_counts: candidates[from..end].iter().map(|c| c.probes.len()).collect(),
                sigmas: batch.free.iter().map(|free| free.sigma).collect(),
            };
            let found = self.scores_along(&groups, |reading, into| {
                into.extend(motions.iter().map(|series| series.along(reading.rows, reading.pose)));
            });
            scores.extend(
                found.into_iter().map(|s| CandidateScore { candidate: s.candidate + from, ..s }),
            );
            from = end;
        }
        scores
    }

    /// Scores of groups of columns that are multiples of motions of the tool, given by their factors at each pose. With several motions there is one
    /// group, and its columns are the multiples of the first motion, then those of the second …
    pub(crate) fn scores_of_multiples(
        &self,
        groups: &ColumnGroups,
        mut motions: impl FnMut(usize, &mut Vec<ToolMotion>),
        mut multiples: impl FnMut(usize, &mut Vec<f64>),
    ) -> Vec<CandidateScore> {
        let (mut now, mut moved, mut times) = (usize::MAX, Vec::new(), Vec::new());
        self.scores_along(groups, |reading, into| {
            if now != reading.pose {
                now = reading.pose;
                moved.clear();
                motions(now, &mut moved);
                times.clear();
                multiples(now, &mut times);
            }
            for motion in &moved {
                let along = reading.rows.derivative_along(motion);
                into.extend(times.iter().map(|times| along * *times));
            }
        })
    }

    /// Scores of groups of columns, given by their derivatives at each measurement.
    pub(crate) fn scores_along(
        &self,
        groups: &ColumnGroups,
        columns: impl FnMut(&VisitedReading<'_>, &mut Vec<DVec3>),
    ) -> Vec<CandidateScore> {
        let sums = self.sums(&groups.column_counts, columns);
        let mut column = 0;
        let group = |(index, count): (usize, &usize)| {
            let columns = column..column + count;
            column = columns.end;
            sums.score(index, columns, &groups.sigmas)
        };
        groups.column_counts.iter().enumerate().filter_map(group).collect()
    }

    /// Effects of the model that interact with candidates: those that change loads or the path affect the candidates, and load-dependent ones respond
    /// to candidates that change loads.
    pub(crate) fn context(&self) -> Vec<AnyEffect> {
        let over_path = |effect: &AnyEffect| matches!(effect, AnyEffect::OverPath(_));
        let all = self.state.hypothesis.model.effects();
        all.filter(|effect| changes_or_uses_loads(effect.spec()) || over_path(effect))
            .copied()
            .collect()
    }

    /// The candidates from index `from` that fit into one model, and the index at which the next batch begins.
    fn batch(&self, candidates: &[Candidate], from: usize) -> (Hypothesis, usize) {
        let arm = self.state.hypothesis.model.arm;
        let mut batch = Hypothesis::fixed(physics::Model::nominal(arm));
        for effect in self.context() {
            batch.model.push(effect).unwrap_or_default();
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
                let sigma = plausible_size(&probe.effect, probe.value);
                batch.free.push(FreeParameter {
                    effect,
                    value: probe.value,
                    mean: 0.0,
                    sigma,
                    prior_source: PriorSource::WideDefault,
                });
            }
            end += 1;
        }
        (batch, end.max(from + 1))
    }

    /// Passes the rows of the fit with further columns, given by the tool motion of each at a pose: columns of the fit, further columns, residual.
    pub(crate) fn rows(
        &self,
        count: usize,
        motions: impl FnMut(usize, &mut Vec<ToolMotion>),
        take: impl FnMut(&[f64], &[f64], f64),
    ) {
        self.rows_along(count, pose_by_pose(motions), take);
    }

    /// The same, with further columns given by their derivatives at each measurement.
    fn rows_along(
        &self,
        count: usize,
        mut columns: impl FnMut(&VisitedReading<'_>, &mut Vec<DVec3>),
        mut take: impl FnMut(&[f64], &[f64], f64),
    ) {
        let (active, width) = (self.fit.columns(), self.fit.columns().len());
        let all = self.state.width();
        let mut row = vec![0.0; width + count + 1];
        let mut filter = WhiteningFilter::new(self.campaign);
        let mut along: Vec<DVec3> = Vec::with_capacity(count);
        self.linearisation.for_each_reading(|reading, slopes| {
            let scale = self.weighing.scale(reading);
            if scale == 0.0 {
                return;
            }
            along.clear();
            columns(reading, &mut along);
            for k in 0..reading.rows.count {
                let full = &slopes[k * all..];
                row.iter_mut().zip(active).for_each(|(slot, j)| *slot = scale * full[*j]);
                row[width..].iter_mut().zip(&along).for_each(|(slot, c)| *slot = scale * c[k]);
                row[width + count] = scale * reading.rows.residual[k];
                filter.pass(reading.pose, reading.instrument, reading.stream, k, &mut row);
                let (fitted, rest) = row.split_at(width);
                take(fitted, &rest[..count], rest[count]);
            }
        });
    }

    fn sums(
        &self,
        groups: &[usize],
        columns: impl FnMut(&VisitedReading<'_>, &mut Vec<DVec3>),
    ) -> ScoreSums {
        let mut sums = ScoreSums::new(self.fit.columns().len(), groups);
        self.rows_along(groups.iter().sum(), columns, |fitted, columns, right| {
            sums.add(fitted, columns, right);
        });
        sums.project(&self.fit.triangle, self.right());
        sums
    }

    /// Tool motion of each probe of each candidate, and the prior standard deviation of its parameter.
    pub(crate) fn candidate_motions(&self, candidates: &[Candidate]) -> Vec<CandidateMotions> {
        let mut all = Vec::with_capacity(candidates.len());
        let mut from = 0;
        while from < candidates.len() {
            let (batch, end) = self.batch(candidates, from);
            let mut found = self.batch_motions(&batch).into_iter();
            let mut sigmas = batch.free.iter().map(|free| free.sigma);
            for candidate in &candidates[from..end] {
                let count = candidate.probes.len();
                let of_probes = found.by_ref().take(count).collect();
                all.push(CandidateMotions {
                    of_probes,
                    sigmas: sigmas.by_ref().take(count).collect(),
                });
            }
            from = end;
        }
        all
    }

    /// Products of all columns `C`, given by their tool motions: with the fit's columns at `places` (`JᵀC`), with each other (`CᵀC`), and with the
    /// residual (`Cᵀr`).
    pub(crate) fn products(
        &self,
        series: &[&MotionSeries],
        places: &[usize],
    ) -> (DMatrix<f64>, DMatrix<f64>, Vec<f64>) {
        let count = series.len();
        let wide = places.len() + count + 1;
        let mut sums = DMatrix::zeros(wide, wide);
        let mut block = DMatrix::zeros(wide, ROWS);
        let mut filled = 0;
        self.rows_along(
            count,
            |reading, into| {
                into.extend(series.iter().map(|one| one.along(reading.rows, reading.pose)));
            },
            |fitted, columns, right| {
                let mut slot = block.column_mut(filled);
                places.iter().enumerate().for_each(|(k, place)| slot[k] = fitted[*place]);
                slot.iter_mut().skip(places.len()).zip(columns).for_each(|(slot, c)| *slot = *c);
                slot[wide - 1] = right;
                filled += 1;
                if filled == ROWS {
                    add_upper(&mut sums, &block);
                    filled = 0;
                }
            },
        );
        block.columns_range_mut(filled..).fill(0.0);
        add_upper(&mut sums, &block);
        sums.fill_lower_triangle_with_upper_triangle();
        let fixed = places.len();
        let mixed = sums.view((0, fixed), (fixed, count)).into_owned();
        let squares = sums.view((fixed, fixed), (count, count)).into_owned();
        let pulls = (0..count).map(|k| sums[(fixed + k, wide - 1)]).collect();
        (mixed, squares, pulls)
    }

    /// Tool motion of each probe as a series over the poses up to the last that takes part. The memory of the candidates is advanced with them.
    fn batch_motions(&self, batch: &Hypothesis) -> Vec<MotionSeries> {
        let arm = &batch.model.arm;
        let (poses, reads_joints) =
            (self.campaign.poses.len(), series::reads_joints(self.campaign));
        let mut all: Vec<MotionSeries> =
            batch.free.iter().map(|_| MotionSeries::new(poses, reads_joints)).collect();
        let rides = PathDynamics::of(&batch.model, self.campaign);
        let slopes = rides.derivatives(batch, self.campaign);
        let mut at_pose = ToolJacobian::of_candidates(batch);
        let used = Some(self.weighing.used.as_slice());
        let mut undeformed = Box::<Evaluation>::default();
        visit_memories(&batch.model, self.campaign, &rides, used, |pose, memories| {
            let inputs = rides.inputs(self.campaign, pose);
            batch.model.load_into(inputs, memories, &mut undeformed);
            undeformed.real = undeformed.nominal;
            let mut motions = at_pose.at(inputs, memories, &undeformed);
            slopes.fill(arm, &undeformed, pose, &mut motions);
            all.iter_mut().zip(&motions).for_each(|(series, motion)| series.put(pose, motion));
        });
        all
    }
}

/// Transpose of a block as a view.
fn transpose_view(block: &DMatrix<f64>) -> DMatrixView<'_, f64, Dyn, Dyn> {
    let (rows, columns) = block.shape();
    DMatrixView::from_slice_with_strides(block.as_slice(), columns, rows, rows, 1)
}

/// Adds the products of a block's rows with each other: the upper triangle, and parts of the lower one.
fn add_upper(sums: &mut DMatrix<f64>, block: &DMatrix<f64>) {
    let (turned, wide) = (transpose_view(block), block.nrows());
    for from in (0..wide).step_by(STRIP) {
        let (high, long) = (STRIP.min(wide - from), wide - from);
        let (left, right) = (block.rows(from, high), turned.columns(from, long));
        sums.view_mut((from, from), (high, long)).gemm(1.0, &left, &right, 1.0);
    }
}

/// Converts motions per pose, computed once at each pose, to derivatives at each measurement.
fn pose_by_pose(
    mut motions: impl FnMut(usize, &mut Vec<ToolMotion>),
) -> impl FnMut(&VisitedReading<'_>, &mut Vec<DVec3>) {
    let (mut now, mut moved) = (usize::MAX, Vec::new());
    move |reading, into| {
        if now != reading.pose {
            now = reading.pose;
            motions(now, &mut moved);
        }
        into.extend(moved.iter().map(|motion| reading.rows.derivative_along(motion)));
    }
}

/// Tool motions of the probes of a candidate.
pub(crate) struct CandidateMotions {
    /// One series per probe.
    pub(crate) of_probes: Vec<MotionSeries>,
    /// Prior standard deviation of each probe's parameter.
    pub(crate) sigmas: Vec<f64>,
}
