//! The task linearised at one trial, and the steps that follow from it.
//!
//! Each step stands on slopes of its own, of the geometry and of the effects that tell theirs; the normal equations are factored once, and the factor put right
//! by one refinement while each step is much smaller than the one before.
//!
//! Promises: an undamped step foretells how large the next will be, a damped one nothing. Never: an evaluation of the model.

use crate::normal::{Factor, ROWS};
use crate::rows::{Rows, TaskError};
use libm::sqrt;
use physics::lanes::{Lanes, Three, WIDTH, Work, widest};
use physics::{Arm, Chain, Evaluation, Following, JOINTS_MAX, Joints, Motions, Told};

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

/// How each of the task's rows changes with each joint.
type Rates = [Joints; ROWS];

/// The linearised task at one trial.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Slopes {
    motions: Motions,
    following: Following,
    /// As the arm stands.
    rates: Rates,
    /// What the factor was made of.
    factored: Rates,
    joints: usize,
    frees_tool_axis: bool,
    factor: Factor,
}

impl Slopes {
    /// Linearises on the geometry of `here`, with all that effects tell.
    pub(crate) fn see(&mut self, here: &Here<'_>) {
        widest(here.arm.count(), See { slopes: self, here });
    }

    #[inline(always)]
    fn see_in<S: Lanes>(&mut self, lanes: S, here: &Here<'_>) {
        let Here { arm, seen, chain, told, rows } = here;
        let count = arm.count().min(JOINTS_MAX);
        (self.joints, self.frees_tool_axis) = (count, rows.free_tool_axis);
        self.motions.take(lanes, arm, chain);
        told.follow(lanes, count, &seen.loads, &mut self.following);
        let Self { motions: Motions { linear, angular }, following, .. } = self;
        let tcp = chain.base_from_tool.origin;
        for k in 0..S::PARTS {
            // A joint moves the tool by itself, and by what it changes of all joints' deviations and of the base's turn.
            let (mut moved, mut turned) = (linear.part(lanes, k), angular.part(lanes, k));
            for i in 0..count {
                let follows = lanes.part(&following.joints[i], k);
                moved = moved.plus_times(Three::same(lanes, linear.at(i)), follows);
                turned = turned.plus_times(Three::same(lanes, angular.at(i)), follows);
            }
            if following.turns_base {
                let (x, y) = (lanes.part(&following.base_x, k), lanes.part(&following.base_y, k));
                let z = lanes.same(0.0);
                (turned.x, turned.y) = (lanes.plus(turned.x, x), lanes.plus(turned.y, y));
                let base = Three::of(lanes, [x, y, z]);
                moved = base.cross_plus(Three::same(lanes, tcp), moved);
            }
            rows.put(lanes, (moved, turned), &mut self.rates, k);
        }
    }

    /// The step on slopes just seen; damped as little as `allowed` asks for.
    pub(crate) fn first(
        &mut self,
        error: &TaskError,
        allowed: impl Fn(&Joints) -> bool,
    ) -> Option<Step> {
        let undamped = self.undamped(error);
        if let Some(step) = undamped.filter(|step| allowed(&step.by)) {
            return Some(step);
        }
        let mut damping = FIRST_DAMPING;
        for _ in 0..DAMPED_TRIES {
            let (by, left) = widest(self.joints, Solve { slopes: self, error, damping })?;
            if allowed(&by) {
                return Some(Step { by, size: f64::INFINITY, foretold: f64::INFINITY, left });
            }
            damping *= 30.0;
        }
        None
    }

    /// The step on slopes just seen, if they have one.
    pub(crate) fn undamped(&mut self, error: &TaskError) -> Option<Step> {
        let (by, left) = widest(self.joints, Solve { slopes: self, error, damping: 0.0 })?;
        let size = largest(&by);
        Some(Step { by, size, foretold: size, left })
    }

    /// The next step with the factor of the `last`, on slopes just seen; none where that was damped, or where this is not much smaller.
    pub(crate) fn again(&self, last: &Step, error: &TaskError, told: &Told) -> Option<Step> {
        if last.size == f64::INFINITY {
            return None;
        }
        let (by, left, error) = widest(self.joints, Refine { slopes: self, error });
        let size = largest(&by);
        let shrinks = size / last.size;
        // What the slopes do not tell shrinks by the same share again, what they do by its square. Of what stays of the task they tell nothing.
        let is_whole = told.is_whole && self.serve_all() && !self.frees_tool_axis;
        let next = if is_whole { MARGIN * shrinks * shrinks } else { shrinks };
        let foretold = next * size + error;
        (shrinks < SHRINKS).then_some(Step { by, size, foretold, left })
    }

    /// How much slopes turn with the joints, per unit of the joints: after a Newton step the next is at most half of this times the square of the sum of
    /// its sizes, as far as the geometry goes. A joint's motion of the tool turns with the joints before it by no more than its length, and an error of the
    /// task asks for no more than the norm of the inverse. None where more than the geometry and told slopes count, or more joints than are asked.
    pub(crate) fn curvature(&self, told: &Told) -> Option<f64> {
        let is_square = self.joints == ROWS && !self.frees_tool_axis;
        if !(is_square && told.is_whole) {
            return None;
        }
        let square = |i: usize| self.factored.iter().map(|row| row[i] * row[i]).sum::<f64>();
        let longest = (0..self.joints).map(square).fold(0.0_f64, f64::max);
        Some(sqrt(self.factor.trace_of_inverse() * longest))
    }

    /// Rows that are asked.
    fn asked(&self) -> usize {
        if self.frees_tool_axis { ROWS - 1 } else { ROWS }
    }

    /// Whether the joints can serve all that is asked.
    fn serve_all(&self) -> bool {
        self.asked() <= self.joints
    }

    /// Whether `JᵀJ` is factored, as no more joints are there than rows; else `J Jᵀ`.
    fn goes_by_joints(&self) -> bool {
        self.joints <= self.asked()
    }

    /// Factors the slopes just seen, with damping relative to the mean of the normal equations' diagonal; rows that take no part become those of the unit matrix.
    #[inline(always)]
    fn factored_in<S: Lanes>(&mut self, lanes: S, damping: f64) -> Option<()> {
        for i in 0..ROWS {
            for k in 0..S::PARTS {
                lanes.put(lanes.part(&self.rates[i], k), &mut self.factored[i], k);
            }
        }
        let rates = &self.factored;
        let mut normal = [[0.0; 2 * WIDTH]; ROWS];
        let part = if self.goes_by_joints() { self.joints } else { self.asked() }.min(ROWS);
        if self.goes_by_joints() {
            for i in 0..part {
                // The lower half alone is looked at.
                for k in 0..=i / WIDTH {
                    let mut sum = lanes.same(0.0);
                    for row in rates {
                        sum = lanes.times_plus(lanes.part(row, k), lanes.same(row[i]), sum);
                    }
                    normal[i].as_chunks_mut().0[k] = lanes.numbers(sum);
                }
            }
        } else {
            for i in 0..part {
                for k in 0..=i {
                    normal[i][k] = self.product(lanes, &rates[i], &rates[k]);
                }
            }
        }
        let added = damping * (0..part).map(|i| normal[i][i]).sum::<f64>() / ROWS as f64;
        (0..part).for_each(|i| normal[i][i] += added);
        (part..ROWS).for_each(|i| normal[i][i] = 1.0);
        self.factor = Factor::of(&normal)?;
        Some(())
    }

    /// `(JᵀJ)⁻¹ Jᵀ e`; for more joints than rows `Jᵀ (J Jᵀ)⁻¹ e`.
    #[inline(always)]
    fn step_in<S: Lanes>(&self, lanes: S, error: &TaskError) -> Joints {
        if self.goes_by_joints() {
            let pull = self.combined(lanes, &error.0);
            let mut step = [0.0; JOINTS_MAX];
            let [a, b, c, d, e, f, ..] = pull;
            let [a, b, c, d, e, f] = self.factor.solve(&[a, b, c, d, e, f]);
            // Four at once, as they will be read.
            lanes.put(lanes.of([a, b, c, d]), &mut step, 0);
            lanes.put(lanes.of([e, f, 0.0, 0.0]), &mut step, 1);
            step
        } else {
            self.combined(lanes, &self.factor.solve(&error.0))
        }
    }

    /// The sum of the factored rows, each times its weight.
    #[inline(always)]
    fn combined<S: Lanes>(&self, lanes: S, weights: &[f64; ROWS]) -> Joints {
        let mut sums = [0.0; JOINTS_MAX];
        for k in 0..S::PARTS {
            let mut sum = lanes.same(0.0);
            for (row, weight) in self.factored.iter().zip(weights) {
                sum = lanes.times_plus(lanes.part(row, k), lanes.same(*weight), sum);
            }
            lanes.put(sum, &mut sums, k);
        }
        sums
    }

    /// What a step leaves of an error where the slopes as the arm stands hold.
    #[inline(always)]
    fn left_in<S: Lanes>(&self, lanes: S, error: &TaskError, step: &Joints) -> TaskError {
        let mut left = *error;
        for i in 0..ROWS {
            left.0[i] -= self.product(lanes, &self.rates[i], step);
        }
        left
    }

    #[inline(always)]
    fn product<S: Lanes>(&self, lanes: S, a: &Joints, b: &Joints) -> f64 {
        let mut sum = lanes.same(0.0);
        for k in 0..S::PARTS {
            sum = lanes.times_plus(lanes.part(a, k), lanes.part(b, k), sum);
        }
        lanes.sum(sum)
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

/// A step on slopes that are factored for it, and what it leaves.
struct Solve<'a> {
    slopes: &'a mut Slopes,
    error: &'a TaskError,
    damping: f64,
}

impl Work for Solve<'_> {
    type Output = Option<(Joints, TaskError)>;

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) -> Self::Output {
        let Self { slopes, error, damping } = self;
        slopes.factored_in(lanes, damping)?;
        let by = slopes.step_in(lanes, error);
        Some((by, slopes.left_in(lanes, error, &by)))
    }
}

/// A step on slopes that were factored where the arm stood before, once more for what it leaves as the arm stands; what then is left, and the largest that
/// another refinement would add.
struct Refine<'a> {
    slopes: &'a Slopes,
    error: &'a TaskError,
}

impl Work for Refine<'_> {
    type Output = (Joints, TaskError, f64);

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) -> Self::Output {
        let Self { slopes, error } = self;
        let mut by = slopes.step_in(lanes, error);
        let rough = largest(&by);
        let left = slopes.left_in(lanes, error, &by);
        let more = slopes.step_in(lanes, &left);
        apply(&mut by, &more);
        let (left, more) = (slopes.left_in(lanes, &left, &more), largest(&more));
        (by, left, more * (more / rough))
    }
}

pub(crate) fn apply(q: &mut Joints, step: &Joints) {
    for (q, step) in q.iter_mut().zip(step) {
        *q += step;
    }
}

pub(crate) fn largest(step: &Joints) -> f64 {
    step.iter().fold(0.0, |most, x| most.max(x.abs()))
}
