//! Data of one torque diagnosis: rows, torque predicted by the model, dictionary of candidates, and the data split.
//!
//! The predicted torque is subtracted from the recorded one first; parameters with a stated uncertainty are fitted with it as prior. Selects nothing.
//! SI units.

use physics::dynamics::INERTIAL_PARAMETERS;
use recording::series::{HeldOut, Recording};
use std::cell::RefCell;

use super::ROWS_LEAST;
use super::load_dependent::StatedLoadFriction;
use super::motion::{Motion, Run};
use super::rigid_body::Rigid;
use super::stated_effects::{EffectKey, StatedModel};
use crate::autocorrelation::ArModel;
use crate::engine::dictionary::CandidateDictionary;
use crate::engine::noise;
use crate::engine::normal_equations::{LeastSquaresSolution, NormalEquations};
use crate::engine::product_cache::ProductCache;
use crate::engine::regression_data::{RegressionData, residual};
use crate::engine::split::{RowSets, RunSpan, SplitSettings, reserved};
use crate::engine::stepwise::TermSelection;

/// Gap between test rows and training rows, in periods of the band edge: the filter mixes rows closer together.
const GAP_PERIODS: f64 = 2.0;

pub(super) struct Case {
    pub(super) motion: Motion,
    pub(super) table: RegressionData,
    pub(super) library: CandidateDictionary,
    pub(super) row_sets: RowSets,
    /// Columns that every fit includes: inertial parameters of unstated masses, and parameters with a stated uncertainty.
    pub(super) always_fitted: Vec<usize>,
    /// Those of `open` that are parameters of the model's effects: column, (effect, value) in the model, and the effect whose first parameter it is.
    pub(super) uncertain_parameters: Vec<(usize, (usize, usize), Option<EffectKey>)>,
    /// Columns of the stated masses, fitted only in one of two variants.
    pub(super) stated_mass_columns: Vec<usize>,
    /// Joints that never move, each with its recorded minus predicted torque, row by row.
    pub(super) stationary: Vec<(usize, Vec<f64>)>,
    /// Torque predicted by the model, per joint and row, and its rigid-body part.
    pub(super) stated_torque: Vec<Vec<f64>>,
    pub(super) rigid: Vec<Vec<f64>>,
    /// Rigid-body part at every sample, per joint and run, from the motion of wider bandwidth; empty if the torque's band is equally wide or the
    /// model states no masses.
    pub(super) rigid_torque_at_samples: Vec<Vec<Vec<f64>>>,
    /// Load-dependent friction stated by the model.
    pub(super) stated_load_friction: Vec<StatedLoadFriction>,
    /// Number of columns of the arm's inertial parameters, which come first.
    pub(super) inertial_columns: usize,
    /// Buffer of the last computed sums of products, for reuse.
    pub(super) sums: RefCell<Option<ProductCache>>,
}

/// Row ranges of the runs for the data split, with a gap as wide as the filter needs.
fn runs(motion: &Motion, recordings: &[Recording]) -> Vec<RunSpan> {
    let is_stated = recordings.iter().any(|one| one.metadata.heldout != HeldOut::Unspecified);
    let mut from = 0;
    let run = |run: &Run| {
        let rows = from..from + run.rows.len();
        from = rows.end;
        let stride = run.rows.get(1).map_or(1, |second| second - run.rows[0]);
        let row_s = stride as f64 * run.step_s;
        let gap = (GAP_PERIODS / (motion.band_hz * row_s)).ceil() as usize;
        let reserved_rows = reserved(&recordings[run.recording].metadata.heldout, run.segment);
        RunSpan { rows, gap, reserved: reserved_rows.or(is_stated.then_some(false)) }
    };
    motion.runs.iter().map(run).collect()
}

impl Case {
    /// Extracts motion and torque from the recordings and sets up all candidates.
    pub(super) fn new(
        stated: &StatedModel<'_>,
        recordings: &[Recording],
        band_hz: Option<f64>,
        seed: u64,
    ) -> Self {
        let arm = &stated.model.arm;
        let motion = Motion::of(arm, stated.delay_s, recordings, band_hz);
        let row_sets = RowSets::of(&runs(&motion, recordings), seed, &SplitSettings::default());
        let rigid = Rigid::new(arm, &motion);
        let mut library = CandidateDictionary {
            columns: rigid.columns[..INERTIAL_PARAMETERS * arm.count()].to_vec(),
            prior: rigid.prior_sigma.iter().map(|sigma| 1.0 / (sigma * sigma)).collect(),
            terms: Vec::new(),
            untested: Vec::new(),
        };
        let is_stated = |k: &usize| arm.joints()[k / INERTIAL_PARAMETERS].link.is_some();
        let all = 0..INERTIAL_PARAMETERS * arm.count();
        let stated_mass_columns: Vec<usize> = all.clone().filter(is_stated).collect();
        let mut always_fitted: Vec<usize> = all.filter(|k| !is_stated(k)).collect();
        let known = stated.evaluate(&motion);
        let mut places = Vec::with_capacity(known.uncertain.len());
        for one in &known.uncertain {
            places.push((library.columns.len(), one.location, one.first_parameter_of));
            always_fitted.push(library.columns.len());
            library.columns.push(one.column.clone());
            library.prior.push(1.0 / (one.sigma * one.sigma));
        }
        let sum = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a + b).collect();
        let torque: Vec<Vec<f64>> =
            rigid.stated_torque.iter().zip(&known.torque).map(sum).collect();
        let mut table = table(&motion, &torque);
        let stationary = add_joint_candidates(stated, &motion, &mut table, &mut library);
        library.share_stated_columns(&known.uncertain);
        library.add_first_moments(arm, &motion);
        let of_mass = &rigid.columns[INERTIAL_PARAMETERS * arm.count()..];
        let several = recordings.len() > 1;
        let last_is_known = arm.joints().last().is_some_and(|joint| joint.link.is_some());
        if several || last_is_known {
            // If the last link's mass is unknown, a payload present in all recordings is indistinguishable from it.
            let mut each: Vec<Option<usize>> = if last_is_known { vec![None] } else { Vec::new() };
            each.extend((0..recordings.len()).filter(|_| several).map(Some));
            each.iter().for_each(|one| library.add_payload(&motion, of_mass, arm.tool.tcp, *one));
        } else {
            let why =
                "the last link's mass is unknown, and a payload cannot be distinguished from it";
            library.untested.push(("payload", None, why));
        }
        let inertial_columns = INERTIAL_PARAMETERS * arm.count();
        let mut case = Self {
            motion,
            table,
            library,
            row_sets,
            always_fitted,
            uncertain_parameters: places,
            stated_mass_columns,
            stationary,
            stated_torque: torque,
            rigid: rigid.stated_torque,
            rigid_torque_at_samples: rigid.at_samples,
            stated_load_friction: StatedLoadFriction::stated(stated),
            inertial_columns,
            sums: RefCell::default(),
        };
        case.add_torque_proportional_candidates(stated);
        case
    }

    /// Recentres payload columns at the fitted centre of mass; returns whether any moved.
    pub(super) fn recentre_payloads(&mut self, selection: &TermSelection) -> bool {
        let of_inertia = self.inertial_columns - 6..self.inertial_columns;
        let mut moved = false;
        for name in &selection.terms {
            let inertia = of_inertia.clone();
            moved |= self.library.recentre_payload(&self.motion, *name, inertia, &selection.solved);
        }
        moved
    }

    /// Fit of all columns of the library at once to the training rows.
    pub(super) fn fit_of_all_candidates(&self) -> LeastSquaresSolution {
        let products = self.products(&self.row_sets.train);
        products.solve(&(0..self.library.columns.len()).collect::<Vec<usize>>())
    }

    /// Whether parameters that every fit includes, constrained by their priors, explain as much as a candidate. Data cannot distinguish the two, so
    /// the candidate is exempt from the held-out tests.
    pub(super) fn is_exempt_from_test(&self, name: usize, always: &[usize]) -> bool {
        self.library.terms[name].corrects_stated || self.is_explained_by_masses(name, always)
    }

    /// Whether fitted stated masses can explain the same as a candidate.
    pub(super) fn is_explained_by_masses(&self, name: usize, always: &[usize]) -> bool {
        let kind = self.library.terms[name].kind;
        matches!(kind, "payload" | "inertia" | "gravity_torque")
            && self.stated_mass_columns.iter().any(|k| always.contains(k))
    }

    /// Normal equations over the rows that both `used` and the table's `counts` select.
    pub(super) fn products(&self, used: &[bool]) -> NormalEquations {
        let sums =
            ProductCache::updated(self.sums.take(), &self.table, &self.library.columns, used);
        let products = sums.products(self.library.prior.clone());
        self.sums.replace(Some(sums));
        products
    }

    /// Estimates each joint's noise (AR model and size) from the residual of the fit of all candidates.
    pub(super) fn estimate_noise(&mut self) {
        // The first pass has equal weights for all joints, the second has the estimated ones.
        for _ in 0..2 {
            self.ignore_autocorrelation();
            let rich = self.fit_of_all_candidates();
            self.table.noise = noise::estimate_noise(
                &self.table,
                &self.library.columns,
                &rich,
                &self.row_sets.train,
            );
        }
    }

    /// Weights rows by noise size alone from here on. Whitening by a slowly decaying autocorrelation would emphasise fast motions, and a slightly
    /// wrong model would then give parameters that hold only for these. Uncertainties are computed from blocks of time instead.
    pub(super) fn ignore_autocorrelation(&mut self) {
        self.table.noise.iter_mut().for_each(|(colour, _)| *colour = ArModel::default());
    }

    /// Residual torque of a joint, row by row, N m or N.
    pub(super) fn residual(&self, solved: &LeastSquaresSolution, joint: usize) -> Vec<f64> {
        residual(&self.table, &self.library.columns, solved, joint)
    }
}

/// Adds the candidates of each moving joint; returns the joints that never move with their residual torque.
fn add_joint_candidates(
    stated: &StatedModel<'_>,
    motion: &Motion,
    table: &mut RegressionData,
    library: &mut CandidateDictionary,
) -> Vec<(usize, Vec<f64>)> {
    let mut still = Vec::new();
    for joint in table.joints().collect::<Vec<usize>>() {
        let moves = &table.moves[joint];
        if moves.iter().filter(|moves| **moves).count() >= ROWS_LEAST {
            library.add_joint(stated, motion, joint);
            continue;
        }
        let never = !moves.contains(&true);
        let held = table.target[joint].take();
        still.extend(held.filter(|_| never).map(|held| (joint, held)));
        library.list_untested_joint(joint);
    }
    still
}

fn table(motion: &Motion, stated: &[Vec<f64>]) -> RegressionData {
    let mut runs = Vec::new();
    let mut rows = 0;
    for run in &motion.runs {
        runs.push(rows..rows + run.rows.len());
        rows += run.rows.len();
    }
    let target = |joint: usize| {
        let mut all = Vec::with_capacity(rows);
        for run in &motion.runs {
            let torque = run.joints[joint].torque.as_ref()?;
            all.extend(run.rows.iter().map(|row| torque[*row]));
        }
        Some(all.iter().zip(&stated[joint]).map(|(torque, stated)| torque - stated).collect())
    };
    let moves: Vec<Vec<bool>> = (0..stated.len()).map(|joint| motion.moves(joint)).collect();
    RegressionData {
        runs,
        target: (0..stated.len()).map(target).collect(),
        counts: moves.clone(),
        moves,
        noise: vec![(ArModel::default(), 1.0); stated.len()],
    }
}
