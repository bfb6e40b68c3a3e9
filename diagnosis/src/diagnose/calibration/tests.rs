//! Selection for robots with and without one additional effect.

use crate::campaign::Campaign;
use crate::campaign_simulation;
use crate::hold_out::{PositionErrors, calibrate};
use crate::progress::ignore;
use crate::test_campaigns::{nominal_robot, unmeasured_campaign};
use glam::DVec3;
use physics::{AnyEffect, Model, ParameterValues, Wrench};

/// Mean length of a point error by noise of 0.05 mm per coordinate: `2 σ sqrt(2/π)`.
const NOISE_M: f64 = 2.0 * 5e-5 * 0.797_884_560_8;

fn effect(kind: &str, joint: Option<usize>, numbers: &[(&str, &[f64])]) -> AnyEffect {
    AnyEffect::build(kind, &nominal_robot().arm, joint, ParameterValues(numbers)).expect("built")
}

/// Effects of every simulated robot: two joint compliances, a tilted axis, a zero offset.
fn common() -> Vec<AnyEffect> {
    vec![
        effect("joint_compliance", Some(1), &[("compliance", &[4e-6])]),
        effect("joint_compliance", Some(2), &[("compliance", &[8e-6])]),
        effect("axis_tilt", Some(3), &[("tilt", &[8e-4, -6e-4])]),
        effect("joint_offset", Some(2), &[("offset", &[1e-3])]),
    ]
}

/// Simulated measurements of a robot with these effects, under varying forces on the tool of at most `push_n` per axis, N.
fn simulated_campaign(truth: &[AnyEffect], push_n: f64, seed: u64) -> Campaign {
    let mut campaign = unmeasured_campaign(3, 160);
    for (row, pose) in campaign.poses.iter_mut().enumerate() {
        let part = |by: f64| ((row + 1) as f64 * by).fract() * 2.0 - 1.0;
        let force = DVec3::new(part(0.7321), part(0.2361), part(0.4142)) * push_n;
        pose.inputs.wrench_base = Wrench { force, moment: DVec3::ZERO };
    }
    let model = Model::new(nominal_robot().arm, truth).expect("effects that fit each other");
    campaign_simulation::simulate_readings(&campaign, &model, &campaign.surroundings, 1.0, seed)
}

struct SelectionSummary {
    names: Vec<(&'static str, Option<usize>)>,
    heldout_m: f64,
    before_m: f64,
    model: Model,
}

/// Calibration on two thirds of the poses, with the error on the others.
fn selected(campaign: &Campaign, base: &Model) -> SelectionSummary {
    let training: Vec<bool> = (0..campaign.poses.len()).map(|k| k % 3 != 0).collect();
    let held: Vec<bool> = training.iter().map(|trains| !trains).collect();
    let found = calibrate(campaign, base, &[], &training, &ignore);
    let model = *found.advanced.fit.hypothesis.model;
    let chosen = found.advanced.chosen.iter().filter_map(|c| model.effects().nth(c.effect));
    SelectionSummary {
        names: chosen.map(|e| (e.spec().kind, e.joint())).collect(),
        heldout_m: PositionErrors::of(&found.advanced.fit, campaign, &held).mean(),
        before_m: PositionErrors::of(&found.calibrated, campaign, &held).mean(),
        model,
    }
}

fn value(selection: &SelectionSummary, kind: &str) -> f64 {
    let found = selection.model.effects().find(|e| e.spec().kind == kind);
    found.map_or(f64::NAN, |effect| effect.values()[0])
}

/// Asserts that the additional effect `more` is selected and that the error on the other poses equals the noise.
fn is_found(more: AnyEffect, push_n: f64, tolerance: f64) {
    let truth: Vec<AnyEffect> = common().into_iter().chain([more]).collect();
    let selection = selected(&simulated_campaign(&truth, push_n, 3), &nominal_robot());
    let (kind, joint) = (more.spec().kind, more.joint());
    assert!(
        selection.names.contains(&(kind, joint)),
        "no {kind} among {:?}, {} mm held out",
        selection.names,
        selection.heldout_m * 1e3
    );
    assert!(
        selection.heldout_m < 1.12 * NOISE_M,
        "{kind}: {} mm held out",
        selection.heldout_m * 1e3
    );
    assert!(
        selection.heldout_m < 0.7 * selection.before_m,
        "{kind}: {} mm before",
        selection.before_m * 1e3
    );
    let ratio = value(&selection, kind) / more.values()[0];
    assert!((ratio - 1.0).abs() < tolerance, "{kind}: {ratio} of the truth, {:?}", selection.names);
    selection.model.check().expect("effects that fit each other");
}

#[test]
fn a_drive_that_stiffens_is_found() {
    is_found(effect("stiffness_hardening", Some(1), &[("cubic", &[4e-13])]), 500.0, 0.2);
}

/// A wave of one cycle per revolution imitates a spring with four parameters here: the remaining misfit is 5 in the sum of squares.
#[test]
fn a_spring_that_carries_the_arm_leaves_no_error() {
    let numbers: &[(&str, &[f64])] = &[
        ("stiffness", &[1.5e4]),
        ("free_length", &[0.3]),
        ("a", &[0.17]),
        ("L", &[0.5]),
        ("angle", &[2.0]),
    ];
    let spring = effect("counterbalance", Some(1), numbers);
    let truth: Vec<AnyEffect> = common().into_iter().chain([spring]).collect();
    let selection = selected(&simulated_campaign(&truth, 200.0, 3), &nominal_robot());
    assert!(
        selection.heldout_m < 1.12 * NOISE_M,
        "{} mm, {:?}",
        selection.heldout_m * 1e3,
        selection.names
    );
    assert!(
        selection.heldout_m < 0.7 * selection.before_m,
        "{} mm before",
        selection.before_m * 1e3
    );
}

#[test]
fn a_payload_that_the_model_does_not_know_is_found() {
    is_found(effect("payload", None, &[("mass", &[9.0]), ("com", &[0.9, 0.1, 1.2])]), 300.0, 0.2);
}

#[test]
fn no_mass_below_zero_is_selected_where_a_robot_carries_less_than_its_model_says() {
    let lighter = effect("payload", None, &[("mass", &[-3.0]), ("com", &[0.9, 0.1, 1.2])]);
    let truth: Vec<AnyEffect> = common().into_iter().chain([lighter]).collect();
    let selection = selected(&simulated_campaign(&truth, 300.0, 3), &nominal_robot());
    assert!(!selection.names.iter().any(|(kind, _)| *kind == "payload"), "{:?}", selection.names);
}

#[test]
fn a_base_that_leans_is_found_and_one_that_leans_absurdly_is_not_selected() {
    for (tilt, is_selected) in [(0.05, true), (0.15, false)] {
        let leaning = effect("gravity_tilt", None, &[("tilt", &[tilt, 0.0])]);
        let heavy = effect("payload", None, &[("mass", &[60.0]), ("com", &[0.3, 0.1, 0.6])]);
        let truth: Vec<AnyEffect> = common().into_iter().chain([heavy, leaning]).collect();
        let base = Model::new(nominal_robot().arm, &[heavy]).expect("a model");
        let selection = selected(&simulated_campaign(&truth, 300.0, 3), &base);
        let found = selection.names.iter().any(|(kind, _)| *kind == "gravity_tilt");
        assert_eq!(found, is_selected, "{tilt}: {:?}", selection.names);
    }
}

#[test]
fn a_base_that_yields_is_found() {
    is_found(effect("base_compliance", None, &[("compliance", &[6e-7])]), 300.0, 0.2);
}

#[test]
fn a_bearing_that_yields_is_found() {
    is_found(effect("bearing_compliance", Some(2), &[("compliance", &[5e-6])]), 400.0, 0.2);
}

#[test]
fn what_has_no_name_is_described() {
    let range = [-1.5, 1.5];
    let numbers: &[(&str, &[f64])] =
        &[("coefficients", &[0.0, 0.0, 0.0, 2e-3, -1.5e-3, 1e-3]), ("range", &range)];
    let truth: Vec<AnyEffect> =
        common().into_iter().chain([effect("joint_polynomial", Some(3), numbers)]).collect();
    let selection = selected(&simulated_campaign(&truth, 0.0, 3), &nominal_robot());
    assert!(
        selection.heldout_m < 1.12 * NOISE_M,
        "{} mm, {:?}",
        selection.heldout_m * 1e3,
        selection.names
    );
    assert!(selection.names.contains(&("joint_polynomial", Some(3))), "{:?}", selection.names);
}

#[test]
fn a_robot_without_them_does_not_get_them() {
    let mut false_ones = Vec::new();
    for seed in 0..20 {
        let selection =
            selected(&simulated_campaign(&common(), 300.0, 100 + seed), &nominal_robot());
        let is_unexpected = |name: &&(&str, Option<usize>)| {
            **name != ("joint_compliance", Some(1)) && **name != ("joint_compliance", Some(2))
        };
        false_ones.extend(selection.names.iter().filter(is_unexpected).copied());
        assert!(
            selection.heldout_m < 1.08 * NOISE_M,
            "seed {seed}: {} mm",
            selection.heldout_m * 1e3
        );
    }
    assert!(false_ones.len() <= 1, "{false_ones:?}");
}

#[test]
fn what_a_model_states_is_not_doubled_by_the_whole_of_which_it_is_a_half() {
    let half = effect("load_compliance", Some(2), &[("compliance", &[1e-6])]);
    let stated = Model::new(nominal_robot().arm, &[half]).expect("sound");
    let selection = selected(&simulated_campaign(&common(), 300.0, 3), &stated);
    selection.model.check().expect("a model that loads");
    assert!(selection.names.contains(&("gravity_compliance", Some(2))), "{:?}", selection.names);
    assert!(
        selection.heldout_m < 1.12 * NOISE_M,
        "{} mm, {:?}",
        selection.heldout_m * 1e3,
        selection.names
    );
}
