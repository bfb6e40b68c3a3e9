//! What the robot's side is to publish.

use shm_schema::JOINTS_MAX;

/// Where a target comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// The daemon, for this very command.
    Corrected,
    /// This command with the daemon's newest correction, which it made for an earlier command.
    LastCorrection,
    /// The daemon refused the command: its last good target.
    Rejected,
    /// This command with a correction on its way to the daemon's, after contact came back.
    Blending,
    /// This command with a correction on its way to zero, as the daemon is silent.
    Ramping,
    /// This command, as if there were no daemon.
    Plain,
}

/// A joint target that may be published.
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

    /// Where it comes from.
    #[must_use]
    pub fn source(&self) -> Source {
        self.source
    }
}
