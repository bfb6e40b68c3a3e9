//! Fits of campaigns whose truth is known.

use super::*;
use crate::campaign::{Instrument, Observation, Reading, ReadingNoise, ToolPoint};
use crate::campaign_simulation;
use crate::extrinsics::{Anchor, FitParameter, Plane, Sphere};
use crate::geometry::geometry;
use crate::test_campaigns::{nominal_robot, unmeasured_campaign};
use glam::DVec3;
use physics::{AnyEffect, Model, ParameterValues};

fn settings(used: &[bool], influence: Influence) -> FitSettings<'_> {
    FitSettings::full(used, influence)
}

/// The nominal robot with a few geometric errors and a compliance.
fn truth() -> Model {
    let mut model = nominal_robot();
    let arm = model.arm;
    let mut add = |kind: &str, joint: usize, stem: &str, values: &[f64]| {
        let effect = AnyEffect::build(kind, &arm, Some(joint), ParameterValues(&[(stem, values)]));
        model.push(effect.expect(kind)).expect("room");
    };
    add("joint_offset", 1, "offset", &[1e-3]);
    add("joint_offset", 2, "offset", &[-7e-4]);
    add("joint_offset", 4, "offset", &[2e-3]);
    add("axis_shift", 4, "shift", &[2e-4, 0.0, -3e-4]);
    add("joint_compliance", 1, "compliance", &[2e-6]);
    model
}

/// Geometry and the compliance of joint 2 free, all initially zero.
fn open() -> Hypothesis {
    let mut hypothesis = geometry(&nominal_robot(), &[]);
    let arm = hypothesis.model.arm;
    let given: &[(&str, &[f64])] = &[("compliance", &[0.0])];
    let effect =
        AnyEffect::build("joint_compliance", &arm, Some(1), ParameterValues(given)).expect("sound");
    hypothesis.add(effect, &[]).expect("room");
    hypothesis
}

fn value(found: &Fit, kind: &str, joint: usize, value: usize) -> (f64, Option<f64>) {
    let hypothesis = &found.hypothesis;
    let values = hypothesis.values();
    let wanted = |free: &crate::FreeParameter| {
        let effect = hypothesis.effect_of(free).expect("there");
        effect.spec().kind == kind && effect.joint() == Some(joint) && free.value == value
    };
    let index = hypothesis.free.iter().position(wanted).expect("free");
    (values[index], found.sigma(found.column_of(index)))
}

#[test]
fn the_truth_is_found_within_its_stated_uncertainty() {
    let campaign = unmeasured_campaign(3, 120);
    let campaign = campaign_simulation::simulate_readings(
        &campaign,
        &truth(),
        &campaign.surroundings,
        1.0,
        11,
    );
    let used = vec![true; 120];
    let found = fit(&campaign, &open(), &settings(&used, Influence::Redescending));
    assert!(found.converged);
    assert!((found.factors[0] - 1.0).abs() < 1e-12, "a noise that is right stands");
    for (kind, joint, place, wanted) in [
        ("joint_offset", 1, 0, 1e-3),
        ("joint_offset", 2, 0, -7e-4),
        ("joint_offset", 4, 0, 2e-3),
        ("axis_shift", 4, 2, -3e-4),
        ("joint_compliance", 1, 0, 2e-6),
    ] {
        let (found, sigma) = value(&found, kind, joint, place);
        let sigma = sigma.expect("determined");
        assert!(
            (found - wanted).abs() < 4.0 * sigma,
            "{kind} {joint}: {found} ± {sigma}, not {wanted}"
        );
        assert!(sigma < 0.2 * wanted.abs(), "{kind} {joint}: ± {sigma}");
    }
    let expected = (found.readings - found.columns().len()) as f64;
    assert!(
        (found.sum_of_squares / expected - 1.0).abs() < 0.2,
        "{} for {expected}",
        found.sum_of_squares
    );
}

#[test]
fn a_joint_that_never_moves_is_named_and_nothing_explodes() {
    let mut campaign = unmeasured_campaign(1, 200);
    campaign.poses.iter_mut().for_each(|pose| pose.inputs.q[4] = 0.3);
    let campaign = campaign_simulation::simulate_readings(
        &campaign,
        &truth(),
        &campaign.surroundings,
        1.0,
        12,
    );
    let used = vec![true; 200];
    let found = fit(&campaign, &open(), &settings(&used, Influence::Equal));
    let messages: Vec<String> =
        found.undetermined.iter().map(crate::UndeterminedParameter::message).collect();
    assert!(messages.iter().any(|s| s.contains("joint 5's offset")), "{messages:#?}");
    assert!(
        messages.iter().any(|s| s.contains("joint 6's offset") && s.contains("target")),
        "{messages:#?}"
    );
    assert!(
        found.converged && found.sum_of_squares / (found.readings as f64) < 1.3,
        "{}",
        found.sum_of_squares
    );
    let first = found.surroundings.parameters().len();
    let values = found.hypothesis.values();
    for undetermined in &found.undetermined {
        let free = undetermined.column - first;
        assert_eq!(values[free], 0.0, "{}: held where it is believed to be", undetermined.name);
    }
}

#[test]
fn wild_readings_lose_their_pull_and_weigh_less_than_half() {
    let campaign = unmeasured_campaign(3, 120);
    let mut campaign = campaign_simulation::simulate_readings(
        &campaign,
        &truth(),
        &campaign.surroundings,
        1.0,
        13,
    );
    for pose in [17, 54] {
        if let Reading::Point { at, .. } = &mut campaign.poses[pose].seen[1].reading {
            *at += DVec3::new(0.004, -0.002, 0.0);
        }
    }
    let used = vec![true; 120];
    let found = fit(&campaign, &open(), &settings(&used, Influence::Redescending));
    let light: Vec<usize> = (0..360).filter(|reading| found.weights[*reading] < 0.5).collect();
    assert_eq!(light, [17 * 3 + 1, 54 * 3 + 1]);
    assert_eq!(found.outliers(&campaign), [17, 54]);
    let (offset, sigma) = value(&found, "joint_offset", 1, 0);
    assert!((offset - 1e-3).abs() < 4.0 * sigma.expect("determined"), "{offset}");
}

/// Without tracker: a ballbar from two fixed points, a probe on two planes and a sphere.
fn without_tracker() -> Campaign {
    let mut campaign = unmeasured_campaign(1, 160);
    let around = &mut campaign.surroundings;
    around.frames.clear();
    around.targets[0] = FitParameter::known(around.targets[0].value);
    around.anchors = vec![DVec3::new(0.9, 0.4, 0.1), DVec3::new(0.6, -0.7, 0.2)]
        .into_iter()
        .map(|position| Anchor {
            place: FitParameter::unknown(position),
            offset_m: FitParameter::known(0.0),
        })
        .collect();
    around.planes = [DVec3::Z, DVec3::new(-1.0, 0.0, 0.0)]
        .map(|normal| FitParameter::unknown(Plane { normal, offset_m: 0.1 }))
        .to_vec();
    around.spheres = vec![Sphere {
        centre: FitParameter::unknown(DVec3::new(0.8, 0.1, 0.3)),
        radius_m: FitParameter::known(0.05),
    }];
    let place = ToolPoint::Target(0);
    let whitening = ReadingNoise::Equal(1e-5).whitening(DVec3::ZERO).expect("sound");
    let kinds = [
        Reading::Distance { place, anchor: 0, length_m: 0.0 },
        Reading::Distance { place, anchor: 1, length_m: 0.0 },
        Reading::Plane { place, plane: 0, radius_m: 0.0 },
        Reading::Plane { place, plane: 1, radius_m: 0.0 },
        Reading::Sphere { place, sphere: 0, radius_m: 0.0 },
    ];
    for pose in &mut campaign.poses {
        pose.seen = kinds.map(|reading| Observation { reading, whitening, instrument: 0 }).to_vec();
    }
    campaign.instruments = vec![Instrument {
        name: "probe".to_owned(),
        noise_is_known: true,
        ..Instrument::default()
    }];
    campaign
}

#[test]
fn distances_and_contacts_of_unknown_place_identify_the_arm_too() {
    let campaign = without_tracker();
    let campaign = campaign_simulation::simulate_readings(
        &campaign,
        &truth(),
        &campaign.surroundings,
        1.0,
        14,
    );
    let used = vec![true; campaign.poses.len()];
    let found = fit(&campaign, &open(), &settings(&used, Influence::Equal));
    assert!(
        found.sum_of_squares / (found.readings as f64) < 1.2,
        "{} of {}",
        found.sum_of_squares,
        found.readings
    );
    for (kind, joint, wanted) in [("joint_offset", 2, -7e-4), ("joint_offset", 4, 2e-3)] {
        let (found, sigma) = value(&found, kind, joint, 0);
        let sigma = sigma.expect("determined");
        assert!(
            (found - wanted).abs() < 4.0 * sigma && sigma < 2e-4,
            "{kind} {joint}: {found} ± {sigma}"
        );
    }
}

/// Poses with three reflectors, one measurement in twenty with a gross error of up to centimetres; and the rows of these.
fn spoilt(seed: u64) -> (Campaign, Vec<usize>) {
    let campaign = unmeasured_campaign(3, 120);
    let mut campaign = campaign_simulation::simulate_readings(
        &campaign,
        &truth(),
        &campaign.surroundings,
        1.0,
        seed,
    );
    let mut rows = Vec::new();
    for (reading, pose) in (0..360).step_by(20).map(|k| (k % 3, k / 3)) {
        if let Reading::Point { at, .. } = &mut campaign.poses[pose].seen[reading].reading {
            at[reading] += [7e-4, -5e-3, 0.03][pose % 3];
            rows.push(pose);
        }
    }
    (campaign, rows)
}

#[test]
fn gross_errors_in_every_twentieth_reading_cost_next_to_nothing_and_are_listed() {
    let used = vec![true; 120];
    let (mut clean_off, mut spoilt_off) = (0.0, 0.0);
    for seed in 0..4 {
        let campaign = unmeasured_campaign(3, 120);
        let clean = campaign_simulation::simulate_readings(
            &campaign,
            &truth(),
            &campaign.surroundings,
            1.0,
            seed,
        );
        let (spoilt, rows) = spoilt(seed);
        for (campaign, sum) in [(&clean, &mut clean_off), (&spoilt, &mut spoilt_off)] {
            let found = fit(campaign, &open(), &settings(&used, Influence::Redescending));
            let lengths =
                found.residuals(&clean).into_iter().map(|residual| residual.residual.length());
            *sum += lengths.sum::<f64>();
            assert!(found.converged && (found.factors[0] - 1.0).abs() < 0.1, "{:?}", found.factors);
        }
        let found = fit(&spoilt, &open(), &settings(&used, Influence::Redescending));
        let listed = found.outliers(&spoilt);
        assert!(rows.iter().all(|row| listed.contains(row)), "{listed:?} for {rows:?}");
    }
    assert!(spoilt_off < 1.01 * clean_off, "{spoilt_off} against {clean_off}");
}

#[test]
fn a_stated_belief_and_the_data_are_one_where_each_alone_is_weak() {
    let mut campaign = unmeasured_campaign(1, 60);
    campaign.poses.iter_mut().for_each(|pose| pose.inputs.q[4] = 0.3);
    let campaign =
        campaign_simulation::simulate_readings(&campaign, &truth(), &campaign.surroundings, 1.0, 3);
    let mut hypothesis = open();
    let is_wrist = |free: &crate::FreeParameter| {
        let effect = hypothesis.effect_of(free).expect("there");
        effect.spec().kind == "joint_offset" && effect.joint() == Some(4)
    };
    let wrist = hypothesis.free.iter().position(is_wrist).expect("free");
    let used = vec![true; 60];
    let without_prior = fit(&campaign, &hypothesis, &settings(&used, Influence::Equal));
    let data_sigma = without_prior.sigma(without_prior.column_of(wrist)).expect("seen");
    let free = &mut hypothesis.free[wrist];
    (free.mean, free.sigma, free.prior_source) =
        (1.9e-3, 2e-4, crate::hypothesis::PriorSource::Stated);
    let with_prior = fit(&campaign, &hypothesis, &settings(&used, Influence::Equal));
    let sigma = with_prior.sigma(with_prior.column_of(wrist)).expect("believed");
    let both = (data_sigma.powi(-2) + 2e-4_f64.powi(-2)).sqrt().recip();
    assert!((sigma / both - 1.0).abs() < 0.02, "{sigma}, not {both}");
    assert!(with_prior.converged);
}

#[test]
fn a_wave_is_found_from_the_opposite_phase() {
    let with_wave = |amplitude: f64, phase: f64| {
        let arm = nominal_robot().arm;
        let given: &[(&str, &[f64])] =
            &[("amplitude", &[amplitude]), ("cycles", &[7.857]), ("phase", &[phase])];
        AnyEffect::build("transmission_error", &arm, Some(3), ParameterValues(given))
            .expect("sound")
    };
    let mut robot = truth();
    robot.push(with_wave(3e-4, 1.0)).expect("room");
    let campaign = unmeasured_campaign(3, 120);
    let campaign =
        campaign_simulation::simulate_readings(&campaign, &robot, &campaign.surroundings, 1.0, 5);
    let used = vec![true; 120];
    for start in [1.0, 1.0 + 0.5 * std::f64::consts::PI, 1.0 - std::f64::consts::PI] {
        let mut hypothesis = open();
        hypothesis.add(with_wave(1e-5, start), &["cycles"]).expect("room");
        let found = fit(&campaign, &hypothesis, &settings(&used, Influence::Redescending));
        assert!(found.converged && found.steps < 40, "{} steps", found.steps);
        let values = found.hypothesis.values();
        let [amplitude, phase] = values[values.len() - 2..] else { unreachable!() };
        let error = (amplitude * phase.cos() - 3e-4 * 1.0_f64.cos())
            .hypot(amplitude * phase.sin() - 3e-4 * 1.0_f64.sin());
        assert!(error < 6e-5, "{amplitude} {phase}");
    }
}

/// Three link-side encoders; that of joint 2 is off by plus or minus twenty times the noise, alternating every five poses.
fn with_play() -> Campaign {
    const NOISE_RAD: f64 = 1e-5;
    let mut campaign = unmeasured_campaign(0, 120);
    let noise = |k: usize| NOISE_RAD * [0.3, -1.1, 0.8, -0.4, 1.5, -0.7, 0.1][k % 7];
    for (k, pose) in campaign.poses.iter_mut().enumerate() {
        let play = if k / 5 % 2 == 0 { 20.0 } else { -20.0 } * NOISE_RAD;
        let position = |joint: usize| {
            let change = if joint == 1 { play } else { 0.0 };
            pose.inputs.q[joint] + change + noise(3 * k + joint)
        };
        let reading = |joint| Reading::JointPosition { joint, position: position(joint) };
        let whitening = ReadingNoise::Equal(NOISE_RAD).whitening(DVec3::ZERO).expect("sound");
        let observe = |joint| Observation { reading: reading(joint), whitening, instrument: 0 };
        pose.seen = (0..3).map(observe).collect();
    }
    campaign
}

#[test]
fn what_half_of_an_encoders_readings_say_is_no_reading_gone_wrong() {
    let mut campaign = with_play();
    let outlier = &mut campaign.poses[60].seen[0].reading;
    if let Reading::JointPosition { position, .. } = outlier {
        *position += 4e-4;
    }
    let used = vec![true; 120];
    let hypothesis = Hypothesis::fixed(nominal_robot());
    let found = fit(&campaign, &hypothesis, &settings(&used, Influence::Redescending));
    let of_joint_2 = (0..120).map(|pose| found.weights[3 * pose + 1]);
    assert!(of_joint_2.fold(1.0, f64::min) > 0.9, "play is to be seen");
    let spoilt = found.weights[3 * 60];
    assert!(spoilt < 0.5, "a single reading of a good encoder that is off weighs {spoilt}");
}
