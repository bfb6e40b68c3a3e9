//! Distances and touches of recordings as measurements of a campaign.
//!
//! Anchors, planes and spheres are in the base frame: a number denotes the same object in all recordings, known if any of these
//! states it.
//!
//! Parameters that no recording states are fitted; contradictions are errors. Objects without measurements are not fitted.

use super::CampaignError;
use crate::campaign::{Campaign, Instrument, Observation, Reading, ReadingNoise, ToolPoint};
use crate::extrinsics::{Anchor, Extrinsics, FitParameter, Plane, Sphere};
use glam::DVec3;
use physics::Arm;
use recording::series::{Channel, Distance, Recording, TouchedPlane, TouchedSphere};
use std::collections::BTreeMap;

/// Assumed standard uncertainty of distances and touches where none is stated, m; the fit estimates a factor on it.
const LENGTH_M: f64 = 2e-5;

/// Definitions of one kind of object, merged over all recordings.
fn merged<T: Copy + PartialEq + Default>(
    recordings: &[Recording],
    stem: &'static str,
    stated_by_index: impl Fn(&Recording) -> BTreeMap<usize, T>,
) -> Result<BTreeMap<usize, T>, CampaignError> {
    let mut all: BTreeMap<usize, T> = BTreeMap::new();
    for recording in recordings {
        for (index, object) in stated_by_index(recording) {
            let known = all.entry(index).or_insert(object);
            if *known == T::default() {
                *known = object;
            } else if object != *known && object != T::default() {
                let file = recording.file.display().to_string();
                return Err(CampaignError::Contradiction {
                    file,
                    what: format!("{stem}{}", index + 1),
                });
            }
        }
    }
    Ok(all)
}

/// Adds the extrinsic objects of all recordings, as far as they are known.
pub(super) fn add_extrinsic_objects(
    recordings: &[Recording],
    surroundings: &mut Extrinsics,
) -> Result<(), CampaignError> {
    let distances = merged(recordings, "distance", |recording| {
        let channels = recording.channels().filter_map(|channel| match channel {
            Channel::Distance(index) => Some(index),
            _ => None,
        });
        channels.map(|index| (index, distance(recording, index))).collect()
    })?;
    let planes = merged(recordings, "plane", |recording| {
        let planes = recording.metadata.gauges.planes.iter();
        planes.map(|(index, plane)| (*index, Some(*plane))).collect()
    })?;
    let spheres = merged(recordings, "sphere", |recording| {
        let mut spheres = BTreeMap::new();
        for number in recording.column(Channel::TouchSphere).unwrap_or_default() {
            if let Some(index) = place(*number) {
                let stated = recording.metadata.gauges.spheres.get(&index).copied();
                spheres.insert(index, stated.unwrap_or_default());
            }
        }
        spheres
    })?;
    surroundings.anchors = all(&distances, anchor, NO_ANCHOR);
    surroundings.planes = all(&planes, |plane| plane.as_ref().map_or(NO_PLANE, plane_of), NO_PLANE);
    surroundings.spheres = all(&spheres, sphere, NO_SPHERE);
    Ok(())
}

/// Placeholder for unused numbers: known, so that it is never fitted.
const NO_ANCHOR: Anchor =
    Anchor { place: FitParameter::known(DVec3::ZERO), offset_m: FitParameter::known(0.0) };
const NO_PLANE: FitParameter<Plane> =
    FitParameter::known(Plane { normal: DVec3::Z, offset_m: 0.0 });
const NO_SPHERE: Sphere =
    Sphere { centre: FitParameter::known(DVec3::ZERO), radius_m: FitParameter::known(0.0) };

/// One object for each number up to the highest, with `none` for missing ones.
fn all<T, U: Copy>(
    stated_by_index: &BTreeMap<usize, T>,
    quantity: impl Fn(&T) -> U,
    none: U,
) -> Vec<U> {
    let count = stated_by_index.keys().next_back().map_or(0, |highest| highest + 1);
    (0..count).map(|index| stated_by_index.get(&index).map_or(none, &quantity)).collect()
}

fn distance(recording: &Recording, index: usize) -> Distance {
    recording.metadata.gauges.distances.get(&index).copied().unwrap_or_default()
}

/// 0-based index of a touched object; `None` if nothing was touched.
fn place(number: f64) -> Option<usize> {
    (number >= 1.0).then(|| number as usize - 1)
}

fn anchor(stated: &Distance) -> Anchor {
    let unknown = FitParameter::unknown(DVec3::ZERO);
    Anchor {
        place: stated
            .anchor_m
            .map_or(unknown, |position| FitParameter::known(DVec3::from_array(position))),
        offset_m: stated.offset_m.map_or(FitParameter::unknown(0.0), FitParameter::known),
    }
}

fn plane_of(stated: &TouchedPlane) -> FitParameter<Plane> {
    let normal = DVec3::from_array(stated.normal);
    let known = |offset_m| FitParameter::known(Plane { normal, offset_m });
    stated.offset_m.map_or(FitParameter::unknown(Plane { normal, offset_m: 0.0 }), known)
}

fn sphere(stated: &TouchedSphere) -> Sphere {
    let unknown = FitParameter::unknown(DVec3::ZERO);
    Sphere {
        centre: stated
            .centre_m
            .map_or(unknown, |position| FitParameter::known(DVec3::from_array(position))),
        radius_m: stated.radius_m.map_or(FitParameter::unknown(0.0), FitParameter::known),
    }
}

/// Whether a row contains a distance or a touch.
pub(super) fn is_read(recording: &Recording, row: usize) -> bool {
    let value = |channel| recording.column(channel).and_then(|column| column.get(row)).copied();
    let touches = |channel| value(channel).and_then(place).is_some();
    let distance = |channel| {
        matches!(channel, Channel::Distance(_)) && value(channel).is_some_and(f64::is_finite)
    };
    let probes = recording.metadata.gauges.probe.is_some();
    recording.channels().any(distance)
        || (probes && (touches(Channel::TouchPlane) || touches(Channel::TouchSphere)))
}

/// Adds the distances and touches of one recording to its poses, for the rows selected by `is_read`.
pub(super) fn read(
    campaign: &mut Campaign,
    index: usize,
    recording: &Recording,
    is_read: impl Fn(usize) -> bool,
) -> Result<(), CampaignError> {
    let mut readings: Vec<(usize, Reading, usize, ReadingNoise)> = Vec::new();
    let mut instrument = |what: &str, noise_is_known: bool| {
        let name = format!("{what} of {}", recording.file.display());
        let instrument = Instrument { name, noise_is_known, ..Instrument::default() };
        campaign.instruments.push(instrument);
        campaign.instruments.len() - 1
    };
    let noise = |sigma: Option<f64>| ReadingNoise::Equal(sigma.unwrap_or(LENGTH_M));
    let on_tool = |target: Option<usize>| target.map_or(ToolPoint::Tcp, ToolPoint::Target);
    for channel in recording.channels() {
        let Channel::Distance(anchor) = channel else { continue };
        let sigma = recording.sigma(channel);
        let instrument_index = instrument(&format!("distance {}", anchor + 1), sigma.is_some());
        let place = on_tool(distance(recording, anchor).target);
        let column = recording.column(channel).unwrap_or_default().iter().enumerate();
        for (row, length_m) in column.filter(|(_, length)| length.is_finite()) {
            let reading = Reading::Distance { place, anchor, length_m: *length_m };
            readings.push((row, reading, instrument_index, noise(sigma)));
        }
    }
    if let Some(probe) = recording.metadata.gauges.probe {
        let (on, radius_m) = (on_tool(probe.target), probe.radius_m);
        let instrument_index = instrument("touches", probe.sigma_m.is_some());
        let mut touch = |channel: Channel, reading: &dyn Fn(usize) -> Reading| {
            let column = recording.column(channel).unwrap_or_default().iter().enumerate();
            let touched = column.filter_map(|(row, number)| Some((row, place(*number)?)));
            let noise = noise(probe.sigma_m);
            readings.extend(touched.map(|(row, touched_object)| {
                (row, reading(touched_object), instrument_index, noise)
            }));
        };
        touch(Channel::TouchPlane, &|plane| Reading::Plane { place: on, plane, radius_m });
        touch(Channel::TouchSphere, &|sphere| Reading::Sphere { place: on, sphere, radius_m });
    }
    // Poses of a recording are a subset of its rows, in the same order.
    let first = campaign.poses.partition_point(|pose| pose.recording < index);
    let poses = campaign.poses.get_mut(first..).unwrap_or_default();
    for (row, reading, instrument, noise) in readings.into_iter().filter(|one| is_read(one.0)) {
        let file = || recording.file.display().to_string();
        let refused = || CampaignError::Sigma { file: file(), what: "distances and touches" };
        let whitening = noise.whitening(DVec3::ZERO).ok_or_else(refused)?;
        let pose_index = poses.binary_search_by_key(&row, |pose| pose.row);
        if let Some(pose) = pose_index.ok().and_then(|pose_index| poses.get_mut(pose_index)) {
            pose.seen.push(Observation { reading, whitening, instrument });
        }
    }
    Ok(())
}

/// Excludes targets on the base or on links from every fit: they are not points of the tool.
pub(super) fn exclude_link_targets(
    arm: &Arm,
    campaign: &mut Campaign,
    recordings: &[Recording],
) -> Result<(), CampaignError> {
    for (target, link) in crate::link_targets::link_target_places(recordings) {
        if link >= arm.count() {
            return Err(CampaignError::NoSuchLink {
                target: target + 1,
                link,
                joints: arm.count(),
            });
        }
        for pose in &mut campaign.poses {
            pose.seen.retain(|observation| {
                !matches!(observation.reading, Reading::Point { place: ToolPoint::Target(t), .. } if t == target)
            });
        }
        if let Some(place) = campaign.surroundings.targets.get_mut(target) {
            place.free = false;
        }
    }
    Ok(())
}

/// Excludes measuring frames without measurements from every fit.
pub(super) fn fix_unused_frames(campaign: &mut Campaign) {
    let mut used = vec![false; campaign.surroundings.frames.len()];
    for observation in campaign.poses.iter().flat_map(|pose| &pose.seen) {
        if let Reading::Point { frame, .. } | Reading::Orientation { frame, .. } =
            observation.reading
        {
            used[frame] = true;
        }
    }
    for (frame, used) in campaign.surroundings.frames.iter_mut().zip(used) {
        frame.free &= used;
    }
}
