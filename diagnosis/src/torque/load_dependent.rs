//! Effects proportional to torque: load-dependent friction, gain, delay. Their columns depend on fitted masses and are updated with them, both for
//! stated and for candidate friction.

use std::sync::Arc;

use super::case::Case;
use super::filter::{delayed, derivative};
use super::fit_quality::STEP_SHARE;
use super::motion::Motion;
use super::regressors::TorqueTerm;
use super::stated_effects::StatedModel;
use crate::engine::dictionary::{CandidateTerm, CoefficientForm, ParameterBounds};
use crate::engine::normal_equations::LeastSquaresSolution;
use crate::engine::regression_data::Regressor;
use crate::engine::stepwise::TermSelection;

const KIND: &str = "load_friction";
/// Iterations between masses and stated load-dependent friction; each reduces the error by a factor of the friction coefficient at least.
const FRICTION_ITERATIONS: usize = 3;

/// Load-dependent friction of a joint stated by the model. Its load includes masses that the model does not state, which must be fitted.
#[derive(Clone, Debug)]
pub(super) struct StatedLoadFriction {
    joint: usize,
    coefficient: f64,
    /// Correction subtracted from the recorded torque for the load beyond the stated masses, row by row, N m or N; empty before the first fit.
    correction: Vec<f64>,
}

impl StatedLoadFriction {
    /// The stated load-dependent friction of all joints.
    pub(super) fn stated(stated: &StatedModel<'_>) -> Vec<Self> {
        let share_of = |joint| (joint, stated.first_value(KIND, joint));
        let all = (0..stated.model.arm.count()).map(share_of).filter(|(_, share)| *share != 0.0);
        all.map(|(joint, coefficient)| Self { joint, coefficient, correction: Vec::new() })
            .collect()
    }

    /// Norm of the correction over all rows, N m or N.
    pub(super) fn correction_norm(&self) -> f64 {
        libm::sqrt(self.correction.iter().map(|x| x * x).sum())
    }
}

impl Case {
    /// Adds the candidates proportional to torque, after a fit of all others.
    pub(super) fn add_torque_proportional_candidates(&mut self, stated: &StatedModel<'_>) {
        let joints: Vec<usize> = self.table.joints().collect();
        let is_open: Vec<bool> =
            (0..self.inertial_columns).map(|k| self.always_fitted.contains(&k)).collect();
        // Only unstated masses count as load at first; candidate masses and fitted stated masses are included once they are selected.
        let is_load = |k: usize| is_open.get(k) == Some(&true);
        let mut rich = self.fit_of_all_candidates();
        for _ in 0..if self.stated_load_friction.is_empty() { 0 } else { FRICTION_ITERATIONS } {
            self.update_stated_load_friction(&rich, &is_load);
            rich = self.fit_of_all_candidates();
        }
        let whole: Vec<(usize, Vec<f64>)> = joints
            .iter()
            .map(|joint| (*joint, self.modelled_torque(&rich, *joint, &|_| true)))
            .collect();
        self.library.add_torque_proportional(&self.motion, &self.stated_torque, &whole);
        for joint in joints {
            let load = self.rigid_body_load(&rich, joint, &is_load);
            let column = self.load_friction_column(joint, &load);
            let family = CandidateTerm {
                kind: KIND,
                joint: Some(joint),
                recording: None,
                columns: Vec::new(),
                signs: vec![ParameterBounds::AtLeast(-stated.first_value(KIND, joint))],
                form: CoefficientForm::Plain(&["coefficient"]),
                corrects_stated: stated.has_uncertain_first(KIND, joint),
                settings: Vec::new(),
            };
            self.library.add(family, vec![column]);
        }
    }

    /// Torque of a joint by the model and the fitted columns that `is_included` accepts, N m or N.
    fn modelled_torque(
        &self,
        solved: &LeastSquaresSolution,
        joint: usize,
        is_included: &dyn Fn(usize) -> bool,
    ) -> Vec<f64> {
        let chosen = solved.columns.iter().zip(&solved.values).filter(|(k, _)| is_included(**k));
        let parts: Vec<(&Regressor, f64)> =
            chosen.map(|(k, value)| (&self.library.columns[*k], *value)).collect();
        let mut torque = Regressor::linear_combination(&parts, joint, self.table.rows());
        torque.iter_mut().zip(&self.stated_torque[joint]).for_each(|(sum, stated)| *sum += stated);
        torque
    }

    /// Rigid-body torque of a joint: that of the stated masses and of the fitted columns that `is_load` accepts, N m or N.
    fn rigid_body_load(
        &self,
        solved: &LeastSquaresSolution,
        joint: usize,
        is_load: &dyn Fn(usize) -> bool,
    ) -> Vec<f64> {
        let mut load = self.modelled_torque(solved, joint, is_load);
        // Stated friction is not a load.
        let other = self.stated_torque[joint].iter().zip(&self.rigid[joint]);
        load.iter_mut().zip(other).for_each(|(load, (all, rigid))| *load -= all - rigid);
        load
    }

    /// Column of load-dependent friction, `|τ| sign(v)`, for the rigid-body torque `load` at the rows. An absolute value must be taken before
    /// filtering: if the torque's band is narrower, the stated masses' torque is used at every sample, and the fitted remainder is interpolated
    /// between rows.
    fn load_friction_column(&self, joint: usize, load: &[f64]) -> Regressor {
        let Some(sharp) = self.rigid_torque_at_samples.get(joint) else {
            let direction = TorqueTerm::VelocitySign.column(&self.motion, joint);
            let times = |(joint, sign): &(usize, Arc<[f64]>)| {
                (*joint, sign.iter().zip(load).map(|(sign, load)| sign * load.abs()).collect())
            };
            return Regressor { parts: direction.parts.iter().map(times).collect() };
        };
        let beyond: Vec<f64> = load.iter().zip(&self.rigid[joint]).map(|(a, b)| a - b).collect();
        let signs = TorqueTerm::VelocitySign.at_samples(&self.motion, joint);
        let mut all = Vec::with_capacity(load.len());
        for ((run, sharp), signs) in self.motion.runs.iter().zip(sharp).zip(signs) {
            let extra = run.interpolated_from_rows(&beyond[all.len()..all.len() + run.rows.len()]);
            let sizes = sharp.iter().zip(extra).zip(signs);
            let samples: Vec<f64> =
                sizes.map(|((stated, extra), sign)| (stated + extra).abs() * sign).collect();
            all.extend(run.at_rows(&samples));
        }
        Regressor { parts: vec![(joint, all.into())] }
    }

    /// Subtracts from the torque the stated load-dependent friction under the load of this fit.
    fn update_stated_load_friction(
        &mut self,
        solved: &LeastSquaresSolution,
        is_load: &dyn Fn(usize) -> bool,
    ) {
        for place in 0..self.stated_load_friction.len() {
            let StatedLoadFriction { joint, coefficient, correction: ref beyond } =
                self.stated_load_friction[place];
            let solved_column =
                self.load_friction_column(joint, &self.rigid_body_load(solved, joint, is_load));
            let stated = self.load_friction_column(joint, &self.rigid[joint]);
            let beside = [(&solved_column, coefficient), (&stated, -coefficient)];
            let new = Regressor::linear_combination(&beside, joint, self.table.rows());
            let old = beyond.iter().copied().chain(std::iter::repeat(0.0));
            let more: Vec<f64> = new.iter().zip(old).map(|(new, old)| new - old).collect();
            self.stated_torque[joint].iter_mut().zip(&more).for_each(|(sum, more)| *sum += more);
            let target = self.table.target[joint].iter_mut().flatten();
            target.zip(&more).for_each(|(left, more)| *left -= more);
            self.stated_load_friction[place].correction = new;
        }
        // The sums were computed for another right-hand side.
        self.sums.replace(None);
    }

    /// Recomputes the column of a selected delay at its fitted value, since the first order is inaccurate for large delays. Returns whether a delay
    /// is selected.
    pub(super) fn update_delay(&mut self, selection: &TermSelection) -> bool {
        let families = &self.library.terms;
        let mut delays =
            selection.terms.iter().filter(|name| families[**name].kind == "torque_delay");
        let Some(place) = delays.next().map(|name| families[*name].columns[0]) else {
            return false;
        };
        let longest_s = 1.0 / self.motion.band_hz;
        let by_s = selection.solved.value(place).unwrap_or(0.0).clamp(-longest_s, longest_s);
        let joints: Vec<usize> = self.table.joints().collect();
        let part = |joint: usize| {
            let torque = self.modelled_torque(&selection.solved, joint, &|k| k != place);
            (joint, delay_quotient(&self.motion, &torque, by_s).into())
        };
        let column = Regressor { parts: joints.into_iter().map(part).collect() };
        self.library.columns[place] = column;
        true
    }

    /// Recomputes columns of load-dependent friction with the fitted load, and those of spring hardening at the fitted rest position of the spring.
    pub(super) fn update_load_columns(&mut self, selection: &TermSelection) {
        let solved = &selection.solved;
        for name in &selection.terms {
            let spring = &self.library.terms[*name];
            let values: Vec<f64> = spring.columns.iter().filter_map(|k| solved.value(*k)).collect();
            let (CoefficientForm::Spring, Some(joint), [stiffness, level]) =
                (spring.form, spring.joint, values.as_slice())
            else {
                continue;
            };
            let column = TorqueTerm::CubedDeflection { rest: -level / stiffness }
                .column(&self.motion, joint);
            let mut families = self.library.terms.iter();
            let hardening =
                families.find(|f| f.kind == "spring_hardening" && f.joint == Some(joint));
            match hardening.and_then(|f| f.columns.first().copied()) {
                Some(place) => self.library.columns[place] = column,
                None => self.library.add_hardening(joint, column),
            }
        }
        let of_masses = |family: &&CandidateTerm| {
            matches!(family.kind, "payload" | "inertia" | "gravity_torque")
        };
        let families = self.library.terms.iter();
        let named: Vec<usize> =
            families.filter(of_masses).flat_map(|f| f.columns.clone()).collect();
        let inertial = self.inertial_columns;
        let is_load = |k: usize| k < inertial || named.contains(&k);
        if !self.stated_load_friction.is_empty() {
            self.update_stated_load_friction(solved, &is_load);
        }
        let joints: Vec<usize> = self.table.joints().collect();
        for joint in joints {
            let column =
                self.load_friction_column(joint, &self.rigid_body_load(solved, joint, &is_load));
            let families = self.library.terms.iter();
            let place = families
                .filter(|f| f.kind == KIND && f.joint == Some(joint))
                .find_map(|f| f.columns.first().copied());
            if let Some(place) = place {
                self.library.columns[place] = column;
            }
        }
    }
}

/// Change of values at the rows per second of a delay `by_s`, run by run: the difference quotient, or minus the derivative for a small delay.
pub(super) fn delay_quotient(motion: &Motion, values: &[f64], by_s: f64) -> Vec<f64> {
    let mut all = Vec::with_capacity(values.len());
    for run in &motion.runs {
        let stride = run.rows.get(1).map_or(1, |second| second - run.rows[0]);
        let row_s = stride as f64 * run.step_s;
        let piece = &values[all.len()..all.len() + run.rows.len()];
        // Below one hundredth of a row interval the first order is used.
        if by_s.abs() < STEP_SHARE * row_s {
            all.extend(derivative(piece, row_s).into_iter().map(|rate| -rate));
        } else {
            let late = delayed(piece, by_s / row_s);
            all.extend(late.iter().zip(piece).map(|(late, now)| (late - now) / by_s));
        }
    }
    all
}
