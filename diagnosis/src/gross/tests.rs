//! The thesis' robot, measured, with one thing grossly wrong at a time.

use super::*;
use crate::made::{measured, nominal};
use recording::model::presets::preset;

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
