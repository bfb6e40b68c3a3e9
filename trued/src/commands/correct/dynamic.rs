//! `trued correct --dynamic`: preview compensation of a path on top of its static correction.

use feedforward::grid::{self, Extended};
use feedforward::preview::{check_joint_limits, lead_s};
use feedforward::result::PreviewReport;
use feedforward::{Settings, preview};
use joint_dynamics::plant::Plants;

use crate::corrections::Corrections;
use crate::exit::Failure;
use crate::in_time::{plants, settled};
use crate::input::Input;

/// A path with even time stamps and standstill at both ends, and the dynamics of its robot's
/// joints.
pub(super) struct Dynamic {
    settings: Settings,
    plants: Plants,
    path: Extended,
}

impl Dynamic {
    /// Extends the input's path.
    pub(super) fn extend(input: &mut Input, settings: Settings) -> Result<Self, Failure> {
        let plants = plants(input, &settings)?;
        let lead_s = lead_s(&plants, &settings);
        let extended = grid::extended(&input.recording, &input.joint_kinds, lead_s);
        let path = extended.map_err(Failure::input)?;
        input.recording = path.recording.clone();
        Ok(Self { settings, plants, path })
    }

    /// Replaces the static commands by dynamically compensated ones.
    pub(super) fn compensate(
        &self,
        input: &Input,
        corrections: &mut Corrections,
    ) -> Result<PreviewReport, Failure> {
        let Self { settings, plants, path } = self;
        let wanted = settled(corrections)?;
        let preview = preview(plants, path.step_s, &wanted, settings).map_err(Failure::input)?;
        let arm = &input.model.physics.arm;
        check_joint_limits(arm, &preview.commanded).map_err(Failure::input)?;
        let report = PreviewReport::of(arm, plants, path, &wanted, &preview);
        corrections.put_joints(preview.commanded);
        Ok(report)
    }
}
