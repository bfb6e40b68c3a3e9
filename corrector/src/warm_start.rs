//! Warm start: extrapolates the last solutions, and decides whether one Newton step from there is enough.
//!
//! The correction is extrapolated linearly in the joint positions. If the last extrapolation was so accurate that the step after the first would
//! have been predicted below [`STEP_DONE`], the next solve may start there.
//!
//! Invariants: the prediction holds for the geometry (it is bounded by the present Jacobian); for the nonlinearity of the effects a bound of ten times the value observed in
//! the last solve from a command is used, and at least [`NONLINEARITY_MIN`]. A pose where another solution could be near, or whose correction is large, is solved from its
//! command; so is the first command more than [`RESTART_AFTER_S`] after the last such solve. The warm start does not affect the solution itself.

use crate::joints::{are_within, difference, dot, max_abs, norm_1};
use crate::linearisation::SAFETY_FACTOR;
use crate::solve::{STEP_DONE, Solution};
use physics::{Inputs, Joints};

/// Least assumed rate at which slopes of effects change with their joint, per rad: twice that of a
/// wave of 0.1 mrad and 300 cycles per revolution.
const NONLINEARITY_MIN: f64 = 20.0;
/// Time of motion after which a solve starts from the command again, s.
const RESTART_AFTER_S: f64 = 0.256;
/// The longest from one command to the next, s: after a longer pause the warm start is reset.
const PAUSE_S: f64 = 0.02;
/// Product of correction and curvature below which there is only one solution near the command:
/// Kantorovich's one half.
const KANTOROVICH_BOUND: f64 = 0.5;
/// Share of `position_limits` that a warm start may use.
const REACH_SHARE: f64 = 0.5;
/// Limit of the extrapolation, in multiples of the last step.
const EXTRAPOLATION_MAX: f64 = 2.0;

/// Properties of a finished solve.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SolveSummary {
    /// See [`crate::linearisation::Linearisation::curvature`]; `None` if one step can never suffice.
    pub(crate) curvature: Option<f64>,
    /// The last step over the square of the previous one; zero for less than two steps.
    pub(crate) nonlinearity: f64,
    /// Whether it ended with an undamped step.
    pub(crate) ended_undamped: bool,
    /// Whether it started at the command.
    pub(crate) from_command: bool,
}

/// The last two solutions of a motion.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WarmStart {
    last: Option<SolvedPose>,
    before: Option<SolvedPose>,
    /// Rate at which slopes of effects change, per rad.
    nonlinearity_bound: f64,
    one_step_suffices: bool,
    /// How long the command has moved since a solve started at the command, s.
    moved_s: f64,
}

/// A command and its correction, rad or m.
#[derive(Clone, Copy, Debug)]
struct SolvedPose {
    q: Joints,
    correction: Joints,
}

impl WarmStart {
    /// The expected correction for a command; `None` if it cannot be extrapolated.
    pub(crate) fn extrapolate(&self, inputs: &Inputs) -> Option<Joints> {
        let last = self.last.as_ref()?;
        if !(inputs.dt_s > 0.0 && inputs.dt_s <= PAUSE_S) {
            return None;
        }
        let mut guess = last.correction;
        if let Some(before) = &self.before {
            let (way, way_before) =
                (difference(&inputs.q, &last.q), difference(&last.q, &before.q));
            let (along, square) = (dot(&way, &way_before), dot(&way_before, &way_before));
            // Without motion the correction stays.
            let carried = if square > 0.0 { along / square } else { 0.0 };
            let carried = carried.clamp(-EXTRAPOLATION_MAX, EXTRAPOLATION_MAX);
            for (guess, before) in guess.iter_mut().zip(&before.correction) {
                *guess += carried * (*guess - before);
            }
        }
        Some(guess)
    }

    /// Whether one step from the next guess is expected to suffice.
    pub(crate) fn is_sure(&self) -> bool {
        self.one_step_suffices && self.moved_s < RESTART_AFTER_S
    }

    /// Whether the command is the same as the last.
    pub(crate) fn is_same_command(&self, q: &Joints) -> bool {
        self.last.as_ref().is_some_and(|last| last.q == *q)
    }

    /// Upper bound of the step after `by`.
    pub(crate) fn next_step_bound(&self, step: &Joints, curvature: f64) -> f64 {
        let (length, size) = (norm_1(step), max_abs(step));
        0.5 * curvature * length * length + self.nonlinearity_bound * size * size
    }

    /// Stores a solution for the command in `inputs`, and the guess that was made for it.
    pub(crate) fn store(
        &mut self,
        inputs: &Inputs,
        solution: &Solution,
        guess: Option<&Joints>,
        summary: &SolveSummary,
    ) {
        if !solution.converged {
            *self = Self::default();
            return;
        }
        let correction = difference(&solution.q, &inputs.q);
        if summary.from_command {
            (self.nonlinearity_bound, self.moved_s) = (NONLINEARITY_MIN, 0.0);
        } else if !self.is_same_command(&inputs.q) {
            self.moved_s += inputs.dt_s;
        }
        self.nonlinearity_bound = self.nonlinearity_bound.max(SAFETY_FACTOR * summary.nonlinearity);
        self.one_step_suffices = guess.zip(summary.curvature).is_some_and(|(guess, curvature)| {
            let extrapolation_error = difference(&correction, guess);
            self.next_step_bound(&extrapolation_error, curvature) < STEP_DONE
        });
        self.before = self.last.replace(SolvedPose { q: inputs.q, correction });
    }
}

/// Whether a correction is such a small part of `position_limits` that no step from the command to it is
/// damped.
pub(crate) fn is_small(correction: &Joints, position_limits: &Joints) -> bool {
    are_within(correction, position_limits, REACH_SHARE)
}

/// Whether a correction is so small for this curvature that a solve from the command finds no
/// other.
pub(crate) fn is_unique(correction: &Joints, curvature: f64) -> bool {
    curvature * norm_1(correction) < KANTOROVICH_BOUND
}
