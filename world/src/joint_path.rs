//! Joint commands of a path, sample by sample, as sent by a controller.
//!
//! The path is planned as a whole before it runs, so that unreachable poses are reported before
//! anything moves; each sample reaches its target pose to 1e-12 m and rad; joints stay within
//! limits and speeds. No correction.

use crate::ik::{self, IkError};
use crate::path::{PathPoint, ToolPath};
use physics::{Arm, Joints};
use thiserror::Error;

/// One command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time since the start of the path, s.
    pub t_s: f64,
    /// Commanded joint positions, rad or m.
    pub q: Joints,
    /// Target of the tool.
    pub wanted: PathPoint,
}

/// All commands of a path at a fixed rate.
#[derive(Clone, Debug, PartialEq)]
pub struct JointPath {
    /// Time between two samples, s.
    pub dt_s: f64,
    /// The commands, at least one, in time order.
    pub samples: Vec<Sample>,
}

/// Why a path cannot be planned.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum PlanError {
    /// A pose without a solution.
    #[error("at {t_s:.3} s: {error}")]
    Unreachable {
        /// Time on the path, s.
        t_s: f64,
        /// Why.
        error: IkError,
    },
    /// A joint (1-based) would exceed its maximum velocity, usually near a singular pose.
    #[error(
        "at {t_s:.3} s joint {joint} would need a speed of {speed:.2}, its limit is {limit:.2} (rad/s or m/s); \
         slow down or avoid singular poses"
    )]
    TooFast {
        /// Time on the path, s.
        t_s: f64,
        /// 1-based.
        joint: usize,
        /// Required velocity, rad/s or m/s.
        speed: f64,
        /// Its limit, rad/s or m/s.
        limit: f64,
    },
}

impl JointPath {
    /// The commands of `path` every `dt_s` (above zero), starting near `start_near` or, if not given, at
    /// [`ik::start_pose`].
    ///
    /// # Errors
    /// Where and why the arm cannot follow.
    pub fn plan(
        arm: &Arm,
        path: &ToolPath,
        dt_s: f64,
        start_near: Option<&Joints>,
    ) -> Result<Self, PlanError> {
        let first = path.at(0.0).base_from_tool;
        let start = match start_near {
            Some(start_near) => ik::solve(arm, &first, start_near),
            None => ik::start_pose(arm, &first),
        };
        let mut q = start.map_err(|error| PlanError::Unreachable { t_s: 0.0, error })?;
        let steps = libm::ceil(path.duration_s() / dt_s) as usize;
        let mut samples = Vec::with_capacity(steps + 1);
        for k in 0..=steps {
            let t_s = k as f64 * dt_s;
            let wanted = path.at(t_s);
            let next = ik::solve(arm, &wanted.base_from_tool, &q)
                .map_err(|error| PlanError::Unreachable { t_s, error })?;
            check_speed(arm, t_s, dt_s, &q, &next)?;
            q = next;
            samples.push(Sample { t_s, q, wanted });
        }
        Ok(Self { dt_s, samples })
    }

    /// Its duration, s.
    pub fn duration_s(&self) -> f64 {
        self.samples.last().map_or(0.0, |sample| sample.t_s)
    }
}

fn check_speed(
    arm: &Arm,
    t_s: f64,
    dt_s: f64,
    before: &Joints,
    now: &Joints,
) -> Result<(), PlanError> {
    for (i, joint) in arm.joints().iter().enumerate() {
        let (speed, limit) = ((now[i] - before[i]).abs() / dt_s, joint.max_speed);
        if speed > limit {
            return Err(PlanError::TooFast { t_s, joint: i + 1, speed, limit });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::tool_along;
    use crate::slots::Slots;
    use crate::test_arm::{irb1600, seven_joints};
    use glam::DVec3;
    use physics::Chain;

    fn quick(arm: &Arm, start: DVec3) -> Result<JointPath, PlanError> {
        let rotation = tool_along(-DVec3::Z, arm.tool.base_from_tool);
        let path = Slots::quick(start).tool_path(rotation).expect("a sound path");
        JointPath::plan(arm, &path, 1e-3, None)
    }

    #[test]
    fn the_commands_are_the_path_at_their_times_from_start_to_end() {
        let arm = irb1600();
        let start = DVec3::new(0.8, 0.0, 0.4);
        let rotation = tool_along(-DVec3::Z, arm.tool.base_from_tool);
        let path = Slots::quick(start).tool_path(rotation).expect("a sound path");
        let plan = JointPath::plan(&arm, &path, 1e-3, None).expect("within reach");
        assert!((plan.duration_s() - path.duration_s()).abs() <= 1e-3);
        for (k, sample) in plan.samples.iter().enumerate() {
            assert_eq!(sample.t_s, k as f64 * 1e-3);
            assert_eq!(sample.wanted, path.at(sample.t_s));
        }
        let end = plan.samples.last().expect("samples").wanted.base_from_tool.origin;
        assert!((end - start - DVec3::new(0.015, 0.0, 2e-3)).length() < 1e-12);
    }

    #[test]
    fn every_command_puts_the_controllers_tool_where_it_is_wanted() {
        for (arm, start) in
            [(irb1600(), DVec3::new(0.8, 0.0, 0.4)), (seven_joints(), DVec3::new(0.5, 0.0, 0.3))]
        {
            let path = quick(&arm, start).expect("within reach");
            for sample in &path.samples {
                let reached = Chain::nominal(&arm, &sample.q).base_from_tool;
                let error = reached.origin - sample.wanted.base_from_tool.origin;
                assert!(error.length() < 1e-12, "{error} at {} s", sample.t_s);
            }
        }
    }

    #[test]
    fn joint_commands_are_smooth() {
        let path = quick(&irb1600(), DVec3::new(0.8, 0.0, 0.4)).expect("within reach");
        for three in path.samples.windows(3) {
            for i in 0..6 {
                let bend = three[2].q[i] - 2.0 * three[1].q[i] + three[0].q[i];
                assert!(bend.abs() / 1e-6 < 2.0, "joint {} at {} s", i + 1, three[1].t_s);
            }
        }
    }

    #[test]
    fn a_path_out_of_reach_is_refused_before_it_runs() {
        let refused = quick(&irb1600(), DVec3::new(2.5, 0.0, 0.4));
        assert!(matches!(refused, Err(PlanError::Unreachable { .. })), "{refused:?}");
    }
}
