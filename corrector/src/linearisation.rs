//! The task linearised at one trial, and Newton steps from it.
//!
//! Each step uses the Jacobian of the geometry at the present pose, and those of the effects that provide one. The normal equations are inverted once; while each
//! step is much smaller than the previous one, the inverse is corrected by the observed effect of the step, along that step only (rank-one update).
//!
//! Invariant: an undamped step predicts the size of the next one, a damped one does not. The model
//! is not evaluated here.

use crate::joints::{apply, max_abs_in};
use crate::normal_equations::{Matrix, ROWS, invert};
use crate::task_rows::{TaskError, TaskRows};
use core::array;
use glam::DVec3;
use libm::sqrt;
use physics::lanes::{Kernel, Lanes, Vec3Lanes, WIDTH, run_widest};
use physics::{Arm, Evaluation, JOINTS_MAX, Joints, LoadSlopes, Motions, SlopeSums};

/// A step that is larger than this share of the previous one requires a new inverse.
const REFINE_RATIO_MAX: f64 = 0.1;
/// Factor of safety on the predicted step if all slopes are known: steps then shrink quadratically,
/// as the last two show.
pub(crate) const SAFETY_FACTOR: f64 = 10.0;
/// Damping of the first damped attempt, relative to the mean of the diagonal; each further attempt
/// has 30 times as much.
const FIRST_DAMPING: f64 = 1e-8;
const DAMPED_ATTEMPTS: u32 = 6;

/// The arm at the present trial of a solve.
pub(crate) struct LinearisationPoint<'a> {
    pub(crate) arm: &'a Arm,
    pub(crate) evaluation: &'a Evaluation,
    /// Whether the real geometry is used, otherwise the nominal one.
    pub(crate) is_real: bool,
    pub(crate) slope_sums: &'a SlopeSums,
    pub(crate) rows: &'a TaskRows,
}

/// A step of the joints, rad or m.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(crate) struct NewtonStep {
    pub(crate) delta: Joints,
    /// Its largest component; infinite for a damped step, which predicts nothing.
    pub(crate) largest: f64,
    /// Predicted size of the next step.
    pub(crate) next_size: f64,
    /// Task error that remains by the linearisation.
    pub(crate) remaining: TaskError,
}

/// Derivative of each task row by each joint, or of each joint by each row.
pub(crate) type TaskJacobian = Matrix;

/// Groups of four lanes that hold all joints of any arm.
const PARTS_MAX: usize = JOINTS_MAX / WIDTH;

/// The linearised task at one trial.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(crate) struct Linearisation {
    following: LoadSlopes,
    /// Motion of the tool by each joint alone, derivative of each joint's deviation by its own
    /// position, and the resulting rows with all other known slopes: as of the last linearisation.
    motions: Motions,
    position: Joints,
    pub(crate) jacobian: TaskJacobian,
    /// Square of the norm of the derivative of the deviations by the joints.
    deviation_norm_squared: f64,
    /// The step for a unit error of each row: the pseudo-inverse of the rates.
    pseudoinverse: TaskJacobian,
    /// The last step; kept in place, because a copy would wait for what was just written.
    pub(crate) step: NewtonStep,
    /// How far the joints moved since, rad or m.
    moved: f64,
    joints: usize,
    frees_tool_axis: bool,
}

impl Linearisation {
    /// Linearises at `point`, with all slopes that effects provide.
    pub(crate) fn linearise(&mut self, point: &LinearisationPoint<'_>) {
        run_widest(point.arm.count(), LineariseWork { slopes: self, point });
    }

    #[inline(always)]
    fn linearise_in<S: Lanes>(&mut self, lanes: S, point: &LinearisationPoint<'_>) {
        let LinearisationPoint { arm, evaluation, is_real, slope_sums, rows } = point;
        let count = arm.count().min(JOINTS_MAX);
        (self.joints, self.frees_tool_axis, self.moved) = (count, rows.free_tool_axis, 0.0);
        let Self { motions, position, following, jacobian, .. } = self;
        let chain = if *is_real { &evaluation.real } else { &evaluation.nominal };
        if *is_real {
            motions.take(lanes, arm, chain);
        } else {
            motions.copy(lanes, &evaluation.loads.motions);
        }
        *position = slope_sums.position;
        let Motions { linear, angular } = motions;
        slope_sums.load_slopes(lanes, &evaluation.loads, following);
        // A joint moves the tool by itself, and through its influence on the deviations of all
        // joints and on the rotation of the base.
        let nothing = Vec3Lanes::same(lanes, DVec3::ZERO);
        let (mut moved, mut turned) = ([nothing; PARTS_MAX], [nothing; PARTS_MAX]);
        let mut squares = lanes.splat(0.0);
        for k in 0..S::PARTS {
            (moved[k], turned[k]) = (linear.part(lanes, k), angular.part(lanes, k));
        }
        for i in 0..count {
            let (along, about) =
                (Vec3Lanes::same(lanes, linear.at(i)), Vec3Lanes::same(lanes, angular.at(i)));
            for k in 0..S::PARTS {
                let follows = slope_sums.row(lanes, (following, &evaluation.loads), (i, k));
                moved[k] = moved[k].plus_times(along, follows);
                turned[k] = turned[k].plus_times(about, follows);
                squares = lanes.mul_add(follows, follows, squares);
            }
        }
        self.deviation_norm_squared = lanes.sum(squares);
        let tcp = Vec3Lanes::same(lanes, chain.base_from_tool.origin);
        for k in 0..S::PARTS {
            let (mut moved, mut turned) = (moved[k], turned[k]);
            if following.turns_base {
                let (x, y) = (lanes.part(&following.base_x, k), lanes.part(&following.base_y, k));
                (turned.x, turned.y) = (lanes.add(turned.x, x), lanes.add(turned.y, y));
                moved = Vec3Lanes::of(lanes, [x, y, lanes.splat(0.0)]).cross_plus(tcp, moved);
            }
            rows.put_motions(lanes, (moved, turned), jacobian, k);
        }
    }

    /// The step by a new linearisation, with as little damping as `allowed` requires; false if
    /// there is none.
    pub(crate) fn solve_within(
        &mut self,
        error: &TaskError,
        allowed: impl Fn(&Joints) -> bool,
    ) -> bool {
        if self.solve_undamped(error) && allowed(&self.step.delta) {
            return true;
        }
        let mut damping = FIRST_DAMPING;
        for _ in 0..DAMPED_ATTEMPTS {
            if !self.solve(error, damping) {
                return false;
            }
            if allowed(&self.step.delta) {
                (self.step.largest, self.step.next_size) = (f64::INFINITY, f64::INFINITY);
                return true;
            }
            damping *= 30.0;
        }
        false
    }

    /// The undamped step by a new linearisation; false if there is none.
    pub(crate) fn solve_undamped(&mut self, error: &TaskError) -> bool {
        self.solve(error, 0.0)
    }

    fn solve(&mut self, error: &TaskError, damping: f64) -> bool {
        run_widest(self.joints, SolveWork { slopes: self, error, damping }).is_some()
    }

    /// The next step by the inverse of the last linearisation, `last` being the size of the step
    /// since, corrected by the geometry of the present trial; returns whether it is much smaller
    /// than that. Always false if `last` was damped.
    pub(crate) fn refine(
        &mut self,
        point: &LinearisationPoint<'_>,
        last: f64,
        error: &TaskError,
    ) -> bool {
        if last == f64::INFINITY {
            return false;
        }
        self.moved += last;
        let correction = run_widest(self.joints, RefineWork { slopes: self, point, error });
        let shrinks = self.step.largest / last;
        // The error of unknown slopes shrinks by the same share again, that of known ones
        // quadratically. The slopes say nothing about the part of the task that remains.
        let is_whole =
            point.slope_sums.is_complete && self.can_reach_all_rows() && !self.frees_tool_axis;
        // The derivative of the deviations by the loads is not renewed: it changed in proportion to
        // the distance moved, by the order of the deviations or of the correction.
        let stale = self.moved * (self.moved + sqrt(self.deviation_norm_squared));
        let next = if is_whole { SAFETY_FACTOR * shrinks * shrinks + stale } else { shrinks };
        self.step.next_size = next * self.step.largest + correction;
        shrinks < REFINE_RATIO_MAX
    }

    /// Bound on how fast the slopes change with the joints, per unit of the joints: after a Newton
    /// step, the next is at most half of this times the square of the sum of its sizes, as far as
    /// the geometry is concerned. A joint's motion of the tool turns with the joints before it by
    /// no more than its length, and an error of the task requires no more than the norm of the
    /// inverse. `None` unless all slopes are known and the arm has as many joints as the task rows.
    pub(crate) fn curvature(&self, slope_sums: &SlopeSums) -> Option<f64> {
        let is_square = self.joints == ROWS && !self.frees_tool_axis;
        if !(is_square && slope_sums.is_complete) {
            return None;
        }
        let (inverse, longest) = run_widest(self.joints, NormsWork(self));
        Some(sqrt(inverse * longest))
    }

    /// Number of task rows.
    fn task_rows(&self) -> usize {
        if self.frees_tool_axis { ROWS - 1 } else { ROWS }
    }

    /// Whether the joints can reach all rows.
    pub(crate) fn can_reach_all_rows(&self) -> bool {
        self.task_rows() <= self.joints
    }

    /// Whether `JᵀJ` is inverted, for at most as many joints as rows; otherwise `J Jᵀ`.
    fn inverts_in_joint_space(&self) -> bool {
        self.joints <= self.task_rows()
    }

    /// `(JᵀJ)⁻¹ Jᵀ`, for more joints than rows `Jᵀ (J Jᵀ)⁻¹`, of the last linearisation, with
    /// damping relative to the mean of the normal equations' diagonal; unused rows become those of
    /// the unit matrix.
    #[inline(always)]
    fn update_pseudoinverse_in<S: Lanes>(&mut self, lanes: S, damping: f64) -> Option<()> {
        let (by_joints, task_rows) = (self.inverts_in_joint_space(), self.task_rows());
        let Self { jacobian, pseudoinverse, joints, .. } = self;
        let mut normal = [[lanes.splat(0.0); 2]; ROWS];
        for (i, sums) in normal.iter_mut().enumerate() {
            if by_joints {
                for row in jacobian.iter() {
                    let weight = lanes.splat(row[i]);
                    for (k, sum) in sums.iter_mut().enumerate() {
                        *sum = lanes.mul_add(lanes.part(row, k), weight, *sum);
                    }
                }
            } else {
                let [a, b, c, d, e, f] = products(lanes, jacobian, &jacobian[i]);
                *sums = [lanes.load([a, b, c, d]), lanes.load([e, f, 0.0, 0.0])];
            }
        }
        let mut damped = 0.0;
        if damping != 0.0 {
            damped = damping * jacobian.iter().flatten().map(|x| x * x).sum::<f64>() / ROWS as f64;
        }
        let part = if by_joints { *joints } else { task_rows };
        let correction = array::from_fn(|i| if i < part { damped } else { 1.0 });
        let inverse = invert(lanes, normal, &correction)?;
        for (i, (step, rate)) in pseudoinverse.iter_mut().zip(jacobian.iter()).enumerate() {
            if by_joints {
                let mut sums = [lanes.splat(0.0); 2];
                for (row, weight) in inverse.iter().zip(rate) {
                    let weight = lanes.splat(*weight);
                    for (sum, part) in sums.iter_mut().zip(row) {
                        *sum = lanes.mul_add(*part, weight, *sum);
                    }
                }
                sums.iter().enumerate().for_each(|(k, sum)| lanes.store(*sum, step, k));
            } else {
                let [[a, b, c, d], [e, f, ..]] = inverse[i].map(|part| lanes.to_array(part));
                combine(lanes, jacobian, &[a, b, c, d, e, f], step);
            }
        }
        Some(())
    }

    /// The step for an error.
    #[inline(always)]
    fn step_in<S: Lanes>(&self, lanes: S, error: &TaskError) -> Joints {
        let mut step = [0.0; JOINTS_MAX];
        combine(lanes, &self.pseudoinverse, &error.0, &mut step);
        step
    }

    /// Error that remains after a step, by the last linearisation.
    #[inline(always)]
    fn remaining_error_in<S: Lanes>(
        &self,
        lanes: S,
        error: &TaskError,
        step: &Joints,
    ) -> TaskError {
        error.minus(&products(lanes, &self.jacobian, step))
    }

    /// Effect of a step on the task at the present trial: that by the last linearisation, plus the
    /// change of the joints' own motions since.
    #[inline(always)]
    fn effect_of_step_in<S: Lanes>(
        &self,
        lanes: S,
        point: &LinearisationPoint<'_>,
        step: &Joints,
    ) -> [f64; ROWS] {
        let LinearisationPoint { arm, evaluation, slope_sums, rows, .. } = point;
        let (mut motions, before) = (Motions::default(), &self.motions);
        motions.take(lanes, arm, &evaluation.real);
        let nothing = Vec3Lanes::same(lanes, DVec3::ZERO);
        let (mut moved, mut turned) = (nothing, nothing);
        for k in 0..S::PARTS {
            let delta = lanes.part(step, k);
            let follows =
                lanes.sub(lanes.part(&slope_sums.position, k), lanes.part(&self.position, k));
            let all = lanes.mul_add(delta, follows, delta);
            let less = lanes.sub(lanes.splat(0.0), delta);
            let [linear, angular] = [motions.linear, motions.angular].map(|m| m.part(lanes, k));
            moved = moved.plus_times(linear, all).plus_times(before.linear.part(lanes, k), less);
            turned =
                turned.plus_times(angular, all).plus_times(before.angular.part(lanes, k), less);
        }
        let correction = rows.motion(moved.sum(), turned.sum());
        let before = products(lanes, &self.jacobian, step);
        array::from_fn(|row| before[row] + correction[row])
    }
}

/// Scalar products of each row with the given one.
#[inline(always)]
fn products<S: Lanes>(lanes: S, rows: &TaskJacobian, with: &Joints) -> [f64; ROWS] {
    let none = lanes.splat(0.0);
    let mut sums = [none; 2 * WIDTH];
    for (sum, row) in sums.iter_mut().zip(rows) {
        for k in 0..S::PARTS {
            *sum = lanes.mul_add(lanes.part(row, k), lanes.part(with, k), *sum);
        }
    }
    let [a, b, c, d, e, f, ..] = sums;
    let [a, b, c, d] = lanes.to_array(lanes.row_sums([a, b, c, d]));
    let [e, f, ..] = lanes.to_array(lanes.row_sums([e, f, none, none]));
    [a, b, c, d, e, f]
}

/// The sum of the rows, each times its weight.
#[inline(always)]
fn combine<S: Lanes>(lanes: S, rows: &TaskJacobian, weights: &[f64; ROWS], into: &mut Joints) {
    for k in 0..S::PARTS {
        let mut sum = lanes.splat(0.0);
        for (row, weight) in rows.iter().zip(weights) {
            sum = lanes.mul_add(lanes.part(row, k), lanes.splat(*weight), sum);
        }
        lanes.store(sum, into, k);
    }
}

struct LineariseWork<'a> {
    slopes: &'a mut Linearisation,
    point: &'a LinearisationPoint<'a>,
}

impl Kernel for LineariseWork<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) {
        self.slopes.linearise_in(lanes, self.point);
    }
}

/// The square of the norm of the inverse, and that of the longest motion of one joint.
struct NormsWork<'a>(&'a Linearisation);

impl Kernel for NormsWork<'_> {
    type Output = (f64, f64);

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) -> (f64, f64) {
        let Linearisation { jacobian, pseudoinverse, .. } = self.0;
        let (mut inverse, mut longest) = (lanes.splat(0.0), 0.0_f64);
        for k in 0..S::PARTS {
            let mut lengths = lanes.splat(0.0);
            for row in 0..ROWS {
                let (rate, step) =
                    (lanes.part(&jacobian[row], k), lanes.part(&pseudoinverse[row], k));
                lengths = lanes.mul_add(rate, rate, lengths);
                inverse = lanes.mul_add(step, step, inverse);
            }
            longest = lanes.to_array(lengths).iter().fold(longest, |most, x| most.max(*x));
        }
        (lanes.sum(inverse), longest)
    }
}

/// Inverts the linearisation, and computes the step and what it leaves.
struct SolveWork<'a> {
    slopes: &'a mut Linearisation,
    error: &'a TaskError,
    damping: f64,
}

impl Kernel for SolveWork<'_> {
    type Output = Option<()>;

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) -> Option<()> {
        let Self { slopes, error, damping } = self;
        slopes.update_pseudoinverse_in(lanes, damping)?;
        let delta = slopes.step_in(lanes, error);
        let (remaining, largest) =
            (slopes.remaining_error_in(lanes, error, &delta), max_abs_in(lanes, &delta));
        slopes.step = NewtonStep { delta, largest, next_size: largest, remaining };
        Some(())
    }
}

/// Refines a step by the inverse of an earlier linearisation, with the geometry of the present
/// trial; returns the largest change that another refinement would make.
struct RefineWork<'a> {
    slopes: &'a mut Linearisation,
    point: &'a LinearisationPoint<'a>,
    error: &'a TaskError,
}

impl Kernel for RefineWork<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) -> f64 {
        let Self { slopes, point, error } = self;
        let mut delta = slopes.step_in(lanes, error);
        let rough = max_abs_in(lanes, &delta);
        let does = slopes.effect_of_step_in(lanes, point, &delta);
        let remaining = error.minus(&does);
        let correction = slopes.step_in(lanes, &remaining);
        apply(&mut delta, &correction);
        let remaining = slopes.remaining_error_in(lanes, &remaining, &correction);
        let largest = max_abs_in(lanes, &delta);
        slopes.step = NewtonStep { delta, largest, next_size: largest, remaining };
        let correction = max_abs_in(lanes, &correction);
        correction * (correction / rough)
    }
}
