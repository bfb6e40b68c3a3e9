//! Whether a command may be believed: right count, finite, in range, in order, fresh.
//!
//! Promises: what another process wrote is a claim; a command that passes is safe to compute with, one that fails is named.
//! Never: a repair of a command.

use crate::outcome::Reason;
use crate::settings::Settings;
use physics::{Arm, JOINTS_MAX, Joints};

/// A commanded joint target, as it came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Names the run of the sender; another one starts anew.
    pub session: u64,
    /// Counts up within a session.
    pub seq: u64,
    /// When the target holds, ns, by the sender's clock; increases within a session.
    pub t_ns: u64,
    /// How long ago it was sent, ns.
    pub age_ns: u64,
    /// How many joints it holds.
    pub joints: usize,
    /// rad or m.
    pub q: Joints,
    /// Directions of approach (−1, 0, 1 each) where the sender knows them.
    pub direction: Option<Joints>,
    /// A pose at rest: no bound on rate and jerk. Believed only in lockstep.
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

/// How a command follows its forerunner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Follows {
    /// The first of a session, or after a jump in time: memory of the path starts anew.
    Anew,
    /// By this many ns.
    After(u64),
}

/// Remembers the last command that passed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Judge {
    last: Option<(u64, u64, u64)>,
}

/// A gap between commands beyond which a path is not one path, ns.
const GAP_NS: u64 = 1_000_000_000;

impl Judge {
    /// Judges a command; one that passes becomes the forerunner of the next.
    ///
    /// # Errors
    /// The reason why it does not pass.
    pub(crate) fn judge(
        &mut self,
        arm: &Arm,
        settings: &Settings,
        command: &Command,
    ) -> Result<Follows, Reason> {
        if command.joints != arm.count() {
            return Err(Reason::WrongJointCount);
        }
        if !command.q.iter().all(|q| q.is_finite()) {
            return Err(Reason::NotFinite);
        }
        if !arm.within_limits(&command.q) {
            return Err(Reason::OutOfLimits);
        }
        if !settings.lockstep && command.age_ns > settings.stale_ns {
            return Err(Reason::Stale);
        }
        let follows = self.order(command)?;
        self.last = Some((command.session, command.seq, command.t_ns));
        Ok(follows)
    }

    fn order(&self, command: &Command) -> Result<Follows, Reason> {
        let Some((session, seq, t_ns)) = self.last else { return Ok(Follows::Anew) };
        if session != command.session {
            return Ok(Follows::Anew);
        }
        if command.seq == seq {
            return Err(Reason::Duplicate);
        }
        if command.seq < seq || command.t_ns <= t_ns {
            return Err(Reason::OutOfOrder);
        }
        let gap_ns = command.t_ns - t_ns;
        Ok(if gap_ns > GAP_NS { Follows::Anew } else { Follows::After(gap_ns) })
    }
}
