//! The target sent to the robot: the command of the present cycle plus a limited correction.
//!
//! Continuity of the correction is ensured only here. The limiter starts from the last correction sent
//! and uses the time elapsed since (by the time stamps of the commands, while they agree with the clock), whatever the daemon requests and why: a fresh
//! answer, none, a rejection, a daemon that has just started, other limits, another model, bypass. No
//! clock, no IPC: time is an argument.
//!
//! The target is the command, bit for bit, while the correction is zero, and the command plus the
//! daemon's correction, bit for bit, once that has been reached.

use envelope::{Elapsed, Intervals, Limiters, Limits};
use shm_schema::{Command, Corrected, FeedBounds, JOINTS_MAX, JointBounds};

use crate::feed::FeedOutput;
use crate::{InvalidTarget, Source, Target};

/// Default age limit of a daemon's answer.
const FRESH_NS: u64 = 10_000_000;

/// Computes each target from the command and the newest answer.
#[derive(Debug)]
pub struct Output {
    limiters: Limiters<JOINTS_MAX>,
    /// `None` before the daemon has sent them: nothing is corrected then.
    limits: [Option<Limits>; JOINTS_MAX],
    intervals: Intervals,
    feed: FeedOutput,
    /// The last target sent.
    sent: Option<Target>,
    /// Age limit of a daemon's answer, ns.
    pub fresh_ns: u64,
}

impl Default for Output {
    fn default() -> Self {
        Self::new()
    }
}

impl Output {
    /// Before the first target.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            limiters: Limiters::at_rest(),
            limits: [None; JOINTS_MAX],
            intervals: Intervals::new(),
            feed: FeedOutput::new(),
            sent: None,
            fresh_ns: FRESH_NS,
        }
    }

    /// Adopts the daemon's limits; invalid ones are ignored and the last valid ones kept.
    pub fn set_bounds(&mut self, bounds: &JointBounds) {
        for (i, limits) in self.limits.iter_mut().enumerate() {
            let new = Limits::new(bounds.angle[i], bounds.rate[i], bounds.jerk[i]);
            *limits = new.ok().or(*limits);
        }
    }

    /// Adopts the daemon's bounds of the feed override, likewise.
    pub fn set_feed_bounds(&mut self, bounds: &FeedBounds) {
        self.feed.set_bounds(bounds);
    }

    /// The feed override continues from this one.
    pub fn start_feed(&mut self, feed_override: f64) {
        self.feed.start(feed_override);
    }

    /// The feed override that was returned last; 1 is the programmed feed.
    #[must_use]
    pub fn feed_override(&self) -> f64 {
        self.feed.value()
    }

    /// The robot begins a run at its command plus this correction; missing and non-finite values count as
    /// zero.
    pub fn start_from(&mut self, correction: &[f64]) {
        let value = |i: usize| correction.get(i).copied().unwrap_or(0.0);
        self.limiters = Limiters::from_motion(|i| (value(i), 0.0, 0.0));
        self.intervals = Intervals::new();
    }

    /// The correction that was sent last, rad or m.
    #[must_use]
    pub fn correction(&self) -> [f64; JOINTS_MAX] {
        std::array::from_fn(|i| self.limiters.joints()[i].value())
    }

    /// The last target sent.
    #[must_use]
    pub fn sent(&self) -> Option<Target> {
        self.sent
    }

    /// The target for `q_cmd` at `now_ns`, given the newest answer and the command sent to the daemon last.
    ///
    /// # Errors
    /// [`InvalidTarget`] if `q_cmd` is not 1 to 16 finite numbers; the state is then unchanged.
    pub fn target(
        &mut self,
        q_cmd: &[f64],
        newest: Option<&Corrected>,
        command: Option<&Command>,
        now_ns: u64,
    ) -> Result<Target, InvalidTarget> {
        InvalidTarget::check(q_cmd)?;
        let answer = newest.filter(|answer| self.is_usable(answer, q_cmd.len(), now_ns));
        let requested = answer.map_or([0.0; JOINTS_MAX], |answer| answer.correction);
        let elapsed = self.elapse(now_ns, command.map(|command| command.t_ns));
        let limits = |i: usize| self.limits[i];
        let correction = match answer {
            // The daemon already coordinates its joints along a line; each joint tracks it on its own.
            Some(_) => self.limiters.step_independently(&requested, limits, elapsed),
            None => self.limiters.step(&requested, limits, elapsed),
        };

        let mut q = [0.0; JOINTS_MAX];
        for (q, (q_cmd, correction)) in q.iter_mut().zip(q_cmd.iter().zip(correction)) {
            // Without a correction the target is bitwise equal, including the sign of a zero.
            *q = if correction == 0.0 { *q_cmd } else { q_cmd + correction };
        }
        let is_reached = correction[..q_cmd.len()] == requested[..q_cmd.len()];
        let source = match answer {
            _ if !is_reached => Source::Ramping,
            None => Source::Plain,
            Some(answer) if command.is_some_and(|command| is_answer_to(answer, command, q_cmd)) => {
                Source::Corrected
            }
            Some(_) => Source::LastCorrection,
        };
        let requested = answer.map(|answer| answer.feed_override);
        let feed_override = self.feed.step(requested, now_ns, elapsed.dt_s);
        let target = Target::new(&q[..q_cmd.len()], source, feed_override);
        self.sent = Some(target);
        Ok(target)
    }

    /// The time since the last target. After a silence the robot has stopped, and the correction is constant.
    fn elapse(&mut self, now_ns: u64, stamp_ns: Option<u64>) -> Elapsed {
        self.intervals.elapse(now_ns, stamp_ns).unwrap_or_else(|| {
            self.limiters.rest();
            Elapsed::default()
        })
    }

    /// Whether the answer is fresh and has this number of joints. It was written by another process and may contain NaN.
    fn is_usable(&self, answer: &Corrected, joints: usize, now_ns: u64) -> bool {
        answer.joints as usize == joints
            && now_ns.saturating_sub(answer.made_ns) <= self.fresh_ns
            && answer.correction().iter().all(|correction| correction.is_finite())
    }
}

/// Whether the answer belongs to this command, and the command commands these joints.
fn is_answer_to(answer: &Corrected, command: &Command, q_cmd: &[f64]) -> bool {
    (answer.command_session, answer.command_seq) == (command.session, command.seq)
        && command.joints() == q_cmd
}

#[cfg(test)]
mod tests;
