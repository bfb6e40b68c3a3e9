//! Pose of the instrument and positions of the targets: as stated in the recording, otherwise estimated from it.
//!
//! Without recorded data the frame is the base, which is stated in the result. The robot is not
//! fitted.

use super::SimulationError;
use crate::campaign::{Campaign, Pose};
use crate::campaign_import;
use crate::fit::{FitSettings, fit};
use crate::frame_drift::FrameDrift;
use crate::hypothesis::Hypothesis;
use crate::robust_weights::Influence;
use glam::DVec3;
use physics::Frame;
use recording::model::RobotModel;
use recording::series::{Channel, Recording};

/// Maximum number of rows for the fit of frame and targets.
const ROWS: usize = 2000;

/// Pose of the instrument, with target positions.
#[derive(Debug)]
pub struct Station {
    /// Transformation from base coordinates to measuring coordinates, without the instrument's drift.
    measuring_from_base: Frame,
    /// Targets on the tool, tool frame, m.
    pub targets_tool_m: Vec<DVec3>,
    /// Whether measured positions are in the base frame.
    pub in_base: bool,
    /// Drift of the instrument.
    drift: Option<FrameDrift>,
}

impl Station {
    /// Transformation from base coordinates to the instrument's coordinates in a row.
    #[must_use]
    pub fn measuring_from_base(&self, row: usize) -> Frame {
        let seen_from_laid =
            self.drift.as_ref().map(|drift| drift.common_from_measured(row).inverse());
        seen_from_laid
            .map_or(self.measuring_from_base, |drift| drift.after(&self.measuring_from_base))
    }

    /// The station of a recording.
    ///
    /// # Errors
    /// A target's position is unknown, or the recording cannot be used for a fit.
    pub fn find(model: &RobotModel, recording: &Recording) -> Result<Self, SimulationError> {
        let about = &recording.metadata;
        let targets = 0..recording.target_count();
        let on_link = |t: &usize| about.targets_on_link.contains_key(t);
        let known: Vec<_> = targets
            .map(|t| about.targets_tool.get(&t).copied().or(on_link(&t).then_some([0.0; 3])))
            .collect();
        let measured =
            |channel: &Channel| matches!(channel, Channel::Position(_) | Channel::Target(..));
        let sampled = |channel: Channel| {
            recording.column(channel).is_some_and(|column| column.iter().any(|x| x.is_finite()))
        };
        let is_measured = recording.channels().filter(measured).any(sampled);
        let is_stated = about.measured_in_base && known.iter().all(Option::is_some);
        if is_measured && !is_stated {
            return Self::fitted(model, recording);
        }
        if let Some(target) = known.iter().position(Option::is_none) {
            let file = recording.file.display().to_string();
            return Err(SimulationError::TargetUnknown { file, target: target + 1 });
        }
        Ok(Self {
            measuring_from_base: Frame::IDENTITY,
            targets_tool_m: known.into_iter().flatten().map(DVec3::from_array).collect(),
            in_base: true,
            drift: FrameDrift::of(recording),
        })
    }

    fn fitted(model: &RobotModel, recording: &Recording) -> Result<Self, SimulationError> {
        let one = std::slice::from_ref(recording);
        let campaign = campaign_import::campaign(&model.physics.arm, one)?;
        let used = evenly_spread(&campaign);
        let settings = FitSettings::full(&used, Influence::Redescending);
        let found = fit(&campaign, &Hypothesis::fixed(model.physics), &settings).surroundings;
        let measuring_from_base = found.frames.first().map(|frame| frame.value.measuring_from_base);
        Ok(Self {
            measuring_from_base: measuring_from_base.unwrap_or(Frame::IDENTITY),
            targets_tool_m: found.targets.iter().map(|target| target.value).collect(),
            in_base: recording.metadata.measured_in_base,
            drift: campaign.recordings.first().and_then(|source| source.frame_drift.clone()),
        })
    }
}

/// Evenly spaced rows with measurements.
fn evenly_spread(campaign: &Campaign) -> Vec<bool> {
    let measured = campaign.poses.iter().filter(|pose| !pose.seen.is_empty()).count();
    let step = measured.div_ceil(ROWS).max(1);
    let mut number = 0;
    let used = |pose: &Pose| {
        if pose.seen.is_empty() {
            return false;
        }
        number += 1;
        (number - 1) % step == 0
    };
    campaign.poses.iter().map(used).collect()
}
