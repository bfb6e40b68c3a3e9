//! The thesis' stiffness, recovered from loads on a simulated arm, with correct uncertainty.

use super::*;
use physics::{Inputs, Memories, Model};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;
use recording::model::presets::preset;

/// Joints 2 to 5, Nm/rad.
const THESIS: [f64; 4] = [451.5e3, 90.3e3, 9.13e3, 3.05e3];
const NOISE: DifferenceNoise = DifferenceNoise { shift_m: 20e-6, turn_rad: 60e-6 };

/// The thesis' robot with all its errors.
fn robot() -> Model {
    preset("irb1600-6-145-thesis").expect("preset").model().expect("sound").physics
}

/// The same with only its load compliance.
fn compliant() -> Model {
    let robot = robot();
    let loads: Vec<AnyEffect> =
        robot.effects().filter(|e| e.spec().kind == "load_compliance").copied().collect();
    Model::new(robot.arm, &loads).expect("sound")
}

fn pose(i: u32) -> (Joints, Wrench) {
    let wave = |k: f64| (f64::from(i) * k + k).sin();
    let mut q = [0.0; JOINTS_MAX];
    for (q, k) in q.iter_mut().zip([1.1, 1.7, 2.3, 2.9, 3.7, 4.3]) {
        *q = 1.1 * wave(k);
    }
    let force = DVec3::new(wave(5.1), wave(5.9), wave(6.7)).normalize() * 250.0;
    (q, Wrench { force, moment: DVec3::new(wave(7.1), wave(7.9), wave(8.3)) * 10.0 })
}

fn loaded_poses(model: &Model, count: u32) -> Vec<LoadedPose> {
    let tool = |q: Joints, wrench_base| {
        let inputs = Inputs { wrench_base, ..Inputs::at_rest(q) };
        model.evaluate(&inputs, &Memories::default()).real.base_from_tool
    };
    (0..count)
        .map(pose)
        .map(|(q, wrench_base)| {
            let (before, after) = (tool(q, Wrench::ZERO), tool(q, wrench_base));
            let turn = after.rotation * before.rotation.transpose();
            let turn = physics::frame::vector_from_rotation(&turn);
            LoadedPose { q, wrench_base, shift: after.origin - before.origin, turn: Some(turn) }
        })
        .collect()
}

/// One target 0.4 m beside each of joints 2 to 5, measured without and under each of `count` loads.
fn loaded_links(model: &Model, count: u32) -> Vec<LoadedLink> {
    let mut cases = Vec::new();
    for joint in 1..5 {
        let nominal = model.arm.joints()[joint];
        let (n1, n2) = physics::frame::normals(nominal.axis);
        let target = nominal.point + (n1 + n2 * 0.5) * 0.35 + nominal.axis * 0.1;
        for (q, wrench_base) in (0..count).map(pose) {
            let observed = |wrench_base| {
                let inputs = Inputs { wrench_base, ..Inputs::at_rest(q) };
                model.evaluate(&inputs, &Memories::default()).real.body(joint).point(target)
            };
            let (before, after) = (observed(Wrench::ZERO), observed(wrench_base));
            cases.push(LoadedLink { joint, q, wrench_base, before, after });
        }
    }
    cases
}

fn vector(rng: &mut ChaCha8Rng, sigma: f64) -> DVec3 {
    let mut draw = || rng.sample::<f64, _>(StandardNormal) * sigma;
    DVec3::new(draw(), draw(), draw())
}

/// Fraction of intervals of ±1.96 sigma that contain the truth.
fn coverage(found: impl Fn(u64) -> Compliances) -> f64 {
    let (mut inside, mut all) = (0_u32, 0_u32);
    for seed in 0..400 {
        let found = found(seed);
        for (joint, stiffness) in (1..5).zip(THESIS) {
            let error = found.value[joint].expect("loaded") - 1.0 / stiffness;
            inside += u32::from(error.abs() < 1.96 * found.sigma(joint));
            all += 1;
        }
    }
    f64::from(inside) / f64::from(all)
}

#[test]
fn the_thesis_stiffness_comes_back_from_many_loads_at_once() {
    let found = estimate_simultaneously(&compliant().arm, &loaded_poses(&compliant(), 40), NOISE)
        .expect("sound");
    for (joint, wanted) in (1..5).zip(THESIS) {
        let (stiffness, _) = found.stiffness(joint).expect("determined");
        // The remaining error is of second order: the arm deflects by up to 20 mrad.
        assert!((stiffness / wanted - 1.0).abs() < 0.02, "joint {}: {stiffness}", joint + 1);
    }
    // Joints 1 and 6 are rigid here.
    assert!(
        found.value[0].expect("loaded").abs() < 1e-7
            && found.value[5].expect("loaded").abs() < 1e-5
    );
}

#[test]
fn what_else_is_wrong_with_the_robot_cancels_in_the_difference() {
    let found =
        estimate_simultaneously(&robot().arm, &loaded_poses(&robot(), 40), NOISE).expect("sound");
    for (joint, wanted) in (1..5).zip(THESIS) {
        let (stiffness, _) = found.stiffness(joint).expect("determined");
        assert!((stiffness / wanted - 1.0).abs() < 0.02, "joint {}: {stiffness}", joint + 1);
    }
}

#[test]
fn the_thesis_stiffness_comes_back_one_joint_after_the_other() {
    let model = compliant();
    let found =
        estimate_joint_by_joint(&model.arm, &loaded_links(&model, 12), 15e-6).expect("sound");
    for (joint, wanted) in (1..5).zip(THESIS) {
        let (stiffness, _) = found.stiffness(joint).expect("determined");
        assert!((stiffness / wanted - 1.0).abs() < 1e-3, "joint {}: {stiffness}", joint + 1);
    }
    assert_eq!(found.undetermined, [0, 5]);
}

/// Linear truth: deflections are computed to first order, so that only noise remains.
#[test]
fn intervals_from_many_loads_hold_the_truth_as_often_as_they_should() {
    let arm = robot().arm;
    let clean: Vec<LoadedPose> = (0..30)
        .map(pose)
        .map(|(q, wrench_base)| {
            let chain = Chain::nominal(&arm, &q);
            let torque = Loads::on(&arm, &chain, wrench_base).wrench_torque;
            let (mut shift, mut turn) = (DVec3::ZERO, DVec3::ZERO);
            for (joint, stiffness) in (1..5).zip(THESIS) {
                let by = chain.axis(joint) * (torque[joint] / stiffness);
                turn += by;
                shift += by.cross(chain.base_from_tool.origin - chain.point(joint));
            }
            LoadedPose { q, wrench_base, shift, turn: Some(turn) }
        })
        .collect();
    let share = coverage(|seed| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut poses = clean.clone();
        for pose in &mut poses {
            pose.shift += vector(&mut rng, NOISE.shift_m);
            pose.turn = pose.turn.map(|turn| turn + vector(&mut rng, NOISE.turn_rad));
        }
        let found = estimate_simultaneously(&arm, &poses, NOISE).expect("sound");
        assert!((found.normalised_rms - 1.0).abs() < 0.3, "{}", found.normalised_rms);
        found
    });
    assert!((0.93..0.97).contains(&share), "{share}");
}

#[test]
fn intervals_of_one_joint_after_the_other_carry_the_doubt_of_those_before() {
    let model = compliant();
    let (clean, sigma) = (loaded_links(&model, 8), 60e-6);
    let share = coverage(|seed| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut cases = clean.clone();
        for case in &mut cases {
            case.before += vector(&mut rng, sigma);
            case.after += vector(&mut rng, sigma);
        }
        estimate_joint_by_joint(&model.arm, &cases, sigma).expect("sound")
    });
    assert!((0.93..0.97).contains(&share), "{share}");
}

#[test]
fn a_joint_that_no_load_bends_is_named() {
    let model = compliant();
    let mut poses = loaded_poses(&model, 20);
    for pose in &mut poses {
        // A weight has no moment about joint 1, whose axis is vertical.
        pose.wrench_base = Wrench { force: DVec3::NEG_Z * 60.0, moment: DVec3::ZERO };
    }
    let found = estimate_simultaneously(&model.arm, &poses, NOISE).expect("sound");
    assert_eq!((found.undetermined[0], found.value[0], found.stiffness(0)), (0, None, None));
}

#[test]
fn what_cannot_be_is_refused() {
    let arm = robot().arm;
    let mut poses = loaded_poses(&compliant(), 3);
    poses[1].shift.y = f64::NAN;
    assert_eq!(
        estimate_simultaneously(&arm, &poses, NOISE),
        Err(StiffnessError::NotFinite { case: 2 })
    );
    let silent = DifferenceNoise { shift_m: 0.0, ..NOISE };
    assert_eq!(estimate_simultaneously(&arm, &[], silent), Err(StiffnessError::Noise));
    let mut cases = loaded_links(&compliant(), 1);
    cases[0].joint = 9;
    let wanted = StiffnessError::NotRevolute { case: 1, joint: 10 };
    assert_eq!(estimate_joint_by_joint(&arm, &cases, 1e-5), Err(wanted));
    let nothing = estimate_simultaneously(&arm, &[], NOISE).expect("nothing to object to");
    assert_eq!(nothing.undetermined, [0, 1, 2, 3, 4, 5]);
}

#[test]
fn a_global_fit_gets_values_and_priors() {
    let arm = robot().arm;
    let found =
        estimate_simultaneously(&arm, &loaded_poses(&compliant(), 40), NOISE).expect("sound");
    let given = [("compliance", &[1e-6][..])];
    let whole = AnyEffect::build("joint_compliance", &arm, Some(2), ParameterValues(&given))
        .expect("sound");
    let mut hypothesis = Hypothesis::fixed(Model::new(arm, &[whole]).expect("sound"));
    hypothesis.free_all(0, &[], &[]);
    found.transfer_to(&mut hypothesis).expect("room");
    assert_eq!(hypothesis.model.check(), Ok(()));
    assert_eq!(hypothesis.free.len(), 6);
    for free in &hypothesis.free {
        let effect = hypothesis.effect_of(free).expect("there");
        let joint = effect.joint().expect("of a joint");
        let kind = if joint == 2 { "joint_compliance" } else { "load_compliance" };
        assert_eq!(effect.spec().kind, kind);
        assert_eq!(Some(free.mean), found.value[joint]);
        assert_eq!(free.sigma, found.sigma(joint));
        assert_eq!(effect.values()[0], free.mean.max(0.0));
    }
}
