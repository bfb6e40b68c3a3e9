//! Starting point of a plan: the model alone, or existing measurements.
//!
//! With recordings, targets and frame are taken from a fit, and the noise from its residuals. Gross
//! errors are always reported.

use super::setup::{LENGTH_SIGMA_M, MeasuringSetup};
use super::{ExistingMeasurements, Task};
use crate::campaign::Campaign;
use crate::campaign_import::{self, CampaignError};
use crate::fit::{FitSettings, fit};
use crate::fit_result::Fit;
use crate::gross_errors;
use crate::robust_weights::Influence;
use physics::Arm;
use recording::model::RobotModel;
use recording::series::Recording;

/// A task, and the existing measurements.
#[derive(Clone, Debug)]
pub struct StartingPoint {
    /// The task; [`Task::test_poses`] is empty.
    pub task: Task,
    /// Measurements with their fit; `None` if there are no readings yet.
    pub measured: Option<(Campaign, Fit)>,
}

/// Why the recordings cannot be used as a starting point.
#[derive(Debug, thiserror::Error)]
pub enum NoStartingPoint {
    /// A recording cannot be used.
    #[error(transparent)]
    Unusable(#[from] CampaignError),
    /// A gross error in the recordings.
    #[error("what was measured does not fit the model: {0}")]
    GrossFault(String),
}

impl StartingPoint {
    /// The task of a setup, with frame, targets and noise estimated from recordings of the robot.
    ///
    /// ```
    /// use diagnosis::plan::setup::MeasuringSetup;
    /// use diagnosis::plan::starting_point::StartingPoint;
    /// use recording::model::RobotModel;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let model = RobotModel::read("irb120".as_ref())?;
    /// let start = StartingPoint::of(&model, &[], &MeasuringSetup::default())?;
    /// assert_eq!(start.measured_poses(), 0);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`NoStartingPoint`] if a recording cannot be used, or contradicts the model.
    pub fn of(
        model: &RobotModel,
        recordings: &[Recording],
        setup: &MeasuringSetup,
    ) -> Result<Self, NoStartingPoint> {
        let mut task = setup.task(model);
        let Some(campaign) = readings(&model.physics.arm, recordings)? else {
            return Ok(Self { task, measured: None });
        };
        if let Some(fault) = gross_errors::detect_global_errors(&campaign, &model.physics).first() {
            return Err(NoStartingPoint::GrossFault(fault.message.clone()));
        }
        let used = vec![true; campaign.poses.len()];
        let settings = FitSettings::full(&used, Influence::Huber);
        let found = fit(&campaign, &task.hypothesis, &settings);
        task.hypothesis.model = found.hypothesis.model.clone();
        task.surroundings = found.surroundings.clone();
        task.noise = setup.noise(length_sigma_m(&campaign, &found).unwrap_or(LENGTH_SIGMA_M));
        Ok(Self { task, measured: Some((campaign, found)) })
    }

    /// The existing measurements.
    #[must_use]
    pub fn known(&self) -> Option<ExistingMeasurements<'_>> {
        self.measured.as_ref().map(|(campaign, fit)| ExistingMeasurements { campaign, fit })
    }

    /// Number of poses with readings.
    #[must_use]
    pub fn measured_poses(&self) -> usize {
        let poses = self.measured.iter().flat_map(|(campaign, _)| &campaign.poses);
        poses.filter(|pose| !pose.seen.is_empty()).count()
    }
}

/// The measurements; `None` if the recordings contain no values yet.
fn readings(arm: &Arm, recordings: &[Recording]) -> Result<Option<Campaign>, CampaignError> {
    if recordings.is_empty() {
        return Ok(None);
    }
    match campaign_import::campaign(arm, recordings) {
        Ok(campaign) => Ok(Some(campaign)),
        Err(CampaignError::NothingMeasured { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Standard uncertainty of a length, estimated from the residuals of the fit, m.
fn length_sigma_m(campaign: &Campaign, found: &Fit) -> Option<f64> {
    let mut observations = campaign.poses.iter().flat_map(|pose| &pose.seen);
    let length = observations.find(|observation| observation.reading.is_length())?;
    Some(found.factors.get(length.instrument)? / length.whitening.x_axis.length())
}
