//! The task linearised at one trial, and the steps that follow from it.
//!
//! Each step stands on slopes of its own, of the geometry and of the effects that tell theirs; the normal equations are factored once, and the factor put right
//! by one refinement while each step is much smaller than the one before.
//!
//! Promises: an undamped step foretells how large the next will be, a damped one nothing. Never: an evaluation of the model.

use crate::normal::{Factor, ROWS};
use crate::rows::{Rows, TaskError};
use libm::sqrt;
use physics::{Arm, Chain, Evaluation, JOINTS_MAX, Joints, Told};

/// A step that is larger than this share of the one before asks for a new factor.
const SHRINKS: f64 = 0.1;
/// Where all slopes are told, steps shrink by squares; so many times what the last two foretell by that is believed.
pub(crate) const MARGIN: f64 = 10.0;
/// Damping of the first damped try, relative to the mean of the diagonal; each further try has 30 times as much.
const FIRST_DAMPING: f64 = 1e-8;
const DAMPED_TRIES: u32 = 6;

/// Where the arm stands in the midst of a solve.
pub(crate) struct Here<'a> {
    pub(crate) arm: &'a Arm,
    pub(crate) seen: &'a Evaluation,
    /// The geometry that counts.
    pub(crate) chain: &'a Chain,
    pub(crate) told: &'a Told,
    pub(crate) rows: &'a Rows,
}

impl Here<'_> {
    /// How a small step of the joints moves the tool, with all that effects tell.
    fn motion(&self, step: &Joints) -> [f64; ROWS] {
        let (more, mut angular) = self.told.follow(self.arm, self.seen, step);
        let mut linear = angular.cross(self.chain.base_from_tool.origin);
        for (i, joint) in self.arm.joints().iter().enumerate() {
            let (v, w) = self.chain.motion_of(i, joint.kind);
            let whole = step[i] + more[i];
            linear += v * whole;
            angular += w * whole;
        }
        self.rows.motion(linear, angular)
    }
}

/// A step that was refined.
pub(crate) struct Refined {
    pub(crate) by: Joints,
    /// The largest of it.
    pub(crate) size: f64,
    /// What it leaves of the task.
    pub(crate) left: TaskError,
    /// The largest that another refinement would add.
    pub(crate) error: f64,
}

/// A step of the joints, rad or m.
#[derive(Clone, Copy)]
pub(crate) struct Step {
    pub(crate) by: Joints,
    /// The largest of it; endless for a damped one, from which nothing may be foretold.
    pub(crate) size: f64,
    /// How large the next step will be.
    pub(crate) foretold: f64,
    /// What it leaves of the task where the slopes hold.
    pub(crate) left: TaskError,
}

/// The linearised task at one trial.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Slopes {
    /// How the tool moves with each joint, as in [`Rows`].
    columns: [[f64; ROWS]; JOINTS_MAX],
    joints: usize,
    frees_tool_axis: bool,
    factor: Factor,
}

impl Slopes {
    /// Linearises on the geometry of `chain`, with what joints' deviations tell of their own joint.
    pub(crate) fn take(&mut self, arm: &Arm, chain: &Chain, told: &Told, rows: &Rows) {
        (self.joints, self.frees_tool_axis) = (arm.count(), rows.free_tool_axis);
        let joints = arm.joints().iter().zip(&told.position).enumerate();
        for ((i, (joint, slope)), column) in joints.zip(&mut self.columns) {
            let (linear, angular) = chain.motion_of(i, joint.kind);
            *column = rows.motion(linear, angular).map(|row| row * (1.0 + slope));
        }
    }

    /// The step on slopes just taken; damped as little as `allowed` asks for.
    pub(crate) fn first(
        &mut self,
        error: &TaskError,
        here: &Here<'_>,
        allowed: impl Fn(&Joints) -> bool,
    ) -> Option<Step> {
        let undamped = self.factored(0.0).map(|()| self.refined(error, here));
        if let Some(Refined { by, size, left, .. }) = undamped.filter(|step| allowed(&step.by)) {
            return Some(Step { by, size, foretold: size, left });
        }
        let mut damping = FIRST_DAMPING;
        for _ in 0..DAMPED_TRIES {
            self.factored(damping)?;
            let by = self.step(error);
            if allowed(&by) {
                let left = self.left_of(error, &by);
                return Some(Step { by, size: f64::INFINITY, foretold: f64::INFINITY, left });
            }
            damping *= 30.0;
        }
        None
    }

    /// The next step with the factor of the `last`; none where that was damped, or where this is not much smaller.
    pub(crate) fn again(&self, last: &Step, error: &TaskError, here: &Here<'_>) -> Option<Step> {
        if last.size == f64::INFINITY {
            return None;
        }
        let Refined { by, size, left, error } = self.refined(error, here);
        let shrinks = size / last.size;
        // What the slopes do not tell shrinks by the same share again, what they do by its square. Of what stays of the task they tell nothing.
        let is_whole = here.told.is_whole && self.serve_all() && !self.frees_tool_axis;
        let next = if is_whole { MARGIN * shrinks * shrinks } else { shrinks };
        let foretold = next * size + error;
        (shrinks < SHRINKS).then_some(Step { by, size, foretold, left })
    }

    /// The step, and once more for what it leaves of the error as all slopes are here.
    pub(crate) fn refined(&self, error: &TaskError, here: &Here<'_>) -> Refined {
        let mut by = self.step(error);
        let rough = largest(&by);
        let mut left = *error;
        left.0.iter_mut().zip(here.motion(&by)).for_each(|(left, moved)| *left -= moved);
        let more = self.step(&left);
        apply(&mut by, &more);
        let (left, more) = (self.left_of(&left, &more), largest(&more));
        Refined { by, size: largest(&by), left, error: more * (more / rough) }
    }

    /// How much slopes turn with the joints, per unit of the joints: after a Newton step the next is at most half of this times the square of the sum of
    /// its sizes, as far as the geometry goes. A joint's motion of the tool turns with the joints before it by no more than its length, and an error of the
    /// task asks for no more than the norm of the inverse. None where more than the geometry and told slopes count, or more joints than are asked.
    pub(crate) fn curvature(&self, told: &Told) -> Option<f64> {
        let is_square = self.joints == ROWS && !self.frees_tool_axis;
        if !(is_square && told.is_whole) {
            return None;
        }
        let longest =
            self.columns().iter().fold(0.0_f64, |most, column| most.max(dot(column, column)));
        Some(sqrt(self.factor.trace_of_inverse() * longest))
    }

    fn columns(&self) -> &[[f64; ROWS]] {
        &self.columns[..self.joints]
    }

    /// Rows that are asked.
    fn asked(&self) -> usize {
        if self.frees_tool_axis { ROWS - 1 } else { ROWS }
    }

    /// Whether the joints can serve all that is asked: then `J Jᵀ` is factored, else `JᵀJ`.
    fn serve_all(&self) -> bool {
        self.asked() <= self.joints
    }

    /// The normal equations with damping, relative to the mean of their diagonal; rows that take no part become those of the unit matrix.
    pub(crate) fn factored(&mut self, damping: f64) -> Option<()> {
        let mut normal = [[0.0; ROWS]; ROWS];
        let part = if self.serve_all() { self.asked() } else { self.joints };
        if self.serve_all() {
            for column in self.columns() {
                for i in 0..ROWS {
                    (0..=i).for_each(|k| normal[i][k] += column[i] * column[k]);
                }
            }
        } else {
            for (i, a) in self.columns().iter().enumerate() {
                for (k, b) in self.columns()[..=i].iter().enumerate() {
                    normal[i][k] = dot(a, b);
                }
            }
        }
        let added = damping * (0..part).map(|i| normal[i][i]).sum::<f64>() / ROWS as f64;
        (0..part).for_each(|i| normal[i][i] += added);
        (part..ROWS).for_each(|i| normal[i][i] = 1.0);
        self.factor = Factor::of(&normal)?;
        Some(())
    }

    /// `Jᵀ (J Jᵀ)⁻¹ e`; for fewer joints than rows `(JᵀJ)⁻¹ Jᵀ e`.
    fn step(&self, error: &TaskError) -> Joints {
        let mut step = [0.0; JOINTS_MAX];
        if self.serve_all() {
            let x = self.factor.solve(&error.0);
            step.iter_mut().zip(self.columns()).for_each(|(step, column)| *step = dot(column, &x));
        } else {
            let mut pull = [0.0; ROWS];
            pull.iter_mut()
                .zip(self.columns())
                .for_each(|(pull, column)| *pull = dot(column, &error.0));
            step[..ROWS].copy_from_slice(&self.factor.solve(&pull));
        }
        step
    }

    /// What a step leaves of an error where the slopes hold.
    fn left_of(&self, error: &TaskError, step: &Joints) -> TaskError {
        let mut left = *error;
        for (column, step) in self.columns().iter().zip(step) {
            left.0.iter_mut().zip(column).for_each(|(left, slope)| *left -= slope * step);
        }
        left
    }
}

fn dot(a: &[f64; ROWS], b: &[f64; ROWS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(crate) fn apply(q: &mut Joints, step: &Joints) {
    for (q, step) in q.iter_mut().zip(step) {
        *q += step;
    }
}

pub(crate) fn largest(step: &Joints) -> f64 {
    step.iter().fold(0.0, |most, x| most.max(x.abs()))
}
