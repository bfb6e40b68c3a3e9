//! Screening of recordings before anything is fitted: time stamps, rows without measurements, stations of the instrument, channels that are frozen,
//! saturated, repeated over several rows or coarsely quantised, targets that slipped on the tool.
//!
//! Read in this order: `time_stamps`, `expected_values` (of a channel, in any measuring frame), `channel_faults`, `target_slip`.
//!
//! Measurements that are frozen or saturated while the arm moves are excluded and reported with channel, time and number of rows; a recording without
//! usable measurements is refused with the reason. No measured value is changed, and only the nominal kinematics is used.

mod channel_faults;
mod expected_values;
mod target_slip;
mod time_stamps;

use physics::Arm;
use recording::series::{Channel, Recording};

use crate::campaign_import::JointPositions;
use crate::frame_drift::FrameDrift;
use channel_faults::ChannelInspection;
use target_slip::separate_slipped_targets;

/// Result of the screening.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ScreeningReport {
    /// Messages for the user, one sentence each.
    pub notes: Vec<String>,
    /// Reasons why nothing can be concluded; empty if usable measurements remain.
    pub doubts: Vec<String>,
}

/// Screens recordings of the robot `arm` and excludes unusable measurements.
pub fn screen_recordings(arm: &Arm, recordings: &mut [Recording]) -> ScreeningReport {
    let mut all = ScreeningReport::default();
    let several = recordings.len() > 1;
    let mut new_target = recordings.iter().map(Recording::target_count).max().unwrap_or(0);
    for recording in recordings.iter_mut() {
        let mut notes = time_stamps::notes(recording);
        notes.extend(missing_value_notes(recording));
        notes.extend(FrameDrift::of(recording).map(|nests| nests.description()));
        // The conversion to poses, later, refuses a recording that lacks a joint, with a proper message.
        let Ok(q) = JointPositions::of(arm, recording) else { continue };
        let had_measurements = has_measurements(recording);
        notes.extend(ChannelInspection::new(arm, recording, &q).exclude_faulty_rows());
        notes.extend(separate_slipped_targets(recording, &mut new_target));
        let is_empty = had_measurements && !has_measurements(recording);
        let name = recording.file.file_name().map(|name| name.to_string_lossy().into_owned());
        let with_file_name = |note: String| match &name {
            Some(name) if several => format!("{name}: {note}"),
            _ => note,
        };
        let list = if is_empty { &mut all.doubts } else { &mut all.notes };
        list.extend(notes.into_iter().map(with_file_name));
    }
    all
}

/// Channels that form one measurement (the coordinates of a point, a quaternion, a link-side joint position), as far as the recording has them.
fn channel_groups(recording: &Recording) -> Vec<Vec<Channel>> {
    let mut groups = vec![(0..3).map(Channel::Position).collect::<Vec<_>>()];
    let on_links = &recording.metadata.targets_on_link;
    for target in (0..recording.target_count()).filter(|t| !on_links.contains_key(t)) {
        groups.push((0..3).map(|axis| Channel::Target(target, axis)).collect());
    }
    groups.push((0..4).map(Channel::Orientation).collect());
    groups.extend((0..recording.joint_count()).map(|joint| vec![Channel::Link(joint)]));
    groups.retain(|group| group.iter().all(|channel| recording.column(*channel).is_some()));
    groups
}

fn finite(recording: &Recording, channel: Channel, row: usize) -> Option<f64> {
    recording.column(channel)?.get(row).copied().filter(|value| value.is_finite())
}

/// Whether the recording contains any measurement, including distances and touches.
fn has_measurements(recording: &Recording) -> bool {
    let whole = |group: &Vec<Channel>, row| {
        group.iter().all(|channel| finite(recording, *channel, row).is_some())
    };
    let gauges = recording.channels().any(|channel| {
        matches!(channel, Channel::Distance(_) | Channel::TouchPlane | Channel::TouchSphere)
    });
    let groups = channel_groups(recording);
    gauges || (0..recording.len()).any(|row| groups.iter().any(|group| whole(group, row)))
}

/// Messages on groups that are missing in some rows.
fn missing_value_notes(recording: &Recording) -> Vec<String> {
    let mut notes = Vec::new();
    for group in channel_groups(recording) {
        let gaps = (0..recording.len())
            .filter(|row| group.iter().any(|channel| finite(recording, *channel, *row).is_none()));
        let (gaps, all) = (gaps.count(), recording.len());
        if gaps > 0 && gaps < all {
            notes.push(format!(
                "{} is missing in {gaps} of {all} rows",
                group_names(recording, &group)
            ));
        }
    }
    notes
}

/// Names of the columns of a group, as `x_mm, y_mm, z_mm`.
fn group_names(recording: &Recording, group: &[Channel]) -> String {
    let name = |channel: &Channel| column_name(recording, *channel);
    group.iter().map(name).collect::<Vec<_>>().join(", ")
}

/// Name of the column, with the units of its file.
fn column_name(recording: &Recording, channel: Channel) -> String {
    let kind = recording.joint_kind(channel.joint().unwrap_or(0));
    channel.name(channel.unit_in(recording.units, kind))
}

#[cfg(test)]
mod tests;
