//! Properties of the catalogue of experiments.

use super::*;
use crate::test_campaigns::nominal_robot;

#[test]
fn every_experiment_stays_inside_the_limits_and_speeds_of_the_arm() {
    let arm = nominal_robot().arm;
    let all = catalogue(&arm);
    // Irrelevant temperatures are NaN, which equals nothing: compared as text.
    assert_eq!(format!("{all:?}"), format!("{:?}", catalogue(&arm)));
    let mut names: Vec<&str> = all.iter().map(|one| one.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), all.len());
    for experiment in &all {
        assert!(experiment.takes_s() > 5.0 && !experiment.says.is_empty(), "{}", experiment.name);
        for (joint, limits) in arm.joints().iter().enumerate() {
            for row in &experiment.rows {
                let q = row.q[joint];
                assert!(limits.limits.0 < q && q < limits.limits.1, "{}: {q}", experiment.name);
            }
            for pair in experiment.rows.windows(2).filter(|p| p[0].segment == p[1].segment) {
                let speed =
                    (pair[1].q[joint] - pair[0].q[joint]).abs() / (pair[1].time_s - pair[0].time_s);
                assert!(speed <= limits.max_speed, "{}: {speed}", experiment.name);
            }
        }
    }
}

#[test]
fn a_request_is_a_recording_that_waits_for_its_measurements() {
    let arm = nominal_robot().arm;
    let measured = MeasuredChannels { channels: (0..3).map(Channel::Position).collect() };
    for experiment in catalogue(&arm) {
        let recording = experiment.recording(&measured, f64::NAN);
        assert_eq!(recording.len(), experiment.rows.len());
        let loaded = experiment.name.contains("load");
        assert_eq!(recording.column(Channel::Wrench(0)).is_some(), loaded, "{}", experiment.name);
        let x = recording.column(Channel::Position(0)).expect("there");
        assert!(x.iter().all(|x| x.is_nan()));
    }
}
