//! Recorded drive torques: the laws, their interactions, and their energy.

use super::effect;
use crate::effects::conformance::{scene, sliding_scene};
use crate::{AnyEffect, Arm, Inputs, JOINTS_MAX, Joints, Memories, Model, inverse_dynamics};
use std::f64::consts::TAU;

fn model(arm: &Arm, effects: &[AnyEffect]) -> Model {
    Model::new(*arm, effects).expect("effects that fit each other")
}

fn moving(q: f64, v: f64, a: f64) -> Inputs {
    let mut inputs = scene().inputs;
    (inputs.q[1], inputs.velocity[1], inputs.acceleration[1]) = (q, v, a);
    inputs
}

/// Contribution of effects of joint 2 to its recorded torque at rest and in motion.
fn added(effects: &[AnyEffect], inputs: &Inputs) -> f64 {
    let arm = scene().arm;
    let drive = model(&arm, effects).drive(inputs, &Memories::default());
    drive.recorded(1) - inverse_dynamics(&arm, inputs)[1]
}

fn of_two(kind: &str, given: &[(&str, &[f64])]) -> AnyEffect {
    effect(&scene().arm, kind, 1, given)
}

fn assert_near(found: f64, wanted: f64) {
    assert!((found - wanted).abs() < 1e-9 * wanted.abs().max(1.0), "{found} not {wanted}");
}

#[test]
fn an_arm_without_effects_records_its_inverse_dynamics() {
    for scene in [scene(), sliding_scene()] {
        let mut inputs = scene.inputs;
        inputs.velocity = std::array::from_fn(|i| 0.1 * i as f64 - 0.2);
        inputs.acceleration = std::array::from_fn(|i| 1.0 - 0.3 * i as f64);
        let drive = model(&scene.arm, &[]).drive(&inputs, &Memories::default());
        let wanted = inverse_dynamics(&scene.arm, &inputs);
        assert_eq!(std::array::from_fn(|i| drive.recorded(i)), wanted);
    }
}

#[test]
fn at_a_reversal_dry_friction_turns_by_twice_its_level_and_rests_at_nothing() {
    let dry = of_two("coulomb_friction", &[("level", &[20.4])]);
    assert_near(added(&[dry], &moving(0.1, 1e-9, 0.0)), 20.4);
    assert_near(added(&[dry], &moving(0.1, -1e-9, 0.0)), -20.4);
    assert_near(added(&[dry], &moving(0.1, 0.0, 3.0)), 0.0);
}

#[test]
fn friction_falls_from_its_level_at_rest_before_it_rises_with_speed() {
    let laws = [
        of_two("coulomb_friction", &[("level", &[10.0])]),
        of_two("stribeck_friction", &[("level", &[4.0]), ("stribeck_speed", &[0.05])]),
        of_two("viscous_friction", &[("coefficient", &[8.0])]),
    ];
    let friction_at = |v: f64| added(&laws, &moving(0.1, v, 0.0));
    assert_near(friction_at(1e-9), 14.0);
    assert_near(friction_at(0.05), 10.0 + 4.0 * f64::exp(-1.0) + 0.4);
    assert_near(friction_at(1.0), 18.0);
    assert_near(friction_at(-1.0), -18.0);
}

#[test]
fn warm_oil_lets_viscous_friction_fall_and_no_other() {
    let warm = of_two("friction_temperature", &[("per_K", &[0.03]), ("reference", &[25.0])]);
    let oil = of_two("viscous_friction", &[("coefficient", &[8.0])]);
    let dry = of_two("coulomb_friction", &[("level", &[10.0])]);
    let mut inputs = moving(0.1, 0.5, 0.0);
    inputs.joint_celsius[1] = 45.0;
    assert_near(added(&[oil, warm], &inputs), 4.0 * f64::exp(-0.6));
    assert_near(added(&[dry, warm], &inputs), 10.0);
    (inputs.joint_celsius[1], inputs.ambient_celsius) = (f64::NAN, f64::NAN);
    assert_near(added(&[oil, warm], &inputs), 4.0);
}

#[test]
fn load_friction_follows_what_gravity_and_motion_ask_of_the_gear() {
    let gear = of_two("load_friction", &[("coefficient", &[0.07])]);
    let mut inputs = moving(0.4, -0.2, 0.8);
    inputs.wrench_base = crate::Wrench::ZERO;
    let carried = inverse_dynamics(&scene().arm, &inputs)[1];
    assert_near(added(&[gear], &inputs), -0.07 * carried.abs());
}

#[test]
fn a_spring_hardens_from_where_it_rests() {
    let spring = of_two("spring", &[("stiffness", &[300.0]), ("rest_position", &[0.2])]);
    let hard = of_two("spring_hardening", &[("cubic_stiffness", &[5e3])]);
    assert_near(added(&[hard, spring], &moving(0.5, 0.0, 0.0)), 300.0 * 0.3 + 5e3 * 0.027);
    assert_near(added(&[hard], &moving(0.5, 0.0, 0.0)), 5e3 * 0.125);
}

#[test]
fn the_gain_of_a_drive_scales_all_that_acts() {
    let dry = of_two("coulomb_friction", &[("level", &[10.0])]);
    let gain = of_two("drive_gain", &[("gain", &[-0.08])]);
    let inputs = moving(0.3, 0.2, 1.0);
    let acts = inverse_dynamics(&scene().arm, &inputs)[1] + 10.0;
    assert_near(added(&[gain, dry], &inputs), 0.92 * acts - (acts - 10.0));
}

#[test]
fn an_unknown_first_moment_is_what_a_mass_there_weighs_less_the_mass() {
    let arm = scene().arm;
    let point = |z: f64| glam::DVec3::new(0.7, 0.1, 1.0 + z);
    // Two masses, one of them negative, make a first moment without mass.
    let (plus, minus) = (point(0.25), point(-0.15));
    let moment = (plus - minus) * 3.0;
    let heavy = |mass: f64, com: glam::DVec3| {
        effect(&arm, "payload", None, &[("mass", &[mass]), ("com", &com.to_array())])
    };
    let unknown = effect(&arm, "gravity_torque", 5, &[("first_moment", &moment.to_array())]);
    let inputs = scene().inputs;
    let torques = |effects: &[AnyEffect]| {
        let drive = model(&arm, effects).drive(&inputs, &Memories::default());
        std::array::from_fn::<f64, 6, _>(|i| drive.recorded(i))
    };
    let (without, one, other) =
        (torques(&[]), torques(&[heavy(3.0, plus)]), torques(&[heavy(3.0, minus)]));
    for (i, found) in torques(&[unknown]).into_iter().enumerate() {
        assert_near(found - without[i], one[i] - other[i]);
    }
}

/// Around a closed path friction dissipates `4 F A` (dry), `π F ω A²` (viscous); a hysteresis
/// nearly `2 h A`; elastic terms dissipate nothing.
#[test]
fn round_a_closed_path_friction_takes_its_energy_and_springs_take_none() {
    let (amplitude, omega, steps) = (0.3, 2.0, 20_000);
    let work = |effects: &[AnyEffect]| {
        let model = model(&scene().arm, effects);
        let mut memories = Memories::default();
        let mut inputs = moving(amplitude, 0.0, 0.0);
        inputs.direction[1] = 1.0;
        model.settle(&inputs, &mut memories);
        let mut sum = 0.0;
        for k in 0..steps {
            let phase = TAU * (f64::from(k) + 0.5) / f64::from(steps);
            inputs.q_before = inputs.q;
            inputs.q[1] = amplitude * phase.cos();
            inputs.velocity[1] = -amplitude * omega * phase.sin();
            model.advance(&inputs, &mut memories);
            let drive = model.drive(&inputs, &memories);
            let torque = drive.recorded(1) - drive.rigid[1];
            sum += torque * inputs.velocity[1] * TAU / omega / f64::from(steps);
        }
        sum
    };
    let share = |found: f64, wanted: f64| {
        assert!((found / wanted - 1.0).abs() < 1e-3, "{found} not {wanted}");
    };
    share(work(&[of_two("coulomb_friction", &[("level", &[20.0])])]), 4.0 * 20.0 * amplitude);
    let oil = of_two("viscous_friction", &[("coefficient", &[8.0])]);
    share(work(&[oil]), TAU / 2.0 * 8.0 * omega * amplitude * amplitude);
    let brush = of_two("hysteresis", &[("amplitude_N", &[12.0]), ("reversal", &[0.01])]);
    // After each reversal z is still behind by `h e^(−x/s)`.
    share(work(&[brush]), 2.0 * 12.0 * amplitude - 2.0 * 12.0 * 0.01);
    let elastic = [
        of_two("spring", &[("stiffness", &[300.0]), ("rest_position", &[0.2])]),
        of_two("spring_hardening", &[("cubic_stiffness", &[5e3])]),
        of_two("torque_ripple", &[("amplitude", &[3.0]), ("cycles", &[7.0]), ("phase", &[0.4])]),
        of_two("gravity_torque", &[("cos", &[30.0]), ("sin", &[-4.0])]),
    ];
    assert!(work(&elastic).abs() < 1e-6, "{}", work(&elastic));
}

#[test]
fn slopes_of_what_is_recorded_are_its_differences_whatever_else_acts() {
    let arm = scene().arm;
    let effects = [
        of_two("coulomb_friction", &[("level", &[10.0])]),
        of_two("viscous_friction", &[("coefficient", &[8.0])]),
        of_two("friction_temperature", &[("per_K", &[0.03])]),
        of_two("stribeck_friction", &[("level", &[4.0]), ("stribeck_speed", &[0.5])]),
        of_two("load_friction", &[("coefficient", &[0.07])]),
        of_two("spring", &[("stiffness", &[300.0]), ("rest_position", &[0.2])]),
        of_two("spring_hardening", &[("cubic_stiffness", &[5e3])]),
        of_two("hysteresis", &[("amplitude_N", &[12.0]), ("reversal", &[0.01])]),
        of_two("drive_gain", &[("gain", &[0.05])]),
        effect(&arm, "gravity_torque", 3, &[("first_moment", &[1.0, -0.4, 0.3])]),
        effect(&arm, "payload", None, &[("mass", &[2.8]), ("com", &[0.9, 0.1, 1.2])]),
        effect(&arm, "gravity_tilt", None, &[("tilt", &[2e-3, -1e-3])]),
        effect(&arm, "joint_offset", 1, &[("offset", &[1e-3])]),
    ];
    let whole = model(&arm, &effects);
    let mut inputs = moving(0.3, 0.4, -0.9);
    inputs.velocity[2] = -0.7;
    inputs.direction[1] = 1.0;
    let mut memories = Memories::default();
    whole.settle(&inputs, &mut memories);
    let wanted: Vec<(usize, usize)> = (0..effects.len())
        .flat_map(|index| (0..effects[index].values().len()).map(move |value| (index, value)))
        .collect();
    let mut visited = 0;
    whole.drive_slopes(&inputs, &memories, &wanted, |place, slopes| {
        let (index, value) = wanted[place];
        let beside = |sign: f64| -> Joints {
            let mut changed = whole;
            let size = 1e-4 * effects[index].values()[value].abs().max(1e-2);
            changed
                .change(index, |effect| effect.values_mut()[value] += sign * size)
                .expect("there");
            let drive = changed.drive(&inputs, &memories);
            std::array::from_fn(|i| drive.recorded(i) / (2.0 * size))
        };
        let (above, below) = (beside(1.0), beside(-1.0));
        for i in 0..JOINTS_MAX {
            let difference = above[i] - below[i];
            let error = 1e-5 * slopes[i].abs().max(difference.abs()) + 1e-6;
            let kind = effects[index].spec().kind;
            assert!(
                (slopes[i] - difference).abs() < error,
                "{kind} {value}, joint {i}: {} {difference}",
                slopes[i]
            );
        }
        visited += 1;
    });
    assert_eq!(visited, wanted.len());
}
