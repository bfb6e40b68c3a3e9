//! State of the cutting process for the vibration monitor: spindle, teeth, feed, cut.

use std::time::Duration;

use shm_schema::{InCut, Operation, Request};

/// State of the cutting process. By default nothing is stated: the daemon then uses its configuration, the commanded path and
/// the level of the forces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProcessState {
    /// Spindle speed, 1/min; 0 if stopped, NaN if unknown.
    pub spindle_rpm: f64,
    /// Teeth of the cutter; 0 where unknown.
    pub teeth: u32,
    /// Feed along the path, mm/s; NaN: the daemon computes it from the commanded path.
    pub feed_mm_s: f64,
    /// Whether the tool cuts; `None`: the daemon decides by the forces.
    pub in_cut: Option<bool>,
    /// Validity of this report, in case the cell fails with the spindle on; `None`: until the next report.
    pub holds_for: Option<Duration>,
}

impl Default for ProcessState {
    fn default() -> Self {
        Self { spindle_rpm: f64::NAN, teeth: 0, feed_mm_s: f64::NAN, in_cut: None, holds_for: None }
    }
}

impl ProcessState {
    pub(crate) fn request(&self) -> Request {
        let in_cut = match self.in_cut {
            None => InCut::Unknown,
            Some(false) => InCut::Air,
            Some(true) => InCut::Cut,
        };
        // Zero means without a time limit.
        let milliseconds =
            |limit: Duration| u32::try_from(limit.as_millis()).unwrap_or(u32::MAX).max(1);
        Request {
            operation: Operation::ProcessState.code(),
            spindle_rpm: self.spindle_rpm,
            teeth: self.teeth,
            feed_mm_s: self.feed_mm_s,
            in_cut: in_cut.code(),
            holds_ms: self.holds_for.map_or(0, milliseconds),
            ..Request::default()
        }
    }
}
