//! Dynamic compensation of a whole path on top of its static correction.

use feedforward::grid::{self, Extended, SourceRows};
use feedforward::preview::{check_joint_limits, lead_s};
use feedforward::result::{PreviewReport, RowResult};
use feedforward::{FeedforwardError, Settings, preview};
use joint_dynamics::plant::Plants;
use physics::JointKind;
use recording::model::RobotModel;
use recording::series::Recording;

use crate::corrections::Corrections;
use crate::error::Error;

/// A path with even time stamps and standstill at both ends, and the dynamics of its robot's
/// joints.
#[derive(Debug)]
pub(crate) struct DynamicPath {
    settings: Settings,
    plants: Plants,
    path: Extended,
}

impl DynamicPath {
    /// Extends the recording.
    pub(crate) fn extend(
        model: &RobotModel,
        recording: &mut Recording,
        kinds: &[JointKind],
        settings: Settings,
    ) -> Result<Self, Error> {
        let plants = joint_plants(model, &settings)?;
        let lead_s = lead_s(&plants, &settings);
        let path = grid::extend(recording, kinds, lead_s);
        let path = path.map_err(Error::in_file(&recording.file))?;
        *recording = path.recording.clone();
        Ok(Self { settings, plants, path })
    }

    /// The row of the user's file for a row of the path, both from 1.
    pub(crate) fn row_in_file(&self, row: usize) -> usize {
        let t_s = self.path.recording.t_s.get(row.saturating_sub(1)).copied();
        self.path.source.at(t_s.unwrap_or(f64::NAN)).row
    }

    /// Number of rows at standstill that were added to the path.
    pub(crate) fn rest_rows(&self) -> usize {
        2 * self.path.lead_rows
    }

    /// Replaces the static commands by dynamically compensated ones.
    pub(crate) fn compensate(
        &self,
        model: &RobotModel,
        corrections: &mut Corrections,
    ) -> Result<PreviewReport, Error> {
        let Self { settings, plants, path } = self;
        let (recording, source) = (&path.recording, &path.source);
        let wanted = static_commands(corrections, recording, source)?;
        let arm = &model.physics.arm;
        let preview = preview(plants, Some(arm), path.step_s, &wanted, settings);
        let preview = preview.map_err(Error::in_file(&recording.file))?;
        let limits = check_joint_limits(arm, &preview.commanded, &recording.t_s, source);
        limits.map_err(Error::in_file(&recording.file))?;
        let report = PreviewReport::of(arm, plants, path, &wanted, &preview);
        let joints = preview.joints.iter().flatten();
        let rows = RowResult::of(arm, (&wanted, &preview.with), path.step_s, joints);
        corrections.compensate(preview.commanded, &rows);
        Ok(report)
    }
}

/// The dynamics of a model's joints.
///
/// # Errors
/// The model states nothing that could be compensated.
pub fn joint_plants(model: &RobotModel, settings: &Settings) -> Result<Plants, Error> {
    let plants = Plants::of(model, settings.unstated);
    if plants.is_empty() {
        return Err(Error::input(FeedforwardError::NothingInTime));
    }
    Ok(plants)
}

/// The joint positions with the static correction of a recording; `source`: the rows of its file.
///
/// # Errors
/// A row was rejected.
pub fn static_commands(
    corrections: &Corrections,
    recording: &Recording,
    source: &SourceRows,
) -> Result<Vec<Vec<f64>>, Error> {
    let joints = corrections.joints();
    let lacking = joints.iter().find_map(|joint| joint.iter().position(|q| !q.is_finite()));
    match lacking {
        None => Ok(joints.to_vec()),
        Some(row) => Err(Error::in_file(&recording.file)(format!(
            "{}: the corrector rejected it, so there is no joint command for it; run `trued correct` without --dynamic to see why",
            source.at(recording.t_s[row])
        ))),
    }
}
