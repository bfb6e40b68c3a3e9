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

use crate::bounded::{Bounds, Square, free_step, lowest};
use crate::damping::damping;
use crate::joints::off;
use crate::normal::ROWS;
use crate::outcome::Reason;
use crate::rows::{Rows, TaskError};
use crate::slopes::{Here, Rates, Slopes};
use crate::solve::{Case, Solution, Solver};
use libm::sqrt;
use physics::{Chain, Inputs, JOINTS_MAX, Joints};

/// Weight of a radian relative to the task's length.
const ORIENTATION_SHARE: f64 = 0.5;
/// An exact solution up to this multiple of the position limit is not damped.
const DAMPED_FROM: f64 = 1.25;
/// From this multiple on it is fully damped.
const DAMPED_IN_FULL: f64 = 5.0;
/// A tool motion below this, for a joint motion over the whole position limit, counts as zero, m:
/// about a thousand times the rounding of its square.
const HARDLY_M: f64 = 3e-10;
/// A tool motion per unit joint motion below this counts as zero, m/rad, for the same reason.
const HARDLY_PER_UNIT: f64 = 1e-7;
/// The correction passes from bound to bound while the tool's least motion per unit of the joints
/// goes from minus to plus this, m/rad.
const PASSES: f64 = 0.03;
/// Damping of all directions, relative to the mean of the diagonal: makes the minimum unique for
/// redundant arms.
const UNIQUE: f64 = 1e-9;
/// Fully damped steps, before the amount of damping is known.
const FULLY_DAMPED: u32 = 4;
/// Limit on Gauss-Newton steps.
const STEPS_MAX: u32 = 20;
/// Converged if a step changes no joint by more than this, rad or m.
const STEP_DONE: f64 = 1e-11;
/// The task is reached if less than this remains, m.
const SERVED_M: f64 = 1e-9;

/// The quadratic problem at one trial, apart from the linearisation.
struct Problem {
    damping: Square,
    /// The correction towards which damping pulls, rad or m.
    reference: Joints,
    share: f64,
    bounds: Bounds,
}

impl Solver {
    /// `exact`, if it converged within the joint limits; otherwise the best solution within bounds,
    /// starting at the command.
    #[inline(always)]
    pub(crate) fn within_bounds(&mut self, case: &Case<'_>, exact: Solution) -> Solution {
        if exact.converged && case.model.arm.within_limits(&exact.q) {
            return exact;
        }
        self.limited(case, exact)
    }

    #[inline(never)]
    #[cold]
    fn limited(&mut self, case: &Case<'_>, exact: Solution) -> Solution {
        let Case { model, inputs, task, .. } = case;
        let refused = Solution { converged: false, ..exact };
        let (arm, count) = (&model.arm, model.arm.count());
        let rows = Rows::of(&Chain::tool_at(arm, &inputs.q), task);
        let mut x = [0.0; JOINTS_MAX];
        let mut held = [false; JOINTS_MAX];
        let Some(uncorrected) = self.look(case, &rows, &x) else { return refused };
        let mut problem = self.problem(case, &uncorrected);
        let mut error = uncorrected;
        let mut steps = 0;
        while steps < STEPS_MAX {
            let (a, g) = problem.at(&self.slopes, count, &error, &x);
            let Some(next) = lowest(count, &a, &g, &problem.bounds, &x) else { return refused };
            let change = off(&next.x, &x).iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            (x, held) = (next.x, next.held);
            steps += 1;
            match self.look(case, &rows, &x) {
                Some(left) => error = left,
                None => return refused,
            }
            if steps == FULLY_DAMPED {
                self.damp(case, &mut problem, &error, &x);
            } else if steps > FULLY_DAMPED && change < STEP_DONE {
                break;
            }
        }
        let left = problem.length(&error);
        // Also discards NaN.
        if left.is_nan() || left > problem.length(&uncorrected) {
            return refused;
        }
        let mut q = inputs.q;
        (0..count).for_each(|i| q[i] += x[i]);
        let is_served = left < SERVED_M;
        let limited = (!is_served).then(|| problem.reason(case, &x, &held));
        Solution { q, converged: is_served, limited, residual: error.residual(task), steps }
    }

    /// The task error with a correction, and the linearisation there; `None` if an effect is
    /// outside the range of its law, or a value is not finite.
    fn look(&mut self, case: &Case<'_>, rows: &Rows, x: &Joints) -> Option<TaskError> {
        let mut trial: Inputs = *case.inputs;
        crate::joints::apply(&mut trial.q, x);
        let Self { seen, told, slopes, .. } = self;
        let arm = &case.model.arm;
        case.model.deviate_into(&trial, case.memories, seen, Some(told));
        seen.stand(arm, &trial);
        if seen.beyond.is_some() {
            return None;
        }
        let error = rows.between(&seen.real.base_from_tool);
        slopes.see(&Here { arm, seen, is_real: true, told, rows });
        error.0.iter().all(|x| x.is_finite()).then_some(error)
    }

    /// Bounds and damping, at the command.
    fn problem(&mut self, case: &Case<'_>, error: &TaskError) -> Problem {
        let Case { model, inputs, reach, .. } = case;
        let mut bounds = Bounds { low: [0.0; JOINTS_MAX], high: [0.0; JOINTS_MAX] };
        for (i, joint) in model.arm.joints().iter().enumerate() {
            let (low, high) = joint.limits;
            bounds.low[i] = (low - inputs.q[i]).max(-reach[i]).min(0.0);
            bounds.high[i] = (high - inputs.q[i]).min(reach[i]).max(0.0);
        }
        let share = if self.slopes.serve_all() { ORIENTATION_SHARE } else { 1.0 };
        let (damping, reference) = ([[0.0; JOINTS_MAX]; JOINTS_MAX], [0.0; JOINTS_MAX]);
        let mut problem = Problem { damping, reference, share, bounds };
        self.damp_by(case, &mut problem, error, 1.0);
        problem
    }

    /// Sets damping by how far the exact solution would exceed the position limit, and the
    /// reference to that solution, from the linearisation at `x`. At the command itself a wrist may
    /// be singular although the corrections of other joints move it away from the singularity; a
    /// fully damped correction already has.
    fn damp(&mut self, case: &Case<'_>, problem: &mut Problem, error: &TaskError, x: &Joints) {
        let rates = &self.slopes.rates;
        let done = |row: usize| rates[row].iter().zip(x).map(|(rate, x)| rate * x).sum::<f64>();
        let whole = TaskError(core::array::from_fn(|row| error.0[row] + done(row)));
        let Exact { by, times } = self.exact(case.model.arm.count(), &whole, case.reach);
        let fits = (DAMPED_FROM / times).min(1.0);
        problem.reference = by.map(|x| x * fits * fits);
        let part = ((times - DAMPED_FROM) / (DAMPED_IN_FULL - DAMPED_FROM)).clamp(0.0, 1.0);
        self.damp_by(case, problem, &whole, part);
    }

    /// Applies the share `part` of the damping that an error requires.
    fn damp_by(&self, case: &Case<'_>, problem: &mut Problem, error: &TaskError, part: f64) {
        let (reach, count) = (case.reach, case.model.arm.count());
        problem.damping = [[0.0; JOINTS_MAX]; JOINTS_MAX];
        let least = reach[..count].iter().fold(f64::INFINITY, |least, reach| least.min(*reach));
        let most = part * problem.length(error) * PASSES / least;
        let (normal, _) = problem.at(&self.slopes, count, error, &[0.0; JOINTS_MAX]);
        if most > 0.0 && most.is_finite() {
            problem.damping = damping(count, &normal, most);
        }
        let mean = (0..count).map(|i| normal[i][i]).sum::<f64>() / count as f64;
        (0..count).for_each(|i| problem.damping[i][i] += UNIQUE * mean);
    }
}

impl Solver {
    /// The exact correction by the present linearisation.
    fn exact(&mut self, count: usize, error: &TaskError, reach: &Joints) -> Exact {
        let slopes = &mut self.slopes;
        if !slopes.serve_all() {
            let found = slopes.undamped(error);
            let by = slopes.step.by;
            let times = (0..count).map(|i| by[i].abs() / reach[i]).fold(0.0, f64::max);
            return if found && times.is_finite() { Exact { by, times } } else { Exact::NONE };
        }
        let weights = by_rows(&slopes.rates, error, &[1.0; JOINTS_MAX], HARDLY_PER_UNIT);
        let scaled = by_rows(&slopes.rates, error, reach, HARDLY_M);
        let (Some(weights), Some(scaled)) = (weights, scaled) else { return Exact::NONE };
        let mut by = [0.0; JOINTS_MAX];
        for (row, weight) in slopes.rates.iter().zip(weights) {
            by.iter_mut().zip(row).for_each(|(x, rate)| *x += weight * rate);
        }
        // The root mean square over the joints.
        let square: f64 = error.0.iter().zip(scaled).map(|(e, z)| e * z).sum();
        Exact { by, times: sqrt(square.max(0.0) / count as f64) }
    }
}

/// An exact correction, as far as the linearisation holds.
struct Exact {
    /// rad or m
    by: Joints,
    /// Its size as a multiple of the position limit: at most one if it fits.
    times: f64,
}

impl Exact {
    const NONE: Self = Self { by: [0.0; JOINTS_MAX], times: f64::INFINITY };
}

/// `(J U² Jᵀ + least²)⁻¹ error`, `U` being the joints' units. Solved in task space: in directions
/// in which the tool does not move at all, an inverse of `JᵀJ` holds only rounding.
fn by_rows(rates: &Rates, error: &TaskError, units: &Joints, least: f64) -> Option<Joints> {
    let (mut a, mut e) = ([[0.0; JOINTS_MAX]; JOINTS_MAX], [0.0; JOINTS_MAX]);
    e[..ROWS].copy_from_slice(&error.0);
    for i in 0..ROWS {
        for k in 0..ROWS {
            a[i][k] =
                units.iter().enumerate().map(|(j, u)| rates[i][j] * rates[k][j] * u * u).sum();
        }
        a[i][i] += least * least;
    }
    free_step(ROWS, &a, &e, &[false; JOINTS_MAX])
}

impl Problem {
    fn weight(&self, row: usize) -> f64 {
        if row < ROWS / 2 { 1.0 } else { self.share }
    }

    /// Norm of the error, m.
    fn length(&self, error: &TaskError) -> f64 {
        let weighted = |(row, x): (usize, &f64)| self.weight(row) * x;
        sqrt(error.0.iter().enumerate().map(weighted).map(|x| x * x).sum())
    }

    /// Matrix and gradient of the quadratic problem at `x`, which leaves `error`.
    fn at(&self, slopes: &Slopes, count: usize, error: &TaskError, x: &Joints) -> (Square, Joints) {
        let mut a = self.damping;
        let mut g: Joints = core::array::from_fn(|i| {
            self.damping[i].iter().zip(&self.reference).map(|(d, x)| d * x).sum()
        });
        for (row, rate) in slopes.rates.iter().enumerate() {
            let square = self.weight(row) * self.weight(row);
            let wanted = error.0[row] + (0..count).map(|i| rate[i] * x[i]).sum::<f64>();
            for i in 0..count {
                g[i] += square * rate[i] * wanted;
                for k in 0..count {
                    a[i][k] += square * rate[i] * rate[k];
                }
            }
        }
        (a, g)
    }

    /// What limits the correction.
    fn reason(&self, case: &Case<'_>, x: &Joints, held: &[bool; JOINTS_MAX]) -> Reason {
        let by_limit = |i: usize| x[i].abs() < case.reach[i];
        let count = case.model.arm.count();
        if (0..count).any(|i| held[i] && by_limit(i)) {
            Reason::JointLimit
        } else if held[..count].contains(&true) {
            Reason::Envelope
        } else {
            Reason::Singular
        }
    }
}
