//! Targets on the base or on a link instead of the tool: tilt of the base (thesis 3.6), and joint stiffness one by one (3.13).
//!
//! Such points are not part of the overall fit; they are transformed to the base frame by its estimated instrument poses. Targets on the last link
//! are targets of the tool and are not treated here.

use crate::campaign::{Campaign, Reading};
use crate::extrinsics::Extrinsics;
use crate::load_pairs::unloaded_twin;
use crate::single_joint::{ObservedTilt, tilt_of_two_targets};
use crate::stiffness::LoadedLink;
use glam::DVec3;
use physics::{Arm, Wrench};
use recording::series::{Channel, Recording};

/// A target on the base or on a link, measured at a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkPoint {
    /// Index into the campaign's poses.
    pub pose: usize,
    /// 0-based.
    pub target: usize,
    /// 0 for the base, otherwise the joint (1-based) that moves the link.
    pub link: usize,
    /// Measured position, m, base frame.
    pub at_base: DVec3,
}

/// Tilt of the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseTilt {
    /// Number of poses compared with the first.
    pub poses: usize,
    /// The pose with the largest tilt.
    pub pose: usize,
    /// The largest tilt.
    pub largest: ObservedTilt,
}

/// Location of targets that are not on the tool, as stated in any recording: target and link.
#[must_use]
pub fn link_target_places(recordings: &[Recording]) -> Vec<(usize, usize)> {
    let mut places: Vec<(usize, usize)> = recordings
        .iter()
        .flat_map(|recording| &recording.metadata.targets_on_link)
        .map(|(target, link)| (*target, *link))
        .collect();
    places.sort_unstable();
    places.dedup();
    places
}

/// All points on the base and on links, in the order of the poses.
#[must_use]
pub fn points(
    campaign: &Campaign,
    recordings: &[Recording],
    surroundings: &Extrinsics,
) -> Vec<LinkPoint> {
    let places = link_target_places(recordings);
    let mut points = Vec::new();
    for (index, pose) in campaign.poses.iter().enumerate() {
        let frame = pose.seen.iter().find_map(|observation| match observation.reading {
            Reading::Point { frame, .. } => Some(frame),
            _ => None,
        });
        let (Some(recording), Some(frame)) = (recordings.get(pose.recording), frame) else {
            continue;
        };
        let back = surroundings.frames[frame].value.measuring_from_base.inverse();
        for (target, link) in &places {
            let value = |axis: usize| {
                let column = recording.column(Channel::Target(*target, axis));
                column.and_then(|column| column.get(pose.row)).copied().unwrap_or(f64::NAN)
            };
            let position = DVec3::from_array([0, 1, 2].map(value));
            if position.is_finite() {
                let at_base = back.point(position);
                points.push(LinkPoint { pose: index, target: *target, link: *link, at_base });
            }
        }
    }
    points
}

/// The largest tilt of the base relative to the first pose, from the first two targets on it. `noise_m` is the standard deviation of one coordinate,
/// m.
#[must_use]
pub fn base_tilt(points: &[LinkPoint], noise_m: f64) -> Option<BaseTilt> {
    let on_base: Vec<&LinkPoint> = points.iter().filter(|point| point.link == 0).collect();
    let first = on_base.first()?.target;
    let second = on_base.iter().map(|point| point.target).find(|target| *target != first)?;
    let both = |group: &[&LinkPoint]| {
        let point_of = |target: usize| group.iter().find(|p| p.target == target).map(|p| p.at_base);
        Some((group.first()?.pose, [point_of(first)?, point_of(second)?]))
    };
    let mut both_seen = on_base.chunk_by(|a, b| a.pose == b.pose).filter_map(both);
    let (_, before) = both_seen.next()?;
    let tilts: Vec<(usize, ObservedTilt)> = both_seen
        .filter_map(|(pose, after)| Some((pose, tilt_of_two_targets(before, after, noise_m)?)))
        .collect();
    let (pose, largest) =
        *tilts.iter().max_by(|a, b| a.1.turn.length().total_cmp(&b.1.turn.length()))?;
    Some(BaseTilt { poses: tilts.len(), pose, largest })
}

/// Targets on links before and after the application of a load.
#[must_use]
pub fn loaded_links(arm: &Arm, campaign: &Campaign, points: &[LinkPoint]) -> Vec<LoadedLink> {
    let one = |point: &LinkPoint| {
        let joint = point.link.checked_sub(1)?;
        let pose = &campaign.poses[point.pose];
        if pose.inputs.wrench_base == Wrench::ZERO {
            return None;
        }
        let unloaded = unloaded_twin(arm, campaign, point.pose)?;
        let same = |other: &&LinkPoint| other.pose == unloaded && other.target == point.target;
        let before = points.iter().find(same)?.at_base;
        let (q, wrench_base) = (pose.inputs.q, pose.inputs.wrench_base);
        Some(LoadedLink { joint, q, wrench_base, before, after: point.at_base })
    };
    points.iter().filter_map(one).collect()
}
