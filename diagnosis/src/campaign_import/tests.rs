//! Synthetic recordings with known stations.

use super::*;
use crate::test_campaigns::{nominal_robot, thesis_robot};
use crate::{FitSettings, Hypothesis, Influence, campaign_simulation, fit};
use recording::series::Recording;

const ROWS: usize = 90;

/// Settled poses; the rows alternate between three stations if `stations` is set.
fn recorded(stations: bool) -> Recording {
    let mut made = Recording::new((0..ROWS).map(|row| row as f64).collect());
    for joint in 0..6 {
        let pace = [0.7548, 0.5698, 0.6180, 0.8191, 0.6711, 0.5497][joint];
        let swing = [2.0, 1.2, 1.2, 3.0, 2.4, 3.0][joint];
        let q = |row: usize| ((row as f64 * pace).fract() - 0.5) * swing;
        made.set(Channel::Command(joint), (0..ROWS).map(q).collect());
    }
    for axis in 0..3 {
        made.set(Channel::Position(axis), vec![0.0; ROWS]);
    }
    if stations {
        let numbers = (0..ROWS).map(|row| [4.0, 2.0, 9.0][row % 3]).collect();
        made.set(Channel::Station, numbers);
    }
    made.set(Channel::BaseTilt(0), (0..ROWS).map(|row| 1e-3 * (row % 7) as f64).collect());
    made.metadata.kind = RecordingKind::Poses;
    made
}

/// Simulated measurements of the thesis' robot by trackers at three stations, without noise.
fn imported() -> Campaign {
    let campaign = campaign(&thesis_robot().arm, &[recorded(true)]).expect("usable");
    let mut truth = campaign.surroundings.clone();
    for (place, frame) in truth.frames.iter_mut().enumerate() {
        let turn = DMat3::from_rotation_z(2.0 * place as f64) * DMat3::from_rotation_x(0.02);
        frame.value.measuring_from_base = Frame::new(turn, DVec3::new(2.0, place as f64, 0.3));
    }
    campaign_simulation::simulate_readings(&campaign, &thesis_robot(), &truth, 0.0, 1)
}

fn left_m(campaign: &Campaign) -> f64 {
    let used = vec![true; campaign.poses.len()];
    let settings = FitSettings::full(&used, Influence::Huber);
    let found = fit(campaign, &Hypothesis::fixed(thesis_robot()), &settings);
    found.residuals(campaign).iter().map(|residual| residual.residual.length()).fold(0.0, f64::max)
}

#[test]
fn rows_of_one_station_share_a_frame_and_others_have_their_own() {
    let imported = imported();
    assert_eq!(imported.surroundings.frames.len(), 3);
    assert!(left_m(&imported) < 1e-7, "{}", left_m(&imported));
    let mut one = campaign(&thesis_robot().arm, &[recorded(false)]).expect("usable");
    assert_eq!(one.surroundings.frames.len(), 1);
    for (pose, truth) in one.poses.iter_mut().zip(&imported.poses) {
        let Reading::Point { at, .. } = truth.seen[0].reading else { continue };
        pose.seen[0].reading = Reading::Point { place: ToolPoint::Tcp, frame: 0, at };
    }
    assert!(left_m(&one) > 0.1, "{}", left_m(&one));
}

#[test]
fn the_stand_of_the_base_is_read_row_by_row_and_matters() {
    let mut imported = imported();
    assert!((imported.poses[6].inputs.base_tilt - DVec3::X * 6e-3).length() < 1e-15);
    imported.poses.iter_mut().for_each(|pose| pose.inputs.base_tilt = DVec3::ZERO);
    assert!(left_m(&imported) > 1e-3, "{}", left_m(&imported));
}

#[test]
fn a_station_of_one_number_is_one_place_in_all_recordings() {
    let two = campaign(&nominal_robot().arm, &[recorded(true), recorded(true)]).expect("usable");
    assert_eq!(two.surroundings.frames.len(), 3);
    let Reading::Point { frame, .. } = two.poses[ROWS + 1].seen[0].reading else {
        unreachable!("a point")
    };
    assert_eq!(frame, 1);
}
