//! The joint positions that put the tool where the controller's geometry would have put it.
//!
//! Solves `FK_real(q + δθ(q, W, T)) = FK_nominal(q_cmd)` from `q_cmd` by at most [`STEPS_MAX`] Newton steps, rows in the wanted tool's
//! axes, weighted by the task. As many freedoms asked as joints there are, or fewer: least change of the joints; more: least squares.
//! Each step stands on slopes of its own, of the geometry and of the effects that tell theirs; the normal equations are factored once, and the factor put right
//! by one refinement while each step is much smaller than the one before.
//!
//! Promises: converged means that nothing is left over, or that an UNDAMPED step was taken after which the next is foretold to be below [`STEP_DONE`]:
//! a singular pose, where damping hides what is left, is refused with the residual. A trial never leaves `reach` (the envelope's angle) about the command.
//! Never: a jump to another branch of solutions, memory (what effects remember stays as it is during the solve).

use crate::normal::{Factor, ROWS};
use crate::outcome::Residual;
use crate::settings::Task;
use glam::{DMat3, DVec3};
use physics::frame::vector_from_rotation;
use physics::{Arm, Chain, Evaluation, Frame, Inputs, JOINTS_MAX, Joints, Memories, Model, Told};

/// The most Newton steps.
const STEPS_MAX: u32 = 10;
/// The solution stands once the step after the last is foretold to be below this, rad or m: a fortieth of what is promised, as the largest of a step
/// says little of a direction in which the tool hardly moves.
const STEP_DONE: f64 = 2.5e-11;
/// It stands too once the weighted error is below this, m: rounding of the geometry.
const ERROR_DONE_M: f64 = 1e-14;
/// A step that is larger than this share of the one before asks for a new factor.
const SHRINKS: f64 = 0.1;
/// Where all slopes are told, steps shrink by squares; so many times what the last two foretell by that is believed.
const MARGIN: f64 = 10.0;
/// Damping of the first damped try, relative to the mean of the diagonal; each further try has 30 times as much.
const FIRST_DAMPING: f64 = 1e-8;
const DAMPED_TRIES: u32 = 6;

/// Where a solve ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Joint positions, rad or m. Not to be used where it has not converged.
    pub q: Joints,
    /// Whether it converged.
    pub converged: bool,
    /// What is left over in the tool; near zero where six or more joints serve all six freedoms.
    pub residual: Residual,
    /// Newton steps spent.
    pub steps: u32,
}

/// Room for one evaluation of the model and for its slopes, kept from cycle to cycle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Solver {
    seen: Evaluation,
    told: Told,
    slopes: Slopes,
}

/// Solves for the command in `inputs.q`; `reach` is how far each joint may go from it, rad or m.
pub fn solve(
    model: &Model,
    inputs: &Inputs,
    memories: &Memories,
    task: &Task,
    reach: &Joints,
) -> Solution {
    Solver::default().solve(model, inputs, memories, task, reach)
}

impl Solver {
    /// Room for an evaluation of the arm that was solved for; the next solve begins anew there.
    pub(crate) fn room(&mut self) -> &mut Evaluation {
        &mut self.seen
    }

    /// [`solve`] for the arm that this solver has seen before, or for its first.
    pub fn solve(
        &mut self,
        model: &Model,
        inputs: &Inputs,
        memories: &Memories,
        task: &Task,
        reach: &Joints,
    ) -> Solution {
        let Self { seen, told, slopes } = self;
        let (mut trial, mut last, mut steps, mut is_real) = (*inputs, None::<Step>, 0, false);
        model.deviate_into(&trial, memories, seen, Some(told));
        let rows = Rows::of(&seen.nominal.base_from_tool, task);
        // What deviations do to the tool is told to first order without the geometry that they make: enough for a step, not for an end.
        let (moved, turned) = seen.deviation.moves(&model.arm, &seen.nominal);
        let mut error = rows.error(-moved, -turned);
        loop {
            if !is_real && error.is_done() {
                seen.stand(&model.arm, &trial);
                (error, is_real) = (rows.between(&seen.real.base_from_tool), true);
            }
            let here = |converged| {
                let residual = error.residual(task);
                Solution { q: trial.q, converged, residual, steps }
            };
            // Beyond its law's limit a hardening joint's prediction is worth nothing: nothing may be built on it.
            if seen.beyond.is_some() || error.is_done() {
                return here(seen.beyond.is_none());
            }
            let chain = if is_real { &seen.real } else { &seen.nominal };
            let allowed = |step: &Joints| stays_within(&trial.q, step, &inputs.q, reach);
            let stands = Here { arm: &model.arm, seen, chain, told, rows: &rows };
            let again = last.and_then(|last| slopes.again(&last, &error, &stands));
            let next = again.filter(|next| allowed(&next.by)).or_else(|| {
                slopes.take(&model.arm, chain, told, &rows);
                slopes.first(&error, &stands, allowed)
            });
            let Some(next) = next.filter(|_| steps < STEPS_MAX) else {
                return here(false);
            };
            apply(&mut trial.q, &next.by);
            steps += 1;
            if is_real && next.foretold < STEP_DONE {
                let residual = next.left.residual(task);
                return Solution { q: trial.q, converged: true, residual, steps };
            }
            last = Some(next);
            model.deviate_into(&trial, memories, seen, Some(told));
            seen.stand(&model.arm, &trial);
            (error, is_real) = (rows.between(&seen.real.base_from_tool), true);
        }
    }
}

/// What is asked of the tool, as rows: the wanted tool's axes, m, rotations times the task's length.
struct Rows {
    wanted: Frame,
    tool_from_base: DMat3,
    length_m: f64,
    free_tool_axis: bool,
}

impl Rows {
    fn of(wanted: &Frame, task: &Task) -> Self {
        Self {
            wanted: *wanted,
            tool_from_base: wanted.rotation.transpose(),
            length_m: task.length_m,
            free_tool_axis: task.free_tool_axis,
        }
    }

    /// A motion of the tool, m and rad in base axes.
    fn motion(&self, linear: DVec3, angular: DVec3) -> [f64; ROWS] {
        let (v, w) = (self.tool_from_base * linear, self.tool_from_base * angular * self.length_m);
        [v.x, v.y, v.z, w.x, w.y, if self.free_tool_axis { 0.0 } else { w.z }]
    }

    fn error(&self, linear: DVec3, angular: DVec3) -> TaskError {
        TaskError(self.motion(linear, angular))
    }

    /// From where the tool is to where it should be.
    fn between(&self, here: &Frame) -> TaskError {
        let turn = vector_from_rotation(&(self.wanted.rotation * here.rotation.transpose()));
        self.error(self.wanted.origin - here.origin, turn)
    }
}

/// What is left between where the tool is and where it should be, as [`Rows`] say.
#[derive(Clone, Copy)]
struct TaskError([f64; ROWS]);

impl TaskError {
    fn residual(&self, task: &Task) -> Residual {
        let [x, y, z, a, b, c] = self.0;
        Residual {
            m: DVec3::new(x, y, z).length(),
            rad: DVec3::new(a, b, c).length() / task.length_m,
        }
    }

    /// Whether nothing of the task is left over: then even a singular pose has its solution.
    fn is_done(&self) -> bool {
        self.0.iter().map(|x| x * x).sum::<f64>() < ERROR_DONE_M * ERROR_DONE_M
    }
}

/// Where the arm stands in the midst of a solve.
struct Here<'a> {
    arm: &'a Arm,
    seen: &'a Evaluation,
    /// The geometry that counts.
    chain: &'a Chain,
    told: &'a Told,
    rows: &'a Rows,
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
struct Refined {
    by: Joints,
    /// The largest of it.
    size: f64,
    /// What it leaves of the task.
    left: TaskError,
    /// The largest that another refinement would add.
    error: f64,
}

/// A step of the joints, rad or m.
#[derive(Clone, Copy)]
struct Step {
    by: Joints,
    /// The largest of it; endless for a damped one, from which nothing may be foretold.
    size: f64,
    /// How large the next step will be.
    foretold: f64,
    /// What it leaves of the task where the slopes hold.
    left: TaskError,
}

/// The linearised task at one trial.
#[derive(Clone, Copy, Debug, Default)]
struct Slopes {
    /// How the tool moves with each joint, as in [`Rows`].
    columns: [[f64; ROWS]; JOINTS_MAX],
    joints: usize,
    frees_tool_axis: bool,
    factor: Factor,
}

impl Slopes {
    /// Linearises on the geometry of `chain`, with what joints' deviations tell of their own joint.
    fn take(&mut self, arm: &Arm, chain: &Chain, told: &Told, rows: &Rows) {
        (self.joints, self.frees_tool_axis) = (arm.count(), rows.free_tool_axis);
        let joints = arm.joints().iter().zip(&told.position).enumerate();
        for ((i, (joint, slope)), column) in joints.zip(&mut self.columns) {
            let (linear, angular) = chain.motion_of(i, joint.kind);
            *column = rows.motion(linear, angular).map(|row| row * (1.0 + slope));
        }
    }

    /// The step on slopes just taken; damped as little as `allowed` asks for.
    fn first(
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
    fn again(&self, last: &Step, error: &TaskError, here: &Here<'_>) -> Option<Step> {
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
    fn refined(&self, error: &TaskError, here: &Here<'_>) -> Refined {
        let mut by = self.step(error);
        let rough = largest(&by);
        let mut left = *error;
        left.0.iter_mut().zip(here.motion(&by)).for_each(|(left, moved)| *left -= moved);
        let more = self.step(&left);
        apply(&mut by, &more);
        let (left, more) = (self.left_of(&left, &more), largest(&more));
        Refined { by, size: largest(&by), left, error: more * (more / rough) }
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
    fn factored(&mut self, damping: f64) -> Option<()> {
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

fn apply(q: &mut Joints, step: &Joints) {
    for (q, step) in q.iter_mut().zip(step) {
        *q += step;
    }
}

/// What is not a number does not stay anywhere.
fn stays_within(q: &Joints, step: &Joints, centre: &Joints, reach: &Joints) -> bool {
    let after = q.iter().zip(step).map(|(q, step)| q + step);
    after.zip(centre).zip(reach).all(|((after, centre), reach)| (after - centre).abs() <= *reach)
}

fn largest(step: &Joints) -> f64 {
    step.iter().fold(0.0, |most, x| most.max(x.abs()))
}
