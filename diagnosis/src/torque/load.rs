//! Effects proportional to the torque itself: load-dependent friction, gain, delay; updated with fitted masses.
//!
//! Promises: fitted masses are included in the load of stated and of candidate friction. Never: a selection.

use std::sync::Arc;

use super::case::Case;
use super::columns::Law;
use super::filter::{derivative, later};
use super::known::Stated;
use super::motion::Motion;
use super::prove::WITHIN_A_STEP;
use crate::engine::library::{Family, Form, Sign};
use crate::engine::normal_equations::Solved;
use crate::engine::stepwise::Selection;
use crate::engine::table::Column;

const KIND: &str = "load_friction";
/// Rounds in which masses and the friction that is stated to go with their load are fitted by turns: each leaves at most the coefficient's share of what
/// the one before left.
const TURNS: usize = 3;

/// Friction of a joint that the model states to go with the load. Of masses the model may say nothing, and it does not know what else hangs there.
#[derive(Clone, Debug)]
pub(super) struct Rubbing {
    joint: usize,
    coefficient: f64,
    /// What is taken off the torque for it, row by row, beyond what stated masses ask for; empty before anything is known.
    beyond: Vec<f64>,
}

impl Rubbing {
    /// Of every joint whose model states any.
    pub(super) fn stated(stated: &Stated<'_>) -> Vec<Self> {
        let of = |joint| (joint, stated.first(KIND, joint));
        let all = (0..stated.model.arm.count()).map(of).filter(|(_, share)| *share != 0.0);
        all.map(|(joint, coefficient)| Self { joint, coefficient, beyond: Vec::new() }).collect()
    }

    /// How much is taken off, all rows together, N m or N.
    pub(super) fn size(&self) -> f64 {
        libm::sqrt(self.beyond.iter().map(|x| x * x).sum())
    }
}

impl Case {
    /// Laws that go with the torque itself need a first fit of all the others.
    pub(super) fn of_torques(&mut self, stated: &Stated<'_>) {
        let joints: Vec<usize> = self.table.joints().collect();
        let is_open: Vec<bool> = (0..self.inertial).map(|k| self.open.contains(&k)).collect();
        // Of the masses alone of which nothing is known: what is named or doubted comes once it is found.
        let of = |k: usize| is_open.get(k) == Some(&true);
        let mut rich = self.rich();
        for _ in 0..if self.rubbing.is_empty() { 0 } else { TURNS } {
            self.restate(&rich, &of);
            rich = self.rich();
        }
        let whole: Vec<(usize, Vec<f64>)> =
            joints.iter().map(|joint| (*joint, self.modelled(&rich, *joint, &|_| true))).collect();
        self.library.of_torque(&self.motion, &self.stated, &whole);
        for joint in joints {
            let load = self.load(&rich, joint, &of);
            let column = self.load_column(joint, &load);
            let family = Family {
                kind: KIND,
                joint: Some(joint),
                recording: None,
                columns: Vec::new(),
                signs: vec![Sign::AtLeast(-stated.first(KIND, joint))],
                form: Form::Plain(&["coefficient"]),
                revises: stated.revises(KIND, joint),
                settings: Vec::new(),
            };
            self.library.add(family, vec![column]);
        }
    }

    /// Torque of a joint by the columns that `of` takes, without what the model states.
    fn modelled(&self, solved: &Solved, joint: usize, of: &dyn Fn(usize) -> bool) -> Vec<f64> {
        let chosen = solved.columns.iter().zip(&solved.values).filter(|(k, _)| of(**k));
        let parts: Vec<(&Column, f64)> =
            chosen.map(|(k, value)| (&self.library.columns[*k], *value)).collect();
        let mut torque = Column::sum(&parts, joint, self.table.rows());
        torque.iter_mut().zip(&self.stated[joint]).for_each(|(sum, stated)| *sum += stated);
        torque
    }

    /// The torque of a joint that masses ask for: stated ones and those of the columns that `of` takes.
    fn load(&self, solved: &Solved, joint: usize, of: &dyn Fn(usize) -> bool) -> Vec<f64> {
        let mut load = self.modelled(solved, joint, of);
        // What the model states of friction is no load.
        let other = self.stated[joint].iter().zip(&self.rigid[joint]);
        load.iter_mut().zip(other).for_each(|(load, (all, rigid))| *load -= all - rigid);
        load
    }

    /// `|τ| sign(v)`, the rigid body's torque given row by row. A size is not what its band says: where the torque's is narrow, what stated masses ask for is taken
    /// as it is before it passes the filter, and what masses are told to ask for beyond between the rows.
    fn load_column(&self, joint: usize, load: &[f64]) -> Column {
        let Some(sharp) = self.sharp.get(joint) else {
            let direction = Law::Direction.column(&self.motion, joint);
            let times = |(joint, sign): &(usize, Arc<[f64]>)| {
                (*joint, sign.iter().zip(load).map(|(sign, load)| sign * load.abs()).collect())
            };
            return Column { parts: direction.parts.iter().map(times).collect() };
        };
        let beyond: Vec<f64> = load.iter().zip(&self.rigid[joint]).map(|(a, b)| a - b).collect();
        let signs = Law::Direction.at_samples(&self.motion, joint);
        let mut all = Vec::with_capacity(load.len());
        for ((run, sharp), signs) in self.motion.runs.iter().zip(sharp).zip(signs) {
            let told = run.between(&beyond[all.len()..all.len() + run.rows.len()]);
            let sizes = sharp.iter().zip(told).zip(signs);
            let samples: Vec<f64> =
                sizes.map(|((stated, told), sign)| (stated + told).abs() * sign).collect();
            all.extend(run.at_rows(&samples));
        }
        Column { parts: vec![(joint, all.into())] }
    }

    /// Takes off the torque what friction that is stated to go with the load exerts under the load that this fit tells.
    fn restate(&mut self, solved: &Solved, of: &dyn Fn(usize) -> bool) {
        for place in 0..self.rubbing.len() {
            let Rubbing { joint, coefficient, ref beyond } = self.rubbing[place];
            let told = self.load_column(joint, &self.load(solved, joint, of));
            let stated = self.load_column(joint, &self.rigid[joint]);
            let beside = [(&told, coefficient), (&stated, -coefficient)];
            let new = Column::sum(&beside, joint, self.table.rows());
            let old = beyond.iter().copied().chain(std::iter::repeat(0.0));
            let more: Vec<f64> = new.iter().zip(old).map(|(new, old)| new - old).collect();
            self.stated[joint].iter_mut().zip(&more).for_each(|(sum, more)| *sum += more);
            let target = self.table.target[joint].iter_mut().flatten();
            target.zip(&more).for_each(|(left, more)| *left -= more);
            self.rubbing[place].beyond = new;
        }
        // They were of another right-hand side.
        self.sums.replace(None);
    }

    /// Gives a delay that stands what it does to the torque that this fit tells: for what is late by much the first order is not enough. Whether it changed.
    pub(super) fn late(&mut self, selection: &Selection) -> bool {
        let families = &self.library.families;
        let mut delays =
            selection.names.iter().filter(|name| families[**name].kind == "torque_delay");
        let Some(place) = delays.next().map(|name| families[*name].columns[0]) else {
            return false;
        };
        let longest_s = 1.0 / self.motion.band_hz;
        let by_s = selection.solved.value(place).unwrap_or(0.0).clamp(-longest_s, longest_s);
        let joints: Vec<usize> = self.table.joints().collect();
        let part = |joint: usize| {
            let torque = self.modelled(&selection.solved, joint, &|k| k != place);
            (joint, of_delay(&self.motion, &torque, by_s).into())
        };
        let column = Column { parts: joints.into_iter().map(part).collect() };
        self.library.columns[place] = column;
        true
    }

    /// Gives friction that goes with the load the load that this fit tells, and springs that harden the place where the spring rests.
    pub(super) fn reload(&mut self, selection: &Selection) {
        let solved = &selection.solved;
        for name in &selection.names {
            let spring = &self.library.families[*name];
            let values: Vec<f64> = spring.columns.iter().filter_map(|k| solved.value(*k)).collect();
            let (Form::Spring, Some(joint), [stiffness, level]) =
                (spring.form, spring.joint, values.as_slice())
            else {
                continue;
            };
            let column = Law::Cube { rest: -level / stiffness }.column(&self.motion, joint);
            let mut families = self.library.families.iter();
            let hardening =
                families.find(|f| f.kind == "spring_hardening" && f.joint == Some(joint));
            match hardening.and_then(|f| f.columns.first().copied()) {
                Some(place) => self.library.columns[place] = column,
                None => self.library.add_hardening(joint, column),
            }
        }
        let of_masses =
            |family: &&Family| matches!(family.kind, "payload" | "inertia" | "gravity_torque");
        let families = self.library.families.iter();
        let named: Vec<usize> =
            families.filter(of_masses).flat_map(|f| f.columns.clone()).collect();
        let inertial = self.inertial;
        let of = |k: usize| k < inertial || named.contains(&k);
        if !self.rubbing.is_empty() {
            self.restate(solved, &of);
        }
        let joints: Vec<usize> = self.table.joints().collect();
        for joint in joints {
            let column = self.load_column(joint, &self.load(solved, joint, &of));
            let families = self.library.families.iter();
            let place = families
                .filter(|f| f.kind == KIND && f.joint == Some(joint))
                .find_map(|f| f.columns.first().copied());
            if let Some(place) = place {
                self.library.columns[place] = column;
            }
        }
    }
}

/// What values at rows, run by run, change by where they come `by_s` later, per second.
pub(super) fn of_delay(motion: &Motion, values: &[f64], by_s: f64) -> Vec<f64> {
    let mut all = Vec::with_capacity(values.len());
    for run in &motion.runs {
        let stride = run.rows.get(1).map_or(1, |second| second - run.rows[0]);
        let row_s = stride as f64 * run.step_s;
        let piece = &values[all.len()..all.len() + run.rows.len()];
        // Of less than a hundredth of a row only the first order is left.
        if by_s.abs() < WITHIN_A_STEP * row_s {
            all.extend(derivative(piece, row_s).into_iter().map(|rate| -rate));
        } else {
            let late = later(piece, by_s / row_s);
            all.extend(late.iter().zip(piece).map(|(late, now)| (late - now) / by_s));
        }
    }
    all
}
