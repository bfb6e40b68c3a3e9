//! The source of corrections, as seen by a bridge.

use trued_client::{JOINTS_MAX, RobotState, Source};

/// The answer to one target.
#[derive(Debug, Clone, Copy)]
pub struct Correction {
    /// What is to be added to the target, rad.
    pub rad: [f64; JOINTS_MAX],
    /// Where it comes from.
    pub source: Source,
    /// The daemon refused the target; it passes, while the correction ramps out.
    pub is_refused: bool,
}

impl Correction {
    /// None.
    pub const ZERO: Self =
        Self { rad: [0.0; JOINTS_MAX], source: Source::Plain, is_refused: false };

    /// Whether the target goes out as it came.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.rad == [0.0; JOINTS_MAX]
    }
}

/// Where corrections come from: the daemon, through the client library, or a simulation.
pub trait Link {
    /// The correction for a new target, rad (m where prismatic).
    fn command(&mut self, q: &[f64]) -> Correction;
    /// The correction as it is now, for a target that the daemon knows already.
    fn repeat(&mut self, q: &[f64]) -> Correction;
    /// The correction that was sent last, rad.
    fn last_correction(&self) -> [f64; JOINTS_MAX];
    /// The share of the programmed feed to go on with, above 0 to 1: what belongs to the last correction.
    fn feed_override(&self) -> f64;
    /// A run begins, and the robot stands where it was sent last: the correction goes on as it was.
    fn start_anew(&mut self);
    /// The robot begins a run at its command plus this correction, rad.
    fn start_from(&mut self, correction: &[f64; JOINTS_MAX]);
    /// What the robot measures of itself.
    fn send_state(&mut self, state: &RobotState);
    /// Nothing is to be sent for a while: the daemon is looked for.
    fn look(&mut self);
}
