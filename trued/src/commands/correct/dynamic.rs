//! `trued correct --dynamic`: preview compensation of a path on top of its static correction.

use feedforward::grid::{self, Extended};
use feedforward::preview::{check_joint_limits, lead_s};
use feedforward::result::PreviewReport;
use feedforward::{Settings, preview};
use joint_dynamics::plant::Plants;

use crate::corrections::Corrections;
use crate::exit::Failure;
use crate::in_time::{plants, settled};
use crate::input::{Input, in_file};

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
        let path = extended.map_err(in_file(&input.recording.file))?;
        input.recording = path.recording.clone();
        Ok(Self { settings, plants, path })
    }

    /// The row of the user's file for a row of the path, both from 1.
    pub(super) fn row_in_file(&self, row: usize) -> usize {
        let t_s = self.path.recording.t_s.get(row.saturating_sub(1)).copied();
        self.path.source.at(t_s.unwrap_or(f64::NAN)).row
    }

    /// Number of rows at standstill that were added to the path.
    pub(super) fn rest_rows(&self) -> usize {
        2 * self.path.lead_rows
    }

    /// Replaces the static commands by dynamically compensated ones.
    pub(super) fn compensate(
        &self,
        input: &Input,
        corrections: &mut Corrections,
    ) -> Result<PreviewReport, Failure> {
        let Self { settings, plants, path } = self;
        let wanted = settled(corrections, input, &path.source)?;
        let preview = preview(plants, path.step_s, &wanted, settings);
        let preview = preview.map_err(in_file(&input.recording.file))?;
        let arm = &input.model.physics.arm;
        let limits = check_joint_limits(arm, &preview.commanded, &path.recording.t_s, &path.source);
        limits.map_err(in_file(&input.recording.file))?;
        let report = PreviewReport::of(arm, plants, path, &wanted, &preview);
        corrections.put_joints(preview.commanded);
        Ok(report)
    }
}
