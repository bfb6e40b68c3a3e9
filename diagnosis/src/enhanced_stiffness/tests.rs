//! Closed forms compared with finite differences, symmetry where expected, and the equilibrium of which they are the tangent.

use super::*;
use physics::Inputs;
use proptest::prelude::*;
use recording::model::presets::preset;

fn arm(name: &str) -> Arm {
    preset(name).expect("preset").model().expect("sound").physics.arm
}

/// An arm with one prismatic joint.
fn sliding(arm: &Arm, joint: usize) -> Arm {
    let mut joints = arm.joints().to_vec();
    joints[joint].kind = JointKind::Prismatic;
    Arm::new(&joints, arm.tool, arm.gravity).expect("sound")
}

fn all(q: &[f64]) -> Joints {
    let mut joints = [0.0; JOINTS_MAX];
    joints[..q.len()].copy_from_slice(q);
    joints
}

/// Compliances of the thesis for joints 2 to 5; joint 1 as joint 2, joint 6 as joint 5.
fn thesis_compliance() -> Joints {
    all(&[451.5, 451.5, 90.3, 9.13, 3.05, 3.05].map(|k| 1.0 / (k * 1e3)))
}

fn wrench(f: [f64; 3], m: [f64; 3]) -> Wrench {
    Wrench { force: DVec3::from_array(f) * 1e3, moment: DVec3::from_array(m) * 50.0 }
}

fn differences(
    arm: &Arm,
    q: &Joints,
    torques: impl Fn(&Loads) -> Joints,
    wrench: Wrench,
) -> JointMatrix {
    let h = 1e-5;
    let torque =
        |q: &Joints| SVector::from(torques(&Loads::on(arm, &Chain::nominal(arm, q), wrench)));
    let mut found = JointMatrix::zeros();
    for j in 0..arm.count() {
        let (mut up, mut down) = (*q, *q);
        up[j] += h;
        down[j] -= h;
        found.set_column(j, &((torque(&up) - torque(&down)) / (2.0 * h)));
    }
    found
}

fn three() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-1.0..1.0_f64)
}

proptest! {
    #[test]
    fn both_closed_forms_are_the_derivatives_of_the_loads(
        q in prop::array::uniform7(-1.5..1.5_f64), f in three(), m in three(), slides in 0..6_usize,
    ) {
        let thesis = arm("irb1600-6-145-thesis");
        for (arm, count) in [(arm("fr3"), 7), (sliding(&thesis, slides), 6), (thesis, 6)] {
            let (q, wrench) = (all(&q[..count]), wrench(f, m));
            let chain = Chain::nominal(&arm, &q);
            let by_wrench = wrench_stiffness(&arm, &chain, &wrench);
            let wanted = differences(&arm, &q, |loads| loads.wrench_torque, wrench);
            prop_assert!((by_wrench - wanted).amax() <= 1e-6 * (1.0 + wanted.amax()), "{}", (by_wrench - wanted).amax());
            let by_gravity = gravity_stiffness(&arm, &chain);
            let wanted = differences(&arm, &q, |loads| loads.gravity_torque, wrench);
            prop_assert!((by_gravity - wanted).amax() <= 1e-6 * (1.0 + wanted.amax()));
            prop_assert!((by_gravity - by_gravity.transpose()).amax() < 1e-12);
        }
    }

    #[test]
    fn a_force_leaves_the_stiffness_symmetric_and_a_moment_does_not(q in prop::array::uniform6(0.3..1.2_f64), f in three()) {
        let arm = arm("irb1600-6-145-thesis");
        let chain = Chain::nominal(&arm, &all(&q));
        let asymmetry = |wrench: Wrench| {
            let k = wrench_stiffness(&arm, &chain, &wrench);
            (k - k.transpose()).amax()
        };
        prop_assert!(asymmetry(wrench(f, [0.0; 3])) < 1e-10);
        // The skew-symmetric part is (z_j × z_i)·M for joints j before i.
        let moment = chain.axis(0).cross(chain.axis(4)) * 14.0;
        let measured = asymmetry(Wrench { force: DVec3::from_array(f) * 1e3, moment });
        prop_assert!(measured >= moment.dot(chain.axis(0).cross(chain.axis(4))) - 1e-9, "{measured}");
    }
}

#[test]
fn the_tangent_is_the_one_of_the_bent_arm() {
    let (arm, compliance) = (arm("irb1600-6-145-thesis"), thesis_compliance());
    let c = JointMatrix::from_diagonal(&SVector::from(compliance));
    let (mut with_enhanced, mut without) = (0.0, 0.0);
    for i in 1..200 {
        let wave = |k: f64| (f64::from(i) * k).sin();
        let q = all(&[1.1, 1.7, 2.3, 2.9, 3.7, 4.3].map(|k| 1.2 * wave(k)));
        let wrench = wrench([5.1, 5.9, 6.7].map(wave), [7.1, 7.9, 8.3].map(wave)).times(0.2);
        let torque = |q: &Joints| {
            SVector::from(Loads::on(&arm, &Chain::nominal(&arm, q), wrench).wrench_torque)
        };
        let mut bent = SVector::zeros();
        for _ in 0..60 {
            let deflected: Joints = std::array::from_fn(|i| q[i] + bent[i]);
            bent = c * torque(&deflected);
        }
        let softening = wrench_stiffness(&arm, &Chain::nominal(&arm, &q), &wrench);
        let inverse = joint_compliance(&compliance, &softening).expect("far from buckling");
        with_enhanced += (bent - inverse * torque(&q)).norm();
        without += (bent - c * torque(&q)).norm();
    }
    println!(
        "off by {:.1e} rad with K_C, {:.1e} rad without, in the mean",
        with_enhanced / 199.0,
        without / 199.0
    );
    assert!(with_enhanced < 0.1 * without, "{with_enhanced} against {without}");
}

#[test]
fn under_a_cutting_force_it_is_worth_less_than_a_tracker_sees() {
    let (arm, compliance) = (arm("irb1600-6-145-thesis"), thesis_compliance());
    let turn = |i: u32, k: f64| (f64::from(i) * k).sin();
    let poses: Vec<Inputs> = (1..=500)
        .map(|i| {
            let q = [1.1, 1.7, 2.3, 2.9, 3.7, 4.3].map(|k| 1.2 * turn(i, k));
            let force = DVec3::new(turn(i, 5.1), turn(i, 5.9), turn(i, 6.7)).normalize() * 100.0;
            Inputs {
                wrench_base: Wrench { force, moment: DVec3::ZERO },
                ..Inputs::at_rest(all(&q))
            }
        })
        .collect();
    let effects: Vec<EnhancedEffect> = poses
        .iter()
        .map(|p| {
            enhanced_effect(&arm, &p.q, p.wrench_base, &compliance).expect("far from buckling")
        })
        .collect();
    let median = |quantity: fn(&EnhancedEffect) -> f64| {
        let mut all: Vec<f64> = effects.iter().map(quantity).collect();
        all.sort_by(f64::total_cmp);
        (all[250] * 1e6, all[499] * 1e6)
    };
    let (moved, by_wrench, by_gravity) =
        (median(|e| e.deflection_m), median(|e| e.by_wrench_m), median(|e| e.by_gravity_m));
    println!(
        "100 N, median and largest in µm: moved {moved:?}, K_C {by_wrench:?}, K_G {by_gravity:?}"
    );
    assert!(by_wrench.1 < 10.0 && by_wrench.0 < 1.0 && moved.0 > 50.0);
}
