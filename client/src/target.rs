//! What is to be sent to the robot.

use shm_schema::JOINTS_MAX;

/// What the correction in a target is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// The daemon's, for this very command.
    Corrected,
    /// The daemon's newest, which it made for an earlier command.
    LastCorrection,
    /// On its way to what the daemon asks for, or to zero as the daemon is silent.
    Ramping,
    /// None, and no daemon that asks for any: the target is the command.
    Plain,
}

/// A joint target, to be sent to the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    q: [f64; JOINTS_MAX],
    joints: usize,
    source: Source,
}

impl Target {
    pub(crate) fn new(q: &[f64], source: Source) -> Self {
        let joints = q.len().min(JOINTS_MAX);
        let mut all = [0.0; JOINTS_MAX];
        all[..joints].copy_from_slice(&q[..joints]);
        Self { q: all, joints, source }
    }

    /// The joints, rad or m: as many as the command had, at most 16.
    #[must_use]
    pub fn joints(&self) -> &[f64] {
        &self.q[..self.joints]
    }

    /// What the correction in it is.
    #[must_use]
    pub fn source(&self) -> Source {
        self.source
    }
}
