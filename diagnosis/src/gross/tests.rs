//! The thesis' robot, measured, with one thing grossly wrong at a time.

use super::*;
use crate::simulate;
use crate::surroundings::{Station, Surroundings};
use crate::{Arrival, Instrument, Noise, Observation, Pose};
use physics::frame::rotation_from_vector;
use physics::{Frame, Inputs, JOINTS_MAX};
use recording::model::presets::preset;

fn thesis() -> Model {
    preset("irb1600-6-145-thesis").expect("preset").model().expect("sound").physics
}

fn nominal() -> Model {
    preset("irb1600-6-145").expect("preset").model().expect("sound").physics
}

/// Sixty poses; `targets` on the tool, or its TCP where there are none.
fn measured(targets: usize) -> Campaign {
    let frame =
        Frame::new(rotation_from_vector(DVec3::new(0.02, 0.01, 2.1)), DVec3::new(2.0, -1.0, 0.4));
    let station = Station { measuring_from_base: frame, pivot: DVec3::ZERO };
    let places =
        [DVec3::new(0.1, 0.0, 0.05), DVec3::new(-0.05, 0.09, 0.06), DVec3::new(-0.05, -0.08, 0.1)];
    let surroundings = Surroundings {
        frames: vec![Fitted::unknown(station)],
        targets: places[..targets].iter().map(|p| Fitted::unknown(*p)).collect(),
        ..Surroundings::default()
    };
    let seen: Vec<Reading> = match targets {
        0 => vec![Reading::Point { place: Place::Tcp, frame: 0, at: DVec3::ZERO }],
        n => (0..n)
            .map(|t| Reading::Point { place: Place::Target(t), frame: 0, at: DVec3::ZERO })
            .collect(),
    };
    let whitening = Noise::Equal(5e-5).whitening(DVec3::ZERO).expect("sound");
    let observe = |reading: &Reading| Observation { reading: *reading, whitening, instrument: 0 };
    let poses = (0..60_u32).map(|row| {
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
            seen: seen.iter().map(observe).collect(),
        }
    });
    let empty = Campaign {
        poses: poses.collect(),
        surroundings: surroundings.clone(),
        instruments: vec![Instrument { name: "tracker".to_owned(), noise_is_known: true }],
        recordings: vec!["made".to_owned()],
    };
    simulate::readings(&empty, &thesis(), &surroundings, 1.0, 5)
}

fn said(campaign: &Campaign) -> Vec<String> {
    suspicions(campaign, &nominal()).into_iter().map(|s| s.says).collect()
}

#[test]
fn a_sound_recording_of_an_uncalibrated_robot_raises_no_suspicion() {
    for targets in [0, 1, 3] {
        assert_eq!(said(&measured(targets)), Vec::<String>::new(), "{targets} targets");
    }
}

#[test]
fn each_gross_fault_is_named() {
    let faults: [(&str, Campaign); 7] = [
        ("joints 2 and 3 are swapped", with_joints(&measured(3), |q| q.swap(1, 2))),
        ("joints 4 and 6 are swapped", with_joints(&measured(3), |q| q.swap(3, 5))),
        (
            "in radians where degrees are said",
            with_joints(&measured(3), |q| q.iter_mut().for_each(|q| *q *= PI / 180.0)),
        ),
        (
            "in degrees where radians are said",
            with_joints(&measured(3), |q| q.iter_mut().for_each(|q| *q *= 180.0 / PI)),
        ),
        ("mirrored", with_points(&measured(3), |p| DVec3::new(p.y, p.x, p.z))),
        ("joint 5 counts the other way", with_joints(&measured(1), |q| q[4] = -q[4])),
        ("thousand times too small", with_points(&measured(0), |p| p * 1e-3)),
    ];
    for (wanted, campaign) in faults {
        let said = said(&campaign);
        assert!(said.first().is_some_and(|s| s.contains(wanted)), "{wanted}: {said:?}");
    }
}

#[test]
fn a_wrong_tool_is_told_from_a_wrong_robot() {
    let campaign = measured(0);
    let mut model = nominal();
    model.arm.tool.tcp += DVec3::new(0.03, 0.0, 0.05);
    let found = suspicions(&campaign, &model);
    assert!(found[0].says.contains("the tool is not the model's"), "{found:?}");
    let other = preset("fr3").expect("preset").model().expect("sound").physics;
    let found = suspicions(&campaign, &other);
    assert!(found[0].says.contains("this robot's"), "{found:?}");
}

#[test]
fn measurements_that_stand_a_row_late_are_noticed() {
    let sound = measured(3);
    let mut late = sound.clone();
    for k in 1..60 {
        late.poses[k].seen.clone_from(&sound.poses[k - 1].seen);
    }
    let said = said(&late);
    assert!(said.first().is_some_and(|s| s.contains("one row after")), "{said:?}");
}
