//! The instrument that measures the tool: passes its points to the trim, and the state of the trim
//! to the status.
//!
//! Runs in the cycle, without allocation; a point without time stamp has the configured latency.

use crate::exchange::{MeasuredInBase, TrimCounters};
use corrector::{PointSample, Trim};
use glam::DVec3;
use physics::Frame;
use shm_schema::MeasuredPoint;

/// The instrument of a cell.
#[derive(Debug)]
pub struct Instrument {
    trim: Trim,
    latency_ns: u64,
    /// The newest point of this cycle, for the recording.
    newest: Option<MeasuredInBase>,
}

impl Instrument {
    /// An instrument with this trim; a point without time stamp was measured `latency_ns` before it was sent.
    #[must_use]
    pub fn new(trim: Trim, latency_ns: u64) -> Self {
        Self { trim, latency_ns, newest: None }
    }

    /// Starts a cycle, without a new point.
    pub fn begin_cycle(&mut self) {
        self.newest = None;
    }

    /// Adds a point received at `now_ns`.
    pub fn add_point(&mut self, message: &MeasuredPoint, now_ns: u64) {
        let stamped = message.has(MeasuredPoint::HAS_TIME);
        let assumed_ns = message.sent_ns.saturating_sub(self.latency_ns);
        let t_ns = if stamped { message.t_ns } else { assumed_ns };
        let sample = PointSample { point_m: DVec3::from_array(message.point_m), t_ns };
        self.trim.add_measurement(&sample, now_ns);
        self.newest = Some(MeasuredInBase { point_m: self.trim.in_base(&sample).to_array(), t_ns });
    }

    /// Displacement of the tool, base frame, m; `corrects`: whether corrections are sent.
    pub fn trim_m(&mut self, now_ns: u64, corrects: bool) -> DVec3 {
        self.trim.step(now_ns, corrects)
    }

    /// Stores the tool pose predicted for what was sent at `now_ns`.
    pub fn store_prediction(
        &mut self,
        now_ns: u64,
        base_from_tool: Option<&Frame>,
        counters: &TrimCounters,
    ) {
        self.trim.store_prediction(now_ns, base_from_tool);
        self.publish(counters);
    }

    /// Publishes the state of the trim.
    pub fn publish(&self, counters: &TrimCounters) {
        counters.store(self.trim.report());
    }

    /// A new model is active.
    pub fn model_changed(&mut self) {
        self.trim.model_changed();
    }

    /// The registration was checked: accepts the instrument again after a jump.
    pub fn rearm(&mut self) {
        self.trim.rearm();
    }

    /// The trim in force, m, and the newest point of this cycle, for the recording.
    #[must_use]
    pub fn record(&self) -> ([f64; 3], Option<MeasuredInBase>) {
        (self.trim.report().trim_m.to_array(), self.newest)
    }
}
