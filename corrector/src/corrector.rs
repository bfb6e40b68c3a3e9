//! The cycle's state: what was commanded, what is remembered, what was published.
//!
//! Every change of what is wanted (start, stop, refused solution, new model, bypass) goes out through one mechanism: each joint's
//! [`Limiter`]. Never more than one bound step per call of [`Corrector::bound`], and never more time in it than has really passed.

use crate::direction::Directions;
use crate::judge::{Command, Follows, Judge};
use crate::outcome::{Gate, Outcome, Reason, Residual, Status};
use crate::settings::{Mode, Settings};
use crate::solve::{Solution, solve};
use crate::wrench::{World, WrenchPath};
use envelope::{Limiter, Limits};
use physics::{Arm, Chain, Inputs, JOINTS_MAX, Joints, Memories, Model, Wrench};

/// Share of the envelope's angle in limited mode.
const LIMITED_SHARE: f64 = 0.1;
/// The most time that one bound step may take, ns: after a pause the correction goes on as if it had been this short.
const STEP_NS_MAX: u64 = 20_000_000;

/// The correction of one robot.
#[derive(Clone, Debug)]
pub struct Corrector {
    settings: Settings,
    judge: Judge,
    memories: Memories,
    directions: Option<Directions>,
    wrench: WrenchPath,
    limiters: [Limiter; JOINTS_MAX],
    /// The last command that passed.
    inputs: Option<Inputs>,
    /// What the last good solution asked for.
    last_wanted: Joints,
    refused_ns: u64,
    /// Why the correction is not yet what is wanted; kept until it is.
    cause: Reason,
    bypassed: bool,
    /// Real time that bound steps may still use, ns.
    budget_ns: u64,
    last_now_ns: Option<u64>,
}

/// What a cycle wants to publish, before the bounds.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// The correction asked for, rad or m.
    correction: Joints,
    status: Status,
    reason: Reason,
    residual: Residual,
    steps: u32,
    gate: Gate,
    dt_ns: u64,
    settled: bool,
}

impl Corrector {
    /// A corrector at rest.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            judge: Judge::default(),
            memories: Memories::default(),
            directions: None,
            wrench: WrenchPath::new(),
            limiters: [Limiter::at_rest(); JOINTS_MAX],
            inputs: None,
            last_wanted: [0.0; JOINTS_MAX],
            refused_ns: 0,
            cause: Reason::Starting,
            bypassed: false,
            budget_ns: STEP_NS_MAX,
            last_now_ns: None,
        }
    }

    /// Takes the correction out (`true`) or lets it in again, ramped.
    pub fn set_bypass(&mut self, bypassed: bool) {
        if self.bypassed && !bypassed {
            self.cause = Reason::Bypass;
        }
        self.bypassed = bypassed;
    }

    /// Changes how much may be corrected, ramped.
    pub fn set_mode(&mut self, mode: Mode) {
        if mode != self.settings.mode {
            self.cause = Reason::Starting;
        }
        self.settings.mode = mode;
    }

    /// How much may be corrected now.
    pub fn mode(&self) -> Mode {
        self.settings.mode
    }

    /// Lets a wrench gate that closed for its loop gain try again.
    pub fn rearm_wrench(&mut self) {
        self.wrench.rearm();
    }

    /// Says that `model` replaces the one before. Its effects remember nothing yet: they settle from the present directions.
    pub fn model_changed(&mut self, model: &Model) {
        self.memories = Memories::default();
        if let Some(inputs) = &self.inputs {
            model.settle(inputs, &mut self.memories);
        }
        self.cause = Reason::ModelChanged;
    }

    /// What the model wants for this command. `now_ns` is the cycle's time (live `CLOCK_MONOTONIC`, in lockstep the command's).
    pub fn correct(
        &mut self,
        model: &Model,
        command: &Command,
        world: &World,
        now_ns: u64,
    ) -> Wanted {
        let elapsed_ns = self.elapse(now_ns);
        let follows = match self.judge.judge(&model.arm, &self.settings, command) {
            Ok(follows) => follows,
            Err(reason) => return self.refuse(Status::Rejected, reason, elapsed_ns),
        };
        let dt_ns = self.spend(match follows {
            Follows::Anew => self.settings.period_ns,
            Follows::After(dt_ns) => dt_ns,
        });
        let inputs = self.follow(model, command, world, follows, dt_ns);
        let (inputs, gate) = self.with_wrench(model, inputs, world, dt_ns);
        self.inputs = Some(inputs);
        let reach = self.reach();
        let solution = solve(model, &inputs, &self.memories, &self.settings.task, &reach);
        let settled = command.settled && self.settings.lockstep;
        self.wanted(&inputs, &solution, Wanted { gate, dt_ns, settled, ..Wanted::nothing(dt_ns) })
    }

    /// Bounds what is wanted and makes it the target.
    pub fn bound(&mut self, model: &Model, wanted: &Wanted) -> Outcome {
        let mut outcome = Outcome {
            wanted: wanted.correction,
            status: wanted.status,
            reason: wanted.reason,
            residual: wanted.residual,
            steps: wanted.steps,
            gate: wanted.gate,
            loop_gain: self.wrench.loop_gain(),
            ..Outcome::default()
        };
        let Some(inputs) = self.inputs else { return outcome };
        let goal = self.goal(wanted);
        let (bounded, follows) = self.step(model.arm.count(), &goal, wanted);
        let (q, correction, cut) = clamped(&model.arm, &inputs.q, &bounded);
        outcome.q = Some(q);
        outcome.correction = correction;
        for (i, limiter) in self.limiters.iter().enumerate() {
            outcome.correction_rate[i] = limiter.rate();
            outcome.correction_acceleration[i] = limiter.acceleration();
        }
        self.name(&mut outcome, follows, cut);
        outcome
    }

    /// Without a command: the correction ramps out. None once it is out, or before the first good command.
    pub fn idle(&mut self, model: &Model, now_ns: u64) -> Option<Outcome> {
        let elapsed_ns = self.elapse(now_ns);
        self.inputs?;
        if self.limiters.iter().all(|limiter| limiter.value() == 0.0 && limiter.is_following()) {
            return None;
        }
        let wanted = self.refuse(Status::Ramping, Reason::Stale, elapsed_ns);
        Some(self.bound(model, &wanted))
    }

    /// Counts the real time that has passed since the last call and returns it, at most one step's worth.
    fn elapse(&mut self, now_ns: u64) -> u64 {
        let since_ns =
            self.last_now_ns.map_or(self.settings.period_ns, |last| now_ns.saturating_sub(last));
        self.last_now_ns = Some(now_ns);
        self.budget_ns = (self.budget_ns + since_ns).min(STEP_NS_MAX);
        since_ns.min(STEP_NS_MAX)
    }

    /// Takes time for a bound step out of what has really passed.
    fn spend(&mut self, asked_ns: u64) -> u64 {
        let spent_ns = asked_ns.min(self.budget_ns);
        self.budget_ns -= spent_ns;
        spent_ns
    }

    /// Nothing new is wanted: whatever correction stands ramps out.
    fn refuse(&mut self, status: Status, reason: Reason, elapsed_ns: u64) -> Wanted {
        let dt_ns = self.spend(elapsed_ns);
        self.cause = reason;
        Wanted { status, reason, ..Wanted::nothing(dt_ns) }
    }

    /// Memory and directions follow the command, once.
    fn follow(
        &mut self,
        model: &Model,
        command: &Command,
        world: &World,
        follows: Follows,
        dt_ns: u64,
    ) -> Inputs {
        let mut inputs = Inputs::at_rest(command.q);
        inputs.ambient_celsius = world.ambient_celsius;
        inputs.joint_celsius = world.joint_celsius;
        inputs.spindle_rpm = world.spindle_rpm;
        let dt_s = seconds(dt_ns);
        let before = self.inputs.filter(|_| follows != Follows::Anew);
        if let Some(before) = before {
            inputs.q_before = before.q;
            inputs.dt_s = dt_s;
            inputs.time_s = before.time_s + dt_s;
        }
        let fresh = Directions::at(&command.q);
        let directions = match before {
            Some(_) => self.directions.get_or_insert(fresh),
            None => self.directions.insert(fresh),
        };
        directions.moved_to(&command.q, self.settings.reversal);
        inputs.direction = command.direction.unwrap_or(*directions.signs());
        if before.is_none() || command.settled {
            if before.is_none() {
                self.memories = Memories::default();
            }
            model.settle(&inputs, &mut self.memories);
        } else {
            model.follow(&inputs, &mut self.memories);
        }
        inputs
    }

    fn with_wrench(
        &mut self,
        model: &Model,
        mut inputs: Inputs,
        world: &World,
        dt_ns: u64,
    ) -> (Inputs, Gate) {
        let measured = world.wrench.map(|sample| {
            let axes = if sample.in_base {
                glam::DMat3::IDENTITY
            } else {
                Chain::nominal(&model.arm, &inputs.q).base_from_tool.rotation
            };
            let w = sample.wrench;
            (Wrench { force: axes * w.force, moment: axes * w.moment }, sample.age_ns)
        });
        let (wrench, gate) = self.wrench.step(&self.settings.wrench, measured, seconds(dt_ns));
        inputs.wrench_base = wrench;
        if self.settings.wrench.process_stiffness.is_some() && measured.is_some() {
            self.wrench.probe(model, &inputs, &self.memories);
        }
        (inputs, gate)
    }

    /// A refused solution holds the last good one for a while, then ramps out.
    fn wanted(&mut self, inputs: &Inputs, solution: &Solution, blank: Wanted) -> Wanted {
        let mut wanted = Wanted { residual: solution.residual, steps: solution.steps, ..blank };
        if solution.converged {
            self.refused_ns = 0;
            for (i, correction) in wanted.correction.iter_mut().enumerate() {
                *correction = solution.q[i] - inputs.q[i];
            }
            self.last_wanted = wanted.correction;
            return wanted;
        }
        self.cause = Reason::NotConverged;
        self.refused_ns = self.refused_ns.saturating_add(wanted.dt_ns);
        let holds = self.refused_ns <= self.settings.hold_ns;
        let status = if holds { Status::Held } else { Status::Ramping };
        let correction = if holds { self.last_wanted } else { wanted.correction };
        Wanted { correction, status, reason: Reason::NotConverged, ..wanted }
    }

    /// What the limiters are to reach.
    fn goal(&self, wanted: &Wanted) -> Joints {
        if self.bypassed || self.settings.mode == Mode::Shadow {
            [0.0; JOINTS_MAX]
        } else {
            wanted.correction
        }
    }

    /// One step of every joint's limiter; tells whether all are where they are wanted.
    fn step(&mut self, joints: usize, goal: &Joints, wanted: &Wanted) -> (Joints, bool) {
        let dt_s = seconds(wanted.dt_ns);
        let mut bounded = [0.0; JOINTS_MAX];
        let mut follows = true;
        for i in 0..joints {
            let limits = self.limits(i);
            let limiter = &mut self.limiters[i];
            bounded[i] = if wanted.settled {
                limiter.jump(goal[i].clamp(-limits.angle(), limits.angle()));
                limiter.value()
            } else {
                limiter.step(goal[i], &limits, dt_s)
            };
            follows &= bounded[i] == goal[i];
        }
        (bounded, follows)
    }

    /// Says how and why the target was made.
    fn name(&mut self, outcome: &mut Outcome, follows: bool, cut: bool) {
        let solved = outcome.status == Status::Corrected;
        if outcome.status == Status::Rejected {
            return;
        }
        if self.settings.mode == Mode::Shadow && follows {
            outcome.status = Status::Shadow;
            outcome.reason = if solved { Reason::ShadowMode } else { outcome.reason };
        } else if self.bypassed {
            outcome.status = if follows { Status::Bypassed } else { Status::Ramping };
            outcome.reason = Reason::Bypass;
        } else if solved && !follows {
            outcome.status = Status::Ramping;
            outcome.reason = if self.cause == Reason::None { Reason::Envelope } else { self.cause };
        } else if solved {
            self.cause = Reason::None;
            outcome.reason = if cut { Reason::JointLimit } else { Reason::None };
        }
    }

    fn limits(&self, i: usize) -> Limits {
        let full = self.settings.envelope[i];
        if self.settings.mode == Mode::Limited {
            Limits::new(full.angle() * LIMITED_SHARE, full.rate(), full.jerk()).unwrap_or(full)
        } else {
            full
        }
    }

    fn reach(&self) -> Joints {
        let mut reach = [0.0; JOINTS_MAX];
        for (reach, limits) in reach.iter_mut().zip(&self.settings.envelope) {
            *reach = limits.angle();
        }
        reach
    }
}

impl Wanted {
    fn nothing(dt_ns: u64) -> Self {
        Self {
            correction: [0.0; JOINTS_MAX],
            status: Status::Corrected,
            reason: Reason::None,
            residual: Residual::default(),
            steps: 0,
            gate: Gate::Absent,
            dt_ns,
            settled: false,
        }
    }
}

/// Safety last: inside the joint limits, whatever the correction. Tells whether a limit cut.
fn clamped(arm: &Arm, q_cmd: &Joints, correction: &Joints) -> (Joints, Joints, bool) {
    let (mut q, mut taken, mut cut) = (*q_cmd, [0.0; JOINTS_MAX], false);
    for (i, joint) in arm.joints().iter().enumerate() {
        let target = q_cmd[i] + correction[i];
        q[i] = target.clamp(joint.limits.0, joint.limits.1);
        cut |= q[i] != target;
        taken[i] = q[i] - q_cmd[i];
    }
    (q, taken, cut)
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}
