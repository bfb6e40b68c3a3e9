//! The best correction within bounds, where no exact one is: beyond the correction limits, beyond a joint limit, at a singular pose.
//!
//! Minimises `‖error(x)‖² + (x − r)ᵀ D (x − r)` over corrections `x` within the position limit and the joint limits, by Gauss-Newton steps, each the minimum of its
//! bounded quadratic problem. A radian is weighted with [`ORIENTATION_SHARE`] of the task's length, so that position takes precedence, if the joints can satisfy the whole task.
//!
//! `D` damps the directions in which the joints hardly move the tool; otherwise the correction would jump between its limits as the arm passes a singular pose. It grows with the
//! excess of an exact solution over the limits. The reference `r` is that exact solution while it is within the limits, so that exact and bounded corrections are continuous even in weakly
//! observable directions, and decreases with the inverse of its size beyond. They are not continuous where an exact solution reaches its limit for less than a
//! nanometre of tool error: rounding hides such directions.
//!
//! Invariants: the correction is within the bounds, and the tool error is never larger than without correction. An exact solution is not affected.

use crate::bounded_minimum::{Bounds, JointMatrix, free_step, minimize};
use crate::damping::damping;
use crate::joints::difference;
use crate::linearisation::{Linearisation, LinearisationPoint, TaskJacobian};
use crate::normal_equations::ROWS;
use crate::outcome::Reason;
use crate::solve::{Solution, SolveProblem, Solver};
use crate::task_rows::{TaskError, TaskRows};
use libm::sqrt;
use physics::{Chain, Inputs, JOINTS_MAX, Joints};

/// Weight of a radian relative to the task's length.
const ORIENTATION_SHARE: f64 = 0.5;
/// An exact solution up to this multiple of the position limit is not damped.
const DAMPED_FROM: f64 = 1.25;
/// From this multiple on it is fully damped.
const FULLY_DAMPED_FROM: f64 = 5.0;
/// A tool motion below this, for a joint motion over the whole position limit, counts as zero, m:
/// about a thousand times the rounding of its square.
const TOOL_MOTION_FLOOR_M: f64 = 3e-10;
/// A tool motion per unit joint motion below this counts as zero, m/rad, for the same reason.
const TOOL_MOTION_FLOOR_PER_UNIT: f64 = 1e-7;
/// The correction passes from bound to bound while the tool's least motion per unit of the joints
/// goes from minus to plus this, m/rad.
const SINGULAR_BAND: f64 = 0.03;
/// Damping of all directions, relative to the mean of the diagonal: makes the minimum unique for
/// redundant arms.
const REGULARISATION: f64 = 1e-9;
/// Fully damped steps, before the amount of damping is known.
const FULLY_DAMPED_STEPS: u32 = 4;
/// Limit on Gauss-Newton steps.
const STEPS_MAX: u32 = 20;
/// Converged if a step changes no joint by more than this, rad or m.
const STEP_DONE: f64 = 1e-11;
/// The task is reached if less than this remains, m.
const TASK_TOLERANCE_M: f64 = 1e-9;

/// The quadratic problem at one trial, apart from the linearisation.
struct BoundedProblem {
    damping: JointMatrix,
    /// The correction towards which damping pulls, rad or m.
    reference: Joints,
    share: f64,
    bounds: Bounds,
}

impl Solver {
    /// `exact`, if it converged within the joint limits; otherwise the best solution within bounds,
    /// starting at the command.
    #[inline(always)]
    pub(crate) fn within_bounds(
        &mut self,
        problem_inputs: &SolveProblem<'_>,
        exact: Solution,
    ) -> Solution {
        if exact.converged && problem_inputs.model.arm.within_limits(&exact.q) {
            return exact;
        }
        self.bounded_solution(problem_inputs, exact)
    }

    #[inline(never)]
    #[cold]
    fn bounded_solution(&mut self, problem_inputs: &SolveProblem<'_>, exact: Solution) -> Solution {
        let SolveProblem { model, inputs, task, .. } = problem_inputs;
        let refused = Solution { converged: false, ..exact };
        let (arm, count) = (&model.arm, model.arm.count());
        let rows = TaskRows::new(&Chain::tool_at(arm, &inputs.q), task);
        let mut x = [0.0; JOINTS_MAX];
        let mut at_bound = [false; JOINTS_MAX];
        let Some(uncorrected) = self.linearise_at(problem_inputs, &rows, &x) else {
            return refused;
        };
        let mut problem = self.problem(problem_inputs, &uncorrected);
        let mut error = uncorrected;
        let mut steps = 0;
        while steps < STEPS_MAX {
            let (a, g) = problem.normal_equations(&self.linearisation, count, &error, &x);
            let Some(next) = minimize(count, &a, &g, &problem.bounds, &x) else { return refused };
            let change = difference(&next.x, &x).iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            (x, at_bound) = (next.x, next.at_bound);
            steps += 1;
            match self.linearise_at(problem_inputs, &rows, &x) {
                Some(left) => error = left,
                None => return refused,
            }
            if steps == FULLY_DAMPED_STEPS {
                self.set_damping(problem_inputs, &mut problem, &error, &x);
            } else if steps > FULLY_DAMPED_STEPS && change < STEP_DONE {
                break;
            }
        }
        let left = problem.weighted_norm(&error);
        // Also discards NaN.
        if left.is_nan() || left > problem.weighted_norm(&uncorrected) {
            return refused;
        }
        let mut q = inputs.q;
        (0..count).for_each(|i| q[i] += x[i]);
        let is_served = left < TASK_TOLERANCE_M;
        let limited = (!is_served).then(|| problem.limiting_reason(problem_inputs, &x, &at_bound));
        Solution { q, converged: is_served, limited, residual: error.residual(task), steps }
    }

    /// The task error with a correction, and the linearisation there; `None` if an effect is
    /// outside the range of its law, or a value is not finite.
    fn linearise_at(
        &mut self,
        problem_inputs: &SolveProblem<'_>,
        rows: &TaskRows,
        x: &Joints,
    ) -> Option<TaskError> {
        let mut trial: Inputs = *problem_inputs.inputs;
        crate::joints::apply(&mut trial.q, x);
        let Self { evaluation, slope_sums, linearisation, .. } = self;
        let arm = &problem_inputs.model.arm;
        problem_inputs.model.deviate_into(
            &trial,
            problem_inputs.memories,
            evaluation,
            Some(slope_sums),
        );
        evaluation.set_real(arm, &trial);
        if evaluation.out_of_range.is_some() {
            return None;
        }
        let error = rows.pose_error(&evaluation.real.base_from_tool);
        linearisation.linearise(&LinearisationPoint {
            arm,
            evaluation,
            is_real: true,
            slope_sums,
            rows,
        });
        error.0.iter().all(|x| x.is_finite()).then_some(error)
    }

    /// Bounds and damping, at the command.
    fn problem(&mut self, problem_inputs: &SolveProblem<'_>, error: &TaskError) -> BoundedProblem {
        let SolveProblem { model, inputs, position_limits, .. } = problem_inputs;
        let mut bounds = Bounds { low: [0.0; JOINTS_MAX], high: [0.0; JOINTS_MAX] };
        for (i, joint) in model.arm.joints().iter().enumerate() {
            let (low, high) = joint.limits;
            bounds.low[i] = (low - inputs.q[i]).max(-position_limits[i]).min(0.0);
            bounds.high[i] = (high - inputs.q[i]).min(position_limits[i]).max(0.0);
        }
        let share = if self.linearisation.can_reach_all_rows() { ORIENTATION_SHARE } else { 1.0 };
        let (damping, reference) = ([[0.0; JOINTS_MAX]; JOINTS_MAX], [0.0; JOINTS_MAX]);
        let mut problem = BoundedProblem { damping, reference, share, bounds };
        self.apply_damping(problem_inputs, &mut problem, error, 1.0);
        problem
    }

    /// Sets damping by how far the exact solution would exceed the position limit, and the
    /// reference to that solution, from the linearisation at `x`. At the command itself a wrist may
    /// be singular although the corrections of other joints move it away from the singularity; a
    /// fully damped correction already has.
    fn set_damping(
        &mut self,
        problem_inputs: &SolveProblem<'_>,
        problem: &mut BoundedProblem,
        error: &TaskError,
        x: &Joints,
    ) {
        let rates = &self.linearisation.jacobian;
        let done = |row: usize| rates[row].iter().zip(x).map(|(rate, x)| rate * x).sum::<f64>();
        let whole = TaskError(core::array::from_fn(|row| error.0[row] + done(row)));
        let ExactCorrection { correction, size_ratio } = self.exact_correction(
            problem_inputs.model.arm.count(),
            &whole,
            problem_inputs.position_limits,
        );
        let fits = (DAMPED_FROM / size_ratio).min(1.0);
        problem.reference = correction.map(|x| x * fits * fits);
        let part = ((size_ratio - DAMPED_FROM) / (FULLY_DAMPED_FROM - DAMPED_FROM)).clamp(0.0, 1.0);
        self.apply_damping(problem_inputs, problem, &whole, part);
    }

    /// Applies the share `part` of the damping that an error requires.
    fn apply_damping(
        &self,
        problem_inputs: &SolveProblem<'_>,
        problem: &mut BoundedProblem,
        error: &TaskError,
        part: f64,
    ) {
        let (position_limits, count) =
            (problem_inputs.position_limits, problem_inputs.model.arm.count());
        problem.damping = [[0.0; JOINTS_MAX]; JOINTS_MAX];
        let smallest = position_limits[..count]
            .iter()
            .fold(f64::INFINITY, |smallest, position_limits| smallest.min(*position_limits));
        let most = part * problem.weighted_norm(error) * SINGULAR_BAND / smallest;
        let (normal, _) =
            problem.normal_equations(&self.linearisation, count, error, &[0.0; JOINTS_MAX]);
        if most > 0.0 && most.is_finite() {
            problem.damping = damping(count, &normal, most);
        }
        let mean = (0..count).map(|i| normal[i][i]).sum::<f64>() / count as f64;
        (0..count).for_each(|i| problem.damping[i][i] += REGULARISATION * mean);
    }
}

impl Solver {
    /// The exact correction by the present linearisation.
    fn exact_correction(
        &mut self,
        count: usize,
        error: &TaskError,
        position_limits: &Joints,
    ) -> ExactCorrection {
        let linearisation = &mut self.linearisation;
        if !linearisation.can_reach_all_rows() {
            let found = linearisation.solve_undamped(error);
            let correction = linearisation.step.delta;
            let size_ratio =
                (0..count).map(|i| correction[i].abs() / position_limits[i]).fold(0.0, f64::max);
            return if found && size_ratio.is_finite() {
                ExactCorrection { correction, size_ratio }
            } else {
                ExactCorrection::NONE
            };
        }
        let weights = solve_in_task_space(
            &linearisation.jacobian,
            error,
            &[1.0; JOINTS_MAX],
            TOOL_MOTION_FLOOR_PER_UNIT,
        );
        let scaled = solve_in_task_space(
            &linearisation.jacobian,
            error,
            position_limits,
            TOOL_MOTION_FLOOR_M,
        );
        let (Some(weights), Some(scaled)) = (weights, scaled) else { return ExactCorrection::NONE };
        let mut correction = [0.0; JOINTS_MAX];
        for (row, weight) in linearisation.jacobian.iter().zip(weights) {
            correction.iter_mut().zip(row).for_each(|(x, rate)| *x += weight * rate);
        }
        // The root mean square over the joints.
        let square: f64 = error.0.iter().zip(scaled).map(|(e, z)| e * z).sum();
        ExactCorrection { correction, size_ratio: sqrt(square.max(0.0) / count as f64) }
    }
}

/// An exact correction, as far as the linearisation holds.
struct ExactCorrection {
    /// rad or m
    correction: Joints,
    /// Its size as a multiple of the position limit: at most one if it fits.
    size_ratio: f64,
}

impl ExactCorrection {
    const NONE: Self = Self { correction: [0.0; JOINTS_MAX], size_ratio: f64::INFINITY };
}

/// `(J U² Jᵀ + least²)⁻¹ error`, `U` being the joints' units. Solved in task space: in directions
/// in which the tool does not move at all, an inverse of `JᵀJ` holds only rounding.
fn solve_in_task_space(
    rates: &TaskJacobian,
    error: &TaskError,
    units: &Joints,
    damping: f64,
) -> Option<Joints> {
    let (mut a, mut e) = ([[0.0; JOINTS_MAX]; JOINTS_MAX], [0.0; JOINTS_MAX]);
    e[..ROWS].copy_from_slice(&error.0);
    for i in 0..ROWS {
        for k in 0..ROWS {
            a[i][k] =
                units.iter().enumerate().map(|(j, u)| rates[i][j] * rates[k][j] * u * u).sum();
        }
        a[i][i] += damping * damping;
    }
    free_step(ROWS, &a, &e, &[false; JOINTS_MAX])
}

impl BoundedProblem {
    fn weight(&self, row: usize) -> f64 {
        if row < ROWS / 2 { 1.0 } else { self.share }
    }

    /// Norm of the error, m.
    fn weighted_norm(&self, error: &TaskError) -> f64 {
        let weighted = |(row, x): (usize, &f64)| self.weight(row) * x;
        sqrt(error.0.iter().enumerate().map(weighted).map(|x| x * x).sum())
    }

    /// Matrix and gradient of the quadratic problem at `x`, which leaves `error`.
    fn normal_equations(
        &self,
        linearisation: &Linearisation,
        count: usize,
        error: &TaskError,
        x: &Joints,
    ) -> (JointMatrix, Joints) {
        let mut a = self.damping;
        let mut g: Joints = core::array::from_fn(|i| {
            self.damping[i].iter().zip(&self.reference).map(|(d, x)| d * x).sum()
        });
        for (row, rate) in linearisation.jacobian.iter().enumerate() {
            let square = self.weight(row) * self.weight(row);
            let target = error.0[row] + (0..count).map(|i| rate[i] * x[i]).sum::<f64>();
            for i in 0..count {
                g[i] += square * rate[i] * target;
                for k in 0..count {
                    a[i][k] += square * rate[i] * rate[k];
                }
            }
        }
        (a, g)
    }

    /// The limit that bounds the correction.
    fn limiting_reason(
        &self,
        problem_inputs: &SolveProblem<'_>,
        x: &Joints,
        at_bound: &[bool; JOINTS_MAX],
    ) -> Reason {
        let by_limit = |i: usize| x[i].abs() < problem_inputs.position_limits[i];
        let count = problem_inputs.model.arm.count();
        if (0..count).any(|i| at_bound[i] && by_limit(i)) {
            Reason::JointLimit
        } else if at_bound[..count].contains(&true) {
            Reason::Envelope
        } else {
            Reason::Singular
        }
    }
}
