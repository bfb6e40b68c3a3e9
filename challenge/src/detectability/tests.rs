//! z, ρ and gains compared with analytical results.

use super::*;
use crate::arm::Arm;
use crate::case::{ModelledEffect, Tier};
use crate::generate::evaluate_detectability;
use crate::instrument::{Instrument, Noise};
use crate::least_squares::dot;
use crate::rng::Rng;
use crate::scene::{Excitation, RecordedInputs};
use crate::transform::{IDENTITY, column as axis, cross, norm, origin, sub};

fn case(hidden: Effect, frame_known: bool) -> PositionCase {
    let mut rng = Rng::new(2, 0);
    let arm = Arm::from_table(2, 1.0, &crate::transform::translation([0.0, 0.0, 0.15]), 3.0, true);
    let scene =
        Scene::random_poses(arm, RecordedInputs::default(), 300, Excitation::Full, &mut rng);
    let instrument = Instrument {
        points: vec![[0.0; 3]],
        measuring_from_base: IDENTITY,
        frame_known,
        points_known: true,
        targets: false,
    };
    let noise = Noise {
        sigma: 2e-5,
        autocorrelation: 0.0,
        quantum: 0.0,
        gaps: 0.0,
        outliers: 0.0,
        stated: true,
    };
    PositionCase {
        tier: Tier::Single,
        scene,
        excitation: Excitation::Full,
        instrument,
        noise,
        modelled: Vec::new(),
        hidden: vec![hidden],
        seed: 9,
    }
}

fn of(kind: Kind, joint: usize, parameters: &[f64]) -> Effect {
    Effect { kind, joint, other_joint: joint, parameters: parameters.to_vec() }
}

/// Sum of squared distances of the tool from joint `i`'s axis, over all rows.
fn square_of_levers(case: &PositionCase, i: usize) -> f64 {
    let rows = case.scene.rows.iter();
    let lever = |q: &[f64; 7]| {
        let frames = case.scene.arm.frames(q);
        let tcp = origin(&frames[6]);
        norm(cross(axis(&frames[i], 2), sub(tcp, origin(&frames[i])))).powi(2)
    };
    rows.map(|row| lever(&row.q)).sum()
}

#[test]
fn in_a_known_frame_an_offset_shows_as_its_lever_over_the_noise() {
    let case = case(of(Kind::JointOffset, 2, &[1e-4]), true);
    let detectability = &evaluate_detectability(&case)[0];
    let z = 1e-4 * square_of_levers(&case, 2).sqrt() / 2e-5;
    assert!((detectability.z / z - 1.0).abs() < 1e-3, "{} not {z}", detectability.z);
    assert!((detectability.rho - detectability.z / 900.0_f64.sqrt()).abs() < 1e-12);
}

#[test]
fn an_unknown_frame_swallows_the_first_joints_offset_whole_however_large() {
    let detectability = &evaluate_detectability(&case(of(Kind::JointOffset, 0, &[5e-3]), false))[0];
    assert!(detectability.z < 0.3, "{}", detectability.z);
}

#[test]
fn a_number_known_to_one_sigma_hides_as_a_reading_of_that_noise_would() {
    // A parameter with prior standard deviation s, and data of strength z per unit: of another effect with the same column, the fraction 1/(1 + s²
    // z²) of its energy remains.
    let mut with = case(of(Kind::GravityCompliance, 1, &[2e-6]), true);
    let other = of(Kind::JointCompliance, 1, &[0.0]);
    with.modelled =
        vec![ModelledEffect { nominal: other.clone(), true_effect: other, sigma: vec![1e-8] }];
    let everything = vec![true; with.scene.rows.len()];
    let unit = LinearisedCase::of(&with, &with.scene, &everything).column(&of(
        Kind::GravityCompliance,
        1,
        &[1.0],
    ));
    let strength = dot(&unit, &unit);
    let expected = 4e-12 * strength / (1.0 + 1e-16 * strength);
    let z = evaluate_detectability(&with)[0].z;
    assert!((z * z / expected - 1.0).abs() < 1e-2, "{} not {expected}", z * z);
    assert!(expected < 0.9 * 4e-12 * strength, "a prior that is felt");
}

#[test]
fn at_rest_without_a_wrench_gravity_and_joint_compliance_are_one_thing() {
    let detectability =
        &evaluate_detectability(&case(of(Kind::JointCompliance, 1, &[3e-6]), false))[0];
    assert!(detectability.same.contains(&("gravity_compliance", Some(2))), "{detectability:?}");
    assert!(
        detectability.z > 8.0 && detectability.least_gain > DISTINGUISHABLE_GAIN,
        "{detectability:?}"
    );
}

#[test]
fn twice_the_effect_gains_four_times_as_much() {
    let gain = |size: f64| {
        evaluate_detectability(&case(of(Kind::Backlash, 2, &[size]), false))[0].least_gain
    };
    assert!((gain(2e-4) / gain(1e-4) - 4.0).abs() < 0.01);
}
