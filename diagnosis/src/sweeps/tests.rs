//! Sweeps of a robot with known axes, backlash and compliance.

use super::*;
use crate::campaign_simulation;
use crate::test_campaigns::{nominal_robot, unmeasured_campaign};
use physics::{AnyEffect, Inputs, JOINTS_MAX, ParameterValues};
use std::f64::consts::PI;

/// Sweeps of all joints, up and down, each with the others at `home`.
fn swept(home: [f64; 6]) -> Campaign {
    let mut campaign = unmeasured_campaign(3, 1);
    let template = campaign.poses[0].clone();
    campaign.poses.clear();
    for joint in 0..6 {
        for k in (0..=12).chain((0..12).rev()) {
            let mut q = [0.0; JOINTS_MAX];
            q[..6].copy_from_slice(&home);
            q[joint] += f64::from(k - 6) * 0.1;
            let row = campaign.poses.len();
            let mut pose = Pose { inputs: Inputs::at_rest(q), row, ..template.clone() };
            pose.inputs.time_s = row as f64;
            campaign.poses.push(pose);
        }
    }
    campaign
}

fn effect(kind: &str, joint: usize, numbers: &[(&str, &[f64])]) -> AnyEffect {
    AnyEffect::build(kind, &nominal_robot().arm, Some(joint), ParameterValues(numbers))
        .expect("built")
}

#[test]
fn sweeps_are_found_and_say_what_each_joint_has() {
    let truth = [
        effect("axis_tilt", 3, &[("tilt", &[8e-4, -6e-4])]),
        effect("backlash", 4, &[("width", &[4e-4])]),
        effect("joint_compliance", 1, &[("compliance", &[4e-6])]),
    ];
    let truth = Model::new(nominal_robot().arm, &truth).expect("sound");
    let mut campaign = swept([0.1, -0.2, 0.3, 0.0, 0.4, 0.0]);
    // Backlash needs the direction of approach of each step.
    for k in 1..campaign.poses.len() {
        for joint in 0..6 {
            let moved = campaign.poses[k].inputs.q[joint] - campaign.poses[k - 1].inputs.q[joint];
            let before = campaign.poses[k - 1].inputs.direction[joint];
            campaign.poses[k].inputs.direction[joint] =
                if moved == 0.0 { before } else { moved.signum() };
        }
    }
    let campaign =
        campaign_simulation::simulate_readings(&campaign, &truth, &campaign.surroundings, 0.02, 3);
    let found = sweeps(&truth.arm, &campaign, &campaign.surroundings);
    let joints: Vec<usize> = found.iter().map(|found| found.sweep.joint).collect();
    assert_eq!(joints, [0, 1, 2, 3, 4, 5]);
    let results = analyse_sweeps(&truth, SagCorrection::AllOthers, found);
    let tilt = results[3].error.expect("an axis");
    for (found, sigma, truth) in [
        (tilt.tilt_rad[0], tilt.sigma_tilt_rad[0], 8e-4),
        (tilt.tilt_rad[1], tilt.sigma_tilt_rad[1], -6e-4),
    ] {
        assert!((found - truth).abs() < 5.0 * sigma + 2e-6, "{found} ± {sigma}, truth {truth}");
    }
    // Joint 2 deflects while joint 3 sweeps, which appears as a shift in the raw tracks.
    assert!(results[2].axis.as_ref().expect("an axis").moved_by_sag_m > 1e-5);
    let errors = results[4].errors.as_ref().expect("errors");
    let lost: Vec<f64> = errors.steps.iter().filter_map(|s| s.half_lost_motion_rad).collect();
    let mean = lost.iter().sum::<f64>() / lost.len() as f64;
    assert!(lost.len() >= 10 && (mean - 2e-4).abs() < 2e-5, "{mean}");
    let of_joints = joint_models(&truth.arm, &results);
    assert!(of_joints.iter().any(|model| model.joint == 1), "{of_joints:?}");
}

#[test]
fn axes_stand_to_each_other_as_the_arm_has_them_whatever_the_frame() {
    let model = nominal_robot();
    let campaign = swept([0.0; 6]);
    let campaign =
        campaign_simulation::simulate_readings(&campaign, &model, &campaign.surroundings, 0.02, 3);
    // The pose of the tracker is unknown: the relative positions of the axes are the same.
    let mut elsewhere = campaign.surroundings.clone();
    elsewhere.frames[0].value.measuring_from_base = physics::Frame::IDENTITY;
    let results = analyse_sweeps(
        &model,
        SagCorrection::AsMeasured,
        sweeps(&model.arm, &campaign, &elsewhere),
    );
    let relative = relative_axes(&results);
    assert_eq!(relative.len(), 5);
    let right = std::f64::consts::FRAC_PI_2;
    for (relative, (angle, distance)) in
        relative.iter().zip([(right, 0.15), (0.0, 0.7), (right, 0.0), (right, 0.0), (right, 0.0)])
    {
        let angle = (relative.angle_rad - angle).abs().min((PI - relative.angle_rad - angle).abs());
        assert!(angle < 5.0 * relative.sigma_angle_rad + 1e-9, "{relative:?}");
        let error = (relative.distance_m - distance).abs();
        assert!(error < 5.0 * relative.sigma_distance_m, "{relative:?} against {distance}");
    }
}

#[test]
fn poses_by_chance_are_no_sweeps() {
    let campaign = unmeasured_campaign(3, 80);
    assert_eq!(sweeps(&nominal_robot().arm, &campaign, &campaign.surroundings), []);
}
