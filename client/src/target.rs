//! The joint target to send to the robot.

use shm_schema::JOINTS_MAX;

/// Origin of the correction in a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// The daemon's correction for this command.
    Corrected,
    /// The daemon's newest correction, computed for an earlier command.
    LastCorrection,
    /// Being ramped to the daemon's correction, or to zero because the daemon does not respond.
    Ramping,
    /// No correction, and no daemon that requests one: the target is the command.
    Plain,
}

/// A joint target, to be sent to the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    q: [f64; JOINTS_MAX],
    joints: usize,
    source: Source,
    feed_override: f64,
}

impl Target {
    pub(crate) fn new(q: &[f64], source: Source, feed_override: f64) -> Self {
        let joints = q.len().min(JOINTS_MAX);
        let mut all = [0.0; JOINTS_MAX];
        all[..joints].copy_from_slice(&q[..joints]);
        Self { q: all, joints, source, feed_override }
    }

    /// The joints, rad or m: as many as the command had, at most 16.
    #[must_use]
    pub fn joints(&self) -> &[f64] {
        &self.q[..self.joints]
    }

    /// Origin of its correction.
    #[must_use]
    pub fn source(&self) -> Source {
        self.source
    }

    /// Feed override that keeps the force under the cell's limit: fraction of the programmed feed, above 0 to 1. 1 in a cell without feed adaptation.
    #[must_use]
    pub fn feed_override(&self) -> f64 {
        self.feed_override
    }
}
