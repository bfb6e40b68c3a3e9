//! The source of corrections, as seen by a bridge.

use trued_client::{JOINTS_MAX, RobotState, Source};

/// The answer to one target.
#[derive(Debug, Clone, Copy)]
pub struct Correction {
    /// To be added to the target, rad.
    pub rad: [f64; JOINTS_MAX],
    /// Its source.
    pub source: Source,
    /// The daemon refused the target; it is sent while the correction ramps to zero.
    pub is_refused: bool,
}

impl Correction {
    /// No correction.
    pub const ZERO: Self =
        Self { rad: [0.0; JOINTS_MAX], source: Source::Plain, is_refused: false };

    /// Whether the target is sent unchanged.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.rad == [0.0; JOINTS_MAX]
    }
}

/// A source of corrections: the daemon, through the client library, or a simulation.
pub trait Link {
    /// The correction for a new target, rad (m where prismatic).
    fn command(&mut self, q: &[f64]) -> Correction;
    /// The present correction, for a target that the daemon already knows.
    fn repeat(&mut self, q: &[f64]) -> Correction;
    /// The correction that was sent last, rad.
    fn last_correction(&self) -> [f64; JOINTS_MAX];
    /// The feed override that belongs to the last correction, above 0 to 1.
    fn feed_override(&self) -> f64;
    /// A run starts with the robot at its last target: the correction continues.
    fn start_anew(&mut self);
    /// A run starts with the robot at its command plus this correction, rad.
    fn start_from(&mut self, correction: &[f64; JOINTS_MAX]);
    /// Sends the measured state of the robot.
    fn send_state(&mut self, state: &RobotState);
    /// Checks the connection to the daemon while nothing is sent.
    fn check_connection(&mut self);
}
