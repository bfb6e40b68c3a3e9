//! State of the cycle: commands, memory of the effects, corrections.
//!
//! Every change of the requested correction (start, rejected command, new model, bypass, mode) passes the joints'
//! [`Limiters`], one step per call of [`Corrector::limit`], over the time elapsed since the last.

use crate::command::{Command, CommandValidator, Continuity};
use crate::compliance;
use crate::cycle_inputs::{CycleInputs, WrenchSample};
use crate::joints::apply;
use crate::outcome::{GateState, Outcome, Reason, Residual, Status};
use crate::path::PathState;
use crate::settings::{Mode, Settings, Task};
use crate::solve::{Solution, Solver};
use crate::task_rows::TaskRows;
use crate::wrench::WrenchFilter;
use envelope::{Elapsed, Intervals, Limiters, Limits};
use glam::DVec3;
use physics::{Arm, Chain, Evaluation, Frame, Inputs, JOINTS_MAX, Joints, Model, Wrench};

/// Share of the rate limit at which a correction is taken back ahead of a joint limit.
const TAKEN_BACK_SHARE: f64 = 0.5;

/// The correction of one robot.
#[derive(Clone, Debug)]
pub struct Corrector {
    settings: Settings,
    validator: CommandValidator,
    path: PathState,
    wrench: WrenchFilter,
    solver: Solver,
    limiters: Limiters<JOINTS_MAX>,
    /// The correction that the last good solution required.
    last_requested: Joints,
    /// The lead of the last accepted command.
    last_lead: Joints,
    refused_ns: u64,
    /// Why the correction is not yet the requested one; kept until it is.
    cause: Reason,
    bypassed: bool,
    /// Share of the position limit in the last mode that corrects; kept through shadow mode, so
    /// that a correction on its way out goes no further.
    angle_share: f64,
    intervals: Intervals,
}

/// The requested correction of a cycle, before limiting.
#[derive(Clone, Copy, Debug)]
pub struct RequestedCorrection {
    /// The requested correction, rad or m.
    correction: Joints,
    status: Status,
    reason: Reason,
    residual: Residual,
    steps: u32,
    gate: GateState,
    elapsed: Elapsed,
    settled: bool,
}

impl Corrector {
    /// A corrector without history and correction.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            validator: CommandValidator::default(),
            path: PathState::new(),
            wrench: WrenchFilter::new(),
            solver: Solver::default(),
            limiters: Limiters::at_rest(),
            last_requested: [0.0; JOINTS_MAX],
            last_lead: [0.0; JOINTS_MAX],
            refused_ns: 0,
            cause: Reason::Starting,
            bypassed: false,
            angle_share: settings.mode.angle_share().unwrap_or(1.0),
            intervals: Intervals::new(),
        }
    }

    /// Ramps the correction to zero (`true`) or back in (`false`).
    pub fn set_bypass(&mut self, bypassed: bool) {
        if self.bypassed && !bypassed {
            self.cause = Reason::Bypass;
        }
        self.bypassed = bypassed;
    }

    /// Sets how much may be corrected; the change is ramped.
    pub fn set_mode(&mut self, mode: Mode) {
        if mode != self.settings.mode {
            self.cause = Reason::Starting;
        }
        self.settings.mode = mode;
        self.angle_share = mode.angle_share().unwrap_or(self.angle_share);
    }

    /// Bounds of joint `i`'s correction in this mode.
    fn limits(&self, i: usize) -> Limits {
        self.settings.limits(i, self.angle_share)
    }

    /// How much may be corrected now.
    pub fn mode(&self) -> Mode {
        self.settings.mode
    }

    /// Opens a wrench gate that closed for its loop gain, as a new trial.
    pub fn rearm_wrench(&mut self) {
        self.wrench.rearm();
    }

    /// Replaces the model. The new effects have no memory yet: they settle from the present
    /// directions.
    pub fn model_changed(&mut self, model: &Model) {
        self.path.resettle(model);
        self.solver = Solver::default();
        self.cause = Reason::ModelChanged;
    }

    /// The requested correction for this command. `now_ns` is the cycle's time (live
    /// `CLOCK_MONOTONIC`, in lockstep the command's).
    pub fn correct(
        &mut self,
        model: &Model,
        command: &Command,
        raw_inputs: &CycleInputs,
        now_ns: u64,
    ) -> RequestedCorrection {
        let elapsed = self.elapse(now_ns, command.t_ns);
        let continuity = match self.validator.validate(&model.arm, &self.settings, command, now_ns)
        {
            Ok(continuity) => continuity,
            Err(reason) => return self.refuse(reason, elapsed),
        };
        let reset_reason = match continuity {
            Continuity::TimeJump => Reason::TimeJump,
            Continuity::CommandJump => Reason::CommandJump,
            Continuity::NewSession | Continuity::After(_) => Reason::None,
        };
        if reset_reason != Reason::None {
            self.cause = reset_reason;
        }
        if self.settings.lockstep && continuity.interval_ns().is_none() {
            // The time of a recording may start again.
            self.intervals = Intervals::new();
            self.elapse(now_ns, command.t_ns);
        }
        let cycle_inputs = raw_inputs.sanitized();
        self.path.advance(model, &self.settings, command, &cycle_inputs, continuity);
        let settled = command.settled && self.settings.lockstep;
        let gate = self.apply_wrench(model, &cycle_inputs, elapsed, settled);
        // Poses at rest are not connected by motion.
        if settled || continuity.interval_ns().is_none() {
            self.solver.reset_warm_start();
        }
        let base = RequestedCorrection {
            gate,
            settled,
            reason: reset_reason,
            ..RequestedCorrection::zero(elapsed)
        };
        let task = Task { offset_m: cycle_inputs.trim_m, ..self.settings.task };
        let position_limits = self.position_limits();
        // `advance` has just stored the command, so that one is there.
        let Some(inputs) = self.path.last() else { return base };
        let solution =
            self.solver.track(model, inputs, self.path.memories(), &task, &position_limits);
        let q_cmd = inputs.q;
        let mut requested = self.requested_from(&q_cmd, &solution, base);
        self.last_lead = cycle_inputs.lead;
        apply(&mut requested.correction, &cycle_inputs.lead);
        requested
    }

    /// Limits the requested correction to the one that is sent.
    pub fn limit(&mut self, model: &Model, requested: &RequestedCorrection) -> Outcome {
        let joints = model.arm.count();
        let mut outcome = Outcome {
            requested: requested.correction,
            status: requested.status,
            reason: requested.reason,
            residual: requested.residual,
            steps: requested.steps,
            gate: requested.gate,
            loop_gain: self.wrench.loop_gain(),
            ..Outcome::default()
        };
        let (goal, is_clipped) = self.goal(&model.arm, requested);
        let (limited, reached) = self.step(joints, &goal, requested);
        outcome.correction = limited;
        for (i, limiter) in self.limiters.joints()[..joints].iter().enumerate() {
            outcome.correction_rate[i] = limiter.rate();
            outcome.correction_acceleration[i] = limiter.acceleration();
        }
        self.set_status(&mut outcome, reached, is_clipped);
        outcome
    }

    /// Residual of the tool pose at the last accepted command with this correction, by the model:
    /// one more evaluation, for reports. `None` before the first command, and if an effect is
    /// outside the range of its law.
    pub fn residual_with(&self, model: &Model, correction: &Joints) -> Option<Residual> {
        let inputs = self.path.last()?;
        let task = &self.settings.task;
        let rows = TaskRows::new(&Chain::tool_at(&model.arm, &inputs.q), task);
        let residual = rows.pose_error(&self.tool_pose_with(model, correction)?).residual(task);
        (residual.m.is_finite() && residual.rad.is_finite()).then_some(residual)
    }

    /// Pose of the tool by the model at the last accepted command with this correction, base frame:
    /// one more evaluation. `None` as for [`Corrector::residual_with`].
    pub fn tool_pose_with(&self, model: &Model, correction: &Joints) -> Option<Frame> {
        let mut inputs = *self.path.last()?;
        apply(&mut inputs.q, correction);
        let mut evaluation = Evaluation::default();
        model.deviate_into(&inputs, self.path.memories(), &mut evaluation, None);
        evaluation.set_real(&model.arm, &inputs);
        evaluation.out_of_range.is_none().then_some(evaluation.real.base_from_tool)
    }

    /// The model's compliance at the TCP along `force_n` at the last accepted command, m/N: two more evaluations. None before the first command, and where an
    /// effect is outside the range of its law. Without a force, along the tool's z axis.
    pub fn compliance_along(&self, model: &Model, force_n: DVec3, in_base: bool) -> Option<f64> {
        let inputs = self.path.last()?;
        let axes = Chain::tool_at(&model.arm, &inputs.q).rotation;
        let force_n = if in_base { force_n } else { axes * force_n };
        let axis = force_n.try_normalize().unwrap_or(axes.z_axis);
        let unloaded = Inputs { wrench_base: Wrench::ZERO, ..*inputs };
        let mut evaluation = Evaluation::default();
        let memories = self.path.memories();
        let found = compliance::compliance_along(axis, model, &unloaded, memories, &mut evaluation);
        found.is_valid.then_some(found.per_newton.length())
    }

    /// Whether corrections go out: not in shadow mode, not while bypassed.
    pub fn is_correcting(&self) -> bool {
        !self.bypassed && self.settings.mode != Mode::Shadow
    }

    /// Work for later cycles that does not affect the present target: to be called after the target
    /// was sent. Without it the gate of a wrench in a contact of known stiffness stays closed.
    pub fn prepare(&mut self, model: &Model) {
        let Some(inputs) = self.path.last() else { return };
        if self.settings.wrench.enabled && self.settings.wrench.process_stiffness.is_some() {
            self.wrench.probe_compliance(
                model,
                inputs,
                self.path.memories(),
                self.solver.scratch(),
            );
        }
    }

    /// The time since the last call. After a silence the robot has stopped, and the correction is
    /// constant.
    fn elapse(&mut self, now_ns: u64, stamp_ns: u64) -> Elapsed {
        self.intervals.elapse(now_ns, Some(stamp_ns)).unwrap_or_else(|| {
            self.limiters.rest();
            Elapsed::default()
        })
    }

    /// A refused command: the last good correction is held for a while, then ramps to zero.
    fn refuse(&mut self, reason: Reason, elapsed: Elapsed) -> RequestedCorrection {
        self.cause = reason;
        self.refused_ns = self.refused_ns.saturating_add(nanoseconds(elapsed));
        let base = RequestedCorrection::zero(elapsed);
        let mut correction = base.correction;
        if self.is_holding() {
            correction = self.last_requested;
            apply(&mut correction, &self.last_lead);
        }
        RequestedCorrection { correction, status: Status::Rejected, reason, ..base }
    }

    /// Whether the refusal is recent enough to hold the last good correction.
    fn is_holding(&self) -> bool {
        self.refused_ns <= self.settings.hold_ns
    }

    /// Applies the measured wrench to the last command, as far as its gate allows; returns the
    /// state of the gate.
    fn apply_wrench(
        &mut self,
        model: &Model,
        cycle_inputs: &CycleInputs,
        elapsed: Elapsed,
        settled: bool,
    ) -> GateState {
        let q_cmd = self.path.last().map(|inputs| &inputs.q);
        let measured = cycle_inputs.wrench.zip(q_cmd).map(|(sample, q_cmd)| {
            let w = sample.wrench;
            let in_base = if sample.in_base {
                w
            } else {
                let axes = Chain::tool_at(&model.arm, q_cmd).rotation;
                Wrench { force: axes * w.force, moment: axes * w.moment }
            };
            WrenchSample { wrench: in_base, in_base: true, ..sample }
        });
        let (wrench, gate) = if settled {
            self.wrench.settled(&self.settings.wrench, measured)
        } else {
            self.wrench.step(&self.settings.wrench, measured, elapsed.dt_s)
        };
        self.path.set_wrench(wrench);
        gate
    }

    /// The requested correction of a solution. If the solve failed, the last good one is held for a
    /// while, then ramps to zero; at a pose at rest it is zero at once.
    fn requested_from(
        &mut self,
        q_cmd: &Joints,
        solution: &Solution,
        base: RequestedCorrection,
    ) -> RequestedCorrection {
        let mut requested =
            RequestedCorrection { residual: solution.residual, steps: solution.steps, ..base };
        if solution.converged || solution.limited.is_some() {
            if let Some(reason) = solution.limited {
                (requested.status, requested.reason) = (Status::Limited, reason);
            }
            self.refused_ns = 0;
            for (i, correction) in requested.correction.iter_mut().enumerate() {
                *correction = solution.q[i] - q_cmd[i];
            }
            self.last_requested = requested.correction;
            return requested;
        }
        self.cause = Reason::NotConverged;
        self.refused_ns = self.refused_ns.saturating_add(nanoseconds(requested.elapsed));
        let (status, correction) = if self.is_holding() && !requested.settled {
            (Status::Held, self.last_requested)
        } else {
            (Status::Ramping, requested.correction)
        };
        RequestedCorrection { correction, status, reason: Reason::NotConverged, ..requested }
    }

    /// The goal of the limiters, and whether a joint limit reduced it.
    fn goal(&self, arm: &Arm, requested: &RequestedCorrection) -> (Joints, bool) {
        if !self.is_correcting() {
            return ([0.0; JOINTS_MAX], false);
        }
        let (mut goal, mut is_clipped) = (requested.correction, false);
        if let Some(inputs) = self.path.last() {
            for (i, goal) in goal[..arm.count()].iter_mut().enumerate() {
                let (lowest, highest) = self.correction_range(arm, inputs, i);
                let cut = goal.clamp(lowest, highest);
                is_clipped |= cut != *goal;
                *goal = cut;
            }
        }
        (goal, is_clipped)
    }

    /// How far joint `i` may be corrected without leaving its limits. Ahead of a limit that the
    /// command approaches, the range shrinks so that the correction can be taken back before the
    /// command reaches the limit: a correction that is cut only at the limit would stop at once.
    fn correction_range(&self, arm: &Arm, inputs: &Inputs, i: usize) -> (f64, f64) {
        let (min, max) = arm.joints()[i].limits;
        let q = inputs.q[i];
        // Both over one cycle.
        let moved = q - inputs.q_before[i];
        let taken_back = TAKEN_BACK_SHARE * self.limits(i).rate() * inputs.dt_s;
        let share = |towards: f64| if towards > taken_back { taken_back / towards } else { 1.0 };
        ((min - q).min(0.0) * share(-moved), (max - q).max(0.0) * share(moved))
    }

    /// One step of the joints' limiters, and whether they reached the goal.
    fn step(
        &mut self,
        joints: usize,
        goal: &Joints,
        requested: &RequestedCorrection,
    ) -> (Joints, GoalState) {
        let mut within_position_limit = [0.0; JOINTS_MAX];
        for (i, within_position_limit) in within_position_limit[..joints].iter_mut().enumerate() {
            let angle = self.limits(i).angle();
            *within_position_limit = goal[i].clamp(-angle, angle);
        }
        let limited = if requested.settled {
            self.limiters.jump(&within_position_limit)
        } else {
            let Self { settings, angle_share, limiters, .. } = self;
            let limits = |i| (i < joints).then(|| settings.limits(i, *angle_share));
            limiters.step(&within_position_limit, limits, requested.elapsed)
        };
        let reached = if limited != within_position_limit {
            GoalState::NotYet
        } else if within_position_limit[..joints] != goal[..joints] {
            GoalState::AtLimit
        } else {
            GoalState::Goal
        };
        (limited, reached)
    }

    /// Sets status and reason of the outcome.
    fn set_status(&mut self, outcome: &mut Outcome, reached: GoalState, is_clipped: bool) {
        let is_limited = outcome.status == Status::Limited;
        let solved = is_limited || outcome.status == Status::Corrected;
        let arrived = reached != GoalState::NotYet;
        if outcome.status == Status::Rejected {
            return;
        }
        if self.bypassed {
            outcome.status = if arrived { Status::Bypassed } else { Status::Ramping };
            outcome.reason = Reason::Bypass;
        } else if self.settings.mode == Mode::Shadow && arrived {
            outcome.status = Status::Shadow;
            outcome.reason =
                if solved && !is_limited { Reason::ShadowMode } else { outcome.reason };
        } else if solved && !arrived {
            outcome.status = Status::Ramping;
            outcome.reason = if self.cause == Reason::None { Reason::Envelope } else { self.cause };
        } else if solved {
            self.cause = Reason::None;
            outcome.reason = match reached {
                _ if is_limited => outcome.reason,
                _ if is_clipped => Reason::JointLimit,
                GoalState::AtLimit => Reason::Envelope,
                // Reported in the cycle in which it happens, whatever the correction is.
                _ if outcome.reason == Reason::CommandJump => Reason::CommandJump,
                _ => Reason::None,
            };
        }
    }

    fn position_limits(&self) -> Joints {
        let mut position_limits = [0.0; JOINTS_MAX];
        for (position_limits, limits) in position_limits.iter_mut().zip(&self.settings.envelope) {
            *position_limits = limits.angle();
        }
        position_limits
    }
}

/// Whether the limiters reached the goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum GoalState {
    Goal,
    /// At the position limit, short of the goal.
    AtLimit,
    NotYet,
}

impl RequestedCorrection {
    fn zero(elapsed: Elapsed) -> Self {
        Self {
            correction: [0.0; JOINTS_MAX],
            status: Status::Corrected,
            reason: Reason::None,
            residual: Residual::default(),
            steps: 0,
            gate: GateState::Absent,
            elapsed,
            settled: false,
        }
    }
}

fn nanoseconds(elapsed: Elapsed) -> u64 {
    (elapsed.dt_s * 1e9) as u64
}
