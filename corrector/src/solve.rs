//! Solves for the joint positions that bring the tool to the pose of the controller's geometry.
//!
//! Solves `FK_real(q + δθ(q, W, T)) = FK_nominal(q_cmd)` by at most [`STEPS_MAX`] Newton steps, weighted by the task: from `q_cmd`, or from an extrapolation of the last
//! solutions ([`Solver::track`]). With at most as many task coordinates as joints: minimum norm; with more: least squares.
//!
//! Invariants: converged means that the residual is zero, or that an UNDAMPED step was taken after which the next is predicted to be below [`STEP_DONE`]:
//! a singular pose, where damping hides the residual, is not converged. A solve that does not converge, or is outside the joint limits, gets the best correction within bounds
//! (`limited.rs`). A trial never leaves `reach` (the position limit) about the command.
//! The starting point affects the number of evaluations, not the result (to 1e-9 rad, compared with [`solve`]).
//! A solve does not jump to another branch of solutions, and does not change the effects' memory.

use crate::joints::{apply, stays_within};
use crate::outcome::{Reason, Residual};
use crate::rows::{Rows, TaskError};
use crate::settings::Task;
use crate::slopes::{Here, Slopes, Step};
use crate::trace::{Ended, Trace, is_alone, is_small};
use physics::{Chain, Evaluation, Inputs, Joints, Memories, Model, Told};

/// Limit on Newton steps.
const STEPS_MAX: u32 = 10;
/// Limit on Newton steps of a warm start; after that the solve restarts from the command.
const NEAR_STEPS_MAX: u32 = 2;
/// Converged if the step after the last is predicted to be below this, rad or m: a fortieth of the
/// documented accuracy, because the largest component of a step says little about a direction in
/// which the tool hardly moves.
pub(crate) const STEP_DONE: f64 = 2.5e-11;

/// Result of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Joint positions, rad or m. Only valid if converged or limited.
    pub q: Joints,
    /// Whether it converged.
    pub converged: bool,
    /// What limits it, if it is the best within bounds and an error remains.
    pub limited: Option<Reason>,
    /// Remaining error of the tool pose; near zero if six or more joints control all six degrees of
    /// freedom.
    pub residual: Residual,
    /// Newton steps taken.
    pub steps: u32,
}

/// Buffers for one evaluation of the model and its slopes, kept from cycle to cycle, and the last
/// solutions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Solver {
    pub(crate) seen: Evaluation,
    pub(crate) told: Told,
    pub(crate) slopes: Slopes,
    ended: Ended,
    trace: Trace,
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
    /// Buffer for an evaluation of the arm of the last solve; the next solve overwrites it.
    pub(crate) fn room(&mut self) -> &mut Evaluation {
        &mut self.seen
    }

    /// [`solve`] for the arm of the previous calls, or for the first one.
    pub fn solve(
        &mut self,
        model: &Model,
        inputs: &Inputs,
        memories: &Memories,
        task: &Task,
        reach: &Joints,
    ) -> Solution {
        let case = Case { model, inputs, memories, task, reach };
        let exact = self.begin_at_command(&case);
        self.within_bounds(&case, exact)
    }

    /// [`Solver::solve`] for one of a sequence of commands, `inputs.dt_s` after the previous one:
    /// starts at the extrapolation of the last solutions, if one evaluation is predicted to suffice
    /// from there.
    pub fn track(
        &mut self,
        model: &Model,
        inputs: &Inputs,
        memories: &Memories,
        task: &Task,
        reach: &Joints,
    ) -> Solution {
        let case = Case { model, inputs, memories, task, reach };
        let guess = self.trace.guess(inputs);
        // For effects with a load limit, existence of a solution depends on the load at the
        // commanded pose.
        let is_sure = self.trace.is_sure() && !model.hardens();
        let near = guess.filter(|guess| is_sure && is_small(guess, reach));
        let near = near.and_then(|guess| self.begin_at_guess(&case, &guess));
        let solution = near.unwrap_or_else(|| {
            let solution = self.begin_at_command(&case);
            let Self { ended, slopes, told, .. } = self;
            ended.curvature = if ended.by_step { slopes.curvature(told) } else { None };
            ended.from_command = true;
            solution
        });
        let solution = self.within_bounds(&case, solution);
        self.trace.take(inputs, &solution, guess.as_ref(), &self.ended);
        solution
    }

    /// Resets the warm start: the next solve starts at its command.
    pub fn forget(&mut self) {
        self.trace = Trace::default();
    }

    /// Starts at the command. The effect of deviations on the tool is of first order without their
    /// geometry: enough for a step, not for convergence.
    fn begin_at_command(&mut self, case: &Case<'_>) -> Solution {
        let Case { model, inputs, memories, task, .. } = case;
        self.ended = Ended::default();
        let Self { seen, told, .. } = self;
        model.deviate_into(inputs, memories, seen, Some(told));
        let rows = Rows::of(&seen.nominal.base_from_tool, task);
        let (moved, turned) = seen.deviation.moves(&seen.nominal, &seen.loads.motions);
        let mut way = Way::of(inputs, rows);
        way.error = way.rows.error(task.offset_m - moved, -turned);
        self.walk(case, &mut way, STEPS_MAX)
    }

    /// Starts at the command with `guess` added; `None` if a start at the command is safer.
    fn begin_at_guess(&mut self, case: &Case<'_>, guess: &Joints) -> Option<Solution> {
        let Case { model, inputs, memories, task, reach } = case;
        let Self { seen, told, slopes, trace, ended } = self;
        *ended = Ended::default();
        let rows = Rows::of(&Chain::tool_at(&model.arm, &inputs.q), task);
        let mut way = Way::of(inputs, rows);
        apply(&mut way.trial.q, guess);
        model.deviate_into(&way.trial, memories, seen, Some(told));
        seen.stand(&model.arm, &way.trial);
        way.look(seen);
        let arm = &model.arm;
        slopes.see(&Here { arm, seen, is_real: true, told, rows: &way.rows });
        if !slopes.undamped(&way.error) {
            return None;
        }
        let Step { by, size, left, .. } = slopes.step;
        let curvature = slopes.curvature(told)?;
        let mut correction = *guess;
        apply(&mut correction, &by);
        if !(is_small(&correction, reach) && is_alone(&correction, curvature)) {
            return None;
        }
        ended.curvature = Some(curvature);
        // A robot at rest gets the same bits again.
        if size < STEP_DONE && trace.stands(&inputs.q) {
            return Some(way.here(true, &way.error, task));
        }
        apply(&mut way.trial.q, &by);
        way.steps = 1;
        if trace.foretell(&by, curvature) < STEP_DONE {
            return Some(way.here(true, &left, task));
        }
        way.last = Some(size);
        self.stand(case, &mut way);
        let solution = self.walk(case, &mut way, NEAR_STEPS_MAX);
        solution.converged.then_some(solution)
    }

    /// Newton steps until convergence.
    fn walk(&mut self, case: &Case<'_>, way: &mut Way, steps_max: u32) -> Solution {
        let Case { model, inputs, task, reach, .. } = case;
        loop {
            if !way.is_real && way.error.is_done() {
                self.seen.stand(&model.arm, &way.trial);
                way.look(&self.seen);
            }
            let Self { seen, told, slopes, .. } = self;
            // Beyond the limit of its law the prediction of a hardening joint is not valid, nor is
            // a step from it.
            if seen.beyond.is_some() || way.error.is_done() {
                return way.here(seen.beyond.is_none(), &way.error, task);
            }
            let count = model.arm.count();
            let allowed = |step: &Joints| stays_within(count, &way.trial.q, step, &inputs.q, reach);
            let Way { is_real, rows, .. } = &*way;
            let here = Here { arm: &model.arm, seen, is_real: *is_real, told, rows };
            let by_last = way.last.is_some_and(|last| slopes.again(&here, last, &way.error))
                && allowed(&slopes.step.by);
            let found = by_last || {
                slopes.see(&here);
                slopes.first(&way.error, allowed)
            };
            if !found || way.steps >= steps_max {
                return way.here(false, &way.error, task);
            }
            let next = &slopes.step;
            apply(&mut way.trial.q, &next.by);
            way.steps += 1;
            if way.is_real && next.foretold < STEP_DONE {
                self.ended.by_step = true;
                self.ended.bent = way.last.map_or(0.0, |last| next.size / (last * last));
                return way.here(true, &next.left, task);
            }
            way.last = Some(next.size);
            self.stand(case, way);
        }
    }

    /// Evaluates the model at the trial, one step after the last linearisation.
    fn stand(&mut self, case: &Case<'_>, way: &mut Way) {
        let Self { seen, told, slopes, .. } = self;
        case.model.deviate_on(&way.trial, case.memories, seen, &slopes.step.by, told);
        seen.stand(&case.model.arm, &way.trial);
        way.look(seen);
    }
}

/// Inputs of a solve.
pub(crate) struct Case<'a> {
    pub(crate) model: &'a Model,
    pub(crate) inputs: &'a Inputs,
    pub(crate) memories: &'a Memories,
    pub(crate) task: &'a Task,
    pub(crate) reach: &'a Joints,
}

/// State of a solve.
struct Way {
    trial: Inputs,
    rows: Rows,
    /// Error at the trial.
    error: TaskError,
    /// Whether the error is that of the real geometry.
    is_real: bool,
    /// The size of the last step.
    last: Option<f64>,
    steps: u32,
}

impl Way {
    /// At its start, before an evaluation.
    #[inline(always)]
    fn of(inputs: &Inputs, rows: Rows) -> Self {
        let error = TaskError::default();
        Self { trial: *inputs, rows, error, is_real: false, last: None, steps: 0 }
    }

    fn look(&mut self, seen: &Evaluation) {
        (self.error, self.is_real) = (self.rows.between(&seen.real.base_from_tool), true);
    }

    fn here(&self, converged: bool, left: &TaskError, task: &Task) -> Solution {
        let (q, residual) = (self.trial.q, left.residual(task));
        Solution { q, converged, limited: None, residual, steps: self.steps }
    }
}
