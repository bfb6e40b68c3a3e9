//! Compact storage of the derivative of the tool pose by one parameter: columns of the candidate dictionary use most of the memory of a diagnosis.
//!
//! At measurements bit-identical to the original derivatives; joint derivatives are stored only if joint positions are measured.

use crate::campaign::{Campaign, Reading};
use crate::residual::ReadingResidual;
use crate::tool_motion::ToolMotion;
use glam::DVec3;
use physics::Joints;

/// Derivative at each pose.
#[derive(Clone, Debug)]
pub(crate) struct MotionSeries {
    /// Rotation and translation of the tool.
    tool: Vec<(DVec3, DVec3)>,
    /// Motion of the joints; empty if no joint position is measured.
    joints: Vec<Joints>,
    reads_joints: bool,
}

impl MotionSeries {
    /// An empty series; `reads_joints`: [`reads_joints`].
    pub(super) fn new(poses: usize, reads_joints: bool) -> Self {
        let joints = Vec::with_capacity(if reads_joints { poses } else { 0 });
        Self { tool: Vec::with_capacity(poses), joints, reads_joints }
    }

    /// Appends the motion at a pose; at skipped poses it is zero.
    pub(super) fn put(&mut self, pose: usize, motion: &ToolMotion) {
        self.tool.resize(pose, (DVec3::ZERO, DVec3::ZERO));
        self.tool.push((motion.turn, motion.shift));
        if self.reads_joints {
            self.joints.resize(pose, Joints::default());
            self.joints.push(motion.joints);
        }
    }

    /// Derivative of the prediction at a pose, in units of the noise.
    pub(super) fn along(&self, rows: &ReadingResidual, pose: usize) -> DVec3 {
        rows.along_parts(self.tool[pose], |joint| self.joints[pose][joint])
    }
}

/// Whether any joint position is measured.
pub(super) fn reads_joints(campaign: &Campaign) -> bool {
    let mut readings = campaign.poses.iter().flat_map(|pose| &pose.seen);
    readings.any(|one| matches!(one.reading, Reading::JointPosition { .. }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Observation;
    use crate::extrinsics::Extrinsics;
    use crate::residual::ExtrinsicColumns;
    use glam::DMat3;
    use physics::Evaluation;

    #[test]
    fn a_reading_of_a_joint_sees_the_motion_that_was_put_in_past_poses_that_take_no_part() {
        let reading = Reading::JointPosition { joint: 2, position: 0.1 };
        let whitening = DMat3::from_diagonal(DVec3::splat(3.0));
        let observation = Observation { reading, whitening, instrument: 0 };
        let (evaluation, around) = (Evaluation::default(), Extrinsics::default());
        let columns = ExtrinsicColumns::of(&around);
        let rows =
            ReadingResidual::of(&observation, &evaluation, &Joints::default(), &around, &columns);
        let mut motion = ToolMotion { turn: DVec3::X, shift: DVec3::Y, ..ToolMotion::default() };
        motion.joints[2] = 0.7;
        let mut series = MotionSeries::new(5, true);
        [1, 4].into_iter().for_each(|pose| series.put(pose, &motion));
        for (pose, wanted) in
            [(0, DVec3::ZERO), (3, DVec3::ZERO), (4, rows.derivative_along(&motion))]
        {
            assert_eq!(series.along(&rows, pose), wanted, "{pose}");
        }
        assert_eq!(series.along(&rows, 1).x, 3.0 * 0.7);
    }
}
