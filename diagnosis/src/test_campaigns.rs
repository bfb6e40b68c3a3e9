//! Synthetic campaigns for tests, with the robot of the thesis.

use crate::campaign_simulation;
use crate::extrinsics::{Extrinsics, FitParameter, MeasuringFrame};
use crate::{
    Arrival, Campaign, Instrument, Observation, Pose, Reading, ReadingNoise, RecordingInfo,
    ToolPoint,
};
use glam::DVec3;
use physics::frame::rotation_from_vector;
use physics::{Frame, Inputs, JOINTS_MAX, Model};
use recording::model::presets::preset;

/// The true robot of the synthetic campaigns: that of the thesis.
pub(crate) fn thesis_robot() -> Model {
    preset("irb1600-6-145-thesis").expect("preset").model().expect("sound").physics
}

/// The nominal model of its controller.
pub(crate) fn nominal_robot() -> Model {
    preset("irb1600-6-145").expect("preset").model().expect("sound").physics
}

/// Poses without measured values, with `targets` reflectors on the tool, or only its TCP if there
/// are none.
pub(crate) fn unmeasured_campaign(targets: usize, count: u32) -> Campaign {
    let frame =
        Frame::new(rotation_from_vector(DVec3::new(0.02, 0.01, 2.1)), DVec3::new(2.0, -1.0, 0.4));
    let station = MeasuringFrame { measuring_from_base: frame, pivot: DVec3::ZERO };
    let places =
        [DVec3::new(0.1, 0.0, 0.05), DVec3::new(-0.05, 0.09, 0.06), DVec3::new(-0.05, -0.08, 0.1)];
    let surroundings = Extrinsics {
        frames: vec![FitParameter::unknown(station)],
        targets: places[..targets].iter().map(|p| FitParameter::unknown(*p)).collect(),
        ..Extrinsics::default()
    };
    let readings: Vec<Reading> = match targets {
        0 => vec![Reading::Point { place: ToolPoint::Tcp, frame: 0, at: DVec3::ZERO }],
        n => (0..n)
            .map(|t| Reading::Point { place: ToolPoint::Target(t), frame: 0, at: DVec3::ZERO })
            .collect(),
    };
    let whitening = ReadingNoise::Equal(5e-5).whitening(DVec3::ZERO).expect("sound");
    let observe = |reading: &Reading| Observation { reading: *reading, whitening, instrument: 0 };
    let poses = (0..count).map(|row| {
        let mut q = [0.0; JOINTS_MAX];
        for (joint, slot) in q.iter_mut().enumerate().take(6) {
            // Multiples of irrational numbers fill the range evenly.
            let part = (f64::from(row + 1)
                * [0.7548, 0.5698, 0.6180, 0.8191, 0.6711, 0.5497][joint])
                .fract();
            *slot = (part - 0.5) * [2.0, 1.2, 1.2, 3.0, 2.4, 3.0][joint];
        }
        let inputs = Inputs::at_rest(q);
        Pose {
            inputs,
            arrival: Arrival::Settled,
            recording: 0,
            row: row as usize,
            seen: readings.iter().map(observe).collect(),
        }
    });
    Campaign {
        poses: poses.collect(),
        surroundings,
        instruments: vec![Instrument {
            name: "tracker".to_owned(),
            noise_is_known: true,
            ..Instrument::default()
        }],
        recordings: vec![RecordingInfo::of_poses("made")],
    }
}

/// Sixty simulated poses of the thesis' robot.
pub(crate) fn simulated_campaign(targets: usize) -> Campaign {
    let campaign = unmeasured_campaign(targets, 60);
    campaign_simulation::simulate_readings(
        &campaign,
        &thesis_robot(),
        &campaign.surroundings,
        1.0,
        5,
    )
}
