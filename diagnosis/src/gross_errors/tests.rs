//! The robot of the thesis, with one gross error at a time.

use super::*;
use crate::test_campaigns::{nominal_robot, simulated_campaign};
use recording::model::presets::preset;

fn messages_of(campaign: &Campaign) -> Vec<String> {
    detect_global_errors(campaign, &nominal_robot()).into_iter().map(|s| s.message).collect()
}

#[test]
fn a_sound_recording_of_an_uncalibrated_robot_raises_no_suspicion() {
    for targets in [0, 1, 3] {
        assert_eq!(
            messages_of(&simulated_campaign(targets)),
            Vec::<String>::new(),
            "{targets} targets"
        );
    }
}

#[test]
fn each_gross_fault_is_named() {
    let faults: [(&str, Campaign); 7] = [
        ("joints 2 and 3 are swapped", with_joints(&simulated_campaign(3), |q| q.swap(1, 2))),
        ("joints 4 and 6 are swapped", with_joints(&simulated_campaign(3), |q| q.swap(3, 5))),
        (
            "in radians, but degrees are stated",
            with_joints(&simulated_campaign(3), |q| q.iter_mut().for_each(|q| *q *= PI / 180.0)),
        ),
        (
            "in degrees, but radians are stated",
            with_joints(&simulated_campaign(3), |q| q.iter_mut().for_each(|q| *q *= 180.0 / PI)),
        ),
        ("mirrored", with_points(&simulated_campaign(3), |p| DVec3::new(p.y, p.x, p.z))),
        ("joint 5 has the opposite sign", with_joints(&simulated_campaign(1), |q| q[4] = -q[4])),
        ("factor of 1000 too small", with_points(&simulated_campaign(0), |p| p * 1e-3)),
    ];
    for (wanted, campaign) in faults {
        let messages = messages_of(&campaign);
        assert!(messages.first().is_some_and(|s| s.contains(wanted)), "{wanted}: {messages:?}");
    }
}

#[test]
fn a_wrong_tool_is_told_from_a_wrong_robot() {
    let campaign = simulated_campaign(0);
    let mut model = nominal_robot();
    model.arm.tool.tcp += DVec3::new(0.03, 0.0, 0.05);
    let found = detect_global_errors(&campaign, &model);
    assert!(found[0].message.contains("the tool differs from the model"), "{found:?}");
    let other = preset("fr3").expect("preset").model().expect("sound").physics;
    let found = detect_global_errors(&campaign, &other);
    assert!(found[0].message.contains("of this robot"), "{found:?}");
}

#[test]
fn measurements_that_stand_a_row_late_are_noticed() {
    let sound = simulated_campaign(3);
    let mut late = sound.clone();
    for k in 1..60 {
        late.poses[k].seen.clone_from(&sound.poses[k - 1].seen);
    }
    let messages = messages_of(&late);
    assert!(messages.first().is_some_and(|s| s.contains("one row after")), "{messages:?}");
}

/// The campaign with one target's points changed.
fn with_one(target: usize, change: fn(DVec3) -> DVec3) -> Campaign {
    targets::with_target(&simulated_campaign(3), target, change)
}

#[test]
fn columns_of_one_target_that_are_wrong_are_named_though_the_others_are_right() {
    let faults: [(&str, Campaign); 5] = [
        (
            "only target 1 has a gross error: its columns x and y are swapped",
            with_one(0, |p| DVec3::new(p.y, p.x, p.z)),
        ),
        (
            "only target 3 has a gross error: its columns y and z are swapped",
            with_one(2, |p| DVec3::new(p.x, p.z, p.y)),
        ),
        (
            "only target 2 has a gross error: its columns x and z are swapped",
            with_one(1, |p| DVec3::new(p.z, p.y, p.x)),
        ),
        (
            "only target 2 has a gross error: its y has the wrong sign",
            with_one(1, |p| DVec3::new(p.x, -p.y, p.z)),
        ),
        (
            "only target 3 has a gross error: its columns are in m, but mm is stated",
            with_one(2, |p| p * 1e-3),
        ),
    ];
    for (wanted, campaign) in faults {
        let messages = messages_of(&campaign);
        assert!(messages.first().is_some_and(|s| s.contains(wanted)), "{wanted}: {messages:?}");
    }
}

#[test]
fn what_the_instrument_is_said_to_be_off_by_is_no_gross_fault() {
    let mut rough = simulated_campaign(3);
    let said_m = 0.05;
    let noisy = crate::campaign_simulation::simulate_readings(
        &rough,
        &nominal_robot(),
        &rough.surroundings.clone(),
        1.0,
        1,
    );
    assert!(messages_of(&noisy).is_empty());
    for observation in rough.poses.iter_mut().flat_map(|pose| &mut pose.seen) {
        observation.whitening = glam::DMat3::from_diagonal(DVec3::splat(1.0 / said_m));
    }
    let rough = crate::campaign_simulation::simulate_readings(
        &rough,
        &nominal_robot(),
        &rough.surroundings.clone(),
        1.0,
        1,
    );
    assert_eq!(messages_of(&rough), Vec::<String>::new());
}
