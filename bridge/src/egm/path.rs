//! Path correction: the component of the daemon's correction perpendicular to the path, at the controller's slower rate.

use physics::Arm;
use trued_client::JOINTS_MAX;

use super::messages::{Header, PATH_CORRECTION};
use crate::displacement::{PathFrame, tool_poses};

/// A correction may be early by this fraction of its period, because the controller's cycles
/// jitter.
const EARLY_SHARE: u64 = 8;

/// The path of one run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Path {
    frame: PathFrame,
    period_ns: u64,
    sent_ns: Option<u64>,
    seqno: u32,
}

impl Path {
    /// Age of the correction for the newest feedback at its arrival, ms; zero would mean no age.
    pub(super) const AGE_MS: u32 = 1;

    pub(super) fn new(period_ns: u64) -> Self {
        Self { frame: PathFrame::default(), period_ns, sent_ns: None, seqno: 0 }
    }

    /// Whether another may be sent at `now_ns`; if so, it counts as sent.
    pub(super) fn is_due(&mut self, now_ns: u64) -> bool {
        let least_ns = self.period_ns - self.period_ns / EARLY_SHARE;
        let is_due = self.sent_ns.is_none_or(|sent| now_ns.saturating_sub(sent) >= least_ns);
        if is_due {
            self.sent_ns = Some(now_ns);
        }
        is_due
    }

    /// The next header of the bridge's own messages.
    pub(super) fn header(&mut self, tm: Option<u32>) -> Header {
        let header = Header { seqno: Some(self.seqno), tm, mtype: Some(PATH_CORRECTION) };
        self.seqno = self.seqno.wrapping_add(1);
        header
    }

    /// Component of `correction`, rad, across the path at `q`, rad: y and z, mm.
    pub(super) fn across_mm(
        &mut self,
        arm: &Arm,
        q: &[f64],
        correction: &[f64; JOINTS_MAX],
    ) -> (f64, f64) {
        let (before, after) = tool_poses(arm, q, correction);
        self.frame.advance(&before);
        let (y, z) = self.frame.across(after.origin - before.origin);
        (y * 1e3, z * 1e3)
    }
}
