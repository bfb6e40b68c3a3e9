//! Pose of the instrument and positions of the targets: as stated in the recording, otherwise estimated from it.
//!
//! Without recorded data the frame is the base, which is stated in the result. The robot is not
//! fitted.

use diagnosis::nests::Nests;
use diagnosis::{Campaign, Hypothesis, Influence, Settings, fit, from_recording};
use glam::DVec3;
use physics::Frame;
use recording::model::RobotModel;
use recording::series::{Channel, Recording};

use super::lacking;
use crate::exit::Failure;

/// Maximum number of rows for the fit of frame and targets.
const ROWS: usize = 2000;

/// The instrument's place.
#[derive(Debug)]
pub(super) struct Stand {
    /// Base coordinates to measuring coordinates, the instrument's wandering apart.
    measuring_from_base: Frame,
    /// Targets on the tool, tool frame, m.
    pub(super) targets: Vec<DVec3>,
    /// Whether measured positions are in the base frame.
    pub(super) in_base: bool,
    /// How the instrument wandered.
    pub(super) nests: Option<Nests>,
}

impl Stand {
    /// Base coordinates to those that the instrument reads in a row.
    pub(super) fn measuring_from_base(&self, row: usize) -> Frame {
        let seen_from_laid = self.nests.as_ref().map(|nests| nests.laid_from_seen(row).inverse());
        seen_from_laid
            .map_or(self.measuring_from_base, |seen| seen.after(&self.measuring_from_base))
    }

    pub(super) fn find(model: &RobotModel, recording: &Recording) -> Result<Self, Failure> {
        let about = &recording.about;
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
            targets: known.into_iter().flatten().map(DVec3::from_array).collect(),
            in_base: true,
            nests: Nests::of(recording),
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
            nests: campaign.recordings.first().and_then(|source| source.nests.clone()),
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
