//! Plans compared with simulated campaigns: selected poses are valid, better than random ones, and predict the uncertainty of the fit.

use super::*;
use crate::campaign::ReadingNoise;
use crate::extrinsics::{Anchor, FitParameter};
use crate::plan::arm_constraints::ArmConstraints;
use crate::plan::line_of_sight::LineOfSight;
use crate::test_campaigns::{nominal_robot, unmeasured_campaign};
use crate::{Extrinsics, FitEffort, FitSettings, Influence, campaign_simulation, fit, geometry};
use glam::DVec3;
use physics::{AnyEffect, Inputs, Memories, Model, ParameterValues};
use rand::RngExt;
use rand_distr::StandardNormal;

const SIGMA_M: f64 = 3e-5;

/// One reflector on the IRB 1600's tool and a tracker beside it; the frame and the reflector's position are fitted.
pub(super) fn task() -> Task {
    let model = nominal_robot();
    let made = unmeasured_campaign(1, 1);
    let sight = LineOfSight {
        instrument_base: DVec3::new(3.5, -1.5, 1.0),
        range_m: [0.3, 30.0],
        acceptance_rad: 80.0_f64.to_radians(),
        facing_tool: vec![Some(DVec3::Z)],
    };
    let mut task = Task {
        hypothesis: geometry(&model, &[]),
        surroundings: made.surroundings,
        measurement: MeasurementKind::Points { least: 1, orientation_rad: None },
        noise: ReadingNoise::Equal(SIGMA_M),
        sight: Some(sight),
        reach: ArmConstraints::of(&model.arm),
        both_directions: false,
        given_poses: Vec::new(),
        test_poses: Vec::new(),
    };
    task.test_poses = task.workspace(60, 1);
    task
}

fn plan_settings(criterion: Criterion, count: usize, seed: u64) -> PlanSettings {
    PlanSettings { count, criterion, candidates: 300, seed }
}

/// A robot with geometry errors of typical size, all of them parameters of the hypothesis.
fn erring(seed: u64) -> Model {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut hypothesis = geometry(&nominal_robot(), &[]);
    let step: Vec<f64> = hypothesis
        .free
        .iter()
        .map(|free| 0.05 * free.sigma * rng.sample::<f64, _>(StandardNormal))
        .collect();
    hypothesis = hypothesis.stepped(&step);
    *hypothesis.model
}

/// RMS tool error at the test poses after measuring at `stops` and fitting, m. The controller's frame is known, so that only errors of the arm count.
fn erred(task: &Task, stops: &[Joints], seed: u64) -> f64 {
    let truth = erring(seed);
    let campaign = task.campaign(stops);
    let made =
        campaign_simulation::simulate_readings(&campaign, &truth, &task.surroundings, 1.0, seed);
    let used = vec![true; made.poses.len()];
    let settings = FitSettings::full(&used, Influence::Equal);
    let found = fit(&made, &task.hypothesis, &settings);
    let tool_at = |model: &Model, q: &Joints| {
        model.evaluate(&Inputs::at_rest(*q), &Memories::default()).real.base_from_tool.origin
    };
    let squares = task
        .test_poses
        .iter()
        .map(|q| tool_at(&found.hypothesis.model, q).distance_squared(tool_at(&truth, q)));
    (squares.sum::<f64>() / task.test_poses.len() as f64).sqrt()
}

fn with_known_surroundings() -> Task {
    // Three reflectors, since one alone does not determine the tool's orientation.
    let mut task = Task { surroundings: unmeasured_campaign(3, 1).surroundings, ..task() };
    task.sight = None;
    let Extrinsics { frames, targets, .. } = &mut task.surroundings;
    frames.iter_mut().for_each(|frame| *frame = FitParameter::known(frame.value));
    targets.iter_mut().for_each(|target| *target = FitParameter::known(target.value));
    task
}

#[test]
fn planned_poses_are_within_limits_seen_and_out_of_the_base() {
    let task = task();
    let arm = &task.hypothesis.model.arm;
    let plan = plan(&task, None, &plan_settings(Criterion::D, 20, 3)).expect("a plan");
    assert_eq!(plan.poses.len(), 20);
    for pose in &plan.poses {
        assert!(arm.within_limits(&pose.q));
        let chain = physics::Chain::nominal(arm, &pose.q);
        let tcp = chain.base_from_tool.origin;
        assert!(tcp.z > 0.0 && !(tcp.truncate().length() < 0.2 && tcp.z < 0.4865), "{tcp}");
        let towards = (task.sight.as_ref().expect("a sight").instrument_base - tcp).normalize();
        // The reflector is 0.1 m from the TCP, and the tracker metres away.
        assert!((chain.base_from_tool.rotation * DVec3::Z).dot(towards) > 0.1);
    }
}

#[test]
fn planned_poses_beat_random_ones_in_what_the_tool_really_errs_by() {
    let task = with_known_surroundings();
    let (mut planned, mut random) = (0.0, 0.0);
    for seed in 0..8 {
        let plan = plan(&task, None, &plan_settings(Criterion::D, 15, seed)).expect("a plan");
        let stops: Vec<Joints> = plan.poses.iter().map(|pose| pose.q).collect();
        let drawn = task.random(15, 1000 + seed).expect("drawn");
        planned += erred(&task, &stops, seed).powi(2);
        random += erred(&task, &drawn, seed).powi(2);
    }
    let ratio = (planned / random).sqrt();
    assert!(ratio < 0.85, "{ratio}");
}

#[test]
fn the_uncertainty_that_a_plan_says_is_that_of_the_fit_afterwards() {
    let task = task();
    let plan = plan(&task, None, &plan_settings(Criterion::D, 25, 5)).expect("a plan");
    let stops: Vec<Joints> = plan.poses.iter().map(|pose| pose.q).collect();
    let campaign = task.campaign(&stops);
    let made = campaign_simulation::simulate_readings(
        &campaign,
        &task.hypothesis.model,
        &task.surroundings,
        1.0,
        9,
    );
    let used = vec![true; made.poses.len()];
    let settings = FitSettings::full(&used, Influence::Equal);
    let found = fit(&made, &task.hypothesis, &settings);
    let mut compared = 0;
    for (k, free) in task.hypothesis.free.iter().enumerate() {
        let name = task.hypothesis.describe(free);
        let planned = plan.numbers.iter().find(|number| number.what == name);
        let sigma = found.sigma(found.column_of(k));
        if let (Some(planned), Some(sigma)) = (planned, sigma) {
            let ratio = planned.to / (sigma / found.design_effect.sqrt());
            assert!((ratio - 1.0).abs() < 0.05, "{name}: {ratio}");
            compared += 1;
        }
    }
    assert!(compared > 15, "{compared}");
}

#[test]
fn the_error_that_is_said_falls_with_every_pose_and_ends_where_the_tool_errs() {
    let task = with_known_surroundings();
    let plan = plan(&task, None, &plan_settings(Criterion::Zone, 15, 2)).expect("a plan");
    for pose in &plan.poses {
        assert!(pose.tool_m[1] <= pose.tool_m[0] && pose.log_det_gain > 0.0);
        assert!(pose.reductions.iter().all(|falls| falls.to <= falls.from));
    }
    let stops: Vec<Joints> = plan.poses.iter().map(|pose| pose.q).collect();
    let errors = (0..12).map(|seed| erred(&task, &stops, seed).powi(2)).sum::<f64>() / 12.0;
    let planned_m = plan.poses.last().expect("poses").tool_m[1];
    let ratio = errors.sqrt() / planned_m;
    // Twelve campaigns of about thirty parameters.
    assert!((0.8..1.25).contains(&ratio), "{ratio}");
}

#[test]
fn each_criterion_is_the_best_at_its_own() {
    let task = task();
    let figures = |criterion| {
        let plan = plan(&task, None, &plan_settings(criterion, 20, 4)).expect("a plan");
        let gain: f64 = plan.poses.iter().map(|pose| pose.log_det_gain).sum();
        (gain, plan.poses.last().expect("poses").tool_m[1])
    };
    let (d, zone) = (figures(Criterion::D), figures(Criterion::Zone));
    let random = figures(Criterion::Random);
    assert!(d.0 > zone.0 && zone.1 < d.1, "{d:?} {zone:?}");
    assert!(d.0 > random.0 + 1.0 && zone.1 < 0.9 * random.1, "{d:?} {zone:?} {random:?}");
}

#[test]
fn what_was_measured_already_counts() {
    let task = task();
    let first = plan(&task, None, &plan_settings(Criterion::D, 15, 6)).expect("a plan");
    let stops: Vec<Joints> = first.poses.iter().map(|pose| pose.q).collect();
    let campaign = campaign_simulation::simulate_readings(
        &task.campaign(&stops),
        &task.hypothesis.model,
        &task.surroundings,
        1.0,
        3,
    );
    let used = vec![true; campaign.poses.len()];
    let settings = FitSettings {
        used: &used,
        influence: Influence::Equal,
        from: Some(&task.surroundings),
        effort: FitEffort::Full,
    };
    let found = fit(&campaign, &task.hypothesis, &settings);
    let known = ExistingMeasurements { campaign: &campaign, fit: &found };
    let go_on = Task { surroundings: found.surroundings.clone(), ..task };
    let second = plan(&go_on, Some(known), &plan_settings(Criterion::D, 5, 7)).expect("a plan");
    let (left, begins) = (first.poses[14].tool_m[1], second.poses[0].tool_m[0]);
    assert!((begins / left - 1.0).abs() < 0.25, "{begins} {left}");
    let unmeasured_before = best_next_pose(&go_on, None, 200, 1e-6, 1).expect("a pose");
    let with_measured = best_next_pose(&go_on, Some(known), 200, 1e-6, 1).expect("a pose");
    assert!(
        !unmeasured_before.enough
            && unmeasured_before.tool_m[0] > with_measured.tool_m[0]
            && with_measured.tool_m[1] < with_measured.tool_m[0]
    );
    assert!(best_next_pose(&go_on, Some(known), 200, 1.0, 1).expect("a pose").enough);
}

#[test]
fn the_same_seed_gives_the_same_poses_and_a_place_without_sight_none() {
    let task = task();
    let q = |seed| {
        plan(&task, None, &plan_settings(Criterion::O1, 6, seed))
            .expect("a plan")
            .poses
            .iter()
            .map(|p| p.q)
            .collect::<Vec<_>>()
    };
    assert_eq!(q(1), q(1));
    assert_ne!(q(1), q(2));
    let mut blind = task.clone();
    if let Some(sight) = &mut blind.sight {
        sight.range_m = [0.0, 0.5];
    }
    assert!(matches!(
        plan(&blind, None, &plan_settings(Criterion::D, 6, 1)),
        Err(PlanError::TooFewPoses { seen: 0, .. })
    ));
}

#[test]
fn a_ballbar_and_a_probe_are_planned_onto_what_they_measure() {
    let mut bar = task();
    let place = FitParameter::unknown(DVec3::new(0.9, 0.0, 0.2));
    bar.surroundings.anchors = vec![Anchor { place, offset_m: FitParameter::known(0.0) }];
    bar.measurement = MeasurementKind::Distance { length_m: [0.598, 0.602] };
    let planned = plan(&bar, None, &plan_settings(Criterion::D, 8, 1)).expect("a plan");
    let arm = &bar.hypothesis.model.arm;
    for pose in &planned.poses {
        let tip = physics::Chain::nominal(arm, &pose.q)
            .base_from_tool
            .point(bar.surroundings.targets[0].value);
        let length = tip.distance(bar.surroundings.anchors[0].place.value);
        assert!((0.597..0.603).contains(&length), "{length}");
    }
    let mut probe = task();
    let plane = crate::Plane { normal: DVec3::Z, offset_m: 0.3 };
    probe.surroundings.planes = vec![FitParameter::unknown(plane)];
    let centre = DVec3::new(0.8, 0.0, 0.3);
    probe.measurement =
        MeasurementKind::Touch(vec![TouchSurface::Plane { plane: 0, centre, radius_m: 0.3 }]);
    let planned = plan(&probe, None, &plan_settings(Criterion::D, 8, 1)).expect("a plan");
    for pose in &planned.poses {
        let tip = physics::Chain::nominal(arm, &pose.q)
            .base_from_tool
            .point(probe.surroundings.targets[0].value);
        assert!((tip.z - 0.3).abs() < 1e-5 && tip.distance(centre) < 0.3);
    }
}

#[test]
fn an_offset_effect_that_is_stated_starts_from_what_is_stated() {
    let mut model = nominal_robot();
    let given: &[(&str, &[f64])] = &[("offset", &[0.001])];
    model
        .push(
            AnyEffect::build("joint_offset", &model.arm, Some(2), ParameterValues(given))
                .expect("built"),
        )
        .expect("room");
    let task = Task { hypothesis: calibration_hypothesis(&model, &[vec![1e-5]]), ..task() };
    let plan = plan(&task, None, &plan_settings(Criterion::D, 4, 1)).expect("a plan");
    let planned =
        plan.numbers.iter().find(|number| number.what.contains("joint 3's offset")).expect("named");
    assert!((planned.from - 1e-5).abs() < 1e-12 && planned.to <= planned.from);
}

#[test]
fn a_list_of_poses_that_are_known_to_be_free_is_all_that_is_chosen_from() {
    let mut task = task();
    task.given_poses = task.random(40, 3).expect("drawn");
    let planned = plan(&task, None, &plan_settings(Criterion::D, 10, 1)).expect("a plan");
    assert!(planned.poses.iter().all(|pose| task.given_poses.contains(&pose.q)));
    assert!(matches!(
        plan(&task, None, &plan_settings(Criterion::D, 41, 1)),
        Err(PlanError::TooFewPoses { drawn: 40, .. })
    ));
}
