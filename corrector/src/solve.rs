//! The joint positions that put the tool where the controller's geometry would have put it.
//!
//! Solves `FK_real(q + δθ(q, W, T)) = FK_nominal(q_cmd)` from `q_cmd` by at most [`STEPS_MAX`] Newton steps, rows in the wanted tool's
//! axes, weighted by the task. As many freedoms asked as joints there are, or fewer: least change of the joints; more: least squares.
//!
//! Promises: converged means that nothing is left over, or that the UNDAMPED next step is below [`STEP_DONE`]: a singular pose, where
//! damping hides what is left, is refused with the residual. A trial never leaves `reach` (the envelope's angle) about the command.
//! Never: a jump to another branch of solutions, memory (what effects remember stays as it is during the solve).

use crate::outcome::Residual;
use crate::settings::Task;
use glam::DVec3;
use nalgebra::{Cholesky, Const, Matrix6, Vector6};
use physics::chain::Jacobian;
use physics::frame::vector_from_rotation;
use physics::{Chain, Frame, Inputs, JOINTS_MAX, Joints, Memories, Model};

/// The most Newton steps.
const STEPS_MAX: u32 = 10;
/// The solution stands once the next step is below this, rad or m.
const STEP_DONE: f64 = 1e-11;
/// It stands too once the weighted error is below this, m: rounding of the geometry.
const ERROR_DONE_M: f64 = 1e-14;
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

/// Solves for the command in `inputs.q`; `reach` is how far each joint may go from it, rad or m.
pub fn solve(
    model: &Model,
    inputs: &Inputs,
    memories: &Memories,
    task: &Task,
    reach: &Joints,
) -> Solution {
    let wanted = Chain::nominal(&model.arm, &inputs.q).base_from_tool;
    let mut trial = *inputs;
    let mut steps = 0;
    loop {
        let now = model.evaluate(&trial, memories);
        let rows = Rows::new(model, &now.real, &wanted, task);
        // Beyond its law's limit a hardening joint's prediction is worth nothing: nothing may be built on it.
        let undamped = rows.step(0.0).filter(|step| now.beyond.is_none() && is_finite(step));
        let here = Solution { q: trial.q, converged: false, residual: rows.residual, steps };
        if rows.is_done() && now.beyond.is_none() {
            return Solution { converged: true, ..here };
        }
        if let Some(step) = undamped.filter(|step| largest(step) < STEP_DONE) {
            apply(&mut trial.q, &step);
            return Solution { q: trial.q, converged: true, ..here };
        }
        let inside = undamped.filter(|step| stays_within(&trial.q, step, &inputs.q, reach));
        let damped = || damped(&rows, &trial.q, &inputs.q, reach).filter(|_| now.beyond.is_none());
        match inside.or_else(damped) {
            Some(step) if steps < STEPS_MAX => apply(&mut trial.q, &step),
            _ => return here,
        }
        steps += 1;
    }
}

/// The least damped step that stays within reach.
fn damped(rows: &Rows, q: &Joints, centre: &Joints, reach: &Joints) -> Option<Joints> {
    let mut damping = FIRST_DAMPING;
    for _ in 0..DAMPED_TRIES {
        let step = rows.step(damping)?;
        if is_finite(&step) && stays_within(q, &step, centre, reach) {
            return Some(step);
        }
        damping *= 30.0;
    }
    None
}

/// The linearised task at one trial, rows in the wanted tool's axes, weighted.
struct Rows {
    jacobian: Jacobian,
    error: Vector6<f64>,
    asked: [bool; 6],
    joints: usize,
    residual: Residual,
}

impl Rows {
    fn new(model: &Model, real: &Chain, wanted: &Frame, task: &Task) -> Self {
        let here = &real.base_from_tool;
        let tool_from_base = wanted.rotation.transpose();
        let linear = tool_from_base * (wanted.origin - here.origin);
        let turn = vector_from_rotation(&(wanted.rotation * here.rotation.transpose()));
        let angular = tool_from_base * turn;
        let mut jacobian = real.jacobian(&model.arm);
        for mut column in jacobian.column_iter_mut() {
            let v = tool_from_base * DVec3::new(column[0], column[1], column[2]);
            let w = tool_from_base * DVec3::new(column[3], column[4], column[5]) * task.length_m;
            column.copy_from_slice(&[v.x, v.y, v.z, w.x, w.y, w.z]);
        }
        let w = angular * task.length_m;
        let mut error = Vector6::new(linear.x, linear.y, linear.z, w.x, w.y, w.z);
        let mut asked = [true; 6];
        if task.free_tool_axis {
            asked[5] = false;
            error[5] = 0.0;
            jacobian.row_mut(5).fill(0.0);
        }
        let spin = if task.free_tool_axis { angular.truncate().length() } else { angular.length() };
        let residual = Residual { m: linear.length(), rad: spin };
        Self { jacobian, error, asked, joints: model.arm.count(), residual }
    }

    /// Whether nothing of the task is left over: then even a singular pose has its solution.
    fn is_done(&self) -> bool {
        self.error.norm() < ERROR_DONE_M
    }

    /// The step that the linearised task asks for; `damping` relative to the mean of the normal matrix' diagonal.
    fn step(&self, damping: f64) -> Option<Joints> {
        let asked = self.asked.iter().filter(|asked| **asked).count();
        if asked <= self.joints { self.least_change(damping) } else { self.least_squares(damping) }
    }

    /// `Jᵀ (J Jᵀ + λ)⁻¹ e`.
    fn least_change(&self, damping: f64) -> Option<Joints> {
        let mut normal: Matrix6<f64> = self.jacobian * self.jacobian.transpose();
        let unasked = |i: usize| !self.asked[i];
        let cholesky = factored(&mut normal, damping, unasked)?;
        let step = self.jacobian.transpose() * cholesky.solve(&self.error);
        Some(step.into())
    }

    /// `(JᵀJ + λ)⁻¹ Jᵀ e`, for fewer than six joints.
    fn least_squares(&self, damping: f64) -> Option<Joints> {
        let columns = self.jacobian.fixed_columns::<6>(0);
        let mut normal: Matrix6<f64> = columns.transpose() * columns;
        let cholesky = factored(&mut normal, damping, |i| i >= self.joints)?;
        let found = cholesky.solve(&(columns.transpose() * self.error));
        let mut step = [0.0; JOINTS_MAX];
        step[..6].copy_from_slice(found.as_slice());
        Some(step)
    }
}

/// Factors the normal matrix with damping; rows that take no part become those of the unit matrix.
fn factored(
    normal: &mut Matrix6<f64>,
    damping: f64,
    takes_no_part: impl Fn(usize) -> bool,
) -> Option<Cholesky<f64, Const<6>>> {
    let added = damping * normal.trace() / 6.0;
    for i in 0..6 {
        normal[(i, i)] = if takes_no_part(i) { 1.0 } else { normal[(i, i)] + added };
    }
    Cholesky::new(*normal)
}

fn apply(q: &mut Joints, step: &Joints) {
    for (q, step) in q.iter_mut().zip(step) {
        *q += step;
    }
}

fn stays_within(q: &Joints, step: &Joints, centre: &Joints, reach: &Joints) -> bool {
    let after = q.iter().zip(step).map(|(q, step)| q + step);
    after.zip(centre).zip(reach).all(|((after, centre), reach)| (after - centre).abs() <= *reach)
}

fn largest(step: &Joints) -> f64 {
    step.iter().fold(0.0, |most, x| most.max(x.abs()))
}

fn is_finite(step: &Joints) -> bool {
    step.iter().all(|x| x.is_finite())
}
