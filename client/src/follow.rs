//! How a correction lives on the robot's side: followed while fresh, ramped out when silent, blended
//! in again when contact returns.
//!
//! Promise: between two answers the correction never steps, by the daemon's own envelope; while the
//! daemon is there, what it says is put out bit for bit. No clock, no IPC: time comes in.

use envelope::{Limiters, Limits};
use shm_schema::{Command, Corrected, CorrectionStatus, JOINTS_MAX, JointBounds};

use crate::{Source, Target};

/// A daemon's answer counts this long, unless told otherwise.
pub(crate) const FRESH_NS: u64 = 10_000_000;
/// A correction that stays this near (rad or m) for so many answers is taken as caught up with: one
/// that moves, stamped with jitter, is never met exactly, and jumps no less itself.
const NEAR: f64 = 1e-6;
const NEAR_ANSWERS: u32 = 50;
/// Rounding of a sum and a difference, relative.
const ROUNDING: f64 = 1e-12;
/// Longest time that one step of a ramp may cover.
const STEP_S_MAX: f64 = 0.1;
/// Real time, s, that steps towards a daemon that is back may save up: its clock and this one jitter apart by less.
const SAVED_S_MAX: f64 = 0.02;
/// By how much the commands' clock may part from the real one between two targets, ns: beyond, it was set.
const PARTED_NS_MAX: i64 = 20_000_000;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    Plain,
    Following,
    Ramping,
    Blending,
}

/// The correction as it is put out, joint by joint.
#[derive(Debug)]
pub struct Follower {
    stage: Stage,
    correction: [f64; JOINTS_MAX],
    limiters: Limiters<JOINTS_MAX>,
    limits: [Option<Limits>; JOINTS_MAX],
    range: [(f64, f64); JOINTS_MAX],
    /// The answer used last.
    used: Option<Corrected>,
    last_ns: Option<u64>,
    /// Time of the command sent last, by its own clock.
    sent_t_ns: Option<u64>,
    /// Time that has passed since without another command, ns: it is counted, and no command brings it again.
    unsent_ns: u64,
    /// By how much the real clock has run ahead of the commands'; below zero: behind them.
    ahead_ns: i64,
    /// Real time that no step has used yet, s.
    saved_s: f64,
    /// Answers in a row that the blended correction was near to.
    near_answers: u32,
    /// A daemon's answer counts this long.
    pub fresh_ns: u64,
}

impl Default for Follower {
    fn default() -> Self {
        Self::new()
    }
}

impl Follower {
    /// One that has heard nothing yet.
    #[must_use]
    pub fn new() -> Self {
        Self {
            stage: Stage::Plain,
            correction: [0.0; JOINTS_MAX],
            limiters: Limiters::at_rest(),
            limits: [None; JOINTS_MAX],
            range: [(f64::NEG_INFINITY, f64::INFINITY); JOINTS_MAX],
            used: None,
            last_ns: None,
            sent_t_ns: None,
            unsent_ns: 0,
            ahead_ns: 0,
            saved_s: SAVED_S_MAX,
            near_answers: 0,
            fresh_ns: FRESH_NS,
        }
    }

    /// Takes over the daemon's bounds; what makes no sense among them is left as it was.
    pub fn set_bounds(&mut self, bounds: &JointBounds) {
        for i in 0..JOINTS_MAX {
            if let Ok(limits) = Limits::new(bounds.angle[i], bounds.rate[i], bounds.jerk[i]) {
                self.limits[i] = Some(limits);
            }
            if bounds.min[i] < bounds.max[i] {
                self.range[i] = (bounds.min[i], bounds.max[i]);
            }
        }
    }

    /// The target for `q_cmd` at `now_ns`, given the newest answer and the command sent last.
    pub fn target(
        &mut self,
        q_cmd: &[f64],
        newest: Option<&Corrected>,
        sent: Option<&Command>,
        now_ns: u64,
    ) -> Target {
        let (dt_s, ramp_s) = self.elapse(now_ns, sent);
        let joints = q_cmd.len().min(JOINTS_MAX);
        let fresh = newest.filter(|answer| self.is_usable(answer, joints, now_ns));
        match fresh {
            Some(answer) => self.hear(answer, dt_s.min(STEP_S_MAX)),
            None => self.miss(ramp_s.min(STEP_S_MAX)),
        }
        let Some(answer) = fresh.filter(|_| self.stage == Stage::Following) else {
            return self.moved(q_cmd, self.source());
        };
        if answer.status == CorrectionStatus::Rejected.code() {
            return Target::new(answer.joints(), Source::Rejected);
        }
        match sent {
            Some(command)
                if answers(answer, command)
                    && command.joints() == q_cmd
                    && is_of(answer, q_cmd) =>
            {
                Target::new(answer.joints(), Source::Corrected)
            }
            _ => self.moved(q_cmd, Source::LastCorrection),
        }
    }

    /// Another epoch was joined: its correction starts anew, however soon it speaks.
    pub fn rejoined(&mut self) {
        if self.stage == Stage::Following {
            self.take_over();
            self.stage = Stage::Blending;
        }
    }

    /// Time since the target before, s: the real one, or the commands' own where that is longer (their clock does not jitter).
    /// Second, for a ramp: the commands' clock counts only as far as the real one has not passed that time already, so that a
    /// pause in sending, or a command stamped well before its target, moves nothing twice. A clock that was set counts for nothing.
    fn elapse(&mut self, now_ns: u64, sent: Option<&Command>) -> (f64, f64) {
        let since = |last: Option<u64>, now: u64| last.map_or(0, |last| now.saturating_sub(last));
        let real_ns = since(self.last_ns, now_ns);
        self.last_ns = Some(now_ns.max(self.last_ns.unwrap_or(0)));
        self.saved_s = (self.saved_s + real_ns as f64 * 1e-9).min(SAVED_S_MAX);
        let t_ns = sent.map(|sent| sent.t_ns);
        let mut commanded_ns = t_ns.map_or(0, |t_ns| since(self.sent_t_ns, t_ns));
        if t_ns.is_some() && t_ns == self.sent_t_ns {
            self.unsent_ns = self.unsent_ns.saturating_add(real_ns);
            commanded_ns = real_ns;
        } else if self.unsent_ns > 0 {
            // The command that comes after brings no more than has really passed: nobody saw when the missing one was due.
            commanded_ns =
                commanded_ns.saturating_sub(std::mem::take(&mut self.unsent_ns)).min(real_ns);
        }
        self.sent_t_ns = t_ns;
        let most_ns = real_ns.saturating_add(PARTED_NS_MAX.unsigned_abs());
        let parts = |commanded_ns: u64| {
            let signed = |ns: u64| i64::try_from(ns).unwrap_or(i64::MAX);
            self.ahead_ns.saturating_add(signed(real_ns)).saturating_sub(signed(commanded_ns))
        };
        if parts(commanded_ns) < -PARTED_NS_MAX {
            commanded_ns = real_ns;
        }
        // Whichever clock is further on counts, from where the further one was before.
        let (before_ns, ahead_ns) = (self.ahead_ns, parts(commanded_ns));
        let past_ns = ahead_ns.max(0).saturating_sub(before_ns.max(0));
        let ramp_ns = past_ns.saturating_add_unsigned(commanded_ns);
        self.ahead_ns = ahead_ns;
        (real_ns.max(commanded_ns.min(most_ns)) as f64 * 1e-9, ramp_ns as f64 * 1e-9)
    }

    fn source(&self) -> Source {
        match self.stage {
            Stage::Plain => Source::Plain,
            Stage::Ramping => Source::Ramping,
            Stage::Following => Source::LastCorrection,
            Stage::Blending => Source::Blending,
        }
    }

    /// The command with the correction as it stands, within the joint limits if the command is.
    fn moved(&self, q_cmd: &[f64], source: Source) -> Target {
        let mut q = [0.0; JOINTS_MAX];
        let joints = q_cmd.len().min(JOINTS_MAX);
        for i in 0..joints {
            let (min, max) = self.range[i];
            let moved = q_cmd[i] + self.correction[i];
            q[i] = if (min..=max).contains(&q_cmd[i]) { moved.clamp(min, max) } else { moved };
        }
        Target::new(&q[..joints], source)
    }

    fn is_usable(&self, answer: &Corrected, joints: usize, now_ns: u64) -> bool {
        let finite = |values: &[f64; JOINTS_MAX]| values[..joints].iter().all(|v| v.is_finite());
        answer.joints as usize == joints
            && now_ns.saturating_sub(answer.made_ns) <= self.fresh_ns
            && finite(&answer.q)
            && finite(&answer.correction)
    }

    /// The daemon speaks: follow it exactly, or go on towards it.
    fn hear(&mut self, answer: &Corrected, dt_s: f64) {
        if self.used.is_some_and(|used| (used.seq, used.made_ns) == (answer.seq, answer.made_ns))
            && self.stage != Stage::Ramping
        {
            return;
        }
        if self.stage == Stage::Following && self.is_near(answer, dt_s) {
            self.correction = answer.correction;
        } else {
            if self.stage == Stage::Following {
                self.take_over();
            }
            self.blend(answer, dt_s);
        }
        self.used = Some(*answer);
    }

    /// Whether the daemon's correction is where its rate lets it be after `dt_s`. It is further where answers were missed meanwhile.
    fn is_near(&self, answer: &Corrected, dt_s: f64) -> bool {
        let reach = |i: usize| self.limits[i].map_or(f64::INFINITY, |limits| limits.rate() * dt_s);
        (0..answer.joints as usize).all(|i| {
            let moved = (answer.correction[i] - self.correction[i]).abs();
            moved <= reach(i) * (1.0 + 1e-6) + 1e-12
        })
    }

    /// One step towards the daemon's correction, in the daemon's time, as the client's own jitter
    /// would look like jerk.
    fn blend(&mut self, answer: &Corrected, dt_s: f64) {
        let daemon_dt_s = match self.used {
            Some(used) if self.stage == Stage::Blending => {
                answer.made_ns.saturating_sub(used.made_ns) as f64 * 1e-9
            }
            _ => dt_s,
        };
        self.stage = Stage::Blending;
        self.step(&answer.correction, daemon_dt_s.min(dt_s).min(self.saved_s));
        let joints = answer.joints as usize;
        let (mine, its) = (&self.correction[..joints], &answer.correction[..joints]);
        let is_near = mine.iter().zip(its).all(|(a, b)| (a - b).abs() <= NEAR);
        self.near_answers = if is_near { self.near_answers + 1 } else { 0 };
        if mine == its || self.near_answers > NEAR_ANSWERS {
            self.near_answers = 0;
            self.correction = answer.correction;
            self.stage = Stage::Following;
        }
    }

    /// The daemon is silent: ramp out.
    fn miss(&mut self, dt_s: f64) {
        if self.stage == Stage::Following {
            self.take_over();
        }
        if self.stage != Stage::Plain {
            self.stage = Stage::Ramping;
            self.step(&[0.0; JOINTS_MAX], dt_s);
            if self.correction == [0.0; JOINTS_MAX] {
                self.stage = Stage::Plain;
                self.limiters = Limiters::at_rest();
            }
        }
    }

    /// The limiters go on from the motion that the daemon had last.
    fn take_over(&mut self) {
        let Some(used) = self.used else { return };
        let motion = |i: usize| {
            (self.correction[i], used.correction_rate[i], used.correction_acceleration[i])
        };
        self.limiters = Limiters::from_motion(motion);
    }

    /// Without bounds from the daemon there has been no correction to move.
    fn step(&mut self, wanted: &[f64; JOINTS_MAX], dt_s: f64) {
        self.saved_s = (self.saved_s - dt_s).max(0.0);
        self.correction = self.limiters.step(wanted, |i| self.limits[i], dt_s);
    }
}

/// Whether the answer is for that command.
pub(crate) fn answers(answer: &Corrected, command: &Command) -> bool {
    (answer.command_session, answer.command_seq) == (command.session, command.seq)
}

/// Whether the answer was made of this very target: what lies in shared memory may have been written over.
fn is_of(answer: &Corrected, q_cmd: &[f64]) -> bool {
    let off = |i: usize| (answer.q[i] - answer.correction[i] - q_cmd[i]).abs();
    (0..q_cmd.len()).all(|i| off(i) <= ROUNDING * (1.0 + q_cmd[i].abs()))
}

#[cfg(test)]
mod tests;
