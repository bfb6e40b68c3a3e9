//! Solves for the joint positions that bring the tool to the pose of the controller's geometry.
//!
//! Solves `FK_real(q + δθ(q, W, T)) = FK_nominal(q_cmd)` by at most [`STEPS_MAX`] Newton steps, weighted by the task: from `q_cmd`, or from an extrapolation of the last
//! solutions ([`Solver::track`]). With at most as many task coordinates as joints: minimum norm; with more: least squares.
//!
//! Invariants: converged means that the residual is zero, or that an UNDAMPED step was taken after which the next is predicted to be below [`STEP_DONE`]:
//! a singular pose, where damping hides the residual, is not converged. A solve that does not converge, or is outside the joint limits, gets the best correction within bounds
//! (`bounded_solution.rs`). A trial never leaves the position limits about the command.
//! The starting point affects the number of evaluations, not the result (to 1e-9 rad, compared with [`solve`]).
//! A solve does not jump to another branch of solutions, and does not change the effects' memory.

use crate::joints::{apply, stays_within};
use crate::linearisation::{Linearisation, LinearisationPoint, NewtonStep};
use crate::outcome::{Reason, Residual};
use crate::settings::Task;
use crate::task_rows::{TaskError, TaskRows};
use crate::warm_start::{SolveSummary, WarmStart, is_small, is_unique};
use physics::{Chain, Evaluation, Inputs, Joints, Memories, Model, SlopeSums};

/// Limit on Newton steps.
const STEPS_MAX: u32 = 10;
/// Limit on Newton steps of a warm start; after that the solve restarts from the command.
const WARM_STEPS_MAX: u32 = 2;
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
    /// The limit, if this is the best solution within bounds and an error remains.
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
    pub(crate) evaluation: Evaluation,
    pub(crate) slope_sums: SlopeSums,
    pub(crate) linearisation: Linearisation,
    summary: SolveSummary,
    warm_start: WarmStart,
}

/// Solves for the command in `inputs.q`; `position_limits` is how far each joint may go from it, rad or m.
pub fn solve(
    model: &Model,
    inputs: &Inputs,
    memories: &Memories,
    task: &Task,
    position_limits: &Joints,
) -> Solution {
    Solver::default().solve(model, inputs, memories, task, position_limits)
}

impl Solver {
    /// Buffer for an evaluation of the arm of the last solve; the next solve overwrites it.
    pub(crate) fn scratch(&mut self) -> &mut Evaluation {
        &mut self.evaluation
    }

    /// [`solve`] for the arm of the previous calls, or for the first one.
    pub fn solve(
        &mut self,
        model: &Model,
        inputs: &Inputs,
        memories: &Memories,
        task: &Task,
        position_limits: &Joints,
    ) -> Solution {
        let problem = SolveProblem { model, inputs, memories, task, position_limits };
        let exact = self.begin_at_command(&problem);
        self.within_bounds(&problem, exact)
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
        position_limits: &Joints,
    ) -> Solution {
        let problem = SolveProblem { model, inputs, memories, task, position_limits };
        let guess = self.warm_start.extrapolate(inputs);
        // For effects with a load limit, existence of a solution depends on the load at the
        // commanded pose.
        let is_sure = self.warm_start.is_sure() && !model.has_hardening();
        let warm_solution = guess.filter(|guess| is_sure && is_small(guess, position_limits));
        let warm_solution = warm_solution.and_then(|guess| self.begin_at_guess(&problem, &guess));
        let solution = warm_solution.unwrap_or_else(|| {
            let solution = self.begin_at_command(&problem);
            let Self { summary, linearisation, slope_sums, .. } = self;
            summary.curvature =
                if summary.ended_undamped { linearisation.curvature(slope_sums) } else { None };
            summary.from_command = true;
            solution
        });
        let solution = self.within_bounds(&problem, solution);
        self.warm_start.store(inputs, &solution, guess.as_ref(), &self.summary);
        solution
    }

    /// Resets the warm start: the next solve starts at its command.
    pub fn reset_warm_start(&mut self) {
        self.warm_start = WarmStart::default();
    }

    /// Starts at the command. The effect of deviations on the tool is of first order without their
    /// geometry: enough for a step, not for convergence.
    fn begin_at_command(&mut self, problem: &SolveProblem<'_>) -> Solution {
        let SolveProblem { model, inputs, memories, task, .. } = problem;
        self.summary = SolveSummary::default();
        let Self { evaluation, slope_sums, .. } = self;
        model.deviate_into(inputs, memories, evaluation, Some(slope_sums));
        let rows = TaskRows::new(&evaluation.nominal.base_from_tool, task);
        let (moved, turned) =
            evaluation.deviation.moves(&evaluation.nominal, &evaluation.loads.motions);
        let mut iterate = Iterate::new(inputs, rows);
        iterate.error = iterate.rows.error(task.offset_m - moved, -turned);
        self.iterate(problem, &mut iterate, STEPS_MAX)
    }

    /// Starts at the command with `guess` added; `None` if a start at the command is safer.
    fn begin_at_guess(&mut self, problem: &SolveProblem<'_>, guess: &Joints) -> Option<Solution> {
        let SolveProblem { model, inputs, memories, task, position_limits } = problem;
        let Self { evaluation, slope_sums, linearisation, warm_start, summary } = self;
        *summary = SolveSummary::default();
        let rows = TaskRows::new(&Chain::tool_at(&model.arm, &inputs.q), task);
        let mut iterate = Iterate::new(inputs, rows);
        apply(&mut iterate.trial.q, guess);
        model.deviate_into(&iterate.trial, memories, evaluation, Some(slope_sums));
        evaluation.set_real(&model.arm, &iterate.trial);
        iterate.update_error(evaluation);
        let arm = &model.arm;
        linearisation.linearise(&LinearisationPoint {
            arm,
            evaluation,
            is_real: true,
            slope_sums,
            rows: &iterate.rows,
        });
        if !linearisation.solve_undamped(&iterate.error) {
            return None;
        }
        let NewtonStep { delta, largest, remaining, .. } = linearisation.step;
        let curvature = linearisation.curvature(slope_sums)?;
        let mut correction = *guess;
        apply(&mut correction, &delta);
        if !(is_small(&correction, position_limits) && is_unique(&correction, curvature)) {
            return None;
        }
        summary.curvature = Some(curvature);
        // A robot at rest gets the same bits again.
        if largest < STEP_DONE && warm_start.is_same_command(&inputs.q) {
            return Some(iterate.solution(true, &iterate.error, task));
        }
        apply(&mut iterate.trial.q, &delta);
        iterate.steps = 1;
        if warm_start.next_step_bound(&delta, curvature) < STEP_DONE {
            return Some(iterate.solution(true, &remaining, task));
        }
        iterate.last = Some(largest);
        self.evaluate_trial(problem, &mut iterate);
        let solution = self.iterate(problem, &mut iterate, WARM_STEPS_MAX);
        solution.converged.then_some(solution)
    }

    /// Newton steps until convergence.
    fn iterate(
        &mut self,
        problem: &SolveProblem<'_>,
        iterate: &mut Iterate,
        steps_max: u32,
    ) -> Solution {
        let SolveProblem { model, inputs, task, position_limits, .. } = problem;
        loop {
            if !iterate.is_real && iterate.error.is_zero() {
                self.evaluation.set_real(&model.arm, &iterate.trial);
                iterate.update_error(&self.evaluation);
            }
            let Self { evaluation, slope_sums, linearisation, .. } = self;
            // Beyond the limit of its law the prediction of a hardening joint is not valid, nor is
            // a step from it.
            if evaluation.out_of_range.is_some() || iterate.error.is_zero() {
                return iterate.solution(evaluation.out_of_range.is_none(), &iterate.error, task);
            }
            let count = model.arm.count();
            let allowed = |step: &Joints| {
                stays_within(count, &iterate.trial.q, step, &inputs.q, position_limits)
            };
            let Iterate { is_real, rows, .. } = &*iterate;
            let point = LinearisationPoint {
                arm: &model.arm,
                evaluation,
                is_real: *is_real,
                slope_sums,
                rows,
            };
            let by_last =
                iterate.last.is_some_and(|last| linearisation.refine(&point, last, &iterate.error))
                    && allowed(&linearisation.step.delta);
            let found = by_last || {
                linearisation.linearise(&point);
                linearisation.solve_within(&iterate.error, allowed)
            };
            if !found || iterate.steps >= steps_max {
                return iterate.solution(false, &iterate.error, task);
            }
            let next = &linearisation.step;
            apply(&mut iterate.trial.q, &next.delta);
            iterate.steps += 1;
            if iterate.is_real && next.next_size < STEP_DONE {
                self.summary.ended_undamped = true;
                self.summary.nonlinearity =
                    iterate.last.map_or(0.0, |last| next.largest / (last * last));
                return iterate.solution(true, &next.remaining, task);
            }
            iterate.last = Some(next.largest);
            self.evaluate_trial(problem, iterate);
        }
    }

    /// Evaluates the model at the trial, one step after the last linearisation.
    fn evaluate_trial(&mut self, problem: &SolveProblem<'_>, iterate: &mut Iterate) {
        let Self { evaluation, slope_sums, linearisation, .. } = self;
        problem.model.deviate_on(
            &iterate.trial,
            problem.memories,
            evaluation,
            &linearisation.step.delta,
            slope_sums,
        );
        evaluation.set_real(&problem.model.arm, &iterate.trial);
        iterate.update_error(evaluation);
    }
}

/// Inputs of a solve.
pub(crate) struct SolveProblem<'a> {
    pub(crate) model: &'a Model,
    pub(crate) inputs: &'a Inputs,
    pub(crate) memories: &'a Memories,
    pub(crate) task: &'a Task,
    pub(crate) position_limits: &'a Joints,
}

/// State of a solve.
struct Iterate {
    trial: Inputs,
    rows: TaskRows,
    /// Error at the trial.
    error: TaskError,
    /// Whether the error is that of the real geometry.
    is_real: bool,
    /// The size of the last step.
    last: Option<f64>,
    steps: u32,
}

impl Iterate {
    /// At its start, before an evaluation.
    #[inline(always)]
    fn new(inputs: &Inputs, rows: TaskRows) -> Self {
        let error = TaskError::default();
        Self { trial: *inputs, rows, error, is_real: false, last: None, steps: 0 }
    }

    fn update_error(&mut self, evaluation: &Evaluation) {
        (self.error, self.is_real) = (self.rows.pose_error(&evaluation.real.base_from_tool), true);
    }

    fn solution(&self, converged: bool, remaining: &TaskError, task: &Task) -> Solution {
        let (q, residual) = (self.trial.q, remaining.residual(task));
        Solution { q, converged, limited: None, residual, steps: self.steps }
    }
}
