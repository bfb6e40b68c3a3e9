//! Division into training and held-out poses: as stated in the recordings, otherwise drawn at random.

use diagnosis::hold_out::HoldOutSplit;
use diagnosis::{Campaign, Pose, campaign_import};
use recording::series::{HeldOut, Recording};
use report::pluralise;

use super::Settings;
use crate::error::Error;

/// How the poses were split.
pub(super) struct PoseSplit {
    pub(super) split: HoldOutSplit,
    /// The seed, if the held-out poses were drawn at random.
    pub(super) seed: Option<u64>,
}

impl PoseSplit {
    /// # Errors
    /// Too few poses on either side, or a station of the instrument that the training poses do not determine.
    pub(super) fn of(
        campaign: &Campaign,
        recordings: &[Recording],
        settings: &Settings,
    ) -> Result<Self, Error> {
        let is_said = |recording: &Recording| recording.metadata.heldout != HeldOut::Unspecified;
        let parts = if recordings.iter().any(is_said) {
            let held = campaign_import::held_out(campaign, recordings);
            let training: Vec<bool> = held.iter().map(|held| !held).collect();
            let trains = training.iter().filter(|trains| **trains).count();
            let description = format!(
                "{trains} of {} poses in the training set, as stated by `heldout` in the recordings",
                held.len()
            );
            Self { split: HoldOutSplit { training, description }, seed: None }
        } else {
            let seed = settings.seed;
            let split = HoldOutSplit::random(campaign, 1.0 - settings.heldout_share, seed);
            Self { split, seed: Some(seed) }
        };
        require_poses(campaign, &parts.split, settings.training_poses_least)?;
        require_station_readings(campaign, &parts.split, settings.station_readings_least)?;
        Ok(parts)
    }
}

/// Checks that lengths were measured on both sides.
fn require_poses(campaign: &Campaign, split: &HoldOutSplit, minimum: usize) -> Result<(), Error> {
    let is_length = |pose: &Pose| pose.seen.iter().any(|s| s.reading.is_length());
    let poses = campaign.poses.iter().zip(&split.training);
    let part = |wanted: bool| {
        poses.clone().filter(|(pose, trains)| **trains == wanted && is_length(pose)).count()
    };
    let (trains, held) = (part(true), part(false));
    if trains < minimum || held == 0 {
        return Err(Error::input(format!(
            "the tool was measured at {} for training and {held} held out, expected at least {minimum} and 1; measure more poses \
             (a few dozen for a robot's geometry), or change --heldout",
            pluralise(trains, "pose")
        )));
    }
    Ok(())
}

/// A station that the training poses do not determine cannot be validated.
fn require_station_readings(
    campaign: &Campaign,
    split: &HoldOutSplit,
    minimum: usize,
) -> Result<(), Error> {
    for (frame, station) in campaign.surroundings.frames.iter().enumerate() {
        let poses = campaign.poses.iter().zip(&split.training);
        let of_station = poses.filter(|(pose, _)| pose.frame() == Some(frame));
        let (trains, held): (Vec<_>, Vec<_>) = of_station.partition(|(_, trains)| **trains);
        let readings: usize = trains.iter().map(|(pose, _)| pose.seen.len()).sum();
        if station.free && readings < minimum && !held.is_empty() {
            return Err(Error::input(format!(
                "station {} of the instrument has {} in the training set and {} held out, expected at least {minimum} to estimate its \
                 pose; measure more from there, assign its rows to another `station`, or change --heldout",
                frame + 1,
                pluralise(readings, "reading"),
                held.len()
            )));
        }
    }
    Ok(())
}
