//! The cycle's state: what was commanded, what is remembered, what was published.
//!
//! Every change of what is wanted (start, stop, refused solution, new model, bypass) goes out through one mechanism: each joint's
//! [`Limiter`]. Never more than one bound step per call of [`Corrector::bound`], and never more time in it than has really passed.

use crate::judge::{Command, Follows, Judge};
use crate::outcome::{Gate, Outcome, Reason, Residual, Status};
use crate::path::Path;
use crate::settings::{Mode, Settings};
use crate::solve::{Solution, Solver};
use crate::world::World;
use crate::wrench::WrenchPath;
use envelope::{Limiter, Limiters};
use physics::{Arm, Chain, JOINTS_MAX, Joints, Model, Wrench};

/// The most time that one bound step may take, ns: after a pause the correction goes on as if it had been this short.
const STEP_NS_MAX: u64 = 20_000_000;
/// Of a longer pause so much stays for later, ns: a command that is less long on its way than those before finds all of its time, or what it brings
/// would look like a jerk.
const SPARE_NS: u64 = 5_000_000;

/// The correction of one robot.
#[derive(Clone, Debug)]
pub struct Corrector {
    settings: Settings,
    judge: Judge,
    path: Path,
    wrench: WrenchPath,
    solver: Solver,
    limiters: Limiters<JOINTS_MAX>,
    /// What the last good solution asked for.
    last_wanted: Joints,
    refused_ns: u64,
    /// Why the correction is not yet what is wanted; kept until it is.
    cause: Reason,
    bypassed: bool,
    /// Real time that bound steps may still use, ns.
    budget_ns: u64,
    /// What passed in calls without a good command since the last one, ns.
    ahead_ns: u64,
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
            path: Path::new(),
            wrench: WrenchPath::new(),
            solver: Solver::default(),
            limiters: Limiters::at_rest(),
            last_wanted: [0.0; JOINTS_MAX],
            refused_ns: 0,
            cause: Reason::Starting,
            bypassed: false,
            budget_ns: STEP_NS_MAX + SPARE_NS,
            ahead_ns: 0,
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
        self.path.settle_anew(model);
        self.solver = Solver::default();
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
        let follows = match self.judge.judge(&model.arm, &self.settings, command, now_ns) {
            Ok(follows) => follows,
            Err(reason) => return self.refuse(reason, elapsed_ns),
        };
        let asked_ns = match follows {
            Follows::After(dt_ns) => dt_ns,
            Follows::Anew => self.settings.period_ns,
            Follows::TimeJump => {
                self.cause = Reason::TimeJump;
                self.settings.period_ns
            }
        };
        let dt_ns = self.spend(asked_ns.saturating_sub(self.ahead_ns));
        self.ahead_ns = 0;
        let world = world.sound();
        self.path.follow(model, &self.settings, command, &world, follows);
        let settled = command.settled && self.settings.lockstep;
        let gate = self.take_wrench(model, &world, (dt_ns, settled));
        // Poses at rest do not lead to each other.
        if settled || follows.after_ns().is_none() {
            self.solver.forget();
        }
        let blank = Wanted { gate, dt_ns, settled, ..Wanted::nothing(dt_ns) };
        let (task, reach) = (&self.settings.task, self.reach());
        // Followed just now: there is a last command.
        let Some(inputs) = self.path.last() else { return blank };
        let solution = self.solver.track(model, inputs, self.path.memories(), task, &reach);
        let q_cmd = inputs.q;
        self.wanted(&q_cmd, &solution, blank)
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
        let Some(q_cmd) = self.path.last().map(|inputs| inputs.q) else { return outcome };
        let goal = self.goal(wanted);
        let (bounded, reached) = self.step(model.arm.count(), &goal, wanted);
        let (q, correction, cut) = clamped(&model.arm, &q_cmd, &bounded);
        outcome.q = Some(q);
        outcome.correction = correction;
        for (i, limiter) in self.limiters.joints()[..model.arm.count()].iter().enumerate() {
            outcome.correction_rate[i] = limiter.rate();
            outcome.correction_acceleration[i] = limiter.acceleration();
        }
        self.name(&mut outcome, reached, cut);
        outcome
    }

    /// What later cycles need and this one's target does not: to be called once that is out. The gate of a wrench in a contact of known stiffness
    /// stays closed without it.
    pub fn prepare(&mut self, model: &Model) {
        let Some(inputs) = self.path.last() else { return };
        if self.settings.wrench.enabled && self.settings.wrench.process_stiffness.is_some() {
            self.wrench.probe(model, inputs, self.path.memories(), self.solver.room());
        }
    }

    /// Without a command: the correction ramps out. None once it is out, or before the first good command.
    pub fn idle(&mut self, model: &Model, now_ns: u64) -> Option<Outcome> {
        let elapsed_ns = self.elapse(now_ns);
        self.path.last()?;
        let out = |limiter: &Limiter| limiter.value() == 0.0 && limiter.is_following();
        let dt_ns = self.move_on(elapsed_ns);
        if self.limiters.joints()[..model.arm.count()].iter().all(out) {
            return None;
        }
        self.cause = Reason::Stale;
        let wanted =
            Wanted { status: Status::Ramping, reason: Reason::Stale, ..Wanted::nothing(dt_ns) };
        Some(self.bound(model, &wanted))
    }

    /// Counts the real time that has passed since the last call and returns it.
    fn elapse(&mut self, now_ns: u64) -> u64 {
        let since_ns =
            self.last_now_ns.map_or(self.settings.period_ns, |last| now_ns.saturating_sub(last));
        self.last_now_ns = Some(now_ns);
        self.budget_ns = self.budget_ns.saturating_add(since_ns).min(STEP_NS_MAX + SPARE_NS);
        since_ns
    }

    /// Takes time for a bound step out of what has really passed.
    fn spend(&mut self, asked_ns: u64) -> u64 {
        let spent_ns = asked_ns.min(STEP_NS_MAX).min(self.budget_ns);
        self.budget_ns -= spent_ns;
        spent_ns
    }

    /// Takes time for a bound step without a command; the next command shall not take it again.
    fn move_on(&mut self, elapsed_ns: u64) -> u64 {
        self.ahead_ns = self.ahead_ns.saturating_add(elapsed_ns);
        self.spend(elapsed_ns)
    }

    /// A refused command: the last good correction holds for a while, then ramps out.
    fn refuse(&mut self, reason: Reason, elapsed_ns: u64) -> Wanted {
        let dt_ns = self.move_on(elapsed_ns);
        self.cause = reason;
        self.refused_ns = self.refused_ns.saturating_add(elapsed_ns);
        let blank = Wanted::nothing(dt_ns);
        let correction = if self.holds() { self.last_wanted } else { blank.correction };
        Wanted { correction, status: Status::Rejected, reason, ..blank }
    }

    /// Whether what was refused is recent enough to hold the last good correction.
    fn holds(&self) -> bool {
        self.refused_ns <= self.settings.hold_ns
    }

    /// Takes the measured wrench to the last command, as far as its gate lets it; what the gate says.
    fn take_wrench(&mut self, model: &Model, world: &World, (dt_ns, settled): (u64, bool)) -> Gate {
        let q_cmd = self.path.last().map(|inputs| &inputs.q);
        let measured = world.wrench.zip(q_cmd).map(|(sample, q_cmd)| {
            let w = sample.wrench;
            let in_base = if sample.in_base {
                w
            } else {
                let axes = Chain::tool_at(&model.arm, q_cmd).rotation;
                Wrench { force: axes * w.force, moment: axes * w.moment }
            };
            (in_base, sample.age_ns)
        });
        let (wrench, gate) = if settled {
            self.wrench.settled(&self.settings.wrench, measured)
        } else {
            self.wrench.step(&self.settings.wrench, measured, seconds(dt_ns))
        };
        self.path.load(wrench);
        gate
    }

    /// A refused solution holds the last good one for a while, then ramps out; at a pose at rest it is out already.
    fn wanted(&mut self, q_cmd: &Joints, solution: &Solution, blank: Wanted) -> Wanted {
        let mut wanted = Wanted { residual: solution.residual, steps: solution.steps, ..blank };
        if solution.converged || solution.limited.is_some() {
            if let Some(reason) = solution.limited {
                (wanted.status, wanted.reason) = (Status::Limited, reason);
            }
            self.refused_ns = 0;
            for (i, correction) in wanted.correction.iter_mut().enumerate() {
                *correction = solution.q[i] - q_cmd[i];
            }
            self.last_wanted = wanted.correction;
            return wanted;
        }
        self.cause = Reason::NotConverged;
        self.refused_ns = self.refused_ns.saturating_add(wanted.dt_ns);
        let (status, correction) = if self.holds() && !wanted.settled {
            (Status::Held, self.last_wanted)
        } else {
            (Status::Ramping, wanted.correction)
        };
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

    /// One step of the joints' limiters, and how far they got.
    fn step(&mut self, joints: usize, goal: &Joints, wanted: &Wanted) -> (Joints, Reached) {
        let mut allowed = [0.0; JOINTS_MAX];
        for (i, allowed) in allowed[..joints].iter_mut().enumerate() {
            let angle = self.settings.limits(i).angle();
            *allowed = goal[i].clamp(-angle, angle);
        }
        let bounded = if wanted.settled {
            self.limiters.jump(&allowed)
        } else {
            let limits = |i| (i < joints).then(|| self.settings.limits(i));
            self.limiters.step(&allowed, limits, seconds(wanted.dt_ns))
        };
        let reached = if bounded != allowed {
            Reached::NotYet
        } else if allowed[..joints] != goal[..joints] {
            Reached::Bound
        } else {
            Reached::Goal
        };
        (bounded, reached)
    }

    /// Says how and why the target was made.
    fn name(&mut self, outcome: &mut Outcome, reached: Reached, cut: bool) {
        let limited = outcome.status == Status::Limited;
        let solved = limited || outcome.status == Status::Corrected;
        let arrived = reached != Reached::NotYet;
        if outcome.status == Status::Rejected {
            return;
        }
        if self.bypassed {
            outcome.status = if arrived { Status::Bypassed } else { Status::Ramping };
            outcome.reason = Reason::Bypass;
        } else if self.settings.mode == Mode::Shadow && arrived {
            outcome.status = Status::Shadow;
            outcome.reason = if solved && !limited { Reason::ShadowMode } else { outcome.reason };
        } else if solved && !arrived {
            outcome.status = Status::Ramping;
            outcome.reason = if self.cause == Reason::None { Reason::Envelope } else { self.cause };
        } else if solved {
            self.cause = Reason::None;
            outcome.reason = match reached {
                _ if limited => outcome.reason,
                _ if cut => Reason::JointLimit,
                Reached::Bound => Reason::Envelope,
                _ => Reason::None,
            };
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

/// How far the limiters got.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reached {
    Goal,
    /// The envelope's angle, short of the goal.
    Bound,
    NotYet,
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
