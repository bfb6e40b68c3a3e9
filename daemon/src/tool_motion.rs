//! Feed of the tool along the commanded path, and rotation of each joint per millimetre.
//!
//! Computed from the nominal geometry and the times of the commands over the last 0.2 s; `None`
//! if these are unknown. Valid for steady cuts; corners are averaged. Not for the cycle's thread.

use physics::{Arm, Chain, JOINTS_MAX, JointKind, Joints};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Commanded points closer than this are skipped, ns.
const STEP_NS: u64 = 5_000_000;
/// Length of the evaluated part of the path, ns.
const WINDOW_NS: u64 = 200_000_000;
/// A shorter part is not evaluated, ns.
const WINDOW_MIN_NS: u64 = 100_000_000;
/// Points further apart belong to different paths, ns.
const BREAK_NS: u64 = 500_000_000;
/// A slower tool counts as at rest, mm/s.
const REST_MM_S: f64 = 0.05;

/// A commanded point, as taken by the cycle.
#[derive(Clone, Copy, Debug)]
pub struct PathPoint {
    /// Session of the sender.
    pub session: u64,
    /// When the target holds, ns.
    pub t_ns: u64,
    /// The target, rad or m.
    pub q: Joints,
}

#[derive(Clone, Copy, Debug)]
struct PathSample {
    point: PathPoint,
    tcp: glam::DVec3,
    path_mm: f64,
}

/// The last part of the commanded path.
#[derive(Debug, Default)]
pub struct PathTracker {
    samples: VecDeque<PathSample>,
}

/// Motion of the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolMotion {
    /// Speed of the TCP along its path, mm/s; 0 at rest.
    pub feed_mm_s: f64,
    /// Revolutions of each revolute joint per mm of path, without sign; 0 at rest.
    pub turns_per_mm: [f64; JOINTS_MAX],
}

impl PathTracker {
    /// Adds a commanded point of this arm.
    pub fn add(&mut self, arm: &Arm, point: &PathPoint) {
        let before = self.samples.back().copied();
        if let Some(PathSample { point: before, .. }) = before {
            let follows = point.session == before.session && point.t_ns >= before.t_ns;
            if !follows || point.t_ns - before.t_ns > BREAK_NS {
                self.clear();
            } else if point.t_ns - before.t_ns < STEP_NS {
                return;
            }
        }
        let tcp = Chain::nominal(arm, &point.q).base_from_tool.origin;
        let path_mm =
            self.samples.back().map_or(0.0, |mark| mark.path_mm + 1e3 * (tcp - mark.tcp).length());
        self.samples.push_back(PathSample { point: *point, tcp, path_mm });
        while self.samples.get(1).is_some_and(|second| point.t_ns - second.point.t_ns >= WINDOW_NS)
        {
            self.samples.pop_front();
        }
    }

    /// Clears the path: no commands arrive, or the arm has changed.
    pub fn clear(&mut self) {
        self.samples.clear();
    }

    /// The present motion of the tool; `None` if the path has not been known for long enough.
    pub fn motion(&self, arm: &Arm) -> Option<ToolMotion> {
        let (from, to) = (self.samples.front()?, self.samples.back()?);
        let lasted_ns = to.point.t_ns - from.point.t_ns;
        let path_mm = to.path_mm - from.path_mm;
        let feed_mm_s = path_mm / (lasted_ns as f64 * 1e-9);
        if lasted_ns < WINDOW_MIN_NS || !feed_mm_s.is_finite() {
            return None;
        }
        let mut turns_per_mm = [0.0; JOINTS_MAX];
        if feed_mm_s < REST_MM_S {
            return Some(ToolMotion { feed_mm_s: 0.0, turns_per_mm });
        }
        for (i, joint) in arm.joints().iter().enumerate() {
            if joint.kind == JointKind::Revolute {
                turns_per_mm[i] = (to.point.q[i] - from.point.q[i]).abs() / TAU / path_mm;
            }
        }
        Some(ToolMotion { feed_mm_s, turns_per_mm })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::model::RobotModel;
    use recording::model::presets::preset;

    fn model() -> RobotModel {
        preset("irb1600-6-145-thesis").unwrap().model().unwrap()
    }

    /// Joint 1 rotates at this speed, rad/s, commanded each millisecond with times that jitter.
    fn turning(travel: &mut PathTracker, arm: &Arm, from_s: f64, to_s: f64, speed: f64) {
        let mut q = [0.0; JOINTS_MAX];
        q[1] = 0.4;
        for k in (from_s * 1e3) as u64..(to_s * 1e3) as u64 {
            q[0] = speed * (k as f64 * 1e-3 - from_s);
            let t_ns = k * 1_000_000 + (k * 7919) % 300_000;
            travel.add(arm, &PathPoint { session: 1, t_ns, q });
        }
    }

    #[test]
    fn the_feed_is_speed_times_radius_and_the_turns_are_those_of_the_joint() {
        let model = model();
        let arm = &model.physics.arm;
        let mut q = [0.0; JOINTS_MAX];
        q[1] = 0.4;
        let tcp = Chain::nominal(arm, &q).base_from_tool.origin;
        let radius_mm = 1e3 * tcp.x.hypot(tcp.y);
        let mut travel = PathTracker::default();
        assert_eq!(travel.motion(arm), None);
        turning(&mut travel, arm, 0.0, 0.5, 0.01);
        let motion = travel.motion(arm).unwrap();
        assert!((motion.feed_mm_s / (0.01 * radius_mm) - 1.0).abs() < 0.004, "{motion:?}");
        assert!((motion.turns_per_mm[0] * TAU * radius_mm - 1.0).abs() < 1e-6, "{motion:?}");
        assert!(motion.turns_per_mm[1..].iter().all(|turns| *turns == 0.0));
    }

    #[test]
    fn a_pause_or_another_sender_begins_a_new_path_and_a_stand_has_no_feed() {
        let model = model();
        let arm = &model.physics.arm;
        let mut travel = PathTracker::default();
        turning(&mut travel, arm, 0.0, 0.5, 0.01);
        turning(&mut travel, arm, 2.0, 2.05, 0.01);
        assert_eq!(travel.motion(arm), None, "known for too short a time");
        turning(&mut travel, arm, 2.05, 2.5, 0.0);
        let motion = travel.motion(arm).unwrap();
        assert_eq!((motion.feed_mm_s, motion.turns_per_mm[0]), (0.0, 0.0));
        travel.add(arm, &PathPoint { session: 2, t_ns: 1, q: [0.0; JOINTS_MAX] });
        assert_eq!(travel.motion(arm), None);
    }
}
