//! Joint positions only, for recordings of any length: poses of all rows would take twenty times as much memory.

use super::{CampaignError, Reader};
use physics::{Arm, Joints};
use recording::series::Recording;

/// Joint positions of a robot, row by row.
pub(crate) struct JointPositions {
    joints: usize,
    /// Row-major, rad or m.
    all: Vec<f64>,
}

impl JointPositions {
    /// Positions of the robot `arm` in `recording`.
    ///
    /// # Errors
    /// An input lacks a joint.
    pub(crate) fn of(arm: &Arm, recording: &Recording) -> Result<Self, CampaignError> {
        let (reader, joints) = (Reader::of(arm, recording, 0), arm.count());
        let mut all = Vec::with_capacity(recording.len() * joints);
        let mut before: Option<Joints> = None;
        for row in 0..recording.len() {
            let q = reader.positions(row, before.as_ref().filter(|_| reader.is_contiguous(row)))?;
            all.extend_from_slice(&q[..joints]);
            before = Some(q);
        }
        Ok(Self { joints, all })
    }

    /// Positions of the arm's joints in a row.
    pub(crate) fn row(&self, row: usize) -> &[f64] {
        &self.all[row * self.joints..(row + 1) * self.joints]
    }

    pub(crate) fn at(&self, row: usize) -> Joints {
        let mut q = Joints::default();
        q[..self.joints].copy_from_slice(self.row(row));
        q
    }
}
