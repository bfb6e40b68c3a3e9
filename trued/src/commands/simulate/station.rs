//! Where the instrument stands and where its targets sit on the tool: as the recording says, else as what was recorded shows.
//!
//! Promises: without anything recorded the frame is the base, and that is said in the result. Never: a fit of the robot.

use diagnosis::{Campaign, Hypothesis, Influence, Settings, fit, from_recording};
use glam::DVec3;
use physics::Frame;
use recording::model::RobotModel;
use recording::series::{Channel, Recording};

use super::lacking;
use crate::exit::Failure;

/// Rows that a fit of frame and targets looks at, at most.
const ROWS: usize = 2000;

/// The instrument's place.
#[derive(Debug)]
pub(super) struct Stand {
    /// Base coordinates to measuring coordinates.
    pub(super) measuring_from_base: Frame,
    /// Targets on the tool, tool frame, m.
    pub(super) targets: Vec<DVec3>,
    /// Whether measured positions are in the base frame.
    pub(super) in_base: bool,
}

impl Stand {
    pub(super) fn find(model: &RobotModel, recording: &Recording) -> Result<Self, Failure> {
        let about = &recording.about;
        let targets = 0..recording.target_count();
        let known: Vec<_> = targets.map(|t| about.targets_tool.get(&t)).collect();
        let measured =
            |channel: &Channel| matches!(channel, Channel::Position(_) | Channel::Target(..));
        let sampled = |channel: Channel| {
            recording.column(channel).is_some_and(|column| column.iter().any(|x| x.is_finite()))
        };
        let anything = recording.channels().filter(measured).any(sampled);
        let said = about.measured_in_base && known.iter().all(Option::is_some);
        if anything && !said {
            return Self::fitted(model, recording);
        }
        if let Some(target) = known.iter().position(Option::is_none) {
            return Err(lacking(format!(
                "{}: where target {number} sits on the tool is not known, and nothing was recorded of it: give target{number}_mm in the TOML",
                recording.file.display(),
                number = target + 1
            )));
        }
        Ok(Self {
            measuring_from_base: Frame::IDENTITY,
            targets: known.into_iter().flatten().map(|place| DVec3::from_array(*place)).collect(),
            in_base: true,
        })
    }

    fn fitted(model: &RobotModel, recording: &Recording) -> Result<Self, Failure> {
        let one = std::slice::from_ref(recording);
        let campaign = from_recording::campaign(&model.physics.arm, one).map_err(Failure::input)?;
        let used = spread(&campaign);
        let settings = Settings {
            used: &used,
            influence: Influence::Redescending,
            from: None,
            effort: diagnosis::fit::Effort::Full,
        };
        let found = fit(&campaign, &Hypothesis::fixed(model.physics), &settings).surroundings;
        let measuring_from_base = found.frames.first().map(|frame| frame.value.measuring_from_base);
        Ok(Self {
            measuring_from_base: measuring_from_base.unwrap_or(Frame::IDENTITY),
            targets: found.targets.iter().map(|target| target.value).collect(),
            in_base: recording.about.measured_in_base,
        })
    }
}

/// Rows with readings, evenly spread.
fn spread(campaign: &Campaign) -> Vec<bool> {
    let seen = campaign.poses.iter().filter(|pose| !pose.seen.is_empty()).count();
    let step = seen.div_ceil(ROWS).max(1);
    let mut number = 0;
    let used = |pose: &diagnosis::Pose| {
        if pose.seen.is_empty() {
            return false;
        }
        number += 1;
        (number - 1) % step == 0
    };
    campaign.poses.iter().map(used).collect()
}
