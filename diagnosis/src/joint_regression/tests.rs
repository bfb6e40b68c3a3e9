//! The formulas of the thesis (corrected) compared with the corresponding effects; its parameters, recovered from sweeps.

use super::*;
use crate::joint_error::JointErrors;
use crate::single_joint::{SagCorrection, Step, Sweep};
use physics::{Inputs, JOINTS_MAX, Joints};
use proptest::prelude::*;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;
use recording::model::presets::preset;

fn thesis() -> Model {
    preset("irb1600-6-145-thesis").expect("preset").model().expect("sound").physics
}

fn with_values(joint: usize, values: &[f64]) -> Hypothesis {
    let zero = thesis_model(&thesis().arm, joint).expect("the thesis' arm");
    assert_eq!(zero.free.len(), values.len());
    zero.stepped(values)
}

fn joint_error(model: &Model, joint: usize, q: [f64; 6]) -> f64 {
    let mut all: Joints = [0.0; JOINTS_MAX];
    all[..6].copy_from_slice(&q);
    model.evaluate(&Inputs::at_rest(all), &Memories::default()).deviation.joints[joint]
}

proptest! {
    #[test]
    fn the_formulas_put_right_are_the_effects(q in prop::array::uniform6(-1.5..1.5_f64), a in -1e-3..1e-3_f64, b in -2e-3..2e-3_f64, k in -5e-4..5e-4_f64) {
        let [_, t2, t3, t4, t5, _] = q;
        let t23 = t2 + t3;
        let cases: [(usize, Vec<f64>, f64); 5] = [
            (1, vec![a, b], a * t2.sin() + b * t23.cos()),
            (2, vec![b], b * t23.cos()),
            (3, vec![b, k], -b * t23.cos() * t4.sin() * t5.sin() + k * t4),
            (4, vec![b, k], b * (t23.cos() * t4.cos() * t5.cos() - t23.sin() * t5.sin()) + k * t5),
            (5, vec![k], k * q[5]),
        ];
        for (joint, values, wanted) in cases {
            let found = joint_error(&with_values(joint, &values).model, joint, q);
            prop_assert!((found - wanted).abs() < 1e-15, "joint {}: {found} not {wanted}", joint + 1);
        }
    }
}

/// Joint `joint` of the thesis' robot with `effects`, up and down within its limits and ±2.5 rad in 31 steps, measured with one target and noise
/// `sigma_m`.
fn errors(model: &Model, joint: usize, held: [f64; 6], sigma_m: f64, seed: u64) -> JointErrors {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut q: Joints = [0.0; JOINTS_MAX];
    q[..6].copy_from_slice(&held);
    let (low, high) = model.arm.joints()[joint].limits;
    let (from, to) = (low.max(-2.5), high.min(2.5));
    let up = (0..31).map(|i| (i, 1.0));
    let steps = up.chain((0..31).rev().map(|i| (i, -1.0))).map(|(i, direction)| {
        q[joint] = from + (to - from) * f64::from(i) / 30.0;
        let mut inputs = Inputs::at_rest(q);
        inputs.direction[joint] = direction;
        let tool = model.evaluate(&inputs, &Memories::default()).real.base_from_tool;
        let mut draw = || rng.sample::<f64, _>(StandardNormal) * sigma_m;
        let point = tool.point(DVec3::new(0.25, 0.1, 0.3)) + DVec3::new(draw(), draw(), draw());
        Step { inputs, targets: vec![Some(point)] }
    });
    let sweep = Sweep { joint, steps: steps.collect() };
    let found = sweep.axis(model, SagCorrection::AllOthers, None).expect("an arc");
    sweep.errors(model, &found, 0.0)
}

#[test]
fn the_thesis_figures_come_back_from_sweeps_as_surely_as_they_say() {
    let b = [0.012_f64, 0.06, 0.045, 0.08].map(f64::to_radians);
    let truth = [vec![2.5e-4, b[0]], vec![b[1]], vec![b[2], 1.8e-4], vec![b[3], 3.7e-4]];
    let kinds = ["gravity_sag", "joint_ratio"];
    let kept: Vec<AnyEffect> =
        thesis().effects().filter(|e| kinds.contains(&e.spec().kind)).copied().collect();
    let model = Model::new(thesis().arm, &kept).expect("sound");
    let held = [[0.0, 0.2, 0.1, 0.3, 0.9, 0.0], [0.0, -0.4, 0.5, -0.5, 1.2, 0.0]];
    let (mut inside, mut all) = (0_u32, 0_u32);
    for (joint, truth) in (1..5).zip(truth) {
        let start = thesis_model(&model.arm, joint).expect("the thesis' arm");
        let mut largest = 0.0_f64;
        for round in 0..150 {
            let sweeps = [(held[0], 2 * round), (held[1], 2 * round + 1)]
                .map(|(held, seed)| errors(&model, joint, held, 20e-6, seed));
            let found = regress(&start, &sweeps);
            assert_eq!(found.determined, vec![true; truth.len()], "joint {}", joint + 1);
            for (free, wanted) in found.hypothesis.free.iter().zip(&truth) {
                let ratio = (free.mean - wanted).abs() / free.sigma;
                largest = largest.max(ratio);
                inside += u32::from(ratio < 1.96);
                all += 1;
                if round == 0 {
                    println!(
                        "joint {}: {:.3e} ± {:.1e}, truth {wanted:.3e}",
                        joint + 1,
                        free.mean,
                        free.sigma
                    );
                }
            }
        }
        assert!(largest < 4.5, "joint {}: off by {largest} sigma", joint + 1);
    }
    let share = f64::from(inside) / f64::from(all);
    println!("95 % intervals cover {share}");
    assert!((0.92..0.975).contains(&share), "{share}");
}

#[test]
fn what_a_sweep_cannot_tell_stays_and_is_named() {
    let model = Model::nominal(thesis().arm);
    // With joint 5 straight, gravity has no lever arm about joint 4: its deflection is not observable.
    let sweeps = [errors(&model, 3, [0.0, 0.2, 0.1, 0.0, 0.0, 0.0], 20e-6, 1)];
    let start = thesis_model(&model.arm, 3).expect("the thesis' arm");
    let found = regress(&start, &sweeps);
    assert_eq!(found.determined, [false, true]);
    assert_eq!(found.hypothesis.free[0], start.free[0]);
}

#[test]
fn an_arm_of_too_few_joints_is_refused_or_has_less() {
    let arm = thesis().arm;
    let short = Arm::new(&arm.joints()[..2], arm.tool, arm.gravity).expect("sound");
    assert!(thesis_model(&short, 3).is_err());
}
