//! The task linearised at one trial, and Newton steps from it.
//!
//! Each step uses the Jacobian of the geometry at the present pose, and those of the effects that provide one. The normal equations are inverted once; while each
//! step is much smaller than the previous one, the inverse is corrected by the observed effect of the step, along that step only (rank-one update).
//!
//! Invariant: an undamped step predicts the size of the next one, a damped one does not. The model
//! is not evaluated here.

use crate::joints::{apply, largest_in};
use crate::normal::{Matrix, ROWS, invert};
use crate::rows::{Rows, TaskError};
use core::array;
use glam::DVec3;
use libm::sqrt;
use physics::lanes::{Lanes, Three, WIDTH, Work, widest};
use physics::{Arm, Evaluation, Following, JOINTS_MAX, Joints, Motions, Told};

/// A step that is larger than this share of the previous one requires a new inverse.
const SHRINKS: f64 = 0.1;
/// Factor of safety on the predicted step if all slopes are known: steps then shrink quadratically,
/// as the last two show.
pub(crate) const MARGIN: f64 = 10.0;
/// Damping of the first damped attempt, relative to the mean of the diagonal; each further attempt
/// has 30 times as much.
const FIRST_DAMPING: f64 = 1e-8;
const DAMPED_TRIES: u32 = 6;

/// The arm at the present trial of a solve.
pub(crate) struct Here<'a> {
    pub(crate) arm: &'a Arm,
    pub(crate) seen: &'a Evaluation,
    /// Whether the real geometry is used, otherwise the nominal one.
    pub(crate) is_real: bool,
    pub(crate) told: &'a Told,
    pub(crate) rows: &'a Rows,
}

/// A step of the joints, rad or m.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(crate) struct Step {
    pub(crate) by: Joints,
    /// Its largest component; infinite for a damped step, which predicts nothing.
    pub(crate) size: f64,
    /// Predicted size of the next step.
    pub(crate) foretold: f64,
    /// What it leaves of the task by the linearisation.
    pub(crate) left: TaskError,
}

/// Derivative of each task row by each joint, or of each joint by each row.
pub(crate) type Rates = Matrix;

/// Groups of four lanes that hold all joints of any arm.
const PARTS_MAX: usize = JOINTS_MAX / WIDTH;

/// The linearised task at one trial.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(crate) struct Slopes {
    following: Following,
    /// Motion of the tool by each joint alone, derivative of each joint's deviation by its own
    /// position, and the resulting rows with all other known slopes: as of the last linearisation.
    motions: Motions,
    position: Joints,
    pub(crate) rates: Rates,
    /// Square of the norm of the derivative of the deviations by the joints.
    follows: f64,
    /// The step for a unit error of each row: the pseudo-inverse of the rates.
    steps: Rates,
    /// The last step; kept in place, because a copy would wait for what was just written.
    pub(crate) step: Step,
    /// How far the joints moved since, rad or m.
    gone: f64,
    joints: usize,
    frees_tool_axis: bool,
}

impl Slopes {
    /// Linearises at `here`, with all slopes that effects provide.
    pub(crate) fn see(&mut self, here: &Here<'_>) {
        widest(here.arm.count(), See { slopes: self, here });
    }

    #[inline(always)]
    fn see_in<S: Lanes>(&mut self, lanes: S, here: &Here<'_>) {
        let Here { arm, seen, is_real, told, rows } = here;
        let count = arm.count().min(JOINTS_MAX);
        (self.joints, self.frees_tool_axis, self.gone) = (count, rows.free_tool_axis, 0.0);
        let Self { motions, position, following, rates, .. } = self;
        let chain = if *is_real { &seen.real } else { &seen.nominal };
        if *is_real {
            motions.take(lanes, arm, chain);
        } else {
            motions.copy(lanes, &seen.loads.motions);
        }
        *position = told.position;
        let Motions { linear, angular } = motions;
        told.follow(lanes, &seen.loads, following);
        // A joint moves the tool by itself, and through its influence on the deviations of all
        // joints and on the rotation of the base.
        let nothing = Three::same(lanes, DVec3::ZERO);
        let (mut moved, mut turned) = ([nothing; PARTS_MAX], [nothing; PARTS_MAX]);
        let mut squares = lanes.same(0.0);
        for k in 0..S::PARTS {
            (moved[k], turned[k]) = (linear.part(lanes, k), angular.part(lanes, k));
        }
        for i in 0..count {
            let (along, about) =
                (Three::same(lanes, linear.at(i)), Three::same(lanes, angular.at(i)));
            for k in 0..S::PARTS {
                let follows = told.row(lanes, (following, &seen.loads), (i, k));
                moved[k] = moved[k].plus_times(along, follows);
                turned[k] = turned[k].plus_times(about, follows);
                squares = lanes.times_plus(follows, follows, squares);
            }
        }
        self.follows = lanes.sum(squares);
        let tcp = Three::same(lanes, chain.base_from_tool.origin);
        for k in 0..S::PARTS {
            let (mut moved, mut turned) = (moved[k], turned[k]);
            if following.turns_base {
                let (x, y) = (lanes.part(&following.base_x, k), lanes.part(&following.base_y, k));
                (turned.x, turned.y) = (lanes.plus(turned.x, x), lanes.plus(turned.y, y));
                moved = Three::of(lanes, [x, y, lanes.same(0.0)]).cross_plus(tcp, moved);
            }
            rows.put(lanes, (moved, turned), rates, k);
        }
    }

    /// The step by a new linearisation, with as little damping as `allowed` requires; false if
    /// there is none.
    pub(crate) fn first(&mut self, error: &TaskError, allowed: impl Fn(&Joints) -> bool) -> bool {
        if self.undamped(error) && allowed(&self.step.by) {
            return true;
        }
        let mut damping = FIRST_DAMPING;
        for _ in 0..DAMPED_TRIES {
            if !self.solve(error, damping) {
                return false;
            }
            if allowed(&self.step.by) {
                (self.step.size, self.step.foretold) = (f64::INFINITY, f64::INFINITY);
                return true;
            }
            damping *= 30.0;
        }
        false
    }

    /// The undamped step by a new linearisation; false if there is none.
    pub(crate) fn undamped(&mut self, error: &TaskError) -> bool {
        self.solve(error, 0.0)
    }

    fn solve(&mut self, error: &TaskError, damping: f64) -> bool {
        widest(self.joints, Solve { slopes: self, error, damping }).is_some()
    }

    /// The next step by the inverse of the last linearisation, `last` being the size of the step
    /// since, corrected by the geometry of the present trial; returns whether it is much smaller
    /// than that. Always false if `last` was damped.
    pub(crate) fn again(&mut self, here: &Here<'_>, last: f64, error: &TaskError) -> bool {
        if last == f64::INFINITY {
            return false;
        }
        self.gone += last;
        let more = widest(self.joints, Refine { slopes: self, here, error });
        let shrinks = self.step.size / last;
        // The error of unknown slopes shrinks by the same share again, that of known ones
        // quadratically. The slopes say nothing about the part of the task that remains.
        let is_whole = here.told.is_whole && self.serve_all() && !self.frees_tool_axis;
        // The derivative of the deviations by the loads is not renewed: it changed in proportion to
        // the distance moved, by the order of the deviations or of the correction.
        let stale = self.gone * (self.gone + sqrt(self.follows));
        let next = if is_whole { MARGIN * shrinks * shrinks + stale } else { shrinks };
        self.step.foretold = next * self.step.size + more;
        shrinks < SHRINKS
    }

    /// Bound on how fast the slopes change with the joints, per unit of the joints: after a Newton
    /// step, the next is at most half of this times the square of the sum of its sizes, as far as
    /// the geometry is concerned. A joint's motion of the tool turns with the joints before it by
    /// no more than its length, and an error of the task requires no more than the norm of the
    /// inverse. `None` unless all slopes are known and the arm has as many joints as the task rows.
    pub(crate) fn curvature(&self, told: &Told) -> Option<f64> {
        let is_square = self.joints == ROWS && !self.frees_tool_axis;
        if !(is_square && told.is_whole) {
            return None;
        }
        let (inverse, longest) = widest(self.joints, Lengths(self));
        Some(sqrt(inverse * longest))
    }

    /// Number of task rows.
    fn asked(&self) -> usize {
        if self.frees_tool_axis { ROWS - 1 } else { ROWS }
    }

    /// Whether the joints can reach all rows.
    pub(crate) fn serve_all(&self) -> bool {
        self.asked() <= self.joints
    }

    /// Whether `JᵀJ` is inverted, for at most as many joints as rows; otherwise `J Jᵀ`.
    fn goes_by_joints(&self) -> bool {
        self.joints <= self.asked()
    }

    /// `(JᵀJ)⁻¹ Jᵀ`, for more joints than rows `Jᵀ (J Jᵀ)⁻¹`, of the last linearisation, with
    /// damping relative to the mean of the normal equations' diagonal; unused rows become those of
    /// the unit matrix.
    #[inline(always)]
    fn inverted_in<S: Lanes>(&mut self, lanes: S, damping: f64) -> Option<()> {
        let (by_joints, asked) = (self.goes_by_joints(), self.asked());
        let Self { rates, steps, joints, .. } = self;
        let mut normal = [[lanes.same(0.0); 2]; ROWS];
        for (i, sums) in normal.iter_mut().enumerate() {
            if by_joints {
                for row in rates.iter() {
                    let weight = lanes.same(row[i]);
                    for (k, sum) in sums.iter_mut().enumerate() {
                        *sum = lanes.times_plus(lanes.part(row, k), weight, *sum);
                    }
                }
            } else {
                let [a, b, c, d, e, f] = products(lanes, rates, &rates[i]);
                *sums = [lanes.of([a, b, c, d]), lanes.of([e, f, 0.0, 0.0])];
            }
        }
        let mut damped = 0.0;
        if damping != 0.0 {
            damped = damping * rates.iter().flatten().map(|x| x * x).sum::<f64>() / ROWS as f64;
        }
        let part = if by_joints { *joints } else { asked };
        let more = array::from_fn(|i| if i < part { damped } else { 1.0 });
        let inverse = invert(lanes, normal, &more)?;
        for (i, (step, rate)) in steps.iter_mut().zip(rates.iter()).enumerate() {
            if by_joints {
                let mut sums = [lanes.same(0.0); 2];
                for (row, weight) in inverse.iter().zip(rate) {
                    let weight = lanes.same(*weight);
                    for (sum, part) in sums.iter_mut().zip(row) {
                        *sum = lanes.times_plus(*part, weight, *sum);
                    }
                }
                sums.iter().enumerate().for_each(|(k, sum)| lanes.put(*sum, step, k));
            } else {
                let [[a, b, c, d], [e, f, ..]] = inverse[i].map(|part| lanes.numbers(part));
                combine(lanes, rates, &[a, b, c, d, e, f], step);
            }
        }
        Some(())
    }

    /// The step for an error.
    #[inline(always)]
    fn step_in<S: Lanes>(&self, lanes: S, error: &TaskError) -> Joints {
        let mut step = [0.0; JOINTS_MAX];
        combine(lanes, &self.steps, &error.0, &mut step);
        step
    }

    /// What a step leaves of an error by the last linearisation.
    #[inline(always)]
    fn left_in<S: Lanes>(&self, lanes: S, error: &TaskError, step: &Joints) -> TaskError {
        error.less(&products(lanes, &self.rates, step))
    }

    /// Effect of a step on the task at the present trial: that by the last linearisation, plus the
    /// change of the joints' own motions since.
    #[inline(always)]
    fn does_in<S: Lanes>(&self, lanes: S, here: &Here<'_>, step: &Joints) -> [f64; ROWS] {
        let Here { arm, seen, told, rows, .. } = here;
        let (mut motions, before) = (Motions::default(), &self.motions);
        motions.take(lanes, arm, &seen.real);
        let nothing = Three::same(lanes, DVec3::ZERO);
        let (mut moved, mut turned) = (nothing, nothing);
        for k in 0..S::PARTS {
            let by = lanes.part(step, k);
            let follows = lanes.minus(lanes.part(&told.position, k), lanes.part(&self.position, k));
            let all = lanes.times_plus(by, follows, by);
            let less = lanes.minus(lanes.same(0.0), by);
            let [linear, angular] = [motions.linear, motions.angular].map(|m| m.part(lanes, k));
            moved = moved.plus_times(linear, all).plus_times(before.linear.part(lanes, k), less);
            turned =
                turned.plus_times(angular, all).plus_times(before.angular.part(lanes, k), less);
        }
        let more = rows.motion(moved.sum(), turned.sum());
        let before = products(lanes, &self.rates, step);
        array::from_fn(|row| before[row] + more[row])
    }
}

/// Scalar products of each row with the given one.
#[inline(always)]
fn products<S: Lanes>(lanes: S, rows: &Rates, with: &Joints) -> [f64; ROWS] {
    let none = lanes.same(0.0);
    let mut sums = [none; 2 * WIDTH];
    for (sum, row) in sums.iter_mut().zip(rows) {
        for k in 0..S::PARTS {
            *sum = lanes.times_plus(lanes.part(row, k), lanes.part(with, k), *sum);
        }
    }
    let [a, b, c, d, e, f, ..] = sums;
    let [a, b, c, d] = lanes.numbers(lanes.sums([a, b, c, d]));
    let [e, f, ..] = lanes.numbers(lanes.sums([e, f, none, none]));
    [a, b, c, d, e, f]
}

/// The sum of the rows, each times its weight.
#[inline(always)]
fn combine<S: Lanes>(lanes: S, rows: &Rates, weights: &[f64; ROWS], into: &mut Joints) {
    for k in 0..S::PARTS {
        let mut sum = lanes.same(0.0);
        for (row, weight) in rows.iter().zip(weights) {
            sum = lanes.times_plus(lanes.part(row, k), lanes.same(*weight), sum);
        }
        lanes.put(sum, into, k);
    }
}

struct See<'a> {
    slopes: &'a mut Slopes,
    here: &'a Here<'a>,
}

impl Work for See<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) {
        self.slopes.see_in(lanes, self.here);
    }
}

/// The square of the norm of the inverse, and that of the longest motion of one joint.
struct Lengths<'a>(&'a Slopes);

impl Work for Lengths<'_> {
    type Output = (f64, f64);

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) -> (f64, f64) {
        let Slopes { rates, steps, .. } = self.0;
        let (mut inverse, mut longest) = (lanes.same(0.0), 0.0_f64);
        for k in 0..S::PARTS {
            let mut lengths = lanes.same(0.0);
            for row in 0..ROWS {
                let (rate, step) = (lanes.part(&rates[row], k), lanes.part(&steps[row], k));
                lengths = lanes.times_plus(rate, rate, lengths);
                inverse = lanes.times_plus(step, step, inverse);
            }
            longest = lanes.numbers(lengths).iter().fold(longest, |most, x| most.max(*x));
        }
        (lanes.sum(inverse), longest)
    }
}

/// Inverts the linearisation, and computes the step and what it leaves.
struct Solve<'a> {
    slopes: &'a mut Slopes,
    error: &'a TaskError,
    damping: f64,
}

impl Work for Solve<'_> {
    type Output = Option<()>;

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) -> Option<()> {
        let Self { slopes, error, damping } = self;
        slopes.inverted_in(lanes, damping)?;
        let by = slopes.step_in(lanes, error);
        let (left, size) = (slopes.left_in(lanes, error, &by), largest_in(lanes, &by));
        slopes.step = Step { by, size, foretold: size, left };
        Some(())
    }
}

/// Refines a step by the inverse of an earlier linearisation, with the geometry of the present
/// trial; returns the largest change that another refinement would make.
struct Refine<'a> {
    slopes: &'a mut Slopes,
    here: &'a Here<'a>,
    error: &'a TaskError,
}

impl Work for Refine<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) -> f64 {
        let Self { slopes, here, error } = self;
        let mut by = slopes.step_in(lanes, error);
        let rough = largest_in(lanes, &by);
        let does = slopes.does_in(lanes, here, &by);
        let left = error.less(&does);
        let more = slopes.step_in(lanes, &left);
        apply(&mut by, &more);
        let left = slopes.left_in(lanes, &left, &more);
        let size = largest_in(lanes, &by);
        slopes.step = Step { by, size, foretold: size, left };
        let more = largest_in(lanes, &more);
        more * (more / rough)
    }
}
