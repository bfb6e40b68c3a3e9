//! Accuracy and repeatability (ISO 9283) of the poses in a recording.

use physics::Arm;

use super::{PoseVisits, VISITS_REQUIRED, pose_visits};
use crate::campaign::Campaign;
use crate::iso9283::{self, DistanceFigures, IsoError, Placement, PoseFigures};

/// A pose with its characteristics.
#[derive(Clone, Debug)]
pub struct EvaluatedPose {
    /// Command and visits.
    pub visits: PoseVisits,
    /// Accuracy and repeatability.
    pub figures: PoseFigures,
}

/// Pose accuracy and repeatability of a recording.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// Poses that were visited at least twice, in the order of the first visits.
    pub poses: Vec<EvaluatedPose>,
    /// Distance accuracy and repeatability of the two poses farthest apart, independent of the frame; `None` if the measured point of the tool is
    /// unknown, or there is only one pose.
    pub distance: Option<DistanceFigures>,
    /// Whether the measuring frame is known relative to the base.
    pub is_frame_known: bool,
    /// Whether the position of the measured point on the tool is known.
    pub is_point_known: bool,
}

impl Evaluation {
    /// Evaluates the measurements of `arm`. An unknown frame is not fitted, since the fit would absorb part of the error.
    ///
    /// # Errors
    /// [`IsoError`] if no pose was visited twice, or values are not finite.
    pub fn of(arm: &Arm, campaign: &Campaign) -> Result<Self, IsoError> {
        let around = &campaign.surroundings;
        let is_frame_known = around.frames.iter().all(|frame| !frame.free);
        let is_point_known = around.targets.iter().all(|target| !target.free);
        let found = pose_visits(arm, campaign);
        if found.is_empty() {
            return Err(IsoError::NoVisits);
        }
        let distance = distance(&found).filter(|_| is_point_known);
        let evaluated = |visits: PoseVisits| {
            let figures = iso9283::pose_figures(&visits.command, &visits.attained)?;
            Ok(EvaluatedPose { visits, figures })
        };
        let poses = found.into_iter().map(evaluated).collect::<Result<_, IsoError>>()?;
        Ok(Self { poses, distance, is_frame_known, is_point_known })
    }

    /// Whether accuracy can be evaluated: it requires the measuring frame and the measured point.
    #[must_use]
    pub fn has_accuracy(&self) -> bool {
        self.is_frame_known && self.is_point_known
    }

    /// Whether every pose was visited as often as the standard requires ([`VISITS_REQUIRED`]).
    #[must_use]
    pub fn has_all_visits(&self) -> bool {
        self.poses.iter().all(|pose| pose.visits.attained.len() >= VISITS_REQUIRED)
    }
}

/// Distance accuracy and repeatability of the two poses farthest apart.
fn distance(found: &[PoseVisits]) -> Option<DistanceFigures> {
    let place = |pose: &PoseVisits| Placement::point(pose.command.position_m);
    let pairs = (0..found.len()).flat_map(|i| (i + 1..found.len()).map(move |j| (i, j)));
    let length = |(i, j): &(usize, usize)| {
        found[*i].command.position_m.distance(found[*j].command.position_m)
    };
    let (i, j) = pairs.max_by(|a, b| length(a).total_cmp(&length(b)))?;
    let visits = found[i].attained.iter().zip(&found[j].attained);
    let visits: Vec<[Placement; 2]> = visits
        .map(|(a, b)| [Placement::point(a.position_m), Placement::point(b.position_m)])
        .collect();
    iso9283::distance_figures([place(&found[i]), place(&found[j])], &visits).ok()
}
