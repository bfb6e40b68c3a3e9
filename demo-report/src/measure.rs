//! The simulated robot runs its measuring program, accelerated, while a tracker measures three reflectors on its tool.
//!
//! It contains only what a recording of a real robot would contain: commands, loads, temperature,
//! noisy measurements. It never contains the truth.

use glam::DVec3;
use recording::series::{Channel, CoordinateFrame, FileUnits, Recording, RecordingMetadata};
use world::random::{Purpose, normals};
use world::survey::{REFLECTORS_TOOL, tool_poses};

use crate::scene::{Scene, TRACKER_M};

/// The recording of the measuring program.
pub(crate) fn measuring_recording(scene: &Scene) -> Recording {
    let rows = &scene.survey;
    let places = tool_poses(&scene.truth.model, rows);
    let mut recording = Recording::new(rows.iter().map(|row| row.time_s).collect());
    recording.units = FileUnits::WORKSHOP;
    recording.metadata = RecordingMetadata {
        model: Some("model.toml".to_owned()),
        measured_in_base: true,
        wrench_frame: Some(CoordinateFrame::Base),
        targets_tool: REFLECTORS_TOOL
            .map(|place| DVec3::to_array(&place))
            .into_iter()
            .enumerate()
            .collect(),
        ..RecordingMetadata::default()
    };
    for joint in 0..scene.model.physics.arm.count() {
        recording.set(Channel::Command(joint), rows.iter().map(|row| row.q[joint]).collect());
    }
    for axis in 0..3 {
        let wrench = |of: &dyn Fn(usize) -> DVec3| (0..rows.len()).map(|k| of(k)[axis]).collect();
        recording.set(Channel::Wrench(axis), wrench(&|k| rows[k].wrench_base.force));
        recording.set(Channel::Wrench(axis + 3), wrench(&|k| rows[k].wrench_base.moment));
    }
    recording.set(Channel::Ambient, rows.iter().map(|row| row.ambient_celsius).collect());
    for (number, reflector) in REFLECTORS_TOOL.iter().enumerate() {
        let positions = places.iter().enumerate().map(|(row, place)| {
            let stream = (row * REFLECTORS_TOOL.len() + number) as u32;
            let mut noise = normals(scene.seed, Purpose::Tracker, stream);
            place.point(*reflector) + DVec3::new(noise(), noise(), noise()) * TRACKER_M
        });
        let positions: Vec<DVec3> = positions.collect();
        for axis in 0..3 {
            let channel = Channel::Target(number, axis);
            recording.metadata.sigma.insert(channel, TRACKER_M);
            recording.set(channel, positions.iter().map(|position| position[axis]).collect());
        }
    }
    recording
}
