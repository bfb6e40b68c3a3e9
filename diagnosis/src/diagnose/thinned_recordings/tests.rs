//! Subsampling before the conversion to poses, compared with subsampling after it.

use super::*;
use crate::test_campaigns::nominal_robot;
use recording::series::Channel;

/// A path of `rows` rows at 100 Hz in two segments, with the tool measured in every third row, targets on the base and a link-side joint position.
fn long(rows: usize) -> Recording {
    let time = |row: usize| (row % (rows / 2)) as f64 * 0.01;
    let mut recording = Recording::new((0..rows).map(time).collect());
    recording.segment = (0..rows).map(|row| i64::from(row >= rows / 2)).collect();
    let column = |value: &dyn Fn(usize) -> f64| (0..rows).map(value).collect::<Vec<f64>>();
    for joint in 0..6 {
        let rate = 0.3 + 0.17 * joint as f64;
        let q = column(&|row| libm::sin(rate * time(row) * (1.0 + 1e-3 * time(row))));
        recording.set(Channel::Command(joint), q);
    }
    for axis in 0..3 {
        let position =
            column(&|row| if row % 3 == 0 { libm::cos(0.2 * time(row)) } else { f64::NAN });
        recording.set(Channel::Position(axis), position);
        recording.set(Channel::Target(1, axis), column(&|row| (row % 7) as f64));
    }
    recording.set(Channel::Link(2), column(&|row| if row % 5 == 0 { 0.1 } else { f64::NAN }));
    recording.set(Channel::Station, column(&|row| (row / 9000) as f64));
    recording.metadata.targets_on_link.insert(1, 0);
    recording
}

#[test]
fn rows_chosen_before_they_are_poses_are_those_chosen_after_to_the_bit() {
    let arm = nominal_robot().arm;
    let two = [long(20_000), long(4_000)];
    let mut whole = campaign(&arm, &two).expect("usable");
    let measured = whole.poses.iter().filter(|pose| !pose.seen.is_empty()).count();
    let few = gross_errors::POSES_MAX;
    let spread: Vec<_> = whole
        .poses
        .iter()
        .filter(|pose| !pose.seen.is_empty())
        .step_by(measured.div_ceil(few))
        .cloned()
        .collect();
    preparation::set_velocities(&mut whole, arm.count());
    let mut notes = Vec::new();
    preparation::subsample(&mut whole, arm.count(), &mut notes);
    let thinned = ThinnedRecordings::select(&arm, &two).expect("usable");
    let (note, sample) = thinned.chosen.expect("a choice");
    assert_eq!((note, thinned.rows, thinned.moves), (notes.remove(0), measured, true));
    assert!(thinned.campaign.poses.len() < 12_000, "{}", thinned.campaign.poses.len());
    // NaN does not equal itself, so both are compared as text.
    assert_eq!(format!("{:?}", thinned.campaign), format!("{whole:?}"));
    assert_eq!(format!("{:?}", sample.poses), format!("{spread:?}"));
}

#[test]
fn a_short_recording_is_looked_at_as_a_whole() {
    let arm = nominal_robot().arm;
    let one = [long(2_000)];
    let thinned = ThinnedRecordings::select(&arm, &one).expect("usable");
    let whole = campaign(&arm, &one).expect("usable");
    assert!(thinned.chosen.is_none());
    assert_eq!(format!("{:?}", thinned.campaign), format!("{whole:?}"));
}
