//! The correction of each target, and the start of the robot's runs.
//!
//! The client library limits the correction; this module decides when a run of the robot begins and
//! from which correction. It never waits longer than its time limit; without a daemon the correction
//! is zero.

use crate::daemon_link::DaemonLink;
use crate::link::{Correction, Link};
use trued_client::JOINTS_MAX;

/// Position of the robot at the start of a run.
#[derive(Debug, Clone, Copy)]
enum RunStart {
    /// At its command: the controller accumulates corrections from zero.
    AtZero,
    /// At these joints, rad.
    At([f64; JOINTS_MAX]),
}

impl RunStart {
    /// Whether the robot's position includes the correction `last`; `q` is its newest target
    /// without correction, `before` the one that was corrected last. True if the robot is clearly
    /// at its last corrected target, or not clearly at `q` itself.
    fn includes_correction(
        &self,
        q: &[f64],
        before: Option<&[f64]>,
        last: &[f64; JOINTS_MAX],
    ) -> bool {
        let Self::At(present) = self else { return false };
        let square = |q, share| distance_squared(present, q, last, share);
        // Clearly: at most half as far as from the other. In between, the run is assumed to have
        // continued.
        before.is_some_and(|q| 4.0 * square(q, 1.0) < square(q, 0.0))
            || 4.0 * square(q, 0.0) > square(q, 1.0)
    }
}

/// The square of the distance of `joints` from `q` with this share of a correction.
fn distance_squared(
    joints: &[f64; JOINTS_MAX],
    q: &[f64],
    correction: &[f64; JOINTS_MAX],
    share: f64,
) -> f64 {
    let differences =
        q.iter().zip(correction).zip(joints).map(|((q, c), target)| q + share * c - target);
    differences.map(|difference| difference * difference).sum()
}

/// Corrections, and the start of a robot's runs.
pub struct Corrections<L = DaemonLink> {
    link: L,
    /// Set if a run starts with the next target.
    start: Option<RunStart>,
    /// The newest target sent as commanded since the last corrected one, rad. A robot whose first
    /// message of a run was lost has already followed it.
    uncorrected: Option<[f64; JOINTS_MAX]>,
    /// The newest corrected target, without its correction, rad.
    corrected: Option<[f64; JOINTS_MAX]>,
}

impl<L: Link> Corrections<L> {
    /// With this link.
    pub fn with_link(link: L) -> Self {
        Self { link, start: None, uncorrected: None, corrected: None }
    }

    /// The link.
    pub fn link(&mut self) -> &mut L {
        &mut self.link
    }

    /// The correction of a new target, rad (m where prismatic).
    pub fn command(&mut self, q: &[f64]) -> Correction {
        let passed = self.uncorrected.take();
        if let Some(start) = self.start.take() {
            let newest = passed.as_ref().map_or(q, |passed| &passed[..q.len()]);
            let before = self.corrected.as_ref().map(|before| &before[..q.len()]);
            let last = self.link.last_correction();
            if !start.includes_correction(newest, before, &last) {
                self.link.start_from(&[0.0; JOINTS_MAX]);
            } else if passed.is_some() || last == [0.0; JOINTS_MAX] {
                self.link.start_from(&last);
            } else {
                self.link.start_anew();
            }
        }
        let mut joints = [0.0; JOINTS_MAX];
        joints[..q.len()].copy_from_slice(q);
        self.corrected = Some(joints);
        self.link.command(q)
    }

    /// Stores a target that is sent as commanded.
    pub fn store_uncorrected(&mut self, q: &[f64; JOINTS_MAX]) {
        self.uncorrected = Some(*q);
    }

    /// Whether the last target sent contained a correction.
    pub fn is_correcting(&self) -> bool {
        self.uncorrected.is_none() && self.link.last_correction() != [0.0; JOINTS_MAX]
    }

    /// Whether a robot at `joints`, rad, is at the target `q` itself: a tenth as far from it as
    /// from the corrected one.
    pub fn is_at_target(&self, q: &[f64], joints: &[f64; JOINTS_MAX]) -> bool {
        let last = self.link.last_correction();
        100.0 * distance_squared(joints, q, &last, 0.0) <= distance_squared(joints, q, &last, 1.0)
    }

    /// The present correction, for a target that the daemon already knows.
    pub fn repeat(&mut self, q: &[f64]) -> Correction {
        self.link.repeat(q)
    }

    /// The next target is the first of a run, in which the controller accumulates corrections from
    /// zero.
    pub fn start_at_zero(&mut self) {
        self.start = Some(RunStart::AtZero);
    }

    /// The next target is the first of a run, with the robot at `joints`, rad. If that is its last
    /// corrected target, the correction in force is kept; otherwise the target is sent as
    /// commanded.
    pub fn start_at(&mut self, joints: &[f64; JOINTS_MAX]) {
        self.start = Some(RunStart::At(*joints));
    }

    /// The controller has used only this part of the corrections sent, rad: the correction
    /// continues from there.
    pub fn continue_from(&mut self, used: &[f64; JOINTS_MAX]) {
        self.link.start_from(used);
    }
}

#[cfg(test)]
pub(crate) mod stub {
    use super::*;
    use trued_client::{RobotState, Source};

    /// A link whose last correction of the first joint was this.
    pub(crate) struct Corrected(pub(crate) f64);

    impl Link for Corrected {
        fn command(&mut self, q: &[f64]) -> Correction {
            self.repeat(q)
        }

        fn repeat(&mut self, _: &[f64]) -> Correction {
            let rad = self.last_correction();
            Correction { rad, source: Source::Corrected, is_refused: false }
        }

        fn last_correction(&self) -> [f64; JOINTS_MAX] {
            first(self.0)
        }

        fn feed_override(&self) -> f64 {
            1.0
        }

        fn start_anew(&mut self) {}

        fn start_from(&mut self, correction: &[f64; JOINTS_MAX]) {
            self.0 = correction[0];
        }

        fn send_state(&mut self, _: &RobotState) {}

        fn check_connection(&mut self) {}
    }

    pub(crate) fn first(joint: f64) -> [f64; JOINTS_MAX] {
        std::array::from_fn(|i| if i == 0 { joint } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::stub::{Corrected, first};
    use super::*;

    /// Correction of the first target of a run, 1 mrad further, with the robot at `stands` and a
    /// last correction of -1 mrad.
    fn begun(position: f64, passed: Option<f64>) -> f64 {
        let mut feed = Corrections::with_link(Corrected(-1e-3));
        if let Some(passed) = passed {
            feed.store_uncorrected(&first(passed));
        }
        feed.start_at(&first(position));
        feed.command(&first(1e-3)[..6]).rad[0]
    }

    #[test]
    fn a_run_continues_with_the_correction_that_is_in_the_robots_position() {
        assert_eq!(begun(0.0, None).to_bits(), (-1e-3_f64).to_bits());
        assert_eq!(begun(1e-3, None).to_bits(), 0.0_f64.to_bits());
    }

    #[test]
    fn a_robot_at_its_last_target_keeps_its_correction_however_near_the_next_target_is() {
        let mut feed = Corrections::with_link(Corrected(-1e-3));
        feed.command(&first(0.0)[..6]);
        feed.start_at(&first(-1e-3));
        assert_eq!(feed.command(&first(-1e-3)[..6]).rad[0].to_bits(), (-1e-3_f64).to_bits());
    }

    #[test]
    fn a_robot_that_has_followed_a_target_as_commanded_continues_without_a_correction() {
        assert_eq!(begun(0.0, Some(0.0)).to_bits(), 0.0_f64.to_bits());
        // The robot stood at the corrected position, and the target was not received.
        assert_eq!(begun(-1e-3, Some(0.0)).to_bits(), (-1e-3_f64).to_bits());
    }
}
