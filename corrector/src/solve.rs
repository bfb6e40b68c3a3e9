//! Solves for the joint positions that bring the tool to the pose of the controller's geometry.
//!
//! Solves `FK_real(q + δθ(q, W, T)) = FK_nominal(q_cmd)` by at most [`STEPS_MAX`] Newton steps, weighted by the task: from `q_cmd`, or from an extrapolation of the last
//! solutions ([`Solver::track`]). With at most as many task coordinates as joints: minimum norm; with more: least squares.
//!
//! Promises: converged means that the residual is zero, or that an UNDAMPED step was taken after which the next is predicted to be below [`STEP_DONE`]:
//! a singular pose, where damping hides the residual, is not converged. A solve that does not converge, or is outside the joint limits, gets the best correction within bounds
//! (`limited.rs`). A trial never leaves `reach` (the position limit) about the command.
//! The starting point affects the number of evaluations, not the result (to 1e-9 rad, compared with [`solve`]).
//! Never: a jump to another branch of solutions, a change of the effects' memory during the solve.

use crate::joints::{apply, stays_within};
use crate::outcome::{Reason, Residual};
use crate::rows::{Rows, TaskError};
use crate::settings::Task;
use crate::slopes::{Here, Slopes, Step};
use crate::trace::{Ended, Trace, is_alone, is_small};
use physics::{Chain, Evaluation, Inputs, Joints, Memories, Model, Told};

/// The most Newton steps.
const STEPS_MAX: u32 = 10;
/// The most from where the last solutions lead: what is not found by then is sought from the command.
const NEAR_STEPS_MAX: u32 = 2;
/// The solution stands once the step after the last is foretold to be below this, rad or m: a fortieth of what is promised, as the largest of a step
/// says little of a direction in which the tool hardly moves.
pub(crate) const STEP_DONE: f64 = 2.5e-11;

/// Where a solve ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Joint positions, rad or m. Not to be used where it has neither converged nor is limited.
    pub q: Joints,
    /// Whether it converged.
    pub converged: bool,
    /// What holds it back, where it is the best within bounds and something is left.
    pub limited: Option<Reason>,
    /// What is left over in the tool; near zero where six or more joints serve all six freedoms.
    pub residual: Residual,
    /// Newton steps spent.
    pub steps: u32,
}

/// Room for one evaluation of the model and for its slopes, kept from cycle to cycle, and where the last solutions were.
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
    /// Room for an evaluation of the arm that was solved for; the next solve overwrites it.
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
        let case = Case { model, inputs, memories, task, reach };
        let exact = self.begin_at_command(&case);
        self.within_bounds(&case, exact)
    }

    /// [`Solver::solve`] for one of commands that follow each other, `inputs.dt_s` after the one before: begun where the last solutions lead, if
    /// one evaluation is foretold to do from there.
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
        // Where a law has a limit, the load at the command itself has a say in whether there is a solution.
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

    /// Forgets where the last solutions were: the next begins at its command.
    pub fn forget(&mut self) {
        self.trace = Trace::default();
    }

    /// From the command. What deviations do to the tool is told to first order without the geometry that they make: enough for a step, not for an end.
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

    /// From the command with `guess` added to it; none where it is safer from the command itself.
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
        // A robot that stands still gets the same bits again.
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

    /// Newton steps until one stands.
    fn walk(&mut self, case: &Case<'_>, way: &mut Way, steps_max: u32) -> Solution {
        let Case { model, inputs, task, reach, .. } = case;
        loop {
            if !way.is_real && way.error.is_done() {
                self.seen.stand(&model.arm, &way.trial);
                way.look(&self.seen);
            }
            let Self { seen, told, slopes, .. } = self;
            // Beyond its law's limit a hardening joint's prediction is worth nothing: nothing may be built on it.
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

    /// Evaluates the model at the trial, which is the last step from where it was seen.
    fn stand(&mut self, case: &Case<'_>, way: &mut Way) {
        let Self { seen, told, slopes, .. } = self;
        case.model.deviate_on(&way.trial, case.memories, seen, &slopes.step.by, told);
        seen.stand(&case.model.arm, &way.trial);
        way.look(seen);
    }
}

/// What is to be solved.
pub(crate) struct Case<'a> {
    pub(crate) model: &'a Model,
    pub(crate) inputs: &'a Inputs,
    pub(crate) memories: &'a Memories,
    pub(crate) task: &'a Task,
    pub(crate) reach: &'a Joints,
}

/// How far a solve has come.
struct Way {
    trial: Inputs,
    rows: Rows,
    /// What is left at the trial.
    error: TaskError,
    /// Whether the error is that of the real geometry.
    is_real: bool,
    /// The size of the last step.
    last: Option<f64>,
    steps: u32,
}

impl Way {
    /// At its beginning, before a look.
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
