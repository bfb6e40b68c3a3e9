//! Validation of a command: count, finite values, range, order, age.
//!
//! A command that passes is safe to compute with; one that fails gets a reason. Commands are never
//! modified.

use crate::outcome::Reason;
use crate::settings::Settings;
use physics::{Arm, JOINTS_MAX, Joints};

/// A commanded joint target, as received.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Identifies the run of the sender; the path history is reset when it changes.
    pub session: u64,
    /// Increases within a session.
    pub seq: u64,
    /// When the target holds, ns, by the sender's clock; increases within a session, unless that clock is set.
    pub t_ns: u64,
    /// How long ago it was sent, ns.
    pub age_ns: u64,
    /// Number of joints.
    pub joints: usize,
    /// rad or m.
    pub q: Joints,
    /// Directions of approach (−1, 0, 1 each) where the sender knows them.
    pub direction: Option<Joints>,
    /// A pose at rest: no limits on rate and jerk. Used in lockstep only.
    pub settled: bool,
}

impl Command {
    /// A fresh command of one run.
    pub fn new(seq: u64, t_ns: u64, q: &[f64]) -> Self {
        let mut all = [0.0; JOINTS_MAX];
        for (slot, value) in all.iter_mut().zip(q) {
            *slot = *value;
        }
        let joints = q.len();
        Self { session: 1, seq, t_ns, age_ns: 0, joints, q: all, direction: None, settled: false }
    }
}

/// How a command continues the previous one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Continuity {
    /// The first of a session: memory of the path is reset.
    NewSession,
    /// The clock of the commands was set: it advanced by more than the elapsed time, or went far back; memory of the path is reset.
    TimeJump,
    /// A joint moved faster than its speed limit allows; memory of the path is reset.
    CommandJump,
    /// After this many ns.
    After(u64),
}

impl Continuity {
    pub(crate) fn interval_ns(self) -> Option<u64> {
        if let Self::After(dt_ns) = self { Some(dt_ns) } else { None }
    }
}

/// Remembers the last command that passed.
#[derive(Clone, Copy, Debug, Default)]
pub struct CommandValidator {
    last: Option<AcceptedCommand>,
}

#[derive(Clone, Copy, Debug)]
struct AcceptedCommand {
    session: u64,
    seq: u64,
    t_ns: u64,
    now_ns: u64,
    q: Joints,
}

/// Largest difference between the commands' time and the cycle's from one command to the next, ns.
const TIME_JUMP_NS: u64 = 1_000_000_000;

impl CommandValidator {
    /// Validates a command received at `now_ns`; a valid one becomes the predecessor of the next.
    ///
    /// # Errors
    /// Why it is invalid.
    pub(crate) fn validate(
        &mut self,
        arm: &Arm,
        settings: &Settings,
        command: &Command,
        now_ns: u64,
    ) -> Result<Continuity, Reason> {
        if command.joints != arm.count() {
            return Err(Reason::WrongJointCount);
        }
        let directions = command.direction.unwrap_or_default();
        if !command.q.iter().chain(&directions).all(|x| x.is_finite()) {
            return Err(Reason::NotFinite);
        }
        if !arm.within_limits(&command.q) || directions.iter().any(|d| d.abs() > 1.0) {
            return Err(Reason::OutOfLimits);
        }
        if !settings.lockstep && command.age_ns > settings.stale_ns {
            return Err(Reason::Stale);
        }
        let mut continuity = self.check_order(command, now_ns)?;
        if let (Continuity::After(dt_ns), Some(last)) = (continuity, &self.last)
            && !(command.settled && settings.lockstep)
            && is_jump(arm, settings, &last.q, &command.q, dt_ns)
        {
            continuity = Continuity::CommandJump;
        }
        let Command { session, seq, t_ns, q, .. } = *command;
        self.last = Some(AcceptedCommand { session, seq, t_ns, now_ns, q });
        Ok(continuity)
    }

    fn check_order(&self, command: &Command, now_ns: u64) -> Result<Continuity, Reason> {
        let Some(last) = self.last.filter(|last| last.session == command.session) else {
            return Ok(Continuity::NewSession);
        };
        if command.seq == last.seq {
            return Err(Reason::Duplicate);
        }
        let Some(dt_ns) = command.t_ns.checked_sub(last.t_ns).filter(|dt_ns| *dt_ns > 0) else {
            // A later number far back in time: the clock was set. A smaller step back resolves
            // itself while commands are refused.
            let was_set = command.seq > last.seq && last.t_ns - command.t_ns > TIME_JUMP_NS;
            return if was_set { Ok(Continuity::TimeJump) } else { Err(Reason::OutOfOrder) };
        };
        if command.seq < last.seq {
            return Err(Reason::OutOfOrder);
        }
        let passed_ns = now_ns.saturating_sub(last.now_ns);
        let jumped = dt_ns > passed_ns.saturating_add(TIME_JUMP_NS);
        Ok(if jumped { Continuity::TimeJump } else { Continuity::After(dt_ns) })
    }
}

/// Whether a joint moved faster than its stated speed allows, with the margin of the settings.
fn is_jump(arm: &Arm, settings: &Settings, from: &Joints, to: &Joints, dt_ns: u64) -> bool {
    // Stamps closer than a cycle give no reliable speed.
    let dt_s = dt_ns.max(settings.period_ns) as f64 * 1e-9;
    arm.joints()
        .iter()
        .enumerate()
        .any(|(i, joint)| (to[i] - from[i]).abs() > settings.jump_margin * joint.max_speed * dt_s)
}

#[cfg(test)]
mod tests;
