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
    said: impl Fn(&Recording) -> BTreeMap<usize, T>,
) -> Result<BTreeMap<usize, T>, CampaignError> {
    let mut all: BTreeMap<usize, T> = BTreeMap::new();
    for recording in recordings {
        for (at, thing) in said(recording) {
            let known = all.entry(at).or_insert(thing);
            if *known == T::default() {
                *known = thing;
            } else if thing != *known && thing != T::default() {
                let file = recording.file.display().to_string();
                return Err(CampaignError::Contradiction {
                    file,
                    what: format!("{stem}{}", at + 1),
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
            Channel::Distance(at) => Some(at),
            _ => None,
        });
        channels.map(|at| (at, distance(recording, at))).collect()
    })?;
    let planes = merged(recordings, "plane", |recording| {
        let planes = recording.metadata.gauges.planes.iter();
        planes.map(|(at, plane)| (*at, Some(*plane))).collect()
    })?;
    let spheres = merged(recordings, "sphere", |recording| {
        let mut spheres = BTreeMap::new();
        for number in recording.column(Channel::TouchSphere).unwrap_or_default() {
            if let Some(at) = place(*number) {
                let said = recording.metadata.gauges.spheres.get(&at).copied();
                spheres.insert(at, said.unwrap_or_default());
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
fn all<T, U: Copy>(said: &BTreeMap<usize, T>, thing: impl Fn(&T) -> U, none: U) -> Vec<U> {
    let count = said.keys().next_back().map_or(0, |highest| highest + 1);
    (0..count).map(|at| said.get(&at).map_or(none, &thing)).collect()
}

fn distance(recording: &Recording, at: usize) -> Distance {
    recording.metadata.gauges.distances.get(&at).copied().unwrap_or_default()
}

/// 0-based index of a touched object; `None` if nothing was touched.
fn place(number: f64) -> Option<usize> {
    (number >= 1.0).then(|| number as usize - 1)
}

fn anchor(said: &Distance) -> Anchor {
    let unknown = FitParameter::unknown(DVec3::ZERO);
    Anchor {
        place: said.anchor_m.map_or(unknown, |at| FitParameter::known(DVec3::from_array(at))),
        offset_m: said.offset_m.map_or(FitParameter::unknown(0.0), FitParameter::known),
    }
}

fn plane_of(said: &TouchedPlane) -> FitParameter<Plane> {
    let normal = DVec3::from_array(said.normal);
    let known = |offset_m| FitParameter::known(Plane { normal, offset_m });
    said.offset_m.map_or(FitParameter::unknown(Plane { normal, offset_m: 0.0 }), known)
}

fn sphere(said: &TouchedSphere) -> Sphere {
    let unknown = FitParameter::unknown(DVec3::ZERO);
    Sphere {
        centre: said.centre_m.map_or(unknown, |at| FitParameter::known(DVec3::from_array(at))),
        radius_m: said.radius_m.map_or(FitParameter::unknown(0.0), FitParameter::known),
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
        let own = instrument(&format!("distance {}", anchor + 1), sigma.is_some());
        let place = on_tool(distance(recording, anchor).target);
        let column = recording.column(channel).unwrap_or_default().iter().enumerate();
        for (row, length_m) in column.filter(|(_, length)| length.is_finite()) {
            let reading = Reading::Distance { place, anchor, length_m: *length_m };
            readings.push((row, reading, own, noise(sigma)));
        }
    }
    if let Some(probe) = recording.metadata.gauges.probe {
        let (on, radius_m) = (on_tool(probe.target), probe.radius_m);
        let own = instrument("touches", probe.sigma_m.is_some());
        let mut touch = |channel: Channel, reading: &dyn Fn(usize) -> Reading| {
            let column = recording.column(channel).unwrap_or_default().iter().enumerate();
            let touched = column.filter_map(|(row, number)| Some((row, place(*number)?)));
            let noise = noise(probe.sigma_m);
            readings.extend(touched.map(|(row, thing)| (row, reading(thing), own, noise)));
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
        let at = poses.binary_search_by_key(&row, |pose| pose.row);
        if let Some(pose) = at.ok().and_then(|at| poses.get_mut(at)) {
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
            pose.seen.retain(|seen| {
                !matches!(seen.reading, Reading::Point { place: ToolPoint::Target(t), .. } if t == target)
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
    for seen in campaign.poses.iter().flat_map(|pose| &pose.seen) {
        if let Reading::Point { frame, .. } | Reading::Orientation { frame, .. } = seen.reading {
            used[frame] = true;
        }
    }
    for (frame, used) in campaign.surroundings.frames.iter_mut().zip(used) {
        frame.free &= used;
    }
}
